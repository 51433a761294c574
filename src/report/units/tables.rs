//! The tables of a report, made of its units, in the order of runs, pairs and algorithms.

use super::facts::PairFacts;
use super::latencies::Latencies;
use super::phantoms::RunPhantoms;
use super::plan::{BLOCK, ReportPlan};
use super::run_units::RunUnits;
use super::unit::{UnitReader, UnitRows};
use crate::results::summary::ReportTables;
use crate::results::table_writer::{TableWriter, write_table};
use crate::rows::csv_rows::{RowReader, read_rows};
use crate::rows::held::{Row, RowRef};
use crate::rows::records::{CellRow, CheckpointRow, FailureRow};
use crate::subjects::accuracy::{AccuracyTally, RunRanges};
use crate::subjects::checkpoints::CheckpointTallies;
use crate::subjects::kept::ScoreRule;
use crate::subjects::late::LateTally;
use crate::subjects::pieces::pieces;
use crate::subjects::references::ReferenceTally;
use crate::subjects::reliability::ReliabilityTallies;
use crate::subjects::witness::{ComparedPair, WitnessTally};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::mpsc::sync_channel;
use svl_core::Result;
use svl_score::manifest::hash;
use svl_score::scenario::WITNESS;

/// Digest of all that the tables are made of.
pub fn made_of(plan: &ReportPlan, runs: &[RunUnits]) -> String {
    let description = plan.manifest.description.as_ref();
    let rule = ["grid", "cells", "robot", "checkpoint", "ranges", "gate"]
        .map(|key| description.and_then(|value| value.get(key)));
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
        rows: RowReader::open(&file("rows"))?.collect::<Result<_>>()?,
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
        tables.references = RowReader::open(&file("references"))?.collect::<Result<_>>()?;
        tables.estimates = read_rows(&file("estimates"))?;
        if plan.has_pieces() {
            tables.sights = read_rows(&file("sights"))?;
            tables.pieces = read_rows(&file("pieces"))?;
        }
    }
    Ok(tables)
}

/// Largest number of pairs whose cells wait to be written.
const MAX_QUEUED_PAIRS: usize = 64;

/// Writes the tables of a report, as `.csv` and `.parquet`, into its folder.
///
/// # Errors
/// The errors of the units' files and of the tables'.
pub fn write_tables(
    folder: &Path,
    plan: &ReportPlan,
    runs: &[RunUnits],
    latencies: &Latencies,
) -> Result<ReportTables> {
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
        let tables = collect_tables(plan, runs, Some(latencies), |rows_of_pair| {
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
        write_table(folder, "drives", tables.drives.iter().cloned())?;
        write_table(folder, "tracks", tables.tracks.iter().cloned())?;
    } else {
        write_table(folder, "checkpoints", tables.checkpoints.iter().cloned())?;
        write_table(folder, "accuracy", tables.accuracy.iter().cloned())?;
        write_table(folder, "reliability", tables.reliability.iter().cloned())?;
        write_table(
            folder,
            "references",
            tables.references.iter().map(RowRef::to_row),
        )?;
        write_table(folder, "estimates", tables.estimates.iter().cloned())?;
        if plan.has_pieces() {
            write_table(folder, "sights", tables.sights.iter().cloned())?;
            write_table(folder, "pieces", tables.pieces.iter().cloned())?;
        }
    }
    Ok(tables)
}

/// The rows of a pair, as they are collected.
pub struct TakenRows<'a> {
    rows: &'a [Row],
    cells: Vec<CellRow>,
    failures: &'a [FailureRow],
}

/// The numbers of the cells of all pairs.
struct TableTallies {
    accuracy: AccuracyTally,
    reliability: ReliabilityTallies,
    references: ReferenceTally,
    witness: WitnessTally,
    late: LateTally,
    has_separate_pairs: bool,
}

impl TableTallies {
    fn begin_run(&mut self, has_separate_pairs: bool, latencies_ms: &BTreeMap<String, f64>) {
        self.has_separate_pairs = has_separate_pairs;
        self.accuracy.begin_pass(has_separate_pairs);
        self.late.begin_run(latencies_ms);
    }

    /// Adds a pair with the cells of the witness, if there is one.
    fn add(&mut self, rows: &mut UnitRows, pair: &PairFacts, seen: Option<UnitRows>) {
        let Some(row) = rows.rows.first() else {
            return;
        };
        let time_ns = row.origin().time_ns();
        self.accuracy.add(time_ns, &rows.cells);
        self.reliability.add(&rows.cells);
        self.references.add(row, &rows.truths);
        let compared = ComparedPair {
            stamp_ns: time_ns.filter(|_| !self.has_separate_pairs),
            infinity_px: pair.infinity_px,
            floor: pair.floor,
        };
        if let Some(seen) = seen {
            self.witness.add(&compared, &rows.cells, &seen.cells);
        }
        let is_plain = row.stress.is_none();
        if let Some(stamp_ns) = compared.stamp_ns.filter(|_| is_plain) {
            let pair = (stamp_ns, pair.infinity_px);
            self.late.add(pair, &mut rows.rows, &rows.cells);
        }
    }
}

/// Collects the rows of units in the order of runs, pairs and algorithms. `latencies`: none where
/// cells are not asked for, nor what is computed of them.
///
/// # Errors
/// The errors of the units' files, and of `take`, which gets the rows of each pair.
pub fn collect_tables(
    plan: &ReportPlan,
    runs: &[RunUnits],
    latencies: Option<&Latencies>,
    mut take: impl FnMut(TakenRows<'_>) -> Result<()>,
) -> Result<ReportTables> {
    let mut tables = ReportTables::default();
    let has_cells = latencies.is_some();
    let rule = ScoreRule::new(&plan.manifest)?;
    let ranges = RunRanges::new(&plan.manifest)?;
    let mut numbers = TableTallies {
        accuracy: AccuracyTally::new(rule.cells, &ranges),
        reliability: ReliabilityTallies::default(),
        references: ReferenceTally::default(),
        witness: WitnessTally::new(rule.cells),
        late: LateTally::new(rule.cells),
        has_separate_pairs: false,
    };
    let scenario = &plan.manifest.scenario;
    for run in runs {
        let name = run.run.run.as_deref();
        let latencies_ms = latencies.map(|own| own.in_run(plan, &run.facts));
        numbers.begin_run(
            plan.manifest.has_separate_pairs(name),
            &latencies_ms.unwrap_or_default(),
        );
        let mut tallies = CheckpointTallies::new(plan.labels(), &rule.checkpoints);
        let mut plain = PlainCells::beside(run, runs).filter(|_| has_cells);
        let units = [run, plain.as_ref().map_or(run, |plain| plain.run)];
        let robot = plan.manifest.part("robot")?.filter(|_| has_cells);
        let phantoms = robot.map(|robot| RunPhantoms::new(plan, units, &rule, robot));
        let phantoms = phantoms.transpose()?.unwrap_or_default();
        let warning = phantoms.warning.iter().filter(|_| plain.is_none());
        let named = warning.map(|warning| format!("{}: {warning}", run.run.words()));
        tables.warnings.extend(named);
        let mut collect = |mut rows: UnitRows, pair: Option<ReadPair<'_>>| -> Result<()> {
            if let Some(ReadPair { facts, seen }) = pair {
                if let Some(plain) = &mut plain {
                    let cells = [plain.for_pair(facts.sequence)?, &rows.cells];
                    rule.add_kept(&mut rows.rows, cells, facts.infinity_px);
                }
                numbers.add(&mut rows, facts, seen);
                phantoms.tell(&mut rows.rows, &mut rows.cells);
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
            tables.sights.extend(rows.sights);
            Ok(())
        };
        read_run(plan, run, has_cells, &mut collect)?;
        numbers.witness.end_run();
        let key = &run.run;
        for unit in run.all().filter(|_| key.stress.is_none() && has_cells) {
            if let Some(errors) = unit.pixel_errors()? {
                numbers.accuracy.add_pixels(&unit.label, &errors);
            }
        }
        let rows = tallies.into_rows().into_iter();
        tables.checkpoints.extend(rows.map(|row| CheckpointRow {
            scenario: scenario.clone(),
            run: key.run.clone(),
            seed: key.seed,
            stress: key.stress.clone(),
            ..row
        }));
    }
    let TableTallies {
        accuracy,
        reliability,
        references,
        witness,
        ..
    } = numbers;
    let ranges = ranges.in_order(&accuracy);
    tables.accuracy = accuracy.into_rows(&plan.labels(), &ranges);
    tables.pieces = pieces(&tables.sights);
    tables.reliability = reliability.into_rows(&plan.labels());
    tables.references = references.into_rows(rule.cells);
    if plan.has_estimates() {
        tables.estimates = witness.into_rows(plan.labels(), |label| plan.why_no_estimate(label));
    }
    Ok(tables)
}

/// A pair whose rows are read, with the cells of the witness, if there is one.
struct ReadPair<'a> {
    facts: &'a PairFacts,
    seen: Option<UnitRows>,
}

/// Reads the units of a run: the rows of all algorithms, pair by pair, or those of each drive.
fn read_run(
    plan: &ReportPlan,
    run: &RunUnits,
    has_cells: bool,
    mut collect: impl FnMut(UnitRows, Option<ReadPair<'_>>) -> Result<()>,
) -> Result<()> {
    let scenario = &plan.manifest.scenario;
    // The truth of the cells is that of the first algorithm: all have the same.
    let is_read = |first: bool, table: &str| match table {
        "cells" => has_cells,
        "truths" => has_cells && first,
        _ => true,
    };
    for block in 0..run.blocks(plan) {
        let units = plan.labels().into_iter();
        let units = units.filter_map(|label| run.unit(label, block));
        let readers = units
            .enumerate()
            .map(|(n, unit)| UnitReader::open(unit, scenario, |table| is_read(n == 0, table)));
        let mut readers = readers.collect::<Result<Vec<_>>>()?;
        if plan.is_driven() {
            for reader in &mut readers {
                collect(reader.take(None)?, None)?;
            }
            continue;
        }
        let seen = run.unit(WITNESS, block).filter(|_| has_cells);
        let seen = seen.map(|unit| UnitReader::open(unit, scenario, |table| table == "cells"));
        let mut seen = seen.transpose()?;
        let pairs = run.facts.pairs.iter().skip((block * BLOCK) as usize);
        for facts in pairs.take(BLOCK as usize) {
            let mut rows = UnitRows::default();
            for reader in &mut readers {
                rows.append(reader.take(Some(facts.sequence))?);
            }
            let seen = seen.as_mut().map(|own| own.take(Some(facts.sequence)));
            let seen = seen.transpose()?;
            collect(rows, Some(ReadPair { facts, seen }))?;
        }
    }
    Ok(())
}

/// The cells of the unperturbed pairs of a perturbed run, a block at a time.
struct PlainCells<'a> {
    run: &'a RunUnits,
    block: Option<u64>,
    cells: Vec<CellRow>,
}

impl<'a> PlainCells<'a> {
    /// None for a run that is not perturbed.
    fn beside(perturbed: &RunUnits, runs: &'a [RunUnits]) -> Option<Self> {
        let key = |own: &RunUnits| (own.run.run.clone(), own.run.seed);
        let mut plain = runs.iter().filter(|own| own.run.stress.is_none());
        let run = plain.find(|own| key(own) == key(perturbed));
        let run = run.filter(|_| perturbed.run.stress.is_some())?;
        Some(Self {
            run,
            block: None,
            cells: Vec::new(),
        })
    }

    /// The cells of the block of a pair.
    fn for_pair(&mut self, sequence: u64) -> Result<&[CellRow]> {
        let mut pairs = self.run.facts.pairs.iter();
        let place = pairs.position(|pair| pair.sequence == sequence);
        let block = place.map(|place| place as u64 / BLOCK);
        if block != self.block {
            self.block = block;
            self.cells.clear();
            for unit in self.run.all().filter(|unit| Some(unit.block) == block) {
                let mut reader = UnitReader::open(unit, "", |table| table == "cells")?;
                self.cells.append(&mut reader.take(None)?.cells);
            }
        }
        Ok(&self.cells)
    }
}
