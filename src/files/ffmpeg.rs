//! The programs of ffmpeg as children: how they start, and what they say.

use std::fs::File;
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::process::{Child, Command, Stdio};
use svl_core::{Error, Result};

/// Options of a conversion to grey or RGB with the same bytes on every machine.
pub const SCALER: [&str; 2] = [
    "-sws_flags",
    "bicubic+accurate_rnd+full_chroma_int+bitexact",
];

/// Largest part of a program's standard error that is read, from its end.
const MAX_SAID: u64 = 4096;

/// Starts a program of ffmpeg with its standard output as a pipe. Its standard error goes to a
/// file, so that it never waits for a reader; the file returned has a position of its own, so that
/// it can be read while the program writes.
///
/// # Errors
/// [`Error::Program`] where it is missing; [`Error::Io`] without a temporary file.
pub fn start(program: &'static str, command: &mut Command) -> Result<(Child, File)> {
    let temporary = |e| Error::io(std::env::temp_dir(), e);
    // The name of the file ends with this function, the file with its last user.
    let stderr = tempfile::NamedTempFile::new().map_err(temporary)?;
    let said = stderr.reopen().map_err(temporary)?;
    let stderr = stderr.as_file().try_clone().map_err(temporary)?;
    command.stdout(Stdio::piped()).stderr(stderr);
    // Ctrl-C is for svl, which ends the run in order, and the program with it.
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(command, 0);
    let child = command.spawn().map_err(|e| Error::Program {
        command: program.to_owned(),
        reason: match e.kind() {
            ErrorKind::NotFound => "reads videos and is not installed; `apt install ffmpeg`, or \
                                    https://ffmpeg.org"
                .to_owned(),
            _ => format!("cannot be started: {e}"),
        },
        stderr: String::new(),
    })?;
    Ok((child, said))
}

/// The last line of a program's standard error.
pub fn last_line(said: &mut File) -> Option<String> {
    let length = said.seek(SeekFrom::End(0)).ok()?;
    let from = length.saturating_sub(MAX_SAID);
    said.seek(SeekFrom::Start(from)).ok()?;
    let mut bytes = Vec::new();
    said.take(MAX_SAID).read_to_end(&mut bytes).ok()?;
    let text = String::from_utf8_lossy(&bytes);
    let line = text.lines().rfind(|line| !line.trim().is_empty())?;
    Some(line.trim().to_owned())
}
