//! Sums of squared differences (SSD) of windows of nine pixels that slide along the rows of a
//! block.
//!
//! As a window moves on by one pixel, one square comes in and one goes out (thesis, section 5.3.3,
//! "Optimization", and figure 5.10). What comes in less what goes out is
//! `(l² − l'²) + (r² − r'²) − 2·(l·r − l'·r')`: the first two belong to one image each and are the
//! same for all disparities, the last is one product of pairs.

use super::Lanes;
use super::pairs::{Group, Pairs};
use std::ops::Range;

/// Half of the one-dimensional window of v1 to v4: it covers x − 4 ..= x + 4.
pub const REACH: usize = 4;
/// Pixels of the window.
pub const WINDOW: usize = 2 * REACH + 1;

/// What multiplies an SSD to make it a cost, 25 · (0.16 |d| + 1) (thesis, equation 5.2).
#[inline(always)]
pub fn weight(disparity: i32) -> u32 {
    25 + 4 * disparity.unsigned_abs()
}

/// A disparity, counted from the first, and its SSD, in one word.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Match(u32);

impl Match {
    /// Nothing compared.
    pub const NONE: Self = Self(u32::MAX);
    /// Bits of an SSD: 9 · 255² < 2²⁰.
    pub(super) const BITS: u32 = 20;
    /// How many disparities there may be.
    pub const DISPARITIES: usize = 1 << (u32::BITS - Self::BITS);

    pub fn index(self) -> u32 {
        self.0 >> Self::BITS
    }

    pub fn ssd(self) -> u32 {
        self.0 & ((1 << Self::BITS) - 1)
    }
}

/// The cheapest disparity of a column of windows.
#[derive(Clone, Copy)]
pub(super) struct Winners {
    pub(super) cost: Group<u32>,
    pub(super) winner: Group<Match>,
}

impl Winners {
    pub(super) const NONE: Self = Self {
        cost: Group::splat(u32::MAX),
        winner: Group::splat(Match::NONE),
    };

    /// These or, where it is cheaper, the disparity of that place.
    #[inline(always)]
    pub(super) fn or(self, ssds: Group<u32>, weight: u32, place: u32) -> Self {
        let mut winners = self;
        for l in 0..Group::ROWS {
            let (cost, least) = (ssds.0[l] * weight, self.cost.0[l]);
            winners.winner.0[l] = if cost < least {
                Match(place | ssds.0[l])
            } else {
                self.winner.0[l]
            };
            winners.cost.0[l] = least.min(cost);
        }
        winners
    }
}

/// The pixels that enter and leave the windows as they slide on to a column.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    pixels: Group<[i16; 2]>,
    /// Difference of the squares.
    squares: Group<u32>,
}

impl Step {
    pub(super) const NONE: Self = Self {
        pixels: Group::splat([0; 2]),
        squares: Group::splat(0),
    };

    /// The step to column `x`, of a block's group of rows. Pixels that come in count `factors[0]`
    /// times.
    #[inline(always)]
    fn to(x: usize, block: &[Lanes<u16>], group: usize, factors: [i16; 2]) -> Self {
        let (come, gone) = (
            rows(&block[x + REACH], group),
            rows(&block[x - REACH - 1], group),
        );
        let mut step = Self::NONE;
        for l in 0..Group::ROWS {
            // Pixels have 8 bits, so that also twice one fits the signed 16 of a product's factor.
            step.pixels.0[l] = [come[l] as i16 * factors[0], gone[l] as i16 * factors[1]];
            let [come, gone] = [come[l], gone[l]].map(u32::from);
            step.squares.0[l] = (come * come).wrapping_sub(gone * gone);
        }
        step
    }
}

/// The pixels of a column that belong to a group.
#[inline(always)]
fn rows(column: &Lanes<u16>, group: usize) -> &[u16; Group::ROWS] {
    &column.0.as_chunks().0[group]
}

/// A group of rows of two images.
pub(super) struct RowGroup<'a> {
    left: &'a [Lanes<u16>],
    right: &'a [Lanes<u16>],
    group: usize,
    /// Of the right image.
    steps: &'a [Step],
}

impl<'a> RowGroup<'a> {
    /// That group of rows of two blocks; `steps` has an element per column.
    #[inline(always)]
    pub(super) fn new(
        left: &'a [Lanes<u16>],
        right: &'a [Lanes<u16>],
        group: usize,
        steps: &'a mut [Step],
    ) -> Self {
        for (u, step) in steps
            .iter_mut()
            .enumerate()
            .take(right.len().saturating_sub(REACH))
            .skip(REACH + 1)
        {
            *step = Step::to(u, right, group, [1, 1]);
        }
        Self {
            left,
            right,
            group,
            steps,
        }
    }

    /// Makes of `sums` those of the window around `x` in the left image with each of the `windows`
    /// in the right one, from the rightmost on, and finds the cheapest. Before, they were those for
    /// `x - 1` and windows one pixel to the left.
    #[inline(always)]
    pub(super) fn slide(
        &self,
        pairs: &impl Pairs,
        x: usize,
        windows: Range<usize>,
        weights: &[u32],
        index: usize,
        sums: &mut [Group<u32>],
    ) -> Winners {
        // Windows that were not there before: all for the first x, else that at the left edge.
        let fresh = if x == REACH {
            windows.end
        } else {
            windows.end.min(REACH + 1)
        }
        .max(windows.start);
        let (slid, new) = sums.split_at_mut(windows.end - fresh);
        let (slid_weights, new_weights) = weights.split_at(slid.len());
        let mut places = (index as u32..).map(|index| index << Match::BITS);
        let mut winners = Winners::NONE;
        if !slid.is_empty() {
            // (a − b)² = a² − 2ab + b²: the squares slide by themselves, and −2ab comes from the
            // factors, for pixels that enter, and for those that leave.
            let left = Step::to(x, self.left, self.group, [-2, 2]);
            let steps = self.steps[fresh..windows.end].iter().rev();
            for (((sum, &weight), right), place) in slid
                .iter_mut()
                .zip(slid_weights)
                .zip(steps)
                .zip(&mut places)
            {
                let ssds = pairs.sum(
                    *sum,
                    [left.squares, right.squares],
                    [left.pixels, right.pixels],
                );
                *sum = ssds;
                winners = winners.or(ssds, weight, place);
            }
        }
        for (((sum, &weight), u), place) in new
            .iter_mut()
            .zip(new_weights)
            .zip((windows.start..fresh).rev())
            .zip(places)
        {
            *sum = self.fresh(x, u);
            winners = winners.or(*sum, weight, place);
        }
        winners
    }

    /// The sum of the windows around `x` and `u`.
    #[inline(always)]
    fn fresh(&self, x: usize, u: usize) -> Group<u32> {
        let mut sum = Group::splat(0);
        for (a, b) in self.left[x - REACH..=x + REACH]
            .iter()
            .zip(&self.right[u - REACH..=u + REACH])
        {
            let (a, b) = (rows(a, self.group), rows(b, self.group));
            for l in 0..Group::ROWS {
                // Pixels have 8 bits, so the square is right modulo 65536 whatever the difference's
                // sign.
                let difference = a[l].wrapping_sub(b[l]);
                sum.0[l] += u32::from(difference.wrapping_mul(difference));
            }
        }
        sum
    }
}
