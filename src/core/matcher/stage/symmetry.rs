//! The symmetric check (thesis, section 5.3.3, "Validity Test", after Fua): the right image must
//! prefer the same match.

use super::RowCheck;
use super::ssd::{DisparityRange, search};
use crate::kernel::{Isa, Lanes, Match, SsdSearch, matches};
use crate::matcher::{Parameter, Range};
use crate::stereo::{Reason, RowMut};

/// Finds the cheapest disparity of each pixel of the right image. It holds one thread's scratch.
///
/// A mirrored, swapped pair has the same disparities, so this is the search for the left image's
/// pixels again, on the mirrored right and left images. This computes the sums twice; right winners
/// accumulated in one search would have to be read and written for every disparity of every pixel,
/// which takes as long.
pub struct SymmetricCheck {
    tolerance_px: i32,
    search: SsdSearch,
    left: Vec<Lanes<u16>>,
    right: Vec<Lanes<u16>>,
    /// Rows of the mirrored right image.
    matches: Vec<Match>,
}

impl SymmetricCheck {
    /// Largest difference between the two disparities, as a parameter of the matchers.
    pub const TOLERANCE: Parameter = Parameter {
        name: "symmetry_tolerance",
        unit: "px",
        range: Range::int(1, 0..=2 * DisparityRange::LIMIT),
        description: "largest difference between the disparities of the left and the right image",
    };

    /// For rows of `width` pixels.
    pub fn new(tolerance_px: i32, width: usize, range: DisparityRange) -> Self {
        Self {
            tolerance_px,
            search: search(width, range),
            left: vec![Lanes::splat(0); width],
            right: vec![Lanes::splat(0); width],
            matches: vec![Match::NONE; width * Lanes::COUNT],
        }
    }
}

impl RowCheck for SymmetricCheck {
    /// Matches the first `rows` of a block of the right image with the same rows of the left one.
    fn search(&mut self, isa: Isa, left: &[Lanes<u16>], right: &[Lanes<u16>], rows: usize) {
        for (mirrored, block) in [(&mut self.left, left), (&mut self.right, right)] {
            mirrored
                .iter_mut()
                // Columns in reverse order mirror the image; the lanes are rows and stay.
                .zip(block.iter().rev())
                .for_each(|(to, from)| *to = *from);
        }
        matches(
            isa,
            &self.right,
            &self.left,
            &mut self.search,
            &mut self.matches[..rows * left.len()],
        );
    }

    /// Rejects the matches of `row`, lane `lane` of the block, with which the right image
    /// disagrees.
    fn check_row(&self, _: Isa, lane: usize, _: &[u8], row: &mut RowMut<'_>) {
        let width = row.width();
        let matches = &self.matches[lane * width..][..width];
        for x in 0..width {
            if let Ok(d) = row.at(x) {
                // Matchers of whole pixels: `d` lies in the range, and its window inside the right
                // image.
                let d = d as i32;
                let matched = matches[(width as i32 - 1 - (x as i32 - d)) as usize];
                if (self.search.first() + matched.index() as i32).abs_diff(d)
                    > self.tolerance_px as u32
                {
                    row.reject(x, Reason::Inconsistent);
                }
            }
        }
    }
}
