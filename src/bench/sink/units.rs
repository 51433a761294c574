//! Writes the units of a report: the results of a run, block by block.

use super::pictures::BlockShots;
use super::table::RunIdentity;
use super::{RunEnd, RunStart, Sink};
use std::collections::BTreeMap;
use std::path::PathBuf;
use svl_core::Result;
use svl_report::units::{BLOCK, BlockWriter, ReportPlan, ReportRun, SealedPair, Units};
use svl_report::{FrameRow, TruthRow, hash_words};
use svl_score::judge::{CellArea, Checkpoint, Judged, TrueCells};

/// Writes the results of a run.
pub struct UnitSink {
    units: Units,
    session: String,
    /// The identities of the algorithms, and whether they have pictures.
    algorithms: BTreeMap<String, (String, bool)>,
    identity: RunIdentity,
    folder: PathBuf,
    checkpoints: Vec<Checkpoint>,
    shots: BlockShots,
    /// Place of the next pair in the run.
    place: u64,
    block: Option<BlockWriter>,
}

impl UnitSink {
    /// Writes into the units of a report, for a session.
    pub fn new(units: &Units, plan: &ReportPlan, session: &str) -> Self {
        let pictured = plan.pictured();
        let labels = plan.manifest.labels().zip(&plan.identities);
        let algorithm = |(label, identity): (&str, &String)| {
            let facts = (identity.clone(), pictured.contains(&label));
            (label.to_owned(), facts)
        };
        Self {
            units: units.clone(),
            session: session.to_owned(),
            algorithms: labels.map(algorithm).collect(),
            identity: RunIdentity::default(),
            folder: PathBuf::new(),
            checkpoints: Vec::new(),
            shots: BlockShots::default(),
            place: 0,
            block: None,
        }
    }

    fn seal(&mut self, is_end: bool) -> Result<()> {
        let Some(block) = &mut self.block else {
            return Ok(());
        };
        let pictures = self.shots.make(is_end)?.cloned();
        block.seal(pictures.as_ref(), self.shots.are_made())
    }

    /// Seals the block under way, and ends it.
    fn end_block(&mut self) -> Result<()> {
        self.seal(true)?;
        self.block = None;
        self.shots.begin_block();
        Ok(())
    }
}

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

impl Sink for UnitSink {
    fn begin_run(&mut self, start: &RunStart<'_>) -> Result<()> {
        self.identity = RunIdentity::new(start);
        let run = ReportRun {
            run: self.identity.run.clone(),
            seed: self.identity.seed,
            stress: self.identity.stress.clone(),
        };
        self.folder = self.units.run_folder(&run)?;
        self.checkpoints.clone_from(&start.judge.checkpoints);
        self.shots = BlockShots::new(start);
        self.place = 0;
        self.block = None;
        Ok(())
    }

    fn take(&mut self, judged: &Judged) -> Result<()> {
        let place = self.place;
        self.place += 1;
        let is_new = |block: &BlockWriter| block.block() != place / BLOCK;
        if self.block.as_ref().is_some_and(is_new) {
            self.end_block()?;
        }
        if judged.estimates.is_empty() && judged.failures.is_empty() {
            return Ok(());
        }
        let number = place / BLOCK;
        let block = self.block.get_or_insert_with(|| {
            let name = format!("{number:05}-{}", self.session);
            BlockWriter::new(&self.folder, name, &self.session, number)
        });
        let frame = &judged.frame;
        for scored in &judged.estimates {
            block.cells.push(self.identity.cells(judged, scored))?;
            block.rows.push([self.identity.row(judged, scored)])?;
            let label = &scored.estimate.algorithm;
            for (i, shown) in &scored.checkpoints {
                let checkpoint = &self.checkpoints[*i];
                block
                    .frames
                    .push([FrameRow::new(frame.sequence, label, checkpoint, shown)])?;
            }
        }
        block.truths.push(truths(judged))?;
        block.failures.push(self.identity.failures(judged))?;
        let pictured: Vec<_> = (self.algorithms.iter())
            .filter(|(_, (_, is_pictured))| *is_pictured)
            .map(|(label, _)| label.as_str())
            .collect();
        self.shots.take(place, &pictured, &self.identity, judged)?;
        let answered = judged.estimates.iter();
        let answered = answered.map(|scored| scored.estimate.algorithm.as_str());
        let failed = judged.failures.iter();
        let failed = failed.map(|failure| failure.algorithm.as_str());
        let algorithms = answered.chain(failed).filter_map(|label| {
            let (identity, has_pictures) = self.algorithms.get(label)?;
            Some((label, identity.as_str(), *has_pictures))
        });
        let pair = SealedPair {
            place,
            sequence: frame.sequence,
            input_hash: hash_words(judged.input_hash()),
            has_rig: frame.rig().is_some(),
        };
        block.add_pair(pair, algorithms);
        Ok(())
    }

    fn settle(&mut self) -> Result<()> {
        self.seal(false)
    }

    fn end_run(&mut self, _: &RunEnd<'_>) -> Result<()> {
        self.end_block()
    }
}
