//! Rows as lanes: blocks of rows transposed so that one vector holds a pixel of every row.
//!
//! A scan along the row is then the same for all lanes of a block: windows slide, nothing is
//! gathered or reduced across lanes, and every load is aligned.

use crate::stereo::Gray;
#[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
use std::mem::transmute;

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

/// Transposes a square. Interleaving both halves rotates the bits of a number's position by one,
/// the first to the end: after as many rotations as a row number has bits, row and column have
/// changed places.
#[inline(always)]
pub(super) fn transpose_square<T: Interleave<N>, const N: usize>(
    square: &[[T; N]; N],
) -> [[T; N]; N] {
    let mut square = *square;
    for _ in 0..N.ilog2() {
        let mut interleaved = [[T::default(); N]; N];
        for (k, pair) in interleaved.as_chunks_mut::<2>().0.iter_mut().enumerate() {
            *pair = T::interleave(square[k], square[k + N / 2]);
        }
        square = interleaved;
    }
    square
}

/// Numbers of which N fill a vector of sixteen bytes.
pub(super) trait Interleave<const N: usize>: Copy + Default {
    /// Interleaves the numbers of both.
    fn interleave(a: [Self; N], b: [Self; N]) -> [[Self; N]; 2];
}

/// [`Interleave`] by instructions: the code that compilers generate for the plain loop takes eight
/// times as long.
macro_rules! interleave {
    ($(
        [$number:ty; $n:literal],
        $x86:ident $x86_high:ident, $vector:ident $arm:ident $arm_high:ident;
    )*) => {$(
        impl Interleave<$n> for $number {
            #[cfg(target_arch = "x86_64")]
            #[inline(always)]
            fn interleave(a: [Self; $n], b: [Self; $n]) -> [[Self; $n]; 2] {
                use std::arch::x86_64::{__m128i, $x86, $x86_high};
                // SAFETY: both types are numbers of any value.
                let [a, b] = unsafe { transmute::<[[Self; $n]; 2], [__m128i; 2]>([a, b]) };
                // SAFETY: as above; and every CPU of this architecture has SSE2.
                unsafe { transmute::<[__m128i; 2], [[Self; $n]; 2]>([$x86(a, b), $x86_high(a, b)]) }
            }

            #[cfg(target_arch = "aarch64")]
            #[inline(always)]
            fn interleave(a: [Self; $n], b: [Self; $n]) -> [[Self; $n]; 2] {
                use std::arch::aarch64::{$arm, $arm_high, $vector};
                // SAFETY: both types are numbers of any value.
                let [a, b] = unsafe { transmute::<[[Self; $n]; 2], [$vector; 2]>([a, b]) };
                // SAFETY: as above; and every CPU of this architecture has NEON.
                unsafe { transmute::<[$vector; 2], [[Self; $n]; 2]>([$arm(a, b), $arm_high(a, b)]) }
            }

            #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
            #[inline(always)]
            fn interleave(a: [Self; $n], b: [Self; $n]) -> [[Self; $n]; 2] {
                let mut interleaved = [[0; $n]; 2];
                let pairs = interleaved.as_flattened_mut().as_chunks_mut::<2>().0;
                for (to, (a, b)) in pairs.iter_mut().zip(a.into_iter().zip(b)) {
                    *to = [a, b];
                }
                interleaved
            }
        }
    )*};
}

interleave! {
    [u8; 16], _mm_unpacklo_epi8 _mm_unpackhi_epi8, uint8x16_t vzip1q_u8 vzip2q_u8;
    [u16; 8], _mm_unpacklo_epi16 _mm_unpackhi_epi16, uint16x8_t vzip1q_u16 vzip2q_u16;
    [i16; 8], _mm_unpacklo_epi16 _mm_unpackhi_epi16, int16x8_t vzip1q_s16 vzip2q_s16;
}
