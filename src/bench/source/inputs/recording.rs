//! Frames from a recording.

use crate::source::frames::Source;
use std::ops::RangeInclusive;
use std::path::PathBuf;
use svl_core::stereo::Frame;
use svl_core::{Error, Result};
use svl_recording::{Reader, Recording, SCENARIO, Selection};
use svl_score::losses::Losses;

/// A recording as a source.
///
/// Unreadable pairs are dropped and counted, and the first one is reported.
///
/// A damaged recording ends with one [`svl_core::Error::Damaged`], after which there are no more
/// frames: a run may show it and still score the frames before it.
pub struct RecordingSource {
    /// The reader, for its header and facts.
    pub reader: Reader,
    selection: Selection,
    unreadable: u64,
}

impl RecordingSource {
    /// Opens a recording.
    ///
    /// # Errors
    /// The errors of [`Reader::open`].
    pub fn open(path: impl Into<PathBuf>) -> Result<Self> {
        Self::new(Recording::open(path)?, &Selection::default())
    }

    /// The pairs of an open recording, of the selected topics where svl did not write it.
    ///
    /// # Errors
    /// The errors of [`Reader::new`].
    pub fn new(recording: Recording, selection: &Selection) -> Result<Self> {
        Reader::new(recording, selection).map(|reader| Self {
            reader,
            selection: selection.clone(),
            unreadable: 0,
        })
    }

    /// The attached scenario file, if any. Damage is reported with the pairs, not here.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn scenario(&self) -> Result<Option<String>> {
        match self.reader.recording().attachment(SCENARIO) {
            Err(Error::Damaged { .. }) => Ok(None),
            found => Ok(found?.and_then(|bytes| String::from_utf8(bytes).ok())),
        }
    }
}

impl Source for RecordingSource {
    fn name(&self) -> String {
        self.reader.path().display().to_string()
    }

    fn next(&mut self) -> Result<Option<Frame>> {
        loop {
            match self.reader.next_pair() {
                // The error is of one pair alone: the file continues.
                Err(error @ Error::Format { .. }) => {
                    // One line in the log; the number follows at the end.
                    if self.unreadable == 0 {
                        tracing::warn!("{error}; this pair is dropped");
                    }
                    self.unreadable += 1;
                }
                next => return next,
            }
        }
    }

    fn pairs(&self) -> Option<u64> {
        self.reader.pairs()
    }

    fn numbers(&self) -> Option<RangeInclusive<u64>> {
        let pairs = self.pairs().or_else(|| self.reader.images())?;
        let first = self.reader.first_sequence;
        Some(first..=first.checked_add(pairs.checked_sub(1)?)?)
    }

    fn seek(&mut self, index: u64) -> Result<bool> {
        self.reader.seek(index)
    }

    fn why_no_pose(&self) -> Option<String> {
        let recording = Recording::open(self.reader.path()).ok()?;
        let summary = recording.summary(&self.selection).ok()?;
        summary.poses?.unusable
    }

    fn finish(&mut self, _: u64) -> Losses {
        let facts = self.reader.facts();
        Losses {
            unpaired: (facts.unpaired_ns.len() as u64).saturating_sub(facts.partners_of_unreadable),
            unpaired_ns: facts.unpaired_ns,
            outside: facts.outside,
            late: facts.late,
            unreadable: self.unreadable,
            broken: facts.broken,
            ..Losses::default()
        }
    }
}
