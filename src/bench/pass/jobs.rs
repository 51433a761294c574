//! Jobs: the pairs of a batch through the algorithms by several threads. A thread matches one pair
//! by one algorithm, always that which is furthest behind.
//!
//! An algorithm without a memory of the run has copies of its matcher where threads would wait
//! otherwise, in all fewer than there are threads. Programs match in turn.

use super::matchers::ReadyMatcher;
use super::matching::{MatchedFrame, Matching};
use super::threads::{in_own_pool, joined};
use parking_lot::Mutex;
use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use svl_core::matcher::{Algorithm, MatchContext, MatchOutput};
use svl_core::stereo::{DisparityMap, Frame};
use svl_core::{Error, Result, interrupt};
use svl_score::judge::Judge;

/// A frame with the places of the algorithms that match it.
pub(super) struct AskedFrame {
    frame: Frame,
    asked: Vec<usize>,
}

/// The outputs of the algorithm at a place for a frame of a batch.
struct JobOutput {
    frame: usize,
    place: usize,
    outputs: Result<Vec<MatchOutput>>,
}

impl Matching<'_> {
    /// Takes the next frames of one size off those that wait, up to the first not rectified.
    pub(super) fn begin_batch(
        &mut self,
        waiting: &mut VecDeque<Frame>,
    ) -> (Vec<AskedFrame>, Result<()>) {
        let mut batch = Vec::new();
        let size = |frame: &Frame| frame.pair.size();
        let first = waiting.front().map(size);
        while waiting.front().map(size) == first
            && let Some(frame) = waiting.pop_front()
        {
            match self.begin(&frame) {
                Ok(asked) => batch.push(AskedFrame { frame, asked }),
                Err(error) => return (batch, Err(error)),
            }
        }
        (batch, Ok(()))
    }

    /// Matches a batch by that many threads. What is complete is returned also after an error; the
    /// result is false if the user ended it.
    pub(super) fn match_by(
        &mut self,
        jobs: usize,
        (batch, begun): (Vec<AskedFrame>, Result<()>),
    ) -> (Vec<(Frame, MatchedFrame)>, Result<bool>) {
        let entries = std::mem::take(&mut self.matchers.0);
        let queue = Mutex::new(JobQueue::new(entries, &batch, jobs));
        let judge = self.judge;
        let mut done = std::thread::scope(|scope| {
            let work = || in_own_pool(|| work(&queue, &batch, judge));
            let threads: Vec<_> = (0..jobs).map(|_| scope.spawn(work)).collect();
            threads.into_iter().flat_map(joined).collect::<Vec<_>>()
        });
        done.sort_by_key(|own| (own.frame, own.place));
        let JobQueue { lanes, died, .. } = queue.into_inner();
        self.matchers.0 = lanes.into_iter().map(MatchLane::into_matcher).collect();
        let (mut done, mut matched) = (done.into_iter().peekable(), Vec::new());
        for (i, AskedFrame { frame, asked }) in batch.into_iter().enumerate() {
            let own = std::iter::from_fn(|| done.next_if(|own| own.frame == i));
            let own: Vec<_> = own.map(|own| (own.place, own.outputs)).collect();
            if own.len() < asked.len() {
                return (matched, Err(died.unwrap_or(Error::Interrupted)));
            }
            match self.collected(&frame, own) {
                Ok(own) => matched.push((frame, own)),
                Err(error) => return (matched, Err(error)),
            }
            if !self.go_on() {
                return (matched, Ok(false));
            }
        }
        (matched, begun.map(|()| true))
    }
}

/// Matches what is next, until nothing is.
fn work(queue: &Mutex<JobQueue>, batch: &[AskedFrame], judge: &Judge) -> Vec<JobOutput> {
    let mut done = Vec::new();
    loop {
        // The queue is free meanwhile.
        let next = queue.lock().next();
        let Some(mut job) = next else {
            return done;
        };
        let outputs = catch_unwind(AssertUnwindSafe(|| job.outputs(batch, judge)));
        let died = outputs.is_err().then(|| {
            let (label, pair) = (&job.matcher.label, batch[job.frames[0]].frame.sequence);
            Error::Invalid(format!(
                "{label} died on pair {pair}; a bug, please report it"
            ))
        });
        let outputs = job.frames.iter().zip(outputs.into_iter().flatten());
        done.extend(outputs.map(|(frame, outputs)| JobOutput {
            frame: *frame,
            place: job.place,
            outputs,
        }));
        queue.lock().put_back(job, died);
    }
}

/// A frame for the algorithm at a place; several for a program that takes several at once.
struct MatchJob {
    frames: Vec<usize>,
    place: usize,
    matcher: ReadyMatcher,
}

impl MatchJob {
    fn outputs(&mut self, batch: &[AskedFrame], judge: &Judge) -> Vec<Result<Vec<MatchOutput>>> {
        let input = |frame: &usize| {
            let frame = &batch[*frame].frame;
            let context = MatchContext::for_frame(frame, judge.grid, judge.cells);
            Some((frame.rectified().ok()?, context))
        };
        let pairs: Vec<_> = self.frames.iter().filter_map(input).collect();
        self.matcher.match_ahead(&pairs, 1);
        self.matcher.ahead.drain(..).collect()
    }
}

/// The frames of a batch that wait for an algorithm.
struct MatchLane {
    frames: VecDeque<usize>,
    /// Matchers that wait: the first one, and copies.
    idle: Vec<ReadyMatcher>,
    /// Maps for its results.
    spent: Vec<DisparityMap>,
    is_program: bool,
    /// The algorithm, if its pairs may be matched in any order.
    copied: Option<Algorithm>,
}

impl MatchLane {
    fn new(mut first: ReadyMatcher, frames: VecDeque<usize>) -> Self {
        let (spec, copies) = (first.algorithm.spec(), std::mem::take(&mut first.copies));
        let is_free = !first.matcher.has_run_memory() && spec.matches_images();
        Self {
            frames,
            spent: std::mem::take(&mut first.spent),
            is_program: spec.is_program(),
            copied: is_free.then(|| first.algorithm.clone()),
            idle: std::iter::once(first).chain(copies).collect(),
        }
    }

    fn into_matcher(mut self) -> ReadyMatcher {
        // Copies are not set up for a size.
        self.idle.sort_by_key(|own| own.warm_for.is_none());
        let mut first = self.idle.remove(0);
        (first.copies, first.spent) = (self.idle, self.spent);
        first
    }
}

/// The jobs of a batch, which the threads share.
struct JobQueue {
    lanes: Vec<MatchLane>,
    /// Number of the copies that may be added.
    copies_left: usize,
    /// True while a program matches.
    has_program: bool,
    /// The error of a matcher that panicked; it ends the batch.
    died: Option<Error>,
}

impl JobQueue {
    fn new(entries: Vec<ReadyMatcher>, batch: &[AskedFrame], jobs: usize) -> Self {
        let copies: usize = entries.iter().map(|entry| entry.copies.len()).sum();
        let lanes = entries.into_iter().enumerate().map(|(place, entry)| {
            let frames = (0..batch.len()).filter(|i| batch[*i].asked.contains(&place));
            MatchLane::new(entry, frames.collect())
        });
        Self {
            lanes: lanes.collect(),
            copies_left: (jobs - 1).saturating_sub(copies),
            has_program: false,
            died: None,
        }
    }

    /// The next frame of the algorithm that is furthest behind, of those with a matcher that waits,
    /// else of those that may have another copy.
    fn next(&mut self) -> Option<MatchJob> {
        if self.died.is_some() || interrupt::requested() {
            return None;
        }
        let (has_program, may_copy) = (self.has_program, self.copies_left > 0);
        let is_ready = |lane: &MatchLane| {
            if lane.idle.is_empty() {
                may_copy && lane.copied.is_some()
            } else {
                !(lane.is_program && has_program)
            }
        };
        let lanes = self.lanes.iter_mut().enumerate();
        let ready = lanes.filter(|(_, lane)| !lane.frames.is_empty() && is_ready(lane));
        let (place, lane) = ready.min_by_key(|(_, own)| (own.idle.is_empty(), own.frames[0]))?;
        let mut matcher = match lane.idle.pop() {
            Some(matcher) => matcher,
            None => {
                self.copies_left -= 1;
                ReadyMatcher::new(lane.copied.as_ref()?).ok()?
            }
        };
        matcher.spent.extend(lane.spent.pop());
        self.has_program |= lane.is_program;
        let several = matcher.matcher.batch().min(lane.frames.len());
        Some(MatchJob {
            frames: lane.frames.drain(..several).collect(),
            place,
            matcher,
        })
    }

    /// Takes a matcher back, and its error if it panicked.
    fn put_back(&mut self, job: MatchJob, died: Option<Error>) {
        let lane = &mut self.lanes[job.place];
        self.has_program &= !lane.is_program;
        lane.idle.push(job.matcher);
        self.died = self.died.take().or(died);
    }
}
