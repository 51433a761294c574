//! 5 x 5 census in 24 bits, as three planes of bytes, and the penalties of disparity steps.

use super::Lanes;

const N: usize = Lanes::COUNT;

/// Planes of bytes of a census of 24 neighbours.
pub const SMALL_CENSUS_PLANES: usize = 3;

/// Reach of the window to either side, pixels.
pub const SMALL_CENSUS_REACH: usize = 2;

/// A power of two above the greatest difference of two pixels at half size.
pub const STEPS: usize = 1024;

/// See [`super::small_census_row`].
#[inline(always)]
pub(super) fn census(rows: [&[u16]; 5], out: [&mut [u8]; SMALL_CENSUS_PLANES]) {
    const REACH: usize = SMALL_CENSUS_REACH;
    let lanes = |row: &[u16], at: usize| -> [u16; N] {
        *row[at..].first_chunk().expect("a block and its margin")
    };
    let neighbours = |k: usize| if k < 12 { k } else { k + 1 };
    for (plane, out) in out.into_iter().enumerate() {
        for (block, out) in out.as_chunks_mut::<N>().0.iter_mut().enumerate() {
            let x = block * N;
            let centre = lanes(rows[REACH], x + REACH);
            let mut bits = [0_u16; N];
            for k in 8 * plane..8 * plane + 8 {
                let k = neighbours(k);
                let neighbour = lanes(rows[k / 5], x + k % 5);
                for i in 0..N {
                    bits[i] = bits[i] << 1 | u16::from(neighbour[i] < centre[i]);
                }
            }
            for i in 0..N {
                out[i] = bits[i] as u8;
            }
        }
    }
}

/// See [`super::step_penalties`].
#[inline(always)]
pub(super) fn penalties([from, to]: [&[u16]; 2], table: &[u8; STEPS], out: &mut [u8]) {
    for ((out, &from), &to) in out.iter_mut().zip(from).zip(to) {
        *out = table[usize::from(from.abs_diff(to)) % STEPS];
    }
}
