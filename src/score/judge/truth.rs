//! The truth of a frame by cells: the reference for every score of cells.
//!
//! Pixels with truth represent the cell if they are at least half of its pixels. Points of a
//! sensor, and fewer pixels, determine a range ([`SparseCell`]): the cell is scored if that is
//! narrow.

use super::cells::{CellJudgement, NearJudgement, claimed, depth_at, has_truth, judge_cell};
use super::sparse::SparseCell;
use std::ops::Range;
use svl_core::depth::{self, CellDecision, GridSettings};
use svl_core::stereo::{
    Cell, CellDepth, CellRule, DepthGrid, Frame, GridShape, MapDensity, Rig, Truth, TruthOrigin,
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
    /// `None` if it is not known.
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
        let are_points = truth.kind.density == MapDensity::Sparse;
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
            let quarter = if let Some(points) = &sparse {
                cell.depth = points.percentile(50, rule, rig);
                TrueQuarter::from_points(points, rule, rig)
            } else {
                let scored = cell.depth.filter(|depth| has_truth(depth, rule));
                scored.map(|_| TrueQuarter::new(truth, columns, rows, rule, rig))
            };
            TrueCell { sparse, quarter }
        };
        let cells = shape.iter().zip(grid.cells_mut()).map(true_cell).collect();
        Some(Self { grid, cells, rule })
    }

    /// Per cell the median true disparity and its distance, if the cell is scored.
    pub fn grid(&self) -> &DepthGrid {
        &self.grid
    }

    /// The nearest quarters of the cells, if they are known.
    pub fn near(&self) -> impl Iterator<Item = Option<CellDepth>> {
        let quarters = self.cells.iter().map(|cell| cell.quarter);
        quarters.map(|quarter| quarter.map(|quarter| quarter.near))
    }

    /// The cells in raster order.
    pub(super) fn cells(&self) -> &[TrueCell] {
        &self.cells
    }

    /// The rule by which a cell, by its number in raster order, is scored against its median or
    /// its nearest quarter.
    pub fn rule(&self, cell: usize, truth: &CellDepth) -> CellRule {
        if self.cells[cell].sparse.is_some() {
            self.rule.proportional_at(truth.median_px.into())
        } else {
            self.rule
        }
    }

    /// Scores every cell, in raster order.
    pub fn judge(&self, reported: &DepthGrid) -> Vec<CellJudgement> {
        debug_assert_eq!(self.grid.shape(), reported.shape());
        let grids = self.grid.iter().zip(reported.iter());
        let cells = grids.zip(&self.cells).enumerate();
        let judged = cells.map(|(i, (((_, median), (_, report)), cell))| {
            let median = median.depth.as_ref();
            let rule = median.map_or(self.rule, |median| self.rule(i, median));
            let near = cell.quarter.map(|quarter| quarter.judge(report, self.rule));
            CellJudgement {
                points: cell.sparse.as_ref().map(|points| points.count),
                near: near.unwrap_or_default(),
                ..judge_cell(median, claimed(report, median), rule)
            }
        });
        judged.collect()
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
        let is_free = self.not_clear < CLEAR;
        let Some(report) = &cell.depth else {
            let is_flagged = cell.near.is_some();
            return NearJudgement {
                is_near,
                found: is_near && is_flagged,
                falsely: is_flagged && is_free,
                ..NearJudgement::default()
            };
        };
        let is_clear = report.distance_m.is_none_or(|z| z > clear_m);
        let is_obstacle = report.distance_m.is_some_and(|z| z < obstacle_m);
        NearJudgement {
            is_near,
            missed: is_near && is_clear && !cell.too_close,
            found: is_near && (!is_clear || cell.too_close),
            falsely: is_obstacle && is_free,
        }
    }

    /// `None` if the points do not determine it.
    fn from_points(points: &SparseCell, rule: CellRule, rig: Option<&Rig>) -> Option<Self> {
        let near = points.percentile(NEAR_PERCENT, rule, rig)?;
        let clear_px = clear_px(rule, rig);
        has_truth(&near, rule).then(|| Self {
            near,
            not_clear: points.share(|d| f64::from(d) > clear_px),
        })
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
    use crate::judge::{SurfaceTally, Verdict};
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

    const ONE_CELL: GridShape = GridShape {
        columns: 1,
        rows: 1,
    };

    #[test]
    fn a_flag_finds_what_is_near_and_is_false_where_nothing_is() {
        let judged = |near_m: f64, not_clear: f64| {
            let quarter = TrueQuarter {
                near: CellDepth {
                    median_px: 10.0,
                    p20_px: 10.0,
                    p80_px: 10.0,
                    distance_m: Some(near_m),
                },
                not_clear,
            };
            let flagged = Cell {
                near: Some(0.9),
                ..Cell::UNKNOWN
            };
            let rule = CellRule::default();
            [flagged, Cell::UNKNOWN].map(|cell| {
                let judged = quarter.judge(&cell, rule);
                assert!(!judged.missed);
                (judged.found, judged.falsely)
            })
        };
        assert_eq!(judged(0.4, 0.3), [(true, false), (false, false)]);
        assert_eq!(judged(2.0, 0.0), [(false, true), (false, false)]);
        // Something is near, but less than a quarter of the cell.
        assert_eq!(judged(2.0, 0.1), [(false, false), (false, false)]);
    }

    #[test]
    fn points_and_a_fifth_of_a_reference_are_scored() {
        let shape = GridShape {
            columns: 2,
            rows: 1,
        };
        let known = |is_known: fn(usize) -> bool, density, origin| {
            let value = |x, _| if is_known(x) { 5.0 } else { f32::INFINITY };
            let frame = frame(
                Plane::from_fn(80, 1, value).unwrap(),
                TruthKind { density, origin },
            );
            let cells = TrueCells::new(&frame, shape, RULE).unwrap();
            [0, 1].map(|column| cells.grid().cell(column, 0).depth.is_some())
        };
        // Ten points in the left cell, nine in the right one.
        let tenth = |x| x % 4 == 0 && x < 76;
        for density in [MapDensity::Sparse, MapDensity::Dense] {
            let cells = known(tenth, density, TruthOrigin::Exact);
            assert_eq!(cells, [true, false]);
        }
        let reference = |is_known| {
            let origin = TruthOrigin::Reference("sgm".into());
            known(is_known, MapDensity::Dense, origin)
        };
        assert_eq!(reference(tenth), [true, true]);
        assert_eq!(reference(|x| x % 4 == 0 && x % 8 != 0), [false, false]);
        // Points on three quarters of the pixels, in three of eight parts of the left cell.
        let uneven = |x| !(15..40).contains(&x);
        let [sparse, dense] = [MapDensity::Sparse, MapDensity::Dense]
            .map(|density| known(uneven, density, TruthOrigin::Exact));
        assert_eq!((sparse, dense), ([false, true], [false, true]));
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
            let cells = TrueCells::new(&frame, ONE_CELL, RULE).unwrap();
            cells.grid().cell(0, 0).depth.unwrap().median_px
        };
        assert_eq!(
            [MapDensity::Dense, MapDensity::Sparse].map(median),
            [4.0, 7.0]
        );
    }

    /// The cell of a slanted surface of 40 rows, every fifth of which is known from row `first` on:
    /// the score of a map, and its counts.
    fn slant(
        first: usize,
        px: impl Fn(usize) -> f32,
        map_px: f32,
    ) -> (CellJudgement, SurfaceTally) {
        let known = |_: usize, y: usize| {
            if y >= first && y.is_multiple_of(5) {
                px(y)
            } else {
                f32::INFINITY
            }
        };
        let frame = frame(Plane::from_fn(16, 40, known).unwrap(), TruthKind::default());
        let cells = TrueCells::new(&frame, ONE_CELL, RULE).unwrap();
        let map = Plane::filled(16, 40, map_px).unwrap();
        let reported = depth::grid(&map, ONE_CELL.into(), None);
        let tally = SurfaceTally::new(&frame, &cells, &reported, RULE);
        (cells.judge(&reported)[0], tally)
    }

    #[test]
    fn a_report_is_compared_with_the_points() {
        // The points' median is 15, their 75th percentile 25.
        let floor = |map_px| slant(0, |y| y as f32, map_px);
        let (right, tally) = floor(16.5);
        assert_eq!((right.verdict, right.points), (Verdict::Right, Some(128)));
        assert_eq!((tally.right, tally.near_right, tally.quarters), (1, 0, 1));
        let (off, tally) = floor(17.5);
        assert_eq!((off.verdict, tally.wrong), (Verdict::Wrong, 1));
        let counts = |px| (floor(px).1.right, floor(px).1.near_right);
        assert_eq!([17.5, 24.0, 27.0].map(counts), [(0, 0), (0, 1), (0, 1)]);
        // Twice the tolerance at 80 px: 5 % of it.
        let far = |map_px| slant(0, |_| 80.0, map_px);
        assert_eq!(far(84.0).0.verdict, Verdict::Right);
        assert_eq!(far(84.1).0.verdict, Verdict::Wrong);
        assert_eq!((far(84.0).1.near_right, far(84.1).1.near_right), (1, 0));
    }

    #[test]
    fn median_and_nearest_quarter_are_scored_each_where_it_is_known() {
        let scored = |first, px: fn(usize) -> f32| {
            [10.0, 50.0].map(|map_px| {
                let (judgement, tally) = slant(first, px, map_px);
                assert_eq!(judgement.points, Some((40 - first) / 5 * 16));
                // The same cells for all reports.
                (
                    judgement.verdict != Verdict::NoTruth,
                    tally.right + tally.wrong,
                    tally.quarters,
                )
            })
        };
        // Half of the parts, and three quarters.
        assert_eq!(scored(20, |_| 10.0), [(true, 1, 0); 2]);
        assert_eq!(scored(10, |_| 10.0), [(true, 1, 1); 2]);
        // The upper quarter is unknown; of the rest, a half or more than half is of one surface.
        assert_eq!(
            scored(10, |y| if y < 25 { 10.0 } else { 50.0 }),
            [(false, 0, 1); 2]
        );
        assert_eq!(
            scored(10, |y| if y < 35 { 10.0 } else { 50.0 }),
            [(true, 1, 0); 2]
        );
    }
}
