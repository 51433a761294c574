//! Texture tests of the pixels of a row: two differences of Gaussians compared (thesis, section
//! 5.3.3), and the standard deviation of a window (section 5.3.2).

use super::sliding_ssd::{REACH, WINDOW};

/// Fixed-point weights (65536 = 1) of the fine and the coarse difference of Gaussians at distance 0
/// ..= 12.
///
/// Both are even functions, but the taps cover −12 ..= +11: distance 12 counts on the left side
/// only.
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

/// See [`super::textured_row`].
#[inline(always)]
pub(super) fn dog(row: &[u8], taps: &DogTaps, out: &mut [bool]) {
    let last = row.len() - 1;
    for (block, out) in out.chunks_mut(BLOCK).enumerate() {
        let start = block * BLOCK;
        // around[i] is pixel start + i - TAPS, edges replicated.
        let mut around = [row[last]; BLOCK + 2 * TAPS];
        let missing = TAPS.saturating_sub(start);
        around[..missing].fill(row[0]);
        let source = &row[start + missing - TAPS..row.len().min(start + BLOCK + TAPS)];
        around[missing..][..source.len()].copy_from_slice(source);
        let mut fine = [0i32; BLOCK];
        let mut coarse = [0i32; BLOCK];
        for i in 0..BLOCK {
            let centre = i32::from(around[i + TAPS]);
            let leftmost = i32::from(around[i]);
            fine[i] = taps.fine[0] * centre + taps.fine[TAPS] * leftmost;
            coarse[i] = taps.coarse[0] * centre + taps.coarse[TAPS] * leftmost;
        }
        for k in 1..TAPS {
            for i in 0..BLOCK {
                let both = i32::from(around[i + TAPS - k]) + i32::from(around[i + TAPS + k]);
                fine[i] += taps.fine[k] * both;
                coarse[i] += taps.coarse[k] * both;
            }
        }
        let mut textured = [false; BLOCK];
        for i in 0..BLOCK {
            textured[i] = fine[i].abs() >= coarse[i].abs();
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
