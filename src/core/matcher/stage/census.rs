//! Cost volume of the census transform (Zabih & Woodfill 1994): a bit for each of a pixel's 62
//! neighbours in 9 x 7 that is darker. It is invariant to gain and offset of the cameras. The
//! image's borders are replicated.

use super::each_row;
use crate::error::Result;
use crate::kernel::{
    CENSUS_BYTES, CENSUS_MARGIN, CENSUS_REACH, Isa, Lanes, OUTSIDE, VolumeShape, census_costs,
    census_row,
};
use crate::stereo::{Gray, buffer};
use std::ops::Range;

/// The cost of every disparity of every pixel.
pub struct CostVolume {
    shape: VolumeShape,
    left: Census,
    right: Census,
    outside: Vec<u8>,
    costs: Vec<Lanes<u8>>,
}

/// The censuses of an image.
struct Census {
    stride: usize,
    /// The image, padded at the sides as far as the census reaches.
    padded: Vec<u8>,
    bytes: Vec<u8>,
}

impl CostVolume {
    /// For images of that size. At least one disparity of the range must lead into the image.
    pub fn new(shape: VolumeShape) -> Result<Self> {
        let mut outside = vec![OUTSIDE; shape.padded() + 2 * CENSUS_MARGIN];
        // ORed into the costs, so that the inner loop has no test for the image's borders.
        outside[CENSUS_MARGIN..][..shape.width].fill(0);
        Ok(Self {
            shape,
            left: Census::new(&shape)?,
            right: Census::new(&shape)?,
            outside,
            costs: buffer(Lanes::splat(0), shape.stride() * shape.height)?,
        })
    }

    /// Computes the costs of a pair.
    pub fn load(&mut self, isa: Isa, left: &Gray, right: &Gray) {
        self.left.load(isa, left);
        self.right.load(isa, right);
        each_row(&mut self.costs, self.shape.stride(), 4, |y, row| {
            let (left, right) = (self.left.row(y), self.right.row(y));
            census_costs(isa, &self.shape, left, right, &self.outside, row)
        });
    }

    /// The costs of row `y`.
    pub fn row(&self, y: usize) -> &[Lanes<u8>] {
        self.rows(y..y + 1)
    }

    /// The costs of some rows.
    pub fn rows(&self, rows: Range<usize>) -> &[Lanes<u8>] {
        &self.costs[rows.start * self.shape.stride()..rows.end * self.shape.stride()]
    }

    pub fn shape(&self) -> VolumeShape {
        self.shape
    }
}

impl Census {
    fn new(shape: &VolumeShape) -> Result<Self> {
        let stride = shape.padded() + 2 * CENSUS_MARGIN;
        Ok(Self {
            stride,
            padded: buffer(0, (shape.width + 2 * CENSUS_REACH[0]) * shape.height)?,
            bytes: buffer(0, stride * CENSUS_BYTES * shape.height)?,
        })
    }

    fn load(&mut self, isa: Isa, image: &Gray) {
        let ([reach_x, reach_y], (width, height)) = (CENSUS_REACH, image.size());
        let padded_width = width + 2 * reach_x;
        each_row(&mut self.padded, padded_width, 16, |y, out| {
            let row = image.row(y);
            // Replicated at the sides here and at the top and bottom below, where rows are chosen.
            out[..reach_x].fill(row[0]);
            out[reach_x..][..width].copy_from_slice(row);
            out[reach_x + width..].fill(row[width - 1]);
        });
        each_row(&mut self.bytes, self.stride * CENSUS_BYTES, 4, |y, out| {
            let rows = std::array::from_fn(|k| {
                let y = (y + k).saturating_sub(reach_y).min(height - 1);
                &self.padded[y * padded_width..][..padded_width]
            });
            census_row(isa, rows, self.stride, &mut out[CENSUS_MARGIN..]);
        });
    }

    /// Censuses of row `y`, plane after plane.
    fn row(&self, y: usize) -> &[u8] {
        &self.bytes[y * self.stride * CENSUS_BYTES..][..self.stride * CENSUS_BYTES]
    }
}
