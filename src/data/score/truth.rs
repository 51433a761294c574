//! The truth of a frame by cells: the reference for every score of cells.
//!
//! Pixels with truth represent the cell if they are at least half of its pixels; if they are fewer,
//! where they are decides whether it is scored ([`SparseCell`]). Points of a sensor, and fewer
//! pixels, are weighted.

use super::cells::{CellJudgement, NearJudgement, Verdict, depth_at, judge_cells};
use super::sparse::SparseCell;
use std::ops::Range;
use svl_core::depth::{self, CellDecision, GridSettings};
use svl_core::stereo::{
    Cell, CellDepth, CellRule, DepthGrid, Frame, GridShape, Rig, Truth, TruthDensity, TruthOrigin,
};

/// Least fraction of a cell's pixels with known truth for the cell to have a dense truth.
const MIN_KNOWN: f64 = 0.5;

/// Percentile of the true disparities that represents the nearest quarter: of n in ascending order
/// the one of rank ⌊0.75 n⌋ + 1, so 3841 of 5120: the ⌈n / 4⌉-th nearest.
const NEAR_PERCENT: usize = 75;

/// Greatest fraction of a cell that is not clear if a reported obstacle is false.
const CLEAR: f64 = 0.05;

/// The truth of a frame's cells.
#[derive(Clone, Debug)]
pub struct TrueCells {
    grid: DepthGrid,
    /// In raster order.
    cells: Vec<TrueCell>,
    rule: CellRule,
}

#[derive(Clone, Debug, Default)]
pub(super) struct TrueCell {
    /// The points of a sparse truth, or of one that covers less than half of the pixels.
    pub sparse: Option<SparseCell>,
    /// `None` if the cell is not scored.
    pub quarter: Option<TrueQuarter>,
}

/// The nearest quarter of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TrueQuarter {
    pub near: CellDepth,
    /// Fraction of the cell's true pixels nearer than clear space.
    pub not_clear: f64,
}

impl TrueCells {
    /// The cells of a frame with truth, scored by `rule`. With a reference as truth, the fraction
    /// of sure disparities must be that of an algorithm's known cell ([`depth::MIN_VALID`]).
    pub fn new(frame: &Frame, shape: GridShape, rule: CellRule) -> Option<Self> {
        let (truth, rig) = (frame.truth.as_ref()?, frame.rig());
        let is_reference = matches!(truth.kind.origin, TruthOrigin::Reference(_));
        let are_points = truth.kind.density == TruthDensity::Sparse;
        let settings = GridSettings {
            min_valid: if is_reference {
                depth::MIN_VALID
            } else {
                MIN_KNOWN
            },
            decision: CellDecision::Median,
            ..shape.into()
        };
        let mut grid = depth::grid(&truth.disparity, settings, rig);
        let true_cell = |(place, cell): ((usize, usize), &mut Cell)| {
            let (columns, rows) = shape.pixels(place, truth.disparity.size());
            let is_sparse = are_points || cell.depth.is_none() && !is_reference;
            let sparse = (is_sparse && cell.valid_share > 0.0)
                .then(|| SparseCell::new(&truth.disparity, &columns, &rows));
            // Points on half of the pixels represent the cell wherever they are.
            let is_scored =
                |points: &&SparseCell| cell.depth.is_some() || points.is_scored(rule, rig);
            if let Some(points) = sparse.as_ref().filter(is_scored) {
                let [p20, median, p80] = [20, 50, 80].map(|p| points.truth.percentile(p));
                cell.depth = Some(CellDepth {
                    p20_px: p20,
                    p80_px: p80,
                    ..depth_at(median, rig)
                });
            }
            let quarter = cell.depth.map(|_| match &sparse {
                Some(points) => TrueQuarter::of_points(points, rule, rig),
                None => TrueQuarter::new(truth, columns, rows, rule, rig),
            });
            TrueCell { sparse, quarter }
        };
        let cells = shape.iter().zip(grid.cells_mut()).map(true_cell).collect();
        Some(Self { grid, cells, rule })
    }

    /// Per cell the median true disparity and its distance, if the cell is scored.
    pub fn grid(&self) -> &DepthGrid {
        &self.grid
    }

    /// The nearest quarters, if the cells are scored.
    pub fn near(&self) -> impl Iterator<Item = Option<CellDepth>> {
        let quarters = self.cells.iter().map(|cell| cell.quarter);
        quarters.map(|quarter| quarter.map(|quarter| quarter.near))
    }

    /// The cells in raster order.
    pub(super) fn cells(&self) -> &[TrueCell] {
        &self.cells
    }

    /// Scores every cell, in raster order.
    pub fn judge(&self, reported: &DepthGrid) -> Vec<CellJudgement> {
        let mut judgements = judge_cells(&self.grid, reported, self.rule);
        let reports = reported.iter().map(|(_, cell)| cell);
        for ((judgement, cell), report) in judgements.iter_mut().zip(&self.cells).zip(reports) {
            judgement.points = cell.sparse.as_ref().map(|points| points.count);
            if let Some(quarter) = cell
                .quarter
                .filter(|_| judgement.verdict != Verdict::NoTruth)
            {
                judgement.near = quarter.judge(report, self.rule);
            }
        }
        judgements
    }
}

impl TrueQuarter {
    fn new(
        truth: &Truth,
        columns: Range<usize>,
        rows: Range<usize>,
        rule: CellRule,
        rig: Option<&Rig>,
    ) -> Self {
        let mut values: Vec<f32> = Vec::with_capacity(columns.len() * rows.len());
        for y in rows {
            let row = &truth.disparity.row(y)[columns.clone()];
            values.extend(row.iter().filter(|d| d.is_finite()));
        }
        let clear_px = clear_px(rule, rig);
        let near = values.iter().filter(|&&d| f64::from(d) > clear_px).count();
        let rank = NEAR_PERCENT * values.len() / 100;
        let (_, near_px, _) = values.select_nth_unstable_by(rank, f32::total_cmp);
        Self {
            near: depth_at(*near_px, rig),
            not_clear: near as f64 / values.len() as f64,
        }
    }

    /// Scores the report of a cell by its nearest quarter.
    pub fn judge(&self, cell: &Cell, rule: CellRule) -> NearJudgement {
        let (obstacle_m, clear_m) = rule.obstacle_and_clear_m();
        let is_near = self.near.distance_m.is_some_and(|z| z < obstacle_m);
        let Some(report) = &cell.depth else {
            return NearJudgement {
                is_near,
                ..NearJudgement::default()
            };
        };
        let is_clear = report.distance_m.is_none_or(|z| z > clear_m);
        let is_obstacle = report.distance_m.is_some_and(|z| z < obstacle_m);
        NearJudgement {
            is_near,
            missed: is_near && is_clear && !cell.too_close,
            found: is_near && (!is_clear || cell.too_close),
            falsely: is_obstacle && self.not_clear < CLEAR,
        }
    }

    fn of_points(points: &SparseCell, rule: CellRule, rig: Option<&Rig>) -> Self {
        let clear_px = clear_px(rule, rig);
        Self {
            near: depth_at(points.truth.percentile(NEAR_PERCENT), rig),
            not_clear: points.truth.share(|d| f64::from(d) > clear_px),
        }
    }
}

/// The disparity above which nothing is clear.
fn clear_px(rule: CellRule, rig: Option<&Rig>) -> f64 {
    let (_, clear_m) = rule.obstacle_and_clear_m();
    rig.map_or(f64::INFINITY, |rig| rig.disparity_px(clear_m))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::SurfaceTally;
    use svl_core::stereo::{Geometry, Gray, Plane, StereoPair, TruthKind};

    const RULE: CellRule = CellRule::Disparity { tolerance_px: 2.0 };

    fn frame(disparity: Plane<f32>, kind: TruthKind) -> Frame {
        let (width, height) = disparity.size();
        let image = Gray::filled(width, height, 0).unwrap();
        Frame {
            truth: Some(Truth {
                kind,
                ..Truth::exact(disparity, None)
            }),
            ..Frame::new(
                StereoPair::new(image.clone(), image).unwrap(),
                Geometry::Rectified(None),
            )
        }
    }

    #[test]
    fn ten_points_are_scored_and_a_fifth_of_a_reference() {
        let shape = GridShape {
            columns: 2,
            rows: 1,
        };
        let known = |is_known: fn(usize) -> bool, density, origin| {
            let value = |x, _| if is_known(x) { x as f32 } else { f32::INFINITY };
            let frame = frame(
                Plane::from_fn(80, 1, value).unwrap(),
                TruthKind { density, origin },
            );
            let cells = TrueCells::new(&frame, shape, RULE).unwrap();
            let cells = [0, 1].map(|column| cells.grid().cell(column, 0).depth);
            cells.map(|depth| depth.map(|depth| depth.median_px))
        };
        // Ten points in the left cell, nine in the right one.
        let tenth = |x| x % 4 == 0 && x < 76;
        for density in [TruthDensity::Sparse, TruthDensity::Dense] {
            let cells = known(tenth, density, TruthOrigin::Exact);
            assert_eq!(cells, [Some(16.0), None]);
        }
        let reference = |is_known| {
            let origin = TruthOrigin::Reference("sgm".into());
            known(is_known, TruthDensity::Dense, origin)
        };
        assert_eq!(reference(tenth), [Some(16.0), Some(56.0)]);
        assert_eq!(reference(|x| x % 4 == 0 && x % 8 != 0), [None; 2]);
    }

    /// A floor of 40 rows, every fourth of which is known: the score of a map, and the counts of
    /// its cell.
    fn floor(map: impl Fn(usize) -> f32) -> (CellJudgement, SurfaceTally) {
        let known = |_: usize, y: usize| {
            if y.is_multiple_of(4) {
                y as f32
            } else {
                f32::INFINITY
            }
        };
        let frame = frame(Plane::from_fn(16, 40, known).unwrap(), TruthKind::default());
        let shape = GridShape {
            columns: 1,
            rows: 1,
        };
        let cells = TrueCells::new(&frame, shape, RULE).unwrap();
        let map = Plane::from_fn(16, 40, |_, y| map(y)).unwrap();
        let reported = depth::grid(&map, shape.into(), None);
        let tally = SurfaceTally::new(&frame, &cells, &reported, RULE);
        (cells.judge(&reported)[0], tally)
    }

    #[test]
    fn points_are_weighted_however_many_they_are() {
        // A floor of 16 rows; all pixels of its upper half, every fourth of the lower one.
        let disparity = Plane::from_fn(16, 16, |x, y| {
            if y < 8 || (x + y) % 4 == 0 {
                y as f32
            } else {
                f32::INFINITY
            }
        });
        let disparity = disparity.unwrap();
        let median = |density| {
            let origin = TruthOrigin::Exact;
            let frame = frame(disparity.clone(), TruthKind { density, origin });
            let one = GridShape {
                columns: 1,
                rows: 1,
            };
            let cells = TrueCells::new(&frame, one, RULE).unwrap();
            cells.grid().cell(0, 0).depth.unwrap().median_px
        };
        assert_eq!(
            [TruthDensity::Dense, TruthDensity::Sparse].map(median),
            [4.0, 7.0]
        );
    }

    #[test]
    fn a_report_is_compared_with_the_points() {
        // The points' median is 16, their 75th percentile 28.
        let (right, tally) = floor(|_| 17.5);
        assert_eq!((right.verdict, right.points), (Verdict::Right, Some(160)));
        assert_eq!((tally.right, tally.near_right), (1, 0));
        let (off, tally) = floor(|_| 18.5);
        assert_eq!((off.verdict, tally.wrong), (Verdict::Wrong, 1));
        let rule = |d| (floor(|_| d).1.right, floor(|_| d).1.near_right);
        assert_eq!([18.5, 26.0, 28.0].map(rule), [(0, 0), (0, 1), (0, 1)]);
    }
}
