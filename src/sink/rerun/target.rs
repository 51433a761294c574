//! Rerun destinations: a file, a viewer started for the run, or a running one.

use super::blueprint::TimeCursor;
use crate::error::{Error, Result};
use ::rerun::sink::FileSinkError;
use ::rerun::{RecordingStream, RecordingStreamBuilder, RecordingStreamError};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;

/// How to get the viewer. Its version must be that of the library: the protocol changes between
/// versions.
pub const VIEWER_HINT: &str =
    "the Rerun viewer comes with `pip install rerun-sdk==0.36.3` (the program `rerun`)";

/// Timeout for a running viewer to answer.
const CONNECT: Duration = Duration::from_secs(3);

/// Where a [`super::RerunSink`] writes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RerunTarget {
    /// A new file, by custom `*.rrd`.
    File(PathBuf),
    /// A viewer: the one listening on Rerun's default port, else a new one.
    Spawn,
    /// A running viewer, e.g. `rerun+http://127.0.0.1:9876/proxy`.
    Url(String),
}

impl RerunTarget {
    /// The file to write, if it is one.
    pub fn file(&self) -> Option<&Path> {
        match self {
            Self::File(path) => Some(path),
            Self::Spawn | Self::Url(_) => None,
        }
    }
}

impl FromStr for RerunTarget {
    type Err = Error;

    /// `spawn`, a URL (`rerun+http://HOST:PORT/proxy`, or `http://HOST:PORT` for short), or a file
    /// ending in `.rrd`.
    fn from_str(text: &str) -> Result<Self> {
        if text == "spawn" {
            return Ok(Self::Spawn);
        }
        let Some((scheme, address)) = text.split_once("://") else {
            return match text {
                file if file.ends_with(".rrd") => Ok(Self::File(file.into())),
                other => Err(Error::Invalid(format!(
                    "'{other}' is no Rerun destination; use `spawn`, a viewer's URL or a FILE.rrd"
                ))),
            };
        };
        let scheme = scheme.trim_start_matches("rerun+");
        let address = address.trim_end_matches('/').trim_end_matches("/proxy");
        if !matches!(scheme, "http" | "https") || address.is_empty() {
            return Err(Error::Invalid(format!(
                "{text}: a viewer's URL looks like rerun+http://127.0.0.1:9876/proxy"
            )));
        }
        Ok(Self::Url(format!("rerun+{scheme}://{address}/proxy")))
    }
}

impl std::fmt::Display for RerunTarget {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::File(path) => write!(f, "{}", path.display()),
            Self::Spawn => f.write_str("the spawned viewer"),
            Self::Url(url) => f.write_str(url),
        }
    }
}

impl RerunTarget {
    /// Where the viewer's time cursor is to stand: a file is read from its first frame, a run
    /// followed.
    pub(super) fn cursor(&self) -> TimeCursor {
        match self {
            Self::File(_) => TimeCursor::First,
            Self::Spawn | Self::Url(_) => TimeCursor::Last,
        }
    }

    /// Opens the stream. An existing file is an error: nothing is overwritten unasked.
    pub(super) fn open(&self, builder: RecordingStreamBuilder) -> Result<RecordingStream> {
        match self {
            Self::File(path) if path.exists() => Err(Error::format(
                path,
                "already exists, and is not overwritten",
            )),
            Self::File(path) => builder.save(path).map_err(|error| self.failed(error)),
            Self::Spawn => builder.spawn().map_err(|error| self.failed(error)),
            Self::Url(url) => {
                let stream = builder
                    .connect_grpc_opts(url.as_str())
                    .map_err(|error| self.failed(error))?;
                // The SDK connects in the background and retries for ever: flushing with a timeout
                // finds out whether a viewer is there.
                stream.flush_with_timeout(CONNECT).map_err(|_| {
                    Error::Invalid(format!(
                        "{url}: no Rerun viewer answers there; start `rerun` first, or use `spawn`"
                    ))
                })?;
                Ok(stream)
            }
        }
    }

    /// The SDK's error in one line.
    pub(super) fn failed(&self, error: RecordingStreamError) -> Error {
        match error {
            RecordingStreamError::FileSink(FileSinkError::CreateFile { source, path }) => {
                Error::io(path, source)
            }
            RecordingStreamError::SpawnViewer(
                ::rerun::SpawnError::ExecutableNotFoundInPath { .. }
                | ::rerun::SpawnError::ExecutableNotFound { .. },
            ) => Error::Invalid(format!("no program `rerun` on the PATH; {VIEWER_HINT}")),
            other => self.broken(&other.to_string()),
        }
    }

    /// `reason`, which may have many lines, as an error of one.
    pub(super) fn broken(&self, reason: &str) -> Error {
        Error::Invalid(format!(
            "{self}: {}",
            reason.lines().next().unwrap_or_default()
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn targets_are_told_apart() {
        let url = |text: &str| Ok(RerunTarget::Url(text.to_owned()));
        let parse = |text: &str| text.parse::<RerunTarget>().map_err(|e| e.to_string());
        assert_eq!(parse("spawn"), Ok(RerunTarget::Spawn));
        assert_eq!(
            parse("out/run.rrd"),
            Ok(RerunTarget::File("out/run.rrd".into()))
        );
        assert_eq!(
            parse("http://host:9876"),
            url("rerun+http://host:9876/proxy")
        );
        assert_eq!(
            parse("rerun+https://host:1/proxy"),
            url("rerun+https://host:1/proxy")
        );
        assert!(parse("ftp://host").is_err() && parse("").is_err());
    }
}
