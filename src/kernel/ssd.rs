//! Sums of squared differences of windows of nine pixels, for all rows of a block at once.
//!
//! As a window moves on by one pixel, one square comes in and one goes out (thesis, section 5.3.3, "Optimization", and
//! figure 5.10). The sums are kept in 16 bits, twice as many to a vector as 32 would allow: each square is capped at
//! [`CAP`], so that nine of them fit. **A capped sum below [`CAP`] is exact**, as none of its squares was capped, **and
//! one that is not is still no larger than the exact sum.** So a minimum below [`CAP`] is the exact minimum; callers
//! look up the rest, windows that differ by 28 grey levels on average and more, one by one.

use super::Lanes;
use super::slide::{REACH, slide};

/// Largest square in a capped sum.
pub const CAP: u16 = u16::MAX / (2 * REACH as u16 + 1);

/// The best disparity of a window so far, in each row of a block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Winners {
    /// Least `capped SSD · weight`.
    cost: Lanes<u32>,
    winner: Lanes<Winner>,
}

/// A disparity, counted from the first, and its capped SSD, in one word.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Winner(u32);

impl Winner {
    /// Nothing compared.
    pub const NONE: Self = Self(u32::MAX);

    pub fn index(self) -> u32 {
        self.0 >> 16
    }

    pub fn capped_ssd(self) -> u32 {
        self.0 & 0xffff
    }
}

impl Winners {
    /// Nothing compared yet.
    pub const NONE: Self = Self { cost: Lanes([u32::MAX; Lanes::COUNT]), winner: Lanes([Winner::NONE; Lanes::COUNT]) };
}

/// See [`super::winners`].
#[inline(always)]
pub(super) fn winners(
    left: &[Lanes<u16>],
    right: &[Lanes<u16>],
    first: i32,
    weights: &[u32],
    sums: &mut [Lanes<u16>],
    out: &mut [Winners],
) {
    let (width, count) = (left.len() as i32, sums.len() as i32);
    let reach = REACH as i32;
    for x in reach..width - reach {
        // Disparities that keep the window inside the right image, counted from the first.
        let from = (x - (width - 1 - reach) - first).clamp(0, count) as usize;
        let to = (x - reach + 1 - first).clamp(0, count) as usize;
        let column = x as usize;
        let winners = &mut out[column];
        *winners = Winners::NONE;
        if from < to {
            // The windows of those disparities, from the right to the left.
            let windows = (x - first) as usize + 1 - to..(x - first) as usize + 1 - from;
            slide(&mut sums[from..to], left, column, right, windows);
            compete(&sums[from..to], &weights[from..to], from as u32, winners);
        }
    }
}

/// See [`super::least_ssd`].
#[inline(always)]
pub(super) fn least(block: &[Lanes<u16>], sums: &mut [Lanes<u16>], out: &mut [Lanes<u16>]) {
    out.fill(Lanes([u16::MAX; Lanes::COUNT]));
    for x in REACH..block.len().saturating_sub(REACH) {
        let windows = x.saturating_sub(sums.len()).max(REACH)..x;
        let sums = &mut sums[..windows.len()];
        slide(sums, block, x, block, windows.clone());
        // One sum serves both windows.
        let mut here = out[x];
        for (sum, there) in sums.iter().zip(out[windows].iter_mut().rev()) {
            meet(&mut here, there, sum);
        }
        out[x] = here;
    }
}

#[inline(always)]
fn meet(here: &mut Lanes<u16>, there: &mut Lanes<u16>, sum: &Lanes<u16>) {
    for l in 0..Lanes::COUNT {
        here.0[l] = here.0[l].min(sum.0[l]);
        there.0[l] = there.0[l].min(sum.0[l]);
    }
}

/// Lets the disparities from `index` on compete with the winners so far, which keep their place at equal cost.
#[inline(always)]
fn compete(sums: &[Lanes<u16>], weights: &[u32], index: u32, winners: &mut Winners) {
    let (fours, rest) = sums.as_chunks::<4>();
    let (weights_of_fours, weights_of_rest) = weights.as_chunks::<4>();
    for (sums, (weights, index)) in fours.iter().zip(weights_of_fours.iter().zip((index..).step_by(4))) {
        select(sums, weights, index, winners);
    }
    for (sum, (weight, index)) in rest.iter().zip(weights_of_rest.iter().zip(index + 4 * fours.len() as u32..)) {
        select(std::array::from_ref(sum), std::array::from_ref(weight), index, winners);
    }
}

#[inline(always)]
fn select<const N: usize>(sums: &[Lanes<u16>; N], weights: &[u32; N], index: u32, winners: &mut Winners) {
    for l in 0..Lanes::COUNT {
        let (mut least, mut winner) = (winners.cost.0[l], winners.winner.0[l].0);
        for k in 0..N {
            let ssd = u32::from(sums[k].0[l]);
            let cost = ssd * weights[k];
            winner = if cost < least { (index + k as u32) << 16 | ssd } else { winner };
            least = least.min(cost);
        }
        (winners.cost.0[l], winners.winner.0[l]) = (least, Winner(winner));
    }
}

/// See [`super::winner_rows`].
#[inline(always)]
pub(super) fn winner_rows(columns: &[Winners], out: &mut [Winner]) {
    const TILE: usize = 16;
    let width = columns.len();
    for (tile, columns) in columns.chunks(TILE).enumerate() {
        for (lane, row) in out.chunks_exact_mut(width).enumerate() {
            let row = &mut row[tile * TILE..][..columns.len()];
            row.iter_mut().zip(columns).for_each(|(out, column)| *out = column.winner.0[lane]);
        }
    }
}
