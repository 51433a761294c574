//! Cells of frames with a truth, as samples for the tables of cells.

use std::ops::RangeInclusive;
use svl_core::depth::decision::{SafeChoice, Tolerance, reported_depth};
use svl_core::matcher::has_small_cells;
use svl_core::stereo::{Cell, CellDepth, CellEvidence, CellRule, LevelCell, LevelVerdict, Rig};
use svl_score::judge::{Judge, Judged, is_right};

/// A cell, reportable or not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellSample {
    /// Scene, recording or seed: samples of one are never split.
    pub group: usize,
    /// `None` if there is nothing to report.
    pub evidence: Option<CellEvidence>,
    /// True if the report would be right, by the scenario's rule.
    pub right: bool,
    /// True if the algorithm reported it.
    pub known: bool,
}

impl CellSample {
    /// True if there is something to report.
    pub fn is_reportable(&self) -> bool {
        self.evidence.is_some()
    }
}

/// Part of a cell to report.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CellTarget {
    #[default]
    Median,
    /// Nearest quarter of the cell.
    Near,
    /// Any surface that is in front of the others: between the nearest twentieth and that quarter.
    Surface,
}

/// The cells of a pair, with or without a truth, by one algorithm.
#[derive(Clone, Debug, PartialEq)]
pub struct PairCells {
    pub stamp_ns: u64,
    /// Number of sizes at which each cell is decided.
    pub levels: usize,
    /// True if the cells have fewer pixels than usual.
    pub is_small: bool,
    /// The decisions on the cells in raster order, those of a cell one after the other, finest
    /// first.
    pub cells: Vec<PairCell>,
}

/// The decision on a cell of a pair at one size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairCell {
    /// `None` if there is nothing to report.
    pub evidence: Option<CellEvidence>,
    /// True if the report would be right; `None` without a truth.
    pub right: Option<bool>,
    /// True if the algorithm reported it.
    pub known: bool,
    /// True if the report failed a test that no probability outweighs.
    pub is_refused: bool,
    /// The first and the last bin for which the report is right, at full size.
    pub ends: [i32; 2],
    /// True if the report is nearer than the rule's `clear_m`.
    pub is_near: bool,
}

impl PairCell {
    /// The report above 0, if there is one.
    pub fn report(&self) -> Option<i64> {
        let report = self.evidence.map(|evidence| evidence.report);
        report.filter(|report| *report > 0)
    }

    /// True for a report above 0 that may be one of a nearer surface: its tolerance is not narrow.
    pub fn is_wide(&self) -> bool {
        let [first, last] = self.ends;
        self.report().is_some() && last - first > 10
    }

    /// The sample for a table, if the cell has a truth.
    pub fn sample(&self, group: usize) -> Option<CellSample> {
        Some(CellSample {
            group,
            evidence: self.evidence,
            right: self.right?,
            known: self.known,
        })
    }
}

/// The cells of a frame by each algorithm of the run, with the part of a cell that each reports and
/// its decision.
pub fn pair_cells(
    judged: &Judged,
    judge: &Judge,
    targets: &[(CellTarget, SafeChoice)],
) -> Vec<PairCells> {
    let rig = judged.frame.rig();
    let truth = judged.true_cells.as_ref();
    let of_algorithm = |(scored, (target, choice)): (_, &(CellTarget, SafeChoice))| {
        let scored: &svl_score::judge::JudgedEstimate = scored;
        let wanted: Vec<Option<CellDepth>> = match (truth, target) {
            (None, _) => vec![None; judge.grid.shape().cells()],
            (Some(truth), CellTarget::Median) => {
                truth.grid().iter().map(|(_, cell)| cell.depth).collect()
            }
            (Some(truth), _) => truth.near().collect(),
        };
        let is_surface = *target == CellTarget::Surface;
        let surfaces_m = is_surface.then(|| surfaces_m(judged, judge));
        let (_, clear_m) = judge.cells.obstacle_and_clear_m();
        let decision = |i: usize, cell: &Cell, level: &LevelCell| {
            let found = level.evidence.and_then(|evidence| {
                let report = [evidence.report; 3];
                Some((evidence, reported_depth(report, level.level, rig)?))
            });
            let (evidence, reported) = found.unzip();
            let report = evidence.map_or(0, |evidence| evidence.report);
            PairCell {
                evidence,
                // `None` if the rule finds no truth.
                right: match &surfaces_m {
                    None => wanted[i].zip(truth).and_then(|(wanted, truth)| {
                        is_right(&wanted, reported.as_ref(), truth.rule(i, &wanted))
                    }),
                    Some(ranges_m) => ranges_m[i].as_ref().map(|range_m| {
                        let depth_m = reported.and_then(|depth| depth.distance_m);
                        depth_m.is_some_and(|depth_m| range_m.contains(&depth_m))
                    }),
                },
                known: cell.depth.is_some() && cell.level == level.level,
                is_refused: matches!(
                    level.verdict,
                    LevelVerdict::Span | LevelVerdict::Contradiction | LevelVerdict::Range
                ),
                ends: Tolerance::ends_of(judge.cells, rig, choice.allowance_px, report as i32),
                is_near: reported
                    .and_then(|depth| depth.distance_m)
                    .is_some_and(|distance_m| distance_m < clear_m),
            }
        };
        let grid = &scored.estimate.grid;
        let cells = grid.iter().zip(grid.levels()).enumerate();
        let cells: Vec<_> = cells
            .flat_map(|(i, ((_, cell), levels))| levels.iter().map(move |level| (i, cell, level)))
            .map(|(i, cell, level)| decision(i, cell, level))
            .collect();
        PairCells {
            stamp_ns: judged.frame.stamp_ns,
            levels: cells.len() / grid.shape().cells(),
            is_small: has_small_cells(judged.frame.pair.size(), grid.shape().cells()),
            cells,
        }
    };
    let algorithms = judged.estimates.iter().zip(targets);
    algorithms.map(of_algorithm).collect()
}

/// The distances that a report of each cell's nearer surface may have; `None` without a rig, or if
/// less than half of its pixels have a truth.
fn surfaces_m(judged: &Judged, judge: &Judge) -> Vec<Option<RangeInclusive<f64>>> {
    let (shape, rig) = (judge.grid.shape(), judged.frame.rig());
    let truth = judged.frame.truth.as_ref().map(|truth| &truth.disparity);
    let range_m = |i: usize| {
        let (rig, truth) = (rig?, truth?);
        let place = (i % shape.columns, i / shape.columns);
        let (columns, rows) = shape.pixels(place, truth.size());
        let pixels = columns.len() * rows.len();
        let values = rows.flat_map(|y| &truth.row(y)[columns.clone()]).copied();
        let known: Vec<_> = values.filter(|px| *px < f32::INFINITY).collect();
        (2 * known.len() > pixels).then(|| surface_m(known, rig, judge.cells))
    };
    (0..shape.cells()).map(range_m).collect()
}

/// The distances from the nearest twentieth of these disparities to their nearest quarter, with
/// the tolerance of each: what fills less than a quarter is a surface, too.
fn surface_m(mut px: Vec<f32>, rig: &Rig, rule: CellRule) -> RangeInclusive<f64> {
    px.sort_unstable_by(|a, b| b.total_cmp(a));
    let [nearest, quarter] = [5, 25].map(|percent| {
        let px = px[percent * px.len() / 100];
        rig.depth_m(px.into()).unwrap_or(f64::INFINITY)
    });
    nearest - rule.tolerance_at_m(nearest)..=quarter + rule.tolerance_at_m(quarter)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_surface_that_fills_a_tenth_is_one() {
        let rig = Rig::new(320.0, (160.0, 120.0), 0.05, 0.0).unwrap();
        let cell = |tenths: usize| {
            let px = |i| if i < 10 * tenths { 16.0 } else { 4.0 };
            surface_m((0..100).map(px).collect(), &rig, CellRule::default())
        };
        // A surface at 1 m before one at 4 m.
        assert_eq!(cell(0), 3.2..=4.8);
        assert_eq!(cell(1), 0.8..=4.8);
        assert_eq!(cell(3), 0.8..=1.2);
        let far = surface_m(vec![0.0; 9], &rig, CellRule::default());
        assert!(!far.contains(&50.0));
    }

    #[test]
    fn narrow_tolerances_are_no_samples_of_surfaces() {
        let cell = |report, ends| PairCell {
            evidence: Some(CellEvidence {
                report,
                ..CellEvidence::default()
            }),
            right: Some(true),
            known: false,
            is_refused: false,
            ends,
            is_near: false,
        };
        assert!(cell(50, [45, 56]).is_wide() && !cell(50, [45, 55]).is_wide());
        assert!(!cell(0, [-6, 6]).is_wide());
    }
}
