//! Convolution along columns.

use crate::stereo::Gray;

const BLOCK: usize = 64;

/// See [`super::smooth_row`].
#[inline(always)]
pub(super) fn row(image: &Gray, y: usize, weights: &[u32], out: &mut [u8]) {
    let last = image.height() - 1;
    for (block, out) in out.chunks_mut(BLOCK).enumerate() {
        let start = block * BLOCK;
        // Blocks of one size, so that the compiler knows how many vectors they are.
        let pixels = |y: usize| -> [u8; BLOCK] {
            let row = &image.row(y)[start..];
            row.first_chunk().copied().unwrap_or_else(|| {
                let mut pixels = [0; BLOCK];
                pixels[..row.len()].copy_from_slice(row);
                pixels
            })
        };
        let mut sums = [1 << 15; BLOCK];
        let centre = pixels(y);
        for i in 0..BLOCK {
            sums[i] += weights[0] * u32::from(centre[i]);
        }
        for (k, &weight) in weights.iter().enumerate().skip(1) {
            let (above, below) = (pixels(y.saturating_sub(k)), pixels((y + k).min(last)));
            for i in 0..BLOCK {
                sums[i] += weight * (u32::from(above[i]) + u32::from(below[i]));
            }
        }
        let smoothed = sums.map(|sum| (sum >> 16) as u8);
        out.copy_from_slice(&smoothed[..out.len()]);
    }
}
