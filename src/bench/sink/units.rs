//! Writes the units of a report: the results of a run, block by block.

use super::pictures::BlockShots;
use super::table::RowIdentity;
use super::{PassEnd, PassStart, Sink};
use nalgebra::Translation3;
use parking_lot::Mutex;
use std::collections::BTreeMap;
use std::sync::Arc;
use svl_core::Result;
use svl_core::stereo::{CellRule, Frame, GridShape, Rgb, Rig, hash_words};
use svl_report::units::{
    BLOCK, PairFacts, PlannedAlgorithm, ReportPlan, ReportRun, UnitHeader, UnitRows, UnitWriter,
    Units,
};
use svl_report::{FloorRays, FrameRow, TruthRow};
use svl_score::judge::{BodyPose, CellArea, Checkpoint, Judged, TestPiece, TrueCells};
use svl_score::manifest::{hash, hash_bytes};
use svl_score::pixel_errors::{PixelErrors, TruePixels};
use svl_score::plausibility::{SCALE_FRAMES, TruthScales};

/// The truth of the cells of a frame, where distances are scored.
fn truths(judged: &Judged) -> Vec<TruthRow> {
    let (frame, truth) = (&judged.frame, judged.true_cells.as_ref());
    let has_pixels = |cells: &&TrueCells| {
        let mut areas = cells.truths().filter_map(|(_, truth)| truth.area);
        areas.any(|area| area == CellArea::Pixels)
    };
    let (Some(cells), Some(rig)) = (truth.filter(|cells| !has_pixels(cells)), frame.rig()) else {
        return Vec::new();
    };
    let truth = frame.truth.as_ref();
    let knows_floor = truth.is_some_and(|truth| truth.surface.is_some());
    TruthRow::for_cells(frame.sequence, rig, knows_floor, cells.truths())
}

/// The pairs of a run so far.
pub type SeenPairs = Arc<Mutex<Vec<PairFacts>>>;

/// Writes the results of a run, and collects the facts of its pairs.
pub struct UnitSink {
    units: Units,
    plan: ReportPlan,
    session: String,
    run: ReportRun,
    identity: RowIdentity,
    checkpoints: Vec<Checkpoint>,
    piece: Option<TestPiece>,
    /// Position of the pair before.
    place: Option<Translation3<f64>>,
    /// Rule by which cells are scored.
    cells: CellRule,
    shape: GridShape,
    start_ns: u64,
    shots: BlockShots,
    /// The units of the block under way, by their algorithms.
    block: BTreeMap<String, UnitWriter>,
    scales: TruthScales,
    /// By algorithm.
    pixel_errors: BTreeMap<String, PixelErrors>,
    /// Frames with a truth so far.
    truths: u64,
    pairs: SeenPairs,
}

impl UnitSink {
    /// Writes into the units of a report, for a session; the pairs of the run under way, or of the
    /// last one, are in `pairs`.
    pub fn new(units: &Units, plan: &ReportPlan, session: &str, pairs: &SeenPairs) -> Self {
        Self {
            units: units.clone(),
            plan: plan.clone(),
            session: session.to_owned(),
            run: ReportRun::default(),
            identity: RowIdentity::default(),
            checkpoints: Vec::new(),
            piece: None,
            place: None,
            cells: CellRule::default(),
            shape: GridShape::default(),
            start_ns: 0,
            shots: BlockShots::default(),
            block: BTreeMap::new(),
            scales: TruthScales::default(),
            pixel_errors: BTreeMap::new(),
            truths: 0,
            pairs: Arc::clone(pairs),
        }
    }

    /// Writes the units of the block under way, with all pairs so far.
    fn end_block(&mut self) -> Result<()> {
        let (mut block, scales) = (std::mem::take(&mut self.block), self.scales.measured());
        self.scales = TruthScales::default();
        let mut pixel_errors = std::mem::take(&mut self.pixel_errors);
        let mut pictures = self.shots.take_pictures()?;
        let pictured = self.plan.pictured();
        let pairs = self.pairs.lock();
        let Some(number) = (pairs.len() as u64).checked_sub(1).map(|last| last / BLOCK) else {
            return Ok(());
        };
        if block.is_empty() {
            return Ok(());
        }
        self.units.run_folder(&self.run)?;
        for algorithm in self.plan.algorithms_of(&self.run) {
            let PlannedAlgorithm { label, .. } = algorithm;
            let Some(mut writer) = block.remove(label) else {
                continue;
            };
            let name = algorithm.unit_name(number, &pairs);
            let path = self.units.unit_path(&self.run, &name);
            writer.pixel_errors = pixel_errors.remove(label).unwrap_or_default();
            writer.pairs = pairs[(number * BLOCK) as usize..].to_vec();
            writer.header = UnitHeader {
                run: self.run.digest.clone(),
                name,
                label: label.to_owned(),
                session: self.session.clone(),
                block: number,
                has_pictures: pictured.contains(&label),
                scale: scales.for_label(label),
                ..UnitHeader::default()
            };
            writer.write(&path, pictures.remove(label).as_ref())?;
        }
        Ok(())
    }

    /// The facts of the pair of a frame.
    fn pair(&self, judged: &Judged) -> PairFacts {
        let frame = &judged.frame;
        let Frame {
            name, pose, base, ..
        } = frame;
        let input = hash_words(judged.input_hash());
        // Programs may get the colours that the pair is the luma of.
        let colors = frame.color.as_ref();
        let bytes = |own: &Rgb| {
            own.rows()
                .map(<[_]>::as_flattened)
                .collect::<Vec<_>>()
                .concat()
        };
        let colors = colors.map(|own| own.each_ref().map(|own| hash_bytes(&bytes(own))));
        let key = (frame.sequence, name, (pose, base), self.start_ns, colors);
        let maps = frame.maps.iter().map(|map| {
            let pixels = map.disparity.pixels();
            let bytes: Vec<u8> = pixels.flat_map(f32::to_le_bytes).collect();
            (map.source.clone(), hash_bytes(&bytes))
        });
        PairFacts {
            sequence: frame.sequence,
            hash: hash(&format!("{input} {key:?}")),
            infinity_px: frame.rig().map(Rig::infinity_px),
            body: BodyPose::new(frame),
            floor: frame
                .floor
                .zip(frame.rig())
                .map(|(plane, rig)| FloorRays::new(&plane, rig, frame.pair.size(), self.shape)),
            maps: maps.collect(),
        }
    }

    fn take_pair(&mut self, judged: &Judged) -> Result<()> {
        let place = self.pairs.lock().len() as u64;
        if place > 0 && place.is_multiple_of(BLOCK) {
            self.end_block()?;
        }
        let pair = self.pair(judged);
        self.pairs.lock().push(pair);
        let frame = &judged.frame;
        // Perturbed pairs have the truth of the others.
        let truths = match self.run.stress {
            None => truths(judged),
            Some(_) => Vec::new(),
        };
        let here = frame.pose.map(|pose| pose.translation);
        let steps = here.zip(std::mem::replace(&mut self.place, here));
        let way_m = steps.map(|(here, before)| (here.vector - before.vector).norm());
        let is_perturbed = self.run.stress.is_some();
        let pixels = (!is_perturbed).then(|| TruePixels::new(frame, &self.cells));
        let piece = self.piece.filter(|_| !is_perturbed);
        for scored in judged.estimates.iter().chain(&judged.witness) {
            let label = &scored.estimate.algorithm;
            if let Some(pixels) = &pixels {
                let own = self.pixel_errors.entry(label.clone()).or_default();
                own.add(pixels, &scored.estimate);
            }
            let shown = scored.checkpoints.iter();
            let frames = shown.map(|(i, shown)| {
                FrameRow::new(frame.sequence, label, &self.checkpoints[*i], shown)
            });
            let rows = UnitRows {
                rows: vec![self.identity.row(judged, scored)],
                cells: self.identity.cells(judged, scored),
                frames: frames.collect(),
                truths: truths.clone(),
                sights: piece
                    .and_then(|piece| self.identity.sight(judged, scored, (piece, way_m)))
                    .into_iter()
                    .collect(),
                ..UnitRows::default()
            };
            self.block.entry(label.clone()).or_default().push(&rows)?;
        }
        for failure in self.identity.failures(judged) {
            let own = self.block.entry(failure.algorithm.clone()).or_default();
            let failures = vec![failure];
            own.push(&UnitRows {
                failures,
                truths: truths.clone(),
                ..UnitRows::default()
            })?;
        }
        self.truths += u64::from(frame.truth.is_some());
        if self.truths <= SCALE_FRAMES {
            self.scales.observe(judged);
        }
        let pictured = self.plan.pictured();
        self.shots.take(place, &pictured, &self.identity, judged);
        Ok(())
    }
}

impl Sink for UnitSink {
    fn begin_pass(&mut self, start: &PassStart<'_>) -> Result<()> {
        self.identity = RowIdentity::new(start);
        let RowIdentity {
            run, seed, stress, ..
        } = &self.identity;
        let mut runs = self.plan.runs.iter();
        let own = runs.find(|own| own.run == *run && own.seed == *seed && own.stress == *stress);
        self.run = own.cloned().unwrap_or_default();
        self.checkpoints.clone_from(&start.judge.checkpoints);
        self.piece = start.judge.piece();
        self.place = None;
        self.cells = start.judge.cells;
        self.shape = start.judge.grid.shape();
        self.start_ns = start.judge.run.start_ns;
        self.shots = BlockShots::new(start);
        self.block.clear();
        self.truths = 0;
        self.pairs.lock().clear();
        Ok(())
    }

    fn take(&mut self, judged: &Judged) -> Result<()> {
        let taken = self.take_pair(judged);
        if taken.is_err() {
            // It would lack a pair.
            self.block.clear();
        }
        taken
    }

    fn end_pass(&mut self, _: &PassEnd<'_>) -> Result<()> {
        self.end_block()
    }
}
