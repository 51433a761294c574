//! An image in blocks of rows, transposed for the kernels that use rows as lanes.

use super::each_row;
use crate::error::Result;
use crate::kernel::{Isa, Lanes, transpose};
use crate::stereo::{Gray, buffer};

/// The blocks of an image, top to bottom; rows below the image are zero.
pub struct Blocks {
    width: usize,
    columns: Vec<Lanes<u16>>,
}

impl Blocks {
    /// Rows per block.
    pub const ROWS: usize = Lanes::COUNT;

    /// For images of that size.
    pub fn new(width: usize, height: usize) -> Result<Self> {
        Ok(Self {
            width,
            columns: buffer(Lanes::splat(0), width * height.div_ceil(Self::ROWS))?,
        })
    }

    /// Loads the pixels of `image`.
    pub fn load(&mut self, isa: Isa, image: &Gray) {
        each_row(&mut self.columns, self.width, 1, |block, columns| {
            transpose(isa, image, block * Self::ROWS, columns)
        });
    }

    /// The columns of the block that contains row `y`, one per pixel of a row.
    pub fn around(&self, y: usize) -> &[Lanes<u16>] {
        &self.columns[y / Self::ROWS * self.width..][..self.width]
    }

    /// The pixels of column `x`, top to bottom, and after them the zeros below the image.
    pub fn column(&self, x: usize) -> impl Iterator<Item = u16> {
        self.columns[x..]
            .iter()
            .step_by(self.width)
            .flat_map(|lanes| lanes.0)
    }

    /// Number of bands, each with its own scratch, into which an image of `height` rows is cut, and
    /// the rows of each, in whole blocks: a few bands per thread, so that a thread that finishes
    /// early finds another.
    pub fn bands(height: usize) -> (usize, usize) {
        let blocks = height.div_ceil(Self::ROWS);
        let wanted = match rayon::current_num_threads() {
            // One thread needs the scratch of only one band.
            1 => 1,
            threads => blocks.min(4 * threads),
        };
        let rows = blocks.div_ceil(wanted) * Self::ROWS;
        (height.div_ceil(rows), rows)
    }
}
