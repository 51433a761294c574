//! Block matching with whole sums, for filters that look at all costs of a window and not only at the least.

use super::Lanes;
use super::slide::{REACH, slide};

/// What is matched: a block of rows of an image with the same rows of another.
#[derive(Clone, Copy)]
pub struct Search<'a> {
    pub left: &'a [Lanes<u16>],
    pub right: &'a [Lanes<u16>],
    /// The first disparity.
    pub first: i32,
    /// What multiplies the SSD of each disparity from the first on to make it a cost; costs fit 32 bits.
    pub weights: &'a [u32],
}

/// A disparity, counted from the first, and its SSD, in one word.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Match(u32);

impl Match {
    /// Nothing compared.
    pub const NONE: Self = Self(u32::MAX);
    /// Bits of an SSD: 9 · 255² < 2²⁰.
    const BITS: u32 = 20;
    /// How many disparities there may be.
    pub const DISPARITIES: usize = 1 << (u32::BITS - Self::BITS);

    pub fn index(self) -> u32 {
        self.0 >> Self::BITS
    }

    pub fn ssd(self) -> u32 {
        self.0 & ((1 << Self::BITS) - 1)
    }
}

/// What a filter says of a window's costs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Doubt {
    Certain,
    Ambiguous,
    /// The kernel cannot tell.
    Open,
}

/// The costs of a column of windows: `sums` times `weights`, for the disparities from `index` on.
struct Costs<'a> {
    sums: &'a [Lanes<u32>],
    weights: &'a [u32],
    index: usize,
}

/// The cheapest disparity of a column of windows.
struct Winners {
    cost: Lanes<u32>,
    winner: Lanes<Match>,
}

impl<'a> Search<'a> {
    /// The columns that have a window.
    #[inline(always)]
    fn columns(&self) -> std::ops::Range<usize> {
        REACH..self.left.len().saturating_sub(REACH)
    }

    /// The costs of the windows in column `x`, if there are any, from `sums` as they were for column `x - 1`.
    #[inline(always)]
    fn costs<'s>(&self, x: usize, sums: &'s mut [Lanes<u32>]) -> Option<Costs<'s>>
    where
        'a: 's,
    {
        let &Search { left, right, first, weights } = self;
        let (width, count, reach) = (left.len() as i32, sums.len() as i32, REACH as i32);
        // Disparities that keep the window inside the right image, counted from the first.
        let from = (x as i32 - (width - 1 - reach) - first).clamp(0, count) as usize;
        let to = (x as i32 - reach + 1 - first).clamp(0, count) as usize;
        if from >= to {
            return None;
        }
        // The windows of those disparities, from the right to the left.
        let last = (x as i32 - first) as usize + 1;
        slide(&mut sums[from..to], left, x, right, last - to..last - from);
        Some(Costs { sums: &sums[from..to], weights: &weights[from..to], index: from })
    }
}

impl Costs<'_> {
    #[inline(always)]
    fn winners(&self) -> Winners {
        let mut winners = Winners { cost: Lanes::splat(u32::MAX), winner: Lanes::splat(Match::NONE) };
        let (fours, rest) = self.sums.as_chunks::<4>();
        let (weights_of_fours, weights_of_rest) = self.weights.as_chunks::<4>();
        for (i, (sums, weights)) in fours.iter().zip(weights_of_fours).enumerate() {
            select(sums, weights, self.index + 4 * i, &mut winners);
        }
        for (i, (sum, weight)) in rest.iter().zip(weights_of_rest).enumerate() {
            let index = self.index + 4 * fours.len() + i;
            select(std::array::from_ref(sum), std::array::from_ref(weight), index, &mut winners);
        }
        winners
    }
}

#[inline(always)]
fn select<const N: usize>(sums: &[Lanes<u32>; N], weights: &[u32; N], index: usize, winners: &mut Winners) {
    for l in 0..Lanes::COUNT {
        let (mut least, mut winner) = (winners.cost.0[l], winners.winner.0[l].0);
        for k in 0..N {
            let ssd = sums[k].0[l];
            let cost = ssd * weights[k];
            winner = if cost < least { ((index + k) as u32) << Match::BITS | ssd } else { winner };
            least = least.min(cost);
        }
        (winners.cost.0[l], winners.winner.0[l]) = (least, Match(winner));
    }
}

/// See [`super::matches`].
#[inline(always)]
pub(super) fn matches(search: &Search<'_>, sums: &mut [Lanes<u32>], out: &mut [Lanes<Match>]) {
    for x in search.columns() {
        if let Some(costs) = search.costs(x, sums) {
            out[x] = costs.winners().winner;
        }
    }
}

/// See [`super::matches_and_rivals`].
#[inline(always)]
pub(super) fn matches_and_rivals(
    search: &Search<'_>,
    thousandths: u32,
    sums: &mut [Lanes<u32>],
    out: &mut [Lanes<Match>],
    doubts: &mut [Lanes<Doubt>],
) {
    for x in search.columns() {
        let Some(costs) = search.costs(x, sums) else { continue };
        let winners = costs.winners();
        let rivals = rivals(&costs, &winners);
        for l in 0..Lanes::COUNT {
            let (least, rival) = (winners.cost.0[l], rivals.0[l]);
            let near = 1000 * u64::from(rival - least) < u64::from(thousandths) * u64::from(least);
            doubts[x].0[l] = if near & (rival != u32::MAX) { Doubt::Ambiguous } else { Doubt::Certain };
        }
        out[x] = winners.winner;
    }
}

/// The least costs of disparities that are not beside the winners.
#[inline(always)]
fn rivals(costs: &Costs<'_>, winners: &Winners) -> Lanes<u32> {
    let mut rivals = Lanes::splat(u32::MAX);
    let mut beside = Lanes::splat(0);
    for l in 0..Lanes::COUNT {
        beside.0[l] = winners.winner.0[l].index().wrapping_sub(1);
    }
    for (index, (sum, &weight)) in (costs.index as u32..).zip(costs.sums.iter().zip(costs.weights)) {
        for l in 0..Lanes::COUNT {
            let elsewhere = index.wrapping_sub(beside.0[l]) > 2;
            let rival = rivals.0[l].min(sum.0[l] * weight);
            rivals.0[l] = if elsewhere { rival } else { rivals.0[l] };
        }
    }
    rivals
}

/// See [`super::matches_and_spread`].
#[inline(always)]
pub(super) fn matches_and_spread(
    search: &Search<'_>,
    threshold_px: f32,
    sums: &mut [Lanes<u32>],
    out: &mut [Lanes<Match>],
    doubts: &mut [Lanes<Doubt>],
) {
    for x in search.columns() {
        if let Some(costs) = search.costs(x, sums) {
            out[x] = costs.winners().winner;
            spread(&costs, threshold_px, &mut doubts[x]);
        }
    }
}

/// The spread of the disparities, each weighted by `(cost + 25)⁻²`, against the threshold.
///
/// With u the unit roundoff, a weight is off by at most 8 u of itself, each of the three sums of n positive terms by
/// (n + 10) u, and so the variance by 6 (n + 10) u times the mean square. What is within twice that of the threshold
/// stays open.
#[inline(always)]
fn spread(costs: &Costs<'_>, threshold_px: f32, doubts: &mut Lanes<Doubt>) {
    let [mut zeroth, mut first, mut second] = [Lanes::splat(0f32); 3];
    for (i, (sum, &weight)) in costs.sums.iter().zip(costs.weights).enumerate() {
        let (d, weight) = (i as f32, weight as f32);
        for l in 0..Lanes::COUNT {
            // An SSD has 20 bits: signed, as AVX2 converts no other.
            let inverse = 1.0 / ((sum.0[l] as i32 as f32) * weight + 25.0);
            let q = inverse * inverse;
            zeroth.0[l] += q;
            first.0[l] += q * d;
            second.0[l] += q * (d * d);
        }
    }
    let margin = 6.0 * (costs.sums.len() + 10) as f32 * f32::EPSILON;
    let threshold = threshold_px * threshold_px;
    for l in 0..Lanes::COUNT {
        let (mean, square) = (first.0[l] / zeroth.0[l], second.0[l] / zeroth.0[l]);
        let excess = square - mean * mean - threshold;
        let margin = margin * (square + threshold);
        let sure = if excess > 0.0 { Doubt::Ambiguous } else { Doubt::Certain };
        doubts.0[l] = if excess.abs() > margin { sure } else { Doubt::Open };
    }
}
