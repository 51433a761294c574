//! How much the pixels of a window differ among themselves.

use super::slide::REACH;

const BLOCK: usize = 64;

/// See [`super::deviating_row`].
#[inline(always)]
pub(super) fn row(row: &[u8], least: u32, out: &mut [bool]) {
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
        for k in 0..=2 * REACH {
            for i in 0..BLOCK {
                let pixel = u32::from(around[i + k]);
                sums[i] += pixel;
                squares[i] += pixel * pixel;
            }
        }
        for i in 0..BLOCK {
            textured[i] = 9 * squares[i] - sums[i] * sums[i] >= least;
        }
        out.copy_from_slice(&textured[..out.len()]);
    }
}
