//! The threads of a pass: all in turn, side by side, or batch by batch where times are measured or
//! several threads match.

use super::matchers::Spent;
use super::matching::{MatchedFrame, Matching, judged};
use crate::sink::Sink;
use crate::source::Source;
use parking_lot::Mutex;
use std::collections::VecDeque;
use std::sync::mpsc::{channel, sync_channel};
use std::thread::ScopedJoinHandle;
use std::time::{Duration, Instant};
use svl_core::Result;
use svl_core::stereo::Frame;
use svl_score::judge::{Judge, Judged};
use svl_score::plausibility::TruthScales;

/// Runs everything in the calling thread, frame by frame.
pub(super) fn in_turn(
    source: &mut dyn Source,
    matching: &mut Matching<'_>,
    sinks: &mut [Box<dyn Sink>],
    taken: &mut TakenFrames,
) -> Result<()> {
    while let Some(frame) = source.next()? {
        let matched = matching.matched(&frame)?;
        let judged = judged(matching.judge, frame, matched);
        taken.push(matching.judge, sinks, &judged)?;
        if source.listens() {
            source.hear(&judged);
        }
        matching.matchers.take_back(spent(judged));
        if !matching.go_on() {
            break;
        }
    }
    Ok(())
}

/// Number of frames that may wait between two threads: enough to absorb a single slow frame.
const MAX_QUEUED_FRAMES: usize = 2;

/// Reads, matches, and scores with the sinks, in a thread each.
pub(super) fn side_by_side(
    source: &mut dyn Source,
    matching: &mut Matching<'_>,
    sinks: &mut [Box<dyn Sink>],
    taken: &mut TakenFrames,
) -> Result<()> {
    std::thread::scope(|scope| {
        let (read, frames) = sync_channel(MAX_QUEUED_FRAMES);
        let reading = move || {
            // Ends with the source, with its first error, or when the receiver is gone.
            while let Some(next) = source.next().transpose() {
                let failed = next.is_err();
                if read.send(next).is_err() || failed {
                    break;
                }
            }
        };
        scope.spawn(|| in_own_pool(reading));
        let judge = matching.judge;
        let (send, received) = sync_channel::<(Frame, MatchedFrame)>(MAX_QUEUED_FRAMES);
        let (give_back, given_back) = channel();
        let push_all = move || {
            for (frame, matched) in received {
                let judged = judged(judge, frame, matched);
                taken.push(judge, sinks, &judged)?;
                // At the end the receiver is gone.
                let _ = give_back.send(spent(judged));
            }
            Ok(())
        };
        let pushing = scope.spawn(|| in_own_pool(push_all));
        let mut ran = Ok(());
        for next in frames {
            let matched =
                next.and_then(|frame| matching.matched(&frame).map(|matched| (frame, matched)));
            let sent = matched.map(|matched| send.send(matched).is_ok());
            given_back
                .try_iter()
                .for_each(|spent| matching.matchers.take_back(spent));
            match sent {
                Ok(true) if matching.go_on() => {}
                Ok(_) => break,
                Err(error) => {
                    ran = Err(error);
                    break;
                }
            }
        }
        // The sinks get every matched frame, even after an error.
        drop(send);
        joined(pushing).and(ran)
    })
}

/// Limit on the frames of a batch of a measured pass.
const MAX_BATCH_FRAMES: usize = 32;
/// Limit on the frames of a batch of jobs, and on those read ahead of it.
const MAX_AHEAD: usize = 8;
/// Limit on the bytes of a batch's frames and maps.
const MAX_BATCH_BYTES: usize = 256 << 20;
/// Limit on the time to match a batch, so that a slow program's results are written soon.
const MAX_BATCH_TIME: Duration = Duration::from_secs(1);

/// Matches waiting frames, for a time. The result is false if the user ended it.
fn match_batch(
    matching: &mut Matching<'_>,
    waiting: &mut Waiting,
) -> (Vec<(Frame, MatchedFrame)>, Result<bool>) {
    let (mut matched, mut ran) = (Vec::new(), Ok(true));
    let began = Instant::now();
    while matches!(ran, Ok(true)) && began.elapsed() < MAX_BATCH_TIME {
        let Some(frame) = waiting.frames.pop_front() else {
            break;
        };
        matching.match_ahead(&frame, &waiting.frames);
        ran = matching.matched(&frame).map(|estimates| {
            matched.push((frame, estimates));
            matching.go_on()
        });
    }
    (matched, ran)
}

/// Waits for a thread, and panics as it did.
pub(crate) fn joined<T>(thread: ScopedJoinHandle<'_, T>) -> T {
    let ended = thread.join();
    ended.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

/// Batches are matched while nothing else runs; then one is read while the sinks take the last. By
/// jobs a batch is matched meanwhile, too, but its memory is measured before.
pub(super) fn in_batches(
    source: &mut dyn Source,
    matching: &mut Matching<'_>,
    jobs: Option<usize>,
    sinks: &mut [Box<dyn Sink>],
    taken: &mut TakenFrames,
) -> Result<()> {
    let judge = matching.judge;
    let max_frames = jobs.map_or(MAX_BATCH_FRAMES, |_| MAX_AHEAD);
    let mut waiting = Waiting::new(matching.matchers.0.len(), max_frames);
    in_own_pool(|| waiting.fill(source));
    let mut by_jobs = (Vec::new(), Ok(true));
    loop {
        let (matched, ran) = match jobs {
            None => match_batch(matching, &mut waiting),
            Some(_) => std::mem::replace(&mut by_jobs, (Vec::new(), Ok(true))),
        };
        let goes_on = matches!(ran, Ok(true));
        let batch = match jobs {
            Some(_) if goes_on => in_own_pool(|| matching.begin_batch(&mut waiting.frames)),
            _ => (Vec::new(), Ok(())),
        };
        let pushed = std::thread::scope(|scope| {
            if goes_on {
                scope.spawn(|| in_own_pool(|| waiting.fill(source)));
            }
            let (send, received) = sync_channel(MAX_QUEUED_FRAMES);
            let judging = move || {
                let mut judging = matched.into_iter();
                // Ends early when a sink failed.
                judging.all(|(frame, matched)| send.send(judged(judge, frame, matched)).is_ok())
            };
            scope.spawn(|| in_own_pool(judging));
            let push_all = || -> Result<Vec<Spent>> {
                let mut back = Vec::new();
                for judged in received {
                    taken.push(judge, sinks, &judged)?;
                    back.push(spent(judged));
                }
                sinks.iter_mut().try_for_each(|sink| sink.settle())?;
                Ok(back)
            };
            let pushing = scope.spawn(|| in_own_pool(push_all));
            if let Some(jobs) = jobs {
                by_jobs = matching.match_by(jobs, batch);
            }
            joined(pushing)
        });
        for spent in pushed? {
            matching.matchers.take_back(spent);
        }
        if !ran? {
            return Ok(());
        }
        if waiting.frames.is_empty()
            && matches!(&by_jobs, (matched, Ok(_)) if matched.is_empty())
            && let Some(end) = waiting.end.take()
        {
            return end;
        }
    }
}

/// Frames that were read and not matched yet.
struct Waiting {
    frames: VecDeque<Frame>,
    algorithms: usize,
    max_frames: usize,
    /// The end of the source.
    end: Option<Result<()>>,
}

impl Waiting {
    fn new(algorithms: usize, max_frames: usize) -> Self {
        Self {
            frames: VecDeque::new(),
            algorithms,
            max_frames,
            end: None,
        }
    }

    /// Reads a batch.
    fn fill(&mut self, source: &mut dyn Source) {
        // Both images, colour and truth; a map per algorithm.
        let bytes = |frame: &Frame| {
            let (width, height) = frame.pair.size();
            width * height * (9 + 6 * self.algorithms)
        };
        let mut held: usize = self.frames.iter().map(bytes).sum();
        while self.end.is_none() && self.frames.len() < self.max_frames && held < MAX_BATCH_BYTES {
            match source.next() {
                Ok(Some(frame)) => {
                    held += bytes(&frame);
                    self.frames.push_back(frame);
                }
                Ok(None) => self.end = Some(Ok(())),
                Err(error) => self.end = Some(Err(error)),
            }
        }
    }
}

/// Does `work` in a rayon pool of one thread, where what it hands to rayon happens, too. Pools are
/// kept for later work: rayon never frees one that is the thread that made it.
pub(crate) fn in_own_pool<R: Send>(work: impl FnOnce() -> R + Send) -> R {
    static IDLE: Mutex<Vec<rayon::ThreadPool>> = Mutex::new(Vec::new());
    let idle = || IDLE.lock();
    let kept = idle().pop();
    let pool = kept.unwrap_or_else(|| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        pool.expect("a thread can be started")
    });
    let done = pool.install(work);
    idle().push(pool);
    done
}

/// The frames that every sink took.
#[derive(Default)]
pub(super) struct TakenFrames {
    pub(super) frames: u64,
    pub(super) duration: Duration,
    last_ns: Option<u64>,
    pub(super) scales: TruthScales,
}

impl TakenFrames {
    fn push(&mut self, judge: &Judge, sinks: &mut [Box<dyn Sink>], judged: &Judged) -> Result<()> {
        judge.check_pair(judged)?;
        self.scales.observe(judged);
        sinks.iter_mut().try_for_each(|sink| sink.take(judged))?;
        self.frames += 1;
        let stamp_ns = judged.frame.stamp_ns;
        let last_ns = self.last_ns.replace(stamp_ns).unwrap_or(stamp_ns);
        self.duration += Duration::from_nanos(stamp_ns.saturating_sub(last_ns));
        Ok(())
    }
}

fn spent(judged: Judged) -> Spent {
    let estimates = judged.estimates.into_iter();
    estimates
        .map(|scored| (scored.estimate.algorithm, scored.estimate.disparity))
        .collect()
}
