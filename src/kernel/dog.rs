//! Two differences of Gaussians along a row, compared.

/// Fixed-point weights (65536 = 1) of the fine and the coarse difference of Gaussians at distance 0
/// ..= 12.
///
/// Both are even functions, yet the taps stand at −12 ..= +11: distance 12 counts on the left side
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

const BLOCK: usize = 64;
const REACH: usize = DogTaps::REACH;

/// See [`super::textured_row`].
#[inline(always)]
pub(super) fn row(row: &[u8], taps: &DogTaps, out: &mut [bool]) {
    let last = row.len() - 1;
    for (block, out) in out.chunks_mut(BLOCK).enumerate() {
        let start = block * BLOCK;
        // around[i] is pixel start + i - REACH, edges replicated.
        let mut around = [row[last]; BLOCK + 2 * REACH];
        let missing = REACH.saturating_sub(start);
        around[..missing].fill(row[0]);
        let source = &row[start + missing - REACH..row.len().min(start + BLOCK + REACH)];
        around[missing..][..source.len()].copy_from_slice(source);
        let mut fine = [0i32; BLOCK];
        let mut coarse = [0i32; BLOCK];
        for i in 0..BLOCK {
            let centre = i32::from(around[i + REACH]);
            let leftmost = i32::from(around[i]);
            fine[i] = taps.fine[0] * centre + taps.fine[REACH] * leftmost;
            coarse[i] = taps.coarse[0] * centre + taps.coarse[REACH] * leftmost;
        }
        for k in 1..REACH {
            for i in 0..BLOCK {
                let both = i32::from(around[i + REACH - k]) + i32::from(around[i + REACH + k]);
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
