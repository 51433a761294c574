//! Frames and estimates into a recording.

use super::Sink;
use crate::error::Result;
use crate::recording::Writer;
use crate::stereo::{Estimate, Frame};

/// A recording as a sink: what came from the source, and beside it every algorithm's disparities.
pub struct RecordingSink {
    writer: Writer,
    pairs: u64,
}

impl RecordingSink {
    pub fn new(writer: Writer) -> Self {
        Self { writer, pairs: 0 }
    }

    /// The recording, to keep more in it than pairs.
    pub fn writer(&mut self) -> &mut Writer {
        &mut self.writer
    }

    /// Pairs written so far.
    pub fn pairs(&self) -> u64 {
        self.pairs
    }
}

impl Sink for RecordingSink {
    fn push(&mut self, frame: &Frame, estimates: &[Estimate]) -> Result<()> {
        self.writer.write(frame)?;
        self.pairs += 1;
        estimates
            .iter()
            .try_for_each(|estimate| self.writer.write_estimate(frame, estimate))
    }

    fn finish(&mut self) -> Result<()> {
        self.writer.finish()
    }
}
