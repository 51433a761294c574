//! Block matching by SSD: for each window the cheapest disparity, and filters that use the costs of
//! all disparities.

use super::Lanes;
use super::lanes::transpose_back;
use super::pairs::{Group, Pairs};
use super::sliding_ssd::{Match, REACH, RowGroup, Step, WeightedDisparity, Winners, ssd};

/// A search along rows of one width, with its scratch memory.
pub struct SsdSearch {
    range: WeightedRange,
    steps: Vec<Step>,
    /// One per disparity.
    sums: Vec<Group<u32>>,
    /// One per column.
    matches: Vec<Group<Match>>,
    doubts: Vec<Group<FilterDecision>>,
}

/// The disparities to be tried.
struct WeightedRange {
    first: i32,
    all: Vec<WeightedDisparity>,
}

/// Decision of a filter on the costs of a window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum FilterDecision {
    Certain,
    Ambiguous,
    /// The kernel cannot decide.
    Open,
}

/// The costs of a column of windows: the SSDs of `sums` times the weights of the disparities,
/// starting at `index`.
struct Costs<'a> {
    sums: &'a [Group<u32>],
    disparities: &'a [WeightedDisparity],
    index: usize,
}

impl SsdSearch {
    /// For rows of `width` pixels and the disparities from `first` on, with the factor that turns
    /// the SSD of each into a cost. Costs fit 32 bits, and there are at most
    /// [`Match::DISPARITIES`].
    pub fn new(width: usize, first: i32, weights: Vec<u32>) -> Self {
        Self {
            steps: vec![Step::NONE; width],
            sums: vec![Group::splat(0); weights.len()],
            matches: vec![Group::splat(Match::NONE); width],
            doubts: vec![Group::splat(FilterDecision::Certain); width],
            range: WeightedRange {
                first,
                all: (0..)
                    .zip(weights)
                    .map(|(index, weight)| WeightedDisparity::new(index, weight))
                    .collect(),
            },
        }
    }

    /// The lowest disparity.
    pub fn first(&self) -> i32 {
        self.range.first
    }

    /// Factor that turns the SSD of the disparity at that index into a cost.
    pub fn weight(&self, index: u32) -> u32 {
        self.range.all[index as usize].whole_weight
    }
}

impl WeightedRange {
    /// Calls `visit` with each column that has windows, their winners and all their costs.
    #[inline(always)]
    fn scan(
        &self,
        pairs: &impl Pairs,
        rows: &RowGroup<'_>,
        width: usize,
        sums: &mut [Group<u32>],
        mut visit: impl FnMut(usize, &Winners, &Costs<'_>),
    ) {
        let count = sums.len() as i32;
        for x in REACH..width.saturating_sub(REACH) {
            // Disparities that keep the window inside the right image, counted from the first.
            let from =
                ((x + REACH + 1) as i32 - width as i32 - self.first).clamp(0, count) as usize;
            let to = ((x + 1) as i32 - REACH as i32 - self.first).clamp(0, count) as usize;
            if from >= to {
                continue;
            }
            // The windows of those disparities, from right to left.
            let last = (x as i32 - self.first) as usize + 1;
            let (sums, disparities) = (&mut sums[from..to], &self.all[from..to]);
            let winners = rows.slide(pairs, x, last - to..last - from, disparities, sums);
            visit(
                x,
                &winners,
                &Costs {
                    sums,
                    disparities,
                    index: from,
                },
            );
        }
    }
}

/// See [`super::matches`].
#[inline(always)]
pub(super) fn matches(
    pairs: impl Pairs,
    left: &[Lanes<u16>],
    right: &[Lanes<u16>],
    search: &mut SsdSearch,
    out: &mut [Match],
) {
    let width = left.len();
    let SsdSearch {
        range,
        steps,
        sums,
        matches,
        ..
    } = search;
    for (group, out) in out.chunks_mut(Group::ROWS * width).enumerate() {
        let rows = RowGroup::new(left, right, group, steps);
        range.scan(&pairs, &rows, width, sums, |x, winners, _| {
            matches[x] = winners.winner
        });
        transpose_back(matches, out);
    }
}

/// See [`super::matches_and_rivals`].
#[inline(always)]
pub(super) fn matches_and_rivals(
    pairs: impl Pairs,
    left: &[Lanes<u16>],
    right: &[Lanes<u16>],
    search: &mut SsdSearch,
    thousandths: u32,
    out: &mut [Match],
    doubts: &mut [FilterDecision],
) {
    matches_and_doubts(pairs, left, right, search, out, doubts, |winners, costs| {
        let rivals = rivals(costs, winners);
        let mut doubts = Group::splat(FilterDecision::Certain);
        for l in 0..Group::ROWS {
            let (least, rival) = (winners.cost.0[l], rivals.0[l]);
            // Cross-multiplied in 64 bits: a thousand times a cost exceeds 32.
            let near = 1000 * u64::from(rival - least) < u64::from(thousandths) * u64::from(least);
            doubts.0[l] = if near & (rival != u32::MAX) {
                FilterDecision::Ambiguous
            } else {
                FilterDecision::Certain
            };
        }
        doubts
    });
}

/// See [`super::matches_and_spread`].
#[inline(always)]
pub(super) fn matches_and_spread(
    pairs: impl Pairs,
    left: &[Lanes<u16>],
    right: &[Lanes<u16>],
    search: &mut SsdSearch,
    threshold_px: f32,
    out: &mut [Match],
    doubts: &mut [FilterDecision],
) {
    matches_and_doubts(pairs, left, right, search, out, doubts, |_, costs| {
        spread(costs, threshold_px)
    });
}

#[inline(always)]
fn matches_and_doubts(
    pairs: impl Pairs,
    left: &[Lanes<u16>],
    right: &[Lanes<u16>],
    search: &mut SsdSearch,
    out: &mut [Match],
    doubts_out: &mut [FilterDecision],
    filter: impl Fn(&Winners, &Costs<'_>) -> Group<FilterDecision>,
) {
    let width = left.len();
    let SsdSearch {
        range,
        steps,
        sums,
        matches,
        doubts,
    } = search;
    let bands = out
        .chunks_mut(Group::ROWS * width)
        .zip(doubts_out.chunks_mut(Group::ROWS * width));
    for (group, (out, doubts_out)) in bands.enumerate() {
        let rows = RowGroup::new(left, right, group, steps);
        range.scan(&pairs, &rows, width, sums, |x, winners, costs| {
            (matches[x], doubts[x]) = (winners.winner, filter(winners, costs));
        });
        transpose_back(matches, out);
        transpose_back(doubts, doubts_out);
    }
}

/// The least costs of disparities that are not next to the winners.
#[inline(always)]
fn rivals(costs: &Costs<'_>, winners: &Winners) -> Group<u32> {
    let mut rivals = Group::splat(u32::MAX);
    let mut beside = Group::splat(0);
    for l in 0..Group::ROWS {
        beside.0[l] = winners.winner.0[l].index().wrapping_sub(1);
    }
    let costs = (costs.index as u32..).zip(costs.sums.iter().zip(costs.disparities));
    for (index, (sum, disparity)) in costs {
        for l in 0..Group::ROWS {
            // 0 ..= 2 for the winner and its neighbours; anything below wraps to much more.
            let elsewhere = index.wrapping_sub(beside.0[l]) > 2;
            let rival = rivals.0[l].min(ssd(sum.0[l]) * disparity.whole_weight);
            rivals.0[l] = if elsewhere { rival } else { rivals.0[l] };
        }
    }
    rivals
}

/// The spread of the disparities, each weighted by `(cost + 25)⁻²`, against the threshold.
///
/// With u the unit roundoff, a weight is off by at most 8 u of itself, each of the three sums of n
/// positive terms by (n + 10) u, and so the variance by 6 (n + 10) u times the mean square.
/// Variances within twice that of the threshold stay open.
#[inline(always)]
fn spread(costs: &Costs<'_>, threshold_px: f32) -> Group<FilterDecision> {
    let [mut zeroth, mut first, mut second] = [Group::splat(0f32); 3];
    for (i, (sum, disparity)) in costs.sums.iter().zip(costs.disparities).enumerate() {
        let (d, weight) = (i as f32, disparity.weight);
        for l in 0..Group::ROWS {
            // An SSD has 20 bits: signed, as AVX2 converts no other.
            let inverse = 1.0 / ((ssd(sum.0[l]) as i32 as f32) * weight + 25.0);
            let q = inverse * inverse;
            zeroth.0[l] += q;
            first.0[l] += q * d;
            second.0[l] += q * (d * d);
        }
    }
    let margin = 6.0 * (costs.sums.len() + 10) as f32 * f32::EPSILON;
    let threshold = threshold_px * threshold_px;
    let mut doubts = Group::splat(FilterDecision::Certain);
    for l in 0..Group::ROWS {
        let (mean, square) = (first.0[l] / zeroth.0[l], second.0[l] / zeroth.0[l]);
        let excess = square - mean * mean - threshold;
        let margin = margin * (square + threshold);
        let sure = if excess > 0.0 {
            FilterDecision::Ambiguous
        } else {
            FilterDecision::Certain
        };
        doubts.0[l] = if excess.abs() > margin {
            sure
        } else {
            FilterDecision::Open
        };
    }
    doubts
}
