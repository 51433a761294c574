//! One pair through one algorithm as rows of the tables.

use crate::error::Result;
use crate::manifest::{Contestant, Manifest};
use crate::report::{CellRow, Row, Table};
use crate::score::{CellJudgement, CellRule, CellTally, DisparityScore, judge_cells, true_grid};
use crate::stereo::{DepthGrid, Estimate, Frame, GridShape};
use crate::timing::Stage;
use std::time::Duration;

/// What all rows of a run share.
#[derive(Clone, Debug)]
pub struct Identity {
    pub run_id: String,
    pub scenario: String,
    /// Seed of the arena's run that is being read.
    pub seed: Option<u64>,
    pub algorithms: Vec<Contestant>,
    pub rule: CellRule,
    pub shape: GridShape,
}

/// An estimate with its judgement.
pub(super) struct Judged {
    pub row: Row,
    pub cells: Vec<CellRow>,
    /// In raster order; none without truth.
    pub judgements: Option<Vec<CellJudgement>>,
}

impl Identity {
    pub fn new(manifest: &Manifest, rule: CellRule, shape: GridShape) -> Self {
        let Manifest {
            run_id,
            scenario,
            algorithms,
            ..
        } = manifest.clone();
        Self {
            run_id,
            scenario,
            seed: None,
            algorithms,
            rule,
            shape,
        }
    }

    /// Judges every estimate of a frame.
    pub(super) fn judge(&self, frame: &Frame, estimates: &[Estimate]) -> Vec<Judged> {
        let truth = true_grid(frame, self.shape);
        let pair_hash = format!("{:032x}", frame.pair.hash());
        estimates
            .iter()
            .map(|estimate| self.judge_one(frame, truth.as_ref(), estimate, &pair_hash))
            .collect()
    }

    fn judge_one(
        &self,
        frame: &Frame,
        truth: Option<&DepthGrid>,
        estimate: &Estimate,
        pair_hash: &str,
    ) -> Judged {
        let contestant = self
            .algorithms
            .iter()
            .find(|contestant| contestant.label == estimate.algorithm);
        let (width, height) = frame.pair.size();
        let judgements = truth.map(|truth| judge_cells(truth, &estimate.grid, self.rule));
        let tally = judgements.as_deref().map(CellTally::of);
        let count = |f: fn(&CellTally) -> usize| tally.as_ref().map(|t| f(t) as u64);
        // Obstacles are a matter of distance: elsewhere none missed would be said of none looked
        // for.
        let obstacles =
            |f| count(f).filter(|_| self.rule == CellRule::Distance && frame.rig.is_some());
        let score = frame
            .truth
            .as_ref()
            .map(|truth| DisparityScore::of(&estimate.disparity, truth));
        let us = |time: Duration| time.as_micros() as u64;
        let stage = |stage| us(estimate.times.get(stage));
        let row = Row {
            run_id: self.run_id.clone(),
            scenario: self.scenario.clone(),
            sequence: frame.sequence,
            stamp_ns: frame.stamp_ns,
            name: frame.name.clone().unwrap_or_default(),
            seed: self.seed,
            pair_hash: pair_hash.to_owned(),
            algorithm: estimate.algorithm.clone(),
            parameters_hash: contestant.map_or_else(String::new, |c| c.parameters_hash.clone()),
            width: width as u32,
            height: height as u32,
            disparities: contestant.and_then(|c| c.disparities),
            smoothing_us: stage(Stage::Smoothing),
            texture_us: stage(Stage::Texture),
            matching_us: stage(Stage::Matching),
            checks_us: stage(Stage::Checks),
            total_us: us(estimate.times.total()),
            coverage: estimate.disparity.coverage(),
            bad1: score.as_ref().and_then(DisparityScore::bad1),
            bad2: score.as_ref().and_then(DisparityScore::bad2),
            invalid: score.as_ref().and_then(DisparityScore::invalid),
            cells_right: count(|t| t.right),
            cells_wrong: count(|t| t.wrong),
            cells_unknown: count(|t| t.unknown),
            missed_obstacles: obstacles(|t| t.missed_obstacles),
            false_obstacles: obstacles(|t| t.false_obstacles),
            result_hash: format!("{:032x}", estimate.disparity.hash()),
        };
        Judged {
            cells: self.cells(frame, estimate, judgements.as_deref()),
            row,
            judgements,
        }
    }

    fn cells(
        &self,
        frame: &Frame,
        estimate: &Estimate,
        judgements: Option<&[CellJudgement]>,
    ) -> Vec<CellRow> {
        let row = |(i, ((column, row), cell)): (usize, ((usize, usize), &crate::stereo::Cell))| {
            let judgement = judgements.map_or(CellJudgement::NO_TRUTH, |j| j[i]);
            CellRow {
                run_id: self.run_id.clone(),
                scenario: self.scenario.clone(),
                sequence: frame.sequence,
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
                missed_obstacle: judgement.missed_obstacle,
                false_obstacle: judgement.false_obstacle,
            }
        };
        estimate.grid.iter().enumerate().map(row).collect()
    }
}

/// Keeps the rows of a replay, in a file where one is asked for.
pub struct RowSink {
    identity: Identity,
    table: Option<Table<Row>>,
    rows: Vec<Row>,
    pairs: u64,
}

impl RowSink {
    pub fn new(identity: Identity, table: Option<Table<Row>>) -> Self {
        Self {
            identity,
            table,
            rows: Vec::new(),
            pairs: 0,
        }
    }

    /// Pairs taken so far.
    pub fn pairs(&self) -> u64 {
        self.pairs
    }

    /// All rows taken so far.
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }
}

impl super::Sink for RowSink {
    fn push(&mut self, frame: &Frame, estimates: &[Estimate]) -> Result<()> {
        let rows: Vec<Row> = self
            .identity
            .judge(frame, estimates)
            .into_iter()
            .map(|judged| judged.row)
            .collect();
        if let Some(table) = &mut self.table {
            table.push(rows.iter().cloned())?;
        }
        self.rows.extend(rows);
        self.pairs += 1;
        Ok(())
    }

    fn finish(&mut self) -> Result<()> {
        self.table.take().map_or(Ok(()), Table::finish)
    }
}
