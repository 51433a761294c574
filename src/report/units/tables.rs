//! The tables of a report, made of its units, in the order of runs, pairs and algorithms.

use super::BLOCK;
use super::plan::{ReportPlan, ReportRun};
use super::run::{PairFacts, RunUnits};
use super::unit::{UnitReader, UnitRows};
use crate::accuracy::{AccuracyRow, AccuracyTally};
use crate::csv_rows::read_rows;
use crate::drives::{DriveRow, TrackRow};
use crate::reliability::{ReliabilityRow, ReliabilityTallies};
use crate::rows::{CellRow, CheckpointRow, FailureRow, FrameRow, Record, Row};
use crate::table_writer::TableWriter;
use std::path::Path;
use std::sync::mpsc::sync_channel;
use svl_core::Result;
use svl_core::depth::GridSettings;
use svl_core::stereo::{Cell, CellDepth, CellRule, CellState, DepthGrid, GridShape};
use svl_score::judge::{Checkpoint, CheckpointFrame, CheckpointTally, agreed_cells};
use svl_score::manifest::hash;

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
        text += &format!("\n{:?} {}", run.run, run.facts.inputs());
        let units = run.all().map(|unit| unit.checksum.as_str());
        text += &units.collect::<Vec<_>>().join(" ");
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
    let rule = ScoreRule::new(plan)?;
    let mut accuracy = AccuracyTally::new(rule.cells);
    let mut reliability = ReliabilityTallies::default();
    for run in runs {
        accuracy.begin_run();
        let mut tallies = RunTallies::new(plan, &rule, &run.run);
        let mut collect = |mut rows: UnitRows, pair: Option<&PairFacts>| -> Result<()> {
            if let Some(pair) = pair {
                rule.add_agreed(&mut rows.rows, &rows.cells, pair.has_rig);
                if let Some(row) = rows.rows.first() {
                    accuracy.add(row.stamp_ns, &rows.cells);
                    reliability.add(&rows.cells);
                }
            }
            take(TakenRows {
                rows: &rows.rows,
                cells: rows.cells,
                failures: &rows.failures,
            })?;
            tallies.add(&rows.rows, &rows.frames);
            tables.failures.extend(rows.failures);
            tables.rows.extend(rows.rows);
            tables.drives.extend(rows.drives);
            tables.tracks.extend(rows.tracks);
            Ok(())
        };
        let is_read = |table: &str| has_cells || table != "cells";
        let scenario = &plan.manifest.scenario;
        for block in 0..run.blocks(plan) {
            let units = plan
                .labels()
                .into_iter()
                .filter_map(|label| run.unit(label, block));
            let readers = units.map(|unit| UnitReader::open(unit, scenario, is_read));
            let mut readers = readers.collect::<Result<Vec<_>>>()?;
            if plan.is_driven() {
                for reader in &mut readers {
                    collect(reader.take(None)?, None)?;
                }
                continue;
            }
            let pairs = run.facts.pairs.iter().skip((block * BLOCK) as usize);
            for pair in pairs.take(BLOCK as usize) {
                let mut rows = UnitRows::default();
                for reader in &mut readers {
                    rows.append(reader.take(Some(pair.sequence))?);
                }
                collect(rows, Some(pair))?;
            }
        }
        tables.checkpoints.extend(tallies.into_rows());
    }
    tables.accuracy = accuracy.into_rows(&plan.labels());
    tables.reliability = reliability.into_rows(&plan.labels());
    Ok(tables)
}

fn write_table<R: Record + Clone>(folder: &Path, name: &str, rows: &[R]) -> Result<()> {
    let mut table = TableWriter::create_both(folder, name)?;
    table.push(rows.iter().cloned())?;
    table.finish()
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
