//! The only loop: frames from a source through the matchers into the sinks.

use crate::counted;
use crate::depth;
use crate::error::{Error, Result};
use crate::matcher::{Algorithm, Matcher};
use crate::scenario::GridSettings;
use crate::sink::Sink;
use crate::source::Source;
use crate::stereo::{DisparityMap, Estimate, Frame};
use crate::timing::{Clock, StageTimes};
use std::sync::mpsc::{channel, sync_channel};
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
    /// Pairs that the source left out as they cannot be read.
    pub unreadable: u64,
    /// Whether the monitor ended it.
    pub interrupted: bool,
}

impl Outcome {
    /// What is missing, in words; nothing of a complete run.
    pub fn lacks(&self) -> Option<String> {
        let unreadable = (self.unreadable > 0)
            .then(|| format!("{} could not be read", counted(self.unreadable, "pair")));
        let failures = (self.failures > 0)
            .then(|| format!("algorithms failed on {}", counted(self.failures, "pair")));
        let lacks: Vec<_> = unreadable.into_iter().chain(failures).collect();
        (!lacks.is_empty()).then(|| lacks.join(" and "))
    }
}

/// The algorithms of a run, ready to match.
pub struct Lineup(Vec<Contestant>);

struct Contestant {
    label: String,
    matcher: Box<dyn Matcher>,
    last_failure: String,
    /// Maps that the sinks are done with.
    spent: Vec<DisparityMap>,
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
                return Err(Error::Invalid(format!(
                    "{label}: named twice; name each algorithm once"
                )));
            }
            let matcher = algorithm.build().map_err(|error| match error {
                Error::Invalid(reason) => Error::Invalid(format!("{label}: {reason}")),
                other => other,
            })?;
            Ok(Contestant {
                label,
                matcher,
                last_failure: String::new(),
                spent: Vec::new(),
            })
        };
        algorithms
            .iter()
            .enumerate()
            .map(contestant)
            .collect::<Result<_>>()
            .map(Self)
    }

    /// Keeps the maps of estimates for later frames.
    fn take_back(&mut self, estimates: Vec<Estimate>) {
        for estimate in estimates {
            if let Some(contestant) = self
                .0
                .iter_mut()
                .find(|contestant| contestant.label == estimate.algorithm)
            {
                contestant.spent.push(estimate.disparity);
            }
        }
    }
}

/// Runs every frame of `source` through the algorithms into `sinks`.
///
/// The sinks are finished by the caller, who may have more to say to them: also after an error, so
/// that what came before it is kept.
///
/// Where the algorithms leave a core free, frames are read ahead and taken by the sinks in threads
/// of their own, in the same order; else all happens in turn, lest the threads disturb the times
/// that are being measured. A source or sink that computes on rayon's own pool, as the arena does,
/// must then not be run from within a pool of one thread: it would wait for the thread that waits
/// for it. Recordings and svl's sinks do not.
///
/// An algorithm that fails on a frame leaves no estimate of it, and the others go on. The monitor
/// is told, but not again while the algorithm fails for the same reason frame after frame.
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
    let mut matching = Matching {
        lineup,
        grid,
        pacer: Pacer { pace, start: None },
        monitor,
        outcome: Outcome::default(),
    };
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let ran = if !matching.lineup.0.is_empty() && cores > rayon::current_num_threads() {
        side_by_side(source, &mut matching, sinks)
    } else {
        in_turn(source, &mut matching, sinks)
    };
    let unreadable = source.left_out().unreadable;
    ran.map(|()| Outcome {
        unreadable,
        ..matching.outcome
    })
}

fn in_turn(
    source: &mut dyn Source,
    matching: &mut Matching<'_>,
    sinks: &mut [&mut dyn Sink],
) -> Result<()> {
    let grid = matching.grid;
    while let Some(frame) = source.next()? {
        let matched = matching.matched(&frame)?;
        matching
            .lineup
            .take_back(push(sinks, grid, &frame, matched)?);
        if !matching.go_on() {
            break;
        }
    }
    Ok(())
}

/// Frames that wait between two threads: enough that neither waits for a single slow one.
const BETWEEN: usize = 2;

fn side_by_side(
    source: &mut dyn Source,
    matching: &mut Matching<'_>,
    sinks: &mut [&mut dyn Sink],
) -> Result<()> {
    std::thread::scope(|scope| {
        let (read, frames) = sync_channel(BETWEEN);
        scope.spawn(move || {
            // Ends with the source, its first error, or when nobody wants more.
            while let Some(next) = source.next().transpose() {
                let failed = next.is_err();
                if read.send(next).is_err() || failed {
                    break;
                }
            }
        });
        let grid = matching.grid;
        let (send, taken) = sync_channel::<(Frame, Vec<Matched>)>(BETWEEN);
        let (spend, spent) = channel();
        let pushing = scope.spawn(move || {
            for (frame, matched) in taken {
                // At the end nobody wants them back.
                let _ = spend.send(push(sinks, grid, &frame, matched)?);
            }
            Ok(())
        });
        let mut ran = Ok(());
        for next in frames {
            let matched =
                next.and_then(|frame| matching.matched(&frame).map(|matched| (frame, matched)));
            let sent = matched.map(|matched| send.send(matched).is_ok());
            spent
                .try_iter()
                .for_each(|estimates| matching.lineup.take_back(estimates));
            match sent {
                Ok(true) if matching.go_on() => {}
                Ok(_) => break,
                Err(error) => {
                    ran = Err(error);
                    break;
                }
            }
        }
        // The sinks take what was matched, whatever happened after.
        drop(send);
        let pushed = pushing
            .join()
            .unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        pushed.and(ran)
    })
}

/// What an algorithm made of a frame.
struct Matched {
    algorithm: String,
    disparity: DisparityMap,
    times: StageTimes,
}

/// Gives the sinks a frame with its estimates, and those back.
fn push(
    sinks: &mut [&mut dyn Sink],
    settings: GridSettings,
    frame: &Frame,
    matched: Vec<Matched>,
) -> Result<Vec<Estimate>> {
    let estimate = |Matched {
                        algorithm,
                        disparity,
                        times,
                    }| {
        let rig = frame.rig.as_ref();
        let grid = depth::grid(
            disparity.disparity(),
            settings.shape(),
            settings.min_valid,
            rig,
        );
        Estimate {
            algorithm,
            disparity,
            grid,
            times,
        }
    };
    let estimates: Vec<Estimate> = matched.into_iter().map(estimate).collect();
    sinks
        .iter_mut()
        .try_for_each(|sink| sink.push(frame, &estimates))?;
    Ok(estimates)
}

/// What is between source and sinks.
struct Matching<'a> {
    lineup: &'a mut Lineup,
    grid: GridSettings,
    pacer: Pacer,
    monitor: &'a mut dyn Monitor,
    outcome: Outcome,
}

impl Matching<'_> {
    fn matched(&mut self, frame: &Frame) -> Result<Vec<Matched>> {
        self.pacer.wait_for(frame);
        let mut matched = Vec::with_capacity(self.lineup.0.len());
        for Contestant {
            label,
            matcher,
            last_failure,
            spent,
        } in &mut self.lineup.0
        {
            let (width, height) = frame.pair.size();
            let mut disparity = spent
                .pop()
                .map_or_else(|| DisparityMap::new(width, height), Ok)?;
            let mut clock = Clock::start();
            if let Err(error) = matcher.compute(&frame.pair, &mut disparity, &mut clock) {
                self.outcome.failures += 1;
                let failure = error.to_string();
                if failure != *last_failure {
                    self.monitor
                        .failed(&format!("{label} on pair {}: {failure}", frame.sequence));
                }
                *last_failure = failure;
                continue;
            }
            last_failure.clear();
            matched.push(Matched {
                algorithm: label.clone(),
                disparity,
                times: clock.times(),
            });
        }
        Ok(matched)
    }

    fn go_on(&mut self) -> bool {
        self.outcome.frames += 1;
        self.outcome.interrupted = !self.monitor.go_on(self.outcome.frames);
        !self.outcome.interrupted
    }
}

struct Pacer {
    pace: Pace,
    start: Option<(Instant, u64)>,
}

impl Pacer {
    fn wait_for(&mut self, frame: &Frame) {
        let Pace::Times(factor) = self.pace else {
            return;
        };
        let (began, first_ns) = *self.start.get_or_insert((Instant::now(), frame.stamp_ns));
        let due =
            Duration::from_nanos((frame.stamp_ns.saturating_sub(first_ns) as f64 / factor) as u64);
        std::thread::sleep(due.saturating_sub(began.elapsed()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stereo::{Gray, StereoPair};

    /// So many frames, then an error.
    struct Failing(u64);

    impl Source for Failing {
        fn name(&self) -> String {
            "failing".into()
        }

        fn next(&mut self) -> Result<Option<Frame>> {
            self.0 = self
                .0
                .checked_sub(1)
                .ok_or_else(|| Error::Invalid("source failed".into()))?;
            let image = Gray::filled(40, 20, self.0 as u8)?;
            let pair = StereoPair::new(image.clone(), image)?;
            let (exposure, stamp_ns) = Default::default();
            let (name, rig, pose, truth) = (None, None, None, None);
            Ok(Some(Frame {
                sequence: self.0,
                stamp_ns,
                name,
                pair,
                rig,
                pose,
                truth,
                exposure,
            }))
        }

        fn pairs(&self) -> Option<u64> {
            None
        }
    }

    /// Takes so many frames, then fails.
    struct Full(usize, Vec<u64>);

    impl Sink for Full {
        fn push(&mut self, frame: &Frame, estimates: &[Estimate]) -> Result<()> {
            assert_eq!(estimates.len(), 1);
            if self.1.len() == self.0 {
                return Err(Error::Invalid("sink failed".into()));
            }
            self.1.push(frame.sequence);
            Ok(())
        }

        fn finish(&mut self) -> Result<()> {
            Ok(())
        }
    }

    struct Until(u64);

    impl Monitor for Until {
        fn go_on(&mut self, done: u64) -> bool {
            done < self.0
        }
    }

    type Flow = fn(&mut dyn Source, &mut Matching<'_>, &mut [&mut dyn Sink]) -> Result<()>;

    /// What the sink took and how it ended, of 20 frames that end in an error.
    fn ran(flow: Flow, sink_takes: usize, monitor_wants: u64) -> (Vec<u64>, Result<()>, Outcome) {
        let mut lineup = Lineup::new(&["v3:max_disparity=8".parse().unwrap()]).unwrap();
        let (mut sink, mut monitor) = (Full(sink_takes, Vec::new()), Until(monitor_wants));
        let pacer = Pacer {
            pace: Pace::Asap,
            start: None,
        };
        let (grid, outcome) = (GridSettings::default(), Outcome::default());
        let mut matching = Matching {
            lineup: &mut lineup,
            grid,
            pacer,
            monitor: &mut monitor,
            outcome,
        };
        let ended = flow(&mut Failing(20), &mut matching, &mut [&mut sink]);
        let outcome = matching.outcome;
        (sink.1, ended, outcome)
    }

    #[test]
    fn both_flows_take_every_frame_in_order_until_the_same_end() {
        let all: Vec<u64> = (0..20).rev().collect();
        for flow in [in_turn as Flow, side_by_side] {
            let (taken, ended, _) = ran(flow, 100, 100);
            assert_eq!(
                (taken, ended.unwrap_err().to_string().as_str()),
                (all.clone(), "source failed")
            );
            let (taken, ended, _) = ran(flow, 6, 100);
            assert_eq!(
                (&taken[..], ended.unwrap_err().to_string().as_str()),
                (&all[..6], "sink failed")
            );
            let (taken, ended, outcome) = ran(flow, 100, 4);
            assert_eq!(
                (&taken[..], outcome.frames, outcome.interrupted),
                (&all[..4], 4, true)
            );
            ended.unwrap();
        }
    }
}
