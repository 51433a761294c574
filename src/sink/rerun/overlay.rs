//! The thesis's picture of a depth grid (figures 5.8d and 7.3, table 5.1): squares on the left image.
//!
//! In every cell a red square, centred, as large as the cell's median is near: at [`Scale::near_px`] it fills the cell,
//! twice as far it has half the cell's sides. A yellow square shows the 20th percentile and a violet one the 80th in
//! the same way: the closer the three, the surer the depth. A red dot: unknown.

use super::scale::Scale;
use crate::stereo::{Cell, CellDepth, DepthGrid, GridShape, Plane, Rig};
use ::rerun::{Boxes2D, LineStrips2D, Points2D, Radius, Rgba32};

const RED: Rgba32 = Rgba32::from_rgb(240, 40, 40);
const YELLOW: Rgba32 = Rgba32::from_rgb(255, 221, 50);
const VIOLET: Rgba32 = Rgba32::from_rgb(186, 85, 255);
const WHITE: Rgba32 = Rgba32::from_unmultiplied_rgba(255, 255, 255, 110);

/// Share of a cell's pixels that must be known for its depth to be (as for the estimates, spec of the depth grid).
const MIN_VALID: f64 = 0.2;

/// A square of the overlay, in pixels of the left image: the outer edge of pixel (0, 0) is at (0, 0).
#[derive(Clone, Copy, Debug, PartialEq)]
struct Square {
    center: [f32; 2],
    half_size: [f32; 2],
}

/// A cell's square for a disparity: the cell shrunk about its centre by the disparity's nearness.
fn square(shape: GridShape, cell: (usize, usize), size: (usize, usize), nearness: f64) -> Square {
    let (x, y) = shape.pixels(cell, size);
    let center = [(x.start + x.end) as f32 / 2.0, (y.start + y.end) as f32 / 2.0];
    let half = |length: usize| (nearness * length as f64 / 2.0) as f32;
    Square { center, half_size: [half(x.len()), half(y.len())] }
}

/// What is drawn over the left image for one grid.
pub(super) struct Overlay {
    /// The red squares.
    pub medians: Boxes2D,
    /// The red dots.
    pub unknown: Points2D,
    /// The borders of the cells.
    pub lines: LineStrips2D,
    /// The yellow and violet squares, to be drawn over the red ones: an entity of their own.
    pub percentiles: Boxes2D,
}

impl Overlay {
    /// Of `grid` on an image of `size` pixels.
    pub(super) fn new(grid: &DepthGrid, size: (usize, usize), scale: &Scale) -> Self {
        let mut medians = Vec::new();
        let mut percentiles = Vec::new();
        let mut unknown = Vec::new();
        for (place, cell) in grid.iter() {
            let at = |disparity: f32| square(grid.shape(), place, size, scale.nearness(disparity.into()));
            match cell.depth {
                Some(depth) => {
                    medians.push((at(depth.median_px), RED));
                    percentiles.extend([(at(depth.p20_px), YELLOW), (at(depth.p80_px), VIOLET)]);
                }
                None => unknown.push(at(0.0).center),
            }
        }
        // In image pixels, so that a small view gets thin lines and a large one bold ones.
        let unit = size.0 as f32 / 320.0;
        Self {
            medians: boxes(&medians, 1.4 * unit).with_draw_order(31.0),
            unknown: Points2D::new(unknown).with_colors([RED]).with_radii([3.5 * unit]),
            lines: LineStrips2D::new(lines(grid.shape(), size))
                .with_colors([WHITE])
                .with_radii([Radius::new_ui_points(0.5)]),
            percentiles: boxes(&percentiles, 0.6 * unit).with_draw_order(32.0),
        }
    }
}

fn boxes(squares: &[(Square, Rgba32)], radius: f32) -> Boxes2D {
    let (centers, half_sizes) = (squares.iter().map(|s| s.0.center), squares.iter().map(|s| s.0.half_size));
    Boxes2D::from_centers_and_half_sizes(centers, half_sizes)
        .with_colors(squares.iter().map(|s| s.1))
        .with_radii([radius])
}

/// Borders between the cells and around them.
fn lines(shape: GridShape, (width, height): (usize, usize)) -> Vec<[[f32; 2]; 2]> {
    let (right, bottom) = (width as f32, height as f32);
    let vertical = (0..=shape.columns).map(|i| (i * width / shape.columns) as f32).map(|x| [[x, 0.0], [x, bottom]]);
    let horizontal = (0..=shape.rows).map(|i| (i * height / shape.rows) as f32).map(|y| [[0.0, y], [right, y]]);
    vertical.chain(horizontal).collect()
}

/// The grid of the true disparities, each cell as an ideal algorithm would report it.
pub(super) fn true_grid(disparity: &Plane<f32>, rig: Option<&Rig>, shape: GridShape) -> DepthGrid {
    let cell = |place| {
        let (xs, ys) = shape.pixels(place, disparity.size());
        let pixels = xs.len() * ys.len();
        let rows = ys.map(|y| &disparity.row(y)[xs.clone()]);
        let mut known: Vec<f32> = rows.flatten().copied().filter(|d| d.is_finite()).collect();
        let valid_share = known.len() as f64 / pixels.max(1) as f64;
        let depth = (valid_share >= MIN_VALID && !known.is_empty()).then(|| {
            let median_px = nearest_rank(&mut known, 0.5);
            CellDepth {
                median_px,
                p20_px: nearest_rank(&mut known, 0.2),
                p80_px: nearest_rank(&mut known, 0.8),
                distance_m: rig.and_then(|rig| rig.depth_m(median_px.into())),
            }
        });
        Cell { valid_share, depth }
    };
    // One cell is made per place of the shape, and no grid is empty.
    DepthGrid::new(shape, shape.iter().map(cell).collect()).expect("a cell per place")
}

/// The `p`-quantile by nearest rank, `sorted[⌈p·n⌉ − 1]`. `values` is not empty.
fn nearest_rank(values: &mut [f32], p: f64) -> f32 {
    let rank = (p * values.len() as f64).ceil() as usize;
    *values.select_nth_unstable_by(rank.saturating_sub(1), f32::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHAPE: GridShape = GridShape { columns: 5, rows: 3 };

    #[test]
    fn a_near_cell_is_full_and_twice_as_far_is_half() {
        let full = square(SHAPE, (1, 2), (320, 240), 1.0);
        assert_eq!(full, Square { center: [96.0, 200.0], half_size: [32.0, 40.0] });
        assert_eq!(square(SHAPE, (1, 2), (320, 240), 0.5).half_size, [16.0, 20.0]);
        assert_eq!(square(SHAPE, (1, 2), (320, 240), 0.0).half_size, [0.0, 0.0]);
    }

    #[test]
    fn lines_enclose_every_cell() {
        let lines = lines(SHAPE, (320, 240));
        assert_eq!(lines.len(), 6 + 4);
        assert!(lines.contains(&[[320.0, 0.0], [320.0, 240.0]]) && lines.contains(&[[0.0, 80.0], [320.0, 80.0]]));
    }

    #[test]
    fn the_true_grid_has_ranks_and_holes() {
        let one = GridShape { columns: 2, rows: 1 };
        let truth = Plane::from_fn(20, 1, |x, _| if x < 10 { x as f32 + 1.0 } else { f32::INFINITY }).unwrap();
        let rig = Rig::new(100.0, (10.0, 0.0), 0.1, 0.0).unwrap();
        let grid = true_grid(&truth, Some(&rig), one);
        let depth = grid.cell(0, 0).depth.unwrap();
        assert_eq!((depth.p20_px, depth.median_px, depth.p80_px, depth.distance_m), (2.0, 5.0, 8.0, Some(2.0)));
        assert_eq!(grid.cell(1, 0).depth, None);
    }
}
