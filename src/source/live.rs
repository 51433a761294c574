//! Cameras as a source.

use super::Source;
use crate::error::{Error, Result};
use crate::grab::{self, GrabRequest, Grabber, Host};
use crate::stereo::{Frame, GrabberReport, Losses};

/// A running grabber as a source. It ends when `stopped`.
///
/// When a camera fails, the pairs from before come first, then one [`crate::Error::Camera`].
pub struct LiveSource {
    name: String,
    grabber: Grabber,
    stopped: fn() -> bool,
    pairs: u64,
    seed: Option<u64>,
}

impl LiveSource {
    /// Opens the two cameras that `name` names, as `v4l2:/dev/video0,/dev/video2`, and starts to
    /// grab.
    ///
    /// # Errors
    /// Those of [`grab::open`].
    pub fn open(name: &str, request: &GrabRequest, host: Host<'_>) -> Result<Self> {
        let mut source = Self::new(name, grab::open(name, request, host)?, host.stopped);
        let default_seed = grab::driver(name).and_then(|driver| driver.default_seed);
        source.seed = request.seed.or(default_seed);
        Ok(source)
    }

    /// The seed that the images depend on, where they do.
    pub fn seed(&self) -> Option<u64> {
        self.seed
    }

    /// A source of a running grabber. `stopped` is polled while no pair comes.
    pub fn new(name: impl Into<String>, grabber: Grabber, stopped: fn() -> bool) -> Self {
        Self {
            name: name.into(),
            grabber,
            stopped,
            pairs: 0,
            seed: None,
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
