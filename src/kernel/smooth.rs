//! Convolution along columns.

use crate::stereo::Gray;

const BLOCK: usize = 64;

/// See [`super::smooth_row`].
#[inline(always)]
pub(super) fn row(image: &Gray, y: usize, weights: &[u32], out: &mut [u8]) {
    let last = image.height() - 1;
    for (block, out) in out.chunks_mut(BLOCK).enumerate() {
        let x = block * BLOCK..block * BLOCK + out.len();
        let mut sums = [1 << 15; BLOCK];
        let centre = &image.row(y)[x.clone()];
        sums.iter_mut().zip(centre).for_each(|(sum, &pixel)| *sum += weights[0] * u32::from(pixel));
        for (k, &weight) in weights.iter().enumerate().skip(1) {
            let above = &image.row(y.saturating_sub(k))[x.clone()];
            let below = &image.row((y + k).min(last))[x.clone()];
            for (sum, (&a, &b)) in sums.iter_mut().zip(above.iter().zip(below)) {
                *sum += weight * (u32::from(a) + u32::from(b));
            }
        }
        out.iter_mut().zip(sums).for_each(|(out, sum)| *out = (sum >> 16) as u8);
    }
}
