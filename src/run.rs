//! The only loop: frames from a source through the matchers into the sinks.

use crate::depth;
use crate::error::{Error, Result};
use crate::matcher::{Algorithm, Matcher};
use crate::scenario::GridSettings;
use crate::sink::Sink;
use crate::source::Source;
use crate::stereo::{DisparityMap, Estimate, Frame};
use crate::timing::Clock;
use std::time::{Duration, Instant};

/// Watches a run and may end it.
pub trait Monitor {
    /// Called after every frame; `false` ends the run, orderly.
    fn go_on(&mut self, done: u64) -> bool;

    /// Told what an algorithm did not match and why.
    fn failed(&mut self, failure: &str) {
        tracing::warn!("{failure}");
    }
}

/// How fast frames are taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pace {
    /// As soon as the one before is done.
    Asap,
    /// At their stamps, this many times faster.
    Times(f64),
}

/// What a run did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Outcome {
    /// Frames taken from the source, all of which went to every sink.
    pub frames: u64,
    /// Estimates that are missing because their algorithm failed on that frame.
    pub failures: u64,
    /// Whether the monitor ended it.
    pub interrupted: bool,
}

/// The algorithms of a run, ready to match.
pub struct Lineup(Vec<Contestant>);

struct Contestant {
    label: String,
    matcher: Box<dyn Matcher>,
    last_failure: String,
}

impl Lineup {
    /// Builds the algorithms; each may stand once, as its label names its rows and topics.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the algorithm that stands twice or cannot be built.
    pub fn new(algorithms: &[Algorithm]) -> Result<Self> {
        let contestant = |(i, algorithm): (usize, &Algorithm)| {
            let label = algorithm.label().to_owned();
            if algorithms[..i].iter().any(|other| other.label() == label) {
                return Err(Error::Invalid(format!("{label}: named twice; name each algorithm once")));
            }
            let matcher = algorithm.build().map_err(|e| Error::Invalid(format!("{label}: {e}")))?;
            Ok(Contestant { label, matcher, last_failure: String::new() })
        };
        algorithms.iter().enumerate().map(contestant).collect::<Result<_>>().map(Self)
    }
}

/// Runs every frame of `source` through the algorithms into `sinks`.
///
/// The sinks are finished by the caller, who may have more to say to them: also after an error, so that what came
/// before it is kept.
///
/// An algorithm that fails on a frame leaves no estimate of it, and the others go on. The monitor is told, but not again
/// while the algorithm fails for the same reason frame after frame.
///
/// # Errors
/// The first of the source or of a sink.
pub fn run(
    source: &mut dyn Source,
    lineup: &mut Lineup,
    grid: GridSettings,
    pace: Pace,
    sinks: &mut [&mut dyn Sink],
    monitor: &mut dyn Monitor,
) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let mut pacer = Pacer { pace, start: None };
    while let Some(frame) = source.next()? {
        pacer.wait_for(&frame);
        let mut estimates = Vec::with_capacity(lineup.0.len());
        for Contestant { label, matcher, last_failure } in &mut lineup.0 {
            let (width, height) = frame.pair.size();
            let mut disparity = DisparityMap::new(width, height)?;
            let mut clock = Clock::start();
            if let Err(error) = matcher.compute(&frame.pair, &mut disparity, &mut clock) {
                outcome.failures += 1;
                let failure = error.to_string();
                if failure != *last_failure {
                    monitor.failed(&format!("{label} on pair {}: {failure}", frame.sequence));
                }
                *last_failure = failure;
                continue;
            }
            last_failure.clear();
            let grid = depth::grid(disparity.disparity(), grid.shape(), grid.min_valid, frame.rig.as_ref());
            estimates.push(Estimate { algorithm: label.clone(), disparity, grid, times: clock.times() });
        }
        for sink in sinks.iter_mut() {
            sink.push(&frame, &estimates)?;
        }
        outcome.frames += 1;
        if !monitor.go_on(outcome.frames) {
            outcome.interrupted = true;
            break;
        }
    }
    Ok(outcome)
}

struct Pacer {
    pace: Pace,
    start: Option<(Instant, u64)>,
}

impl Pacer {
    fn wait_for(&mut self, frame: &Frame) {
        let Pace::Times(factor) = self.pace else { return };
        let (began, first_ns) = *self.start.get_or_insert((Instant::now(), frame.stamp_ns));
        let due = Duration::from_nanos((frame.stamp_ns.saturating_sub(first_ns) as f64 / factor) as u64);
        std::thread::sleep(due.saturating_sub(began.elapsed()));
    }
}
