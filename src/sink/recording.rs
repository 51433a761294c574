//! Frames and estimates into a recording.

use super::Sink;
use crate::error::Result;
use crate::recording::Writer;
use crate::stereo::{Estimate, Frame};

/// A recording as a sink: what came from the source, and beside it every algorithm's disparities.
pub struct RecordingSink(Writer);

impl RecordingSink {
    pub fn new(writer: Writer) -> Self {
        Self(writer)
    }
}

impl Sink for RecordingSink {
    fn push(&mut self, frame: &Frame, estimates: &[Estimate]) -> Result<()> {
        self.0.write(frame)?;
        estimates.iter().try_for_each(|estimate| self.0.write_estimate(frame, estimate))
    }

    fn finish(&mut self) -> Result<()> {
        self.0.finish()
    }
}
