//! Benefit and cost of filters: obstacles that are floor, obstacles removed by a filter, and
//! objects nearer than the range of disparities.

use super::{CellJudgement, TrueCells, Verdict};
use svl_core::stereo::{CellRule, Estimate, Frame, Rig, Surface, Truth};

/// Counts over the cells of a frame with exact truth and a rig.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FilterTally {
    /// Cells reported as an obstacle in which nothing but floor is nearer than clear space; `None`
    /// if the truth has no surfaces.
    pub floor: Option<usize>,
    /// Cells with an obstacle that are right with and without filters; `None` without filters, and
    /// like `floor`.
    pub kept: Option<usize>,
    /// Those that are right only without filters.
    pub lost: Option<usize>,
    /// Cells nearer than the range of disparities that are reported as such, or right; `None` if
    /// the range is unknown.
    pub close: Option<usize>,
    /// Those that are neither.
    pub blind: Option<usize>,
    /// True if cells are reported as too close but none of them has an obstacle; `None` without
    /// filters.
    pub alarm: Option<bool>,
}

/// Least fraction of a cell's pixels that makes something an obstacle in it: a quarter, as for
/// missed near obstacles.
const MIN_SHARE: f64 = 0.25;

impl FilterTally {
    /// `cells` are the scores of the estimate's grid.
    pub fn new(
        frame: &Frame,
        true_cells: &TrueCells,
        estimate: &Estimate,
        cells: &[CellJudgement],
        rule: CellRule,
    ) -> Self {
        let Some(scene) = FilterScene::new(frame, true_cells, rule) else {
            return Self::default();
        };
        // Nothing is measured where no cell has enough of a truth.
        if cells.iter().all(|cell| cell.verdict == Verdict::NoTruth) {
            return Self::default();
        }
        let reported: Vec<_> = estimate.grid.iter().map(|(_, cell)| *cell).collect();
        let (obstacle_m, _) = rule.obstacle_and_clear_m();
        let is_near = |i: usize| {
            let distance_m = reported[i].depth.and_then(|depth| depth.distance_m);
            distance_m.is_some_and(|z| z < obstacle_m)
        };
        let knows_surfaces = scene.truth.surface.is_some();
        let floor = knows_surfaces
            .then(|| scene.count(|i, place| is_near(i) && scene.is_clear_floor(place)));
        let before = estimate.unfiltered.as_ref();
        let before = before.map(|grid| true_cells.judge(grid));
        let right_before = |with_filter: bool| {
            let before = before.as_ref().filter(|_| knows_surfaces)?;
            Some(scene.count(|i, place| {
                before[i].verdict == Verdict::Right
                    && (cells[i].verdict == Verdict::Right) == with_filter
                    && scene.has_obstacle(place)
            }))
        };
        let true_px = |i: usize| cells[i].true_px.unwrap_or_default();
        let out_of_range = |said: bool| {
            let range_px = estimate.range_px?;
            Some(scene.count(|i, _| {
                let is_said = reported[i].too_close || cells[i].verdict == Verdict::Right;
                true_px(i) > range_px && is_said == said
            }))
        };
        let alarm = before.as_ref().map(|_| {
            let is_close = |i: usize, _| reported[i].too_close;
            let is_rightly = |i: usize, place| reported[i].too_close && scene.has_obstacle(place);
            scene.count(is_close) > 0 && scene.count(is_rightly) == 0
        });
        Self {
            floor,
            kept: right_before(true),
            lost: right_before(false),
            close: out_of_range(true),
            blind: out_of_range(false),
            alarm,
        }
    }
}

/// The contents of the cells of a frame, by its truth.
struct FilterScene<'a> {
    truth: &'a Truth,
    rig: &'a Rig,
    true_cells: &'a TrueCells,
    rule: CellRule,
}

impl<'a> FilterScene<'a> {
    /// `None` without a truth or a rig, and for a rule of disparities.
    fn new(frame: &'a Frame, true_cells: &'a TrueCells, rule: CellRule) -> Option<Self> {
        let is_of_distances = matches!(rule, CellRule::Distance { .. });
        Some(Self {
            truth: frame.truth.as_ref().filter(|_| is_of_distances)?,
            rig: frame.rig()?,
            true_cells,
            rule,
        })
    }

    /// Number of cells for which a function of index and place is true.
    fn count(&self, is: impl Fn(usize, (usize, usize)) -> bool) -> usize {
        let places = self.true_cells.grid().shape().iter().enumerate();
        places.filter(|(i, place)| is(*i, *place)).count()
    }

    /// True if nothing but floor is nearer than clear space.
    fn is_clear_floor(&self, place: (usize, usize)) -> bool {
        let (_, clear_m) = self.rule.obstacle_and_clear_m();
        self.nearer_share(place, clear_m) == 0.0
    }

    fn has_obstacle(&self, place: (usize, usize)) -> bool {
        let (obstacle_m, _) = self.rule.obstacle_and_clear_m();
        self.nearer_share(place, obstacle_m) >= MIN_SHARE
    }

    /// Fraction of a cell's pixels that are nearer and not floor.
    fn nearer_share(&self, place: (usize, usize), distance_m: f64) -> f64 {
        let limit_px = self.rig.disparity_px(distance_m) as f32;
        self.share(place, |d, surface| {
            surface != Surface::Floor && d > limit_px
        })
    }

    /// Fraction of a cell's pixels for which a function of disparity and surface is true.
    fn share(&self, place: (usize, usize), is: impl Fn(f32, Surface) -> bool) -> f64 {
        let shape = self.true_cells.grid().shape();
        let true_cell = &self.true_cells.cells()[place.1 * shape.columns + place.0];
        if let Some(points) = &true_cell.sparse {
            return points.share(|d| is(d, Surface::Unknown));
        }
        let (columns, rows) = shape.pixels(place, self.truth.disparity.size());
        let pixels = columns.len() * rows.len();
        let surfaces = self.truth.surface.as_ref();
        let count_in_row = |y: usize| {
            let is = |x: &usize| {
                let surface = surfaces.map_or(Surface::Unknown, |s| s.get(*x, y));
                is(self.truth.disparity.get(*x, y), surface)
            };
            columns.clone().filter(is).count()
        };
        rows.map(count_in_row).sum::<usize>() as f64 / pixels as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::depth::{GridSettings, grid};
    use svl_core::stereo::{DisparityMap, Geometry, Gray, GridShape, Plane, StereoPair};

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
        let cells = true_cells.judge(&estimate.grid);
        FilterTally::new(&frame, &true_cells, &estimate, &cells, rule)
    }

    const NONE: f32 = f32::INFINITY;

    #[test]
    fn floor_obstacles_and_what_a_filter_takes_away() {
        let seen = [25.0, 25.0, 25.0, NONE];
        let plain = tally(seen, seen, [false; 4]);
        // The second cell has an obstacle.
        assert_eq!(
            (plain.floor, plain.kept, plain.lost),
            (Some(1), Some(2), Some(0))
        );
        let filtered = tally(seen, [NONE, NONE, 25.0, NONE], [false; 4]);
        let counts = (filtered.floor, filtered.kept, filtered.lost);
        assert_eq!(counts, (Some(0), Some(1), Some(1)));
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
