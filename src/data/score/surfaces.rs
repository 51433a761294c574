//! Cells of two surfaces: where the nearest quarter of a cell is nearer than its median.
//!
//! The median rule calls an algorithm wrong that names the nearer of two surfaces, and overlooks an
//! obstacle that fills a quarter of a cell. These counts stand beside it.

use std::ops::Range;
use svl_core::stereo::{CellDepth, CellRule, DepthGrid, Frame, Plane, Rig, Truth};

/// Least share of a cell's true pixels that a report names.
const NAMED: f64 = 0.25;

/// Rank of the true disparity that is the nearest quarter's.
const NEAR_PERCENT: usize = 75;

/// Greatest share of a cell that is not clear where a reported obstacle is none.
const CLEAR: f64 = 0.05;

/// The nearest quarters of a frame's true cells, in raster order.
#[derive(Clone, Debug)]
pub struct TrueQuarters(Vec<Option<TrueQuarter>>);

#[derive(Clone, Copy, Debug, PartialEq)]
struct TrueQuarter {
    near_px: f64,
    /// Absent without a rig, or at infinity.
    near_m: Option<f64>,
    /// Share of the cell's true pixels that is nearer than what is clear.
    not_clear: f64,
}

/// Counts over the cells of a frame that have a truth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SurfaceTally {
    /// Right by the median, or nearer than that and agreeing with a quarter of the cell.
    pub right: usize,
    pub wrong: usize,
    /// Cells whose nearest quarter is an obstacle, reported as clear.
    pub missed: usize,
    /// Cells reported as an obstacle that are nearly all clear.
    pub falsely: usize,
    /// Judged by the nearest quarter in place of the median.
    pub near_right: usize,
    pub near_wrong: usize,
}

impl TrueQuarters {
    /// Of the cells that `true_grid` knows.
    pub fn new(truth: &Truth, true_grid: &DepthGrid, rule: CellRule, rig: Option<&Rig>) -> Self {
        let (shape, size) = (true_grid.shape(), truth.disparity.size());
        let (_, clear_m) = rule.obstacle_and_clear_m();
        // Nearer is of a greater disparity.
        let clear_px = rig.map_or(f64::INFINITY, |rig| rig.disparity_px(clear_m));
        let mut values = Vec::new();
        let quarter = |(place, cell): ((usize, usize), &svl_core::stereo::Cell)| {
            cell.depth?;
            let (columns, rows) = shape.pixels(place, size);
            values.clear();
            values.extend(finite(&truth.disparity, &columns, rows));
            let near = values.iter().filter(|&&d| f64::from(d) > clear_px).count();
            let rank = NEAR_PERCENT * values.len() / 100;
            let (_, near_px, _) = values.select_nth_unstable_by(rank, f32::total_cmp);
            let near_px = f64::from(*near_px);
            Some(TrueQuarter {
                near_px,
                near_m: rig.and_then(|rig| rig.depth_m(near_px)),
                not_clear: near as f64 / values.len() as f64,
            })
        };
        Self(true_grid.iter().map(quarter).collect())
    }

    /// The nearest quarters, where the cells have a truth.
    pub fn depths(&self) -> impl Iterator<Item = Option<CellDepth>> {
        self.0.iter().map(|quarter| {
            quarter.map(|quarter| CellDepth {
                median_px: quarter.near_px as f32,
                p20_px: quarter.near_px as f32,
                p80_px: quarter.near_px as f32,
                distance_m: quarter.near_m,
            })
        })
    }
}

impl SurfaceTally {
    /// Judges the cells of `reported` by the frame's truth.
    pub fn new(
        frame: &Frame,
        true_grid: &DepthGrid,
        quarters: &TrueQuarters,
        reported: &DepthGrid,
        rule: CellRule,
    ) -> Self {
        let mut tally = Self::default();
        let (Some(truth), shape) = (&frame.truth, reported.shape()) else {
            return tally;
        };
        let (obstacle_m, clear_m) = rule.obstacle_and_clear_m();
        let cells = true_grid.iter().zip(reported.iter()).zip(&quarters.0);
        for (((place, median), (_, cell)), quarter) in cells {
            let (Some(median), Some(report), Some(quarter)) = (&median.depth, &cell.depth, quarter)
            else {
                continue;
            };
            if judged_by_distance(rule) && median.distance_m.is_none() {
                continue;
            }
            let median_px = f64::from(median.median_px);
            let agrees = |true_px: f64, surface| {
                // What is too close is anywhere nearer than its report.
                cell.too_close && true_px >= f64::from(report.median_px)
                    || agrees(report, true_px, rule, frame.rig(), surface)
            };
            let named = || {
                let (columns, rows) = shape.pixels(place, truth.disparity.size());
                let pixels = || finite(&truth.disparity, &columns, rows.clone());
                let agreeing = pixels().filter(|&d| agrees(d.into(), true)).count();
                agreeing as f64 >= NAMED * pixels().count() as f64
            };
            let is_nearer = f64::from(report.median_px) > median_px;
            match agrees(median_px, false) || is_nearer && named() {
                true => tally.right += 1,
                false => tally.wrong += 1,
            }
            match agrees(quarter.near_px, false) {
                true => tally.near_right += 1,
                false => tally.near_wrong += 1,
            }
            let is_clear = report.distance_m.is_none_or(|z| z > clear_m);
            let is_obstacle = report.distance_m.is_some_and(|z| z < obstacle_m);
            let near_obstacle = quarter.near_m.is_some_and(|z| z < obstacle_m);
            tally.missed += usize::from(near_obstacle && is_clear);
            tally.falsely += usize::from(is_obstacle && quarter.not_clear < CLEAR);
        }
        tally
    }
}

fn judged_by_distance(rule: CellRule) -> bool {
    matches!(rule, CellRule::Distance { .. })
}

/// Whether a report is within the rule's tolerance of a true disparity; of a surface judged in
/// pixels, 5 % of it at least.
fn agrees(
    report: &CellDepth,
    true_px: f64,
    rule: CellRule,
    rig: Option<&Rig>,
    surface: bool,
) -> bool {
    match rule {
        CellRule::Distance {
            tolerance_m,
            tolerance_percent,
            ..
        } => {
            let true_m = rig.and_then(|rig| rig.depth_m(true_px));
            true_m.zip(report.distance_m).is_some_and(|(z_true, z)| {
                (z - z_true).abs() <= (tolerance_percent / 100.0 * z_true).max(tolerance_m)
            })
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
    use svl_core::stereo::{Exposure, Geometry, Gray, GridShape, StereoPair};

    /// A cell of ten pixels: `near` of them at 0.4 m, the others at 2 m, and what a report of
    /// `distance_m` is counted as.
    fn tally(near: usize, distance_m: f64) -> SurfaceTally {
        // One metre is 10 px.
        let rig = Rig::new(100.0, (5.0, 0.5), 0.1, 0.0).unwrap();
        let pixels = (0..10).map(|i| if i < near { 25.0 } else { 5.0 }).collect();
        let disparity = Plane::from_vec(10, 1, pixels).unwrap();
        let image = Gray::filled(10, 1, 0).unwrap();
        let frame = Frame {
            sequence: 0,
            stamp_ns: 0,
            name: None,
            pair: StereoPair::new(image.clone(), image).unwrap(),
            color: None,
            geometry: Geometry::Rectified(Some(rig)),
            pose: None,
            truth: Some(Truth::exact(disparity, None)),
            exposure: Exposure::default(),
        };
        let settings = GridSettings::from(GridShape {
            columns: 1,
            rows: 1,
        });
        let truth = frame.truth.as_ref().unwrap();
        let true_grid = grid(&truth.disparity, settings, Some(&rig));
        let report = Plane::filled(10, 1, (10.0 / distance_m) as f32).unwrap();
        let reported = grid(&report, settings, Some(&rig));
        let rule = CellRule::default();
        let quarters = TrueQuarters::new(truth, &true_grid, rule, Some(&rig));
        SurfaceTally::new(&frame, &true_grid, &quarters, &reported, rule)
    }

    #[test]
    fn the_nearer_surface_may_be_named_from_a_quarter_on() {
        assert_eq!((tally(3, 0.4).right, tally(3, 0.4).wrong), (1, 0));
        assert_eq!((tally(2, 0.4).right, tally(2, 0.4).wrong), (0, 1));
        // The farther one is the median's.
        assert_eq!((tally(3, 2.0).right, tally(7, 2.0).right), (1, 0));
    }

    #[test]
    fn obstacles_are_those_of_the_nearest_quarter() {
        assert_eq!((tally(3, 2.0).missed, tally(2, 2.0).missed), (1, 0));
        assert_eq!((tally(3, 0.4).near_right, tally(2, 0.4).near_wrong), (1, 1));
        assert_eq!((tally(0, 0.4).falsely, tally(1, 0.4).falsely), (1, 0));
    }
}
