//! Stixels: a disparity map as vertical pieces of objects and of the ground.
//!
//! Badino, Franke and Pfeiffer, "The Stixel World", DAGM 2009; in the form with several objects
//! above each other of Pfeiffer and Franke, "Towards a Global Optimal Multi-Layer Stixel
//! Representation of Dense 3D Data", BMVC 2011. Each column of a few pixels is divided into
//! segments by dynamic programming: on an object the disparity is constant, on the ground it falls
//! linearly towards the horizon. The segmentation with the least cost explains the disparities by
//! few segments in a plausible order.
//!
//! Departures from the papers: costs are capped squares, not mixtures of distributions; pixels
//! without a disparity cost nothing, and segments end at their outermost rows with one; there is no
//! sky; the ground is a plane fitted to each map ([`GroundPlane`]), not that of a known camera.

mod ground;
mod segments;

pub use ground::GroundPlane;

use super::grid::{GridSettings, grid};
use crate::stereo::{DepthGrid, Plane, Rig};
use segments::Segmentation;
use std::ops::Range;

/// A vertical piece of the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Stixel {
    /// Pixels of the left image.
    pub columns: Range<usize>,
    pub rows: Range<usize>,
    pub is_ground: bool,
    /// Disparity at the middle row, pixels.
    pub disparity_px: f32,
    /// Change of the disparity from a row to the next below it, pixels; 0 on an object.
    pub slope: f32,
    /// Fraction of its rows with disparities, 0..=1.
    pub support: f32,
}

impl Stixel {
    /// The disparity in a row.
    pub fn at(&self, row: usize) -> f32 {
        let middle = 0.5 * (self.rows.start + self.rows.end - 1) as f32;
        self.disparity_px + self.slope * (row as f32 - middle)
    }
}

/// Stixels of an image, left to right and bottom to top.
#[derive(Clone, Debug, PartialEq)]
pub struct Stixels {
    pub stixels: Vec<Stixel>,
    /// The ground, if a plane was found.
    pub ground: Option<GroundPlane>,
}

/// Greatest number of blocks in a row and in a column; their medians are the measurements.
const BLOCKS: (usize, usize) = (64, 120);
/// Least fraction of an object's rows with disparities; that of the ground, whose plane is fitted
/// to all columns; and the fewest rows of blocks of either.
const OBJECT_SUPPORT: f32 = 0.5;
const GROUND_SUPPORT: f32 = 0.25;
const MIN_BLOCKS: usize = 3;

impl Stixels {
    /// The stixels of a disparity map, pixels, infinite where unknown.
    pub fn new(disparity: &Plane<f32>) -> Self {
        let (width, height) = disparity.size();
        let block = (width.div_ceil(BLOCKS.0), height.div_ceil(BLOCKS.1));
        let measured = medians(disparity, block);
        let ground = GroundPlane::fit(&measured).map(|plane| plane.for_pixels(block));
        let mut stixels = Vec::new();
        let mut segmentation = Segmentation::new(&measured);
        for column in 0..measured.width() {
            let columns = column * block.0..((column + 1) * block.0).min(width);
            let x = 0.5 * (columns.start + columns.end - 1) as f32;
            let middle = |row: usize| {
                let end = ((row + 1) * block.1).min(height);
                0.5 * (row * block.1 + end - 1) as f32
            };
            let expected = |row: usize| ground.map(|plane| plane.at(x, middle(row)));
            for segment in segmentation.column(column, expected) {
                let rows = segment.rows.start * block.1..(segment.rows.end * block.1).min(height);
                let support = segment.measured as f32 / segment.rows.len() as f32;
                let least = match segment.object_px {
                    Some(_) => OBJECT_SUPPORT,
                    None => GROUND_SUPPORT,
                };
                if segment.measured < MIN_BLOCKS || support < least {
                    continue;
                }
                let center = 0.5 * (rows.start + rows.end - 1) as f32;
                let (disparity_px, slope) = match (segment.object_px, ground) {
                    (None, Some(plane)) => (plane.at(x, center), plane.per_row),
                    (object_px, _) => (object_px.unwrap_or_default(), 0.0),
                };
                stixels.push(Stixel {
                    columns: columns.clone(),
                    rows,
                    is_ground: segment.object_px.is_none(),
                    disparity_px,
                    slope,
                    support,
                });
            }
        }
        Self { stixels, ground }
    }

    /// The disparities of the stixels as a map of that size, infinite between them.
    ///
    /// # Panics
    /// If the size is not that of the map that they come from.
    pub fn render(&self, (width, height): (usize, usize)) -> Plane<f32> {
        let mut map =
            Plane::filled(width, height, f32::INFINITY).expect("the map that they come from");
        for stixel in &self.stixels {
            for y in stixel.rows.clone() {
                map.row_mut(y)[stixel.columns.clone()].fill(stixel.at(y));
            }
        }
        map
    }
}

/// The grid of medians of a map's stixels.
pub(super) fn stixel_grid(
    disparity: &Plane<f32>,
    settings: GridSettings,
    rig: Option<&Rig>,
) -> DepthGrid {
    let map = Stixels::new(disparity).render(disparity.size());
    grid(&map, settings, rig)
}

/// Medians of blocks of pixels, infinite where less than half have a disparity.
fn medians(disparity: &Plane<f32>, block: (usize, usize)) -> Plane<f32> {
    let (width, height) = disparity.size();
    let mut values = Vec::with_capacity(block.0 * block.1);
    let mut median = |column: usize, row: usize| {
        values.clear();
        let columns = column * block.0..((column + 1) * block.0).min(width);
        let rows = row * block.1..((row + 1) * block.1).min(height);
        // Blocks at the right and the bottom may be smaller.
        let pixels = columns.len() * rows.len();
        for y in rows {
            let row = &disparity.row(y)[columns.clone()];
            values.extend(row.iter().filter(|d| d.is_finite()));
        }
        if 2 * values.len() < pixels || values.is_empty() {
            return f32::INFINITY;
        }
        let middle = values.len() / 2;
        *values.select_nth_unstable_by(middle, f32::total_cmp).1
    };
    let (columns, rows) = (width.div_ceil(block.0), height.div_ceil(block.1));
    let medians = (0..columns * rows).map(|i| median(i % columns, i / columns));
    Plane::from_vec(columns, rows, medians.collect()).expect("fewer blocks than pixels")
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (320, 240);

    /// A floor with its horizon at row 80, a wall at 8 px, and a box of 24 px that stands on the
    /// floor; the head rolls.
    fn scene(x: usize, y: usize) -> f32 {
        let floor = 0.25 * (y as f32 - 80.0) + 0.01 * (x as f32 - 160.0);
        match (x, y) {
            (100..160, 90..) => floor.max(24.0),
            _ => floor.max(8.0),
        }
    }

    fn stixels(scene: impl Fn(usize, usize) -> f32) -> Stixels {
        Stixels::new(&Plane::from_fn(SIZE.0, SIZE.1, scene).unwrap())
    }

    /// The greatest error of the map, and the fraction of its pixels without a stixel.
    fn compare(stixels: &Stixels, scene: impl Fn(usize, usize) -> f32) -> (f32, f64) {
        let map = stixels.render(SIZE);
        let (mut worst, mut missing) = (0.0_f32, 0);
        for y in 0..SIZE.1 {
            for x in 0..SIZE.0 {
                match map.get(x, y) {
                    d if d.is_finite() => worst = worst.max((d - scene(x, y)).abs()),
                    _ => missing += 1,
                }
            }
        }
        (worst, f64::from(missing) / (SIZE.0 * SIZE.1) as f64)
    }

    #[test]
    fn a_box_on_the_floor_in_front_of_a_wall() {
        let stixels = stixels(scene);
        let ground = stixels.ground.unwrap();
        assert!((ground.per_row - 0.25).abs() < 0.01, "{ground:?}");
        assert!((ground.per_column - 0.01).abs() < 0.002, "{ground:?}");
        let (worst, missing) = compare(&stixels, scene);
        assert!(worst < 1.5 && missing < 0.01, "{worst} {missing}");
        // Through the box: the floor, the box, the wall.
        let column: Vec<_> = stixels
            .stixels
            .iter()
            .filter(|stixel| stixel.columns.contains(&130))
            .map(|stixel| (stixel.is_ground, stixel.disparity_px.round()))
            .collect();
        assert_eq!(column[1..], [(false, 24.0), (false, 8.0)]);
        assert!(column[0].0);
    }

    #[test]
    fn a_steep_floor_is_ground() {
        // 1.5 pixels a row: 330 at the bottom.
        let steep = |_: usize, y: usize| (1.5 * (y as f32 - 19.5)).max(6.0);
        let stixels = stixels(steep);
        let ground = stixels.ground.unwrap();
        assert!((ground.per_row - 1.5).abs() < 0.02, "{ground:?}");
        let (worst, missing) = compare(&stixels, steep);
        assert!(worst < 3.0 && missing < 0.05, "{worst} {missing}");
    }

    #[test]
    fn holes_and_outliers_do_not_matter() {
        // A third of the pixels has no disparity, in every ninth block all are wrong.
        let spoiled = |x: usize, y: usize| match (x / 5, y / 2) {
            _ if (7 * x + 3 * y).is_multiple_of(3) => f32::INFINITY,
            (a, b) if (a + 4 * b).is_multiple_of(9) => 60.0,
            _ => scene(x, y),
        };
        let (worst, missing) = compare(&stixels(spoiled), scene);
        assert!(worst < 2.5 && missing < 0.08, "{worst} {missing}");
    }

    #[test]
    fn stixels_of_a_column_do_not_overlap() {
        // No scene at all: disparities without an order.
        let noise = |x: usize, y: usize| match (x * 7919 + y * 104_729) % 97 {
            n if n < 50 => n as f32,
            _ => f32::INFINITY,
        };
        for scene in [&noise as &dyn Fn(usize, usize) -> f32, &scene] {
            let stixels = stixels(scene).stixels;
            for pair in stixels.windows(2) {
                let [lower, upper] = pair else { unreachable!() };
                let is_above = upper.rows.end <= lower.rows.start;
                assert!(
                    lower.columns != upper.columns || is_above,
                    "{lower:?} {upper:?}"
                );
            }
            let inside = |s: &Stixel| s.columns.end <= SIZE.0 && s.rows.end <= SIZE.1;
            assert!(stixels.iter().all(inside));
        }
    }

    #[test]
    fn nothing_seen_has_no_stixels_and_every_size_is_possible() {
        let none = stixels(|_, _| f32::INFINITY);
        assert_eq!((none.stixels.len(), none.ground), (0, None));
        for (width, height) in [(1, 1), (1, 200), (200, 1), (7, 5), (65, 121), (641, 479)] {
            let map = Plane::from_fn(width, height, |x, y| (x + y) as f32).unwrap();
            Stixels::new(&map).render((width, height));
            let map = Plane::from_fn(width, height, |_, _| -2.0).unwrap();
            Stixels::new(&map).render((width, height));
        }
    }

    #[test]
    fn the_last_block_may_be_smaller() {
        // Blocks of 11 x 5 pixels: the last column has three, the last row two.
        let size = (641, 482);
        let map = Plane::from_fn(size.0, size.1, |_, _| 20.0).unwrap();
        let stixels = Stixels::new(&map);
        assert!(stixels.render(size).pixels().all(|d| d == 20.0));
    }

    #[test]
    fn cells_report_the_median_of_their_stixels() {
        let map = Plane::from_fn(SIZE.0, SIZE.1, scene).unwrap();
        let settings = GridSettings {
            decision: crate::depth::CellDecision::Stixels,
            ..GridSettings::default()
        };
        let left = crate::stereo::Gray::filled(SIZE.0, SIZE.1, 0).unwrap();
        let rule = crate::stereo::CellRule::default();
        let grid = crate::depth::cells(&map, &left, settings, rule, None);
        // Of the scene itself, which has no gaps.
        let medians = super::grid(&map, settings, None);
        for ((place, cell), (_, median)) in grid.iter().zip(medians.iter()) {
            let [a, b] = [cell, median].map(|cell| cell.depth.unwrap().median_px);
            assert!((a - b).abs() < 1.0, "{place:?}: {a} {b}");
        }
    }
}
