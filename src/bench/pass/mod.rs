//! The one loop: frames from a source through the algorithms and the judge into the sinks.
//!
//! Replay, score, record and the experiments are this loop with other sources and sinks. Code that
//! does not iterate over frames (`svl match`, `svl bench`) calls a matcher directly.

mod jobs;
mod matchers;
mod matching;
#[cfg(test)]
mod tests;
mod threads;
mod through;

pub use matchers::Matchers;
pub(crate) use threads::{in_own_pool, joined};
pub use through::{complete, ending, frames_through, report_losses, run_through};

use crate::sink::{PassEnd, PassStart, Sink};
use crate::source::Source;
use matching::Matching;
use std::collections::BTreeMap;
use std::time::Duration;
use svl_core::{Error, Result, counted};
use svl_score::losses::Losses;
use svl_score::losses::{FailedPairs, Missing};
use svl_score::notice::Notice;
use svl_score::plausibility::MeasuredScales;
use threads::{TakenFrames, in_batches, in_turn, side_by_side};

/// Watches a pass and may end it.
pub trait Monitor: Send {
    /// Called after every frame; `false` ends the pass without an error.
    fn go_on(&mut self, done: u64) -> bool;

    /// Reports that an algorithm failed on a pair, and why.
    fn failed(&mut self, failure: &Notice) {
        failure.warn();
    }
}

/// Speed at which frames are taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pace {
    /// Each frame as soon as the previous one is done.
    Asap,
    /// At their stamps, that many times faster.
    Times(f64),
    /// Each frame as soon as possible, and measured: frames are read in batches, matched while
    /// nothing else of svl runs, then scored and passed to the sinks. The times of a pair are those
    /// of its median matching of `rounds`, which must have equal results; matchings that set up the
    /// memory for a size of images do not count.
    Measured { rounds: usize },
    /// Each frame as soon as possible, by that many threads, in each of which one algorithm matches
    /// one pair: no time is measured.
    Jobs(usize),
}

impl Pace {
    pub(crate) fn jobs(self) -> Option<usize> {
        match self {
            Self::Jobs(jobs) => Some(jobs),
            _ => None,
        }
    }

    /// The work that the times of such a pass measure, in words.
    pub fn times(self) -> String {
        match self {
            Self::Asap | Self::Times(_) => {
                "matching while svl reads and writes; `svl score` measures it alone".to_owned()
            }
            Self::Measured { rounds } => {
                let rounds = match rounds {
                    0 | 1 => String::new(),
                    _ => format!("; of each pair the median of {rounds} matchings"),
                };
                format!("matching alone, while svl neither reads nor writes{rounds}")
            }
            Self::Jobs(_) => "not measured with --jobs".to_owned(),
        }
    }
}

/// Result of a pass.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outcome {
    /// Frames that every sink took.
    pub frames: u64,
    /// Sum of the steps between their stamps; a clock that jumps back adds nothing.
    pub duration: Duration,
    /// Per algorithm the frames on which it failed, so that its estimate is missing.
    pub failures: BTreeMap<String, u64>,
    /// True if the monitor ended it.
    pub interrupted: bool,
    /// Everything of the source that is in no frame.
    pub losses: Losses,
    /// The factors between the truth and the algorithms.
    pub scales: MeasuredScales,
}

impl Outcome {
    /// True if it was interrupted before the end of its source. `pairs`: their number, if known.
    pub fn stopped_early(&self, pairs: Option<u64>) -> bool {
        self.interrupted && pairs != Some(self.frames)
    }

    /// Fails if it [stopped early](Self::stopped_early).
    pub fn reached_end(&self, pairs: Option<u64>) -> Result<()> {
        if !self.stopped_early(pairs) {
            return Ok(());
        }
        let done = match pairs {
            Some(pairs) => format!("{} of {}", self.frames, counted(pairs, "pair")),
            None => counted(self.frames, "pair"),
        };
        Err(Error::Invalid(format!("interrupted after {done}")))
    }

    /// Number of pairs that are missing, and of all.
    pub fn missing(&self) -> Missing {
        let failed_pairs = |(label, &failed): (&String, &u64)| {
            let pairs = self.frames;
            (label.clone(), FailedPairs { pairs, failed })
        };
        Missing {
            pairs: self.frames,
            losses: self.losses.clone(),
            algorithms: self.failures.iter().map(failed_pairs).collect(),
            doubts: self.scales.doubts(),
        }
    }
}

/// Runs every frame of `source` through the algorithms into `sinks`, between their
/// [`Sink::begin_pass`] and [`Sink::end_pass`]. Both are called also when the pass fails, so that
/// what came before the error is kept. The caller finishes the sinks.
///
/// Frames are read ahead and taken by the sinks, where the algorithms leave a core free, in threads
/// of their own, in the same order; else all happens in turn, so that other threads do not disturb
/// the times that are measured. With a source that listens or keeps the newest frame all happens in
/// turn too. The threads for
/// reading and for the sinks are rayon pools of their own: a source or a sink that uses rayon never
/// waits for the caller's pool, whose only thread may be waiting for them. A measured pass
/// ([`Pace::Measured`]) matches first and has the two threads afterwards, batch by batch; with
/// [`Pace::Jobs`] they have the batches before and behind the one that is matched.
///
/// An algorithm that fails on a frame leaves no estimate for it, and the others continue. It is
/// reported to the monitor, but not again while the algorithm fails for the same reason frame after
/// frame.
///
/// The outcome holds also for a pass that failed, with the first error of the source, of a raw pair
/// for an algorithm, or of a sink.
pub fn run(
    source: &mut dyn Source,
    matchers: &mut Matchers,
    start: &PassStart<'_>,
    pace: Pace,
    sinks: &mut [Box<dyn Sink>],
    monitor: &mut dyn Monitor,
) -> (Outcome, Result<()>) {
    let mut matching = Matching::new(matchers, start, pace, monitor);
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let has_free_core = cores > rayon::current_num_threads();
    let reads_ahead = has_free_core && !source.listens() && !source.keeps_newest();
    let mut taken = TakenFrames::default();
    let begun = sinks.iter_mut().try_for_each(|sink| sink.begin_pass(start));
    let ran = begun.and_then(|()| {
        if matching.is_measured() && !source.listens() {
            in_batches(source, &mut matching, pace.jobs(), sinks, &mut taken)
        } else if !matching.matchers.is_empty() && reads_ahead {
            side_by_side(source, &mut matching, sinks, &mut taken)
        } else {
            in_turn(source, &mut matching, sinks, &mut taken)
        }
    });
    let ran = match ran {
        Err(Error::Interrupted) => {
            matching.interrupted = true;
            Ok(())
        }
        ran => ran,
    };
    let outcome = Outcome {
        frames: taken.frames,
        duration: taken.duration,
        failures: matching.failures,
        interrupted: matching.interrupted,
        losses: source.finish(taken.frames),
        // Perturbed pairs have the truth of the others.
        scales: match start.judge.run.stress {
            None => taken.scales.measured(),
            Some(_) => MeasuredScales::default(),
        },
    };
    let error = ran.as_ref().err().map(ToString::to_string);
    let end = PassEnd {
        losses: &outcome.losses,
        error: error.as_deref(),
    };
    let ended = sinks
        .iter_mut()
        .map(|sink| sink.end_pass(&end))
        .fold(Ok(()), Result::and);
    (outcome, ran.and(ended))
}
