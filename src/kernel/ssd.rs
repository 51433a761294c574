//! Sums of squared differences of windows of nine pixels, for all rows of a block at once.
//!
//! As a window moves on by one pixel, one square comes in and one goes out (thesis, section 5.3.3, "Optimization", and
//! figure 5.10). The sums are kept in 16 bits, twice as many to a vector as 32 would allow: each square is capped at
//! [`CAP`], so that nine of them fit. **A capped sum below [`CAP`] is exact**, as none of its squares was capped, **and
//! one that is not is still no larger than the exact sum.** So a minimum below [`CAP`] is the exact minimum; callers
//! look up the rest, windows that differ by 28 grey levels on average and more, one by one.

use super::Lanes;

/// Half of the window: it covers x − 4 ..= x + 4.
const REACH: usize = 4;

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
            update(&mut sums[from..to], left, column, right, windows);
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
        update(sums, block, x, block, windows.clone());
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

/// Makes of `sums` the capped SSDs of the window around `x` in `left` with each of the `windows` in `right`, from the
/// rightmost on. Before, they were those for `x - 1` and windows one pixel to the left.
#[inline(always)]
fn update(
    sums: &mut [Lanes<u16>],
    left: &[Lanes<u16>],
    x: usize,
    right: &[Lanes<u16>],
    windows: std::ops::Range<usize>,
) {
    // Windows that were not there before: all for the first x, else that at the left edge.
    let fresh = if x == REACH { windows.end } else { windows.end.min(REACH + 1) }.max(windows.start);
    let (slid, new) = sums.split_at_mut(windows.end - fresh);
    if !slid.is_empty() {
        let (come, gone) = (&left[x + REACH], &left[x - REACH - 1]);
        let come_right = right[fresh + REACH..windows.end + REACH].iter().rev();
        let gone_right = right[fresh - REACH - 1..windows.end - REACH - 1].iter().rev();
        for (sum, (come_right, gone_right)) in slid.iter_mut().zip(come_right.zip(gone_right)) {
            for l in 0..Lanes::COUNT {
                let (come, gone) = (square(come, come_right, l), square(gone, gone_right, l));
                sum.0[l] = sum.0[l].wrapping_add(come).wrapping_sub(gone);
            }
        }
    }
    for (sum, u) in new.iter_mut().zip((windows.start..fresh).rev()) {
        *sum = Lanes([0; Lanes::COUNT]);
        for (a, b) in left[x - REACH..=x + REACH].iter().zip(&right[u - REACH..=u + REACH]) {
            for l in 0..Lanes::COUNT {
                sum.0[l] += square(a, b, l);
            }
        }
    }
}

#[inline(always)]
fn square(a: &Lanes<u16>, b: &Lanes<u16>, l: usize) -> u16 {
    // Pixels have 8 bits, so the square is right modulo 65536 whatever the difference's sign.
    let difference = a.0[l].wrapping_sub(b.0[l]);
    difference.wrapping_mul(difference).min(CAP)
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

/// See [`super::transpose_back`].
#[inline(always)]
pub(super) fn transpose_back(columns: &[Lanes<u16>], out: &mut [u16]) {
    const TILE: usize = 16;
    let width = columns.len();
    for (tile, columns) in columns.chunks(TILE).enumerate() {
        for (lane, row) in out.chunks_exact_mut(width).enumerate() {
            let row = &mut row[tile * TILE..][..columns.len()];
            row.iter_mut().zip(columns).for_each(|(out, column)| *out = column.0[lane]);
        }
    }
}
