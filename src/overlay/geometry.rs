//! From cells to squares.

use crate::stereo::{CellDepth, DepthGrid, Rig};
use serde::Serialize;

/// At this distance and below a square fills its cell.
pub const NEAR_M: f64 = 0.2;

/// How near a disparity is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Nearness {
    /// [`NEAR_M`] over the distance.
    Metric(Rig),
    /// Without a rig: the share of this largest disparity, in pixels.
    Relative { max_px: f32 },
}

impl Nearness {
    /// 0 at infinity, 1 for whatever fills its cell.
    pub fn of(&self, disparity_px: f32) -> f64 {
        let nearness = match self {
            Self::Metric(rig) => rig.depth_m(disparity_px.into()).map_or(0.0, |depth_m| NEAR_M / depth_m),
            Self::Relative { max_px } => f64::from(disparity_px) / f64::from(*max_px),
        };
        nearness.clamp(0.0, 1.0)
    }

    /// The disparity from which on a square fills its cell, pixels.
    pub fn max_px(&self) -> f32 {
        match self {
            Self::Metric(rig) => rig.disparity_px(NEAR_M) as f32,
            Self::Relative { max_px } => *max_px,
        }
    }
}

/// A rectangle in image pixels; pixel (x, y) covers `x..x + 1`, `y..y + 1`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Rect {
    pub x: f64,
    pub y: f64,
    pub width: f64,
    pub height: f64,
}

impl Rect {
    /// `(x, y)` of the centre.
    pub fn center(&self) -> (f64, f64) {
        (self.x + self.width / 2.0, self.y + self.height / 2.0)
    }

    /// The rectangle `factor` times as large about the same centre.
    pub fn scaled(&self, factor: f64) -> Self {
        let (x, y) = self.center();
        let (width, height) = (self.width * factor, self.height * factor);
        Self { x: x - width / 2.0, y: y - height / 2.0, width, height }
    }
}

/// A known cell's squares, which have the proportions of the cell.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Squares {
    /// Filled red.
    pub median: Rect,
    /// Outlined yellow; a farther part of the cell, so it is the smallest.
    pub p20: Rect,
    /// Outlined violet; a nearer part of the cell, so it is the largest.
    pub p80: Rect,
}

/// What is drawn in one cell.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Mark {
    pub column: usize,
    pub row: usize,
    /// The cell itself.
    pub cell: Rect,
    /// A red dot in the middle where there are none.
    pub squares: Option<Squares>,
}

/// The squares of a cell with that depth.
pub fn squares(cell: Rect, depth: &CellDepth, nearness: Nearness) -> Squares {
    let [median, p20, p80] =
        [depth.median_px, depth.p20_px, depth.p80_px].map(|disparity| cell.scaled(nearness.of(disparity)));
    Squares { median, p20, p80 }
}

/// What is drawn on an image of `size` (width, height), in raster order of the cells.
pub fn marks(grid: &DepthGrid, size: (usize, usize), nearness: Nearness) -> Vec<Mark> {
    let mark = |((column, row), cell): ((usize, usize), &crate::stereo::Cell)| {
        let (x, y) = grid.shape().pixels((column, row), size);
        let bounds = Rect { x: x.start as f64, y: y.start as f64, width: x.len() as f64, height: y.len() as f64 };
        let squares = cell.depth.as_ref().map(|depth| squares(bounds, depth, nearness));
        Mark { column, row, cell: bounds, squares }
    };
    grid.iter().map(mark).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stereo::{Cell, GridShape};

    const CELL: Rect = Rect { x: 64.0, y: 80.0, width: 64.0, height: 80.0 };

    fn rig() -> Rig {
        Rig::new(328.0, (159.5, 119.5), 0.044, 0.0).unwrap()
    }

    #[test]
    fn a_square_is_as_large_as_it_is_near() {
        let rig = rig();
        let at = |depth_m: f64| Nearness::Metric(rig).of(rig.disparity_px(depth_m) as f32);
        assert!((at(0.4) - 0.5).abs() < 1e-6);
        assert!((at(2.0) - 0.1).abs() < 1e-6);
        assert_eq!(at(0.1), 1.0);
        assert_eq!(Nearness::Metric(rig).of(0.0), 0.0);
    }

    #[test]
    fn without_a_rig_disparity_itself_counts() {
        let nearness = Nearness::Relative { max_px: 80.0 };
        assert_eq!([20.0, 80.0, 99.0, -1.0].map(|d| nearness.of(d)), [0.25, 1.0, 1.0, 0.0]);
    }

    #[test]
    fn squares_stand_in_the_middle_and_keep_the_cell_s_proportions() {
        let depth = CellDepth { median_px: 40.0, p20_px: 20.0, p80_px: 80.0, distance_m: None };
        let squares = squares(CELL, &depth, Nearness::Relative { max_px: 80.0 });
        assert_eq!(squares.median, Rect { x: 80.0, y: 100.0, width: 32.0, height: 40.0 });
        assert_eq!(squares.p20, Rect { x: 88.0, y: 110.0, width: 16.0, height: 20.0 });
        assert_eq!(squares.p80, CELL);
    }

    #[test]
    fn unknown_cells_have_no_squares_and_cells_tile_the_image() {
        let cell = |known: bool| Cell {
            valid_share: 0.5,
            depth: known.then_some(CellDepth { median_px: 8.0, p20_px: 8.0, p80_px: 8.0, distance_m: None }),
        };
        let grid =
            DepthGrid::new(GridShape { columns: 3, rows: 1 }, vec![cell(true), cell(false), cell(true)]).unwrap();
        let marks = marks(&grid, (10, 4), Nearness::Relative { max_px: 8.0 });
        assert_eq!(marks.iter().map(|m| m.squares.is_some()).collect::<Vec<_>>(), [true, false, true]);
        assert_eq!(
            marks.iter().map(|m| (m.cell.x, m.cell.width)).collect::<Vec<_>>(),
            [(0.0, 3.0), (3.0, 3.0), (6.0, 4.0)]
        );
        assert_eq!(marks[2].squares.unwrap().median, marks[2].cell);
    }
}
