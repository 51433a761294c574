//! The work while a person turns knobs: the frame that is shown first, for the screen and for
//! Rerun, then a sample of the source, until something else is wanted.

use super::shown::{FrameSide, Job, LABELS, SampleView, TuneState, sides, title};
use crate::cli::shared::viewer;
use parking_lot::{Condvar, Mutex};
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use svl::manifest::Manifest;
use svl::notice::Notice;
use svl::pass::{Matchers, Monitor, Pace};
use svl::report::compare::changes;
use svl::report::{Row, RowRef, Rows};
use svl::scenario::{is_of_witness, witness};
use svl::score::{Judge, Judged, METRICS, Metric, MetricSource as _};
use svl::sink::{Outbox, PassStart, RerunTarget, Sink, TableSink, ViewedScene, WatchSink, finish};
use svl::stereo::Frame;
use svl::tune::{SampleCells, Sampler, TunedSetting, evaluate, spread_order};

/// Longest time that frames of the sample are matched before a new job is looked for.
const MAX_CHUNK_TIME: Duration = Duration::from_millis(20);

/// Pace at which times are taken.
const MEASURED: Pace = Pace::Measured { rounds: 1 };

/// Largest number of frames of cameras that make the sample.
const MAX_SEEN: usize = 64;

/// Largest number of settings that are remembered: those of a person's day.
const MAX_REMEMBERED: usize = 10_000;

#[derive(Default)]
struct State {
    job: Option<Job>,
    shown: TuneState,
    is_busy: bool,
    stops: bool,
}

impl State {
    /// True if what is under way has to give way.
    fn is_interrupted(&self) -> bool {
        self.job.is_some() || self.stops
    }
}

type SharedState = Arc<(Mutex<State>, Condvar)>;

/// The thread that runs algorithms.
pub(super) struct TuneWorker {
    shared: SharedState,
    thread: Option<JoinHandle<()>>,
}

impl TuneWorker {
    /// `sampler`: reads the sample; without it the sample is of the frames that were shown.
    pub(super) fn begin(
        sampler: Option<Sampler>,
        judge: Judge,
        viewer: Option<(RerunTarget, String)>,
    ) -> svl::Result<Self> {
        let manifest = Manifest::new("tune", &[])?;
        let rerun = viewer.map(|(target, name)| {
            let algorithms = LABELS.map(|label| (label.to_owned(), String::new()));
            let info = ViewedScene {
                scenario: name,
                algorithms: algorithms.to_vec(),
                ..ViewedScene::new(&manifest, Vec::new())
            };
            viewer::viewer()?.tuning(target, &info)
        });
        let rerun = rerun.transpose()?;
        let shared = SharedState::default();
        let mut bench = Bench {
            shared: Arc::clone(&shared),
            manifest,
            judge,
            sampler,
            seen: VecDeque::new(),
            rerun,
            matchers: Matchers::default(),
            built: None,
            rows: BTreeMap::new(),
            cells: SampleCells::default(),
            compared: None,
        };
        let thread = std::thread::spawn(move || bench.run());
        Ok(Self {
            shared,
            thread: Some(thread),
        })
    }

    /// Asks for something else: what is under way gives way to it.
    pub(super) fn ask(&self, job: Job) {
        let mut state = self.shared.0.lock();
        state.job = Some(job);
        state.is_busy = true;
        self.shared.1.notify_all();
    }

    /// The state to show now; messages are reported once.
    pub(super) fn shown(&self) -> TuneState {
        let mut state = self.shared.0.lock();
        let says = state.shown.says.take();
        TuneState {
            says,
            ..state.shown.clone()
        }
    }

    /// Waits until nothing is under way.
    pub(super) fn settle(&self) {
        let (state, changed) = &*self.shared;
        changed.wait_while(&mut state.lock(), |state| state.is_busy);
    }
}

impl Drop for TuneWorker {
    fn drop(&mut self) {
        self.shared.0.lock().stops = true;
        self.shared.1.notify_all();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Ends a run as soon as something else is wanted.
struct KeyWatch<'a> {
    shared: &'a SharedState,
    failure: Option<String>,
    /// A frame that a person waits for is run to its end.
    ends: bool,
}

impl Monitor for KeyWatch<'_> {
    fn go_on(&mut self, _: u64) -> bool {
        !(self.ends && self.shared.0.lock().is_interrupted())
    }

    fn failed(&mut self, failure: &Notice) {
        self.failure = Some(failure.to_string());
    }
}

/// State of the thread.
struct Bench {
    shared: SharedState,
    manifest: Manifest,
    judge: Judge,
    sampler: Option<Sampler>,
    seen: VecDeque<Arc<Frame>>,
    rerun: Option<Box<dyn Sink>>,
    matchers: Matchers,
    /// The settings that the matchers are built of, and the rows; `None` where one could not be.
    built: Option<[TunedSetting; 2]>,
    /// By the number of the frame.
    rows: BTreeMap<u64, [Row; 2]>,
    /// The cells of these frames, where there is no truth.
    cells: SampleCells,
    /// Result of the setting compared with for the frame that is shown.
    compared: Option<(Arc<Frame>, FrameSide)>,
}

impl Bench {
    fn run(&mut self) {
        loop {
            let mut state = self.shared.0.lock();
            while !state.is_interrupted() {
                state.is_busy = false;
                self.shared.1.notify_all();
                self.shared.1.wait(&mut state);
            }
            let Some(job) = state.job.take().filter(|_| !state.stops) else {
                return;
            };
            drop(state);
            if let Err(error) = self.do_job(&job) {
                let shown = &mut self.shared.0.lock().shown;
                shown.failure = Some(error.to_string());
                shown.done += 1;
            }
        }
    }

    fn do_job(&mut self, job: &Job) -> svl::Result<()> {
        self.prepare(&job.settings, &job.frame)?;
        self.show_frame(&job.frame)?;
        let newest = self.seen.back().map(|frame| frame.sequence);
        if self.sampler.is_none() && newest != Some(job.frame.sequence) {
            self.seen.push_back(Arc::clone(&job.frame));
            if self.seen.len() > MAX_SEEN
                && let Some(oldest) = self.seen.pop_front()
            {
                self.rows.remove(&oldest.sequence);
            }
        }
        self.do_sample(job)
    }

    /// Builds the matchers if the settings changed.
    fn prepare(&mut self, settings: &[TunedSetting; 2], frame: &Frame) -> svl::Result<()> {
        let [now, _] = settings;
        let algorithms = settings.each_ref().map(|setting| &setting.algorithm);
        // Both are built the next time where one of them cannot be.
        let built = self.built.take();
        let is_old = [0, 1].map(|i| {
            let mut built = built.iter();
            built.any(|built| built[i].algorithm == *algorithms[i])
        });
        let mut rules = built.iter().map(|[built, _]| (built.grid, built.cells));
        let is_ruled = rules.any(|rules| rules == (now.grid, now.cells));
        if is_old == [true; 2] && is_ruled {
            self.built = built;
            return Ok(());
        }
        self.rows.clear();
        self.cells.clear();
        {
            let shown = &mut self.shared.0.lock().shown;
            shown.failure = None;
            shown.sample = SampleView {
                frames: shown.sample.frames,
                ..SampleView::default()
            };
        }
        let labelled = [0, 1].map(|i| algorithms[i].clone().called(LABELS[i].to_owned()));
        self.judge.grid = now.grid;
        self.judge.cells = now.cells;
        self.manifest.algorithms = Manifest::new("tune", &labelled)?.algorithms;
        // Their titles in Rerun are as they are written, without defaults.
        for (record, algorithm) in self.manifest.algorithms.iter_mut().zip(algorithms) {
            record.parameters = title(algorithm);
        }
        if is_old == [false; 2] {
            let is_own = algorithms.iter().any(|own| is_of_witness(own.spec().name));
            let is_seen = frame.truth.is_none() && frame.rectified().is_ok() && !is_own;
            let witness = is_seen.then(witness);
            let algorithms: Vec<_> = labelled.iter().cloned().chain(witness).collect();
            self.matchers = Matchers::new(&algorithms)?.without_warnings();
        } else {
            let mut others = labelled.iter().zip(is_old).filter(|(_, is_old)| !is_old);
            others.try_for_each(|(algorithm, _)| self.matchers.replace(algorithm))?;
        }
        if !(is_old[1] && is_ruled) {
            self.compared = None;
        }
        self.built = Some(settings.clone());
        Ok(())
    }

    fn show_frame(&mut self, frame: &Arc<Frame>) -> svl::Result<()> {
        let seen: Outbox<Vec<FrameSide>> = Outbox::default();
        let outbox = seen.clone();
        let watch_sink = WatchSink(move |judged: &Judged| outbox.put(sides(judged)));
        let mut sinks: Vec<Box<dyn Sink>> = vec![Box::new(watch_sink)];
        sinks.extend(self.rerun.take());
        let frames = [Arc::clone(frame)];
        // Results that are known of this frame are not computed again.
        let known = self.compared.take();
        let known = known.filter(|(other, _)| Arc::ptr_eq(other, frame));
        let idle = known.as_ref().map(|_| self.matchers.split_off(1));
        // Quickly: the memory of new matchers is in its times, which are measured afterwards.
        let mut ran = self.evaluate(&frames, &mut sinks, Pace::Asap);
        if let Err(error) = &ran
            && sinks.len() > 1
        {
            // A viewer that was closed is no reason to end.
            let words = format!("Rerun is gone, continuing without pictures: {error}");
            self.shared.0.lock().shown.says = Some(words);
            sinks.truncate(1);
            ran = self.evaluate(&frames, &mut sinks, Pace::Asap);
        }
        self.rerun = sinks.drain(1..).next();
        self.matchers.append(idle.unwrap_or_default());
        ran?;
        let mut seen = seen.take();
        seen.extend(known.map(|(_, compared)| compared));
        let side = |label: &str| seen.iter().find(|side| side.algorithm == label).cloned();
        let sides = LABELS.map(side);
        self.compared = sides[1].clone().map(|side| (Arc::clone(frame), side));
        {
            let shown = &mut self.shared.0.lock().shown;
            shown.sides = sides;
            shown.done += 1;
        }
        let rows = self.evaluate(&frames, &mut Vec::new(), MEASURED)?;
        for side in self.shared.0.lock().shown.sides.iter_mut().flatten() {
            let row = rows.iter().find(|row| row.algorithm == side.algorithm);
            let us = row.and_then(|row| row.total_us);
            side.ms = us.map(|us| us as f64 / 1e3);
        }
        if self.sampler.is_none() {
            self.keep(&rows);
        }
        Ok(())
    }

    /// Runs frames; the sinks are left to the caller.
    fn evaluate(
        &mut self,
        frames: &[Arc<Frame>],
        sinks: &mut Vec<Box<dyn Sink>>,
        pace: Pace,
    ) -> svl::Result<Vec<Row>> {
        let rows = Outbox::default();
        sinks.insert(0, Box::new(TableSink::new(None, None, &rows)?));
        sinks.push(Box::new(self.cells.clone()));
        let start = PassStart::new(&self.manifest, None, &self.judge);
        let mut watch = KeyWatch {
            shared: &self.shared,
            failure: None,
            // A person waits for what is done as soon as possible.
            ends: pace != Pace::Asap,
        };
        let ran = evaluate(frames, &mut self.matchers, &start, pace, sinks, &mut watch);
        let failure = watch.failure;
        finish(vec![sinks.remove(0)])?;
        sinks.pop();
        ran?;
        if failure.is_some() {
            self.shared.0.lock().shown.failure = failure;
        }
        Ok(rows.take())
    }

    fn keep(&mut self, rows: &[Row]) {
        for rows in rows.chunk_by(|row, other| row.sequence == other.sequence) {
            // A frame on which one of them failed is not a pair.
            if let [now, compared] = rows {
                let pair = [now, compared].map(Row::clone);
                self.rows.insert(now.sequence, pair);
            }
        }
    }

    /// Reads and runs the sample, as far as nothing else is wanted.
    fn do_sample(&mut self, job: &Job) -> svl::Result<()> {
        let shared = Arc::clone(&self.shared);
        let is_interrupted = || shared.0.lock().is_interrupted();
        if let Some(sampler) = &mut self.sampler {
            while !is_interrupted() && sampler.step()? {}
        }
        let frames: Vec<_> = match &self.sampler {
            Some(sampler) => sampler.frames.to_vec(),
            None => self.seen.iter().cloned().collect(),
        };
        shared.0.lock().shown.sample.frames = frames.len();
        let spread = spread_order(frames.len()).into_iter();
        let mut left: Vec<_> = spread.map(|i| Arc::clone(&frames[i])).collect();
        left.retain(|frame| !self.rows.contains_key(&frame.sequence));
        let (mut left, mut chunk, mut shown) = (&left[..], 1, 1);
        while !left.is_empty() {
            if is_interrupted() {
                return Ok(());
            }
            let (now, later) = left.split_at(chunk.min(left.len()));
            let began = Instant::now();
            let rows = self.evaluate(now, &mut Vec::new(), MEASURED)?;
            self.keep(&rows);
            left = later;
            if began.elapsed() < MAX_CHUNK_TIME / 2 {
                chunk *= 2;
            }
            // Intervals take a moment: they are shown at first, then ever more seldom.
            if self.rows.len() >= shown {
                self.publish();
                shown = 2 * self.rows.len();
            }
        }
        self.publish();
        if !is_interrupted() && !self.rows.is_empty() {
            let shown = &mut shared.0.lock().shown;
            let written = job.settings[0].algorithm.written();
            let tried = Arc::make_mut(&mut shown.tried);
            tried.retain(|(other, _)| *other != written);
            if tried.len() < MAX_REMEMBERED {
                tried.push((written, shown.sample.changes.clone()));
            }
        }
        Ok(())
    }

    fn publish(&self) {
        let side =
            |side: usize| -> Rows { self.rows.values().map(|rows| rows[side].clone()).collect() };
        let (now, compared) = (side(0), side(1));
        let [now, compared] = [&now, &compared].map(|rows| rows.iter().collect::<Vec<_>>());
        let mut changes = changes(&compared, &now, METRICS);
        let rule = self.judge.cells;
        let labels = [LABELS[1], LABELS[0]];
        changes.extend(self.cells.changes(self.rows.keys(), labels, rule));
        let has = |metric: &Metric| changes.iter().any(|change| change.metric == metric);
        let metrics = [
            ("wrong", true),
            ("estimated_right", false),
            ("coverage", false),
        ];
        let ranked_by = metrics
            .into_iter()
            .filter_map(|(name, worse)| Some((Metric::find(name)?, worse)))
            .find(|(metric, _)| has(metric));
        let value = |row: &RowRef<'_>| {
            let (metric, _) = ranked_by?;
            match metric.estimated() {
                Some(_) => self.cells.right(row.sequence(), LABELS[0], rule),
                None => row.metrics().get(metric.name),
            }
        };
        let values = now.iter().map(|row| (row.sequence(), value(row))).collect();
        let sample = &mut self.shared.0.lock().shown.sample;
        *sample = SampleView {
            done: now.len(),
            frames: sample.frames,
            changes,
            ranked_by,
            values,
        };
    }
}
