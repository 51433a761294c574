//! Pictures for the report page: the best and the worst frame of each checkpoint, or the scenes.

use super::table::RunIdentity;
use super::{Outbox, RunStart, Sink};
use crate::report::html::{CheckpointFigure, FrameShot, Rank, SceneFigure, SceneResult};
use svl_core::Result;
use svl_core::stereo::{CellRule, DepthGrid, Frame, Plane};
use svl_data::files;
use svl_data::overlay::{self, Nearness, Picture};
use svl_data::score::{Checkpoint, CheckpointTally, Judged, JudgedEstimate};

/// Widest picture of a frame, pixels: as wide as the arena's.
const WIDTH: usize = 320;
/// Widest picture of a scene: nineteen scenes through eight algorithms are a page of 3.3 MB. The
/// page shows it two thirds as wide.
const SCENE_WIDTH: usize = 200;

/// Limit of the algorithms with pictures, spread over those of the run: a page is to be sent
/// around.
const PICTURED: usize = 8;

/// Half the limit of the frames shown of recordings, over all runs.
const SAMPLES: usize = 6;
/// Half the limit of the scenes shown.
const SCENES: usize = 10;

/// The pictures of a report page.
#[derive(Default)]
pub struct ReportPictures {
    /// Per checkpoint the worst and the best frame of every algorithm (thesis, figure 7.3), or of
    /// recordings without checkpoints frames spread over them.
    pub figures: Vec<CheckpointFigure>,
    /// One per frame of a data set, whose frames have names, where there are no checkpoints.
    pub scenes: Vec<SceneFigure>,
}

/// Collects the pictures over all runs.
#[derive(Default)]
pub struct PictureSink {
    identity: RunIdentity,
    algorithms: Vec<String>,
    checkpoints: Vec<Checkpoint>,
    cells: CellRule,
    /// By checkpoint and algorithm, with the pictures of the leading frames of all runs.
    tallies: Vec<Vec<CheckpointTally<FrameShot>>>,
    scenes: Vec<SceneFigure>,
    samples: Vec<CheckpointFigure>,
    /// The choice of samples among the frames taken, and among those asked for.
    taken: SampleChoice,
    asked: SampleChoice,
    start_ns: u64,
    outbox: Outbox<ReportPictures>,
}

impl PictureSink {
    /// Leaves the pictures in `outbox`.
    pub fn new(outbox: &Outbox<ReportPictures>) -> Self {
        Self {
            outbox: outbox.clone(),
            ..Self::default()
        }
    }

    /// True if the page has room for the algorithm at that place.
    fn is_pictured(&self, algorithm: &str) -> bool {
        pictured(&self.algorithms).contains(&algorithm)
    }
}

impl Sink for PictureSink {
    fn begin_run(&mut self, start: &RunStart<'_>) -> Result<()> {
        self.identity = RunIdentity::new(start);
        self.start_ns = start.judge.run.start_ns;
        self.cells = start.judge.cells;
        // All runs of a report have the same algorithms and checkpoints.
        if self.algorithms.is_empty() {
            self.algorithms = start.manifest.labels().map(str::to_owned).collect();
            self.checkpoints.clone_from(&start.judge.checkpoints);
            let tallies = vec![CheckpointTally::default(); self.algorithms.len()];
            self.tallies = vec![tallies; self.checkpoints.len()];
        }
        Ok(())
    }

    fn ask_for_maps(&mut self, frame: &Frame, shows_checkpoint: bool, needed: &mut [bool]) {
        let is_shown = match self.identity.run {
            _ if !self.checkpoints.is_empty() => shows_checkpoint,
            Some(_) => self.asked.next(SAMPLES).is_some(),
            None => frame.name.is_some() && self.asked.next(SCENES).is_some(),
        };
        if is_shown {
            let pictured = pictured(&self.algorithms);
            for (needed, label) in needed.iter_mut().zip(&self.algorithms) {
                *needed |= pictured.contains(&label.as_str());
            }
        }
    }

    fn take(&mut self, judged: &Judged) -> Result<()> {
        for scored in &judged.estimates {
            let label = &scored.estimate.algorithm;
            let Some(a) = self.algorithms.iter().position(|l| l == label) else {
                continue;
            };
            if !self.is_pictured(label) {
                continue;
            }
            for &(c, verdict) in &scored.checkpoints {
                let tally = &self.tallies[c][a];
                let (best, worst) = tally.would_lead(&verdict);
                let shot = if best || worst {
                    let grid = &scored.estimate.grid;
                    Some(FrameShot {
                        passed: Some(verdict.passed),
                        failures: self.checkpoints[c].failures(grid, scored.cells.as_deref()),
                        findings: self.checkpoints[c].findings(grid, self.cells),
                        ..frame_shot(&self.identity, judged, scored)?
                    })
                } else {
                    None
                };
                // The shot exists if and only if the frame leads, and only then it is asked for.
                self.tallies[c][a].add(verdict, || shot.clone().expect("a leading frame"));
            }
        }
        match &judged.frame.name {
            _ if !self.checkpoints.is_empty() => Ok(()),
            _ if self.identity.run.is_some() => self.sample(judged),
            Some(name) => {
                if let Some(kept) = self.taken.next(SCENES) {
                    let scene = self.scene(name, judged)?;
                    push_spread(&mut self.scenes, kept, scene);
                }
                Ok(())
            }
            None => Ok(()),
        }
    }

    fn finish(self: Box<Self>) -> Result<()> {
        let figure = |(checkpoint, tallies): (Checkpoint, Vec<CheckpointTally<FrameShot>>)| {
            CheckpointFigure {
                checkpoint: Some(checkpoint.number),
                title: format!("{} {}", checkpoint.number, checkpoint.name),
                about: checkpoint.description,
                shots: tallies.into_iter().flat_map(leading_shots).collect(),
            }
        };
        let checkpoints = self.checkpoints.into_iter().zip(self.tallies).map(figure);
        self.outbox.put(ReportPictures {
            figures: checkpoints.chain(self.samples).collect(),
            scenes: self.scenes,
        });
        Ok(())
    }
}

/// Chooses frames that are spread evenly over those that came so far.
#[derive(Default)]
struct SampleChoice {
    /// Frames so far.
    frames: usize,
    /// Doublings of the stride.
    doublings: u32,
    kept: usize,
}

impl SampleChoice {
    /// The number of samples before the next frame if that is one, else none; at most twice `half`
    /// are kept. If it is less than before, every second one stays, from the first.
    fn next(&mut self, half: usize) -> Option<usize> {
        let place = self.frames;
        self.frames += 1;
        let is_on_stride = |doublings: u32| place.is_multiple_of(1_usize << doublings);
        if !is_on_stride(self.doublings) {
            return None;
        }
        if self.kept == 2 * half {
            if !is_on_stride(self.doublings + 1) {
                return None;
            }
            self.doublings += 1;
            self.kept = half;
        }
        self.kept += 1;
        Some(self.kept - 1)
    }
}

/// Adds what is spread over a run, of which `kept` stay: all, or every second one.
fn push_spread<T>(kept_so_far: &mut Vec<T>, kept: usize, next: T) {
    if kept < kept_so_far.len() {
        let mut places = 0..;
        kept_so_far.retain(|_| places.next().is_some_and(|i: usize| i.is_multiple_of(2)));
    }
    kept_so_far.push(next);
}

impl PictureSink {
    /// Keeps frames that are spread evenly over what came so far, at most twice the limit.
    fn sample(&mut self, judged: &Judged) -> Result<()> {
        let Some(kept) = self.taken.next(SAMPLES) else {
            return Ok(());
        };
        let frame = &judged.frame;
        let seconds = frame.stamp_ns.saturating_sub(self.start_ns) as f64 / 1e9;
        let run = self.identity.run.as_deref().unwrap_or_default();
        let shown = judged.estimates.iter();
        let shown = shown.filter(|scored| self.is_pictured(&scored.estimate.algorithm));
        let shots =
            shown.map(|scored| Ok((Rank::Sample, frame_shot(&self.identity, judged, scored)?)));
        let figure = CheckpointFigure {
            checkpoint: None,
            title: format!("{run}, frame {}, {seconds:.2} s", frame.sequence),
            about: String::new(),
            shots: shots.collect::<Result<_>>()?,
        };
        push_spread(&mut self.samples, kept, figure);
        Ok(())
    }

    /// A scene with the results of the pictured algorithms.
    fn scene(&self, name: &str, judged: &Judged) -> Result<SceneFigure> {
        let frame = &judged.frame;
        let max_px = Nearness::of_frame(frame).near_px();
        let disparities =
            |plane: &Plane<f32>| png(overlay::disparities(plane, max_px as f32), SCENE_WIDTH);
        let shot = |scored: &JudgedEstimate| {
            let map = &scored.estimate.disparity;
            let errors = frame
                .truth
                .as_ref()
                .map(|truth| png(overlay::errors::errors(map, truth), SCENE_WIDTH));
            Ok(SceneResult {
                row: self.identity.row(judged, scored),
                disparities: disparities(map.disparity())?,
                errors: errors.transpose()?,
            })
        };
        let shown = judged
            .estimates
            .iter()
            .filter(|scored| self.is_pictured(&scored.estimate.algorithm));
        Ok(SceneFigure {
            title: name.to_owned(),
            size: frame.pair.size(),
            left: left(frame, SCENE_WIDTH)?,
            max_px,
            truth: frame
                .truth
                .as_ref()
                .map(|truth| disparities(&truth.disparity))
                .transpose()?,
            shots: shown.map(shot).collect::<Result<_>>()?,
        })
    }
}

/// The algorithms whose pictures are shown: the first, the last, and others spread evenly between.
fn pictured(algorithms: &[String]) -> Vec<&str> {
    let count = algorithms.len().min(PICTURED);
    let place = |i: usize| i * (algorithms.len() - 1) / (count - 1).max(1);
    (0..count).map(|i| algorithms[place(i)].as_str()).collect()
}

fn leading_shots(tally: CheckpointTally<FrameShot>) -> impl Iterator<Item = (Rank, FrameShot)> {
    let leading = [(Rank::Worst, tally.worst), (Rank::Best, tally.best)];
    leading
        .into_iter()
        .filter_map(|(rank, lead)| Some((rank, lead?.0)))
}

/// A frame through one algorithm, for a page.
///
/// # Errors
/// The reason why its pictures cannot be encoded.
pub(crate) fn frame_shot(
    identity: &RunIdentity,
    judged: &Judged,
    scored: &JudgedEstimate,
) -> Result<FrameShot> {
    let (frame, estimate) = (&judged.frame, &scored.estimate);
    let size = frame.pair.size();
    let nearness = Nearness::of_frame(frame);
    let marks = |grid: &DepthGrid| overlay::marks(grid, size, nearness);
    let preview = overlay::disparities(estimate.disparity.disparity(), nearness.near_px() as f32);
    Ok(FrameShot {
        row: identity.row(judged, scored),
        cells: identity.cells(judged, scored),
        passed: None,
        failures: Vec::new(),
        findings: Vec::new(),
        left: left(frame, WIDTH)?,
        size,
        estimate: marks(&estimate.grid),
        truth: judged.true_cells.as_ref().map(|truth| marks(truth.grid())),
        preview: png(preview, WIDTH)?,
    })
}

fn png(picture: Picture, width: usize) -> Result<Vec<u8>> {
    let Picture { codes, palette } = picture.at_most(width);
    files::encode_palette_png(&codes, &palette)
}

/// The left image, in colour where the source has it.
fn left(frame: &Frame, width: usize) -> Result<Vec<u8>> {
    match &frame.color {
        Some([left, _]) => files::encode_color_jpeg(left, width),
        None => files::encode_jpeg(frame.pair.left(), width),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_spread_over_the_algorithms() {
        let names = |n: usize| (0..n).map(|i| i.to_string()).collect::<Vec<_>>();
        assert_eq!(pictured(&names(3)), ["0", "1", "2"]);
        assert_eq!(
            pictured(&names(32)),
            ["0", "4", "8", "13", "17", "22", "26", "31"]
        );
        assert!(pictured(&[]).is_empty());
    }
}
