//! Both images at half size, their censuses, and the penalties of steps: by row, and by column.

use crate::depth::decision::StepSum;
use crate::error::Result;
use crate::kernel::{
    Isa, Lanes, SMALL_CENSUS_PLANES, SMALL_CENSUS_REACH, STEPS, halve_row, quarter_row,
    small_census_row, step_penalties, transpose_plane,
};
use crate::stereo::{Gray, buffer};

const REACH: usize = SMALL_CENSUS_REACH;
const PLANES: usize = SMALL_CENSUS_PLANES;

/// A plane of bytes and the same transposed, both in whole blocks of lanes.
pub(super) struct TwoWayPlane {
    pub(super) rows: Vec<u8>,
    pub(super) columns: Vec<u8>,
}

/// An image at half size with its censuses.
pub(super) struct HalfImage {
    size: (usize, usize),
    /// Quarters of grey levels, each row between margins of clamped pixels.
    half: Vec<u16>,
    smooth: Vec<u16>,
    pub(super) census: [TwoWayPlane; PLANES],
    /// Elements before the first pixel of the planes by row.
    pub(super) margin: usize,
}

/// Penalties for jumps of disparity, from the pixel above and from the one on the left.
pub(super) struct StepCosts {
    pub(super) down: Vec<u8>,
    pub(super) across: TwoWayPlane,
}

/// Whole blocks of lanes.
pub(super) fn padded(pixels: usize) -> usize {
    pixels.next_multiple_of(Lanes::COUNT)
}

impl TwoWayPlane {
    /// Planes of `size`, with room before the first pixel by row.
    fn new((width, height): (usize, usize), margin: usize) -> Result<Self> {
        let pixels = padded(width) * padded(height);
        Ok(Self {
            rows: buffer(0, margin + pixels)?,
            columns: buffer(0, pixels)?,
        })
    }

    fn transpose(&mut self, isa: Isa, (width, height): (usize, usize), margin: usize) {
        let rows = &self.rows[margin..];
        transpose_plane(isa, rows, padded(width), padded(height), &mut self.columns);
    }
}

impl HalfImage {
    /// For images of twice `size`, whose censuses are shifted by up to `shift` pixels.
    pub(super) fn new(size: (usize, usize), shift: usize) -> Result<Self> {
        let stride = padded(size.0) + 2 * REACH;
        let margin = padded(shift);
        let census = || TwoWayPlane::new(size, margin);
        Ok(Self {
            size,
            half: buffer(0, stride * size.1)?,
            smooth: vec![0; 2 * size.0 + 3],
            census: [census()?, census()?, census()?],
            margin,
        })
    }

    fn stride(&self) -> usize {
        padded(self.size.0) + 2 * REACH
    }

    /// The pixels of a row.
    pub(super) fn row(&self, y: usize) -> &[u16] {
        &self.half[y * self.stride() + REACH..][..self.size.0]
    }

    #[inline(always)]
    pub(super) fn at(&self, x: usize, y: usize) -> u16 {
        self.half[y * self.stride() + REACH + x]
    }

    /// The censuses from the first pixel of a row on.
    pub(super) fn censuses(&self, y: usize) -> [&[u8]; PLANES] {
        let start = self.margin + y * padded(self.size.0);
        self.census.each_ref().map(|plane| &plane.rows[start..])
    }

    /// The steps from each of a row's columns to its left neighbour.
    pub(super) fn texture(&self, y: usize, columns: &std::ops::Range<usize>) -> StepSum {
        let row = &self.row(y)[columns.start.saturating_sub(1)..columns.end];
        let pairs = row.iter().zip(&row[1..]);
        StepSum::new(pairs.map(|(a, b)| a.abs_diff(*b).into()))
    }

    /// Halves an image.
    pub(super) fn halve(&mut self, isa: Isa, image: &Gray) {
        self.load_rows(image.height(), |rows, smooth, out| {
            let smooth = &mut smooth[..image.width() + 2];
            halve_row(isa, rows.map(|y| image.row(y)), smooth, out);
        });
    }

    /// Halves a half image again.
    pub(super) fn halve_again(&mut self, isa: Isa, half: &HalfImage) {
        let (width, height) = half.size;
        self.load_rows(height, |rows, smooth, out| {
            let smooth = &mut smooth[..width + 2];
            quarter_row(isa, rows.map(|y| half.row(y)), smooth, out);
        });
    }

    /// Fills each row by that function from four rows of an image of that height.
    fn load_rows(
        &mut self,
        full_height: usize,
        halve: impl Fn([usize; 4], &mut [u16], &mut [u16]),
    ) {
        let (width, stride) = (self.size.0, self.stride());
        let last = full_height - 1;
        for (y, out) in self.half.chunks_exact_mut(stride).enumerate() {
            let rows = [
                (2 * y).saturating_sub(1),
                2 * y,
                2 * y + 1,
                last.min(2 * y + 2),
            ];
            halve(rows, &mut self.smooth, &mut out[REACH..][..width]);
            let (first, end) = (out[REACH], out[REACH + width - 1]);
            out[..REACH].fill(first);
            out[REACH + width..].fill(end);
        }
    }

    /// Computes the censuses.
    pub(super) fn describe(&mut self, isa: Isa) {
        let ((width, height), stride) = (self.size, self.stride());
        for y in 0..height {
            let rows = std::array::from_fn(|j| {
                let y = (y + j).saturating_sub(REACH).min(height - 1);
                &self.half[y * stride..][..stride]
            });
            let start = self.margin + y * padded(width);
            let out = self
                .census
                .each_mut()
                .map(|plane| &mut plane.rows[start..][..padded(width)]);
            small_census_row(isa, rows, out);
        }
        for plane in &mut self.census {
            plane.transpose(isa, self.size, self.margin);
        }
    }
}

impl StepCosts {
    pub(super) fn new(size: (usize, usize)) -> Result<Self> {
        Ok(Self {
            down: buffer(0, padded(size.0) * size.1)?,
            across: TwoWayPlane::new(size, 0)?,
        })
    }

    /// Loads the penalties from the left image and the table of differences.
    pub(super) fn load(&mut self, isa: Isa, left: &HalfImage, table: &[u8; STEPS]) {
        let (width, height) = left.size;
        for y in 0..height {
            let start = y * padded(width);
            let row = left.row(y);
            let above = left.row(y.saturating_sub(1));
            let down = &mut self.down[start..][..width];
            step_penalties(isa, [above, row], table, down);
            let across = &mut self.across.rows[start + 1..][..width - 1];
            step_penalties(isa, [&row[..width - 1], &row[1..]], table, across);
        }
        self.across.transpose(isa, left.size, 0);
    }
}
