//! Pictures for the report page: the best and the worst frame of each checkpoint, or the scenes.

use super::RunStart;
use super::table::RunIdentity;
use crate::report::FrameRow;
use crate::report::html::{CheckpointFigure, FrameShot, Rank, SceneFigure, SceneResult};
use crate::report::shots::{MAX_SAMPLES, MAX_SCENES, stride};
use crate::report::units::{BlockPictures, CheckpointShot};
use std::collections::BTreeMap;
use svl_core::Result;
use svl_core::stereo::{CellRule, DepthGrid, Frame, Plane};
use svl_data::files;
use svl_data::overlay::{self, Nearness, Picture};
use svl_data::score::{Checkpoint, CheckpointFrame, CheckpointTally, Judged, JudgedEstimate};

/// Widest picture of a frame, pixels: as wide as the arena's.
const WIDTH: usize = 320;
/// Widest picture of a scene: nineteen scenes through eight algorithms are a page of 3.3 MB. The
/// page shows it two thirds as wide.
const SCENE_WIDTH: usize = 200;

/// The pictures of a block: the best and the worst frame of each checkpoint (thesis, figure 7.3), or
/// frames spread over a recording, or the scenes of a data set.
#[derive(Default)]
pub(super) struct BlockShots {
    checkpoints: Vec<Checkpoint>,
    cells: CellRule,
    start_ns: u64,
    /// True if the pairs are perturbed, so that none is shown.
    is_perturbed: bool,
    /// Those of leading frames, by checkpoint and algorithm.
    tallies: BTreeMap<(usize, String), CheckpointTally<FrameShot>>,
    pictures: BlockPictures,
    is_changed: bool,
}

impl BlockShots {
    /// Those of a run.
    pub(super) fn new(start: &RunStart<'_>) -> Self {
        Self {
            checkpoints: start.judge.checkpoints.clone(),
            cells: start.judge.cells,
            start_ns: start.judge.run.start_ns,
            is_perturbed: start.judge.run.stress.is_some(),
            ..Self::default()
        }
    }

    /// Another block begins.
    pub(super) fn begin_block(&mut self) {
        self.tallies.clear();
        self.pictures = BlockPictures::default();
        self.is_changed = false;
    }

    /// The pictures of the block so far, if there are any.
    pub(super) fn pictures(&mut self) -> Option<&BlockPictures> {
        if std::mem::take(&mut self.is_changed) {
            self.pictures.checkpoints.clear();
            for ((c, label), tally) in &self.tallies {
                let leading = [&tally.worst, &tally.best];
                let mut sequences = Vec::new();
                for (shot, frame) in leading.into_iter().flatten() {
                    let sequence = shot.row.sequence;
                    if !sequences.contains(&sequence) {
                        sequences.push(sequence);
                        let checkpoint = &self.checkpoints[*c];
                        self.pictures.checkpoints.push(CheckpointShot {
                            frame: FrameRow::new(sequence, label, checkpoint, frame),
                            shot: shot.clone(),
                        });
                    }
                }
            }
        }
        let BlockPictures {
            checkpoints,
            samples,
            scenes,
        } = &self.pictures;
        let is_empty = checkpoints.is_empty() && samples.is_empty() && scenes.is_empty();
        (!is_empty).then_some(&self.pictures)
    }

    /// Takes the frame at `place` in the run, with the results of the algorithms that are pictured.
    pub(super) fn take(
        &mut self,
        place: u64,
        pictured: &[&str],
        identity: &RunIdentity,
        judged: &Judged,
    ) -> Result<()> {
        if self.is_perturbed {
            return Ok(());
        }
        let estimates = judged.estimates.iter();
        let shown = estimates.filter(|scored| pictured.contains(&scored.estimate.algorithm.as_str()));
        let shown: Vec<_> = shown.collect();
        for scored in &shown {
            for &(c, frame) in &scored.checkpoints {
                self.take_checkpoint(c, frame, identity, judged, scored)?;
            }
        }
        if !self.checkpoints.is_empty() || shown.is_empty() {
            return Ok(());
        }
        let is_recording = identity.run.is_some();
        let limit = if is_recording { MAX_SAMPLES } else { MAX_SCENES };
        let stride = stride(place + 1, limit);
        if !place.is_multiple_of(stride) {
            return Ok(());
        }
        let is_on_stride = |place: &u64| place.is_multiple_of(stride);
        self.pictures.samples.retain(|(place, _)| is_on_stride(place));
        self.pictures.scenes.retain(|(place, _)| is_on_stride(place));
        if is_recording {
            let sample = self.sample(identity, judged, &shown)?;
            self.pictures.samples.push((place, sample));
        } else if let Some(name) = &judged.frame.name {
            let scene = scene(identity, name, judged, &shown)?;
            self.pictures.scenes.push((place, scene));
        }
        self.is_changed = true;
        Ok(())
    }

    fn take_checkpoint(
        &mut self,
        c: usize,
        frame: CheckpointFrame,
        identity: &RunIdentity,
        judged: &Judged,
        scored: &JudgedEstimate,
    ) -> Result<()> {
        let key = (c, scored.estimate.algorithm.clone());
        let tally = self.tallies.entry(key).or_default();
        let (best, worst) = tally.would_lead(&frame);
        let mut shot = None;
        if best || worst {
            let (grid, checkpoint) = (&scored.estimate.grid, &self.checkpoints[c]);
            shot = Some(FrameShot {
                passed: Some(frame.passed),
                failures: checkpoint.failures(grid, scored.cells.as_deref()),
                findings: checkpoint.findings(grid, self.cells),
                ..frame_shot(identity, judged, scored)?
            });
            self.is_changed = true;
        }
        // The shot exists if and only if the frame leads, and only then it is asked for.
        tally.add(frame, || shot.clone().expect("a leading frame"));
        Ok(())
    }

    /// A frame of a recording.
    fn sample(
        &self,
        identity: &RunIdentity,
        judged: &Judged,
        shown: &[&JudgedEstimate],
    ) -> Result<CheckpointFigure> {
        let frame = &judged.frame;
        let seconds = frame.stamp_ns.saturating_sub(self.start_ns) as f64 / 1e9;
        let run = identity.run.as_deref().unwrap_or_default();
        let shots = shown.iter();
        let shots = shots.map(|scored| Ok((Rank::Sample, frame_shot(identity, judged, scored)?)));
        Ok(CheckpointFigure {
            checkpoint: None,
            title: format!("{run}, frame {}, {seconds:.2} s", frame.sequence),
            about: String::new(),
            shots: shots.collect::<Result<_>>()?,
        })
    }
}

/// A scene with the results of the pictured algorithms.
fn scene(
    identity: &RunIdentity,
    name: &str,
    judged: &Judged,
    shown: &[&JudgedEstimate],
) -> Result<SceneFigure> {
    let frame = &judged.frame;
    let max_px = Nearness::of_frame(frame).near_px();
    let disparities =
        |plane: &Plane<f32>| png(overlay::disparities(plane, max_px as f32), SCENE_WIDTH);
    let truth = frame.truth.as_ref();
    let shot = |scored: &&JudgedEstimate| {
        let map = &scored.estimate.disparity;
        let errors = truth.map(|truth| png(overlay::errors::errors(map, truth), SCENE_WIDTH));
        Ok(SceneResult {
            row: identity.row(judged, scored),
            disparities: disparities(map.disparity())?,
            errors: errors.transpose()?,
        })
    };
    let truth = truth.map(|truth| disparities(&truth.disparity));
    Ok(SceneFigure {
        title: name.to_owned(),
        size: frame.pair.size(),
        left: left(frame, SCENE_WIDTH)?,
        max_px,
        truth: truth.transpose()?,
        shots: shown.iter().map(shot).collect::<Result<_>>()?,
    })
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
