//! Phantoms: reports nearer than what the robot drove through.

use super::plan::ReportPlan;
use super::run_units::RunUnits;
use super::unit::UnitReader;
use crate::rows::held::Row;
use crate::rows::records::CellRow;
use crate::subjects::kept::ScoreRule;
use std::collections::{BTreeMap, BTreeSet};
use svl_core::Result;
use svl_core::statistics::lower_median;
use svl_core::stereo::{CellState, GridShape};
use svl_score::judge::{DrivenWay, RobotSize, WayBounds};
use svl_score::scenario::{WITNESS, is_of_witness};

/// Least probability of a cell that the witness knows as v5 does.
const SURE: f64 = 0.9;
/// Phantoms of v5 beyond which poses or size are wrong: their number, and their part.
const MAX_OF_V5: [f64; 2] = [4.0, 0.002];
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
    /// By algorithm and pair: reports in cells with a bound, and of these phantoms, those that v5
    /// reports, too, and those in cells of the own body.
    counts: BTreeMap<(String, u64), [f64; 4]>,
    /// The reason why nothing is judged, or a doubt.
    pub(crate) warning: Option<String>,
}

/// A report in a cell with a bound.
struct WayReport {
    sequence: u64,
    distance_m: f64,
    is_phantom: bool,
    is_of_v5: bool,
}

impl RunPhantoms {
    /// # Errors
    /// The errors of the units' files.
    pub(crate) fn new(
        plan: &ReportPlan,
        run: &RunUnits,
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
            own.warning = own.judge(plan, run, rule)?;
        }
        Ok(own)
    }

    /// Judges the reports of all algorithms, that of v5 first; returns what is doubtful.
    fn judge(
        &mut self,
        plan: &ReportPlan,
        run: &RunUnits,
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
        let mut reports: BTreeMap<_, Vec<WayReport>> = BTreeMap::new();
        let mut of_v5 = BTreeSet::new();
        let mut beyond = BTreeMap::new();
        let mut judged_of_v5 = 0u64;
        for (label, _, disparities) in labels {
            // The nearest distance that the algorithm can report, by its range and this report.
            let nearest_m = |cell: &CellRow| {
                let infinity_px = f64::from(*infinities.get(&cell.sequence)?);
                let end_px = f64::from(disparities?) - 1.0 - infinity_px;
                Some(cell.distance_m? * (cell.median_px? - infinity_px) / end_px)
            };
            for (_, unit) in run.units(label) {
                let mut reader = UnitReader::open(unit, "", |table| table == "cells")?;
                for cell in reader.take(None)?.cells {
                    let place = (cell.sequence, cell.column, cell.row);
                    let Some(free_m) = self.free_m(&cell) else {
                        continue;
                    };
                    let is_beyond = cell.true_distance_m.map(|true_m| free_m > true_m);
                    beyond.extend(is_beyond.map(|is_beyond| (place, is_beyond)));
                    let limit_m = free_m - rule.cells.tolerance_at_m(free_m);
                    let far_m = (cell.state == Some(CellState::Far)).then_some(f64::INFINITY);
                    let known = cell.distance_m.or(far_m);
                    let is_sure = label != WITNESS || cell.probability >= Some(SURE);
                    let is_judged = is_sure && limit_m > nearest_m(&cell).unwrap_or(0.0);
                    let Some(distance_m) = known.filter(|_| is_judged) else {
                        continue;
                    };
                    let is_phantom = distance_m < limit_m;
                    if label == v5 {
                        judged_of_v5 += 1;
                        of_v5.extend(is_phantom.then_some(place));
                    }
                    let own = reports.entry((label, cell.column, cell.row)).or_default();
                    own.push(WayReport {
                        sequence: cell.sequence,
                        distance_m,
                        is_phantom,
                        is_of_v5: label != v5 && of_v5.contains(&place),
                    });
                }
            }
        }
        let wrong = "poses, tf, or --robot are wrong";
        let [most, part] = MAX_OF_V5;
        if of_v5.len() as f64 > most.max(part * judged_of_v5 as f64) {
            self.bounds.clear();
            return Ok(Some(format!(
                "no phantoms are told: v5 reports {} of {judged_of_v5} cells nearer than what \
                 the robot drove through: {wrong}",
                of_v5.len()
            )));
        }
        for ((label, ..), own) in reports {
            self.count(label, &own);
        }
        let wrongly = beyond.values().filter(|is_beyond| **is_beyond).count();
        Ok((wrongly > 0).then(|| {
            let bounds = beyond.len();
            format!("{wrongly} of {bounds} bounds of free ways are beyond the truth: {wrong}")
        }))
    }

    /// Counts the reports of an algorithm in a cell.
    fn count(&mut self, label: &str, reports: &[WayReport]) {
        let median_m = lower_median(reports.iter().map(|own| own.distance_m));
        let median_m = median_m.unwrap_or_default();
        let is_alike = |own: &&WayReport| (own.distance_m - median_m).abs() <= ALIKE * median_m;
        let alike = reports.iter().filter(is_alike).count() as f64;
        let is_body = reports.len() >= MIN_REPORTS && alike >= MIN_ALIKE * reports.len() as f64;
        for own in reports {
            let counts = self
                .counts
                .entry((label.to_owned(), own.sequence))
                .or_default();
            counts[0] += 1.0;
            if own.is_phantom {
                counts[if is_body {
                    3
                } else {
                    1 + usize::from(own.is_of_v5)
                }] += 1.0;
            }
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
