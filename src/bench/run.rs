//! The one loop: frames from a source through the algorithms and the judge into the sinks.
//!
//! Replay, score, record and the experiments are this loop with other sources and sinks. What does
//! not iterate frames (`svl match`, `svl bench`) calls a matcher directly.

use crate::report::{LoggedResult, ResultLog};
use crate::sink::{RunEnd, RunStart, Sink};
use crate::source::Source;
use std::collections::VecDeque;
use std::sync::mpsc::{channel, sync_channel};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};
use svl_core::counted;
use svl_core::depth;
use svl_core::matcher::{Algorithm, MatchContext, MatchOutput, Matcher, ProgramRecord};
use svl_core::stereo::{DisparityMap, Estimate, Frame, Losses, RectifiedPair, Rig};
use svl_core::timing::StageTimes;
use svl_core::{Error, Result};
use svl_data::manifest::Manifest;
use svl_data::memory::MemoryUse;
use svl_data::score::{Judge, Judged, MetricValues};

/// Watches a run and may end it.
pub trait Monitor {
    /// Called after every frame; `false` ends the run without an error.
    fn go_on(&mut self, done: u64) -> bool;

    /// Reports that an algorithm failed on a pair, and why.
    fn failed(&mut self, failure: &str) {
        tracing::warn!("{failure}");
    }

    /// Does `work`, and says what memory it took, where the program counts that.
    fn memory_of(&mut self, work: &mut dyn FnMut()) -> Option<MemoryUse> {
        work();
        None
    }
}

/// How fast frames are taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pace {
    /// As soon as the previous one is done.
    Asap,
    /// At their stamps, that many times faster.
    Times(f64),
    /// As soon as possible, and measured: frames are read in batches, matched while nothing else of
    /// svl runs, then judged and taken by the sinks. The times of a pair are those of its median
    /// matching of so many, which must have equal results; matchings that set up the memory for a
    /// size of images do not count.
    Measured { rounds: usize },
}

impl Pace {
    /// What the times of such a run are of, in words.
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
        }
    }
}

/// What a run did.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Outcome {
    /// Frames that every sink took.
    pub frames: u64,
    /// Estimates that are missing because their algorithm failed on that frame.
    pub failures: u64,
    /// Whether the monitor ended it.
    pub interrupted: bool,
    /// What of the source is in no frame.
    pub losses: Losses,
}

impl Outcome {
    /// What is missing, in words; nothing for a complete run.
    pub fn missing(&self) -> Option<String> {
        let Losses {
            unpaired,
            late,
            unreadable,
            cut,
            without_truth: _,
            grabber: _,
        } = self.losses;
        let count = |n: u64, noun: &str| (n > 0).then(|| counted(n, noun));
        let missing = [
            count(unreadable, "pair").map(|n| n + " could not be read"),
            count(unpaired, "image").map(|n| n + " had no partner"),
            count(late, "image").map(|n| n + " came too late"),
            count(cut, "frame").map(|n| n + " of a video that is cut off"),
            count(self.failures, "pair").map(|n| format!("algorithms failed on {n}")),
        ];
        let missing: Vec<_> = missing.into_iter().flatten().collect();
        (!missing.is_empty()).then(|| missing.join(" and "))
    }
}

/// The algorithms of a run, ready to match.
pub struct Matchers(Vec<RunMatcher>);

struct RunMatcher {
    label: String,
    matcher: Box<dyn Matcher>,
    last_failure: String,
    /// Maps that the sinks are done with.
    spent: Vec<DisparityMap>,
    memory: Option<MemoryUse>,
    /// Where its parameters determine it.
    max_disparity: Option<i32>,
    /// Whether the user was warned of it.
    warned_of_range: bool,
    /// The size of images that it has memory for, once it was measured.
    warm_for: Option<(usize, usize)>,
    /// What it made of the next pairs, where it matches several at once.
    ahead: VecDeque<Result<Vec<MatchOutput>>>,
}

impl RunMatcher {
    fn new(algorithm: &Algorithm) -> Result<Self> {
        let label = algorithm.label().to_owned();
        let matcher = algorithm.build().map_err(|error| match error {
            Error::Usage(reason) => Error::Usage(format!("{label}: {reason}")),
            other => other,
        })?;
        Ok(Self {
            label,
            matcher,
            last_failure: String::new(),
            spent: Vec::new(),
            memory: None,
            max_disparity: algorithm.max_disparity(),
            // What filters say is too close is not missed.
            warned_of_range: !algorithm.filters().is_empty(),
            warm_for: None,
            ahead: VecDeque::new(),
        })
    }
}

impl Matchers {
    /// Builds the algorithms; each label may occur once, as it names rows and topics.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the algorithm that occurs twice or cannot be built.
    pub fn new(algorithms: &[Algorithm]) -> Result<Self> {
        for (i, algorithm) in algorithms.iter().enumerate() {
            let label = algorithm.label();
            if algorithms[..i].iter().any(|other| other.label() == label) {
                return Err(Error::Usage(format!(
                    "{label}: named twice; name each algorithm once"
                )));
            }
        }
        let entries = algorithms.iter().map(RunMatcher::new);
        entries.collect::<Result<_>>().map(Self)
    }

    /// Puts an algorithm in the place of the one with its label; the others keep their memory.
    ///
    /// # Errors
    /// As [`Matchers::new`].
    pub fn replace(&mut self, algorithm: &Algorithm) -> Result<()> {
        let label = algorithm.label();
        if let Some(entry) = self.0.iter_mut().find(|entry| entry.label == label) {
            *entry = RunMatcher {
                warned_of_range: entry.warned_of_range,
                ..RunMatcher::new(algorithm)?
            };
        }
        Ok(())
    }

    /// Takes those from the `first` on away, into their own: what they have stays with them.
    #[must_use]
    pub fn split_off(&mut self, first: usize) -> Self {
        Self(self.0.split_off(first.min(self.0.len())))
    }

    /// Takes those with these labels away, into their own.
    #[must_use]
    pub fn take(&mut self, labels: &[&str]) -> Self {
        let is_named = |entry: &mut RunMatcher| labels.contains(&entry.label.as_str());
        Self(self.0.extract_if(.., is_named).collect())
    }

    /// Puts others behind these.
    pub fn append(&mut self, mut others: Self) {
        self.0.append(&mut others.0);
    }

    /// The same without the warning of ranges that end before obstacles do: where algorithms change
    /// all the time, it would come all the time.
    #[must_use]
    pub fn without_warnings(mut self) -> Self {
        self.0
            .iter_mut()
            .for_each(|entry| entry.warned_of_range = true);
        self
    }

    /// No algorithms: the frames go to the sinks as they are.
    pub fn none() -> Self {
        Self(Vec::new())
    }

    /// Completes the manifest with the memory of each algorithm, known after a measured run whose
    /// monitor counts it, and with why it failed on its last pair.
    pub fn complete(&self, manifest: &mut Manifest) {
        for record in &mut manifest.algorithms {
            if let Some(entry) = self.0.iter().find(|entry| entry.label == record.label) {
                record.program = entry.matcher.program();
                let process = record.program.as_ref().and_then(|p| p.memory_bytes);
                record.memory_bytes = process.or(entry.memory.map(|memory| memory.peak));
                for warning in record.program.iter().flat_map(ProgramRecord::warnings) {
                    tracing::warn!("{}: {warning}", entry.label);
                }
                let failure = Some(&entry.last_failure).filter(|failure| !failure.is_empty());
                record.failure = failure.cloned();
            }
        }
    }

    /// Keeps the maps of estimates for later frames.
    fn take_back(&mut self, spent: Spent) {
        for (label, map) in spent {
            if let Some(entry) = self.0.iter_mut().find(|entry| entry.label == label) {
                entry.spent.push(map);
            }
        }
    }
}

/// Maps that the sinks are done with, with the labels of their algorithms.
type Spent = Vec<(String, DisparityMap)>;

/// Runs every frame of `source` through the algorithms into `sinks`, between their
/// [`Sink::begin_run`] and [`Sink::end_run`]. Both are called also when the run fails, so that what
/// came before the error is kept. The caller finishes the sinks.
///
/// Where the algorithms leave a core free, frames are read ahead and taken by the sinks in threads
/// of their own, in the same order; else all happens in turn, so that other threads do not disturb
/// the times that are measured. With a source that listens all happens in turn too. The threads for
/// reading and for the sinks are rayon pools of their own: a source or a sink that uses rayon never
/// waits for the caller's pool, whose only thread may be waiting for them. A measured run
/// ([`Pace::Measured`]) matches first and has the two threads afterwards, batch by batch.
///
/// An algorithm that fails on a frame leaves no estimate for it, and the others go on. It is
/// reported to the monitor, but not again while the algorithm fails for the same reason frame
/// after frame.
///
/// The outcome holds also for a run that failed, with the first error of the source, of a raw pair
/// for an algorithm, or of a sink.
pub fn run(
    source: &mut dyn Source,
    matchers: &mut Matchers,
    start: &RunStart<'_>,
    pace: Pace,
    sinks: &mut [Box<dyn Sink>],
    monitor: &mut dyn Monitor,
) -> (Outcome, Result<()>) {
    let mut matching = Matching {
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
        failures: 0,
        interrupted: false,
    };
    // Pairs of a run that was interrupted.
    matching
        .matchers
        .0
        .iter_mut()
        .for_each(|entry| entry.ahead.clear());
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let has_free_core = cores > rayon::current_num_threads();
    let reads_ahead = has_free_core && !source.listens();
    let mut taken = 0;
    let begun = sinks.iter_mut().try_for_each(|sink| sink.begin_run(start));
    let ran = begun.and_then(|()| {
        if matching.rounds.is_some() && !source.listens() {
            in_batches(source, &mut matching, sinks, &mut taken)
        } else if !matching.matchers.0.is_empty() && reads_ahead {
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
        frames: taken,
        failures: matching.failures,
        interrupted: matching.interrupted,
        losses: source.finish(taken),
    };
    let error = ran.as_ref().err().map(ToString::to_string);
    let end = RunEnd {
        losses: &outcome.losses,
        error: error.as_deref(),
    };
    let ended = sinks
        .iter_mut()
        .map(|sink| sink.end_run(&end))
        .fold(Ok(()), Result::and);
    (outcome, ran.and(ended))
}

/// Everything in the calling thread, frame by frame.
fn in_turn(
    source: &mut dyn Source,
    matching: &mut Matching<'_>,
    sinks: &mut [Box<dyn Sink>],
    taken: &mut u64,
) -> Result<()> {
    while let Some(frame) = source.next()? {
        let matched = matching.matched(&frame)?;
        let judged = judged(matching.judge, frame, matched);
        push(sinks, &judged)?;
        *taken += 1;
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

/// Frames that wait between two threads: enough that neither waits for a single slow one.
const BETWEEN: usize = 2;

/// Reading, matching, and judging with the sinks in a thread each.
fn side_by_side(
    source: &mut dyn Source,
    matching: &mut Matching<'_>,
    sinks: &mut [Box<dyn Sink>],
    taken: &mut u64,
) -> Result<()> {
    std::thread::scope(|scope| {
        let (read, frames) = sync_channel(BETWEEN);
        let reading = move || {
            // Ends with the source, its first error, or when the receiver is gone.
            while let Some(next) = source.next().transpose() {
                let failed = next.is_err();
                if read.send(next).is_err() || failed {
                    break;
                }
            }
        };
        scope.spawn(|| in_own_pool(reading));
        let judge = matching.judge;
        let (send, received) = sync_channel::<(Frame, Vec<Matched>)>(BETWEEN);
        let (give_back, given_back) = channel();
        let push_all = move || {
            for (frame, matched) in received {
                let judged = judged(judge, frame, matched);
                push(sinks, &judged)?;
                *taken += 1;
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
        // The sinks take what was matched, whatever happened after.
        drop(send);
        let pushed = pushing
            .join()
            .unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        pushed.and(ran)
    })
}

/// A batch of a measured run: at most so many frames,
const BATCH_FRAMES: usize = 32;
/// so many bytes of frames and maps,
const BATCH_BYTES: usize = 256 << 20;
/// and so much time to match it, so that a slow program's results are written soon.
const BATCH_TIME: Duration = Duration::from_secs(1);

/// Batches are matched while nothing else runs; then one is read while the sinks take the last.
fn in_batches(
    source: &mut dyn Source,
    matching: &mut Matching<'_>,
    sinks: &mut [Box<dyn Sink>],
    taken: &mut u64,
) -> Result<()> {
    let judge = matching.judge;
    let mut waiting = Waiting::new(matching.matchers.0.len());
    in_own_pool(|| waiting.fill(source));
    loop {
        let (mut matched, mut ran) = (Vec::new(), Ok(true));
        let began = Instant::now();
        while matches!(ran, Ok(true)) && began.elapsed() < BATCH_TIME {
            let Some(frame) = waiting.frames.pop_front() else {
                break;
            };
            matching.ask_for_maps(&frame, sinks);
            matching.match_ahead(&frame, &waiting.frames);
            ran = matching.matched(&frame).map(|estimates| {
                matched.push((frame, estimates));
                matching.go_on()
            });
        }
        let goes_on = matches!(ran, Ok(true));
        let pushed = std::thread::scope(|scope| {
            if goes_on {
                scope.spawn(|| in_own_pool(|| waiting.fill(source)));
            }
            let (send, received) = sync_channel(BETWEEN);
            let judging = move || {
                let mut judging = matched.into_iter();
                // Ends early when a sink failed.
                judging.all(|(frame, matched)| send.send(judged(judge, frame, matched)).is_ok())
            };
            scope.spawn(|| in_own_pool(judging));
            let push_all = || -> Result<Vec<Spent>> {
                let mut back = Vec::new();
                for judged in received {
                    push(sinks, &judged)?;
                    *taken += 1;
                    back.push(spent(judged));
                }
                sinks.iter_mut().try_for_each(|sink| sink.settle())?;
                Ok(back)
            };
            let pushing = scope.spawn(|| in_own_pool(push_all));
            pushing
                .join()
                .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        });
        for spent in pushed? {
            matching.matchers.take_back(spent);
        }
        if !ran? {
            return Ok(());
        }
        if waiting.frames.is_empty()
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
    /// How the source ended.
    end: Option<Result<()>>,
}

impl Waiting {
    fn new(algorithms: usize) -> Self {
        Self {
            frames: VecDeque::new(),
            algorithms,
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
        while self.end.is_none() && self.frames.len() < BATCH_FRAMES && held < BATCH_BYTES {
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
fn in_own_pool<R: Send>(work: impl FnOnce() -> R + Send) -> R {
    static IDLE: Mutex<Vec<rayon::ThreadPool>> = Mutex::new(Vec::new());
    let idle = || IDLE.lock().unwrap_or_else(PoisonError::into_inner);
    let kept = idle().pop();
    let pool = kept.unwrap_or_else(|| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        pool.expect("a thread can be started")
    });
    let done = pool.install(work);
    idle().push(pool);
    done
}

/// What an algorithm made of a frame.
struct Matched {
    algorithm: String,
    output: MatchOutput,
    range_px: Option<f64>,
    times: StageTimes,
    /// Metrics and hash, where an earlier part of the run has them.
    logged: Option<(MetricValues, u128)>,
}

/// Completes the estimates of a frame with their grids and scores them.
fn judged(judge: &Judge, frame: Frame, matched: Vec<Matched>) -> Judged {
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
    let estimates = matched.into_iter().map(estimate).collect();
    let mut judged = judge.judge(frame, estimates);
    for (scored, logged) in judged.estimates.iter_mut().zip(logged) {
        if let Some((metrics, hash)) = logged {
            scored.metrics = metrics;
            scored.hash = hash;
        }
    }
    judged
}

fn push(sinks: &mut [Box<dyn Sink>], judged: &Judged) -> Result<()> {
    sinks.iter_mut().try_for_each(|sink| sink.take(judged))
}

fn spent(judged: Judged) -> Spent {
    let estimates = judged.estimates.into_iter();
    estimates
        .map(|scored| (scored.estimate.algorithm, scored.estimate.disparity))
        .collect()
}

impl RunMatcher {
    fn compute(&mut self, pair: RectifiedPair<'_>, context: &MatchContext) -> Result<MatchOutput> {
        let mut output = match self.spent.pop() {
            Some(map) => MatchOutput::with_memory(map),
            None => MatchOutput::new()?,
        };
        output.begin();
        self.matcher.compute(pair, context, &mut output)?;
        // Cells are scored by their place: another shape would compare the wrong ones.
        match &output.grid {
            Some(grid) if grid.shape() != context.grid.shape() => Err(Error::Invalid(
                "its depth grid does not have the shape of the run's".into(),
            )),
            _ => Ok(output),
        }
    }

    /// Matches several pairs at once, `rounds` times.
    fn match_ahead(&mut self, pairs: &[(RectifiedPair<'_>, MatchContext<'_>)], rounds: usize) {
        let mut ahead: Vec<_> = pairs.iter().map(|_| Ok(Vec::new())).collect();
        for _ in 0..rounds {
            self.matcher.announce(pairs);
            for ((pair, context), outputs) in pairs.iter().zip(&mut ahead) {
                // Also where it failed before: an answer waits for each.
                add(outputs, self.compute(*pair, context));
            }
        }
        self.ahead.extend(ahead);
    }

    /// Warns once where its range of disparities ends before obstacles do.
    fn warn_of_range(&mut self, rig: &Rig, obstacle_m: f64) {
        let nearest_m = |px: i32| rig.depth_m(f64::from(px));
        let Some(nearest_m) = self.max_disparity.and_then(nearest_m) else {
            return;
        };
        if nearest_m >= obstacle_m && !std::mem::replace(&mut self.warned_of_range, true) {
            let px = rig.disparity_px(obstacle_m).ceil();
            tracing::warn!(
                "{}: max_disparity sees nothing nearer than {nearest_m:.2} m, but obstacles are \
                 what is nearer than {obstacle_m} m: it takes more than {px} px",
                self.label
            );
        }
    }

    /// Sets up its memory for that pair, and learns how much that is.
    fn warm_up(
        &mut self,
        pair: RectifiedPair<'_>,
        context: &MatchContext,
        monitor: &mut dyn Monitor,
    ) {
        self.spent.clear();
        let used = monitor.memory_of(&mut || {
            // An error comes again when the pair is matched, and is reported then.
            if let Ok(output) = self.compute(pair, context) {
                self.spent.push(output.disparity);
            }
        });
        let before = self.memory.unwrap_or_default();
        self.memory = used.map(|used| MemoryUse {
            peak: before
                .peak
                .max(used.peak.saturating_add_signed(before.kept)),
            kept: before.kept + used.kept,
        });
    }

    /// A result of an earlier part of the run. Its map is empty.
    fn logged(
        &mut self,
        result: &LoggedResult,
        (width, height): (usize, usize),
    ) -> Result<Matched> {
        let mut output = MatchOutput::new()?;
        output.disparity = DisparityMap::new(width, height)?;
        output.grid = Some(result.grid.clone());
        Ok(Matched {
            algorithm: self.label.clone(),
            output,
            range_px: None,
            times: result.times(),
            logged: Some((result.row.metrics, result.hash)),
        })
    }

    /// The output whose time is the median, by nearest rank, of outputs for one pair.
    fn median(&mut self, mut outputs: Vec<MatchOutput>) -> Result<MatchOutput> {
        if let [first, others @ ..] = &outputs[..]
            && !others.is_empty()
        {
            let hash = first.disparity.hash();
            if others.iter().any(|other| other.disparity.hash() != hash) {
                return Err(Error::Invalid(
                    "its result differs when the pair is matched again".into(),
                ));
            }
        }
        outputs.sort_by_key(|output| output.clock.times().total());
        let middle = outputs.swap_remove((outputs.len() - 1) / 2);
        let others = outputs.into_iter().map(|output| output.disparity);
        self.spent.extend(others);
        Ok(middle)
    }
}

/// Adds an output to those of earlier rounds, until the first error.
fn add(outputs: &mut Result<Vec<MatchOutput>>, output: Result<MatchOutput>) {
    if let Ok(before) = outputs {
        match output {
            Ok(output) => before.push(output),
            Err(error) => *outputs = Err(error),
        }
    }
}

/// What stands between source and sinks.
struct Matching<'a> {
    matchers: &'a mut Matchers,
    judge: &'a Judge,
    pacer: Pacer,
    /// How often a pair is matched in a measured run.
    rounds: Option<usize>,
    /// Results of an earlier part of the run, which take the place of matching,
    log: Option<&'a ResultLog>,
    /// that with this seed,
    seed: Option<u64>,
    /// unless a sink needs the map of that algorithm.
    needed: Vec<bool>,
    monitor: &'a mut dyn Monitor,
    frames: u64,
    failures: u64,
    interrupted: bool,
}

impl<'a> Matching<'a> {
    /// Learns whose maps of the next frame the sinks need.
    fn ask_for_maps(&mut self, frame: &Frame, sinks: &mut [Box<dyn Sink>]) {
        if self.log.is_some() {
            self.needed.clear();
            self.needed.resize(self.matchers.0.len(), false);
            let shows_checkpoint = self.judge.shows_checkpoint(frame);
            for sink in sinks {
                sink.ask_for_maps(frame, shows_checkpoint, &mut self.needed);
            }
        }
    }

    fn matched(&mut self, frame: &Frame) -> Result<Vec<Matched>> {
        self.pacer.wait_for(frame);
        if self.matchers.0.is_empty() {
            // A recording of raw pairs needs no rectified ones.
            return Ok(Vec::new());
        }
        let pair = frame.rectified()?;
        let context = MatchContext::of(frame, self.judge.grid, self.judge.cells);
        if self.rounds.is_some() {
            let (obstacle_m, _) = self.judge.cells.obstacle_and_clear_m();
            for entry in &mut self.matchers.0 {
                if entry.warm_for.replace(pair.size()) == Some(pair.size()) {
                    continue;
                }
                entry.warm_up(pair, &context, self.monitor);
                if let Some(rig) = frame.rig() {
                    entry.warn_of_range(rig, obstacle_m);
                }
            }
        }
        let logged = self.logged(frame);
        let is_known = |i: usize| logged[i].is_some() && self.needed.get(i) == Some(&false);
        // In turns, so that a slow moment of the machine meets all algorithms.
        let mut rounds: Vec<_> = self.matchers.0.iter().map(|_| Ok(Vec::new())).collect();
        for _ in 0..self.rounds.unwrap_or(1) {
            let entries = self.matchers.0.iter_mut().zip(&mut rounds).enumerate();
            for (_, (entry, outputs)) in entries.filter(|(i, _)| !is_known(*i)) {
                if entry.ahead.is_empty() && outputs.is_ok() {
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
        let mut matched = Vec::with_capacity(rounds.len());
        for (i, (entry, outputs)) in self.matchers.0.iter_mut().zip(rounds).enumerate() {
            if is_known(i)
                && let Some(result) = logged[i]
            {
                matched.push(entry.logged(result, pair.size())?);
                continue;
            }
            match outputs.and_then(|outputs| entry.median(outputs)) {
                Ok(output) => {
                    entry.last_failure.clear();
                    let times = logged[i].map_or_else(|| output.clock.times(), |r| r.times());
                    matched.push(Matched {
                        algorithm: entry.label.clone(),
                        range_px: entry.max_disparity.map(f64::from),
                        times,
                        output,
                        logged: None,
                    });
                }
                Err(error) => {
                    self.failures += 1;
                    let failure = error.to_string();
                    if failure != entry.last_failure {
                        let label = &entry.label;
                        self.monitor
                            .failed(&format!("{label} on pair {}: {failure}", frame.sequence));
                    }
                    entry.last_failure = failure;
                }
            }
        }
        Ok(matched)
    }

    /// Matches a frame and those that wait behind it by the algorithms that take several pairs at
    /// once.
    fn match_ahead(&mut self, frame: &Frame, waiting: &VecDeque<Frame>) {
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

    /// What an earlier part of the run made of the frame, per algorithm.
    fn logged(&self, frame: &Frame) -> Vec<Option<&'a LoggedResult>> {
        let Some(log) = self.log else {
            return vec![None; self.matchers.0.len()];
        };
        let pair = log.pair(&self.judge.run, self.seed, frame);
        let entries = self.matchers.0.iter();
        entries.map(|entry| pair.get(&entry.label)).collect()
    }

    fn go_on(&mut self) -> bool {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::{AlignmentMonitor, AssumeRectified};
    use std::sync::Arc;
    use svl_core::stereo::{ExtraPlanes, Geometry, Gray, StereoPair};
    use svl_data::manifest::Manifest;

    /// That many frames, then an error.
    struct Failing {
        left: u64,
        geometry: Geometry,
        listens: bool,
        heard: Vec<u64>,
        /// Whether it is read from a pool, or from a thread that has one of its own.
        in_pool: bool,
    }

    impl Failing {
        fn new(left: u64) -> Self {
            Self {
                left,
                geometry: Geometry::Rectified(None),
                listens: false,
                heard: Vec::new(),
                in_pool: rayon::current_thread_index().is_some(),
            }
        }
    }

    impl Source for Failing {
        fn name(&self) -> String {
            "failing".into()
        }

        fn next(&mut self) -> Result<Option<Frame>> {
            self.left = self
                .left
                .checked_sub(1)
                .ok_or_else(|| Error::Invalid("source failed".into()))?;
            // As the arena renders: rayon must work in this thread, not in the pool of the caller,
            // whose only thread waits for this one.
            let in_pool = rayon::current_thread_index().is_some();
            assert!(in_pool || !self.in_pool, "rayon would use another pool");
            let image = Gray::filled(40, 20, self.left as u8)?;
            Ok(Some(Frame {
                sequence: self.left,
                stamp_ns: 0,
                name: None,
                pair: StereoPair::new(image.clone(), image)?,
                geometry: self.geometry,
                pose: None,
                truth: None,
                color: None,
                exposure: Default::default(),
            }))
        }

        fn pairs(&self) -> Option<u64> {
            None
        }

        fn listens(&self) -> bool {
            self.listens
        }

        fn hear(&mut self, judged: &Judged) {
            assert_eq!(judged.frame.sequence, self.left, "before the next frame");
            self.heard.push(judged.frame.sequence);
        }
    }

    /// What happened to a sink, in order.
    type Log = Arc<Mutex<Vec<String>>>;

    /// Takes that many frames, then fails.
    struct Full(usize, Log);

    impl Full {
        fn note(&self, what: String) {
            self.1.lock().unwrap().push(what);
        }
    }

    impl Sink for Full {
        fn begin_run(&mut self, _: &RunStart<'_>) -> Result<()> {
            self.note("begin".into());
            Ok(())
        }

        fn take(&mut self, judged: &Judged) -> Result<()> {
            assert_eq!(judged.estimates.len(), 1);
            if self.0 == 0 {
                return Err(Error::Invalid("sink failed".into()));
            }
            self.0 -= 1;
            self.note(judged.frame.sequence.to_string());
            Ok(())
        }

        fn end_run(&mut self, end: &RunEnd<'_>) -> Result<()> {
            self.note(format!("end {}", end.error.unwrap_or("well")));
            Ok(())
        }

        fn finish(self: Box<Self>) -> Result<()> {
            Ok(())
        }
    }

    struct Until(u64);

    impl Monitor for Until {
        fn go_on(&mut self, done: u64) -> bool {
            done < self.0
        }
    }

    /// What the sink saw and how the run ended.
    fn ran(source: &mut dyn Source, sink_takes: usize, last: u64) -> (String, Outcome, Result<()>) {
        let algorithms = ["v3:max_disparity=8".parse().unwrap()];
        let manifest = Manifest::new("test", &algorithms).unwrap();
        let judge = Judge::default();
        let start = RunStart {
            manifest: &manifest,
            log: None,
            seed: None,
            judge: &judge,
        };
        let log = Log::default();
        let mut sinks: Vec<Box<dyn Sink>> = vec![Box::new(Full(sink_takes, Arc::clone(&log)))];
        let mut matchers = Matchers::new(&algorithms).unwrap();
        let (asap, until) = (Pace::Asap, &mut Until(last));
        let (outcome, ended) = run(source, &mut matchers, &start, asap, &mut sinks, until);
        (log.lock().unwrap().join(" "), outcome, ended)
    }

    fn pool(threads: usize) -> rayon::ThreadPool {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap()
    }

    #[test]
    fn every_frame_is_taken_in_order_until_the_same_end() {
        // From the only thread of a pool, and from outside of any.
        let in_pool = |work: &mut (dyn FnMut() + Send)| pool(1).install(work);
        let outside = |work: &mut (dyn FnMut() + Send)| work();
        for with in [&in_pool as &dyn Fn(&mut (dyn FnMut() + Send)), &outside] {
            with(&mut || {
                let (log, _, ended) = ran(&mut Failing::new(4), 100, 100);
                assert_eq!(log, "begin 3 2 1 0 end source failed");
                assert_eq!(ended.unwrap_err().to_string(), "source failed");
                let (log, _, ended) = ran(&mut Failing::new(9), 3, 100);
                assert_eq!(log, "begin 8 7 6 end sink failed");
                assert_eq!(ended.unwrap_err().to_string(), "sink failed");
                let (log, outcome, ended) = ran(&mut Failing::new(20), 100, 4);
                assert_eq!(log, "begin 19 18 17 16 end well");
                ended.unwrap();
                assert_eq!((outcome.frames, outcome.interrupted), (4, true));
            });
        }
    }

    #[test]
    fn a_source_that_listens_hears_each_frame_before_the_next() {
        let mut source = Failing {
            listens: true,
            ..Failing::new(20)
        };
        // Through the wrappers of every run of the command line.
        let mut rectified = AssumeRectified::new(&mut source);
        let mut monitored = AlignmentMonitor::new(&mut rectified);
        ran(&mut monitored, 100, 3).2.unwrap();
        assert_eq!(source.heard, [19, 18, 17]);
    }

    #[test]
    fn memory_is_set_up_once_for_a_size_in_all_runs() {
        struct Warmed(usize);
        impl Monitor for Warmed {
            fn go_on(&mut self, done: u64) -> bool {
                done < 2
            }

            fn memory_of(&mut self, work: &mut dyn FnMut()) -> Option<MemoryUse> {
                self.0 += 1;
                work();
                None
            }
        }
        let algorithms = ["v3:max_disparity=8", "v1:max_disparity=8"].map(|a| a.parse().unwrap());
        let manifest = Manifest::new("test", &algorithms).unwrap();
        let judge = Judge::default();
        let start = RunStart {
            manifest: &manifest,
            log: None,
            seed: None,
            judge: &judge,
        };
        let mut matchers = Matchers::new(&algorithms).unwrap();
        let warmed = |matchers: &mut Matchers| {
            let (mut monitor, pace) = (Warmed(0), Pace::Measured { rounds: 1 });
            let mut source = Failing::new(9);
            run(&mut source, matchers, &start, pace, &mut [], &mut monitor)
                .1
                .unwrap();
            monitor.0
        };
        assert_eq!((warmed(&mut matchers), warmed(&mut matchers)), (2, 0));
        // What takes another's place has to be set up; so does nothing that was away meanwhile.
        matchers.replace(&algorithms[0]).unwrap();
        let away = matchers.split_off(1);
        assert_eq!(warmed(&mut matchers), 1);
        matchers.append(away);
        assert_eq!(warmed(&mut matchers), 0);
    }

    /// Answers the announced pairs by their numbers, and fails on the second.
    struct Several(VecDeque<usize>);

    impl Matcher for Several {
        fn batch(&self) -> usize {
            3
        }

        fn announce(&mut self, pairs: &[(RectifiedPair<'_>, MatchContext<'_>)]) {
            self.0 = (0..pairs.len()).collect();
        }

        fn compute(
            &mut self,
            pair: RectifiedPair<'_>,
            _: &MatchContext,
            output: &mut MatchOutput,
        ) -> Result<()> {
            let (width, height) = pair.size();
            let number = self.0.pop_front().expect("announced");
            let map = &mut output.disparity;
            map.resize(width, height, ExtraPlanes::NONE)?;
            map.rows_mut()
                .for_each(|mut row| row.accept(0, number as f32));
            match number {
                1 => Err(Error::Invalid("too dark".into())),
                _ => Ok(()),
            }
        }
    }

    #[test]
    fn of_several_pairs_each_has_its_own_outputs() {
        let mut entry = RunMatcher {
            matcher: Box::new(Several(VecDeque::new())),
            ..RunMatcher::new(&"v3".parse().unwrap()).unwrap()
        };
        let image = Gray::filled(4, 2, 0).unwrap();
        let pair = StereoPair::new(image.clone(), image).unwrap();
        let pair = (RectifiedPair::assume(&pair), MatchContext::default());
        entry.match_ahead(&[pair; 3], 2);
        let firsts = entry.ahead.iter().map(|outputs| match outputs {
            Ok(outputs) => {
                let maps = outputs.iter().map(|output| output.disparity.at(0, 0));
                maps.map(|disparity| format!("{disparity:?}")).collect()
            }
            Err(error) => vec![error.to_string()],
        });
        let firsts: Vec<Vec<_>> = firsts.collect();
        let expected = [vec!["Ok(0.0)"; 2], vec!["too dark"], vec!["Ok(2.0)"; 2]];
        assert_eq!(firsts, expected);
    }

    #[test]
    fn raw_pairs_are_not_matched() {
        let mut source = Failing {
            geometry: Geometry::Raw,
            ..Failing::new(20)
        };
        let error = ran(&mut source, 100, 3).2.unwrap_err().to_string();
        assert!(error.contains("--calib"), "{error}");
    }
}
