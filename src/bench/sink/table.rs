//! Rows of the tables: one per pair and algorithm, one per cell.

use super::{Outbox, PassStart, Sink};
use std::path::Path;
use std::time::Duration;
use svl_core::Result;
use svl_core::stereo::{Cell, hash_words};
use svl_core::timing::Stage;
use svl_report::{CellRow, FailureRow, Row, TableWriter};
use svl_score::judge::{Judged, JudgedEstimate, MatchFailure};
use svl_score::manifest::AlgorithmRecord;

/// Rows that are removed at once.
const TRIMMED: usize = 500;

/// Writes the rows of a run, and keeps them for its summary.
pub struct TableSink {
    rows: TableWriter<Row>,
    cells: Option<TableWriter<CellRow>>,
    identity: RowIdentity,
    kept: Vec<Row>,
    /// Limit on the rows that are kept, if any: the newest.
    pub(super) newest: Option<usize>,
    outbox: Outbox<Vec<Row>>,
}

impl TableSink {
    /// Writes rows and cells to a file if one is given, `.csv` or `.parquet`, and leaves all rows
    /// in `outbox`.
    ///
    /// # Errors
    /// The errors of [`TableWriter::create`].
    pub fn new(
        rows: Option<&Path>,
        cells: Option<&Path>,
        outbox: &Outbox<Vec<Row>>,
    ) -> Result<Self> {
        let rows = rows.map_or_else(|| Ok(TableWriter::in_memory()), TableWriter::create)?;
        let cells = cells.map(TableWriter::create).transpose()?;
        Ok(Self {
            rows,
            cells,
            identity: RowIdentity::default(),
            kept: Vec::new(),
            newest: None,
            outbox: outbox.clone(),
        })
    }

    /// Removes the oldest rows beyond the limit, once `slack` of them can go at once.
    fn trim(&mut self, slack: usize) {
        let surplus = self
            .newest
            .map(|newest| self.kept.len().saturating_sub(newest));
        if let Some(surplus) = surplus.filter(|surplus| *surplus >= slack) {
            self.kept.drain(..surplus);
        }
    }
}

impl Sink for TableSink {
    fn begin_pass(&mut self, start: &PassStart<'_>) -> Result<()> {
        self.identity = RowIdentity::new(start);
        Ok(())
    }

    fn take(&mut self, judged: &Judged) -> Result<()> {
        for estimate in &judged.estimates {
            // The cells are written first: a row in the file implies that its cells are there too.
            if let Some(cells) = &mut self.cells {
                cells.push(self.identity.cells(judged, estimate))?;
            }
            let row = self.identity.row(judged, estimate);
            self.rows.push([row.clone()])?;
            self.kept.push(row);
            self.trim(TRIMMED);
        }
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> Result<()> {
        self.trim(1);
        // The rows are known even if the table is incomplete.
        self.outbox.put(self.kept);
        let cells = self.cells.map_or(Ok(()), TableWriter::finish);
        self.rows.finish().and(cells)
    }
}

/// Values that all rows of a run share.
#[derive(Clone, Debug, Default)]
pub(crate) struct RowIdentity {
    pub session: String,
    pub scenario: String,
    pub seed: Option<u64>,
    /// The recording, where the scenario has some.
    pub run: Option<String>,
    /// Perturbation of the pairs.
    pub stress: Option<String>,
    algorithms: Vec<AlgorithmRecord>,
}

impl RowIdentity {
    pub(crate) fn new(start: &PassStart<'_>) -> Self {
        let run = &start.judge.run;
        Self {
            session: start.manifest.run_id.clone(),
            scenario: start.manifest.scenario.clone(),
            seed: start.seed,
            run: (!run.name.is_empty()).then(|| run.name.clone()),
            stress: run.stress.clone(),
            algorithms: start.manifest.algorithms.clone(),
        }
    }

    /// An estimate as a row.
    pub(crate) fn row(&self, judged: &Judged, scored: &JudgedEstimate) -> Row {
        let (frame, estimate) = (&judged.frame, &scored.estimate);
        let mut algorithms = self.algorithms.iter();
        let algorithm = algorithms.find(|own| own.label == estimate.algorithm);
        let (truth, unfiltered) = (frame.truth.as_ref(), estimate.unfiltered.as_ref());
        let (width, height) = frame.pair.size();
        let us = |time: Duration| time.as_micros() as u64;
        let stage = |stage| estimate.times.map(|times| us(times.get(stage)));
        Row {
            session: self.session.clone(),
            scenario: self.scenario.clone(),
            sequence: frame.sequence,
            stamp_ns: frame.stamp_ns,
            name: frame.name.clone().unwrap_or_default(),
            seed: self.seed,
            pair_hash: hash_words(judged.pair_hash()),
            input_hash: hash_words(judged.input_hash()),
            algorithm: estimate.algorithm.clone(),
            parameters_hash: algorithm.map_or_else(String::new, |a| a.parameters_hash.clone()),
            width: width as u32,
            height: height as u32,
            disparities: algorithm.and_then(|a| a.disparities),
            smoothing_us: stage(Stage::Smoothing),
            texture_us: stage(Stage::Texture),
            matching_us: stage(Stage::Matching),
            checks_us: stage(Stage::Checks),
            total_us: estimate.times.map(|times| us(times.total())),
            metrics: scored.metrics.clone(),
            result_hash: hash_words(scored.hash),
            truth: truth.map(|truth| truth.kind.origin.to_string()),
            run: self.run.clone(),
            filters_us: unfiltered.and_then(|_| stage(Stage::Filters)),
            stress: self.stress.clone(),
        }
    }

    /// The algorithms that failed on a frame as rows.
    pub(crate) fn failures(&self, judged: &Judged) -> Vec<FailureRow> {
        let row = |failed: &MatchFailure| FailureRow {
            scenario: self.scenario.clone(),
            run: self.run.clone(),
            seed: self.seed,
            sequence: judged.frame.sequence,
            algorithm: failed.algorithm.clone(),
            reason: failed.reason.clone(),
            stress: self.stress.clone(),
        };
        judged.failures.iter().map(row).collect()
    }

    /// The cells of an estimate as rows, in raster order.
    pub(crate) fn cells(&self, judged: &Judged, scored: &JudgedEstimate) -> Vec<CellRow> {
        let estimate = &scored.estimate;
        let judgement = |i: usize| {
            let cells = scored.cells.as_ref();
            cells.map(|cells| cells[i]).unwrap_or_default()
        };
        let row = |(i, ((column, row), cell)): (usize, ((usize, usize), &Cell))| {
            let judgement = judgement(i);
            CellRow {
                scenario: self.scenario.clone(),
                sequence: judged.frame.sequence,
                seed: self.seed,
                algorithm: estimate.algorithm.clone(),
                column: column as u32,
                row: row as u32,
                valid_share: cell.valid_share,
                median_px: cell.depth.map(|d| d.median_px.into()),
                p20_px: cell.depth.map(|d| d.p20_px.into()),
                p80_px: cell.depth.map(|d| d.p80_px.into()),
                distance_m: cell.depth.and_then(|d| d.distance_m),
                true_median_px: judgement.true_px,
                true_distance_m: judgement.true_m,
                verdict: judgement.verdict,
                area: judgement.area,
                missed: judgement.near.missed,
                r#false: judgement.near.falsely,
                run: self.run.clone(),
                state: Some(cell.state()),
                probability: cell.probability,
                near_probability: cell.near,
                stress: self.stress.clone(),
                true_points: judgement.points.map(|points| points as u64),
                level: cell.level.into(),
                near_distance_m: cell.surface.map(|surface| surface.distance_m),
                near_px: cell.surface.map(|surface| surface.px.into()),
                surface_probability: cell.surface.map(|surface| surface.probability),
                free_m: None,
            }
        };
        estimate.grid.iter().enumerate().map(row).collect()
    }
}
