//! Cameras as a source.

use super::Source;
use crate::error::{Error, Result};
use crate::grab::{Grabber, Tally};
use crate::stereo::Frame;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A running grabber as a source that ends when it is told to.
///
/// When a camera fails, the pairs from before come first, then one [`crate::Error::Camera`].
pub struct LiveSource {
    name: String,
    grabber: Grabber,
    stopped: fn() -> bool,
    pairs: u64,
    last: LastTally,
}

/// What a source did, to be read after it was dropped.
#[derive(Clone, Default)]
pub struct LastTally(Arc<Mutex<Tally>>);

impl LastTally {
    pub fn get(&self) -> Tally {
        self.lock().clone()
    }

    /// Says how many pairs were used of those that the source gave.
    pub fn used(&self, pairs: u64) {
        let mut tally = self.lock();
        tally.unread = tally.pairs.saturating_sub(tally.dropped + pairs);
    }

    fn lock(&self) -> MutexGuard<'_, Tally> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl LiveSource {
    /// `stopped`: asked while no pair comes, whether to end.
    pub fn new(name: impl Into<String>, grabber: Grabber, stopped: fn() -> bool) -> Self {
        Self {
            name: name.into(),
            grabber,
            stopped,
            pairs: 0,
            last: LastTally::default(),
        }
    }

    /// Where the tally will be when this is dropped.
    pub fn tally(&self) -> LastTally {
        self.last.clone()
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
}

impl Drop for LiveSource {
    fn drop(&mut self) {
        *self.last.lock() = self.grabber.stop();
    }
}
