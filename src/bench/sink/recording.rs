//! Frames and estimates into a recording.

use super::{PassEnd, Sink};
use svl_core::stereo::hash_words;
use svl_core::{Result, counted};
use svl_recording::{GRABBER, PairResult, StoredResults, Writer};
use svl_score::judge::Judged;

/// A recording as a sink: the pairs of the source, and beside them every algorithm's disparities.
pub struct RecordingSink {
    writer: Writer,
    stored: Option<StoredResults>,
    /// Stored results of pairs that were changed since.
    foreign: u64,
}

impl RecordingSink {
    /// `stored`: results of the recording that the pairs are from, which are written too.
    pub fn new(writer: Writer, stored: Option<StoredResults>) -> Self {
        Self {
            writer,
            stored,
            foreign: 0,
        }
    }
}

impl Sink for RecordingSink {
    fn take(&mut self, judged: &Judged) -> Result<()> {
        let frame = &judged.frame;
        self.writer.write(frame)?;
        for scored in &judged.estimates {
            let hashes = [judged.pair_hash(), scored.hash];
            let result = PairResult::new(frame, &scored.estimate, hashes);
            self.writer.write_result(frame, &result)?;
        }
        let Some(stored) = &mut self.stored else {
            return Ok(());
        };
        let pair_hash = hash_words(judged.pair_hash());
        for result in stored.pair_results(frame.sequence)? {
            if result.result.pair_hash == pair_hash {
                self.writer.write_result(frame, &result)?;
            } else {
                self.foreign += 1;
            }
        }
        Ok(())
    }

    /// Writes the grabber's counts, and the reason why a run ended early.
    fn end_pass(&mut self, end: &PassEnd<'_>) -> Result<()> {
        if self.foreign > 0 {
            let results = counted(self.foreign, "result");
            tracing::warn!(
                "{results} not recorded: of pairs before they were rectified, resized or \
                 perturbed; `svl replay` makes new ones"
            );
        }
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
