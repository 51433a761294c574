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
use svl_report::shots::{MAX_SAMPLES, MAX_SCENES, stride_so_far};
use svl_report::units::{
    BLOCK, Badness, BlockPictures, CheckpointShot, WorstFrame, WorstFrames, WorstPicture,
};
use svl_score::judge::{
    AreaChoice, Checkpoint, CheckpointFrame, CheckpointTally, Judged, JudgedEstimate,
    MetricSource as _, TestPiece, TrueCells, size_words,
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
    piece: Option<TestPiece>,
    /// Number of pairs of the run, or more; 0 if unknown.
    pairs: u64,
    /// Stamp of the first pair; absent if stamps are placeholders.
    start_ns: Option<u64>,
    /// True if the pairs are perturbed, so that none is shown.
    is_perturbed: bool,
    /// Tallies of leading frames, by checkpoint and algorithm.
    tallies: BTreeMap<(usize, String), CheckpointTally<RawShot>>,
    /// Frames spread over a recording or a data set, by their places: of each algorithm a shot.
    samples: Vec<(u64, Vec<RawFrame>)>,
    /// By algorithm the last block, and the worst frames of it and of all blocks before it without
    /// a gap, whose pictures were taken.
    worst: BTreeMap<String, (u64, WorstFrames<Option<RawFrame>>)>,
    /// What the shots of the frame at a place share.
    shared: Option<(u64, Arc<SharedFrame>)>,
}

/// A frame of an algorithm whose pictures are not made yet: most are outdone, or leave the stride.
struct RawFrame {
    heading: Heading,
    shot: RawShot,
}

/// The heading of a frame of a recording, without shots, or the name of a scene.
enum Heading {
    Frame(CheckpointFigure),
    Scene(String),
}

impl RawFrame {
    fn encoded(self) -> Result<WorstPicture> {
        let shot = self.shot.encoded()?;
        Ok(match self.heading {
            Heading::Frame(figure) => WorstPicture::Frame(Box::new(CheckpointFigure {
                shots: vec![(Rank::Sample, shot)],
                ..figure
            })),
            Heading::Scene(title) => WorstPicture::Scene(Box::new(SceneFigure {
                title,
                size: shot.size,
                left: shot.left,
                max_px: self.shot.shared.pictures()?.end_px.into(),
                truth: shot.true_preview,
                shots: vec![SceneResult {
                    row: shot.row,
                    disparities: shot.preview.unwrap_or_default(),
                    errors: shot.errors,
                }],
            })),
        })
    }
}

/// What the shots of a frame share; its pictures are made at their first use.
struct SharedFrame {
    frame: Frame,
    /// Largest width of its pictures, pixels.
    width: usize,
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
    fn new(judged: &Judged, width: usize) -> Self {
        let (frame, nearness) = (&judged.frame, Nearness::for_frame(&judged.frame));
        let marks = |truth: &TrueCells| overlay::marks(truth.grid(), frame.pair.size(), nearness);
        Self {
            truth: judged.true_cells.as_ref().map(marks),
            end_px: match frame.truth {
                Some(_) => nearness.near_px as f32,
                None => color_end(judged),
            },
            frame: frame.clone(),
            width,
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
        let true_preview = truth.map(|truth| preview(truth, end_px, self.width));
        let pictures = SharedPictures {
            left: left(&self.frame, self.width)?,
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
        let (truth, width) = (self.shared.frame.truth.as_ref(), self.shared.width);
        let errors = truth.map(|truth| error_picture(&self.disparity, truth, width));
        Ok(FrameShot {
            left: pictures.left.clone(),
            preview: Some(preview(&self.disparity, pictures.end_px, width)?),
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
            piece: start.judge.piece(),
            pairs: start.pairs.unwrap_or(0),
            start_ns: (!start.judge.run.is_untimed).then_some(start.judge.run.start_ns),
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
        let samples = std::mem::take(&mut self.samples);
        let places: BTreeSet<_> = samples.iter().map(|(place, _)| *place).collect();
        for (label, (_, worst)) in &mut self.worst {
            let own = pictures.entry(label.clone()).or_default();
            for frame in worst.take_pictures() {
                let (frame, raw) = frame.replace(());
                // Samples are of all algorithms that are pictured.
                let picture = match places.contains(&frame.place) {
                    true => WorstPicture::Sample,
                    false => raw.encoded()?,
                };
                own.worst.push(frame.replace(picture).0);
            }
        }
        for (place, frames) in samples {
            for frame in frames {
                let own = pictures.entry(frame.shot.shot.row.algorithm.clone());
                let own = own.or_default();
                match frame.encoded()? {
                    WorstPicture::Frame(figure) => own.samples.push((place, *figure)),
                    WorstPicture::Scene(scene) => own.scenes.push((place, *scene)),
                    WorstPicture::Sample => {}
                }
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
    ) {
        if self.is_perturbed {
            return;
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
            self.take_sample(place, identity, judged, &shown);
        }
        for scored in shown {
            self.take_worst(place, identity, judged, scored);
        }
    }

    /// Takes the frame if it is on the stride of those that are spread over a recording or a data
    /// set.
    fn take_sample(
        &mut self,
        place: u64,
        identity: &RowIdentity,
        judged: &Judged,
        shown: &[&JudgedEstimate],
    ) {
        let is_recording = identity.run.is_some();
        let limit = if is_recording {
            MAX_SAMPLES
        } else {
            MAX_SCENES
        };
        let stride = stride_so_far(self.pairs, place, limit);
        if !place.is_multiple_of(stride) {
            return;
        }
        self.samples
            .retain(|(place, _)| place.is_multiple_of(stride));
        if is_recording || judged.frame.name.is_some() {
            let frames = shown.iter();
            let frames = frames.map(|scored| self.raw_frame(place, identity, judged, scored));
            let frames = frames.collect();
            self.samples.push((place, frames));
        }
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
            let shared = self.shared(place, judged, MAX_WIDTH);
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
    fn shared(&mut self, place: u64, judged: &Judged, width: usize) -> Arc<SharedFrame> {
        let known = self.shared.take();
        let known = known.filter(|(own, shared)| (*own, shared.width) == (place, width));
        let known = known.unwrap_or_else(|| (place, Arc::new(SharedFrame::new(judged, width))));
        Arc::clone(&self.shared.insert(known).1)
    }

    /// The frame at that place through an algorithm.
    fn raw_frame(
        &mut self,
        place: u64,
        identity: &RowIdentity,
        judged: &Judged,
        scored: &JudgedEstimate,
    ) -> RawFrame {
        let (heading, width) = match scene_name(identity, judged) {
            Some(name) => (Heading::Scene(name.clone()), MAX_SCENE_WIDTH),
            None => (Heading::Frame(self.figure(identity, judged)), MAX_WIDTH),
        };
        let shared = self.shared(place, judged, width);
        let mut shot = RawShot::new(identity, judged, scored, shared);
        let unseen = self.piece.zip(self.unseen_m(judged, scored));
        let words = |(piece, m): (TestPiece, f64)| {
            let size = size_words(piece.size_m);
            format!("{size} at {m:.2} m is not seen")
        };
        shot.shot.failures.extend(unseen.map(words));
        RawFrame { heading, shot }
    }

    /// The distance of the test piece that an estimate does not show.
    fn unseen_m(&self, judged: &Judged, scored: &JudgedEstimate) -> Option<f64> {
        let (piece, view) = self.piece.as_ref().zip(judged.piece.as_ref())?;
        piece.unseen_m(view, scored.sight.as_ref()?)
    }

    /// Takes the frame if it may be one of the worst of its algorithm.
    fn take_worst(
        &mut self,
        place: u64,
        identity: &RowIdentity,
        judged: &Judged,
        scored: &JudgedEstimate,
    ) {
        let unseen_m = self.unseen_m(judged, scored);
        let Some(badness) = badness(scored, self.cells, unseen_m) else {
            return;
        };
        let is_scene = scene_name(identity, judged).is_some();
        let frame = WorstFrame {
            badness,
            // The report knows the place of the run.
            run: 0,
            place,
            stamp_ns: (!is_scene).then_some(judged.frame.stamp_ns),
            picture: (),
        };
        let (label, block) = (&scored.estimate.algorithm, place / BLOCK);
        let known = self.worst.remove(label);
        let known = known.filter(|(last, _)| block <= last + 1);
        let (_, mut worst) = known.unwrap_or_default();
        worst.add(frame, || {
            Some(self.raw_frame(place, identity, judged, scored))
        });
        self.worst.insert(label.clone(), (block, worst));
    }

    /// The heading of a frame, without its shots.
    fn figure(&self, identity: &RowIdentity, judged: &Judged) -> CheckpointFigure {
        let frame = &judged.frame;
        let at_s = |start_ns| frame.stamp_ns.saturating_sub(start_ns) as f64 / 1e9;
        let at_s = self.start_ns.map(at_s);
        let time = at_s.map(|at_s| format!(", {at_s:.2} s"));
        let seed = identity.seed.map(|seed| format!("seed {seed}"));
        let run = identity.run.clone().or(seed).unwrap_or_default();
        let shown = judged
            .estimates
            .iter()
            .flat_map(|scored| &scored.checkpoints);
        let shows: BTreeSet<_> = shown.map(|(i, _)| self.checkpoints[*i].number).collect();
        CheckpointFigure {
            title: format!(
                "{run}, frame {}{}",
                frame.sequence,
                time.unwrap_or_default()
            ),
            shows: shows.into_iter().collect(),
            at_s,
            ..CheckpointFigure::default()
        }
    }
}

/// The name of a frame that is a scene of a data set.
fn scene_name<'a>(identity: &RowIdentity, judged: &'a Judged) -> Option<&'a String> {
    let name = judged.frame.name.as_ref();
    name.filter(|_| identity.run.is_none())
}

/// The test piece that is not seen, missed cells, and the wrong ones of the headline's area with
/// their largest error; absent without truth.
fn badness(scored: &JudgedEstimate, rule: CellRule, unseen_m: Option<f64>) -> Option<Badness> {
    let cells = scored.cells.as_ref()?;
    let errors = cells.iter().zip(scored.estimate.grid.iter());
    let errors = errors.filter(|(judged, _)| AreaChoice::default().has(judged.area));
    let errors = errors.filter_map(|(judged, (_, cell))| judged.error_in_tolerances(cell, rule));
    Some(Badness {
        unseen: unseen_m.map_or(0.0, f64::recip),
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

/// A frame through one algorithm, for a page.
///
/// # Errors
/// The reason why its pictures cannot be encoded.
pub(crate) fn frame_shot(
    identity: &RowIdentity,
    judged: &Judged,
    scored: &JudgedEstimate,
) -> Result<FrameShot> {
    let shared = Arc::new(SharedFrame::new(judged, MAX_WIDTH));
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
