//! Cameras as a source.

use super::Source;
use crate::error::{Error, Result};
use crate::grab::Grabber;
use crate::stereo::{Frame, GrabberReport, Losses};

/// A running grabber as a source that ends when it is told to.
///
/// When a camera fails, the pairs from before come first, then one [`crate::Error::Camera`].
pub struct LiveSource {
    name: String,
    grabber: Grabber,
    stopped: fn() -> bool,
    pairs: u64,
}

impl LiveSource {
    /// `stopped`: asked while no pair comes, whether to end.
    pub fn new(name: impl Into<String>, grabber: Grabber, stopped: fn() -> bool) -> Self {
        Self {
            name: name.into(),
            grabber,
            stopped,
            pairs: 0,
        }
    }
}

impl Source for LiveSource {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn next(&mut self) -> Result<Option<Frame>> {
        let frame = self.grabber.next_pair_unless(self.stopped)?;
        self.pairs += u64::from(frame.is_some());
        if self.pairs == 0 {
            let reason = match (self.stopped)() {
                true => "stopped before the first pair",
                false => {
                    "gave no pair; the counts say why, and another --trigger or --pairing may help"
                }
            };
            return Err(Error::camera(&self.name, reason));
        }
        Ok(frame)
    }

    fn pairs(&self) -> Option<u64> {
        None
    }

    fn finish(&mut self, taken: u64) -> Losses {
        let mut tally = self.grabber.stop();
        tally.unread = tally.pairs.saturating_sub(tally.dropped + taken);
        Losses {
            grabber: Some(GrabberReport {
                facts: tally.facts(),
                text: tally.to_string(),
            }),
            ..Losses::default()
        }
    }
}
