//! Blocks of rows laid out so that the rows are the lanes.
//!
//! A scan along the row then is the same for all lanes of a block: windows slide, nothing is
//! gathered or reduced across lanes, and every load is aligned.

use crate::stereo::Gray;

/// One value per row of a block, [`Lanes::COUNT`] rows.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub struct Lanes<T>(pub [T; Lanes::<()>::COUNT]);

impl Lanes<()> {
    /// Rows per block: two vectors of 16-bit numbers in AVX-512.
    pub const COUNT: usize = 64;
}

impl<T: Copy> Lanes<T> {
    pub fn splat(value: T) -> Self {
        Self([value; Lanes::COUNT])
    }
}

impl<T> AsRef<[T]> for Lanes<T> {
    fn as_ref(&self) -> &[T] {
        &self.0
    }
}

/// See [`super::transpose`].
#[inline(always)]
pub(super) fn transpose(image: &Gray, y: usize, out: &mut [Lanes<u16>]) {
    const TILE: usize = 16;
    let rows = Lanes::COUNT.min(image.height() - y);
    for (tile, out) in out.chunks_mut(TILE).enumerate() {
        let x = tile * TILE;
        for lane in 0..rows {
            let row = &image.row(y + lane)[x..x + out.len()];
            out.iter_mut()
                .zip(row)
                .for_each(|(out, &pixel)| out.0[lane] = u16::from(pixel));
        }
    }
}

/// The lanes of columns as rows, one after the other.
#[inline(always)]
pub(super) fn transpose_back<T: Copy, C: AsRef<[T]>>(columns: &[C], out: &mut [T]) {
    const TILE: usize = 16;
    let width = columns.len();
    for (tile, columns) in columns.chunks(TILE).enumerate() {
        for (lane, row) in out.chunks_exact_mut(width).enumerate() {
            let row = &mut row[tile * TILE..][..columns.len()];
            row.iter_mut()
                .zip(columns)
                .for_each(|(out, column)| *out = column.as_ref()[lane]);
        }
    }
}
