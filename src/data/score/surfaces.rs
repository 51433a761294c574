//! Cells with two surfaces: those whose nearest quarter is nearer than the median.
//!
//! The median rule counts a report of the nearer of two surfaces as wrong, and overlooks an
//! obstacle that fills a quarter of a cell. These counts supplement it.

use super::TrueCells;
use std::ops::Range;
use svl_core::stereo::{CellDepth, CellRule, DepthGrid, Frame, Plane, Rig};

/// Least fraction of a cell's true pixels that a report must agree with.
const NAMED: f64 = 0.25;

/// Counts over the cells of a frame with truth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SurfaceTally {
    /// Right by the median, or nearer than that and agreeing with a quarter of the cell.
    pub right: usize,
    pub wrong: usize,
    /// Cells whose nearest quarter is an obstacle.
    pub near: usize,
    /// Those of them that are unknown.
    pub near_unknown: usize,
    /// Those of them that are reported as clear, and those that are not.
    pub missed: usize,
    pub found: usize,
    /// Cells reported as an obstacle that are nearly all clear.
    pub falsely: usize,
    /// Scored by the nearest quarter instead of the median.
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
        let truths = true_cells.grid().iter().zip(true_cells.cells());
        for (((place, median), of_truth), (_, cell)) in truths.zip(reported.iter()) {
            let (Some(median), Some(quarter)) = (&median.depth, &of_truth.quarter) else {
                continue;
            };
            if judged_by_distance(rule) && median.distance_m.is_none() {
                continue;
            }
            let near = quarter.judge(cell, rule);
            tally.near += usize::from(near.is_near);
            tally.missed += usize::from(near.missed);
            tally.found += usize::from(near.found);
            tally.falsely += usize::from(near.falsely);
            let Some(report) = &cell.depth else {
                tally.near_unknown += usize::from(near.is_near);
                continue;
            };
            let median_px = f64::from(median.median_px);
            let agrees = |true_px: f64, surface| {
                // Too close means anywhere nearer than the report.
                cell.too_close && true_px >= f64::from(report.median_px)
                    || agrees(report, true_px, rule, frame.rig(), surface)
            };
            let named = || {
                if let Some(points) = &of_truth.sparse {
                    return points.truth.share(|d| agrees(d.into(), true)) >= NAMED;
                }
                let (columns, rows) = shape.pixels(place, truth.disparity.size());
                let pixels = || finite(&truth.disparity, &columns, rows.clone());
                let agreeing = pixels().filter(|&d| agrees(d.into(), true)).count();
                agreeing as f64 >= NAMED * pixels().count() as f64
            };
            let is_nearer = f64::from(report.median_px) > median_px;
            if agrees(median_px, false) || is_nearer && named() {
                tally.right += 1;
            } else {
                tally.wrong += 1;
            }
            if agrees(quarter.near.median_px.into(), false) {
                tally.near_right += 1;
            } else {
                tally.near_wrong += 1;
            }
        }
        tally
    }
}

fn judged_by_distance(rule: CellRule) -> bool {
    matches!(rule, CellRule::Distance { .. })
}

/// True if a report is within the rule's tolerance of a true disparity; if scored in pixels, within
/// at least 5 % of the disparity.
fn agrees(
    report: &CellDepth,
    true_px: f64,
    rule: CellRule,
    rig: Option<&Rig>,
    surface: bool,
) -> bool {
    match rule {
        CellRule::Distance { .. } => {
            let true_m = rig.and_then(|rig| rig.depth_m(true_px));
            let distances = true_m.zip(report.distance_m);
            distances.is_some_and(|(z_true, z)| (z - z_true).abs() <= rule.tolerance_at_m(z_true))
        }
        CellRule::Disparity { tolerance_px } => {
            let share = if surface { 0.05 * true_px } else { 0.0 };
            (f64::from(report.median_px) - true_px).abs() <= tolerance_px.max(share)
        }
    }
}

/// The true disparities of a cell.
fn finite<'a>(
    disparity: &'a Plane<f32>,
    columns: &Range<usize>,
    rows: Range<usize>,
) -> impl Iterator<Item = f32> + 'a {
    let columns = columns.clone();
    rows.flat_map(move |y| disparity.row(y)[columns.clone()].iter().copied())
        .filter(|d| d.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::depth::{GridSettings, grid};
    use svl_core::stereo::{Geometry, Gray, GridShape, StereoPair, Truth};

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
