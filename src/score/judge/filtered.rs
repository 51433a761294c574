//! Benefit and cost of filters: obstacles that a filter removes, and objects nearer than the range
//! of disparities.

use super::{CellJudgement, TrueCells, Verdict};
use svl_core::stereo::{CellRule, Estimate, Frame};

/// Counts over the cells of a frame with exact truth and a rig.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FilterTally {
    /// Cells with an obstacle that are right with and without filters; `None` without filters, and
    /// if floor is unknown.
    pub kept: Option<usize>,
    /// Cells with an obstacle that are right only without filters.
    pub lost: Option<usize>,
    /// Cells nearer than the range of disparities that are reported as such, or right; `None` if
    /// the range is unknown.
    pub close: Option<usize>,
    /// Cells nearer than the range that are neither.
    pub blind: Option<usize>,
    /// True if cells are reported as too close but none of them has an obstacle; `None` without
    /// filters.
    pub alarm: Option<bool>,
}

impl FilterTally {
    /// `cells` are the scores of the estimate's grid.
    pub fn new(
        frame: &Frame,
        true_cells: &TrueCells,
        estimate: &Estimate,
        cells: &[CellJudgement],
        rule: CellRule,
    ) -> Self {
        let has_distances = matches!(rule, CellRule::Distance { .. }) && frame.rig().is_some();
        let truth = frame.truth.as_ref().filter(|_| has_distances);
        // Nothing is measured where no cell has enough of a truth.
        let is_scored = cells.iter().any(|cell| cell.verdict != Verdict::NoTruth);
        let Some(truth) = truth.filter(|_| is_scored) else {
            return Self::default();
        };
        let count = |is: &dyn Fn(usize) -> bool| (0..cells.len()).filter(|i| is(*i)).count();
        let too_close: Vec<_> = estimate
            .grid
            .iter()
            .map(|(_, cell)| cell.too_close)
            .collect();
        let before = estimate.unfiltered.as_ref();
        let before = before.map(|grid| true_cells.judge(frame, grid));
        let right_before = |with_filter: bool| {
            let before = before.as_ref().filter(|_| truth.surface.is_some())?;
            Some(count(&|i| {
                before[i].verdict == Verdict::Right
                    && (cells[i].verdict == Verdict::Right) == with_filter
                    && true_cells.has_obstacle(i)
            }))
        };
        let out_of_range = |said: bool| {
            let range_px = estimate.range_px?;
            Some(count(&|i| {
                let is_said = too_close[i] || cells[i].verdict == Verdict::Right;
                cells[i].true_px.unwrap_or_default() > range_px && is_said == said
            }))
        };
        let alarm = before.as_ref().map(|_| {
            count(&|i| too_close[i]) > 0
                && count(&|i| too_close[i] && true_cells.has_obstacle(i)) == 0
        });
        Self {
            kept: right_before(true),
            lost: right_before(false),
            close: out_of_range(true),
            blind: out_of_range(false),
            alarm,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::depth::{GridSettings, grid};
    use svl_core::stereo::{
        DisparityMap, Geometry, Gray, GridShape, Plane, Rig, StereoPair, Surface, Truth,
    };

    /// Four cells of ten pixels, at 25 px per 0.4 m: floor; floor with 3 pixels of a wall; a wall;
    /// a wall nearer than the range of 40 px.
    fn frame() -> Frame {
        let disparity = |x: usize| match x {
            0..30 => 25.0,
            _ => 50.0,
        };
        let surface = |x: usize| match x {
            0..17 => Surface::Floor,
            _ => Surface::Wall,
        };
        let image = Gray::filled(40, 1, 0).unwrap();
        Frame {
            truth: Some(Truth {
                surface: Some(Plane::from_fn(40, 1, |x, _| surface(x)).unwrap()),
                ..Truth::exact(Plane::from_fn(40, 1, |x, _| disparity(x)).unwrap(), None)
            }),
            ..Frame::new(
                StereoPair::new(image.clone(), image).unwrap(),
                Geometry::Rectified(Some(Rig::new(100.0, (5.0, 0.5), 0.1, 0.0).unwrap())),
            )
        }
    }

    /// Cells reported with these disparities, without filters and with them.
    fn tally(before: [f32; 4], after: [f32; 4], too_close: [bool; 4]) -> FilterTally {
        let frame = frame();
        let settings = GridSettings::from(GridShape {
            columns: 4,
            rows: 1,
        });
        let report = |cells: [f32; 4]| {
            let map = Plane::from_fn(40, 1, |x, _| cells[x / 10]).unwrap();
            grid(&map, settings, frame.rig())
        };
        let mut filtered = report(after);
        for (cell, is) in filtered.cells_mut().zip(too_close) {
            cell.too_close = is;
        }
        let estimate = Estimate {
            algorithm: String::new(),
            disparity: DisparityMap::new(40, 1).unwrap(),
            grid: filtered,
            own_grid: true,
            unfiltered: Some(report(before)),
            range_px: Some(40.0),
            times: Default::default(),
        };
        let rule = CellRule::default();
        let true_cells = TrueCells::new(&frame, settings.shape(), rule).unwrap();
        let cells = true_cells.judge(&frame, &estimate.grid);
        FilterTally::new(&frame, &true_cells, &estimate, &cells, rule)
    }

    const NONE: f32 = f32::INFINITY;

    #[test]
    fn obstacles_that_a_filter_takes_away_are_counted() {
        let seen = [25.0, 25.0, 25.0, NONE];
        let plain = tally(seen, seen, [false; 4]);
        // The second cell has an obstacle.
        assert_eq!((plain.kept, plain.lost), (Some(2), Some(0)));
        let filtered = tally(seen, [NONE, NONE, 25.0, NONE], [false; 4]);
        assert_eq!((filtered.kept, filtered.lost), (Some(1), Some(1)));
    }

    #[test]
    fn cells_nearer_than_the_range_are_counted() {
        let seen = [25.0, 25.0, 25.0, NONE];
        let plain = tally(seen, seen, [false; 4]);
        assert_eq!(
            (plain.close, plain.blind, plain.alarm),
            (Some(0), Some(1), Some(false))
        );
        // At the end of the range: right, as it claims only to be nearer.
        let close = [25.0, 25.0, 25.0, 40.0];
        let filtered = tally(seen, close, [false, false, false, true]);
        assert_eq!((filtered.close, filtered.blind), (Some(1), Some(0)));
        assert_eq!(filtered.alarm, Some(false));
        // Near floor is not a reason; next to a real one it is not a false alarm.
        let alarm = |too_close| tally(seen, [40.0; 4], too_close).alarm;
        assert_eq!(alarm([true, false, false, false]), Some(true));
        assert_eq!(alarm([true, true, false, false]), Some(false));
    }
}
