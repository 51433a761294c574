//! The tables of a report, made of its units, in the order of runs, pairs and algorithms.

use super::block::{CELLS, DRIVES, FAILURES, FRAMES, ROWS, TRACKS, TRUTHS};
use super::kept::KeptResults;
use super::store::{StoredSeal, StoredSession, Units};
use super::{ReportPlan, ReportRun, RunFacts, SealedPair};
use crate::accuracy::{AccuracyRow, AccuracyTally};
use crate::csv_rows::{RowReader, read_rows};
use crate::drives::{DriveRow, TrackRow};
use crate::prior::{PRIOR, PriorTally, TruthRow};
use crate::reliability::{ReliabilityRow, ReliabilityTallies};
use crate::rows::{CellRow, CheckpointRow, FailureRow, FrameRow, Record, Row};
use crate::table_writer::TableWriter;
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};
use std::sync::mpsc::sync_channel;
use svl_core::Result;
use svl_core::depth::GridSettings;
use svl_core::stereo::{Cell, CellDepth, CellRule, CellState, DepthGrid, GridShape};
use svl_score::judge::{Checkpoint, CheckpointFrame, CheckpointTally, agreed_cells};
use svl_score::manifest::{RunRecord, hash};

/// A run of a report with what is kept of it.
pub struct RunUnits {
    pub run: ReportRun,
    /// None of a run that no session began.
    pub facts: Option<RunFacts>,
    pub kept: KeptResults,
}

impl RunUnits {
    /// Reads the units of a run. `damaged` gets the file of each unit that is not what was sealed.
    ///
    /// # Errors
    /// [`svl_core::Error::Io`], [`svl_core::Error::Format`].
    pub fn read(
        units: &Units,
        plan: &ReportPlan,
        run: &ReportRun,
        sessions: &[StoredSession],
        damaged: impl FnMut(&StoredSeal, PathBuf),
    ) -> Result<Self> {
        let facts = units.facts(run)?;
        let seals = units.seals(run, sessions, damaged)?;
        let end = facts.as_ref().and_then(|facts| facts.end.as_ref());
        let pairs = end.map(|end| end.pairs);
        // Perturbed pairs are not shown.
        let pictured = match run.stress {
            None => plan.pictured(),
            Some(_) => Vec::new(),
        };
        Ok(Self {
            run: run.clone(),
            facts,
            kept: KeptResults::new(plan, seals, pairs, &pictured),
        })
    }

    /// The recording that it reads, if it is one; of perturbed pairs that is told once.
    pub fn record(&self) -> Option<RunRecord> {
        let facts = self.facts.as_ref().filter(|_| self.run.stress.is_none())?;
        facts.record.clone()
    }

    /// Number of its pairs, once all were read.
    pub fn pairs(&self) -> Option<u64> {
        let end = self.facts.as_ref().and_then(|facts| facts.end.as_ref());
        end.map(|end| end.pairs)
    }

    /// Forgets what is kept of an algorithm whose results depend on all earlier pairs, unless it is
    /// all, and of one session.
    pub fn forget_partial(&mut self, label: &str) {
        let pairs = self.pairs();
        let is_whole = Some(self.kept.count(label)) == pairs;
        if !is_whole || self.kept.sessions(label).len() > 1 {
            self.kept.forget(label);
        }
    }

    /// The reason to doubt its truth, by the algorithms of the plan.
    pub fn doubt(&self, plan: &ReportPlan) -> Option<String> {
        let mut scales = self.facts.as_ref()?.scales.clone();
        scales
            .algorithms
            .retain(|label, _| plan.identity(label).is_some());
        scales.doubt()
    }

    /// True if all its pairs were read, and every algorithm has a result of each or failed on it.
    pub fn is_whole(&self, plan: &ReportPlan) -> bool {
        let count = |label: &str| self.kept.count(label);
        if plan.is_driven() {
            return plan.manifest.labels().all(|label| count(label) > 0);
        }
        let pairs = self.pairs();
        pairs.is_some()
            && plan
                .labels_of(&self.run)
                .into_iter()
                .all(|label| Some(count(label)) == pairs)
    }
}

/// The rows of a report's tables, without those of the cells.
#[derive(Default)]
pub struct ReportTables {
    pub rows: Vec<Row>,
    pub failures: Vec<FailureRow>,
    pub checkpoints: Vec<CheckpointRow>,
    /// Of cells, where they are asked for.
    pub accuracy: Vec<AccuracyRow>,
    /// Likewise.
    pub reliability: Vec<ReliabilityRow>,
    /// The rows of the prior, where cells are scored by distances.
    pub prior: Vec<Row>,
    pub drives: Vec<DriveRow>,
    pub tracks: Vec<TrackRow>,
}

/// Digest of all that the tables are made of.
pub fn made_of(plan: &ReportPlan, runs: &[RunUnits]) -> String {
    let description = plan.manifest.description.as_ref();
    let rule =
        ["grid", "cells", "checkpoint"].map(|key| description.and_then(|value| value.get(key)));
    let mut text = format!("{} {:?} {rule:?}", plan.manifest.scenario, plan.labels());
    for run in runs {
        text += &format!("\n{:?}", run.run);
        for label in plan.labels() {
            text += &format!("\n{label} {:?}", run.kept.places(label));
        }
        for stored in run.kept.seals() {
            text += &format!("\n{:?}", stored.seal.files);
        }
    }
    hash(&text)
}

/// Reads the tables that are in a folder.
///
/// # Errors
/// [`svl_core::Error::Io`], [`svl_core::Error::Format`].
pub fn read_tables(folder: &Path, plan: &ReportPlan) -> Result<ReportTables> {
    let file = |name: &str| folder.join(format!("{name}.csv"));
    let mut tables = ReportTables {
        rows: read_rows(&file("rows"))?,
        failures: read_rows(&file("failures"))?,
        ..ReportTables::default()
    };
    if plan.is_driven() {
        tables.drives = read_rows(&file("drives"))?;
        tables.tracks = read_rows(&file("tracks"))?;
    } else {
        tables.checkpoints = read_rows(&file("checkpoints"))?;
        tables.accuracy = read_rows(&file("accuracy"))?;
        tables.reliability = read_rows(&file("reliability"))?;
        tables.prior = read_rows(&file(PRIOR))?;
    }
    Ok(tables)
}

/// Largest number of pairs whose cells wait to be written.
const MAX_QUEUED_PAIRS: usize = 64;

/// Writes the tables of a report, as `.csv` and `.parquet`, into its folder.
///
/// # Errors
/// Those of the units' files and of the tables'.
pub fn write_tables(folder: &Path, plan: &ReportPlan, runs: &[RunUnits]) -> Result<ReportTables> {
    let mut rows = TableWriter::create_both(folder, "rows")?;
    let mut cells = TableWriter::create_both(folder, "cells")?;
    let mut failures = TableWriter::create_both(folder, "failures")?;
    let tables = std::thread::scope(|scope| {
        let (send, received) = sync_channel(MAX_QUEUED_PAIRS);
        // The cells are most of the rows: read here, and written in another thread.
        let writing = scope.spawn(move || {
            let mut received = received.into_iter();
            received.try_for_each(|rows_of_pair: Vec<CellRow>| cells.push(rows_of_pair))?;
            cells.finish()
        });
        let tables = collect_tables(plan, runs, true, |rows_of_pair| {
            // Fails only once the other thread has ended with an error.
            let _ = send.send(rows_of_pair.cells);
            failures.push(rows_of_pair.failures.iter().cloned())?;
            rows.push(rows_of_pair.rows.iter().cloned())
        });
        drop(send);
        let written = writing.join();
        written.unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
        tables
    })?;
    rows.finish()?;
    failures.finish()?;
    if plan.is_driven() {
        write_table(folder, "drives", &tables.drives)?;
        write_table(folder, "tracks", &tables.tracks)?;
    } else {
        write_table(folder, "checkpoints", &tables.checkpoints)?;
        write_table(folder, "accuracy", &tables.accuracy)?;
        write_table(folder, "reliability", &tables.reliability)?;
        write_table(folder, PRIOR, &tables.prior)?;
    }
    Ok(tables)
}

/// The rows of a pair, as they are collected.
pub struct TakenRows<'a> {
    rows: &'a [Row],
    cells: Vec<CellRow>,
    failures: &'a [FailureRow],
}

/// Collects the rows of units in the order of runs, pairs and algorithms. `has_cells`: false where
/// cells are not asked for, nor what is computed of them.
///
/// # Errors
/// Those of the units' files, and of `take`, which gets the rows of each pair.
pub fn collect_tables(
    plan: &ReportPlan,
    runs: &[RunUnits],
    has_cells: bool,
    mut take: impl FnMut(TakenRows<'_>) -> Result<()>,
) -> Result<ReportTables> {
    let mut tables = ReportTables::default();
    let places = plan.manifest.labels().map(str::to_owned).zip(0..);
    let places: HashMap<String, usize> = places.collect();
    let rule = ScoreRule::new(plan)?;
    let mut accuracy = AccuracyTally::new(rule.cells);
    let mut reliability = ReliabilityTallies::default();
    let mut prior = PriorTally::default();
    for run in runs {
        accuracy.begin_run();
        let mut tallies = RunTallies::new(plan, &rule, &run.run);
        let mut collect = |mut rows_of_pair: PairRows| -> Result<()> {
            rows_of_pair.sort(&places);
            if let Some(pair) = &rows_of_pair.pair {
                rule.add_agreed(&mut rows_of_pair.rows, &rows_of_pair.cells, pair.has_rig);
            }
            if let (Some(row), false) = (rows_of_pair.rows.first(), plan.is_driven()) {
                accuracy.add(row.stamp_ns, &rows_of_pair.cells);
                reliability.add(&rows_of_pair.cells);
                prior.add(row, std::mem::take(&mut rows_of_pair.truths));
            }
            take(TakenRows {
                rows: &rows_of_pair.rows,
                cells: rows_of_pair.cells,
                failures: &rows_of_pair.failures,
            })?;
            tallies.add(&rows_of_pair.rows, &rows_of_pair.frames);
            tables.failures.extend(rows_of_pair.failures);
            tables.rows.extend(rows_of_pair.rows);
            tables.drives.extend(rows_of_pair.drives);
            tables.tracks.extend(rows_of_pair.tracks);
            Ok(())
        };
        if plan.is_driven() {
            for label in plan.labels() {
                if let Some((_, seal)) = run.kept.first(label) {
                    collect(PairRows::from_drive(seal)?)?;
                }
            }
        } else {
            each_pair(&run.kept, plan, has_cells, &mut collect)?;
        }
        tables.checkpoints.extend(tallies.into_rows());
    }
    tables.accuracy = accuracy.into_rows(&plan.labels());
    tables.reliability = reliability.into_rows(&plan.labels());
    tables.prior = prior.into_rows(rule.cells);
    Ok(tables)
}

fn write_table<R: Record + Clone>(folder: &Path, name: &str, rows: &[R]) -> Result<()> {
    let mut table = TableWriter::create_both(folder, name)?;
    table.push(rows.iter().cloned())?;
    table.finish()
}

/// The rows of a pair, or of a drive.
#[derive(Default)]
struct PairRows {
    pair: Option<SealedPair>,
    rows: Vec<Row>,
    cells: Vec<CellRow>,
    failures: Vec<FailureRow>,
    frames: Vec<FrameRow>,
    drives: Vec<DriveRow>,
    tracks: Vec<TrackRow>,
    truths: Vec<TruthRow>,
}

impl PairRows {
    fn from_drive(seal: &StoredSeal) -> Result<Self> {
        Ok(Self {
            rows: seal.whole(ROWS)?,
            cells: seal.whole(CELLS)?,
            failures: seal.whole(FAILURES)?,
            drives: seal.whole(DRIVES)?,
            tracks: seal.whole(TRACKS)?,
            ..Self::default()
        })
    }

    /// Sorts the rows by the places of their algorithms; those of an algorithm keep their order.
    fn sort(&mut self, places: &HashMap<String, usize>) {
        let place = |label: &str| places.get(label).copied();
        self.rows.sort_by_key(|row| place(&row.algorithm));
        self.cells.sort_by_key(|row| place(&row.algorithm));
        self.failures.sort_by_key(|row| place(&row.algorithm));
    }
}

/// Hands on the rows of each pair of a run, from whichever seals have them.
fn each_pair(
    kept: &KeptResults,
    plan: &ReportPlan,
    has_cells: bool,
    take: &mut impl FnMut(PairRows) -> Result<()>,
) -> Result<()> {
    let labels = plan.labels();
    // Per block the places with results, and the seals that they are taken of.
    let mut blocks: BTreeMap<u64, BTreeMap<u64, Vec<usize>>> = BTreeMap::new();
    for label in &labels {
        for (&place, &seal) in kept.places(label).into_iter().flatten() {
            let block = blocks.entry(place / super::BLOCK).or_default();
            let seals = block.entry(place).or_default();
            if !seals.contains(&seal) {
                seals.push(seal);
            }
        }
    }
    for places in blocks.into_values() {
        let mut readers: BTreeMap<usize, SealReader<'_>> = BTreeMap::new();
        for (place, seals) in places {
            let mut rows_of_pair = PairRows::default();
            for i in seals {
                let reader = match readers.entry(i) {
                    std::collections::btree_map::Entry::Occupied(entry) => entry.into_mut(),
                    std::collections::btree_map::Entry::Vacant(entry) => {
                        entry.insert(SealReader::open(&kept.seals()[i], has_cells)?)
                    }
                };
                let is_taken = |label: &str| kept.seal(label, place) == Some(i);
                reader.take(place, &is_taken, &mut rows_of_pair)?;
            }
            take(rows_of_pair)?;
        }
    }
    Ok(())
}

/// The tables of a seal, read pair by pair.
struct SealReader<'a> {
    pairs: std::slice::Iter<'a, SealedPair>,
    rows: PairReader<Row>,
    cells: PairReader<CellRow>,
    failures: PairReader<FailureRow>,
    frames: PairReader<FrameRow>,
    truths: PairReader<TruthRow>,
}

impl<'a> SealReader<'a> {
    fn open(stored: &'a StoredSeal, has_cells: bool) -> Result<Self> {
        Ok(Self {
            pairs: stored.seal.pairs.iter(),
            rows: PairReader::open(stored, ROWS)?,
            cells: if has_cells {
                PairReader::open(stored, CELLS)?
            } else {
                PairReader::default()
            },
            failures: PairReader::open(stored, FAILURES)?,
            frames: PairReader::open(stored, FRAMES)?,
            truths: if has_cells {
                PairReader::open(stored, TRUTHS)?
            } else {
                PairReader::default()
            },
        })
    }

    /// Adds the rows of the pair at `place` that are taken, by their algorithms.
    fn take(
        &mut self,
        place: u64,
        is_taken: &dyn Fn(&str) -> bool,
        rows_of_pair: &mut PairRows,
    ) -> Result<()> {
        for pair in self.pairs.by_ref() {
            let is_here = pair.place == place;
            let keep = |label: &str| is_here && is_taken(label);
            self.rows
                .take(pair.sequence, &keep, &mut rows_of_pair.rows)?;
            self.cells
                .take(pair.sequence, &keep, &mut rows_of_pair.cells)?;
            self.failures
                .take(pair.sequence, &keep, &mut rows_of_pair.failures)?;
            self.frames
                .take(pair.sequence, &keep, &mut rows_of_pair.frames)?;
            // Sessions have the same truth of a pair.
            let is_first = rows_of_pair.truths.is_empty();
            let keep = |_: &str| is_here && is_first;
            self.truths
                .take(pair.sequence, &keep, &mut rows_of_pair.truths)?;
            if is_here {
                rows_of_pair.pair = Some(pair.clone());
                break;
            }
        }
        Ok(())
    }
}

/// A table of a seal, whose rows are in the order of the pairs.
struct PairReader<R> {
    reader: Option<RowReader<R>>,
    next: Option<R>,
}

impl<R> Default for PairReader<R> {
    fn default() -> Self {
        Self {
            reader: None,
            next: None,
        }
    }
}

impl<R: RowOfPair> PairReader<R> {
    fn open(stored: &StoredSeal, table: &str) -> Result<Self> {
        let file = stored.table(table);
        let reader = file.map(|(path, bytes)| RowReader::open_beginning(&path, bytes));
        let mut reader = reader.transpose()?;
        let next = match &mut reader {
            Some(reader) => reader.next().transpose()?,
            None => None,
        };
        Ok(Self { reader, next })
    }

    fn take(
        &mut self,
        sequence: u64,
        keep: &dyn Fn(&str) -> bool,
        rows: &mut Vec<R>,
    ) -> Result<()> {
        while let Some(row) = self.next.take_if(|row| row.sequence() == sequence) {
            if keep(row.algorithm()) {
                rows.push(row);
            }
            if let Some(reader) = &mut self.reader {
                self.next = reader.next().transpose()?;
            }
        }
        Ok(())
    }
}

/// A row of a pair.
trait RowOfPair: Record {
    fn sequence(&self) -> u64;
    fn algorithm(&self) -> &str;
}

macro_rules! pair_rows {
    ($($kind:ty),*) => {$(
        impl RowOfPair for $kind {
            fn sequence(&self) -> u64 {
                self.sequence
            }

            fn algorithm(&self) -> &str {
                &self.algorithm
            }
        }
    )*};
}

pair_rows!(Row, CellRow, FailureRow, FrameRow);

impl RowOfPair for TruthRow {
    fn sequence(&self) -> u64 {
        self.sequence
    }

    /// That of all.
    fn algorithm(&self) -> &'static str {
        ""
    }
}

/// The rules of the scenario by which its frames were scored.
struct ScoreRule {
    shape: GridShape,
    cells: CellRule,
    checkpoints: Vec<Checkpoint>,
}

impl ScoreRule {
    fn new(plan: &ReportPlan) -> Result<Self> {
        Ok(Self {
            shape: plan
                .manifest
                .part::<GridSettings>("grid")?
                .unwrap_or_default()
                .shape(),
            cells: plan.manifest.part("cells")?.unwrap_or_default(),
            checkpoints: plan.manifest.part("checkpoint")?.unwrap_or_default(),
        })
    }

    /// Sets, without truth, the share of cells that agree with the median of the other algorithms.
    fn add_agreed(&self, rows: &mut [Row], cells: &[CellRow], has_rig: bool) {
        for row in rows.iter_mut() {
            row.metrics.set("agreed", None);
        }
        // A median needs at least two others.
        if rows.len() < 3 || rows.iter().any(|row| row.truth.is_some()) {
            return;
        }
        let grid = |row: &Row| {
            let own = cells.iter().filter(|cell| cell.algorithm == row.algorithm);
            depth_grid(own, self.shape)
        };
        let grids: Vec<_> = rows.iter().map(grid).collect();
        let rule = self.cells.for_rig(has_rig);
        for (i, row) in rows.iter_mut().enumerate() {
            let others = grids.iter().enumerate().filter(|(j, _)| *j != i);
            let others: Vec<_> = others.filter_map(|(_, grid)| grid.as_ref()).collect();
            if let Some(own) = &grids[i] {
                let agreed = agreed_cells(own, &others, rule) as f64 / self.shape.cells() as f64;
                row.metrics.set("agreed", Some(agreed));
            }
        }
    }
}

/// The grid of these rows; none unless all its cells are there.
fn depth_grid<'a>(rows: impl Iterator<Item = &'a CellRow>, shape: GridShape) -> Option<DepthGrid> {
    let mut cells = vec![None; shape.cells()];
    for row in rows {
        let (column, line) = (row.column as usize, row.row as usize);
        if column >= shape.columns || line >= shape.rows {
            return None;
        }
        let depth = match (row.median_px, row.p20_px, row.p80_px) {
            (Some(median_px), Some(p20_px), Some(p80_px)) => Some(CellDepth {
                median_px: median_px as f32,
                p20_px: p20_px as f32,
                p80_px: p80_px as f32,
                distance_m: row.distance_m,
            }),
            _ => None,
        };
        cells[line * shape.columns + column] = Some(Cell {
            valid_share: row.valid_share,
            depth,
            probability: row.probability,
            too_close: row.state == Some(CellState::TooClose),
            near: row.near_probability,
            ..Cell::UNKNOWN
        });
    }
    let cells = cells.into_iter().collect::<Option<Vec<_>>>()?;
    DepthGrid::new(shape, cells).ok()
}

/// The checkpoints of a run, by checkpoint and algorithm.
struct RunTallies<'a> {
    scenario: &'a str,
    run: &'a ReportRun,
    checkpoints: &'a [Checkpoint],
    labels: Vec<&'a str>,
    tallies: Vec<Vec<CheckpointTally<u64>>>,
    took_part: Vec<bool>,
}

impl<'a> RunTallies<'a> {
    fn new(plan: &'a ReportPlan, rule: &'a ScoreRule, run: &'a ReportRun) -> Self {
        let labels = plan.labels();
        let tallies = vec![CheckpointTally::default(); labels.len()];
        Self {
            scenario: &plan.manifest.scenario,
            run,
            checkpoints: &rule.checkpoints,
            tallies: vec![tallies; rule.checkpoints.len()],
            took_part: vec![false; labels.len()],
            labels,
        }
    }

    fn add(&mut self, rows: &[Row], frames: &[FrameRow]) {
        for row in rows {
            if let Some(a) = self.place(&row.algorithm) {
                self.took_part[a] = true;
            }
        }
        for frame in frames {
            let mut checkpoints = self.checkpoints.iter();
            let c = checkpoints.position(|own| own.number == frame.checkpoint);
            if let Some((c, a)) = c.zip(self.place(&frame.algorithm)) {
                self.tallies[c][a].add(frame.scored(), || frame.sequence);
            }
        }
    }

    fn place(&self, label: &str) -> Option<usize> {
        self.labels.iter().position(|own| *own == label)
    }

    fn into_rows(self) -> Vec<CheckpointRow> {
        let mut rows = Vec::new();
        for (checkpoint, tallies) in self.checkpoints.iter().zip(&self.tallies) {
            let algorithms = self.labels.iter().zip(tallies).zip(&self.took_part);
            for ((label, tally), _) in algorithms.filter(|(_, took_part)| **took_part) {
                let (best, worst) = (tally.best.as_ref(), tally.worst.as_ref());
                rows.push(CheckpointRow {
                    scenario: self.scenario.to_owned(),
                    seed: self.run.seed,
                    checkpoint: checkpoint.number,
                    name: checkpoint.name.clone(),
                    algorithm: (*label).to_owned(),
                    frames: tally.frames as u64,
                    passed: tally.passed as u64,
                    share: tally.share(),
                    best_sequence: best.map(|(sequence, _)| *sequence),
                    best_passed: best.map(|(_, frame)| frame.passed),
                    worst_sequence: worst.map(|(sequence, _)| *sequence),
                    worst_passed: worst.map(|(_, frame)| frame.passed),
                    run: self.run.run.clone(),
                    stress: self.run.stress.clone(),
                });
            }
        }
        rows
    }
}

impl FrameRow {
    /// The result of a checkpoint as a row.
    pub fn new(
        sequence: u64,
        algorithm: &str,
        checkpoint: &Checkpoint,
        frame: &CheckpointFrame,
    ) -> Self {
        Self {
            sequence,
            algorithm: algorithm.to_owned(),
            checkpoint: checkpoint.number,
            passed: frame.passed,
            missing: frame.missing as u64,
            wrong: frame.wrong as u64,
            order_holds: frame.order_holds,
            error: frame.error,
        }
    }

    /// The result of the checkpoint.
    pub fn scored(&self) -> CheckpointFrame {
        CheckpointFrame {
            passed: self.passed,
            missing: self.missing as usize,
            wrong: self.wrong as usize,
            order_holds: self.order_holds,
            error: self.error,
        }
    }
}
