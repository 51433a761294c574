//! Memory layout of a cost volume: row by row, in blocks of neighbouring pixels, which are the
//! lanes, and within a block disparity by disparity. A path from another row then never reads
//! across lanes.

use super::Lanes;

/// Matching cost of a disparity that leads outside the right image; others are 0 ..= 62.
pub const OUTSIDE: u8 = u8::MAX;

/// Extent of a cost volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VolumeShape {
    pub width: usize,
    pub height: usize,
    /// The first disparity, and the number of disparities.
    pub first: i32,
    pub count: usize,
}

impl VolumeShape {
    /// Blocks per row.
    pub fn blocks(&self) -> usize {
        self.width.div_ceil(Lanes::COUNT)
    }

    /// Pixels in the blocks of a row, including those beyond the image.
    pub fn padded(&self) -> usize {
        self.blocks() * Lanes::COUNT
    }

    /// Lanes per row.
    pub fn stride(&self) -> usize {
        self.blocks() * self.count
    }

    /// Number of disparities that lead from column `x`, or from one before it, into the right
    /// image. Costs beyond them are neither written nor read.
    #[inline(always)]
    pub(super) fn reached(&self, x: usize) -> usize {
        self.count.min((x as i32 + 1 - self.first).max(0) as usize)
    }

    /// Number of disparities that lead from some pixel of a block into the right image. Costs
    /// beyond them are neither written nor read.
    #[inline(always)]
    pub fn reached_in(&self, block: usize) -> usize {
        self.reached((block + 1) * Lanes::COUNT - 1)
    }
}
