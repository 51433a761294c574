//! Rerun destinations: a file, a viewer started for the run, or a running one.

use crate::blueprint::{self, LayoutNode, TimeCursor};
use crate::{APPLICATION, TIMELINES, file};
use rerun::sink::FileSinkError;
use rerun::{AsComponents, RecordingStream, RecordingStreamBuilder, RecordingStreamError};
use std::io::ErrorKind;
use std::net::{SocketAddr, TcpStream};
use std::process::Command;
use std::time::Duration;
use svl_bench::sink::RerunTarget;
use svl_core::{Error, Result};

/// The version of the library, which the viewer must have: the protocol changes between versions.
fn version() -> String {
    rerun::build_info().version.to_string()
}

/// Instructions for getting the viewer.
fn hint() -> String {
    let version = version();
    format!("the Rerun viewer comes with `pip install rerun-sdk=={version}` (the program `rerun`)")
}

fn missing() -> Error {
    Error::Invalid(format!("no program `rerun` on the PATH; {}", hint()))
}

/// Checks that a viewer is listening, or that the one on the PATH can be started.
///
/// # Errors
/// The errors of [`find_program`].
pub(crate) fn find_viewer() -> Result<()> {
    let listening = SocketAddr::from(([127, 0, 0, 1], DEFAULT_PORT));
    match TcpStream::connect_timeout(&listening, CONNECT) {
        Ok(_) => Ok(()),
        Err(_) => find_program(),
    }
}

/// Checks that the viewer on the PATH can show the library's output.
///
/// # Errors
/// If there is none, or it has another version.
pub(crate) fn find_program() -> Result<()> {
    let output = Command::new("rerun").arg("--version").output();
    let output = output.map_err(|error| {
        if error.kind() == ErrorKind::NotFound {
            missing()
        } else {
            Error::io("rerun", error)
        }
    })?;
    check_version("the program `rerun` on the PATH", &output.stdout)
}

/// Checks the version in `said`, as reported by a viewer: `rerun-cli 0.36.3 [...]`.
///
/// # Errors
/// [`Error::Invalid`] for another one.
fn check_version(viewer: &str, said: &[u8]) -> Result<()> {
    let said = String::from_utf8_lossy(said);
    let release = |text: &str| -> Option<(u32, u32)> {
        let mut numbers = text.trim_start_matches('v').split(['.', '-', '+']);
        Some((numbers.next()?.parse().ok()?, numbers.next()?.parse().ok()?))
    };
    let found = said.split_whitespace().find(|word| release(word).is_some());
    match found {
        Some(found) if release(found) != release(&version()) => Err(Error::Invalid(format!(
            "{viewer} is Rerun {found}, and svl writes for {}; {}",
            version(),
            hint()
        ))),
        // The format of its report may change: the stream itself then shows if they are compatible.
        _ => Ok(()),
    }
}

/// Port of a viewer started without options.
const DEFAULT_PORT: u16 = 9876;

/// Timeout for a running viewer to answer.
const CONNECT: Duration = Duration::from_secs(3);

/// A target with the errors of its stream.
pub(crate) struct Destination(pub(crate) RerunTarget);

/// A recording viewed by a person pair by pair.
pub(crate) struct ViewStream {
    stream: RecordingStream,
    target: Destination,
}

impl ViewStream {
    /// Opens `target` for a recording with that name and layout.
    ///
    /// # Errors
    /// The errors of [`svl_bench::sink::Viewer::run`].
    pub(crate) fn open(target: RerunTarget, name: &str, root: &LayoutNode) -> Result<Self> {
        let target = Destination(target);
        let stream = target.open(RecordingStreamBuilder::new(APPLICATION).recording_name(name))?;
        blueprint::send(
            root,
            APPLICATION.into(),
            TIMELINES[0],
            target.cursor(),
            &stream,
        )
        .map_err(|error| target.failed(error))?;
        Ok(Self { stream, target })
    }

    /// Sets the pair of all further logs.
    pub(crate) fn set_pair(&self, sequence: u64) {
        let number = i64::try_from(sequence).unwrap_or(i64::MAX);
        self.stream.set_time_sequence(TIMELINES[0], number);
    }

    pub(crate) fn log(&self, path: &str, what: &impl AsComponents) -> Result<()> {
        let logged = self.stream.log(path, what);
        logged.map_err(|error| self.target.failed(error))
    }

    pub(crate) fn flush(&self) -> Result<()> {
        self.target.flush(&self.stream)
    }
}

impl Destination {
    /// Initial position of the viewer's time cursor: a file is read from its first frame, a run is
    /// followed.
    pub(crate) fn cursor(&self) -> TimeCursor {
        match self.0 {
            RerunTarget::File(_) => TimeCursor::First,
            RerunTarget::Spawn | RerunTarget::Url(_) => TimeCursor::Last,
        }
    }

    /// Opens the stream. An existing file is an error: nothing is overwritten unasked.
    pub(crate) fn open(&self, builder: RecordingStreamBuilder) -> Result<RecordingStream> {
        match &self.0 {
            RerunTarget::File(path) if path.exists() => Err(Error::format(
                path,
                "already exists, and is not overwritten",
            )),
            RerunTarget::File(path) => {
                file::open(builder, path).map_err(|error| self.failed(error))
            }
            RerunTarget::Spawn => {
                find_viewer()?;
                builder.spawn().map_err(|error| self.failed(error))
            }
            RerunTarget::Url(url) => {
                let stream = builder
                    .connect_grpc_opts(url.as_str())
                    .map_err(|error| self.failed(error))?;
                // The SDK connects in the background and retries forever: flushing with a timeout
                // detects if a viewer is there.
                stream.flush_with_timeout(CONNECT).map_err(|_| {
                    Error::Invalid(format!(
                        "{url}: no Rerun viewer answers there; start `rerun` first, or use `spawn`"
                    ))
                })?;
                Ok(stream)
            }
        }
    }

    /// Waits until everything logged is written or sent.
    pub(crate) fn flush(&self, stream: &RecordingStream) -> Result<()> {
        stream.flush_blocking().map_err(|error| match &self.0 {
            RerunTarget::File(path) => {
                Error::format(path, "could not be written to its end; is the disk full?")
            }
            RerunTarget::Spawn | RerunTarget::Url(_) => self.broken(&error.to_string()),
        })
    }

    /// The SDK's error in one line.
    pub(crate) fn failed(&self, error: RecordingStreamError) -> Error {
        match error {
            RecordingStreamError::FileSink(FileSinkError::CreateFile { source, path }) => {
                Error::io(path, source)
            }
            RecordingStreamError::SpawnViewer(
                rerun::SpawnError::ExecutableNotFoundInPath { .. }
                | rerun::SpawnError::ExecutableNotFound { .. },
            ) => missing(),
            other => self.broken(&other.to_string()),
        }
    }

    /// `reason`, possibly many lines, as a one-line error.
    pub(crate) fn broken(&self, reason: &str) -> Error {
        Error::Invalid(format!(
            "{}: {}",
            self.0,
            reason.lines().next().unwrap_or_default()
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_viewer_of_another_version_is_one_line_with_the_cure() {
        let ours = version();
        let other = "rerun-cli 0.99.1 (release_full) [rustc 1.95.0, LLVM 22.1.2] x86_64";
        let error = check_version("rerun", other.as_bytes()).unwrap_err();
        let words = format!("rerun is Rerun 0.99.1, and svl writes for {ours}; ");
        let error = error.to_string();
        assert!(
            error.starts_with(&words) && !error.contains('\n'),
            "{error}"
        );
        assert!(
            error.contains(&format!("pip install rerun-sdk=={ours}")),
            "{error}"
        );
        // Patches of one release are compatible; an unreadable version is not another version.
        let [major, minor] = [0, 1].map(|i| ours.split('.').nth(i).unwrap());
        for said in [
            format!("rerun-cli {major}.{minor}.99 (x)"),
            "hello".to_owned(),
        ] {
            assert!(check_version("rerun", said.as_bytes()).is_ok(), "{said}");
        }
    }
}
