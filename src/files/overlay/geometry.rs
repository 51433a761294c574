//! Geometry of the depth grid's overlay: cells to squares.

use serde::{Deserialize, Serialize};
use svl_core::stereo::{CellDepth, DepthGrid, Frame, Rig};

/// Distance at which an obstacle fills its cell if the camera moves, metres.
pub const NEAR_M: f64 = 0.2;
/// Disparity that fills a cell of an unknown camera: the end of svl's default search range.
const NEAR_PX: f64 = 80.0;

/// The scale of the squares: nearness of a disparity, so that a size has the same meaning in every
/// frame of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearness {
    /// The disparity that fills a cell, pixels.
    pub near_px: f64,
    doffs_px: f64,
}

impl Nearness {
    /// The scale for `frame`'s camera. On a moving rig (the arena, a robot) an obstacle at
    /// [`NEAR_M`] fills its cell, or at the nearest distance within disparities of a quarter of the
    /// width. In a static scene with truth, its own nearest point does.
    pub fn for_frame(frame: &Frame) -> Self {
        // A moving camera keeps one scale, or sizes would not compare between frames.
        let still = frame.truth.as_ref().filter(|_| frame.pose.is_none());
        let nearest = still.and_then(|truth| {
            truth
                .disparity
                .pixels()
                .filter(|d| d.is_finite())
                .reduce(f32::max)
        });
        // Search ranges rarely reach farther: the cell would never be filled.
        let quarter_px = frame.pair.size().0 as f64 / 4.0;
        let near_px = match (nearest, frame.rig()) {
            (Some(nearest), _) => f64::from(nearest).max(1.0),
            (None, Some(rig)) => rig.disparity_px(NEAR_M).min(quarter_px),
            (None, None) => NEAR_PX,
        };
        Self::new(near_px, frame.rig().map_or(0.0, Rig::doffs_px))
    }

    /// The scale on which the disparity `near_px` fills a cell; `doffs_px` as in
    /// [`svl_core::stereo::Rig`].
    pub fn new(near_px: f64, doffs_px: f64) -> Self {
        Self { near_px, doffs_px }
    }

    /// 0 at infinity, 1 for anything that fills its cell: the nearest distance over that of the
    /// disparity.
    pub fn at(&self, disparity_px: f32) -> f64 {
        let near_px = self.near_px + self.doffs_px;
        if near_px > 0.0 {
            ((f64::from(disparity_px) + self.doffs_px) / near_px).clamp(0.0, 1.0)
        } else {
            0.0
        }
    }
}

/// A rectangle in image pixels; pixel (x, y) covers `x..x + 1`, `y..y + 1`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
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
        Self {
            x: x - width / 2.0,
            y: y - height / 2.0,
            width,
            height,
        }
    }
}

/// A known cell's squares, with the proportions of the cell.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Squares {
    /// Filled green.
    pub median: Rect,
    /// Outlined yellow; a farther part of the cell, so it is the smallest.
    pub p20: Rect,
    /// Outlined violet; a nearer part of the cell, so it is the largest.
    pub p80: Rect,
}

/// Drawing of one cell.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mark {
    pub column: usize,
    pub row: usize,
    /// The cell itself.
    pub cell: Rect,
    /// `None` draws a dot in the centre.
    pub squares: Option<Squares>,
}

/// The squares of a cell with that depth.
pub fn squares(cell: Rect, depth: &CellDepth, nearness: Nearness) -> Squares {
    let [median, p20, p80] = [depth.median_px, depth.p20_px, depth.p80_px]
        .map(|disparity| cell.scaled(nearness.at(disparity)));
    Squares { median, p20, p80 }
}

/// Drawings on an image of `size` (width, height), in raster order of the cells.
pub fn marks(grid: &DepthGrid, size: (usize, usize), nearness: Nearness) -> Vec<Mark> {
    let mark = |((column, row), cell): ((usize, usize), &svl_core::stereo::Cell)| {
        let (x, y) = grid.shape().pixels((column, row), size);
        let bounds = Rect {
            x: x.start as f64,
            y: y.start as f64,
            width: x.len() as f64,
            height: y.len() as f64,
        };
        let squares = cell
            .depth
            .as_ref()
            .map(|depth| squares(bounds, depth, nearness));
        Mark {
            column,
            row,
            cell: bounds,
            squares,
        }
    };
    grid.iter().map(mark).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::stereo::{Cell, Geometry, Gray, GridShape, Plane, Pose, StereoPair, Truth};

    const CELL: Rect = Rect {
        x: 64.0,
        y: 80.0,
        width: 64.0,
        height: 80.0,
    };

    fn frame(rig: Option<Rig>, pose: Option<Pose>, truth: Option<f32>) -> Frame {
        let image = Gray::filled(320, 240, 0).unwrap();
        let truth = truth.map(|d| Truth::exact(Plane::filled(320, 240, d).unwrap(), None));
        let pair = StereoPair::new(image.clone(), image).unwrap();
        Frame {
            pose,
            truth,
            ..Frame::new(pair, Geometry::Rectified(rig))
        }
    }

    #[test]
    fn a_square_is_as_large_as_it_is_near() {
        let rig = Rig::new(328.0, (159.5, 119.5), 0.044, 0.0).unwrap();
        let nearness = Nearness::for_frame(&frame(Some(rig), Some(Pose::identity()), Some(9.0)));
        let at = |depth_m: f64| nearness.at(rig.disparity_px(depth_m) as f32);
        assert!((at(0.4) - 0.5).abs() < 1e-6 && (at(2.0) - 0.1).abs() < 1e-6);
        assert_eq!((at(0.1), nearness.at(0.0)), (1.0, 0.0));
        // Nothing is near if all is at infinity.
        assert_eq!(Nearness::new(5.0, -5.0).at(5.0), 0.0);
    }

    #[test]
    fn a_still_scene_takes_its_nearest_point() {
        let rig = Rig::new(1000.0, (159.5, 119.5), 0.19, 30.0).unwrap();
        let nearness = |rig, truth| Nearness::for_frame(&frame(rig, None, truth));
        let still = nearness(Some(rig), Some(64.0));
        assert_eq!(still.near_px, 64.0);
        assert_eq!([64.0, 17.0].map(|d| still.at(d)), [1.0, 0.5]);
        assert_eq!(nearness(None, Some(16.0)).near_px, 16.0);
        let unknown = nearness(None, None);
        let found = [20.0, 80.0, 99.0, -1.0].map(|d| unknown.at(d));
        assert_eq!(found, [0.25, 1.0, 1.0, 0.0]);
    }

    #[test]
    fn squares_stand_in_the_middle_and_keep_the_cell_s_proportions() {
        let depth = CellDepth::new([20.0, 40.0, 80.0], None);
        let squares = squares(CELL, &depth, Nearness::new(80.0, 0.0));
        let sides = |rect: Rect| [rect.x, rect.y, rect.width, rect.height];
        assert_eq!(sides(squares.median), [80.0, 100.0, 32.0, 40.0]);
        assert_eq!(sides(squares.p20), [88.0, 110.0, 16.0, 20.0]);
        assert_eq!(squares.p80, CELL);
    }

    #[test]
    fn unknown_cells_have_no_squares_and_cells_tile_the_image() {
        let cell = |known: bool| Cell {
            valid_share: 0.5,
            depth: known.then(|| CellDepth::at(8.0, None)),
            ..Cell::UNKNOWN
        };
        let (columns, rows) = (3, 1);
        let cells = [true, false, true].map(cell).into();
        let grid = DepthGrid::new(GridShape { columns, rows }, cells).unwrap();
        let marks = marks(&grid, (10, 4), Nearness::new(8.0, 0.0));
        let found = marks
            .iter()
            .map(|m| (m.cell.x, m.cell.width, m.squares.is_some()));
        let expected = [(0.0, 3.0, true), (3.0, 3.0, false), (6.0, 4.0, true)];
        assert_eq!(found.collect::<Vec<_>>(), expected);
        assert_eq!(marks[2].squares.unwrap().median, marks[2].cell);
    }
}
