//! Sums of squared differences of windows of nine pixels that slide along the rows of a block.
//!
//! As a window moves on by one pixel, one square comes in and one goes out (thesis, section 5.3.3,
//! "Optimization", and figure 5.10). What comes in less what goes out is
//! `(l² − l'²) + (r² − r'²) − 2·(l·r − l'·r')`: the first two belong to one image each and are the
//! same for all disparities, the last is one product of pairs.

use super::Lanes;
use super::exact::{Match, Winners};
use super::pairs::{Group, Pairs};
use std::ops::Range;

/// Half of the window: it covers x − 4 ..= x + 4.
pub(super) const REACH: usize = 4;

/// What the windows of a column take in and let go as they move on to it.
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
pub(super) struct Rows<'a> {
    left: &'a [Lanes<u16>],
    right: &'a [Lanes<u16>],
    group: usize,
    /// Of the right image.
    steps: &'a [Step],
}

impl<'a> Rows<'a> {
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
