//! Sums of absolute differences (SAD) over square windows, for a row of pixels at once.
//!
//! The columns of the windows are summed first and slide down with the rows: one difference enters,
//! one leaves. The sum of a window is then that of the neighbouring columns across its width.
//! Pixels are the lanes, disparities the loop: minima, runners-up and the neighbours of the minimum
//! are kept per lane, and nothing is reduced across lanes.

use super::PREFILTER_CAP;
use crate::stereo::{Reason, RowMut};

/// Pixels handled together; rows passed to these kernels extend that far beyond their last pixel.
pub const PIXELS: usize = 64;

/// A pixel's cheapest disparities.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct SadWinners {
    /// Index of the winner, counted from the first.
    pub index: [u16; PIXELS],
    pub sad: [u16; PIXELS],
    /// Least of the others except the winner's two neighbours, `u16::MAX` if there is none.
    pub other: [u16; PIXELS],
    /// SADs of the neighbours before and after; unspecified where they lie outside the range.
    pub before: [u16; PIXELS],
    pub after: [u16; PIXELS],
}

impl SadWinners {
    /// Nothing compared.
    pub const NONE: Self = Self {
        index: [0; PIXELS],
        sad: [u16::MAX; PIXELS],
        other: [u16::MAX; PIXELS],
        before: [0; PIXELS],
        after: [0; PIXELS],
    };
}

/// Thresholds of the tests of a winner.
#[derive(Clone, Copy, Debug)]
pub struct SadTest {
    /// Disparity of the first index; each further index is one less.
    pub highest: i32,
    /// Number of disparities in the range.
    pub count: u16,
    /// Least sum of the prefilter's responses over a window.
    pub texture: u16,
    /// Per cent by which another disparity must be worse; 0 = off.
    pub uniqueness: u32,
}

/// See [`super::slide_columns`].
#[inline(always)]
pub(super) fn slide(left: [&[u8]; 2], right: [&[u8]; 2], stride: usize, sums: &mut [u16]) {
    for (index, sums) in sums.chunks_exact_mut(stride).enumerate() {
        let right = right.map(|row| &row[index..]);
        for (block, sums) in sums.as_chunks_mut::<PIXELS>().0.iter_mut().enumerate() {
            let x = block * PIXELS;
            let pixels = |row: &[u8]| -> [u8; PIXELS] {
                // Rows extend a block beyond their end.
                *row[x..]
                    .first_chunk()
                    .expect("a block beyond the row's end")
            };
            let ([left_in, left_out], [right_in, right_out]) =
                (left.map(pixels), right.map(pixels));
            for i in 0..PIXELS {
                let (new, old) = (
                    left_in[i].abs_diff(right_in[i]),
                    left_out[i].abs_diff(right_out[i]),
                );
                sums[i] = sums[i]
                    .wrapping_add(u16::from(new))
                    .wrapping_sub(u16::from(old));
            }
        }
    }
}

/// See [`super::slide_texture`].
#[inline(always)]
pub(super) fn slide_texture([new, old]: [&[u8]; 2], sums: &mut [u16]) {
    let response = |pixel: u8| u16::from(pixel.abs_diff(PREFILTER_CAP as u8));
    for (sum, (&new, &old)) in sums.iter_mut().zip(new.iter().zip(old)) {
        *sum = sum.wrapping_add(response(new)).wrapping_sub(response(old));
    }
}

/// See [`super::run_sums`].
#[inline(always)]
pub(super) fn run_sums(columns: &[u16], window: usize, out: &mut [u16]) {
    for (block, out) in out.as_chunks_mut::<PIXELS>().0.iter_mut().enumerate() {
        *out = window_sum(columns, block * PIXELS, window);
    }
}

/// See [`super::least_sads`].
#[inline(always)]
pub(super) fn least(sums: &[u16], stride: usize, window: usize, out: &mut [SadWinners]) {
    for (block, out) in out.iter_mut().enumerate() {
        let mut best = SadWinners::NONE;
        // The SADs of the previous disparity, the least of those before it, and whether the
        // previous one took the lead.
        let mut previous = [u16::MAX; PIXELS];
        let mut older = [u16::MAX; PIXELS];
        let mut led = [0u16; PIXELS];
        for (index, columns) in sums.chunks_exact(stride).enumerate() {
            let sads = window_sum(columns, block * PIXELS, window);
            // Read from a copy: a choice between a new value and the one already stored becomes a
            // conditional store, which is a branch on instruction sets without one.
            let now = best;
            for i in 0..PIXELS {
                let (sad, least, led_before) = (sads[i], now.sad[i], led[i]);
                let takes = u16::from(sad < least).wrapping_neg();
                best.other[i] = blend(takes, older[i], now.other[i].min(sad | led_before));
                best.after[i] = blend(led_before, sad, now.after[i]);
                best.before[i] = blend(takes, previous[i], now.before[i]);
                best.index[i] = blend(takes, index as u16, now.index[i]);
                best.sad[i] = least.min(sad);
                led[i] = takes;
            }
            older = now.sad;
            previous = sads;
        }
        *out = best;
    }
}

/// `yes` where the bits of `mask` are set, else `no`.
#[inline(always)]
fn blend(mask: u16, yes: u16, no: u16) -> u16 {
    (yes & mask) | (no & !mask)
}

#[inline(always)]
fn window_sum(columns: &[u16], x: usize, window: usize) -> [u16; PIXELS] {
    let mut sums = [0u16; PIXELS];
    for k in 0..window {
        let columns: &[u16; PIXELS] = columns[x + k..]
            .first_chunk()
            .expect("a block beyond the row's end");
        for i in 0..PIXELS {
            sums[i] += columns[i];
        }
    }
    sums
}

/// See [`super::accept_sads`].
#[inline(always)]
pub(super) fn accept(
    winners: &[SadWinners],
    textures: &[u16],
    test: &SadTest,
    row: &mut RowMut<'_>,
) {
    let (disparity, why, _) = row.planes_mut();
    let pixels = disparity
        .chunks_mut(PIXELS)
        .zip(why.chunks_mut(PIXELS))
        .zip(textures.chunks(PIXELS));
    for (best, ((disparity, why), textures)) in winners.iter().zip(pixels) {
        for (i, ((disparity, why), &texture)) in
            disparity.iter_mut().zip(why).zip(textures).enumerate()
        {
            let (sad, other) = (u32::from(best.sad[i]), u32::from(best.other[i]));
            // Divided as in OpenCV, rounding down, so that decisions are the same.
            let limit = sad + sad * test.uniqueness / 100;
            let ambiguous =
                (test.uniqueness > 0) & (other < u32::from(u16::MAX)) & (other <= limit);
            let reason = if ambiguous {
                Reason::Ambiguous
            } else {
                Reason::Valid
            };
            *why = if texture < test.texture {
                Reason::Untextured
            } else {
                reason
            };
            let whole = test.highest - i32::from(best.index[i]);
            let fraction = if (best.index[i] > 0) & (best.index[i] + 1 < test.count) {
                fraction(best.before[i], best.sad[i], best.after[i])
            } else {
                0
            };
            // OpenCV's rounding: upwards.
            let sixteenths = (whole * 256 + fraction + 15) >> 4;
            *disparity = if *why == Reason::Valid {
                sixteenths as f32 / 16.0
            } else {
                f32::INFINITY
            };
        }
    }
}

/// Position of the minimum between its neighbours, in 256ths of a pixel towards the higher
/// disparity, which comes before.
#[inline(always)]
fn fraction(before: u16, least: u16, after: u16) -> i32 {
    let [before, least, after] = [before, least, after].map(f64::from);
    let slope = after - before;
    let curvature = before + after - 2.0 * least + slope.abs();
    // A flat neighbourhood has no fraction.
    if curvature > 0.0 {
        (slope * 256.0 / curvature) as i32
    } else {
        0
    }
}
