//! Windows of a filter: their positions in the image, and the cells of the grid that each covers.
//!
//! Other image sizes scale the positions of the windows, not their size.

use super::FilterKind;
use crate::error::{Error, Result};
use crate::stereo::GridShape;

/// The windows of a filter in images of one size, and the cells that they cover.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FilterWindows {
    /// Left upper corners.
    pub corners: Vec<[usize; 2]>,
    /// Per cell of the grid, in raster order, its windows; a detection in any of them suffices.
    pub by_cell: Vec<Vec<usize>>,
}

/// The strips of the image's width, in tenths, that the two windows of *too close* cover.
const STRIPS: [[usize; 2]; 2] = [[1, 5], [5, 9]];

impl FilterWindows {
    /// *Floor*: one window per cell, centred in it and shifted into the image.
    ///
    /// *Too close*: two windows at half height, left and right of the middle (at 320 x 240 from the
    /// columns 32 and 160 and the row 56 on). Each covers a strip of four tenths of the width, of
    /// full height: an object that near on the floor is taller than the image. A cell is too close
    /// if a window is whose strip covers at least half of the cell.
    ///
    /// # Errors
    /// [`Error::Invalid`] for images smaller than a window of that `side`.
    pub fn new(
        kind: FilterKind,
        side: usize,
        (width, height): (usize, usize),
        shape: GridShape,
    ) -> Result<Self> {
        if width < side || height < side {
            return Err(Error::Invalid(format!(
                "filter {kind}: images of {width}x{height} are smaller than its windows of \
                 {side}x{side}"
            )));
        }
        // Twice the centres, which need not be whole.
        let corner = |middle: [usize; 2]| {
            let corner =
                |middle: usize, length: usize| (middle.saturating_sub(side) / 2).min(length - side);
            [corner(middle[0], width), corner(middle[1], height)]
        };
        let (corners, by_cell) = match kind {
            FilterKind::Floor => {
                let middle = |place| {
                    let (x, y) = shape.pixels(place, (width, height));
                    corner([x.start + x.end, y.start + y.end])
                };
                let cells = (0..shape.cells()).map(|cell| vec![cell]);
                (shape.iter().map(middle).collect(), cells.collect())
            }
            FilterKind::TooClose => {
                let corners = STRIPS.map(|[from, to]| corner([(from + to) * width / 10, height]));
                let covering = |(column, row)| {
                    let (x, _) = shape.pixels((column, row), (width, height));
                    let covers = |[from, to]: [usize; 2]| {
                        let (from, to) = (from * width / 10, to * width / 10);
                        let common = x.end.min(to).saturating_sub(x.start.max(from));
                        2 * common >= x.len()
                    };
                    (0..STRIPS.len()).filter(|&i| covers(STRIPS[i])).collect()
                };
                (corners.to_vec(), shape.iter().map(covering).collect())
            }
        };
        Ok(Self { corners, by_cell })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_of_the_floor_are_centred_in_cells() {
        let shape = GridShape::default();
        let windows = FilterWindows::new(FilterKind::Floor, 64, (320, 240), shape).unwrap();
        let corners: Vec<_> = windows.corners.iter().step_by(6).collect();
        assert_eq!(corners, [&[0, 8], &[64, 88], &[128, 168]]);
        assert_eq!(windows.by_cell[7], [7]);
        // Clamped if a cell is narrower than a window.
        let narrow = FilterWindows::new(FilterKind::Floor, 64, (100, 70), shape).unwrap();
        assert_eq!(narrow.corners[0], [0, 0]);
        assert_eq!(narrow.corners[14], [36, 6]);
    }

    #[test]
    fn windows_of_too_close_are_left_and_right_of_the_middle() {
        let shape = GridShape::default();
        let windows = FilterWindows::new(FilterKind::TooClose, 128, (320, 240), shape).unwrap();
        assert_eq!(windows.corners, [[32, 56], [160, 56]]);
        let row = [vec![0], vec![0], vec![0, 1], vec![1], vec![1]];
        assert_eq!(windows.by_cell, [row.clone(), row.clone(), row].concat());
        let double = FilterWindows::new(FilterKind::TooClose, 128, (640, 480), shape).unwrap();
        assert_eq!(double.corners, [[128, 176], [384, 176]]);
        assert_eq!(double.by_cell, windows.by_cell);
    }

    #[test]
    fn images_smaller_than_a_window_are_refused() {
        let error = FilterWindows::new(FilterKind::Floor, 64, (320, 60), GridShape::default());
        let error = error.unwrap_err().to_string();
        assert!(
            error.contains("320x60") && error.contains("64x64"),
            "{error}"
        );
    }
}
