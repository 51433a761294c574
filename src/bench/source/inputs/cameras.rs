//! Cameras as a source.

use crate::source::frames::Source;
use svl_core::Result;
use svl_core::stereo::Frame;
use svl_grab::{self as grab, GrabRequest, Grabber, Host, Unpaired, camera_error};
use svl_score::losses::{GrabberReport, Losses};

/// A running grabber as a source. It ends when `stopped`.
///
/// When a camera fails, the pairs from before come first, then one [`svl_grab::CameraError`].
pub struct CameraSource {
    name: String,
    grabber: Grabber,
    stopped: fn() -> bool,
    pairs: u64,
    /// The seed of the images, if they depend on one.
    pub seed: Option<u64>,
    /// Pairs a second that were asked for.
    asked_hz: Option<f64>,
    /// Stamps of the first and the last pair.
    stamps_ns: Option<[u64; 2]>,
}

/// Fraction of the requested rate below which it counts as not reached: stamps and clocks differ
/// less.
const MIN_RATE: f64 = 0.95;

impl CameraSource {
    /// Opens the two cameras that `name` names, as `v4l2:/dev/video0,/dev/video2`, and starts to
    /// grab.
    ///
    /// # Errors
    /// The errors of [`grab::open`].
    pub fn open(name: &str, request: &GrabRequest, host: Host<'_>) -> Result<Self> {
        let mut source = Self::new(name, grab::open(name, request, host)?, host.stopped);
        let default_seed = grab::driver(name).and_then(|driver| driver.default_seed);
        source.seed = request.seed.or(default_seed);
        source.asked_hz = request.rate_hz;
        Ok(source)
    }

    /// A source of a running grabber. `stopped` is polled while no pair comes.
    pub fn new(name: impl Into<String>, grabber: Grabber, stopped: fn() -> bool) -> Self {
        Self {
            name: name.into(),
            grabber,
            stopped,
            pairs: 0,
            seed: None,
            asked_hz: None,
            stamps_ns: None,
        }
    }

    /// The requested rate and the reached one, in words, if that is less.
    fn missed_rate(&self) -> Option<String> {
        let ([first, last], asked) = (self.stamps_ns?, self.asked_hz?);
        let seconds = last.saturating_sub(first) as f64 / 1e9;
        let reached = (self.pairs - 1) as f64 / seconds;
        let is_missed = seconds > 0.0 && reached < MIN_RATE * asked;
        is_missed.then(|| format!("asked for {asked} pairs a second, reached {reached:.1}"))
    }
}

impl Source for CameraSource {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn next(&mut self) -> Result<Option<Frame>> {
        let frame = self.grabber.next_pair_unless(self.stopped)?;
        self.pairs += u64::from(frame.is_some());
        if let Some(Frame { stamp_ns, .. }) = &frame {
            let [first, _] = self.stamps_ns.unwrap_or([*stamp_ns; 2]);
            self.stamps_ns = Some([first, *stamp_ns]);
        }
        if self.pairs == 0 {
            let reason = if (self.stopped)() {
                "stopped before the first pair"
            } else {
                "gave no pair; the counts say why, and another --trigger or --pairing may help"
            };
            return Err(camera_error(&self.name, reason));
        }
        Ok(frame)
    }

    fn pairs(&self) -> Option<u64> {
        None
    }

    fn finish(&mut self, taken: u64) -> Losses {
        let mut tally = self.grabber.stop();
        tally.unread = tally.pairs.saturating_sub(tally.dropped + taken);
        let (mut facts, mut text) = (tally.facts(), tally.to_string());
        if let Some(missed) = self.missed_rate() {
            tracing::warn!("{}: {missed}", self.name);
            text += &format!("; {missed}");
            facts.insert("rate".to_owned(), missed);
        }
        let damaged = tally.count(|reason| reason == Unpaired::Damaged);
        let partners = tally.count(|reason| !reason.is_outside() && reason != Unpaired::Damaged);
        Losses {
            // The partner of a damaged image is lost with it.
            unpaired: partners.saturating_sub(damaged),
            unreadable: damaged,
            outside: tally.count(Unpaired::is_outside),
            dropped: tally.dropped,
            grabber: Some(GrabberReport { facts, text }),
            ..Losses::default()
        }
    }
}
