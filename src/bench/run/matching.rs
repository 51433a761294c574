//! Between source and sinks: a frame through the algorithms, then through the judge.

use super::matchers::{Matched, Matchers, RunMatcher, add};
use super::{Monitor, Pace};
use crate::report::{LoggedResult, ResultLog};
use crate::sink::{RunStart, Sink};
use std::collections::{BTreeMap, VecDeque};
use std::time::{Duration, Instant};
use svl_core::matcher::MatchContext;
use svl_core::stereo::{Estimate, Frame, Rig};
use svl_core::{Error, Result, depth};
use svl_data::score::{Judge, Judged, MatchFailure};

/// The outputs of all algorithms for a frame.
#[derive(Default)]
pub(super) struct MatchedFrame {
    matched: Vec<Matched>,
    failures: Vec<MatchFailure>,
}

/// Completes the estimates of a frame with their grids and scores them.
pub(super) fn judged(judge: &Judge, frame: Frame, of_frame: MatchedFrame) -> Judged {
    let mut logged = Vec::new();
    let estimate = |matched: Matched| {
        let Matched {
            algorithm,
            output,
            range_px,
            times,
            logged: of_log,
        } = matched;
        logged.push(of_log);
        let disparity = output.disparity;
        let own_grid = output.grid.is_some();
        let grid = output.grid.unwrap_or_else(|| {
            let (map, left) = (disparity.disparity(), frame.pair.left());
            depth::cells(map, left, judge.grid, judge.cells, frame.rig())
        });
        Estimate {
            algorithm,
            disparity,
            grid,
            own_grid,
            unfiltered: output.unfiltered,
            range_px,
            times,
        }
    };
    let estimates = of_frame.matched.into_iter().map(estimate).collect();
    let mut judged = judge.judge(frame, estimates);
    judged.failures = of_frame.failures;
    for (scored, logged) in judged.estimates.iter_mut().zip(logged) {
        if let Some((metrics, hash)) = logged {
            // An algorithm that failed before may answer now.
            let agreed = scored.metrics.get("agreed");
            scored.metrics = metrics;
            scored.metrics.set("agreed", agreed);
            scored.hash = hash;
        }
    }
    judged
}
/// The part of a run between source and sinks.
pub(super) struct Matching<'a> {
    pub(super) matchers: &'a mut Matchers,
    pub(super) judge: &'a Judge,
    pacer: Pacer,
    /// Number of times that a pair is matched in a measured run.
    rounds: Option<usize>,
    /// Results of an earlier part of the run, which take the place of matching,
    log: Option<&'a ResultLog>,
    /// that with this seed,
    seed: Option<u64>,
    /// unless a sink needs the map of that algorithm.
    needed: Vec<bool>,
    monitor: &'a mut dyn Monitor,
    frames: u64,
    pub(super) failures: BTreeMap<String, u64>,
    pub(super) interrupted: bool,
}

impl<'a> Matching<'a> {
    pub(super) fn new(
        matchers: &'a mut Matchers,
        start: &RunStart<'a>,
        pace: Pace,
        monitor: &'a mut dyn Monitor,
    ) -> Self {
        let labels = matchers.0.iter().map(|entry| entry.label.clone());
        let failures = labels.map(|label| (label, 0)).collect();
        for entry in &mut matchers.0 {
            // Pairs of a run that was interrupted.
            entry.ahead.clear();
            entry.matcher.forget();
        }
        Self {
            matchers,
            judge: start.judge,
            pacer: Pacer { pace, start: None },
            rounds: match pace {
                Pace::Measured { rounds } => Some(rounds.max(1)),
                Pace::Asap | Pace::Times(_) => None,
            },
            log: start.log.filter(|log| !log.is_empty()),
            seed: start.seed,
            needed: Vec::new(),
            monitor,
            frames: 0,
            failures,
            interrupted: false,
        }
    }

    pub(super) fn is_measured(&self) -> bool {
        self.rounds.is_some()
    }

    /// Asks the sinks which algorithms' maps of the next frame they need.
    pub(super) fn ask_for_maps(&mut self, frame: &Frame, sinks: &mut [Box<dyn Sink>]) {
        if self.log.is_some() {
            self.needed.clear();
            self.needed.resize(self.matchers.0.len(), false);
            let shows_checkpoint = self.judge.shows_checkpoint(frame);
            for sink in sinks {
                sink.ask_for_maps(frame, shows_checkpoint, &mut self.needed);
            }
        }
    }

    pub(super) fn matched(&mut self, frame: &Frame) -> Result<MatchedFrame> {
        self.pacer.wait_for(frame);
        if self.matchers.0.is_empty() {
            // A recording of raw pairs needs no rectified ones.
            return Ok(MatchedFrame::default());
        }
        let pair = frame.rectified()?;
        let context = MatchContext::of(frame, self.judge.grid, self.judge.cells);
        for entry in &mut self.matchers.0 {
            entry.check(frame);
        }
        if self.rounds.is_some() {
            let (obstacle_m, _) = self.judge.cells.obstacle_and_clear_m();
            let mut short: Vec<(String, f64)> = Vec::new();
            for entry in &mut self.matchers.0 {
                if entry.warm_for.replace(pair.size()) == Some(pair.size()) {
                    continue;
                }
                entry.warm_up(pair, &context);
                if let Some(rig) = frame.rig() {
                    let nearest_m = entry.short_range(rig, obstacle_m);
                    short.extend(nearest_m.map(|nearest_m| (entry.label.clone(), nearest_m)));
                }
            }
            if let Some(rig) = frame.rig() {
                warn_of_ranges(short, rig, obstacle_m);
            }
        }
        let logged = self.logged(frame);
        // The first result of a log is matched again: another program behind the same command would
        // continue with other results.
        let is_known = |entry: &RunMatcher, i: usize| {
            let is_needed = self.needed.get(i) != Some(&false);
            let is_free = !is_needed && !entry.matcher.remembers();
            logged[i].is_some() && entry.is_verified && is_free
        };
        // In turns, so that a slow moment of the machine affects all algorithms.
        let mut rounds: Vec<_> = self.matchers.0.iter().map(|_| Ok(Vec::new())).collect();
        for _ in 0..self.rounds.unwrap_or(1) {
            let entries = self.matchers.0.iter_mut().zip(&mut rounds).enumerate();
            for (i, (entry, outputs)) in entries {
                if !is_known(entry, i) && entry.ahead.is_empty() && outputs.is_ok() {
                    add(outputs, entry.compute(pair, &context));
                }
            }
        }
        for (entry, outputs) in self.matchers.0.iter_mut().zip(&mut rounds) {
            if let Some(ahead) = entry.ahead.pop_front() {
                *outputs = ahead;
            }
        }
        if rounds
            .iter()
            .any(|outputs| matches!(outputs, Err(Error::Interrupted)))
        {
            return Err(Error::Interrupted);
        }
        let mut of_frame = MatchedFrame::default();
        for (i, (entry, outputs)) in self.matchers.0.iter_mut().zip(rounds).enumerate() {
            if is_known(entry, i)
                && let Some(result) = logged[i]
            {
                of_frame.matched.push(entry.logged(result, pair.size())?);
                continue;
            }
            match outputs.and_then(|outputs| entry.median(outputs)) {
                Ok(output) => {
                    entry.succeeded();
                    if let Some(earlier) = logged[i] {
                        entry.verify(&output, earlier, frame.sequence)?;
                    }
                    let times = logged[i].map_or_else(|| output.clock.times(), |r| r.times());
                    of_frame.matched.push(Matched {
                        algorithm: entry.label.clone(),
                        range_px: entry.max_disparity.map(f64::from),
                        times,
                        output,
                        logged: None,
                    });
                }
                Err(error) => {
                    let (algorithm, reason) = (entry.label.clone(), error.to_string());
                    *self.failures.entry(algorithm.clone()).or_default() += 1;
                    let is_news = entry.failed(&reason);
                    let failure = MatchFailure { algorithm, reason };
                    if is_news {
                        self.monitor.failed(&failure.words(frame.sequence));
                    }
                    of_frame.failures.push(failure);
                }
            }
        }
        Ok(of_frame)
    }

    /// Matches a frame and those that wait behind it by the algorithms that take several pairs at
    /// once.
    pub(super) fn match_ahead(&mut self, frame: &Frame, waiting: &VecDeque<Frame>) {
        // With a log not all pairs are matched.
        if self.log.is_some() {
            return;
        }
        for entry in &mut self.matchers.0 {
            let (batch, size) = (entry.matcher.batch(), frame.pair.size());
            if batch < 2 || !entry.ahead.is_empty() || entry.warm_for != Some(size) {
                continue;
            }
            let frames = std::iter::once(frame).chain(waiting).take(batch);
            let pairs = frames.map_while(|frame| {
                let context = MatchContext::of(frame, self.judge.grid, self.judge.cells);
                let pair = frame.rectified().ok();
                pair.filter(|pair| pair.size() == size)
                    .map(|pair| (pair, context))
            });
            entry.match_ahead(&pairs.collect::<Vec<_>>(), self.rounds.unwrap_or(1));
        }
    }

    /// The results of an earlier part of the run, per algorithm.
    fn logged(&self, frame: &Frame) -> Vec<Option<&'a LoggedResult>> {
        let Some(log) = self.log else {
            return vec![None; self.matchers.0.len()];
        };
        let pair = log.pair(&self.judge.run, self.seed, frame);
        let entries = self.matchers.0.iter();
        entries.map(|entry| pair.get(&entry.label)).collect()
    }

    pub(super) fn go_on(&mut self) -> bool {
        self.frames += 1;
        self.interrupted = !self.monitor.go_on(self.frames);
        !self.interrupted
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

/// Warns of algorithms whose ranges of disparities end before obstacles do: their labels, and the
/// nearest distances that they see.
fn warn_of_ranges(mut short: Vec<(String, f64)>, rig: &Rig, obstacle_m: f64) {
    let px = rig.disparity_px(obstacle_m).ceil();
    short.sort_by(|a, b| a.1.total_cmp(&b.1));
    for equal in short.chunk_by(|a, b| a.1.total_cmp(&b.1).is_eq()) {
        let labels: Vec<_> = equal.iter().map(|(label, _)| label.as_str()).collect();
        tracing::warn!(
            "{}: max_disparity sees nothing nearer than {:.2} m; obstacles at {obstacle_m} m need \
             about {px} px",
            labels.join(", "),
            equal[0].1
        );
    }
}
