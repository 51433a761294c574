//! Frames from a recording.

use super::Source;
use crate::error::{Error, Result};
use crate::recording::{self, Reader, SCENARIO, Selection};
use crate::stereo::Frame;
use std::path::PathBuf;

/// A recording as a source.
///
/// A damaged recording ends with one [`crate::Error::Damaged`], after which there are no more frames: a run may show it
/// and go on to score the frames that came before.
pub struct RecordingSource(Reader);

impl RecordingSource {
    /// Opens a recording.
    ///
    /// # Errors
    /// As [`Reader::open`].
    pub fn open(path: impl Into<PathBuf>) -> Result<Self> {
        Reader::open(path).map(Self)
    }

    /// As [`RecordingSource::open`], choosing the topics of a recording that svl did not write.
    ///
    /// # Errors
    /// As [`Reader::open_selection`].
    pub fn open_selection(path: impl Into<PathBuf>, selection: &Selection) -> Result<Self> {
        Reader::open_selection(path, selection).map(Self)
    }

    /// The scenario file that the recording was made by, where it holds one. Damage is left to be told with the pairs.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn scenario(&self) -> Result<Option<String>> {
        match recording::attachment(self.0.path(), SCENARIO) {
            Err(Error::Damaged { .. }) => Ok(None),
            found => Ok(found?.and_then(|bytes| String::from_utf8(bytes).ok())),
        }
    }

    /// The recording, to ask it for its header and what it left out.
    pub fn reader(&self) -> &Reader {
        &self.0
    }
}

impl Source for RecordingSource {
    fn name(&self) -> String {
        self.0.path().display().to_string()
    }

    fn next(&mut self) -> Result<Option<Frame>> {
        self.0.next_pair()
    }

    fn pairs(&self) -> Option<u64> {
        self.0.pairs()
    }

    fn unpaired(&self) -> u64 {
        self.0.unpaired()
    }
}
