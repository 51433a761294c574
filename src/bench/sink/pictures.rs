//! Pictures for the report page: the best and the worst frame of each checkpoint, or the scenes.

use super::PassStart;
use super::table::RowIdentity;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, OnceLock};
use svl_core::Result;
use svl_core::stereo::{CellRule, Frame, Plane, Truth};
use svl_files as files;
use svl_files::overlay::{self, Mark, NO_DISPARITY, Nearness, Picture, errors};
use svl_report::html::{CheckpointFigure, FrameShot, Rank, SceneFigure, SceneResult};
use svl_report::shots::{MAX_SAMPLES, MAX_SCENES, stride};
use svl_report::units::{
    Badness, BlockPictures, CheckpointShot, WorstFrame, WorstFrames, WorstPicture,
};
use svl_score::judge::{
    Checkpoint, CheckpointFrame, CheckpointTally, Judged, JudgedEstimate, TrueCells,
};

/// Largest width of a frame's picture, pixels.
const MAX_WIDTH: usize = 640;
/// Largest width of a scene's picture: sixteen scenes through eight algorithms are a page of
/// 3.3 MB. The page shows it two thirds as wide.
const MAX_SCENE_WIDTH: usize = 200;

/// The pictures of a block: the best and the worst frame of each checkpoint (thesis, figure 7.3),
/// or frames spread over a recording, or the scenes of a data set; those of several algorithms
/// share the left image and the truth until the end.
#[derive(Default)]
pub(super) struct BlockShots {
    checkpoints: Vec<Checkpoint>,
    cells: CellRule,
    start_ns: u64,
    /// True if the pairs are perturbed, so that none is shown.
    is_perturbed: bool,
    /// Tallies of leading frames, by checkpoint and algorithm.
    tallies: BTreeMap<(usize, String), CheckpointTally<RawShot>>,
    samples: Vec<(u64, CheckpointFigure)>,
    scenes: Vec<(u64, SceneFigure)>,
    /// The worst frames by algorithm.
    worst: BTreeMap<String, WorstFrames<RawPicture>>,
    /// What the shots of the frame at a place share.
    shared: Option<(u64, Arc<SharedFrame>)>,
}

/// The picture of one of the worst frames: most are outdone soon.
enum RawPicture {
    Frame(CheckpointFigure, Box<RawShot>),
    Scene(Box<SceneFigure>),
}

/// What the shots of a frame share; its pictures are made at their first use.
struct SharedFrame {
    frame: Frame,
    /// The truth's cells.
    truth: Option<Vec<Mark>>,
    /// The disparity at the end of the colours without a truth, pixels.
    end_px: f32,
    pictures: OnceLock<SharedPictures>,
}

struct SharedPictures {
    left: Vec<u8>,
    true_preview: Option<Vec<u8>>,
    /// The disparity at the end of the colours, pixels.
    end_px: f32,
}

impl SharedFrame {
    fn new(judged: &Judged) -> Self {
        let (frame, nearness) = (&judged.frame, Nearness::for_frame(&judged.frame));
        let marks = |truth: &TrueCells| overlay::marks(truth.grid(), frame.pair.size(), nearness);
        Self {
            truth: judged.true_cells.as_ref().map(marks),
            end_px: match frame.truth {
                Some(_) => nearness.near_px as f32,
                None => color_end(judged),
            },
            frame: frame.clone(),
            pictures: OnceLock::new(),
        }
    }

    fn pictures(&self) -> Result<&SharedPictures> {
        if let Some(pictures) = self.pictures.get() {
            return Ok(pictures);
        }
        let truth = self.frame.truth.as_ref().map(|truth| &truth.disparity);
        let end_px = truth.and_then(|truth| overlay::color_end(&[truth]));
        let end_px = end_px.unwrap_or(self.end_px);
        let true_preview = truth.map(|truth| preview(truth, end_px, MAX_WIDTH));
        let pictures = SharedPictures {
            left: left_image(&self.frame)?,
            true_preview: true_preview.transpose()?,
            end_px,
        };
        Ok(self.pictures.get_or_init(|| pictures))
    }
}

/// A shot whose pictures are not made yet: most leading frames are outdone soon.
#[derive(Clone)]
struct RawShot {
    shot: FrameShot,
    disparity: Plane<f32>,
    shared: Arc<SharedFrame>,
}

impl RawShot {
    fn new(
        identity: &RowIdentity,
        judged: &Judged,
        scored: &JudgedEstimate,
        shared: Arc<SharedFrame>,
    ) -> Self {
        let (size, nearness) = (judged.frame.pair.size(), Nearness::for_frame(&judged.frame));
        let shot = FrameShot {
            row: identity.row(judged, scored),
            cells: identity.cells(judged, scored),
            passed: None,
            failures: Vec::new(),
            findings: Vec::new(),
            left: Vec::new(),
            size,
            estimate: overlay::marks(&scored.estimate.grid, size, nearness),
            truth: shared.truth.clone(),
            preview: None,
            true_preview: None,
            errors: None,
        };
        Self {
            shot,
            disparity: scored.estimate.disparity.disparity().clone(),
            shared,
        }
    }

    fn encoded(&self) -> Result<FrameShot> {
        let pictures = self.shared.pictures()?;
        let truth = self.shared.frame.truth.as_ref();
        let errors = truth.map(|truth| error_picture(&self.disparity, truth, MAX_WIDTH));
        Ok(FrameShot {
            left: pictures.left.clone(),
            preview: Some(preview(&self.disparity, pictures.end_px, MAX_WIDTH)?),
            true_preview: pictures.true_preview.clone(),
            errors: errors.transpose()?,
            ..self.shot.clone()
        })
    }
}

/// Disparities in colours that end at `end_px`, as a file.
fn preview(plane: &Plane<f32>, end_px: f32, width: usize) -> Result<Vec<u8>> {
    encoded(&overlay::disparities(plane, end_px).at_most(width, NO_DISPARITY))
}

/// The errors of disparities, as a file.
fn error_picture(plane: &Plane<f32>, truth: &Truth, width: usize) -> Result<Vec<u8>> {
    encoded(&errors::errors(plane, truth).at_most(width, errors::NO_TRUTH))
}

fn encoded(picture: &Picture) -> Result<Vec<u8>> {
    files::encode_palette_png(&picture.codes, &picture.palette)
}

impl BlockShots {
    /// The empty pictures of a run.
    pub(super) fn new(start: &PassStart<'_>) -> Self {
        Self {
            checkpoints: start.judge.checkpoints.clone(),
            cells: start.judge.cells,
            start_ns: start.judge.run.start_ns,
            is_perturbed: start.judge.run.stress.is_some(),
            ..Self::default()
        }
    }

    /// The pictures of each algorithm in the block, which ends.
    ///
    /// # Errors
    /// The reason why a picture cannot be encoded.
    pub(super) fn take_pictures(&mut self) -> Result<BTreeMap<String, BlockPictures>> {
        let mut pictures: BTreeMap<String, BlockPictures> = BTreeMap::new();
        for ((c, label), tally) in std::mem::take(&mut self.tallies) {
            let own = pictures.entry(label).or_default();
            let mut sequences = Vec::new();
            for (raw, frame) in [&tally.worst, &tally.best].into_iter().flatten() {
                let sequence = raw.shot.row.sequence;
                if !sequences.contains(&sequence) {
                    sequences.push(sequence);
                    let number = self.checkpoints[c].number;
                    let shot = CheckpointShot::new(number, frame, &raw.encoded()?)?;
                    own.checkpoints.push(shot);
                }
            }
        }
        for (label, worst) in std::mem::take(&mut self.worst) {
            let is_sample = |place: u64| {
                let samples = self.samples.iter().map(|(own, _)| *own);
                let mut all = samples.chain(self.scenes.iter().map(|(own, _)| *own));
                all.any(|own| own == place)
            };
            let own = pictures.entry(label).or_default();
            for frame in worst.finish() {
                let picture = match frame.picture {
                    // Samples are of all algorithms that are pictured.
                    _ if is_sample(frame.place) => WorstPicture::Sample,
                    RawPicture::Scene(scene) => WorstPicture::Scene(scene),
                    RawPicture::Frame(figure, raw) => {
                        let shots = vec![(Rank::Sample, raw.encoded()?)];
                        WorstPicture::Frame(Box::new(CheckpointFigure { shots, ..figure }))
                    }
                };
                own.worst.push(WorstFrame {
                    picture,
                    badness: frame.badness,
                    run: frame.run,
                    place: frame.place,
                    stamp_ns: frame.stamp_ns,
                });
            }
        }
        for (place, mut figure) in std::mem::take(&mut self.samples) {
            for shot in std::mem::take(&mut figure.shots) {
                let own = pictures.entry(shot.1.row.algorithm.clone()).or_default();
                let shots = vec![shot];
                let figure = figure.clone();
                own.samples
                    .push((place, CheckpointFigure { shots, ..figure }));
            }
        }
        for (place, mut scene) in std::mem::take(&mut self.scenes) {
            for shot in std::mem::take(&mut scene.shots) {
                let own = pictures.entry(shot.row.algorithm.clone()).or_default();
                let shots = vec![shot];
                let scene = scene.clone();
                own.scenes.push((place, SceneFigure { shots, ..scene }));
            }
        }
        Ok(pictures)
    }

    /// Takes the frame at `place` in the run, with the results of the algorithms that are pictured.
    pub(super) fn take(
        &mut self,
        place: u64,
        pictured: &[&str],
        identity: &RowIdentity,
        judged: &Judged,
    ) -> Result<()> {
        if self.is_perturbed {
            return Ok(());
        }
        let estimates = judged.estimates.iter();
        let shown =
            estimates.filter(|scored| pictured.contains(&scored.estimate.algorithm.as_str()));
        let shown: Vec<_> = shown.collect();
        for scored in &shown {
            for &(c, frame) in &scored.checkpoints {
                self.take_checkpoint(c, (place, frame), identity, judged, scored);
            }
        }
        if self.checkpoints.is_empty() && !shown.is_empty() {
            self.take_sample(place, identity, judged, &shown)?;
        }
        let mut worst = shown.iter();
        worst.try_for_each(|scored| self.take_worst(place, identity, judged, scored))
    }

    /// Takes the frame if it is on the stride of those that are spread over a recording or a data
    /// set.
    fn take_sample(
        &mut self,
        place: u64,
        identity: &RowIdentity,
        judged: &Judged,
        shown: &[&JudgedEstimate],
    ) -> Result<()> {
        let is_recording = identity.run.is_some();
        let limit = if is_recording {
            MAX_SAMPLES
        } else {
            MAX_SCENES
        };
        let stride = stride(place + 1, limit);
        if !place.is_multiple_of(stride) {
            return Ok(());
        }
        let is_on_stride = |place: &u64| place.is_multiple_of(stride);
        self.samples.retain(|(place, _)| is_on_stride(place));
        self.scenes.retain(|(place, _)| is_on_stride(place));
        if is_recording {
            let shared = self.shared(place, judged);
            let sample = self.sample(identity, judged, shown, &shared)?;
            self.samples.push((place, sample));
        } else if let Some(name) = &judged.frame.name {
            let scene = scene(identity, name, judged, shown)?;
            self.scenes.push((place, scene));
        }
        Ok(())
    }

    fn take_checkpoint(
        &mut self,
        c: usize,
        (place, frame): (u64, CheckpointFrame),
        identity: &RowIdentity,
        judged: &Judged,
        scored: &JudgedEstimate,
    ) {
        let key = (c, scored.estimate.algorithm.clone());
        let tally = self.tallies.get(&key);
        let (best, worst) = tally.map_or((true, true), |tally| tally.would_lead(&frame));
        let mut shot = None;
        if best || worst {
            let shared = self.shared(place, judged);
            let (grid, checkpoint) = (&scored.estimate.grid, &self.checkpoints[c]);
            let mut raw = RawShot::new(identity, judged, scored, shared);
            raw.shot.passed = Some(frame.passed);
            raw.shot.failures = checkpoint.failures(grid, scored.cells.as_deref());
            raw.shot.findings = checkpoint.findings(grid, self.cells);
            shot = Some(raw);
        }
        // The shot exists if and only if the frame leads, and only then it is asked for.
        let tally = self.tallies.entry(key).or_default();
        tally.add(frame, || shot.clone().expect("a leading frame"));
    }

    /// What the shots of the frame at that place share.
    fn shared(&mut self, place: u64, judged: &Judged) -> Arc<SharedFrame> {
        let known = self.shared.take().filter(|(own, _)| *own == place);
        let known = known.unwrap_or_else(|| (place, Arc::new(SharedFrame::new(judged))));
        Arc::clone(&self.shared.insert(known).1)
    }

    /// Takes the frame if it is one of the worst of its algorithm so far.
    fn take_worst(
        &mut self,
        place: u64,
        identity: &RowIdentity,
        judged: &Judged,
        scored: &JudgedEstimate,
    ) -> Result<()> {
        let label = &scored.estimate.algorithm;
        let takes = |badness: &Badness| {
            let own = self.worst.get(label);
            own.is_none_or(|own| own.takes(badness))
        };
        let Some(badness) = badness(scored, self.cells).filter(takes) else {
            return Ok(());
        };
        let frame = &judged.frame;
        let scene_name = frame.name.as_ref().filter(|_| identity.run.is_none());
        let picture = match scene_name {
            Some(name) => {
                let last = self.scenes.last().filter(|(own, _)| *own == place);
                let mut scene = match last {
                    Some((_, scene)) => scene.clone(),
                    None => scene(identity, name, judged, &[scored])?,
                };
                scene.shots.retain(|own| own.row.algorithm == *label);
                RawPicture::Scene(Box::new(scene))
            }
            None => {
                let shared = self.shared(place, judged);
                let raw = RawShot::new(identity, judged, scored, shared);
                RawPicture::Frame(self.figure(identity, judged), Box::new(raw))
            }
        };
        let stamp_ns = scene_name.is_none().then_some(frame.stamp_ns);
        self.worst
            .entry(label.clone())
            .or_default()
            .add(WorstFrame {
                badness,
                // The report knows the place of the run.
                run: 0,
                place,
                stamp_ns,
                picture,
            });
        Ok(())
    }

    /// The heading of a frame, without its shots.
    fn figure(&self, identity: &RowIdentity, judged: &Judged) -> CheckpointFigure {
        let frame = &judged.frame;
        let seconds = frame.stamp_ns.saturating_sub(self.start_ns) as f64 / 1e9;
        let seed = identity.seed.map(|seed| format!("seed {seed}"));
        let run = identity.run.clone().or(seed).unwrap_or_default();
        let shown = judged
            .estimates
            .iter()
            .flat_map(|scored| &scored.checkpoints);
        let shows: BTreeSet<_> = shown.map(|(i, _)| self.checkpoints[*i].number).collect();
        CheckpointFigure {
            title: format!("{run}, frame {}, {seconds:.2} s", frame.sequence),
            shows: shows.into_iter().collect(),
            at_s: Some(seconds),
            ..CheckpointFigure::default()
        }
    }

    /// A frame of a recording.
    fn sample(
        &self,
        identity: &RowIdentity,
        judged: &Judged,
        shown: &[&JudgedEstimate],
        shared: &Arc<SharedFrame>,
    ) -> Result<CheckpointFigure> {
        let shots = shown.iter().map(|scored| {
            let raw = RawShot::new(identity, judged, scored, Arc::clone(shared));
            Ok((Rank::Sample, raw.encoded()?))
        });
        Ok(CheckpointFigure {
            shots: shots.collect::<Result<_>>()?,
            ..self.figure(identity, judged)
        })
    }
}

/// Missed and wrong cells and the largest error of an algorithm; absent without truth.
fn badness(scored: &JudgedEstimate, rule: CellRule) -> Option<Badness> {
    let cells = scored.cells.as_ref()?;
    let errors = cells.iter().zip(scored.estimate.grid.iter());
    let errors = errors.filter_map(|(judged, (_, cell))| judged.error_in_tolerances(cell, rule));
    Some(Badness {
        missed: cells.iter().filter(|cell| cell.near.missed).count() as u64,
        wrong: scored.metrics.get("wrong")? as u64,
        // JSON has no infinity.
        error: errors.fold(0.0, f64::max).min(1e9),
    })
}

/// The disparity at the end of the colours, pixels.
fn color_end(judged: &Judged) -> f32 {
    let truth = judged.frame.truth.as_ref().map(|truth| &truth.disparity);
    let maps = judged.estimates.iter();
    let maps: Vec<_> = maps
        .map(|scored| scored.estimate.disparity.disparity())
        .collect();
    let end_px = truth.and_then(|truth| overlay::color_end(&[truth]));
    let end_px = end_px.or_else(|| overlay::color_end(&maps));
    end_px.unwrap_or_else(|| Nearness::for_frame(&judged.frame).near_px as f32)
}

/// A scene with the results of the pictured algorithms.
fn scene(
    identity: &RowIdentity,
    name: &str,
    judged: &Judged,
    shown: &[&JudgedEstimate],
) -> Result<SceneFigure> {
    let frame = &judged.frame;
    let max_px = color_end(judged);
    let disparities = |plane: &Plane<f32>| preview(plane, max_px, MAX_SCENE_WIDTH);
    let truth = frame.truth.as_ref();
    let shot = |scored: &&JudgedEstimate| {
        let map = scored.estimate.disparity.disparity();
        let errors = truth.map(|truth| error_picture(map, truth, MAX_SCENE_WIDTH));
        Ok(SceneResult {
            row: identity.row(judged, scored),
            disparities: disparities(map)?,
            errors: errors.transpose()?,
        })
    };
    let truth = truth.map(|truth| disparities(&truth.disparity));
    Ok(SceneFigure {
        title: name.to_owned(),
        size: frame.pair.size(),
        left: left(frame, MAX_SCENE_WIDTH)?,
        max_px: max_px.into(),
        truth: truth.transpose()?,
        shots: shown.iter().map(shot).collect::<Result<_>>()?,
    })
}

/// A frame through one algorithm, for a page.
///
/// # Errors
/// The reason why its pictures cannot be encoded.
pub(crate) fn frame_shot(
    identity: &RowIdentity,
    judged: &Judged,
    scored: &JudgedEstimate,
) -> Result<FrameShot> {
    let shared = Arc::new(SharedFrame::new(judged));
    RawShot::new(identity, judged, scored, shared).encoded()
}

/// The left image as a page shows it.
pub(crate) fn left_image(frame: &Frame) -> Result<Vec<u8>> {
    left(frame, MAX_WIDTH)
}

/// The left image, in colour where the source has it.
fn left(frame: &Frame, width: usize) -> Result<Vec<u8>> {
    match &frame.color {
        Some([left, _]) => files::encode_color_jpeg(left, width),
        None => files::encode_jpeg(frame.pair.left(), width),
    }
}
