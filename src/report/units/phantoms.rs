//! Phantoms: reports nearer than what the robot drove through.

use super::plan::ReportPlan;
use super::run_units::RunUnits;
use super::unit::UnitReader;
use crate::rows::held::Row;
use crate::rows::records::CellRow;
use crate::subjects::kept::ScoreRule;
use std::collections::BTreeMap;
use svl_core::Result;
use svl_core::statistics::lower_median;
use svl_core::stereo::{CellState, GridShape};
use svl_score::judge::{DrivenWay, RobotSize, WayBounds};
use svl_score::scenario::{WITNESS, is_of_witness};

/// Least probability of a cell that the witness knows as v5 does.
const SURE: f64 = 0.9;
/// Cells in which something is nearer than what the robot drove through, beyond which poses or size
/// are wrong: their number, and their part.
const MAX_NEARER: [f64; 2] = [4.0, 0.002];
/// A cell of the robot's own body: the fewest reports, the part of them that are alike, and how
/// far they differ.
const MIN_REPORTS: usize = 8;
const MIN_ALIKE: f64 = 0.8;
const ALIKE: f64 = 0.02;

/// The cells of a run and their reports, by the way that the robot drove.
#[derive(Default)]
pub(crate) struct RunPhantoms {
    shape: GridShape,
    /// By pair.
    bounds: BTreeMap<u64, WayBounds>,
    /// By algorithm and pair: reports in cells with a bound, and of these phantoms, those that are
    /// there by the truth or v5, and those in cells of the own body.
    counts: BTreeMap<(String, u64), [f64; 4]>,
    /// The reason why nothing is judged, or a doubt.
    pub(crate) warning: Option<String>,
}

/// A report in a cell with a bound.
struct WayReport {
    sequence: u64,
    distance_m: f64,
    is_phantom: bool,
    /// True if something is there by the truth or v5.
    is_seen: bool,
}

/// The pair, column and row of a cell.
fn place(cell: &CellRow) -> (u64, u32, u32) {
    (cell.sequence, cell.column, cell.row)
}

impl RunPhantoms {
    /// `plain`: the unperturbed pairs of the run.
    ///
    /// # Errors
    /// The errors of the units' files.
    pub(crate) fn new(
        plan: &ReportPlan,
        [run, plain]: [&RunUnits; 2],
        rule: &ScoreRule,
        robot: RobotSize,
    ) -> Result<Self> {
        let pairs = &run.facts.pairs;
        let way = DrivenWay::new(robot, pairs.iter().map(|pair| pair.body.clone()).collect());
        let mut own = Self {
            shape: rule.shape,
            warning: way.refusal(),
            ..Self::default()
        };
        if own.warning.is_none() {
            let bounds = pairs.iter().enumerate();
            let bounds =
                bounds.filter_map(|(i, pair)| Some((pair.sequence, way.bounds(i, rule.shape)?)));
            own.bounds = bounds.collect();
            own.warning = own.judge(plan, [run, plain], rule)?;
        }
        Ok(own)
    }

    /// Judges the reports of all algorithms, that of v5 first; returns what is doubtful.
    fn judge(
        &mut self,
        plan: &ReportPlan,
        [run, plain]: [&RunUnits; 2],
        rule: &ScoreRule,
    ) -> Result<Option<String>> {
        let records = plan.manifest.algorithms.iter();
        let mut labels: Vec<_> = records
            .map(|own| (own.label.as_str(), &*own.name, own.disparities))
            .collect();
        labels.push((WITNESS, "v5", None));
        labels.sort_by_key(|(_, name, _)| !is_of_witness(name));
        let pairs = run.facts.pairs.iter();
        let infinities = pairs.filter_map(|pair| Some((pair.sequence, pair.infinity_px?)));
        let infinities: BTreeMap<_, _> = infinities.collect();
        let v5 = labels[0].0;
        let limit_m = |free_m: f64| free_m - rule.cells.tolerance_at_m(free_m);
        // True if the limit of a cell is beyond the nearest distance that an algorithm of that
        // range can report, by the truth or the report.
        let is_in_range = |disparities: Option<u32>, cell: &CellRow, free_m: f64| {
            let nearest_m = || {
                let truth = cell.true_distance_m.zip(cell.true_median_px);
                let (distance_m, px) = truth.or(cell.distance_m.zip(cell.median_px))?;
                let infinity_px = f64::from(*infinities.get(&cell.sequence)?);
                let end_px = f64::from(disparities?) - 1.0 - infinity_px;
                Some(distance_m * (px - infinity_px) / end_px)
            };
            limit_m(free_m) > nearest_m().unwrap_or(0.0)
        };
        let report_m = |label: &str, cell: &CellRow| {
            let far_m = (cell.state == Some(CellState::Far)).then_some(f64::INFINITY);
            let is_sure = label != WITNESS || cell.probability >= Some(SURE);
            cell.distance_m.or(far_m).filter(|_| is_sure)
        };
        // True of a cell in which something is nearer, by its truth, which the cells of any
        // algorithm have, else by v5, the first.
        let mut seen = BTreeMap::new();
        for (label, _, disparities) in labels.iter().take(2) {
            self.read(plain, label, |cell, free_m| {
                let by_truth = cell.true_distance_m.map(|true_m| true_m < free_m);
                let by_v5 = report_m(label, cell).filter(|_| *label == v5);
                let is_nearer = by_truth.or(by_v5.map(|m| m < limit_m(free_m)));
                if let Some(own) = is_nearer.filter(|_| is_in_range(*disparities, cell, free_m)) {
                    seen.entry(place(cell)).or_insert(own);
                }
            })?;
        }
        let (nearer, all) = (seen.values().filter(|own| **own).count(), seen.len());
        let [most, part] = MAX_NEARER;
        let is_wrong = nearer as f64 > most.max(part * all as f64);
        let doubt = (nearer > 0).then(|| {
            let untold = if is_wrong {
                "no phantoms are told: "
            } else {
                ""
            };
            format!(
                "{untold}{nearer} of {all} cells are nearer, by the truth or v5, than what the \
                 robot drove through: something moved, or poses, tf, or --robot are wrong"
            )
        });
        if is_wrong {
            self.bounds.clear();
            return Ok(doubt);
        }
        let mut reports: BTreeMap<_, Vec<WayReport>> = BTreeMap::new();
        for (label, _, disparities) in &labels {
            let is_v5 = *label == v5 && run.run.stress.is_none();
            self.read(run, label, |cell, free_m| {
                let known = report_m(label, cell);
                let known = known.filter(|_| is_in_range(*disparities, cell, free_m));
                let own = known.map(|distance_m| WayReport {
                    sequence: cell.sequence,
                    distance_m,
                    is_phantom: distance_m < limit_m(free_m),
                    is_seen: seen.get(&place(cell)) == Some(&true)
                        && (cell.true_distance_m.is_some() || !is_v5),
                });
                let all = reports.entry((*label, cell.column, cell.row));
                all.or_default().extend(own);
            })?;
        }
        for ((label, ..), own) in reports {
            self.count(label, &own);
        }
        Ok(doubt)
    }

    /// Reads the cells of an algorithm in a run that have a bound, with it.
    fn read(&self, run: &RunUnits, label: &str, mut take: impl FnMut(&CellRow, f64)) -> Result<()> {
        for (_, unit) in run.units(label) {
            let mut reader = UnitReader::open(unit, "", |table| table == "cells")?;
            for cell in &reader.take(None)?.cells {
                if let Some(free_m) = self.free_m(cell) {
                    take(cell, free_m);
                }
            }
        }
        Ok(())
    }

    /// Counts the reports of an algorithm in a cell.
    fn count(&mut self, label: &str, reports: &[WayReport]) {
        let median_m = lower_median(reports.iter().map(|own| own.distance_m));
        let median_m = median_m.unwrap_or_default();
        let is_alike = |own: &&WayReport| (own.distance_m - median_m).abs() <= ALIKE * median_m;
        let alike = reports.iter().filter(is_alike).count() as f64;
        let is_body = reports.len() >= MIN_REPORTS && alike >= MIN_ALIKE * reports.len() as f64;
        for own in reports {
            let key = (label.to_owned(), own.sequence);
            let counts = self.counts.entry(key).or_default();
            counts[0] += 1.0;
            let kind = if is_body {
                3
            } else {
                1 + usize::from(own.is_seen)
            };
            counts[kind] += f64::from(own.is_phantom);
        }
    }

    fn free_m(&self, cell: &CellRow) -> Option<f64> {
        let bounds = self.bounds.get(&cell.sequence)?;
        let place = cell.row as usize * self.shape.columns + cell.column as usize;
        *bounds.free_m.get(place)?
    }

    /// Sets the numbers of a pair.
    pub(crate) fn tell(&self, rows: &mut [Row], cells: &mut [CellRow]) {
        for cell in cells {
            cell.free_m = self.free_m(cell);
        }
        for row in rows {
            let counts = self.counts.get(&(row.algorithm.clone(), row.sequence));
            let Some((counts, bounds)) = counts.zip(self.bounds.get(&row.sequence)) else {
                continue;
            };
            let has_phantom = f64::from(counts[1] > 0.0);
            for (name, value) in [
                ("way_cells", counts[0]),
                ("phantoms", counts[1]),
                ("phantoms_of_v5", counts[2]),
                ("phantoms_of_body", counts[3]),
                ("way_m", bounds.way_m),
                ("phantom_way", has_phantom * bounds.way_m),
                ("phantom_pairs", has_phantom),
            ] {
                row.metrics.set(name, Some(value));
            }
        }
    }
}
