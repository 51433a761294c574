//! A run as it is watched: every algorithm's maps, grid and numbers beside each other in the Rerun viewer.
//!
//! ```text
//! world                        z up
//!   arena                      the true geometry, where known (static)
//!   trail                      where the camera has been
//!   rig/left                   Transform3D, Pinhole
//!   rig/left/image
//! algo/<name>/overlay          the thesis's picture of the depth grid
//!            /disparity /depth /why /ssdpi
//!            /points           the cloud, in the camera's frame
//!            /latency/<stage>  milliseconds, and /latency/total
//!            /coverage         percent of the pixels
//!            /wrong_cells      where truth and rig are known
//! truth/overlay  truth/depth
//! run/parameters  run/verdicts  run/frames
//! ```
//! Timelines: `pair`, the frame's number, and `time`, its stamp.

mod blueprint;
mod layout;
mod overlay;
mod picture;
mod scale;
mod target;
mod world;

pub use target::{RerunTarget, VIEWER_HINT};

use super::Sink;
use crate::error::Result;
use crate::stereo::{DepthGrid, Estimate, Frame, GridShape, Plane, Pose, Rig};
use crate::timing::Stage;
use ::rerun::{
    ApplicationId, AsComponents, Clear, RecordingStream, RecordingStreamBuilder, Rgba32, Scalars, SeriesLines,
    TextDocument, TextLog, TimeCell, ViewCoordinates,
};
use overlay::Overlay;
use scale::Scale;
use std::path::Path;

/// Rerun's word for the program: recordings of one application share their layout.
const APPLICATION: &str = "svl";
/// The timelines, the one the viewer opens with first.
const TIMELINES: [&str; 2] = ["pair", "time"];
const CAMERA: &str = "world/rig/left";
const IMAGE: &str = "world/rig/left/image";
/// Stamps from here on are taken for time since 1970, smaller ones for time since the start: 2001 in nanoseconds.
const EPOCH_NS: u64 = 1_000_000_000_000_000_000;

/// Colours of the algorithms' lines, told apart by most eyes (after Okabe and Ito), on a dark ground.
const COLORS: [Rgba32; 8] = [
    Rgba32::from_rgb(86, 180, 233),
    Rgba32::from_rgb(230, 159, 0),
    Rgba32::from_rgb(0, 190, 140),
    Rgba32::from_rgb(240, 228, 66),
    Rgba32::from_rgb(204, 121, 167),
    Rgba32::from_rgb(213, 94, 0),
    Rgba32::from_rgb(120, 140, 255),
    Rgba32::from_rgb(200, 200, 200),
];

/// What is known of a run before its first frame.
#[derive(Clone, Debug, Default)]
pub struct RunInfo {
    /// One for all algorithms of a run.
    pub recording_id: String,
    /// Name of the scenario or source, shown as the recording's name.
    pub scenario: String,
    /// The algorithms as they were asked for, each with its parameters in words.
    pub algorithms: Vec<(String, String)>,
    /// True geometry: names, each with line strips in world metres.
    pub wireframe: Vec<(String, Vec<Vec<[f32; 3]>>)>,
    /// Shape of the true grid; the estimates bring their own.
    pub grid: GridShape,
}

/// An algorithm of the run: its label, and the label as part of a path.
struct Algorithm {
    label: String,
    part: String,
}

impl Algorithm {
    fn path(&self, entity: &str) -> String {
        format!("algo/{}/{entity}", self.part)
    }
}

/// The labels as parts of entity paths, which have their own meaning for `/ : = ,` and spaces: letters, digits, `_` and
/// `.` stay, the rest becomes `-`. Labels that would become equal are numbered.
fn algorithms(labels: impl Iterator<Item = String>) -> Vec<Algorithm> {
    let safe = |c: char| if c.is_ascii_alphanumeric() || matches!(c, '_' | '.') { c } else { '-' };
    let mut made: Vec<Algorithm> = Vec::new();
    for label in labels {
        let stem: String = label.chars().map(safe).collect();
        let names = std::iter::once(stem.clone()).chain((2..).map(|n| format!("{stem}-{n}")));
        // The numbers never end, so one of them is free.
        let part = names.into_iter().find(|name| made.iter().all(|a| a.part != *name)).unwrap_or(stem);
        made.push(Algorithm { label, part });
    }
    made
}

/// Writes a run to Rerun.
pub struct RerunSink {
    stream: RecordingStream,
    target: RerunTarget,
    algorithms: Vec<Algorithm>,
    wireframe: Vec<(String, Vec<Vec<[f32; 3]>>)>,
    grid: GridShape,
    begun: bool,
    camera: Option<(Scale, Option<Rig>, (usize, usize))>,
    last_pose: Option<Pose>,
}

impl RerunSink {
    /// Opens `target` and writes what holds for the whole run. The layout follows with the first frame.
    ///
    /// # Errors
    /// The file exists (it is never overwritten: remove it first) or cannot be made; no viewer to spawn, or none at the
    /// URL. Always one line.
    pub fn new(target: RerunTarget, run: &RunInfo) -> Result<Self> {
        let builder = RecordingStreamBuilder::new(APPLICATION)
            .recording_id(run.recording_id.as_str())
            .recording_name(run.scenario.as_str())
            .send_properties(true);
        let stream = target.open(builder)?;
        let sink = Self {
            stream,
            target,
            algorithms: algorithms(run.algorithms.iter().map(|(label, _)| label.clone())),
            wireframe: run.wireframe.clone(),
            grid: run.grid,
            begun: false,
            camera: None,
            last_pose: None,
        };
        sink.log_static("world", &ViewCoordinates::RIGHT_HAND_Z_UP())?;
        if !run.wireframe.is_empty() {
            sink.log_static("world/arena", &world::wireframe(&run.wireframe))?;
        }
        sink.log_static("run/parameters", &TextDocument::from_markdown(parameters(run)))?;
        sink.log_static("run/verdicts", &TextDocument::from_markdown(awaiting(run)))?;
        for root in ["algo", "truth"] {
            sink.log_static(root, &picture::classes())?;
        }
        for path in ["truth/overlay", "truth/overlay/percentiles", "truth/depth"] {
            sink.log_static(path, &world::on_image())?;
        }
        for (algorithm, color) in sink.algorithms.iter().zip(COLORS.into_iter().cycle()) {
            sink.style(algorithm, color)?;
        }
        Ok(sink)
    }

    /// Shows the checkpoints' verdicts, once they are known.
    ///
    /// # Errors
    /// As [`Sink::push`].
    pub fn verdicts(&mut self, markdown: &str) -> Result<()> {
        self.log_static("run/verdicts", &TextDocument::from_markdown(markdown))
    }

    /// Frames of reference, names and colours of an algorithm's entities.
    fn style(&self, algorithm: &Algorithm, color: Rgba32) -> Result<()> {
        for map in ["overlay", "overlay/percentiles", "disparity", "depth", "why", "ssdpi"] {
            self.log_static(&algorithm.path(map), &world::on_image())?;
        }
        self.log_static(&algorithm.path("points"), &world::in_camera())?;
        let line = |name: &str, color| SeriesLines::new().with_names([name]).with_colors([color]).with_widths([1.5]);
        for (stage, color) in Stage::ALL.into_iter().zip(COLORS.into_iter().skip(1)) {
            self.log_static(&algorithm.path(&format!("latency/{}", stage.name())), &line(stage.name(), color))?;
        }
        for number in ["latency/total", "coverage", "wrong_cells"] {
            self.log_static(&algorithm.path(number), &line(&algorithm.label, color))?;
        }
        Ok(())
    }

    /// The layout, as soon as a frame tells what there is to see.
    fn begin(&mut self, frame: &Frame, scale: &Scale) -> Result<()> {
        let facts = layout::Facts {
            truth: frame.truth.is_some(),
            rig: frame.rig.is_some(),
            named: frame.name.is_some(),
            eye: world::eye(&self.wireframe, scale),
        };
        let root = layout::run(&self.algorithms, &facts);
        blueprint::send(&root, APPLICATION.into(), TIMELINES[0], &self.stream)
            .map_err(|error| self.target.failed(error))
    }

    /// The scale of the frame's camera: set by its first frame, kept as long as it takes the pictures.
    fn scale(&mut self, frame: &Frame) -> Scale {
        let size = frame.pair.size();
        match self.camera {
            Some((scale, rig, of)) if rig == frame.rig && of == size => scale,
            _ => {
                let scale = Scale::of(frame);
                self.camera = Some((scale, frame.rig, size));
                scale
            }
        }
    }

    fn push_scene(&mut self, frame: &Frame, scale: &Scale) -> Result<()> {
        self.log(IMAGE, &picture::gray(frame.pair.left()))?;
        let pose = frame.pose.unwrap_or_else(world::resting);
        let camera = frame.rig.as_ref().map(|rig| world::pinhole(rig, frame, scale));
        match camera {
            Some(pinhole) => self.log(CAMERA, &[&world::transform(&pose) as &dyn AsComponents, &pinhole])?,
            None => self.log(CAMERA, &Clear::flat())?,
        }
        if let (Some(from), Some(to)) = (&self.last_pose, &frame.pose) {
            self.log("world/trail", &world::step(from, to))?;
        }
        self.last_pose = frame.pose;
        if let Some(name) = &frame.name {
            self.log("run/frames", &TextLog::new(name.as_str()))?;
        }
        Ok(())
    }

    /// Draws the truth and gives its grid.
    fn push_truth(&self, frame: &Frame, scale: &Scale, shape: GridShape) -> Result<Option<DepthGrid>> {
        let Some(truth) = &frame.truth else {
            self.log("truth", &Clear::recursive())?;
            return Ok(None);
        };
        let grid = overlay::true_grid(&truth.disparity, frame.rig.as_ref(), shape);
        self.log_overlay("truth/overlay", &grid, frame, scale)?;
        self.log_depth("truth/depth", &truth.disparity, frame, scale)?;
        Ok(Some(grid))
    }

    fn push_estimate(
        &self,
        algorithm: &Algorithm,
        estimate: &Estimate,
        frame: &Frame,
        scale: &Scale,
        truth: Option<&DepthGrid>,
    ) -> Result<()> {
        let map = &estimate.disparity;
        self.log_overlay(&algorithm.path("overlay"), &estimate.grid, frame, scale)?;
        self.log(&algorithm.path("disparity"), &picture::disparity(map.disparity(), scale))?;
        self.log(&algorithm.path("why"), &picture::why(map.why()))?;
        self.log(&algorithm.path("ssdpi"), &picture::ssdpi(map.ssdpi()))?;
        self.log_depth(&algorithm.path("depth"), map.disparity(), frame, scale)?;
        let points = frame.rig.as_ref().map(|rig| world::points(map, frame.pair.left(), rig, scale));
        self.log_or_clear(&algorithm.path("points"), points)?;

        let millis = |time: std::time::Duration| Scalars::single(time.as_secs_f64() * 1e3);
        for stage in Stage::ALL {
            self.log(&algorithm.path(&format!("latency/{}", stage.name())), &millis(estimate.times.get(stage)))?;
        }
        self.log(&algorithm.path("latency/total"), &millis(estimate.times.total()))?;
        self.log(&algorithm.path("coverage"), &Scalars::single(100.0 * map.coverage()))?;
        let wrong = truth.and_then(|truth| wrong_cells(truth, &estimate.grid));
        self.log_or_clear(&algorithm.path("wrong_cells"), wrong.map(|n| Scalars::single(n as f64)))
    }

    fn log_overlay(&self, path: &str, grid: &DepthGrid, frame: &Frame, scale: &Scale) -> Result<()> {
        let Overlay { medians, unknown, lines, percentiles } = Overlay::new(grid, frame.pair.size(), scale);
        self.log(path, &[&lines as &dyn AsComponents, &medians, &unknown])?;
        self.log(&format!("{path}/percentiles"), &percentiles)
    }

    fn log_depth(&self, path: &str, disparity: &Plane<f32>, frame: &Frame, scale: &Scale) -> Result<()> {
        let depth = frame.rig.as_ref().map(|rig| picture::depth(disparity, rig, scale));
        self.log_or_clear(path, depth.as_ref().map(|(depth, mask)| [depth as &dyn AsComponents, mask]))
    }

    fn log(&self, path: &str, what: &(impl AsComponents + ?Sized)) -> Result<()> {
        self.stream.log(path, what).map_err(|error| self.target.failed(error))
    }

    fn log_static(&self, path: &str, what: &impl AsComponents) -> Result<()> {
        self.stream.log_static(path, what).map_err(|error| self.target.failed(error))
    }

    /// Without the clearing, the viewer would go on showing the last that there was.
    fn log_or_clear(&self, path: &str, what: Option<impl AsComponents>) -> Result<()> {
        match what {
            Some(what) => self.log(path, &what),
            None => self.log(path, &Clear::flat()),
        }
    }
}

impl Sink for RerunSink {
    /// Shows a frame. An algorithm without an estimate for it shows nothing there.
    fn push(&mut self, frame: &Frame, estimates: &[Estimate]) -> Result<()> {
        let scale = self.scale(frame);
        if !self.begun {
            self.begin(frame, &scale)?;
            self.begun = true;
        }
        let nanos = i64::try_from(frame.stamp_ns).unwrap_or(i64::MAX);
        self.stream.set_time_sequence(TIMELINES[0], i64::try_from(frame.sequence).unwrap_or(i64::MAX));
        self.stream.set_time(
            TIMELINES[1],
            if frame.stamp_ns < EPOCH_NS {
                TimeCell::from_duration_nanos(nanos)
            } else {
                TimeCell::from_timestamp_nanos_since_epoch(nanos)
            },
        );
        self.push_scene(frame, &scale)?;
        let shape = estimates.first().map_or(self.grid, |estimate| estimate.grid.shape());
        let truth = self.push_truth(frame, &scale, shape)?;
        for algorithm in &self.algorithms {
            match estimates.iter().find(|estimate| estimate.algorithm == algorithm.label) {
                Some(estimate) => self.push_estimate(algorithm, estimate, frame, &scale, truth.as_ref())?,
                None => self.log(&format!("algo/{}", algorithm.part), &Clear::recursive())?,
            }
        }
        Ok(())
    }

    fn finish(&mut self) -> Result<()> {
        let flushed = self.stream.flush_blocking().map_err(|error| self.target.broken(&error.to_string()));
        // Only now does a file get its index, which a viewer wants for quick opening.
        self.stream.finalize_deferred_sinks();
        flushed
    }
}

/// Writes a viewer layout for the recording `file` (MCAP) with these topics to `layout`, by custom `*.rbl`, and says
/// whether it did: a recording without svl's topics is left to the viewer's own judgement.
///
/// # Errors
/// The layout cannot be written.
pub fn save_recording_layout(file: &Path, topics: &[String], layout: &Path) -> Result<bool> {
    let Some(root) = layout::recording(topics) else { return Ok(false) };
    // The viewer names a recording after its path, and applies a layout to recordings of that name.
    let app = ApplicationId::new_or_unknown(file.display().to_string());
    blueprint::save(&root, app, "message_log_time", layout)
        .map_err(|error| RerunTarget::File(layout.to_owned()).failed(error))?;
    Ok(true)
}

/// Number of cells whose distance is off by more than 0.10 m and 20 % of the true one; a cell that either does not know
/// is not wrong. Nothing where no cell can be compared.
fn wrong_cells(truth: &DepthGrid, estimate: &DepthGrid) -> Option<usize> {
    let distance = |grid: &DepthGrid, (column, row)| grid.cell(column, row).depth.and_then(|depth| depth.distance_m);
    let known: Vec<_> = truth.shape().iter().filter_map(|at| Some((at, distance(truth, at)?))).collect();
    let wrong = |&&(at, z): &&((usize, usize), f64)| {
        distance(estimate, at).is_some_and(|reported| (reported - z).abs() > (0.2 * z).max(0.1))
    };
    (!known.is_empty()).then(|| known.iter().filter(wrong).count())
}

/// The run's head line and its parameters.
fn parameters(run: &RunInfo) -> String {
    let rows = run.algorithms.iter().map(|(label, parameters)| format!("\n### {label}\n{parameters}\n"));
    format!("# {}\n{}", run.scenario, rows.collect::<String>())
}

fn awaiting(run: &RunInfo) -> String {
    format!("# {}\n\nNo checkpoint has been judged: verdicts come at the end of a scored run.\n", run.scenario)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_become_parts_of_paths() {
        let labels = ["v3", "v3:max_disparity=64", "v3:max_disparity,64", "exec:a b/c"];
        let parts: Vec<_> = algorithms(labels.into_iter().map(str::to_owned)).into_iter().map(|a| a.part).collect();
        assert_eq!(parts, ["v3", "v3-max_disparity-64", "v3-max_disparity-64-2", "exec-a-b-c"]);
    }
}
