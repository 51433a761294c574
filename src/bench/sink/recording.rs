//! Frames and estimates into a recording.

use super::{RunEnd, Sink};
use svl_core::Result;
use svl_data::recording::{GRABBER, Writer};
use svl_data::score::Judged;

/// A recording as a sink: the pairs of the source, and beside them every algorithm's disparities.
pub struct RecordingSink {
    writer: Writer,
}

impl RecordingSink {
    pub fn new(writer: Writer) -> Self {
        Self { writer }
    }
}

impl Sink for RecordingSink {
    fn take(&mut self, judged: &Judged) -> Result<()> {
        self.writer.write(&judged.frame)?;
        judged.estimates.iter().try_for_each(|scored| {
            let hashes = [judged.pair_hash(), scored.hash];
            self.writer
                .write_estimate(&judged.frame, &scored.estimate, hashes)
        })
    }

    /// Writes the grabber's counts, and the reason why a run ended early.
    fn end_run(&mut self, end: &RunEnd<'_>) -> Result<()> {
        let Some(grabber) = &end.losses.grabber else {
            return Ok(());
        };
        let mut facts = grabber.facts.clone();
        facts.extend(
            end.error
                .map(|error| ("error".to_owned(), error.to_owned())),
        );
        self.writer.remember(GRABBER, facts)
    }

    fn finish(mut self: Box<Self>) -> Result<()> {
        self.writer.finish()
    }
}
