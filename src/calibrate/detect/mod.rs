//! Chessboard detection with subpixel corners.
//!
//! ```text
//! image ─▶ candidate (ChESS) ─▶ grid (neighbour to neighbour) ─▶ refine (two edges fitted)
//!       ─▶ labelling (which corner is the first)
//! ```
//!
//! Compared with the crate `calib-targets` 0.16 (its sweep of settings, saddle point refinement) in
//! November 2026, on OpenCV's 13 stereo pairs of a 9x6 board, and on 40 simulated boards per image
//! quality:
//!
//! | | this | calib-targets |
//! |---|---|---|
//! | complete boards, OpenCV's 26 images | 26 | 25 (one more corner than the board has) |
//! | distance to OpenCV's corners, rms | 0.135 px | 0.146 px, 2 corners farther than 2 px |
//! | rms after [`super::solve()`] | 0.164 px | 0.177 px |
//! | simulated, noise 0: boards, corner rms | 40, 0.012 px | 38, 0.014 px |
//! | noise 5 (grey levels) | 40, 0.030 px | 38, 0.057 px |
//! | noise 10 | 39, 0.055 px | 38, 0.114 px |
//! | noise 20 | 27, 0.113 px | 33, 0.244 px |
//! | blur 1.5 px | 39, 0.028 px | 38, 0.034 px |
//! | blur 4 px | 32, 0.131 px | 32, 0.150 px |
//! | 70 % less light at one edge | 40, 0.020 px | 38, 0.033 px |
//! | time per image of 640x480, machine under load | 20 ms | 17 ms |
//!
//! So svl keeps its own. At a noise of 20 the grids of `calib-targets` are better, and its boards
//! are found more often: 39 of 40 if its grids are refined as here.

mod assemble;
mod candidate;
mod grid;
mod labelling;
mod refine;

use super::Board;
use candidate::Finder;
use nalgebra::{Point2, Vector2};
use std::fmt::{Display, Formatter};
use svl_core::Result;
use svl_core::stereo::{Gray, StereoPair};

/// A complete board detected in an image.
#[derive(Clone, Debug, PartialEq)]
pub struct Sighting {
    /// The inner corners in the order of [`Board::corners`], pixels, pixel centres at integers.
    pub corners: Vec<Point2<f64>>,
    /// Median standard deviation of the blur across the edges of the corners, pixels.
    pub blur_px: f64,
    /// Median difference between dark and bright squares at the corners, grey levels.
    pub contrast: f64,
}

/// Detection of a board in an image.
#[derive(Clone, Debug, PartialEq)]
pub enum Detection {
    Whole(Sighting),
    /// A board with another number of corners, the longer side first.
    Other {
        corners: (usize, usize),
    },
    /// Part of the board. `beyond`: the edge of the image beyond which the rest lies, if any.
    Part {
        beyond: Option<Edge>,
    },
    Nothing,
}

impl Detection {
    /// The corners of a complete board; empty for anything else.
    pub fn corners(&self) -> &[Point2<f64>] {
        match self {
            Self::Whole(sighting) => &sighting.corners,
            _ => &[],
        }
    }
}

/// An edge of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Edge {
    Left,
    Right,
    Top,
    Bottom,
}

impl Display for Edge {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Left => "at its left edge",
            Self::Right => "at its right edge",
            Self::Top => "at its top",
            Self::Bottom => "at its bottom",
        })
    }
}

/// Detects one board in the images of one camera.
pub struct Detector {
    board: Board,
    finder: Finder,
}

/// Images of at most this many pixels are also searched enlarged if no complete board is found.
const MAX_ENLARGED_PIXELS: usize = 1_000_000;

impl Detector {
    /// # Errors
    /// None known; those of the corner detector for its settings.
    pub fn new(board: Board) -> Result<Self> {
        Ok(Self {
            board,
            finder: Finder::new()?,
        })
    }

    /// Detects the board in the image.
    ///
    /// On a board that is not symmetric under a rotation of 180° (one side even, the other odd) the
    /// square outside the first corner is dark. On other boards the vector from the first corner to
    /// the last is as close to `towards` as possible: `(1, 1)` starts at the upper left; the
    /// diagonal found in the other camera's image labels both images consistently.
    pub fn find(&mut self, image: &Gray, towards: Vector2<f64>) -> Detection {
        let candidates = self.finder.find(image);
        let plain = assemble::assemble(image, &candidates, &self.board, towards);
        if matches!(plain, Detection::Whole(_) | Detection::Other { .. }) {
            return plain;
        }
        // Half the size makes blurred edges sharp enough for the detector's ring.
        let candidates = self.finder.find_halved(image);
        if let Detection::Whole(sighting) =
            assemble::assemble(image, &candidates, &self.board, towards)
        {
            return Detection::Whole(sighting);
        }
        // Enlarging is slow, and the squares of a board in a large image are rarely that small.
        if image.width() * image.height() > MAX_ENLARGED_PIXELS {
            return plain;
        }
        let candidates = self.finder.find_enlarged(image);
        match assemble::assemble(image, &candidates, &self.board, towards) {
            Detection::Whole(sighting) => Detection::Whole(sighting),
            _ => plain,
        }
    }
}

/// Detects one board in both images of pairs.
pub struct PairDetector([Detector; 2]);

impl PairDetector {
    /// # Errors
    /// The errors of [`Detector::new`].
    pub fn new(board: Board) -> Result<Self> {
        Ok(Self([Detector::new(board)?, Detector::new(board)?]))
    }

    /// Detections in the left and the right image. Complete boards are labelled consistently in
    /// both.
    pub fn find(&mut self, pair: &StereoPair) -> [Detection; 2] {
        let [left, right] = &mut self.0;
        let seen = left.find(pair.left(), UPPER_LEFT);
        let towards = match &seen {
            Detection::Whole(sighting) => labelling::diagonal(&sighting.corners),
            _ => UPPER_LEFT,
        };
        [seen, right.find(pair.right(), towards)]
    }
}

#[cfg(test)]
mod tests;

const UPPER_LEFT: Vector2<f64> = Vector2::new(1.0, 1.0);
