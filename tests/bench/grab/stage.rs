//! Two simulated cameras on a scripted clock.

use std::sync::Arc;
use std::time::Duration;
use svl::Result;
use svl::grab::simulated::{
    CameraBehavior, RenderedPictures, SimulatedCamera, SimulatedTrigger, TriggerCable, TriggerInput,
};
use svl::grab::{
    Camera, Capture, GrabClock, Grabber, Limits, Policy, Rule, Settings, Setup, Taken, Tally,
    Unpaired, WhenFull,
};
use svl::stereo::{Frame, Gray, Side, StereoPair};

pub const MS: u64 = 1_000_000;
/// About 60 per second.
pub const PERIOD_NS: u64 = 16 * MS;

/// Trigger of the cameras.
#[derive(Clone, Copy, PartialEq)]
pub enum Triggered {
    WhenArmed,
    AtFixedRate,
    Never,
}

/// Changes of a test to the usual settings.
pub struct Stage {
    pub clock: Arc<GrabClock>,
    pub behaviors: [CameraBehavior; 2],
    pub light: f64,
    pub queue: usize,
    pub when_full: WhenFull,
    pub first: Settings,
    /// Pairs between two steps of the exposure balance; never, unless a test is about it.
    pub balance_every: u32,
    /// From this index on, all images of the right camera are damaged.
    pub damaged_from: u64,
    /// Additional transfer time of the right camera's images, from a driver that knows no pulses.
    pub on_its_way_ms: u64,
    pub period_ns: u64,
}

pub const FIRST: Settings = Settings::new(4_000, 0);

impl Stage {
    pub fn new(left: CameraBehavior, right: CameraBehavior) -> Self {
        Self {
            clock: GrabClock::scripted(),
            behaviors: [left, right],
            light: 1.0,
            queue: 100_000,
            when_full: WhenFull::Wait,
            first: FIRST,
            balance_every: u32::MAX,
            damaged_from: u64::MAX,
            on_its_way_ms: 0,
            period_ns: PERIOD_NS,
        }
    }

    pub fn start(self, triggered: Triggered, rule: Rule) -> Grabber {
        let (clock, period_ns) = (self.clock, self.period_ns);
        let cable = TriggerCable::new(&clock);
        let pictures = Arc::new(pictures());
        let [left, right] = self.behaviors;
        let camera = |side, behavior| -> Box<dyn Camera> {
            let input = match triggered {
                Triggered::Never => TriggerInput::FreeRunning { period_ns },
                _ => TriggerInput::Cable(cable.clone()),
            };
            Box::new(SimulatedCamera::new(
                side, &clock, input, &pictures, self.light, behavior,
            ))
        };
        let right = failing(camera(Side::Right, right), self.damaged_from);
        let right = match self.on_its_way_ms {
            0 => right,
            ms => belated(right, &clock, ms * MS),
        };
        let cameras = [camera(Side::Left, left), right];
        let trigger = Box::new(SimulatedTrigger::new(&cable));
        let policy = match triggered {
            Triggered::WhenArmed => Policy::Coordinated { trigger, period_ns },
            Triggered::AtFixedRate => Policy::FixedRate { trigger, period_ns },
            Triggered::Never => Policy::FreeRunning { period_ns },
        };
        Grabber::start(Setup {
            clock,
            cameras,
            policy,
            rule,
            settings: self.first,
            max_shutter_us: 8_000,
            balance_every: self.balance_every,
            timeout: Duration::from_secs(1),
            queue: self.queue,
            when_full: self.when_full,
            rig: pictures.rig(),
        })
        .unwrap()
    }

    /// Grabs that many pairs, fewer if it ends earlier, and stops.
    pub fn grab(self, triggered: Triggered, rule: Rule, pairs: usize) -> (Vec<Frame>, Tally) {
        let mut grabber = self.start(triggered, rule);
        let frames = (0..pairs)
            .map_while(|_| grabber.next_pair().unwrap())
            .collect();
        (frames, adds_up(grabber.stop()))
    }
}

/// A camera whose images go through `capture`.
struct Altered<F> {
    camera: Box<dyn Camera>,
    capture: F,
}

impl<F: FnMut(&mut dyn Camera, Duration) -> Result<Option<Taken>> + Send> Camera for Altered<F> {
    fn name(&self) -> String {
        self.camera.name()
    }

    fn limits(&self) -> Limits {
        self.camera.limits()
    }

    fn arm(&mut self, settings: Settings) -> Result<()> {
        self.camera.arm(settings)
    }

    fn capture(&mut self, timeout: Duration) -> Result<Option<Taken>> {
        (self.capture)(&mut *self.camera, timeout)
    }
}

/// A camera that delivers that many intact images, then only damaged ones.
fn failing(camera: Box<dyn Camera>, mut whole: u64) -> Box<dyn Camera> {
    let capture = move |camera: &mut dyn Camera, timeout: Duration| {
        let Some(taken) = camera.capture(timeout)? else {
            return Ok(None);
        };
        let is_intact = whole > 0;
        whole = whole.saturating_sub(1);
        Ok(Some(if is_intact { taken } else { Taken::Damaged }))
    };
    Box::new(Altered { camera, capture })
}

/// A camera with a driver that neither knows pulses nor can cancel an image in transfer. Its first
/// image belongs to no pulse.
fn belated(camera: Box<dyn Camera>, clock: &Arc<GrabClock>, late_ns: u64) -> Box<dyn Camera> {
    let (clock, mut coming, mut is_new) = (clock.clone(), None::<(u64, Capture)>, true);
    let capture = move |camera: &mut dyn Camera, timeout: Duration| {
        if std::mem::take(&mut is_new) {
            let image = Gray::filled(32, 24, 0)?;
            let capture = Capture {
                image,
                stamp_ns: 0,
                trigger_id: None,
                ordered: FIRST,
                settings: FIRST,
            };
            return Ok(Some(Taken::Image(capture)));
        }
        let Some((due_ns, capture)) = coming.take() else {
            if let Some(Taken::Image(capture)) = camera.capture(timeout)? {
                coming = Some((
                    clock.now_ns() + late_ns,
                    Capture {
                        trigger_id: None,
                        ..capture
                    },
                ));
            }
            return Ok(None);
        };
        clock.sleep_until(due_ns.min(clock.now_ns() + timeout.as_nanos() as u64));
        if clock.now_ns() >= due_ns {
            return Ok(Some(Taken::Image(capture)));
        }
        coming = Some((due_ns, capture));
        Ok(None)
    };
    Box::new(Altered { camera, capture })
}

/// Rule of pairs whose images are at most a quarter of a period apart.
pub const NEAR: Rule = Rule::Stamp {
    max_skew_ns: PERIOD_NS / 4,
    period_ns: PERIOD_NS,
};

/// Skew of each pair in nanoseconds.
pub fn skews(frames: &[Frame]) -> Vec<i64> {
    let skews = frames.iter().map(|frame| frame.exposure.skew_ns);
    skews.map(Option::unwrap).collect()
}

/// Number of images without a partner, except those at the end.
pub fn lost(tally: &Tally) -> u64 {
    tally.unpaired.iter().sum::<u64>() - tally.unpaired[Unpaired::Unfinished as usize]
}

/// Asserts that everything is counted.
#[track_caller]
pub fn adds_up(tally: Tally) -> Tally {
    assert_eq!(
        tally.frames.iter().sum::<u64>(),
        2 * tally.pairs + tally.unpaired.iter().sum::<u64>(),
        "{tally}"
    );
    tally
}

/// Small pictures, each of one grey value: the content of a frame tells its exposure time.
fn pictures() -> RenderedPictures {
    let pair = |grey| {
        let image = Gray::filled(32, 24, grey).unwrap();
        StereoPair::new(image.clone(), image).unwrap()
    };
    RenderedPictures::new((0..60).map(|i| pair(70 + i)).collect(), 60.0, None).unwrap()
}

/// A camera that takes this long to get ready, and up to that much longer.
pub fn slow(arm_ms: f64, jitter_ms: f64) -> CameraBehavior {
    CameraBehavior {
        arm_ms,
        jitter_ms,
        ..CameraBehavior::default()
    }
}
