//! The chessboard, and its corners in a pair.

use nalgebra::{Point2, Point3};
use svl_core::stereo::LengthUnit;
use svl_core::{Error, Result};

/// A chessboard, described by its inner corners.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Board {
    columns: usize,
    rows: usize,
    square_m: Option<f64>,
}

impl Board {
    /// `columns`, `rows`: inner corners along each side. `square_m`: side of a square in metres, if
    /// measured; otherwise lengths are in squares.
    ///
    /// # Errors
    /// [`Error::Invalid`] for fewer than 3 or more than 50 corners along a side, or a side that is
    /// not positive.
    pub fn new((columns, rows): (usize, usize), square_m: Option<f64>) -> Result<Self> {
        if ![columns, rows].iter().all(|side| (3..=50).contains(side)) {
            return Err(Error::Invalid(format!(
                "a board of {columns}x{rows} inner corners: each side needs 3 to 50 of them"
            )));
        }
        match square_m {
            Some(side) if !(side.is_finite() && side > 0.0) => Err(Error::Invalid(format!(
                "squares of {side} m: their side must be positive"
            ))),
            _ => Ok(Self {
                columns,
                rows,
                square_m,
            }),
        }
    }

    /// Inner corners along a row.
    pub fn columns(&self) -> usize {
        self.columns
    }

    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Unit of its lengths.
    pub fn unit(&self) -> LengthUnit {
        if self.square_m.is_some() {
            LengthUnit::Metres
        } else {
            LengthUnit::Squares
        }
    }

    /// Side of a square in [`Board::unit`].
    pub fn side(&self) -> f64 {
        self.square_m.unwrap_or(1.0)
    }

    /// The corners row by row in the board's own frame, z = 0.
    pub fn corners(&self) -> impl Iterator<Item = Point3<f64>> + use<> {
        let (columns, side) = (self.columns, self.side());
        let at = move |i: usize| {
            Point3::new(
                (i % columns) as f64 * side,
                (i / columns) as f64 * side,
                0.0,
            )
        };
        (0..columns * self.rows).map(at)
    }
}

impl std::str::FromStr for Board {
    type Err = Error;

    /// From its inner corners along both sides, as `9x6`.
    fn from_str(text: &str) -> Result<Self> {
        let sides = text.split_once('x');
        let sides = sides.and_then(|(long, short)| Some((long.parse().ok()?, short.parse().ok()?)));
        let expected = || format!("'{text}': expected inner corners as 9x6");
        Self::new(sides.ok_or_else(|| Error::Invalid(expected()))?, None)
    }
}

/// The corners of one board in both images of a pair, in the order of [`Board::corners`], pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct StereoView {
    pub left: Vec<Point2<f64>>,
    pub right: Vec<Point2<f64>>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_are_row_by_row() {
        let board = Board::new((4, 3), Some(0.03)).unwrap();
        let corners: Vec<_> = board.corners().collect();
        assert_eq!(corners.len(), 12);
        assert_eq!(corners[5], Point3::new(0.03, 0.03, 0.0));
    }

    #[test]
    fn impossible_boards_are_refused() {
        assert!(Board::new((2, 6), None).is_err());
        assert!(Board::new((9, 6), Some(0.0)).is_err());
        assert!(Board::new((9, 6), Some(f64::NAN)).is_err());
    }
}
