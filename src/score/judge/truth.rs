//! The truth of a frame by cells: the reference for every score of cells.
//!
//! Pixels with truth represent the cell if they are at least half of its pixels, and what its parts
//! without any may hold cannot move the median. Points of a sensor, and fewer pixels, determine a
//! range ([`SparseCell`]): the cell is scored if that is narrow. Floor is no obstacle: whether a
//! pixel or point is floor is known before any quantile.

use super::CellArea;
use super::cells::{CellJudgement, NearJudgement, claimed, has_truth, is_within};
use super::cells::{Verdict, judge_cell};
use super::sparse::SparseCell;
use std::borrow::Cow;
use std::ops::Range;
use svl_core::depth::{self, CellDecision, GridSettings};
use svl_core::stereo::{
    Cell, CellDepth, CellRule, DepthGrid, Frame, GridShape, MapDensity, Plane, Rig, Surface, Truth,
};

/// Least fraction of a cell's pixels with known truth for the cell to have a dense truth.
const MIN_KNOWN: f64 = 0.5;

/// Percentile of the true disparities that represents the nearest quarter: of n in ascending order
/// the one of rank ⌊0.75 n⌋ + 1, so 3841 of 5120: the ⌈n / 4⌉-th nearest.
const NEAR_PERCENT: usize = 75;

/// Least fraction of a cell's parts, some of them without truth, that are near if a quarter is.
const MIN_NEAR: f64 = 1.0 - NEAR_PERCENT as f64 / 100.0;

/// Greatest fraction of a cell that is not free if a report of something near is false.
const MAX_OCCUPIED: f64 = 0.05;

/// Least fraction of a cell's true pixels that are floor if the cell is.
const MIN_FLOOR: f64 = 0.5;

/// Least fraction of a cell's true pixels that a report of a nearer surface must agree with.
const MIN_NAMED: f64 = 0.25;

/// Disparity of floor where it is no obstacle: farther than anything.
const FLOOR_PX: f32 = f32::NEG_INFINITY;

/// The truth of a frame's cells.
#[derive(Clone, Debug)]
pub struct TrueCells {
    grid: DepthGrid,
    /// In raster order.
    cells: Vec<TrueCell>,
    rule: CellRule,
}

#[derive(Clone, Debug, Default)]
struct TrueCell {
    /// The points of a sparse truth, or of one that covers less than half of the pixels.
    sparse: Option<SparseCell>,
    /// `None` if the median is unknown.
    area: Option<CellArea>,
    /// `None` if it is not known.
    quarter: Option<TrueQuarter>,
}

/// The pixels of a cell: those of all surfaces, and of those above the floor.
struct CellMaps<'a> {
    all: &'a Plane<f32>,
    above: &'a Plane<f32>,
    columns: Range<usize>,
    rows: Range<usize>,
}

/// The nearest quarter of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
struct TrueQuarter {
    /// That of all pixels, floor included; `None` if the points do not determine it.
    depth: Option<CellDepth>,
    near: NearTruth,
}

/// The truth that decides the score of a report in a cell, besides nearer surfaces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellTruth {
    /// `None` if the median is unknown.
    pub area: Option<CellArea>,
    pub median: Option<CellDepth>,
    /// `None` if the nearest quarter is unknown.
    pub near: Option<NearTruth>,
}

/// The obstacles and the clear space in a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NearTruth {
    /// A quarter of the cell is an obstacle: near, and not floor.
    pub is_obstacle: bool,
    /// Nearly all of the cell is beyond [`CellRule::far_m`].
    pub is_free: bool,
    /// Nothing but floor is nearer than clear space; false if floor is unknown.
    pub is_clear_floor: bool,
}

impl TrueCells {
    /// The cells of a frame with truth, scored by `rule`.
    pub fn new(frame: &Frame, shape: GridShape, rule: CellRule) -> Option<Self> {
        let (truth, rig) = (frame.truth.as_ref()?, frame.rig());
        let are_points = truth.kind.density == MapDensity::Sparse;
        let settings = GridSettings {
            min_valid: MIN_KNOWN,
            decision: CellDecision::Median,
            ..shape.into()
        };
        let mut grid = depth::grid(&truth.disparity, settings, rig);
        let limits = NearLimits {
            rule,
            rig,
            knows_floor: truth.surface.is_some(),
        };
        let above = above_floor(truth);
        let true_cell = |(place, cell): ((usize, usize), &mut Cell)| {
            let (columns, rows) = shape.pixels(place, truth.disparity.size());
            let maps = CellMaps {
                all: &truth.disparity,
                above: &above,
                columns,
                rows,
            };
            let is_sparse = are_points || cell.depth.is_none();
            if is_sparse && cell.valid_share > 0.0 {
                let [points, above] = [maps.all, maps.above].map(|map| maps.points(map));
                cell.depth = points.percentile(50, rule, rig);
                let floor = above.share(|d| d == FLOOR_PX);
                return TrueCell {
                    area: cell.depth.map(|depth| area(&depth, floor, rule)),
                    quarter: TrueQuarter::from_points(&points, &above, limits),
                    sparse: Some(points),
                };
            }
            let Some(depth) = cell.depth else {
                return TrueCell::default();
            };
            let can_have = cell.valid_share < 1.0 && has_truth(&depth, rule);
            let has_holes = can_have && maps.have_holes();
            if has_holes && !maps.points(maps.all).tells_median(rule, rig) {
                cell.depth = None;
            }
            let known = TrueCell::from_pixels(&maps, depth, limits, has_holes);
            TrueCell {
                area: known.area.filter(|_| cell.depth.is_some()),
                ..known
            }
        };
        let cells = shape.iter().zip(grid.cells_mut()).map(true_cell).collect();
        Some(Self { grid, cells, rule })
    }

    /// Per cell the median true disparity and its distance, if the cell is scored.
    pub fn grid(&self) -> &DepthGrid {
        &self.grid
    }

    /// The nearest quarters of the cells, floor included, if they are known.
    pub fn near(&self) -> impl Iterator<Item = Option<CellDepth>> {
        self.cells.iter().map(|cell| cell.quarter?.depth)
    }

    /// True if a quarter of the cell, by its number in raster order, is an obstacle.
    pub(super) fn has_obstacle(&self, cell: usize) -> bool {
        let quarter = self.cells[cell].quarter;
        quarter.is_some_and(|quarter| quarter.near.is_obstacle)
    }

    /// The truths that decide the scores of a constant, by column and row, in raster order.
    pub fn truths(&self) -> impl Iterator<Item = ((usize, usize), CellTruth)> {
        let cells = self.grid.iter().zip(&self.cells);
        cells.map(|((place, median), cell)| {
            let truth = CellTruth {
                area: cell.area,
                median: median.depth,
                near: cell.quarter.map(|quarter| quarter.near),
            };
            (place, truth)
        })
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

    /// Scores every cell, in raster order, in the frame that these are the true cells of.
    pub fn judge(&self, frame: &Frame, reported: &DepthGrid) -> Vec<CellJudgement> {
        debug_assert_eq!(self.grid.shape(), reported.shape());
        let grids = self.grid.iter().zip(reported.iter());
        let cells = grids.zip(&self.cells).enumerate();
        let judged = cells.map(|(i, (((place, median), (_, report)), cell))| {
            let median = median.depth.as_ref();
            let rule = median.map_or(self.rule, |median| self.rule(i, median));
            let near = cell
                .quarter
                .map(|quarter| quarter.near.judge(report, self.rule));
            let by_median = judge_cell(median, claimed(report, median), rule);
            let is_nearer = || {
                let depths = report.depth.zip(median);
                depths.is_some_and(|(report, median)| report.median_px > median.median_px)
            };
            CellJudgement {
                points: cell.sparse.as_ref().map(|points| points.count),
                near: near.unwrap_or_default(),
                area: cell.area,
                right_surface: match by_median.verdict {
                    Verdict::Wrong => is_nearer() && self.names_surface(frame, place, report),
                    verdict => verdict == Verdict::Right,
                },
                ..by_median
            }
        });
        judged.collect()
    }

    /// True if a report agrees with a quarter of its cell.
    fn names_surface(&self, frame: &Frame, place: (usize, usize), cell: &Cell) -> bool {
        let (Some(report), Some(truth)) = (cell.depth, &frame.truth) else {
            return false;
        };
        let agrees = |px: f32| {
            let surface = CellDepth::at(px, frame.rig());
            cell.too_close && surface.median_px >= report.median_px
                || is_within(&surface, &report, self.rule.proportional_at(px.into()))
        };
        let shape = self.grid.shape();
        let named = match &self.cells[place.1 * shape.columns + place.0].sparse {
            Some(points) => points.share(agrees),
            None => {
                let (columns, rows) = shape.pixels(place, truth.disparity.size());
                share(&known(&truth.disparity, &columns, &rows), agrees)
            }
        };
        named >= MIN_NAMED
    }
}

impl CellMaps<'_> {
    fn points(&self, map: &Plane<f32>) -> SparseCell {
        SparseCell::new(map, &self.columns, &self.rows)
    }

    /// True if a part of the cell has no known pixel.
    fn have_holes(&self) -> bool {
        SparseCell::has_holes(self.all, &self.columns, &self.rows)
    }
}

impl TrueCell {
    /// That of a dense truth, whose known pixels have that median. Where the cell `has_holes`, only
    /// what does not depend on them is known.
    fn from_pixels(
        maps: &CellMaps<'_>,
        depth: CellDepth,
        limits: NearLimits<'_>,
        has_holes: bool,
    ) -> Self {
        let [mut all, above] =
            [maps.all, maps.above].map(|map| known(map, &maps.columns, &maps.rows));
        let floor = share(&above, |d| d == FLOOR_PX);
        let is_scored = has_truth(&depth, limits.rule);
        let quarter = is_scored.then(|| TrueQuarter::new(&mut all, &above, limits));
        let is_decided = |quarter: &TrueQuarter| {
            let [obstacle_px, ..] = limits.limits_px();
            let is_near = |d: f32| f64::from(d) > obstacle_px;
            let is_obstacle = Some(quarter.near.is_obstacle);
            // Nothing is nearer than a limit at infinity.
            !has_holes
                || obstacle_px == f64::INFINITY
                || maps.points(maps.above).tells_share(MIN_NEAR, is_near) == is_obstacle
        };
        Self {
            area: Some(area(&depth, floor, limits.rule)),
            quarter: quarter.filter(is_decided),
            sparse: None,
        }
    }
}

/// Limits of what is near in a frame.
#[derive(Clone, Copy)]
struct NearLimits<'a> {
    rule: CellRule,
    rig: Option<&'a Rig>,
    knows_floor: bool,
}

impl NearLimits<'_> {
    /// The disparities above which something is an obstacle, is not clear, and is not free.
    fn limits_px(&self) -> [f64; 3] {
        let (obstacle_m, clear_m) = self.rule.obstacle_and_clear_m();
        let limits_m = [Some(obstacle_m), Some(clear_m), self.rule.far_m()];
        let px = |m: Option<f64>| Some(self.rig?.disparity_px(m?));
        limits_m.map(|m| px(m).unwrap_or(f64::INFINITY))
    }
}

impl TrueQuarter {
    /// That of a cell's known disparities, `all` and those `above` the floor.
    fn new(all: &mut [f32], above: &[f32], limits: NearLimits<'_>) -> Self {
        let [obstacle_px, clear_px, far_px] = limits.limits_px();
        let beyond = |px: f64| move |d: f32| f64::from(d) > px;
        let rank = NEAR_PERCENT * all.len() / 100;
        let near = above.iter().filter(|&&d| beyond(obstacle_px)(d)).count();
        let not_free = share(all, beyond(far_px));
        let (_, near_px, _) = all.select_nth_unstable_by(rank, f32::total_cmp);
        Self {
            depth: Some(CellDepth::at(*near_px, limits.rig)),
            near: NearTruth {
                is_obstacle: near >= above.len() - rank,
                is_free: not_free < MAX_OCCUPIED,
                is_clear_floor: limits.knows_floor && !above.iter().any(|&d| beyond(clear_px)(d)),
            },
        }
    }

    /// `None` if the points do not determine it.
    fn from_points(
        points: &SparseCell,
        above: &SparseCell,
        limits: NearLimits<'_>,
    ) -> Option<Self> {
        let NearLimits { rule, rig, .. } = limits;
        let (obstacle_m, _) = rule.obstacle_and_clear_m();
        let [_, clear_px, far_px] = limits.limits_px();
        let range = above.range(NEAR_PERCENT).filter(|_| above.is_enough())?;
        let is_obstacle = match range {
            // The parts without points hold nothing nearer, or only floor.
            [FLOOR_PX, near_px] => {
                let near_m = rig.and_then(|rig| rig.depth_m(near_px.into()));
                near_m.is_none_or(|z| z >= obstacle_m).then_some(false)?
            }
            _ => {
                let near = above.percentile(NEAR_PERCENT, rule, rig)?;
                has_truth(&near, rule).then_some(())?;
                near.distance_m.is_some_and(|z| z < obstacle_m)
            }
        };
        let beyond = |px: f64| move |d: f32| f64::from(d) > px;
        Some(Self {
            depth: points
                .percentile(NEAR_PERCENT, rule, rig)
                .filter(|near| has_truth(near, rule)),
            near: NearTruth {
                is_obstacle,
                is_free: points.share(beyond(far_px)) < MAX_OCCUPIED,
                is_clear_floor: limits.knows_floor && above.share(beyond(clear_px)) == 0.0,
            },
        })
    }
}

impl CellTruth {
    /// Scores the report of a cell; a nearer surface is not looked for.
    pub fn judge(&self, cell: &Cell, rule: CellRule) -> CellJudgement {
        let median = self.median.as_ref();
        let near = self.near.map(|near| near.judge(cell, rule));
        CellJudgement {
            area: self.area,
            near: near.unwrap_or_default(),
            ..judge_cell(median, claimed(cell, median), rule)
        }
    }
}

impl NearTruth {
    /// Scores the report of a cell, the nearer of two surfaces, by its nearest quarter.
    fn judge(self, cell: &Cell, rule: CellRule) -> NearJudgement {
        let (obstacle_m, clear_m) = rule.obstacle_and_clear_m();
        let is_at_most = |limit_m: f64| cell.nearest_m().is_some_and(|z| z <= limit_m);
        let is_reported = is_at_most(clear_m) || cell.too_close || cell.near.is_some();
        let is_obstacle = is_at_most(obstacle_m.next_down());
        NearJudgement {
            is_known: true,
            is_near: self.is_obstacle,
            missed: self.is_obstacle && cell.depth.is_some() && !is_reported,
            found: self.is_obstacle && is_reported,
            falsely: is_reported && self.is_free,
            is_floor: is_obstacle && self.is_clear_floor,
        }
    }
}

/// The area of a cell with this median, of which this fraction is floor.
fn area(median: &CellDepth, floor: f64, rule: CellRule) -> CellArea {
    let is_beyond = |beyond_m| median.distance_m.is_none_or(|z| z > beyond_m);
    match rule {
        CellRule::Disparity { .. } => CellArea::Pixels,
        CellRule::Distance { .. } if floor >= MIN_FLOOR => CellArea::Floor,
        CellRule::Distance { .. } if rule.beyond_m().is_some_and(is_beyond) => CellArea::Beyond,
        CellRule::Distance { .. } => CellArea::Obstacle,
    }
}

/// The true disparities with floor at [`FLOOR_PX`].
fn above_floor(truth: &Truth) -> Cow<'_, Plane<f32>> {
    let Some(surfaces) = &truth.surface else {
        return Cow::Borrowed(&truth.disparity);
    };
    let mut above = truth.disparity.clone();
    for y in 0..above.height() {
        let pixels = above.row_mut(y).iter_mut().zip(surfaces.row(y));
        let floor = pixels.filter(|(d, surface)| is_known(d) && **surface == Surface::Floor);
        floor.for_each(|(d, _)| *d = FLOOR_PX);
    }
    Cow::Owned(above)
}

/// True for a disparity that is known, or floor.
fn is_known(disparity: &f32) -> bool {
    *disparity < f32::INFINITY
}

/// The known disparities of a cell.
fn known(map: &Plane<f32>, columns: &Range<usize>, rows: &Range<usize>) -> Vec<f32> {
    let mut known = Vec::with_capacity(rows.len() * columns.len());
    for row in rows.clone().map(|y| &map.row(y)[columns.clone()]) {
        if row.iter().all(is_known) {
            known.extend_from_slice(row);
        } else {
            known.extend(row.iter().copied().filter(is_known));
        }
    }
    known
}

/// The fraction of the values for which a function is true, 0..=1.
fn share(values: &[f32], is: impl Fn(f32) -> bool) -> f64 {
    values.iter().filter(|&&d| is(d)).count() as f64 / values.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judge::{AreaChoice, CellTally};
    use svl_core::stereo::TruthOrigin;
    use svl_core::stereo::{Geometry, Gray, StereoPair, TruthKind};

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
        let judged = |is_obstacle: bool, is_free: bool| {
            let quarter = NearTruth {
                is_obstacle,
                is_free,
                is_clear_floor: false,
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
        assert_eq!(judged(true, false), [(true, false), (false, false)]);
        assert_eq!(judged(false, true), [(false, true), (false, false)]);
        // Something is near, but less than a quarter of the cell.
        assert_eq!(judged(false, false), [(false, false), (false, false)]);
    }

    #[test]
    fn points_are_scored() {
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

    /// The median and the obstacle, if known, of a cell of 16 x 16 pixels at 10 px/m with that
    /// truth.
    fn holes(px: impl Fn(usize, usize) -> f32, origin: TruthOrigin) -> (Option<f32>, Option<bool>) {
        let kind = TruthKind {
            density: MapDensity::Dense,
            origin,
        };
        let mut frame = frame(Plane::from_fn(16, 16, px).unwrap(), kind);
        frame.geometry = Geometry::Rectified(Some(rig()));
        let cells = TrueCells::new(&frame, ONE_CELL, CellRule::default()).unwrap();
        let (_, truth) = cells.truths().next().unwrap();
        (
            truth.median.map(|depth| depth.median_px),
            truth.near.map(|near| near.is_obstacle),
        )
    }

    #[test]
    fn a_hole_that_could_move_the_median_is_no_truth() {
        // Rows of unknown sky, of a wall at 5 m, and of an obstacle at 0.5 m less a bit.
        let under_sky = |sky: usize, wall: usize| {
            move |_: usize, y: usize| match y {
                y if y < sky => f32::INFINITY,
                y if y < sky + wall => 2.0,
                _ => 21.0,
            }
        };
        let known = |sky, wall| holes(under_sky(sky, wall), TruthOrigin::Exact);
        // The sky could be far, with the wall half of the cell; 6 rows are an obstacle anyway.
        assert_eq!(known(6, 4), (None, Some(true)));
        // Whatever it is, half of the cell is the obstacle, or the wall.
        assert_eq!(known(4, 2), (Some(21.0), Some(true)));
        assert_eq!(known(2, 13), (Some(2.0), Some(false)));
        // Four rows of sky or more decide about the nearest quarter.
        assert_eq!(known(4, 12), (Some(2.0), None));
        // Parts with a known pixel have no holes, and references none at all.
        let few = |x, y| match under_sky(6, 4)(x, y) {
            px if px.is_finite() => px,
            _ if x % 2 + y % 2 == 0 => 2.0,
            unknown => unknown,
        };
        assert_eq!(holes(few, TruthOrigin::Exact), (Some(21.0), Some(true)));
    }

    #[test]
    fn without_distances_nothing_is_near_in_a_hole() {
        let below_sky = |_, y| if y < 8 { f32::INFINITY } else { 21.0 };
        let frame = frame(
            Plane::from_fn(16, 16, below_sky).unwrap(),
            TruthKind::default(),
        );
        let cells = TrueCells::new(&frame, ONE_CELL, RULE).unwrap();
        let (_, truth) = cells.truths().next().unwrap();
        assert!(truth.median.is_some() && !truth.near.unwrap().is_obstacle);
    }

    #[test]
    fn a_hole_beside_one_surface_changes_nothing() {
        let surface =
            |sky: usize| move |_: usize, y: usize| if y < sky { f32::INFINITY } else { 21.0 };
        for sky in 0..=8 {
            let (median, near) = holes(surface(sky), TruthOrigin::Exact);
            assert_eq!((median, near), (Some(21.0), Some(true)), "{sky}");
        }
    }

    /// The score of a map in the cell of a slanted surface of 40 rows, every fifth of which is
    /// known from row `first` on.
    fn slant(first: usize, px: impl Fn(usize) -> f32, map_px: f32) -> CellJudgement {
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
        cells.judge(&frame, &reported)[0]
    }

    #[test]
    fn a_report_is_compared_with_the_points() {
        // The points' median is 15, their 75th percentile 25.
        let floor = |map_px| slant(0, |y| y as f32, map_px);
        let right = floor(16.5);
        assert_eq!((right.verdict, right.points), (Verdict::Right, Some(128)));
        assert!(right.right_surface && right.near.is_known);
        assert_eq!(floor(17.5).verdict, Verdict::Wrong);
        // A quarter of the points is within 2 px of 20 to 30, in steps of 5.
        assert!([17.5, 24.0].iter().all(|px| !floor(*px).right_surface));
        // Twice the tolerance at 80 px: 5 % of it.
        let far = |map_px| slant(0, |_| 80.0, map_px);
        assert_eq!(far(84.0).verdict, Verdict::Right);
        assert_eq!(far(84.1).verdict, Verdict::Wrong);
    }

    #[test]
    fn median_and_nearest_quarter_are_scored_each_where_it_is_known() {
        let scored = |first, px: fn(usize) -> f32| {
            [10.0, 50.0].map(|map_px| {
                let judgement = slant(first, px, map_px);
                assert_eq!(judgement.points, Some((40 - first) / 5 * 16));
                // The same cells for all reports.
                (
                    judgement.verdict != Verdict::NoTruth,
                    judgement.near.is_known,
                )
            })
        };
        // Half of the parts, and three quarters.
        assert_eq!(scored(20, |_| 10.0), [(true, false); 2]);
        assert_eq!(scored(10, |_| 10.0), [(true, true); 2]);
        // The upper quarter is unknown; of the rest, a half or more than half is of one surface.
        assert_eq!(
            scored(10, |y| if y < 25 { 10.0 } else { 50.0 }),
            [(false, true); 2]
        );
        assert_eq!(
            scored(10, |y| if y < 35 { 10.0 } else { 50.0 }),
            [(true, false); 2]
        );
    }

    /// One metre is 10 px.
    fn rig() -> Rig {
        Rig::new(100.0, (5.0, 0.5), 0.1, 0.0).unwrap()
    }

    fn rule_beyond(beyond_m: Option<f64>) -> CellRule {
        CellRule::Distance {
            tolerance_m: 0.1,
            tolerance_percent: 20.0,
            obstacle_m: 0.5,
            clear_m: 0.75,
            beyond_m,
        }
    }

    /// The score of a report in a cell of ten pixels, each with its true distance and surface.
    /// Points are the same, eight times in every part.
    fn judged(
        pixels: [(f64, Surface); 10],
        density: MapDensity,
        beyond_m: Option<f64>,
        reported_m: f64,
    ) -> CellJudgement {
        let rule = rule_beyond(beyond_m);
        let disparity = Plane::from_fn(80, 8, |x, _| (10.0 / pixels[x / 8].0) as f32).unwrap();
        let surface = Plane::from_fn(80, 8, |x, _| pixels[x / 8].1).unwrap();
        let mut frame = frame(
            disparity,
            TruthKind {
                density,
                origin: TruthOrigin::Exact,
            },
        );
        frame.geometry = Geometry::Rectified(Some(rig()));
        frame.truth.as_mut().unwrap().surface = Some(surface);
        let report = Plane::filled(80, 8, (10.0 / reported_m) as f32).unwrap();
        let reported = depth::grid(&report, ONE_CELL.into(), frame.rig());
        let cells = TrueCells::new(&frame, ONE_CELL, rule).unwrap();
        cells.judge(&frame, &reported)[0]
    }

    /// `count` pixels of one kind, the others of another.
    fn cell(count: usize, first: (f64, Surface), others: (f64, Surface)) -> [(f64, Surface); 10] {
        std::array::from_fn(|i| if i < count { first } else { others })
    }

    const DENSITIES: [MapDensity; 2] = [MapDensity::Dense, MapDensity::Sparse];
    const WALL: (f64, Surface) = (0.4, Surface::Wall);
    const FLOOR: (f64, Surface) = (0.3, Surface::Floor);
    const FAR: (f64, Surface) = (3.0, Surface::Room);

    #[test]
    fn the_area_is_floor_from_half_of_the_cell_on_then_beyond() {
        let area = |pixels, beyond_m| {
            let areas = DENSITIES.map(|density| judged(pixels, density, beyond_m, 1.0).area);
            assert_eq!(areas[0], areas[1]);
            areas[0].unwrap()
        };
        assert_eq!(area(cell(5, FLOOR, WALL), Some(2.0)), CellArea::Floor);
        assert_eq!(area(cell(10, FAR, WALL), Some(2.0)), CellArea::Beyond);
        assert_eq!(area(cell(10, FAR, WALL), None), CellArea::Obstacle);
        assert_eq!(area(cell(10, WALL, FAR), Some(2.0)), CellArea::Obstacle);
        // Floor far away is floor.
        let far_floor = (3.0, Surface::Floor);
        assert_eq!(area(cell(6, far_floor, FAR), Some(2.0)), CellArea::Floor);
    }

    #[test]
    fn at_infinity_a_cell_is_beyond_if_something_is() {
        let infinity = CellDepth::at(0.0, Some(&rig()));
        let area = |beyond_m| area(&infinity, 0.0, rule_beyond(beyond_m));
        assert_eq!(
            [Some(2.0), None].map(area),
            [CellArea::Beyond, CellArea::Obstacle]
        );
    }

    #[test]
    fn an_obstacle_is_a_near_quarter_that_is_not_floor() {
        let near = |pixels, density| {
            let judgement = judged(pixels, density, None, 3.0);
            (judgement.near.is_known, judgement.near.is_near)
        };
        for density in DENSITIES {
            assert_eq!(near(cell(10, WALL, FAR), density), (true, true));
            assert_eq!(near(cell(10, FLOOR, FAR), density), (true, false));
        }
        let dense = |pixels| near(pixels, MapDensity::Dense).1;
        // A quarter of ten pixels is three.
        assert!(dense(cell(3, WALL, FAR)) && !dense(cell(2, WALL, FAR)));
        assert!(dense(cell(3, WALL, FLOOR)) && !dense(cell(2, WALL, FLOOR)));
    }

    #[test]
    fn stops_for_floor_are_counted_and_are_not_false() {
        let scores = |pixels, density, reported_m| {
            let near = judged(pixels, density, None, reported_m).near;
            (near.is_floor, near.falsely)
        };
        for density in DENSITIES {
            assert_eq!(scores(cell(10, FLOOR, FAR), density, 0.3), (true, false));
            assert_eq!(scores(cell(10, FLOOR, FAR), density, 0.6), (false, false));
            assert_eq!(scores(cell(10, FAR, FAR), density, 0.74), (false, true));
            assert_eq!(scores(cell(10, FAR, FAR), density, 0.76), (false, false));
            assert_eq!(scores(cell(9, FLOOR, WALL), density, 0.3), (false, false));
            assert_eq!(scores(cell(10, FAR, FAR), density, 0.3), (true, true));
        }
    }

    #[test]
    fn far_is_scored_and_is_never_near() {
        const SKY: (f64, Surface) = (f64::INFINITY, Surface::Room);
        for density in DENSITIES {
            let sky = |reported_m| judged(cell(10, SKY, FAR), density, Some(2.0), reported_m);
            // 0.83 px and 2 px.
            let verdicts = [f64::INFINITY, 12.0, 5.0].map(|m| sky(m).verdict);
            assert_eq!(verdicts, [Verdict::Right, Verdict::Right, Verdict::Wrong]);
            assert_eq!(sky(5.0).area, Some(CellArea::Beyond));
            let near = sky(0.3).near;
            assert!(near.is_known && !near.is_near && near.falsely);
            assert_eq!(sky(f64::INFINITY).near, sky(5.0).near);
            let wall = judged(cell(10, WALL, FAR), density, None, f64::INFINITY);
            assert_eq!(wall.verdict, Verdict::Wrong);
            assert!(wall.near.missed && !wall.near.found && !wall.near.falsely);
        }
    }

    #[test]
    fn the_nearer_surface_may_be_named_from_a_quarter_on() {
        let right = |near: usize, reported_m| {
            let judgement = judged(cell(near, WALL, FAR), MapDensity::Dense, None, reported_m);
            let tally = CellTally::from_judgements([&judgement]);
            assert_eq!(tally.right_surface + tally.wrong_surface, 1);
            judgement.right_surface
        };
        assert!(right(3, 0.4) && !right(2, 0.4));
        // The farther one is the median.
        assert!(right(3, 3.0) && !right(7, 3.0));
    }

    #[test]
    fn areas_are_disjoint_and_add_up() {
        let cells = [
            cell(10, WALL, FAR),
            cell(10, FLOOR, FAR),
            cell(10, FAR, FAR),
            cell(6, FAR, FLOOR),
        ];
        let cells = cells.map(|pixels| judged(pixels, MapDensity::Dense, Some(2.0), 0.4));
        let tally = |choice: AreaChoice| {
            CellTally::from_judgements(cells.iter().filter(|cell| choice.has(cell.area)))
        };
        assert_eq!(
            AreaChoice::ALL.map(|choice| tally(choice).scored()),
            [1, 1, 2, 4]
        );
        assert_eq!(
            AreaChoice::ALL.map(|choice| tally(choice).right),
            [1, 1, 0, 2]
        );
    }
}
