//! The log of a decoder: a line with the time of each frame, and its errors.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};

/// Options of ffmpeg that keep each frame and the times of the file, and log one for each frame.
/// The output gets times of its own, one at each step of its rate: so every version from 4.2 to 9.0
/// neither drops nor repeats a frame, whatever its option for that is called.
pub(crate) const TIMES: [&str; 9] = [
    "-v",
    // Each line with its level, also of one as the line before.
    "repeat+level+info",
    "-nostats",
    "-hide_banner",
    "-copyts",
    "-r",
    "1/100",
    "-vf",
    "settb=1/1000000000,showinfo=checksum=0,setpts=N*100000000000",
];

/// Longest part of a line that is read at once.
const MAX_LINE: u64 = 4096;

/// The log of a decoder that still writes it.
pub(crate) struct DecoderLog {
    file: BufReader<File>,
    /// The line of which the end is not written yet.
    line: Vec<u8>,
    last_error: Option<String>,
}

impl DecoderLog {
    pub(crate) fn new(file: File) -> Self {
        Self {
            file: BufReader::new(file),
            line: Vec::new(),
            last_error: None,
        }
    }

    /// The time of the next frame, nanoseconds; none if the file has none. A frame is logged before
    /// it is written, so it is here once the frame is.
    pub(crate) fn next_ns(&mut self) -> Option<i64> {
        while let Some(line) = self.line() {
            if let Some(time) = frame_time(&line) {
                return time.parse().ok();
            }
        }
        None
    }

    /// The last error of a decoder that has ended.
    pub(crate) fn last_error(&mut self) -> Option<String> {
        while self.line().is_some() {}
        self.last_error.take()
    }

    /// The next line that is written in full; one without an end counts at its limit.
    fn line(&mut self) -> Option<String> {
        let room = MAX_LINE.saturating_sub(self.line.len() as u64);
        let mut rest = self.file.by_ref().take(room);
        rest.read_until(b'\n', &mut self.line).ok()?;
        if !self.line.ends_with(b"\n") && (self.line.len() as u64) < MAX_LINE {
            return None;
        }
        let line = String::from_utf8_lossy(&self.line).into_owned();
        self.line.clear();
        for level in ["[error] ", "[fatal] "] {
            if let Some((_, error)) = line.split_once(level) {
                self.last_error = Some(error.trim().to_owned());
            }
        }
        Some(line)
    }
}

/// The time in the line of a frame, in words.
fn frame_time(line: &str) -> Option<&str> {
    let frame = line.strip_prefix("[Parsed_showinfo_")?;
    let (_, times) = frame.split_once("] n:")?.1.split_once(" pts:")?;
    Some(times.split_once(" pts_time:")?.0.trim())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn a_growing_log_gives_times_and_errors() {
        let written = tempfile::NamedTempFile::new().unwrap();
        let mut log = DecoderLog::new(written.reopen().unwrap());
        let write = |text: &str| written.as_file().write_all(text.as_bytes()).unwrap();
        assert_eq!(log.next_ns(), None);
        write("[info]   title : frame:0 pts:7 pts_time:7\n[mjpeg @ 0x5] [error] bad da");
        assert_eq!((log.next_ns(), log.last_error()), (None, None));
        write("ta\n[Parsed_showinfo_1 @ 0x5] [info] n:   0 pts:-40000000 pts_time:-0.04 pos: 5\n");
        write("[Parsed_showinfo_1 @ 0x5] [info] color_range:pc\n");
        write(&format!("[info] {}\n", "long ".repeat(10_000)));
        write("[Parsed_showinfo_1 @ 0x5] [info] n:   1 pts:NOPTS pts_time:NOPTS pos: 6\n");
        write("[Parsed_showinfo_1 @ 0x5] [info] n:   2 pts: 40000000 pts_time:0.04\n");
        let times: Vec<_> = (0..4).map(|_| log.next_ns()).collect();
        assert_eq!(times, [Some(-40_000_000), None, Some(40_000_000), None]);
        assert_eq!(log.last_error().unwrap(), "bad data");
    }
}
