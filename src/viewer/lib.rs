//! Rerun as the viewer of svl: maps, depth grid and metrics of every algorithm side by side.
//!
//! ```text
//! world                        z up
//!   arena                      the true geometry, where known (static)
//!   trail                      where the camera has been
//!   rig/left                   Transform3D, Pinhole
//!   rig/left/image
//! algo/<name>/overlay          the thesis's picture of the depth grid
//!            /overlay/cells    the distances of its cells, as text
//!            /disparity /depth /depth/none /why
//!            /ssdpi            of algorithms that have one
//!            /points           the depths of the cloud
//!            /latency/<stage>  milliseconds, and /latency/total
//!            /coverage         percent of the pixels
//!            /wrong_cells      where truth and rig are known
//!            /row_offset       rows, of algorithms that measure the vertical misalignment
//! truth/overlay  truth/depth
//! run/parameters  run/verdicts  run/frames
//! legend/why
//! ```
//! Timelines: `pair`, the frame's number, and `time`, its stamp; during tuning also `change`, which
//! counts the updates. Maps are logged for all frames, or for some ([`RerunDetail`]); between them
//! they are cleared. `run/frames` lists those frames, and the worst second.

mod blueprint;
mod board;
mod detail;
mod file;
mod info;
mod layout;
mod overlay;
mod picture;
mod push;
mod scale;
mod step;
mod target;
mod world;

use board::RerunBoard;
use detail::ListedFrames;
use info::AlgorithmPath;
use rerun::log::ChunkBatcherConfig;
use rerun::{
    Clear, RecordingStream, RecordingStreamBuilder, Rgba32, SeriesLines, TextDocument, TimeCell,
    ViewCoordinates,
};
use scale::Scale;
use std::path::Path;
use std::time::Duration;
use step::RerunSteps;
use svl_bench::sink::{
    BoardView, PassStart, RerunDetail, RerunTarget, Sink, StepView, Verdicts, ViewedScene, Viewer,
};
use svl_core::Result;
use svl_core::stereo::{ExtraPlanes, Frame, Pose, Rig, TruthOrigin};
use svl_core::timing::Stage;
use svl_files::overlay::{ColorEnd, algorithm_colors, plot_color};
use svl_score::judge::{Checkpoint, Judged, METRICS, Metric, MetricSource as _};
use target::Destination;

/// Rerun's application id: recordings of one application share their layout.
const APPLICATION: &str = "svl";
/// The timelines, the one the viewer opens with first.
const TIMELINES: [&str; 2] = ["pair", "time"];
/// The timeline of a person's changes, which is in front during tuning.
const CHANGES: &str = "change";
/// Time that a viewer may take to receive a frame while a person waits for it.
const SENT: Duration = Duration::from_secs(3);
const CAMERA: &str = "world/rig/left";
const IMAGE: &str = "world/rig/left/image";
const LEGEND: &str = "legend/why";
/// The maps that every algorithm has, and its cloud.
const MAPS: [&str; 4] = ["disparity", "why", "depth", "points"];
/// The first frames, which determine the end of the colours of disparities: a block of a report.
const MAX_COLORED: u64 = 64;
/// Stamps from here on (2001, in nanoseconds) are interpreted as Unix time, smaller ones as the
/// time since the start of the recording.
const EPOCH_NS: u64 = 1_000_000_000_000_000_000;

/// Limit on the bytes of a file's batch, estimated by images and maps, and by the numbers and texts
/// of an algorithm's estimate. A batch repeats names and metadata of the columns of each entity,
/// which cost more than what a few pairs have; a run that is killed loses at most two.
const MAX_BATCH_BYTES: usize = 48 << 20;
/// Limit on its pairs, as those of a block, which a killed run keeps.
const MAX_BATCH_PAIRS: usize = 64;
const BYTES_PER_ESTIMATE: usize = 32 << 10;
const BYTES_PER_MAP_PIXEL: usize = 4;

/// Rerun, as built into svl.
pub struct Rerun;

impl Viewer for Rerun {
    fn run(
        &self,
        target: RerunTarget,
        detail: RerunDetail,
        info: &ViewedScene,
        verdicts: Option<Verdicts>,
    ) -> Result<Box<dyn Sink>> {
        let sink = RerunSink::new(target, detail, info)?;
        Ok(Box::new(RerunSink { verdicts, ..sink }))
    }

    fn tuning(&self, target: RerunTarget, info: &ViewedScene) -> Result<Box<dyn Sink>> {
        let sink = RerunSink::new(target, RerunDetail::Full, info)?;
        let changes = Some(0);
        Ok(Box::new(RerunSink { changes, ..sink }))
    }

    fn board(&self, target: RerunTarget, columns: usize) -> Result<Box<dyn BoardView>> {
        Ok(Box::new(RerunBoard::new(target, columns)?))
    }

    fn steps(&self, target: RerunTarget) -> Result<Box<dyn StepView>> {
        Ok(Box::new(RerunSteps::new(target)?))
    }

    fn save_layout(&self, file: &Path, topics: &[String], layout: &Path) -> Result<bool> {
        layout::save_recording_layout(file, topics, layout)
    }

    fn find(&self) -> Result<()> {
        target::find_viewer()
    }

    fn find_program(&self) -> Result<()> {
        target::find_program()
    }
}

/// Writes a run to Rerun.
struct RerunSink {
    stream: RecordingStream,
    target: Destination,
    algorithms: Vec<AlgorithmPath>,
    /// The end of the colours of disparities, while the first frames determine it.
    color_end: ColorEnd,
    colored: u64,
    /// `None` before the layout was sent; then true if it has views of the truth.
    begun: Option<bool>,
    camera: Option<(Scale, Option<Rig>, (usize, usize))>,
    last_pose: Option<Pose>,
    /// Start of the current run on the timelines.
    start: Moment,
    /// Starts of all runs, by seed and recording.
    starts: Vec<((Option<u64>, String), Moment)>,
    /// The last frame's position on them.
    last: Option<Moment>,
    detail: RerunDetail,
    frames: ListedFrames,
    /// True if the frame being logged is listed, and if it has maps.
    is_listed: bool,
    has_maps: bool,
    /// Bytes of the batch under way.
    batched: usize,
    /// Number and name of the run's checkpoints.
    checkpoints: Vec<String>,
    verdicts: Option<Verdicts>,
    /// During tuning, number of updates shown.
    changes: Option<i64>,
}

/// A position on the timelines.
#[derive(Clone, Copy, Default)]
struct Moment {
    pair: u64,
    time_ns: u64,
}

impl Moment {
    /// The pair of a run that starts here.
    fn after(self, sequence: u64, stamp_ns: u64) -> Self {
        Self {
            pair: self.pair.saturating_add(sequence),
            time_ns: self.time_ns.saturating_add(stamp_ns),
        }
    }
}

impl RerunSink {
    /// Opens `target` and writes the static entities of the run. The layout follows with the first
    /// frame.
    ///
    /// # Errors
    /// If the file exists (it is never overwritten: remove it first) or cannot be created; if there
    /// is no viewer to spawn, or none at the URL. Always one line.
    fn new(target: RerunTarget, detail: RerunDetail, run: &ViewedScene) -> Result<Self> {
        let mut builder = RecordingStreamBuilder::new(APPLICATION)
            .recording_id(run.recording_id.as_str())
            .recording_name(run.scenario.as_str())
            .send_properties(true);
        if target.file().is_some() {
            // The sink ends batches, never while matching is measured.
            builder = builder.batcher_config(ChunkBatcherConfig::NEVER);
        }
        let target = Destination(target);
        let stream = target.open(builder)?;
        let sink = Self {
            stream,
            target,
            algorithms: info::algorithms(run.algorithms.iter().map(|(label, _)| label.clone())),
            color_end: ColorEnd::default(),
            colored: 0,
            begun: None,
            camera: None,
            last_pose: None,
            start: Moment::default(),
            starts: Vec::new(),
            last: None,
            detail,
            frames: ListedFrames::default(),
            is_listed: false,
            has_maps: false,
            batched: 0,
            checkpoints: Vec::new(),
            verdicts: None,
            changes: None,
        };
        sink.log_static("world", &ViewCoordinates::RIGHT_HAND_Z_UP())?;
        if !run.wireframe.is_empty() {
            sink.log_static("world/arena", &world::wireframe(&run.wireframe))?;
        }
        sink.log_static(
            "run/parameters",
            &TextDocument::from_markdown(info::parameters(run)),
        )?;
        sink.log_static(
            "run/verdicts",
            &TextDocument::from_markdown(info::awaiting(run)),
        )?;
        sink.log_static(LEGEND, &picture::classes())?;
        for path in [
            "truth/overlay",
            "truth/overlay/percentiles",
            "truth/overlay/cells",
            "truth/depth",
            "truth/depth/none",
            LEGEND,
        ] {
            sink.log_static(path, &world::on_image())?;
        }
        let labels: Vec<_> = sink
            .algorithms
            .iter()
            .map(|own| own.label.as_str())
            .collect();
        for (algorithm, color) in sink.algorithms.iter().zip(algorithm_colors(&labels)) {
            sink.style(algorithm, color)?;
        }
        Ok(sink)
    }

    /// Frames of reference, names and colours of an algorithm's entities.
    fn style(&self, algorithm: &AlgorithmPath, rgb: [u8; 3]) -> Result<()> {
        let overlays = [
            "overlay",
            "overlay/percentiles",
            "overlay/cells",
            "depth/none",
        ];
        for map in overlays.iter().chain(&MAPS) {
            self.log_static(&algorithm.path(map), &world::on_image())?;
        }
        for (k, stage) in Stage::ALL.into_iter().enumerate() {
            self.log_static(
                &algorithm.path(&format!("latency/{}", stage.name())),
                &line(stage.name(), color(plot_color(k + 1))),
            )?;
        }
        let plots = METRICS.iter().filter_map(|metric| metric.plot);
        for number in plots.chain(["latency/total"]) {
            self.log_static(&algorithm.path(number), &line(&algorithm.label, color(rgb)))?;
        }
        Ok(())
    }

    /// Sends the layout, as soon as a frame and its estimates determine the views.
    fn begin(&mut self, judged: &Judged, scale: &Scale) -> Result<()> {
        let frame = &judged.frame;
        for algorithm in &mut self.algorithms {
            let mut estimates = judged.estimates.iter().map(|scored| &scored.estimate);
            let estimate = estimates.find(|estimate| estimate.algorithm == algorithm.label);
            algorithm.extra = estimate.map_or(ExtraPlanes::NONE, |e| e.disparity.extra());
        }
        for algorithm in self.algorithms.iter().filter(|a| a.extra.ssdpi) {
            self.log_static(&algorithm.path("ssdpi"), &world::on_image())?;
        }
        // A fraction with denominator 0 has no value: its plot would stay empty.
        let has = |metric: &&Metric| {
            let mut estimates = judged.estimates.iter();
            estimates.any(|scored| scored.metrics.value(metric).is_some())
        };
        let first = judged.estimates.first();
        let cloud = first.map(|scored| scored.estimate.disparity.disparity());
        let facts = layout::Facts {
            truth: frame.truth.as_ref().map(|truth| match &truth.kind.origin {
                TruthOrigin::Exact => "truth".to_owned(),
                other => other.to_string(),
            }),
            rig: frame.rig().is_some(),
            size: frame.name.is_none().then(|| frame.pair.size()),
            eye: world::eye(scale, frame, cloud),
            plots: METRICS
                .iter()
                .filter(|m| m.plot.is_some())
                .filter(has)
                .collect(),
        };
        let (root, timeline) = match self.changes {
            None => (layout::run(&self.algorithms, &facts), TIMELINES[0]),
            Some(_) => (layout::tuning(&self.algorithms, &facts), CHANGES),
        };
        let (app, cursor) = (APPLICATION.into(), self.target.cursor());
        blueprint::send(&root, app, timeline, cursor, &self.stream)
            .map_err(|error| self.target.failed(error))
    }

    /// Writes the batch under way if it has that many bytes.
    fn end_batch(&mut self, bytes: usize) -> Result<()> {
        if self.batched < bytes {
            return Ok(());
        }
        self.batched = 0;
        self.flush()
    }

    /// Waits until everything logged is written or sent.
    fn flush(&self) -> Result<()> {
        self.target.flush(&self.stream)
    }

    /// The colour scale of the frame's camera, kept as long as rig and image size are unchanged.
    fn scale(&mut self, frame: &Frame) -> Result<Scale> {
        let size = frame.pair.size();
        match self.camera {
            Some((scale, rig, scale_size)) if rig.as_ref() == frame.rig() && scale_size == size => {
                Ok(scale)
            }
            _ => {
                let scale = Scale::new(frame);
                self.camera = Some((scale, frame.rig().copied(), size));
                self.log_static(LEGEND, &picture::legend(size))?;
                Ok(scale)
            }
        }
    }

    /// Logs the end of the colours of disparities in all frames, by the first ones: by their truth,
    /// else by the estimates.
    fn push_colors(&mut self, judged: &Judged) -> Result<()> {
        self.colored += 1;
        if self.colored > MAX_COLORED {
            return Ok(());
        }
        let maps = judged.estimates.iter();
        let maps = maps.map(|scored| scored.estimate.disparity.disparity());
        match &judged.frame.truth {
            Some(truth) => self.color_end.add(&truth.disparity),
            None => maps.for_each(|map| self.color_end.add(map)),
        }
        // A viewer shows the first frame at once.
        let end_px = self.color_end.end_px();
        let Some(end_px) = end_px.filter(|_| self.colored.is_power_of_two()) else {
            return Ok(());
        };
        let range = picture::disparity_range(end_px);
        let mut paths = self.algorithms.iter().map(|own| own.path("disparity"));
        paths.try_for_each(|path| self.log_static(&path, &range))
    }

    /// Sets the time of what is logged next. `is_wall`: it has the stamps of a clock on the wall.
    fn set_time(&self, now: Moment, is_wall: bool) {
        let nanos = i64::try_from(now.time_ns).unwrap_or(i64::MAX);
        self.stream
            .set_time_sequence(TIMELINES[0], i64::try_from(now.pair).unwrap_or(i64::MAX));
        self.stream.set_time(
            TIMELINES[1],
            if is_wall {
                TimeCell::from_timestamp_nanos_since_epoch(nanos)
            } else {
                TimeCell::from_duration_nanos(nanos)
            },
        );
    }
}

fn color([r, g, b]: [u8; 3]) -> Rgba32 {
    Rgba32::from_rgb(r, g, b)
}

/// The look of a line over time.
fn line(name: &str, color: Rgba32) -> SeriesLines {
    SeriesLines::new()
        .with_names([name])
        .with_colors([color])
        .with_widths([1.5])
}

impl Sink for RerunSink {
    /// Places the next run after the previous one on the timelines, with a second between.
    fn begin_pass(&mut self, start: &PassStart<'_>) -> Result<()> {
        let words = |c: &Checkpoint| format!("checkpoint {}, {}", c.number, c.name);
        self.checkpoints = start.judge.checkpoints.iter().map(words).collect();
        self.frames.begin_pass();
        if self.changes.is_some() {
            let info = ViewedScene::new(start.manifest, Vec::new());
            let parameters = TextDocument::from_markdown(info::parameters(&info));
            self.log_static("run/parameters", &parameters)?;
        } else if let Some(last) = self.last {
            self.start = Moment {
                pair: last.pair + 1,
                time_ns: last.time_ns + 1_000_000_000,
            };
            self.last_pose = None;
        }
        let run = (start.seed, start.judge.run.name.clone());
        self.starts.push((run, self.start));
        Ok(())
    }

    /// Logs a frame. An algorithm without an estimate for it shows nothing there.
    fn take(&mut self, judged: &Judged) -> Result<()> {
        let frame = &judged.frame;
        let scale = self.scale(frame)?;
        // Also at the first frame with a truth, which only some pairs may have.
        let has_truth = frame.truth.is_some();
        if self.begun.is_none_or(|had_truth| has_truth && !had_truth) {
            self.begin(judged, &scale)?;
            self.begun = Some(has_truth);
        }
        let now = self.start.after(frame.sequence, frame.stamp_ns);
        let before = self.last.replace(now);
        let is_first = before.is_none();
        // The existing content is kept while only an algorithm changes.
        let is_again = self.changes.is_some() && before.is_some_and(|last| last.pair == now.pair);
        self.set_time(now, frame.stamp_ns >= EPOCH_NS);
        if let Some(changes) = &mut self.changes {
            *changes += 1;
            self.stream.set_time_sequence(CHANGES, *changes);
        }
        self.is_listed = self.frames.next(judged);
        if self.is_listed {
            self.push_name(judged)?;
        }
        let has_maps = self.is_listed || self.detail == RerunDetail::Full;
        if std::mem::replace(&mut self.has_maps, has_maps) && !has_maps {
            self.clear_maps()?;
        }
        if !is_again {
            self.push_scene(frame, &scale)?;
            if is_first {
                // The viewer's time cursor starts at the first batch of a file.
                self.flush()?;
            }
            self.push_truth(judged, &scale)?;
        }
        self.push_colors(judged)?;
        for (i, algorithm) in self.algorithms.iter().enumerate() {
            let mut estimates = judged.estimates.iter();
            match estimates.find(|scored| scored.estimate.algorithm == algorithm.label) {
                Some(scored) => self.push_estimate(algorithm, scored, frame, &scale)?,
                None if is_again && i > 0 => {}
                None => self.log(&format!("algo/{}", algorithm.part), &Clear::recursive())?,
            }
        }
        if self.changes.is_some() && self.target.0.file().is_none() {
            let sent = self.stream.flush_with_timeout(SENT);
            return sent.map_err(|error| self.target.broken(&error.to_string()));
        }
        let (width, height) = frame.pair.size();
        let maps = if has_maps { BYTES_PER_MAP_PIXEL } else { 0 };
        let estimate = BYTES_PER_ESTIMATE + maps * width * height;
        let bytes = width * height + judged.estimates.len() * estimate;
        self.batched += bytes.max(MAX_BATCH_BYTES / MAX_BATCH_PAIRS);
        match self.target.0.file() {
            // Nothing is measured, or pairs are large.
            Some(_) => self.end_batch(2 * MAX_BATCH_BYTES),
            None => Ok(()),
        }
    }

    fn settle(&mut self) -> Result<()> {
        let is_file = self.target.0.file().is_some();
        self.end_batch(if is_file { MAX_BATCH_BYTES } else { 0 })
    }

    /// Waits until everything is written or sent. A file gets its index, for quick opening, when
    /// the sink is dropped.
    fn finish(mut self: Box<Self>) -> Result<()> {
        if let Some(results) = self.verdicts.take().and_then(|read| read()) {
            let verdicts = TextDocument::from_markdown(results.verdicts);
            self.log_static("run/verdicts", &verdicts)?;
            if let Some(worst) = results.worst {
                self.push_worst(&worst)?;
            }
        }
        self.flush()
    }
}
