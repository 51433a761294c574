//! Rows as lanes: blocks of rows transposed so that one vector holds a pixel of every row.
//!
//! A scan along the row is then the same for all lanes of a block: windows slide, nothing is
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

/// Side of a [`Square`].
pub(super) const SIDE: usize = 16;

/// Rows of bytes.
pub(super) type Square = [[u8; SIDE]; SIDE];

/// See [`super::transpose`].
#[inline(always)]
pub(super) fn transpose(image: &Gray, y: usize, out: &mut [Lanes<u16>]) {
    let rows = Lanes::COUNT.min(image.height() - y);
    for (tile, out) in out.chunks_mut(SIDE).enumerate() {
        let x = tile * SIDE;
        for top in (0..rows).step_by(SIDE) {
            // Rows below the image and columns next to it are zero.
            let mut square = Square::default();
            for (lane, pixels) in (top..rows).zip(&mut square) {
                let row = &image.row(y + lane)[x..];
                match row.first_chunk() {
                    Some(row) => *pixels = *row,
                    None => pixels[..row.len()].copy_from_slice(row),
                }
            }
            for (out, column) in out.iter_mut().zip(transpose_square(&square)) {
                out.0[top..top + SIDE].copy_from_slice(&column.map(u16::from));
            }
        }
    }
}

/// See [`super::transpose_plane`].
#[inline(always)]
pub(super) fn transpose_plane(rows: &[u8], stride: usize, height: usize, out: &mut [u8]) {
    for y in (0..height).step_by(SIDE) {
        for x in (0..stride).step_by(SIDE) {
            let mut square = Square::default();
            for (i, pixels) in square.iter_mut().enumerate() {
                let row = &rows[(y + i) * stride + x..];
                *pixels = *row.first_chunk().expect("a square within the plane");
            }
            for (i, column) in transpose_square(&square).iter().enumerate() {
                out[(x + i) * height + y..][..SIDE].copy_from_slice(column);
            }
        }
    }
}

/// The lanes of columns as rows, one after the other.
#[inline(always)]
pub(super) fn transpose_back<T: Copy, C: AsRef<[T]>>(columns: &[C], out: &mut [T]) {
    let width = columns.len();
    // Tiles, so that the cache lines of a few columns serve all rows before they are evicted.
    for (tile, columns) in columns.chunks(SIDE).enumerate() {
        for (lane, row) in out.chunks_exact_mut(width).enumerate() {
            let row = &mut row[tile * SIDE..][..columns.len()];
            row.iter_mut()
                .zip(columns)
                .for_each(|(out, column)| *out = column.as_ref()[lane]);
        }
    }
}

/// Transposes a square of bytes. Interleaving the bytes of both halves rotates the bits of a byte's
/// position by one, the first to the end: after as many rotations as a row number has bits, row and
/// column have changed places.
#[inline(always)]
pub(super) fn transpose_square(square: &Square) -> Square {
    let mut square = *square;
    for _ in 0..SIDE.ilog2() {
        let mut interleaved = [[0; SIDE]; SIDE];
        for (k, pair) in interleaved.as_chunks_mut::<2>().0.iter_mut().enumerate() {
            *pair = interleave(square[k], square[k + SIDE / 2]);
        }
        square = interleaved;
    }
    square
}

/// Interleaves the bytes of both. The code that compilers generate for the plain loop takes eight
/// times as long.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn interleave(a: [u8; SIDE], b: [u8; SIDE]) -> [[u8; SIDE]; 2] {
    use std::arch::x86_64::{__m128i, _mm_unpackhi_epi8, _mm_unpacklo_epi8};
    // SAFETY: both types are sixteen bytes of any value.
    let vector = |bytes: [u8; SIDE]| unsafe { std::mem::transmute::<[u8; SIDE], __m128i>(bytes) };
    let (a, b) = (vector(a), vector(b));
    // SAFETY: as above; and every CPU of this architecture has SSE2.
    unsafe { std::mem::transmute([_mm_unpacklo_epi8(a, b), _mm_unpackhi_epi8(a, b)]) }
}

#[cfg(target_arch = "aarch64")]
#[inline(always)]
fn interleave(a: [u8; SIDE], b: [u8; SIDE]) -> [[u8; SIDE]; 2] {
    use std::arch::aarch64::{uint8x16_t, vzip1q_u8, vzip2q_u8};
    // SAFETY: both types are sixteen bytes of any value.
    let vector = |bytes: [u8; SIDE]| unsafe { std::mem::transmute::<_, uint8x16_t>(bytes) };
    let (a, b) = (vector(a), vector(b));
    // SAFETY: as above; and every CPU of this architecture has NEON.
    unsafe { std::mem::transmute([vzip1q_u8(a, b), vzip2q_u8(a, b)]) }
}

#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
#[inline(always)]
fn interleave(a: [u8; SIDE], b: [u8; SIDE]) -> [[u8; SIDE]; 2] {
    let mut interleaved = [[0; SIDE]; 2];
    for (to, (a, b)) in interleaved
        .as_flattened_mut()
        .as_chunks_mut::<2>()
        .0
        .iter_mut()
        .zip(a.into_iter().zip(b))
    {
        *to = [a, b];
    }
    interleaved
}
