//! The frames of one video, by way of the programs `ffprobe` and `ffmpeg`.

use super::log;
use super::log::DecoderLog;
use std::ffi::OsString;
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use svl_core::stereo::{Gray, MAX_SIDE};
use svl_core::{Error, Result, inputs};
use svl_files::{DecodedImage, SideBySide, ffmpeg};

/// Options for an input: the times of an AVI are those of its index, which has damaged frames too.
const BY_INDEX: [&str; 2] = ["-fflags", "+sortdts"];

/// Words of an ffprobe that is too old, whatever the file is.
const UNKNOWN_OPTION: [&str; 3] = [
    "No match for section",
    "Unrecognized option",
    "Option not found",
];

/// Limit of ffprobe's output: a line for each frame of some days.
const MAX_PROBE_BYTES: u64 = 1 << 30;

/// Facts of a video before its frames.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct VideoInfo {
    pub size: (usize, usize),
    pub is_grey: bool,
    /// Degrees by which its frames are turned.
    pub rotation: i32,
    /// The places of left and right in its frames, if its header names them.
    pub places: Option<SideBySide>,
    /// Frames per second.
    pub rate_hz: Option<f64>,
    /// Median time between frames, nanoseconds; that of the rate if the file has no times.
    pub period_ns: Option<u64>,
    /// Time of the last frame, nanoseconds, if the file has times.
    pub last_ns: Option<i64>,
    /// Number of frames by its header.
    pub frames: Option<u64>,
}

#[derive(serde::Deserialize)]
struct Probe {
    #[serde(default)]
    streams: Vec<ProbeStream>,
    #[serde(default)]
    packets: Vec<ProbePacket>,
    #[serde(default)]
    format: ProbeFormat,
}

#[derive(serde::Deserialize)]
struct ProbeStream {
    width: Option<usize>,
    height: Option<usize>,
    pix_fmt: Option<String>,
    avg_frame_rate: Option<String>,
    nb_frames: Option<String>,
    #[serde(default)]
    side_data_list: Vec<ProbeSideData>,
}

#[derive(Default, serde::Deserialize)]
struct ProbeSideData {
    rotation: Option<f64>,
    /// Kind of a stereo video, and 1 if the left image is the second.
    #[serde(rename = "type")]
    kind: Option<String>,
    inverted: Option<u8>,
}

impl ProbeSideData {
    fn places(&self) -> Option<SideBySide> {
        // ffprobe 6 has blanks between the words.
        let kind = self.kind.as_ref()?.replace(' ', "");
        let places = match &*kind {
            "sidebyside" => [SideBySide::LeftRight, SideBySide::RightLeft],
            "topandbottom" => [SideBySide::TopBottom, SideBySide::BottomTop],
            _ => return None,
        };
        Some(places[usize::from(self.inverted == Some(1))])
    }
}

#[derive(serde::Deserialize)]
struct ProbePacket {
    pts_time: Option<String>,
}

#[derive(Default, serde::Deserialize)]
struct ProbeFormat {
    duration: Option<String>,
}

impl VideoInfo {
    /// # Errors
    /// [`Error::Io`]; [`Error::Program`] if ffprobe is missing; [`Error::Format`] for a file that
    /// it cannot read.
    fn read(path: &Path) -> Result<Self> {
        let entries = "stream=width,height,pix_fmt,avg_frame_rate,nb_frames:\
                       stream_side_data=rotation,type,inverted:packet=pts_time:format=duration";
        // Another program opens it.
        inputs::register(path);
        let mut command = Command::new("ffprobe");
        command
            .args(["-v", "error", "-select_streams", "v:0", "-of", "json"])
            .args(["-show_entries", entries])
            .args(BY_INDEX)
            .arg(named(path));
        let (mut child, mut said) = ffmpeg::start("ffprobe", command.stdin(Stdio::null()))?;
        let mut json = Vec::new();
        let out = child.stdout.take().into_iter();
        for out in out {
            let read = out.take(MAX_PROBE_BYTES).read_to_end(&mut json);
            read.map_err(|e| Error::io(path, e))?;
        }
        let _ = child.wait();
        let wrong = |reason: String| Error::format(path, reason);
        let mut unread = || match ffmpeg::last_line(&mut said) {
            Some(line) if UNKNOWN_OPTION.iter().any(|word| line.contains(word)) => Error::Program {
                command: "ffprobe".to_owned(),
                reason: "does not know an option that svl needs: install a newer ffmpeg".to_owned(),
                stderr: line,
            },
            Some(line) => wrong(format!("ffprobe cannot read it as a video: {line}")),
            None => wrong("contains no video".to_owned()),
        };
        let probe: Probe = serde_json::from_slice(&json).map_err(|_| unread())?;
        Self::new(probe).map_err(wrong)?.ok_or_else(unread)
    }

    fn new(probe: Probe) -> std::result::Result<Option<Self>, String> {
        let Some(stream) = probe.streams.into_iter().next() else {
            return Ok(None);
        };
        let (Some(mut width), Some(mut height)) = (stream.width, stream.height) else {
            return Ok(None);
        };
        let rotation = stream.side_data_list.iter().find_map(|data| data.rotation);
        let rotation = rotation.map_or(0, |degrees| degrees.round() as i32);
        if rotation % 180 != 0 && rotation % 90 == 0 {
            (width, height) = (height, width);
        }
        if !(1..=MAX_SIDE).contains(&width) || !(1..=MAX_SIDE).contains(&height) {
            return Err(format!(
                "has frames of {width}x{height} pixels, svl accepts {MAX_SIDE}"
            ));
        }
        let rate_hz = stream.avg_frame_rate.and_then(|rate| {
            let (frames, seconds) = rate.split_once('/')?;
            let hz = frames.parse::<f64>().ok()? / seconds.parse::<f64>().ok()?;
            (hz.is_finite() && hz > 0.0).then_some(hz)
        });
        // In the order of decoding; shown they are in that of their times.
        let ns = |packet: &ProbePacket| {
            let seconds: f64 = packet.pts_time.as_ref()?.parse().ok()?;
            Some((seconds * 1e9).round() as i64)
        };
        let times: Option<Vec<i64>> = probe.packets.iter().map(ns).collect();
        let mut times = times.unwrap_or_default();
        times.sort_unstable();
        let gaps = times.windows(2).map(|ends| ends[1].abs_diff(ends[0]));
        let mut gaps: Vec<_> = gaps.filter(|gap| *gap > 0).collect();
        gaps.sort_unstable();
        let by_rate = rate_hz.map(|hz| (1e9 / hz) as u64);
        let duration = probe
            .format
            .duration
            .and_then(|text| text.parse::<f64>().ok());
        // A duration may count from zero, though the first frame is later.
        let start = times.first().map_or(0.0, |ns| *ns as f64 / 1e9).max(0.0);
        let by_duration = duration
            .zip(rate_hz)
            .map(|(s, hz)| ((s - start) * hz).round() as u64);
        let listed = probe.packets.len() as u64;
        let frames = match stream.nb_frames.and_then(|text| text.parse().ok()) {
            Some(frames) => Some(frames),
            // A duration ends anywhere in the last frame: one more or less is no loss.
            None => by_duration
                .filter(|frames| *frames > listed + 1)
                .or(Some(listed)),
        };
        Ok(Some(Self {
            size: (width, height),
            rotation,
            places: stream.side_data_list.iter().find_map(ProbeSideData::places),
            is_grey: stream
                .pix_fmt
                .is_some_and(|format| format.starts_with("gray")),
            rate_hz,
            period_ns: gaps.get(gaps.len() / 2).copied().or(by_rate),
            last_ns: times.last().copied(),
            frames: frames.filter(|frames| *frames > 0),
        }))
    }
}

/// A frame of a video, and its time in nanoseconds, if it has one.
pub(crate) type TimedImage = (Option<i64>, DecodedImage);

/// A video that is being decoded.
pub(crate) struct VideoStream {
    pub path: PathBuf,
    pub info: VideoInfo,
    /// The time of its first frame.
    pub first_ns: Option<i64>,
    /// Frames decoded.
    pub got: u64,
    pub has_ended: bool,
    decoder: Child,
    log: DecoderLog,
    bytes: Vec<u8>,
    /// The first frame, read when the video was opened.
    first: Option<TimedImage>,
}

impl VideoStream {
    /// A video whose frames are turned as the file says.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Program`] where ffmpeg is missing; [`Error::Format`] for what it
    /// cannot read, or that has no frame.
    pub(crate) fn open(path: &Path) -> Result<Self> {
        std::fs::metadata(path).map_err(|e| Error::io(path, e))?;
        let info = VideoInfo::read(path)?;
        if info.rotation != 0 {
            let degrees = info.rotation;
            tracing::warn!("{}: is turned by {degrees}°, as it says", path.display());
        }
        Self::start(path, info, &[])
    }

    /// The same video from its begin, in grey, shrunk to a size.
    ///
    /// # Errors
    /// The errors of [`VideoStream::open`].
    pub(crate) fn again(&self, size: (usize, usize)) -> Result<Self> {
        let info = VideoInfo {
            size,
            is_grey: true,
            ..self.info.clone()
        };
        let shrink = ["-s".to_owned(), format!("{}x{}", size.0, size.1)];
        Self::start(&self.path, info, &shrink)
    }

    fn start(path: &Path, info: VideoInfo, shrink: &[String]) -> Result<Self> {
        let (width, height) = info.size;
        let (pixels, bytes) = if info.is_grey {
            ("gray", 1)
        } else {
            ("rgb24", 3)
        };
        let mut command = Command::new("ffmpeg");
        command
            .arg("-nostdin")
            .args(BY_INDEX)
            .arg("-i")
            .arg(named(path))
            // Each frame once, and the same bytes on every machine.
            .args(["-map", "0:v:0"])
            .args(shrink)
            .args(log::TIMES)
            .args(ffmpeg::SCALER)
            .args(["-f", "rawvideo", "-pix_fmt", pixels, "pipe:1"]);
        let (decoder, said) = ffmpeg::start("ffmpeg", command.stdin(Stdio::null()))?;
        let mut stream = Self {
            path: path.to_owned(),
            info,
            first_ns: None,
            got: 0,
            has_ended: false,
            decoder,
            log: DecoderLog::new(said),
            bytes: vec![0; width * height * bytes],
            first: None,
        };
        stream.first = stream.decode()?;
        stream.first_ns = stream.first.as_ref().and_then(|(time_ns, _)| *time_ns);
        Ok(stream)
    }

    /// The next frame; none at the end, also of one that is cut off.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn next(&mut self) -> Result<Option<TimedImage>> {
        match self.first.take() {
            Some(first) => Ok(Some(first)),
            None => self.decode(),
        }
    }

    fn decode(&mut self) -> Result<Option<TimedImage>> {
        let Some(out) = self.decoder.stdout.as_mut().filter(|_| !self.has_ended) else {
            return Ok(None);
        };
        match out.read_exact(&mut self.bytes) {
            Ok(()) => {}
            Err(e) if e.kind() == ErrorKind::UnexpectedEof => {
                self.has_ended = true;
                let _ = self.decoder.wait();
                let said = self.log.last_error().map(|line| format!("ffmpeg: {line}"));
                if self.got == 0 {
                    let said = said.map_or_else(String::new, |said| format!("; {said}"));
                    let reason = format!("gives no frame that can be read{said}");
                    return Err(Error::format(&self.path, reason));
                }
                if let Some(said) = said {
                    tracing::warn!("{}: {said}", self.path.display());
                }
                return Ok(None);
            }
            Err(e) => return Err(Error::io(&self.path, e)),
        }
        self.got += 1;
        let (width, height) = self.info.size;
        let image = if self.info.is_grey {
            Gray::from_vec(width, height, self.bytes.clone()).map(DecodedImage::Gray)
        } else {
            DecodedImage::from_rgb(width, height, &self.bytes)
        };
        let time_ns = self.log.next_ns();
        image.map(|image| Some((time_ns, image)))
    }

    /// Number of its declared frames that were not decoded, once it has ended.
    pub(crate) fn missing(&self) -> u64 {
        let frames = self.info.frames.unwrap_or(0);
        if self.has_ended {
            frames.saturating_sub(self.got)
        } else {
            0
        }
    }
}

impl Drop for VideoStream {
    fn drop(&mut self) {
        // The decoder's frames are no longer needed; it may have ended already.
        let _ = self.decoder.kill();
        let _ = self.decoder.wait();
    }
}

/// The argument that makes a file of any name, whatever it looks like.
fn named(path: &Path) -> OsString {
    let mut name = OsString::from("file:");
    name.push(path);
    name
}

#[cfg(test)]
mod tests {
    use super::*;

    fn info(json: &str) -> std::result::Result<Option<VideoInfo>, String> {
        VideoInfo::new(serde_json::from_str(json).unwrap())
    }

    #[test]
    fn output_of_ffprobe_is_parsed() {
        let stream = r#""width":4,"height":2,"pix_fmt":"gray","avg_frame_rate":"30000/1001""#;
        let packets = r#""packets":[{"pts_time":"1.1"},{"pts_time":"1.3"},{"pts_time":"1.2"}]"#;
        let found = info(&format!(
            r#"{{"streams":[{{{stream},"nb_frames":"9"}}],{packets}}}"#
        ));
        let found = found.unwrap().unwrap();
        assert_eq!(
            (found.size, found.is_grey, found.frames),
            ((4, 2), true, Some(9))
        );
        assert_eq!(
            (found.period_ns, found.last_ns),
            (Some(100_000_000), Some(1_300_000_000))
        );
        assert!((found.rate_hz.unwrap() - 29.97).abs() < 0.001);
        // Without a count the duration tells, but for a part of a frame.
        for (duration, frames) in [("1.2", 3), ("1.234", 3), ("1.6", 15)] {
            let format = format!(r#""format":{{"duration":"{duration}"}}"#);
            let json = format!(r#"{{"streams":[{{{stream}}}],{packets},{format}}}"#);
            assert_eq!(
                info(&json).unwrap().unwrap().frames,
                Some(frames),
                "{duration}"
            );
        }
        assert_eq!(info("{}"), Ok(None));
        let huge = info(r#"{"streams":[{"width":99999,"height":2}]}"#);
        assert!(huge.unwrap_err().contains("99999x2"));
        for (kind, inverted, places) in [
            ("side by side", 0, Some(SideBySide::LeftRight)),
            ("sidebyside", 1, Some(SideBySide::RightLeft)),
            ("top and bottom", 1, Some(SideBySide::BottomTop)),
            ("2D", 0, None),
        ] {
            let data = format!(r#"{{"type":"{kind}","inverted":{inverted}}}"#);
            let json = format!(r#"{{"streams":[{{{stream},"side_data_list":[{{}},{data}]}}]}}"#);
            assert_eq!(info(&json).unwrap().unwrap().places, places, "{kind}");
        }
        let odd = info(
            r#"{"streams":[{"width":4,"height":2,"avg_frame_rate":"0/0"}],
            "packets":[{}]}"#,
        );
        let odd = odd.unwrap().unwrap();
        assert_eq!(
            (odd.rate_hz, odd.period_ns, odd.frames),
            (None, None, Some(1))
        );
    }
}
