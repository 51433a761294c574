//! Sums of absolute differences (SAD) over square windows, for a row of pixels.
//!
//! The columns of the windows are summed first and slide down with the rows: one difference enters,
//! one leaves. The windows slide along the row in the same way. Disparities are the lanes: a pixel
//! is compared with neighbours in the other image, and whole lanes enter and leave.

use super::PREFILTER_CAP;
use super::lanes::transpose_square;
use crate::stereo::{Reason, RowMut};

/// Pixels whose winners are tested together.
pub const PIXELS: usize = 64;

/// Side of a square that is transposed.
const SIDE: usize = 8;

/// Sums at consecutive disparities, the highest first.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct Sads([u16; Self::COUNT]);

impl Sads {
    /// Rows passed to these kernels extend that far beyond the last pixel that is compared.
    pub const COUNT: usize = 32;
    pub const ZERO: Self = Self([0; Self::COUNT]);
}

/// SADs of the windows of neighbouring pixels. Scratch.
pub struct SadBlock {
    /// Number of disparities.
    count: usize,
    /// Sums of all columns of the window but the last, plus [`BIAS`] modulo 2¹⁶.
    sums: Vec<Sads>,
    by_pixel: Vec<Sads>,
    /// Between two that are never the least.
    by_disparity: Vec<SadsOfPixels>,
}

/// SADs of neighbouring pixels at one disparity, less [`BIAS`].
#[derive(Clone, Copy)]
#[repr(align(64))]
struct SadsOfPixels([u16; PIXELS]);

impl SadsOfPixels {
    const GREATEST: Self = Self([i16::MAX as u16; PIXELS]);

    #[inline(always)]
    fn signed(&self) -> [i16; PIXELS] {
        self.0.map(|sad| sad as i16)
    }
}

impl SadBlock {
    /// For that many disparities.
    pub fn new(count: usize) -> Self {
        let columns = count.div_ceil(Sads::COUNT);
        Self {
            count,
            sums: vec![Sads::ZERO; columns],
            by_pixel: vec![Sads::ZERO; columns * PIXELS],
            by_disparity: vec![SadsOfPixels::GREATEST; columns * Sads::COUNT + 2],
        }
    }

    /// Number of [`Sads`] of a column.
    pub fn column(&self) -> usize {
        self.sums.len()
    }

    /// Moves the windows along the pixels of the block: for each a column enters, and one leaves
    /// before the next pixel.
    #[inline(always)]
    fn slide(&mut self, entering: &[Sads], leaving: &[Sads]) {
        let column = self.column();
        for (at, sums) in self.sums.iter_mut().enumerate() {
            let sads = self.by_pixel[at..].iter_mut().step_by(column);
            let entering = entering[at..].iter().step_by(column);
            let leaving = leaving[at..].iter().step_by(column);
            let mut sum = *sums;
            for (sads, (entering, leaving)) in sads.zip(entering.zip(leaving)) {
                // Copies, which do not overlap.
                let (entering, leaving) = (*entering, *leaving);
                for i in 0..Sads::COUNT {
                    sum.0[i] = sum.0[i].wrapping_add(entering.0[i]);
                }
                *sads = sum;
                for i in 0..Sads::COUNT {
                    sum.0[i] = sum.0[i].wrapping_sub(leaving.0[i]);
                }
            }
            *sums = sum;
        }
    }

    #[inline(always)]
    fn transpose(&mut self) {
        let column = self.column();
        for (at, lanes) in self.by_disparity[1..].chunks_exact_mut(SIDE).enumerate() {
            let (sads, lane) = (at * SIDE / Sads::COUNT, at * SIDE % Sads::COUNT);
            for (x, pixels) in self.by_pixel.chunks_exact(SIDE * column).enumerate() {
                let mut square = [[0; SIDE]; SIDE];
                for (i, row) in square.iter_mut().enumerate() {
                    row.copy_from_slice(&pixels[i * column + sads].0[lane..lane + SIDE]);
                }
                for (lanes, row) in lanes.iter_mut().zip(transpose_square(&square)) {
                    lanes.0[x * SIDE..(x + 1) * SIDE].copy_from_slice(&row);
                }
            }
        }
        self.by_disparity[1 + self.count] = SadsOfPixels::GREATEST;
    }

    /// The winners of the block.
    #[inline(always)]
    fn winners(&self, uniqueness: u32) -> SadWinners {
        let sads = &self.by_disparity[1..=self.count];
        let mut least = [i16::MAX; PIXELS];
        let mut place = [0i16; PIXELS];
        for (index, sads) in (0..).zip(sads) {
            let sads = sads.signed();
            for i in 0..PIXELS {
                // The index increases: the last one that takes the lead is the greatest.
                let takes = i16::from(sads[i] < least[i]).wrapping_neg();
                place[i] = place[i].max(takes & index);
                least[i] = least[i].min(sads[i]);
            }
        }
        let [mut before, mut after] = [[i16::MAX; PIXELS]; 2];
        for (i, place) in place.into_iter().enumerate() {
            let place = place as usize;
            before[i] = self.by_disparity[place].0[i] as i16;
            after[i] = self.by_disparity[place + 2].0[i] as i16;
        }
        let mut rivals = [0; PIXELS];
        if uniqueness > 0 {
            let mut limit = [0; PIXELS];
            for i in 0..PIXELS {
                // Divided as in OpenCV, rounding down, so that decisions are the same.
                let sad = u32::from(unbiased(least[i]));
                let limit_of = sad + sad * uniqueness / 100;
                limit[i] = (limit_of.min(u32::from(u16::MAX) - 1) as u16 ^ BIAS) as i16;
            }
            for sads in sads {
                count_close(&sads.signed(), &limit, 1, &mut rivals);
            }
            for own in [&least, &before, &after] {
                count_close(own, &limit, -1, &mut rivals);
            }
        }
        SadWinners {
            index: place.map(|index| index as u16),
            sad: least.map(unbiased),
            rivals,
            before: before.map(unbiased),
            after: after.map(unbiased),
        }
    }
}

/// Difference of a sum and its signed number: SSE2 compares signed numbers only.
const BIAS: u16 = 1 << 15;

#[inline(always)]
fn unbiased(sad: i16) -> u16 {
    sad as u16 ^ BIAS
}

/// Adds a number to the counts of the pixels whose SAD is within the limit.
#[inline(always)]
fn count_close(sads: &[i16; PIXELS], limit: &[i16; PIXELS], by: i16, counts: &mut [i16; PIXELS]) {
    let (sads, mut sums) = (*sads, *counts);
    for i in 0..PIXELS {
        sums[i] += by & i16::from(sads[i] <= limit[i]).wrapping_neg();
    }
    *counts = sums;
}

/// Cheapest disparities of neighbouring pixels.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct SadWinners {
    /// Index of the winner, counted from the first.
    pub index: [u16; PIXELS],
    pub sad: [u16; PIXELS],
    /// Number of others, except the winner's two neighbours, that are not worse by the uniqueness.
    pub rivals: [i16; PIXELS],
    /// SADs of the neighbours before and after; `u16::MAX` outside the range.
    pub before: [u16; PIXELS],
    pub after: [u16; PIXELS],
}

impl SadWinners {
    /// Nothing compared.
    pub const NONE: Self = Self {
        index: [0; PIXELS],
        sad: [u16::MAX; PIXELS],
        rivals: [0; PIXELS],
        before: [u16::MAX; PIXELS],
        after: [u16::MAX; PIXELS],
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
}

/// See [`super::slide_columns`].
#[inline(always)]
pub(super) fn slide(left: [&[u8]; 2], right: [&[u8]; 2], blocks: usize, columns: &mut [Sads]) {
    for (x, columns) in columns.chunks_exact_mut(blocks).enumerate() {
        let (new, old) = (left[0][x], left[1][x]);
        let met = x..x + blocks * Sads::COUNT;
        let entering = right[0][met.clone()].as_chunks().0;
        let leaving = right[1][met].as_chunks().0;
        for (sums, (entering, leaving)) in columns.iter_mut().zip(entering.iter().zip(leaving)) {
            slide_column(sums, new, entering, old, leaving);
        }
    }
}

#[inline(always)]
fn slide_column(
    sums: &mut Sads,
    new: u8,
    entering: &[u8; Sads::COUNT],
    old: u8,
    leaving: &[u8; Sads::COUNT],
) {
    let (enters, leaves) = (differences(new, entering), differences(old, leaving));
    let mut moved = *sums;
    for i in 0..Sads::COUNT {
        let change = u16::from(enters[i]).wrapping_sub(u16::from(leaves[i]));
        moved.0[i] = moved.0[i].wrapping_add(change);
    }
    *sums = moved;
}

#[inline(always)]
fn differences(pixel: u8, others: &[u8; Sads::COUNT]) -> [u8; Sads::COUNT] {
    let others = *others;
    let mut out = [0; Sads::COUNT];
    for i in 0..Sads::COUNT {
        // `abs_diff` becomes a difference of 32 bits.
        out[i] = pixel.saturating_sub(others[i]) | others[i].saturating_sub(pixel);
    }
    out
}

/// See [`super::least_sads`].
#[inline(always)]
pub(super) fn least(
    columns: &[Sads],
    window: usize,
    uniqueness: u32,
    block: &mut SadBlock,
    out: &mut [SadWinners],
) {
    let column = block.column();
    let (first, entering) = columns.split_at((window - 1) * column);
    block.sums.fill(Sads([BIAS; Sads::COUNT]));
    for column in first.chunks_exact(column) {
        for (sums, column) in block.sums.iter_mut().zip(column) {
            for i in 0..Sads::COUNT {
                sums.0[i] = sums.0[i].wrapping_add(column.0[i]);
            }
        }
    }
    let entering = entering.chunks(PIXELS * column);
    let leaving = columns.chunks(PIXELS * column);
    for (out, (entering, leaving)) in out.iter_mut().zip(entering.zip(leaving)) {
        block.slide(entering, leaving);
        block.transpose();
        *out = block.winners(uniqueness);
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
    let mut sum: u16 = columns[..window - 1].iter().sum();
    let columns = columns[window - 1..].iter().zip(columns);
    for (out, (entering, leaving)) in out.iter_mut().zip(columns) {
        *out = sum + entering;
        sum = *out - leaving;
    }
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
        let mut all = [0; PIXELS];
        all[..textures.len()].copy_from_slice(textures);
        let (disparities, reasons) = accept_block(best, &all, test);
        disparity.copy_from_slice(&disparities[..disparity.len()]);
        why.copy_from_slice(&reasons[..why.len()]);
    }
}

#[inline(always)]
fn accept_block(
    best: &SadWinners,
    textures: &[u16; PIXELS],
    test: &SadTest,
) -> ([f32; PIXELS], [Reason; PIXELS]) {
    let mut disparities = [f32::INFINITY; PIXELS];
    let mut reasons = [Reason::Valid; PIXELS];
    for i in 0..PIXELS {
        let reason = if best.rivals[i] > 0 {
            Reason::Ambiguous
        } else {
            Reason::Valid
        };
        reasons[i] = if textures[i] < test.texture {
            Reason::Untextured
        } else {
            reason
        };
    }
    for i in 0..PIXELS {
        let index = i32::from(best.index[i]);
        let inside = (index > 0) & (index + 1 < i32::from(test.count));
        let fraction = fraction(best.before[i], best.sad[i], best.after[i]);
        let fraction = if inside { fraction } else { 0 };
        // OpenCV's rounding: upwards.
        let sixteenths = ((test.highest - index) * 256 + fraction + 15) >> 4;
        let valid = (best.rivals[i] <= 0) & (textures[i] >= test.texture);
        let found = sixteenths as f32 / 16.0;
        disparities[i] = if valid { found } else { f32::INFINITY };
    }
    (disparities, reasons)
}

/// Position of the minimum between its neighbours, in 256ths of a pixel towards the higher
/// disparity, which comes before.
#[inline(always)]
fn fraction(before: u16, least: u16, after: u16) -> i32 {
    let [before, least, after] = [before, least, after].map(f32::from);
    let slope = after - before;
    let curvature = before + after - 2.0 * least + slope.abs();
    // A flat neighbourhood has no fraction: zero by one. The quotient is at most 128, and its parts
    // are integers below 2²⁴ and 2¹⁸: no rounding reaches the next integer.
    (slope * 256.0 / curvature.max(1.0)) as i32
}
