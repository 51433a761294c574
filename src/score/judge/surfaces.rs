//! Cells with two surfaces: those whose nearest quarter is nearer than the median.
//!
//! The median rule counts a report of the nearer of two surfaces as wrong, and overlooks an
//! obstacle that fills a quarter of a cell. These counts supplement it.

use super::TrueCells;
use super::cells::{depth_at, has_truth, is_within};
use super::truth::TrueQuarter;
use std::ops::Range;
use svl_core::stereo::{Cell, CellDepth, CellRule, DepthGrid, Frame, Plane};

/// Least fraction of a cell's true pixels that a report must agree with.
const NAMED: f64 = 0.25;

/// Counts over the cells of a frame with truth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SurfaceTally {
    /// Right by the median, or nearer than that and agreeing with a quarter of the cell.
    pub right: usize,
    pub wrong: usize,
    /// Cells whose nearest quarter is known.
    pub quarters: usize,
    /// Those of them in which it is an obstacle.
    pub near: usize,
    /// Those of them that are unknown.
    pub near_unknown: usize,
    /// Those of them that are reported as clear, and those that are not.
    pub missed: usize,
    pub found: usize,
    /// Cells reported as an obstacle that are nearly all clear.
    pub falsely: usize,
    /// Scored by a known nearest quarter instead of the median.
    pub near_right: usize,
    pub near_wrong: usize,
}

impl SurfaceTally {
    /// Scores the cells of `reported` against the frame's truth.
    pub fn new(
        frame: &Frame,
        true_cells: &TrueCells,
        reported: &DepthGrid,
        rule: CellRule,
    ) -> Self {
        let mut tally = Self::default();
        let (Some(truth), shape) = (&frame.truth, reported.shape()) else {
            return tally;
        };
        let grids = true_cells.grid().iter().zip(reported.iter());
        let cells = grids.zip(true_cells.cells()).enumerate();
        for (i, (((place, median), (_, cell)), of_truth)) in cells {
            if let Some(quarter) = &of_truth.quarter {
                tally.add_quarter(quarter, cell, rule, true_cells.rule(i, &quarter.near));
            }
            let median = median.depth.filter(|depth| has_truth(depth, rule));
            let Some((median, report)) = median.zip(cell.depth) else {
                continue;
            };
            let is_named = || {
                let agrees = |px: f32| {
                    let surface = depth_at(px, frame.rig());
                    agrees(cell, &report, &surface, rule.proportional_at(px.into()))
                };
                let share = of_truth.sparse.as_ref().map_or_else(
                    || {
                        let (columns, rows) = shape.pixels(place, truth.disparity.size());
                        share(finite(&truth.disparity, columns, rows), agrees)
                    },
                    |points| points.share(agrees),
                );
                share >= NAMED
            };
            let is_nearer = report.median_px > median.median_px;
            if agrees(cell, &report, &median, true_cells.rule(i, &median))
                || is_nearer && is_named()
            {
                tally.right += 1;
            } else {
                tally.wrong += 1;
            }
        }
        tally
    }

    /// Counts a cell whose nearest quarter is known; it agrees by `near_rule`.
    fn add_quarter(
        &mut self,
        quarter: &TrueQuarter,
        cell: &Cell,
        rule: CellRule,
        near_rule: CellRule,
    ) {
        let near = quarter.judge(cell, rule);
        self.quarters += 1;
        self.near += usize::from(near.is_near);
        self.missed += usize::from(near.missed);
        self.found += usize::from(near.found);
        self.falsely += usize::from(near.falsely);
        match &cell.depth {
            None => self.near_unknown += usize::from(near.is_near && !near.found),
            Some(report) if agrees(cell, report, &quarter.near, near_rule) => self.near_right += 1,
            Some(_) => self.near_wrong += 1,
        }
    }
}

/// True if the report of a cell is within the rule's tolerance of a true depth, or too close, which
/// means anywhere nearer than the report.
fn agrees(cell: &Cell, report: &CellDepth, truth: &CellDepth, rule: CellRule) -> bool {
    cell.too_close && truth.median_px >= report.median_px || is_within(truth, report, rule)
}

/// The fraction of the values for which a function is true, 0..=1.
fn share(values: impl Iterator<Item = f32>, is: impl Fn(f32) -> bool) -> f64 {
    let (mut all, mut count) = (0usize, 0usize);
    for value in values {
        all += 1;
        count += usize::from(is(value));
    }
    count as f64 / all as f64
}

/// The true disparities of a cell.
fn finite(
    disparity: &Plane<f32>,
    columns: Range<usize>,
    rows: Range<usize>,
) -> impl Iterator<Item = f32> {
    rows.flat_map(move |y| disparity.row(y)[columns.clone()].iter().copied())
        .filter(|d| d.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::depth::{GridSettings, grid};
    use svl_core::stereo::{Geometry, Gray, GridShape, Rig, StereoPair, Truth};

    /// Counts for a cell of ten pixels, `near` of them at 0.4 m and the others at 2 m, and a report
    /// of `distance_m`.
    fn tally(near: usize, distance_m: f64) -> SurfaceTally {
        // One metre is 10 px.
        let rig = Rig::new(100.0, (5.0, 0.5), 0.1, 0.0).unwrap();
        let pixels = (0..10).map(|i| if i < near { 25.0 } else { 5.0 }).collect();
        let disparity = Plane::from_vec(10, 1, pixels).unwrap();
        let image = Gray::filled(10, 1, 0).unwrap();
        let frame = Frame {
            truth: Some(Truth::exact(disparity, None)),
            ..Frame::new(
                StereoPair::new(image.clone(), image).unwrap(),
                Geometry::Rectified(Some(rig)),
            )
        };
        let settings = GridSettings::from(GridShape {
            columns: 1,
            rows: 1,
        });
        let report = Plane::filled(10, 1, (10.0 / distance_m) as f32).unwrap();
        let reported = grid(&report, settings, Some(&rig));
        let rule = CellRule::default();
        let true_cells = TrueCells::new(&frame, settings.shape(), rule).unwrap();
        SurfaceTally::new(&frame, &true_cells, &reported, rule)
    }

    #[test]
    fn the_nearer_surface_may_be_named_from_a_quarter_on() {
        assert_eq!((tally(3, 0.4).right, tally(3, 0.4).wrong), (1, 0));
        assert_eq!((tally(2, 0.4).right, tally(2, 0.4).wrong), (0, 1));
        // The farther one is the median.
        assert_eq!((tally(3, 2.0).right, tally(7, 2.0).right), (1, 0));
    }

    #[test]
    fn obstacles_are_those_of_the_nearest_quarter() {
        assert_eq!((tally(3, 2.0).missed, tally(2, 2.0).missed), (1, 0));
        assert_eq!((tally(3, 0.4).near_right, tally(2, 0.4).near_wrong), (1, 1));
        assert_eq!((tally(0, 0.4).falsely, tally(1, 0.4).falsely), (1, 0));
        let near = |cells: SurfaceTally| (cells.near, cells.near_unknown);
        assert_eq!(near(tally(3, 2.0)), (1, 0));
        // An infinite disparity is invalid.
        assert_eq!(near(tally(3, 0.0)), (1, 1));
        assert_eq!(near(tally(2, 2.0)), (0, 0));
    }
}
