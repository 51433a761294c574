//! The chessboard in an image, its corners to a fraction of a pixel.
//!
//! ```text
//! image ─▶ candidates (ChESS) ─▶ grid (neighbour to neighbour) ─▶ refine (two edges fitted) ─▶ place (which is first)
//! ```

mod candidate;
mod grid;
mod place;
mod read;
mod refine;

use super::Board;
use crate::error::Result;
use crate::stereo::{Gray, StereoPair};
use candidate::Finder;
use nalgebra::{Point2, Vector2};

/// A whole board in an image.
#[derive(Clone, Debug, PartialEq)]
pub struct Sighting {
    /// The inner corners in the order of [`Board::corners`], pixels, pixel centres at integers.
    pub corners: Vec<Point2<f64>>,
    /// Standard deviation of the blur across the edges, pixels: the median of the corners.
    pub blur_px: f64,
    /// Difference of dark and bright squares, grey levels: the median of the corners.
    pub contrast: f64,
}

/// What an image shows of a board.
#[derive(Clone, Debug, PartialEq)]
pub enum Seen {
    Whole(Sighting),
    /// A grid of other corners than the board has, the longer side first.
    Other {
        corners: (usize, usize),
    },
    /// Some of it; the rest is beyond an edge of the image, where that is known.
    Part {
        beyond: Option<Edge>,
    },
    Nothing,
}

/// An edge of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Edge {
    Left,
    Right,
    Top,
    Bottom,
}

/// Looks for one board in one camera's images.
pub struct Detector {
    board: Board,
    finder: Finder,
}

/// Images up to so many pixels are looked at enlarged when no whole board is found.
const SMALL: usize = 1_000_000;

impl Detector {
    /// # Errors
    /// None known; those of the corner detector's settings.
    pub fn new(board: Board) -> Result<Self> {
        Ok(Self {
            board,
            finder: Finder::new()?,
        })
    }

    /// What the image shows of the board.
    ///
    /// A board that differs from itself turned by 180° (one of its sides even, the other odd) is
    /// read by its colours: the square outside the first corner is dark. Other boards are read so
    /// that the way from the first corner to the last is most like `towards`: `(1, 1)` begins at
    /// the upper left, and the diagonal of the other camera's image reads both alike.
    pub fn find(&mut self, image: &Gray, towards: Vector2<f64>) -> Seen {
        let candidates = self.finder.find(image);
        let plain = read::read(image, &candidates, &self.board, towards);
        if matches!(plain, Seen::Whole(_) | Seen::Other { .. }) {
            return plain;
        }
        let candidates = self.finder.find_halved(image);
        if let Seen::Whole(sighting) = read::read(image, &candidates, &self.board, towards) {
            return Seen::Whole(sighting);
        }
        if image.width() * image.height() > SMALL {
            return plain;
        }
        let candidates = self.finder.find_enlarged(image);
        match read::read(image, &candidates, &self.board, towards) {
            Seen::Whole(sighting) => Seen::Whole(sighting),
            _ => plain,
        }
    }
}

/// Looks for one board in both images of pairs.
pub struct PairDetector([Detector; 2]);

impl PairDetector {
    /// # Errors
    /// As [`Detector::new`].
    pub fn new(board: Board) -> Result<Self> {
        Ok(Self([Detector::new(board)?, Detector::new(board)?]))
    }

    /// What the left and the right image show; whole boards are read alike in both.
    pub fn find(&mut self, pair: &StereoPair) -> [Seen; 2] {
        let [left, right] = &mut self.0;
        let seen = left.find(pair.left(), UPPER_LEFT);
        let towards = match &seen {
            Seen::Whole(sighting) => place::diagonal(&sighting.corners),
            _ => UPPER_LEFT,
        };
        [seen, right.find(pair.right(), towards)]
    }
}

#[cfg(test)]
mod tests;

const UPPER_LEFT: Vector2<f64> = Vector2::new(1.0, 1.0);
