//! A test piece in view: from where on does an algorithm always see it?
//!
//! Terms: *test piece* as in IEC TS 61496-4-3 and ANSI/ITSDF B56.5, *reach* as a tolerance limit
//! (Wilks 1941), the greatest distance from which 95 % of the approaches see it, with a confidence
//! of 95 %.

use super::truth::TrueCells;
use serde::{Deserialize, Serialize};
use svl_core::stereo::{
    Cell, CellDepth, CellRule, CellState, DepthGrid, Frame, GridShape, MapDensity, Plane, Rig,
    Surface, Truth, TruthOrigin,
};
use svl_core::{Error, Result};

/// Width and height of test pieces, metres: `[piece]` of a scenario.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PieceConfig {
    /// The seeds of the arena draw them in turn; recordings have one.
    pub sizes_m: Vec<[f64; 2]>,
    /// Nearer pairs do not count [default: `obstacle_m`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub near_m: Option<f64>,
}

/// The test piece of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TestPiece {
    pub size_m: [f64; 2],
    pub near_m: f64,
    /// True in the arena, whose only object it is.
    pub is_only_object: bool,
}

/// Largest difference of the width of a region from that of the piece: a part of it, or pixels.
const WIDTH_PART: f64 = 0.25;
const WIDTH_PX: f64 = 2.0;
/// Least part of the piece's height that a region has: at its foot the floor is as near.
const MIN_HEIGHT: f64 = 0.3;
/// Fewest pixels of a piece in view, and least width of one at the nearest distance that counts.
const MIN_PIXELS: usize = 6;
const MIN_WIDTH_PX: f64 = 3.0;
/// Part of the piece's pixels that are nearer than its distance, and of a cell's pixels than the
/// nearest truth that a false report is compared with.
const NEAREST: f64 = 0.1;
const NEAREST_OF_CELL: f64 = 0.05;
/// Largest part of a witness that is something else and not farther.
const CLEAR: f64 = 0.05;

/// A piece as a frame shows it, in the cells of a grid.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PieceView {
    /// Distance of its nearest tenth, metres; `None` unless it is in view.
    pub distance_m: Option<f64>,
    /// True for the cells that show it and nothing else that is as near, in raster order.
    witnesses: Vec<bool>,
    /// The mirrored cells of these, if nothing is as near there.
    mirrored: Vec<bool>,
    /// Per cell the distance of its nearest twentieth, if that is known.
    nearest_m: Vec<Option<f64>>,
}

/// A frame with a test piece through an algorithm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PieceSight {
    pub is_seen: bool,
    /// True if it would be seen in the mirrored cells, where it is not.
    pub is_by_chance: bool,
    /// True if the true distances of the cells see it.
    pub exact_sees: bool,
    /// Number of cells that are reported nearer than anything in them.
    pub false_cells: usize,
    /// True if one of these is in the robot's way and nearer than clear space.
    pub is_stop: bool,
}

impl PieceConfig {
    const SIZES_M: std::ops::RangeInclusive<f64> = 0.005..=5.0;
    const NEAR_M: std::ops::RangeInclusive<f64> = 0.05..=50.0;

    /// # Errors
    /// [`Error::Invalid`] with the key and its range.
    pub fn validate(&self) -> Result<()> {
        let wrong = |what: String| Err(Error::Invalid(format!("piece: {what}")));
        if self.sizes_m.is_empty() || self.sizes_m.len() > 100 {
            return wrong("sizes_m = [[width, height], …] names 1 to 100 pieces".to_owned());
        }
        let mut sides = self.sizes_m.iter().flatten();
        if let Some(side) = sides.find(|side| !Self::SIZES_M.contains(side)) {
            return wrong(format!("sizes_m has {side}: a side is 0.005 to 5 m"));
        }
        match self.near_m.filter(|near| !Self::NEAR_M.contains(near)) {
            Some(near) => wrong(format!("near_m = {near} is not from 0.05 to 50 m")),
            None => Ok(()),
        }
    }

    /// The number of the piece of the run with that seed, or of a recording.
    pub fn number(&self, seed: Option<u64>) -> usize {
        (seed.unwrap_or_default() % self.sizes_m.len() as u64) as usize
    }

    /// The piece of the run with that seed, or of a recording.
    pub fn piece(&self, seed: Option<u64>, rule: CellRule) -> TestPiece {
        TestPiece {
            size_m: self.sizes_m[self.number(seed)],
            near_m: self.near_m.unwrap_or(rule.obstacle_and_clear_m().0),
            is_only_object: seed.is_some(),
        }
    }
}

/// Width and height, as `10 x 20 cm`.
pub fn size_words(size_m: [f64; 2]) -> String {
    let [width, height] = size_m.map(|m| (1000.0 * m).round() / 10.0);
    format!("{width} x {height} cm")
}

impl TestPiece {
    /// The distance of the piece in a frame that does not show it to an algorithm, if it counts.
    pub fn unseen_m(&self, view: &PieceView, sight: &PieceSight) -> Option<f64> {
        let counts = |m: &f64| *m > self.near_m && !sight.is_seen;
        view.distance_m.filter(counts)
    }

    /// Refuses a frame in which no piece can be found.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the cure.
    pub fn check(&self, frame: &Frame) -> Result<()> {
        let Some(rig) = frame.rig() else {
            return Err(Error::Invalid(
                "a test piece has a size in metres, and the pairs have no calibration: --calib FILE"
                    .to_owned(),
            ));
        };
        let is_sparse = |truth: &Truth| truth.kind.density == MapDensity::Sparse;
        if frame
            .truth
            .as_ref()
            .is_some_and(|own| is_sparse(own) && !is_board(own))
        {
            return Err(Error::Invalid(
                "a test piece is found in a dense truth, and this one is of points: --truth with a \
                 depth image, or a board on the piece"
                    .to_owned(),
            ));
        }
        let width_px = rig.focal_px() * self.size_m[0] / self.near_m;
        if width_px < MIN_WIDTH_PX {
            return Err(Error::Invalid(format!(
                "piece: {} m is {width_px:.1} px wide at {} m; at least 3 px are needed: a wider \
                 piece, larger images or a smaller near_m",
                self.size_m[0], self.near_m
            )));
        }
        Ok(())
    }

    /// The piece in a frame with a dense truth and a rig.
    pub fn view(&self, frame: &Frame, shape: GridShape, rule: CellRule) -> Option<PieceView> {
        let (truth, rig) = (frame.truth.as_ref()?, frame.rig()?);
        let depth = truth.disparity.map(|d| {
            let known = d.is_finite().then(|| rig.depth_m(d.into()));
            // Beyond infinity as at infinity; unknown is NaN.
            known.map_or(f64::NAN, |m| m.unwrap_or(f64::INFINITY)) as f32
        });
        let mask = match &truth.surface {
            Some(surface) if self.is_only_object => Some(surface.map(|s| s == Surface::Object)),
            // The board alone has a truth.
            _ if is_board(truth) => Some(depth.map(|m| !m.is_nan())),
            _ => self.region(&depth, rig, rule),
        };
        let size = depth.size();
        let pixels = |place| {
            let (columns, rows) = shape.pixels(place, size);
            rows.flat_map(move |y| columns.clone().map(move |x| (x, y)))
        };
        let nearest_m = shape.iter().map(|place| {
            let values = pixels(place).map(|(x, y)| depth.get(x, y));
            nearest(values.filter(|m| !m.is_nan()).collect(), NEAREST_OF_CELL)
        });
        let mut view = PieceView {
            nearest_m: nearest_m.collect(),
            ..PieceView::default()
        };
        let Some(mask) = mask else {
            return Some(view);
        };
        let own = mask.pixels().zip(depth.pixels());
        let own: Vec<_> = own
            .filter(|(is, m)| *is && m.is_finite())
            .map(|own| own.1)
            .collect();
        if own.len() < MIN_PIXELS {
            return Some(view);
        }
        let distance_m = nearest(own, NEAREST)?;
        let limit_m = (distance_m + rule.tolerance_at_m(distance_m)) as f32;
        let is_beside_far = |m: f32| m > limit_m || m.is_nan() && is_board(truth);
        let outstanding = outstanding(&mask, &depth, is_beside_far);
        // Per cell: pixels that stand out, other ones that are not farther, and all.
        let counts = shape.iter().map(|place| {
            pixels(place).fold([0; 3], |[own, other, all], (x, y)| {
                let stands = outstanding.get(x, y);
                let is_near = !stands && depth.get(x, y) <= limit_m;
                [
                    own + usize::from(stands),
                    other + usize::from(is_near),
                    all + 1,
                ]
            })
        });
        let counts: Vec<[usize; 3]> = counts.collect();
        view.distance_m = Some(distance_m);
        let is_witness =
            |[own, other, all]: [usize; 3]| own > 0 && (other as f64) < CLEAR * all as f64;
        view.witnesses = counts.iter().copied().map(is_witness).collect();
        let mirrored = shape.iter().enumerate().map(|(i, (column, row))| {
            let [own, other, _] = counts[i];
            let opposite = row * shape.columns + shape.columns - 1 - column;
            // Nothing is known to be free without a truth.
            let is_free = own == 0 && other == 0 && view.nearest_m[i].is_some();
            is_free && view.witnesses[opposite]
        });
        view.mirrored = mirrored.collect();
        Some(view)
    }

    /// The only region of the width and the height of the piece that is nearer than what is beside
    /// it; `None` without one, or with two.
    fn region(&self, depth: &Plane<f32>, rig: &Rig, rule: CellRule) -> Option<Plane<bool>> {
        let (width, height) = depth.size();
        let is_nearer = |m: f32, other: f32| {
            !m.is_nan() && f64::from(other - m) > rule.tolerance_at_m(m.into())
        };
        // Runs of a row: first and last column, and the region that they belong to.
        let mut regions: Vec<Vec<(usize, usize, usize)>> = Vec::new();
        let mut above: Vec<(usize, usize, usize)> = Vec::new();
        for y in 0..height {
            let row = depth.row(y);
            let (mut start, mut found) = (None, Vec::new());
            for x in 1..width - 1 {
                if is_nearer(row[x], row[x - 1]) {
                    start = Some(x);
                }
                if !is_nearer(row[x], row[x + 1]) {
                    continue;
                }
                let Some(first) = start.take() else { continue };
                // Each edge at its own distance: the side of a box is seen beside its front.
                let edge_m =
                    |edge: f64, at: usize| rig.point_m((edge - 0.5, 0.0), row[at].into())[0];
                let width_m = edge_m((x + 1) as f64, x) - edge_m(first as f64, first);
                let pixel_m = f64::from(row[x]) / rig.focal_px();
                let most_m = (WIDTH_PART * self.size_m[0]).max(WIDTH_PX * pixel_m);
                if (width_m - self.size_m[0]).abs() <= most_m {
                    found.push((first, x));
                }
            }
            let runs = found.into_iter().map(|(first, last)| {
                let mut touching = above.iter();
                let own = touching.find(|(from, to, _)| first <= *to && *from <= last);
                let region = own.map_or(regions.len(), |own| own.2);
                if region == regions.len() {
                    regions.push(Vec::new());
                }
                regions[region].push((y, first, last));
                (first, last, region)
            });
            above = runs.collect();
        }
        let is_high = |runs: &&Vec<(usize, usize, usize)>| {
            let (y, first, _) = runs[0];
            let expected = rig.focal_px() * self.size_m[1] / f64::from(depth.get(first, y));
            runs.len() as f64 >= MIN_HEIGHT * expected
        };
        let mut regions = regions.iter().filter(is_high);
        let (own, None) = (regions.next()?, regions.next()) else {
            return None;
        };
        let mut mask = Plane::filled(width, height, false).ok()?;
        for &(y, first, last) in own {
            (first..=last).for_each(|x| mask.set(x, y, true));
        }
        Some(mask)
    }
}

/// True of the truth of a printed board.
fn is_board(truth: &Truth) -> bool {
    matches!(truth.kind.origin, TruthOrigin::Board(_))
}

/// The pixels of a piece in rows in which both neighbours of it are far.
fn outstanding(mask: &Plane<bool>, depth: &Plane<f32>, far: impl Fn(f32) -> bool) -> Plane<bool> {
    let (width, height) = mask.size();
    let rows: Vec<bool> = (0..height)
        .map(|y| {
            let row = mask.row(y);
            let ends = row
                .iter()
                .position(|own| *own)
                .zip(row.iter().rposition(|own| *own));
            ends.is_some_and(|(first, last)| {
                let is_far = |x: usize| x >= width || far(depth.get(x, y));
                is_far(first.wrapping_sub(1)) && is_far(last + 1)
            })
        })
        .collect();
    let mut own = mask.clone();
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        own.set(x, y, mask.get(x, y) && rows[y]);
    }
    own
}

/// The value that a part of all are nearer than.
fn nearest(mut values: Vec<f32>, part: f64) -> Option<f64> {
    let rank = (part * values.len() as f64) as usize;
    (rank < values.len()).then(|| f64::from(*values.select_nth_unstable_by(rank, f32::total_cmp).1))
}

impl PieceView {
    /// True for a cell, by its number in raster order, that shows the piece alone.
    fn is_witness(&self, cell: usize) -> bool {
        self.witnesses.get(cell) == Some(&true)
    }

    /// The distance of the piece, of a cell that shows it alone.
    pub fn shown_m(&self, cell: usize) -> Option<f64> {
        self.distance_m.filter(|_| self.is_witness(cell))
    }

    /// The sight of the algorithm that reports a grid.
    pub fn sight(&self, grid: &DepthGrid, truth: Option<&TrueCells>, rule: CellRule) -> PieceSight {
        let shape = grid.shape();
        let (obstacle_m, clear_m) = rule.obstacle_and_clear_m();
        let own = |depth: Option<CellDepth>| depth.and_then(|own| own.distance_m);
        let agrees = |m: Option<f64>| {
            let off = m.zip(self.distance_m).map(|(m, own)| (m - own).abs());
            off.is_some_and(|off| off <= rule.tolerance_at_m(self.distance_m.unwrap_or_default()))
        };
        let sees = |cell: &Cell| {
            let is_near = [CellState::Near, CellState::TooClose].contains(&cell.state());
            let surface_m = cell.surface.map(|surface| surface.distance_m);
            let is_nearer = is_near && self.distance_m < Some(obstacle_m);
            is_nearer || agrees(own(cell.depth)) || agrees(surface_m)
        };
        let mut sight = PieceSight::default();
        for (i, ((column, _), cell)) in grid.iter().enumerate() {
            sight.is_seen |= self.is_witness(i) && sees(cell);
            sight.is_by_chance |= self.mirrored.get(i) == Some(&true) && sees(cell);
            let reported = cell.nearest_m();
            let nearest = self.nearest_m.get(i).copied().flatten();
            let is_false = reported
                .zip(nearest)
                .is_some_and(|(m, nearest)| m < nearest - rule.tolerance_at_m(nearest));
            sight.false_cells += usize::from(is_false);
            let is_ahead = (shape.columns..2 * shape.columns).contains(&(3 * column + 1));
            sight.is_stop |= is_false && is_ahead && reported < Some(clear_m);
        }
        if let Some(truth) = truth {
            let mut medians = truth.grid().iter().enumerate();
            sight.exact_sees =
                medians.any(|(i, (_, median))| self.is_witness(i) && agrees(own(median.depth)));
        }
        sight
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::depth;
    use svl_core::stereo::{Geometry, Gray, StereoPair};

    const SIZE: (usize, usize) = (40, 20);
    /// Cells of four columns.
    const SHAPE: GridShape = GridShape {
        columns: 10,
        rows: 1,
    };
    const PIECE: TestPiece = TestPiece {
        size_m: [0.06, 0.16],
        near_m: 0.5,
        is_only_object: false,
    };

    fn rig() -> Rig {
        Rig::new(100.0, (20.0, 10.0), 0.1, 0.0).unwrap()
    }

    /// A wall at 4 m, with things before it: columns, rows and distance of each.
    fn map(things: &[(std::ops::Range<usize>, std::ops::Range<usize>, f32)]) -> Plane<f32> {
        Plane::from_fn(SIZE.0, SIZE.1, |x, y| {
            let mut things = things.iter();
            let own = things.find(|own| own.0.contains(&x) && own.1.contains(&y));
            10.0 / own.map_or(4.0, |own| own.2)
        })
        .unwrap()
    }

    fn frame(truth: Plane<f32>) -> Frame {
        let image = Gray::from_fn(SIZE.0, SIZE.1, |_, _| 0).unwrap();
        let pair = StereoPair::new(image.clone(), image).unwrap();
        Frame {
            truth: Some(Truth::exact(truth, None)),
            ..Frame::new(pair, Geometry::Rectified(Some(rig())))
        }
    }

    /// How a report sees the piece at 1 m in columns 4 to 10.
    fn sight(reported: &Plane<f32>) -> PieceSight {
        let rule = CellRule::default();
        let frame = frame(map(&[(4..10, 2..18, 1.0)]));
        let view = PIECE.view(&frame, SHAPE, rule).unwrap();
        assert_eq!(view.distance_m, Some(1.0));
        let shown = (0..10).filter(|cell| view.shown_m(*cell).is_some());
        assert_eq!(shown.collect::<Vec<_>>(), [1, 2]);
        let truth = TrueCells::new(&frame, SHAPE, rule);
        let grid = depth::grid(reported, SHAPE.into(), Some(&rig()));
        view.sight(&grid, truth.as_ref(), rule)
    }

    #[test]
    fn a_piece_is_seen_by_its_own_cells_and_by_chance_by_the_mirrored_ones() {
        let exact = PieceSight {
            is_seen: true,
            exact_sees: true,
            ..PieceSight::default()
        };
        assert_eq!(sight(&map(&[(4..10, 2..18, 1.0)])), exact);
        // The tolerance is 0.2 m.
        assert!(sight(&map(&[(4..8, 2..18, 1.19)])).is_seen);
        assert!(!sight(&map(&[(4..8, 2..18, 1.3)])).is_seen);
        let wall = sight(&map(&[]));
        assert!(!wall.is_seen && wall.false_cells == 0);
        let mirrored = sight(&map(&[(28..36, 0..20, 1.0)]));
        assert!(!mirrored.is_seen && mirrored.is_by_chance);
        assert_eq!((mirrored.false_cells, mirrored.is_stop), (2, false));
        // Ahead, and nearer than clear space.
        let ahead = sight(&map(&[(16..20, 0..20, 0.6)]));
        assert_eq!((ahead.false_cells, ahead.is_stop), (1, true));
        let far_ahead = sight(&map(&[(16..20, 0..20, 0.8)]));
        assert_eq!((far_ahead.false_cells, far_ahead.is_stop), (1, false));
    }

    #[test]
    fn only_one_region_of_the_size_is_the_piece() {
        let found = |things: &[_]| {
            let view = PIECE.view(&frame(map(things)), SHAPE, CellRule::default());
            view.unwrap().distance_m
        };
        let own = (4..10, 2..18, 1.0);
        // Wider, lower, and two of it.
        assert_eq!(found(&[(4..18, 2..18, 1.0)]), None);
        assert_eq!(found(&[(4..10, 2..5, 1.0)]), None);
        assert_eq!(found(&[own.clone(), (30..36, 2..18, 1.0)]), None);
        assert_eq!(found(&[own.clone(), (20..34, 2..18, 1.5)]), Some(1.0));
        // The side of a box, 0.36 m deep, is seen beside its front.
        let side = [(27, 1.357), (28, 1.188), (29, 1.056)].map(|(x, m)| (x..x + 1, 2..18, m));
        assert_eq!(
            found(&[&side[..], &[(30..36, 2..18, 1.0)]].concat()),
            Some(1.0)
        );
        assert_eq!(found(&[(27..36, 2..18, 1.0)]), None);
        // Floor as near at its foot: the part above it stands out.
        let view = PIECE.view(
            &frame(map(&[own, (0..40, 14..20, 1.0)])),
            SHAPE,
            CellRule::default(),
        );
        assert_eq!(view.unwrap().distance_m, Some(1.0));
    }
}
