//! Texture tests of the pixels of a row: two differences of Gaussians compared (thesis, section
//! 5.3.3), and the standard deviation of a window (section 5.3.2).

use super::pairs::{Group, Pairs};
use super::sliding_ssd::{REACH, WINDOW};

/// Fixed-point weights (65536 = 1) of the fine and the coarse difference of Gaussians at distance 0
/// ..= 12.
///
/// Both are even functions, but the taps cover −12 ..= +11: distance 12 counts on the left side
/// only. The weight of distance 0 has at most 21 bits with its sign, the others have 16.
#[derive(Clone, Debug, PartialEq)]
pub struct DogTaps {
    pub fine: [i32; DogTaps::REACH + 1],
    pub coarse: [i32; DogTaps::REACH + 1],
}

impl DogTaps {
    /// Farthest tap to the left; to the right it is one less.
    pub const REACH: usize = 12;
}

/// Pixels tested together.
const BLOCK: usize = 64;
/// Reach of the Gaussians.
const TAPS: usize = DogTaps::REACH;
/// The number of distances, in pairs. Distance 0 takes a pair of its own.
const PAIRS: usize = 1 + TAPS / 2;
/// Low bits of the weight of distance 0: the rest fits 16 bits, too, and so does a pixel times
/// their power of two.
const LOW_BITS: u32 = 6;

/// The weights of a difference of Gaussians, in pairs.
#[inline(always)]
fn weight_pairs(taps: &[i32; TAPS + 1]) -> [[i16; 2]; PAIRS] {
    let mut weights = [[0; 2]; PAIRS];
    let low = taps[0] & ((1 << LOW_BITS) - 1);
    weights[0] = [(taps[0] >> LOW_BITS) as i16, low as i16];
    for (weights, taps) in weights[1..].iter_mut().zip(taps[1..].as_chunks::<2>().0) {
        *weights = taps.map(|tap| tap as i16);
    }
    weights
}

/// See [`super::textured_row`].
#[inline(always)]
pub(super) fn dog(pairs: impl Pairs, row: &[u8], taps: &DogTaps, out: &mut [bool]) {
    let last = row.len() - 1;
    let (fine, coarse) = (weight_pairs(&taps.fine), weight_pairs(&taps.coarse));
    // The pixels, raised and plain, and then the sums of those at each distance on both sides.
    let mut planes = [[0; BLOCK]; 2 * PAIRS];
    for (block, out) in out.chunks_mut(BLOCK).enumerate() {
        let start = block * BLOCK;
        // around[i] is pixel start + i - TAPS, edges replicated.
        let mut around = [row[last]; BLOCK + 2 * TAPS];
        let missing = TAPS.saturating_sub(start);
        around[..missing].fill(row[0]);
        let source = &row[start + missing - TAPS..row.len().min(start + BLOCK + TAPS)];
        around[missing..][..source.len()].copy_from_slice(source);
        let mut numbers = [0; BLOCK + 2 * TAPS];
        for i in 0..numbers.len() {
            numbers[i] = i16::from(around[i]);
        }
        let (centre, sides) = planes.split_at_mut(2);
        for i in 0..BLOCK {
            centre[0][i] = numbers[i + TAPS] << LOW_BITS;
            centre[1][i] = numbers[i + TAPS];
        }
        for (k, sums) in (1..TAPS).zip(&mut *sides) {
            for i in 0..BLOCK {
                sums[i] = numbers[i + TAPS - k] + numbers[i + TAPS + k];
            }
        }
        sides[TAPS - 1].copy_from_slice(&numbers[..BLOCK]);
        let mut textured = [false; BLOCK];
        for (i, textured) in textured.as_chunks_mut().0.iter_mut().enumerate() {
            let mut sums = [Group::splat(0); 2];
            for (pair, planes) in planes.as_chunks().0.iter().enumerate() {
                let numbers = planes.each_ref().map(|plane| plane.as_chunks().0[i]);
                let numbers = pairs.pair_up(&numbers);
                sums[0] = pairs.add_weighted(sums[0], numbers, fine[pair]);
                sums[1] = pairs.add_weighted(sums[1], numbers, coarse[pair]);
            }
            *textured = [false; Group::ROWS];
            let [fine, coarse] = &sums;
            for (l, textured) in textured.iter_mut().enumerate() {
                *textured = (fine.0[l] as i32).abs() >= (coarse.0[l] as i32).abs();
            }
        }
        out.copy_from_slice(&textured[..out.len()]);
    }
}

/// See [`super::deviating_row`].
#[inline(always)]
pub(super) fn deviation(row: &[u8], least: u32, out: &mut [bool]) {
    out.fill(false);
    let windows = row.len().saturating_sub(2 * REACH);
    if windows == 0 {
        return;
    }
    for (block, out) in out[REACH..REACH + windows].chunks_mut(BLOCK).enumerate() {
        let start = block * BLOCK;
        let mut around = [0; BLOCK + 2 * REACH];
        let source = &row[start..row.len().min(start + around.len())];
        around[..source.len()].copy_from_slice(source);
        let mut textured = [false; BLOCK];
        let [mut sums, mut squares] = [[0u32; BLOCK]; 2];
        for k in 0..WINDOW {
            for i in 0..BLOCK {
                let pixel = u32::from(around[i + k]);
                sums[i] += pixel;
                squares[i] += pixel * pixel;
            }
        }
        for i in 0..BLOCK {
            textured[i] = WINDOW as u32 * squares[i] - sums[i] * sums[i] >= least;
        }
        out.copy_from_slice(&textured[..out.len()]);
    }
}
