//! Cameras as a source.

use super::Source;
use crate::error::Result;
use crate::grab::{Grabber, Tally};
use crate::stereo::Frame;
use std::sync::{Arc, Mutex, PoisonError};

/// A running grabber as a source that never ends by itself.
///
/// When a camera fails, the pairs from before come first, then one [`crate::Error::Camera`].
pub struct LiveSource {
    name: String,
    grabber: Grabber,
    last: LastTally,
}

/// What a source did, to be read after it was dropped.
#[derive(Clone, Default)]
pub struct LastTally(Arc<Mutex<Tally>>);

impl LastTally {
    pub fn get(&self) -> Tally {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl LiveSource {
    pub fn new(name: impl Into<String>, grabber: Grabber) -> Self {
        Self { name: name.into(), grabber, last: LastTally::default() }
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
        self.grabber.next()
    }

    fn pairs(&self) -> Option<u64> {
        None
    }
}

impl Drop for LiveSource {
    fn drop(&mut self) {
        *self.last.0.lock().unwrap_or_else(PoisonError::into_inner) = self.grabber.stop();
    }
}
