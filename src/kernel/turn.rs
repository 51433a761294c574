//! Squares of bytes whose rows become columns.

pub(super) const SIDE: usize = 16;

/// Rows of bytes.
pub(super) type Square = [[u8; SIDE]; SIDE];

/// Makes rows columns. To merge the halves of all bytes, one from each by turns, moves the first
/// bit of a byte's place to the end: after as many times as a row's number has bits, row and column
/// have changed places.
#[inline(always)]
pub(super) fn turn(square: &Square) -> Square {
    let mut square = *square;
    for _ in 0..SIDE.ilog2() {
        let mut merged = [[0; SIDE]; SIDE];
        for (k, pair) in merged.as_chunks_mut::<2>().0.iter_mut().enumerate() {
            *pair = merge(square[k], square[k + SIDE / 2]);
        }
        square = merged;
    }
    square
}

/// The bytes of both by turns. What compilers make of the plain loop takes eight times as long.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn merge(a: [u8; SIDE], b: [u8; SIDE]) -> [[u8; SIDE]; 2] {
    use std::arch::x86_64::{__m128i, _mm_unpackhi_epi8, _mm_unpacklo_epi8};
    // SAFETY: both types are sixteen bytes of any value.
    let vector = |bytes: [u8; SIDE]| unsafe { std::mem::transmute::<[u8; SIDE], __m128i>(bytes) };
    let (a, b) = (vector(a), vector(b));
    // SAFETY: as above; and every CPU of this architecture has SSE2.
    unsafe { std::mem::transmute([_mm_unpacklo_epi8(a, b), _mm_unpackhi_epi8(a, b)]) }
}

#[cfg(not(target_arch = "x86_64"))]
#[inline(always)]
fn merge(a: [u8; SIDE], b: [u8; SIDE]) -> [[u8; SIDE]; 2] {
    let mut merged = [[0; SIDE]; 2];
    for (to, (a, b)) in merged
        .as_flattened_mut()
        .as_chunks_mut::<2>()
        .0
        .iter_mut()
        .zip(a.into_iter().zip(b))
    {
        *to = [a, b];
    }
    merged
}
