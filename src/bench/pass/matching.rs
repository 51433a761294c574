//! Between source and sinks: a frame through the algorithms, then through the judge.

use super::matchers::{Matched, Matchers, ReadyMatcher, add};
use super::{Monitor, Pace};
use crate::sink::{PassStart, Wanted};
use std::collections::{BTreeMap, VecDeque};
use std::time::{Duration, Instant};
use svl_core::matcher::{MatchContext, MatchOutput};
use svl_core::stereo::{Estimate, Frame, RectifiedPair, Rig};
use svl_core::{Error, Result, depth};
use svl_score::judge::{Judge, Judged, JudgedEstimate, MatchFailure};
use svl_score::notice::Notice;
use svl_score::scenario::WITNESS;

/// The outputs of all algorithms for a frame.
#[derive(Default)]
pub(super) struct MatchedFrame {
    matched: Vec<Matched>,
    failures: Vec<MatchFailure>,
}

/// Completes the estimates of a frame with their grids and scores them.
pub(super) fn judged(judge: &Judge, frame: Frame, matches: MatchedFrame) -> Judged {
    let estimate = |matched: Matched| {
        let output = matched.output;
        let disparity = output.disparity;
        let own_grid = output.grid.is_some();
        let grid = output.grid.or(output.decided);
        let grid =
            grid.unwrap_or_else(|| depth::grid(disparity.disparity(), judge.grid, frame.rig()));
        Estimate {
            algorithm: matched.algorithm,
            disparity,
            grid,
            own_grid,
            unfiltered: output.unfiltered,
            range_px: matched.range_px,
            times: matched.times,
        }
    };
    let estimates = matches.matched.into_iter().map(estimate).collect();
    let mut judged = judge.judge(frame, estimates);
    let is_witness = |own: &mut JudgedEstimate| own.estimate.algorithm == WITNESS;
    judged.witness = judged.estimates.extract_if(.., is_witness).next();
    judged.failures = matches.failures;
    judged
}

/// The part of a pass between source and sinks.
pub(super) struct Matching<'a> {
    pub(super) matchers: &'a mut Matchers,
    pub(super) judge: &'a Judge,
    pacer: Pacer,
    /// Number of times that a pair is matched in a measured pass.
    rounds: Option<usize>,
    /// The results that are asked for, if not all are.
    wanted: Option<&'a dyn Wanted>,
    /// Place of the next pair in the pass.
    place: u64,
    /// The size of images whose ranges of disparities were looked at.
    ranged_for: Option<(usize, usize)>,
    monitor: &'a mut dyn Monitor,
    frames: u64,
    pub(super) failures: BTreeMap<String, u64>,
    pub(super) interrupted: bool,
}

impl<'a> Matching<'a> {
    pub(super) fn new(
        matchers: &'a mut Matchers,
        start: &PassStart<'a>,
        pace: Pace,
        monitor: &'a mut dyn Monitor,
    ) -> Self {
        let labels = matchers.0.iter().map(|entry| entry.label.clone());
        let failures = labels.map(|label| (label, 0)).collect();
        for entry in &mut matchers.0 {
            entry.begin_pass();
        }
        Self {
            matchers,
            judge: start.judge,
            pacer: Pacer { pace, start: None },
            rounds: match pace {
                Pace::Measured { rounds } => Some(rounds.max(1)),
                Pace::Jobs(_) => Some(1),
                Pace::Asap | Pace::Times(_) => None,
            },
            wanted: start.wanted,
            place: 0,
            ranged_for: None,
            monitor,
            frames: 0,
            failures,
            interrupted: false,
        }
    }

    pub(super) fn is_measured(&self) -> bool {
        self.rounds.is_some()
    }

    /// The places of the algorithms that match the next frame, with memory for its size.
    pub(super) fn begin(&mut self, frame: &Frame) -> Result<Vec<usize>> {
        self.pacer.wait_for(frame);
        let (wanted, place) = (self.wanted, self.place);
        self.place += 1;
        // Also of algorithms whose results are known: the warning belongs to the pass.
        let is_new = self.ranged_for.replace(frame.pair.size()) != Some(frame.pair.size());
        if let Some(rig) = frame.rig().filter(|_| is_new && self.rounds.is_some()) {
            self.matchers
                .warn_of_ranges(frame.pair.size(), rig, self.judge);
        }
        let entries = self.matchers.0.iter().enumerate();
        let asked = entries.filter(|(_, entry)| is_wanted(wanted, place, entry));
        let asked: Vec<_> = asked.map(|(i, _)| i).collect();
        // A recording of raw pairs needs no rectified ones.
        if !asked.is_empty() {
            let pair = frame.rectified()?;
            let context = MatchContext::for_frame(frame, self.judge.grid, self.judge.cells);
            if self.rounds.is_some() {
                warm_up(self.matchers.at(&asked), pair, &context);
            }
        }
        Ok(asked)
    }

    pub(super) fn matched(&mut self, frame: &Frame) -> Result<MatchedFrame> {
        let asked = self.begin(frame)?;
        if asked.is_empty() {
            return Ok(MatchedFrame::default());
        }
        let context = MatchContext::for_frame(frame, self.judge.grid, self.judge.cells);
        let mut matching = self.matchers.at(&asked);
        let rounds = self.rounds.unwrap_or(1);
        let rounds = in_rounds(&mut matching, frame.rectified()?, &context, rounds);
        self.collected(frame, asked.into_iter().zip(rounds).collect())
    }

    /// The outputs of algorithms for a frame, by their places.
    pub(super) fn collected(
        &mut self,
        frame: &Frame,
        outputs: Vec<(usize, Result<Vec<MatchOutput>>)>,
    ) -> Result<MatchedFrame> {
        let is_interrupted = |(_, own): &(_, Result<_>)| matches!(own, Err(Error::Interrupted));
        if outputs.iter().any(is_interrupted) {
            return Err(Error::Interrupted);
        }
        let mut matches = MatchedFrame::default();
        for (place, outputs) in outputs {
            let entry = &mut self.matchers.0[place];
            match outputs.and_then(|outputs| entry.median(outputs)) {
                Ok(output) => {
                    entry.is_failing = false;
                    matches.matched.push(Matched {
                        algorithm: entry.label.clone(),
                        range_px: entry.max_disparity.map(f64::from),
                        times: entry
                            .times(&output)
                            .filter(|_| self.pacer.pace.jobs().is_none()),
                        output,
                    });
                }
                Err(error) => {
                    let (algorithm, reason) = (entry.label.clone(), error.to_string());
                    *self.failures.entry(algorithm.clone()).or_default() += 1;
                    let is_news = entry.failed(&reason);
                    if is_news {
                        let notice = Notice::on_pair(&algorithm, frame.sequence, &reason);
                        self.monitor.failed(&notice);
                    }
                    matches.failures.push(MatchFailure { algorithm, reason });
                }
            }
        }
        Ok(matches)
    }

    /// Matches a frame and those that wait behind it by the algorithms that take several pairs at
    /// once.
    pub(super) fn match_ahead(&mut self, frame: &Frame, waiting: &VecDeque<Frame>) {
        let size = frame.pair.size();
        for i in 0..self.matchers.0.len() {
            let entry = &self.matchers.0[i];
            let batch = entry.matcher.batch();
            if batch < 2 || !entry.ahead.is_empty() || entry.warm_for != Some(size) {
                continue;
            }
            let frames = std::iter::once(frame).chain(waiting).zip(self.place..);
            let is_next = |(_, place): &(&Frame, u64)| is_wanted(self.wanted, *place, entry);
            let pairs = frames
                .take_while(is_next)
                .take(batch)
                .map_while(|(frame, _)| {
                    let context = MatchContext::for_frame(frame, self.judge.grid, self.judge.cells);
                    let pair = frame.rectified().ok();
                    pair.filter(|pair| pair.size() == size)
                        .map(|pair| (pair, context))
                });
            let pairs: Vec<_> = pairs.collect();
            self.matchers.0[i].match_ahead(&pairs, self.rounds.unwrap_or(1));
        }
    }

    pub(super) fn go_on(&mut self) -> bool {
        self.frames += 1;
        self.interrupted = !self.monitor.go_on(self.frames);
        !self.interrupted
    }
}

/// True if the result of an algorithm of the pair at `place` is asked for.
fn is_wanted(wanted: Option<&dyn Wanted>, place: u64, entry: &ReadyMatcher) -> bool {
    wanted.is_none_or(|wanted| wanted.wants(place, &entry.label))
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

/// The outputs of each algorithm, of all rounds or ahead.
fn in_rounds(
    matching: &mut [&mut ReadyMatcher],
    pair: RectifiedPair<'_>,
    context: &MatchContext<'_>,
    rounds: usize,
) -> Vec<Result<Vec<MatchOutput>>> {
    // In turns, so that a slow moment of the machine affects all algorithms.
    let mut all: Vec<_> = matching.iter().map(|_| Ok(Vec::new())).collect();
    for _ in 0..rounds {
        for (entry, outputs) in matching.iter_mut().zip(&mut all) {
            if entry.ahead.is_empty() && outputs.is_ok() {
                add(outputs, entry.compute(pair, context));
            }
        }
    }
    for (entry, outputs) in matching.iter_mut().zip(&mut all) {
        if let Some(ahead) = entry.ahead.pop_front() {
            *outputs = ahead;
        }
    }
    all
}

/// Sets up the memory of algorithms for the size of a pair.
fn warm_up(entries: Vec<&mut ReadyMatcher>, pair: RectifiedPair<'_>, context: &MatchContext<'_>) {
    for entry in entries {
        if entry.warm_for.replace(pair.size()) != Some(pair.size()) {
            entry.warm_up(pair, context);
        }
    }
}

impl Matchers {
    /// Warns of algorithms whose ranges of disparities end before obstacles do, each once; for
    /// images of a size.
    pub fn warn_of_ranges(&mut self, size: (usize, usize), rig: &Rig, judge: &Judge) {
        let (obstacle_m, _) = judge.cells.obstacle_and_clear_m();
        let images = (size, judge.grid.shape().cells());
        let px = rig.disparity_px(obstacle_m).ceil();
        let short = self.0.iter_mut().filter_map(|entry| {
            let nearest_m = entry.short_range(images, rig, obstacle_m)?;
            Some((entry.label.clone(), nearest_m))
        });
        let mut short: Vec<(String, f64)> = short.collect();
        short.sort_by(|a, b| a.1.total_cmp(&b.1));
        for equal in short.chunk_by(|a, b| a.1.total_cmp(&b.1).is_eq()) {
            let labels = equal.iter().map(|(label, _)| label.as_str());
            let nearest_m = equal[0].1;
            let text = format!(
                "max_disparity sees nothing nearer than {nearest_m:.2} m; obstacles at \
                 {obstacle_m} m need about {px} px"
            );
            Notice::new(labels, text).warn();
        }
    }
}
