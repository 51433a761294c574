//! Sums of squared differences (SSD) of windows of nine pixels that slide along the rows of a
//! block.
//!
//! When a window advances by one pixel, one square enters and one leaves (thesis, section 5.3.3,
//! "Optimization", and figure 5.10). Their difference is `(l² − l'²) + (r² − r'²) − 2·(l·r −
//! l'·r')`: the first two belong to one image each and are the same for all disparities, the last
//! is one product of pairs.
//!
//! Sums are kept as the bits of the 32-bit float 2²³ + SSD: below 2²⁴ adding one to its bits adds
//! one to the number, so the sum slides in integers and is multiplied by its weight as a float, in
//! one operation where an integer product takes two.

use super::Lanes;
use super::pairs::{BIAS, Group, Pairs, RowPairs};
use std::ops::Range;

/// Half of the one-dimensional window of v1 to v4: it covers x − 4 ..= x + 4.
pub const REACH: usize = 4;
/// Pixels of the window.
pub const WINDOW: usize = 2 * REACH + 1;

/// Factor that turns an SSD into a cost, 25 · (0.16 |d| + 1) (thesis, equation 5.2).
#[inline(always)]
pub fn weight(disparity: i32) -> u32 {
    25 + 4 * disparity.unsigned_abs()
}

/// [`weight`] by the absolute disparity, modulo 65536.
#[inline(always)]
pub(super) fn short_weight(disparity: u16) -> u16 {
    disparity.wrapping_mul(4).wrapping_add(25)
}

/// A disparity, counted from the first, and its SSD, in one word.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Match(u32);

impl Match {
    /// Nothing compared.
    pub const NONE: Self = Self(u32::MAX);
    /// Bits of an SSD: 9 · 255² < 2²⁰.
    pub(super) const BITS: u32 = 20;
    /// Largest number of disparities.
    pub const DISPARITIES: usize = 1 << (u32::BITS - Self::BITS);

    pub fn index(self) -> u32 {
        self.0 >> Self::BITS
    }

    pub fn ssd(self) -> u32 {
        self.0 & ((1 << Self::BITS) - 1)
    }
}

/// The sum of an SSD of 0: the bits of 2²³.
const ZERO: u32 = 0x4b00_0000;

/// The SSD that a sum represents.
#[inline(always)]
pub(super) fn ssd(sum: u32) -> u32 {
    sum ^ ZERO
}

/// The cheapest disparity of a column of windows.
#[derive(Clone, Copy)]
pub(super) struct Winners {
    pub(super) cost: Group<u32>,
    pub(super) winner: Group<Match>,
}

/// The cheapest so far. Of winner and place, the instruction set updates the one that takes it
/// fewer operations.
#[derive(Clone, Copy)]
struct Cheapest {
    /// The bits of floats: they compare as whole numbers do, and faster.
    cost: Group<i32>,
    winner: Group<Match>,
    /// Index of the winner among the sums.
    place: Group<i16>,
}

impl Cheapest {
    const NONE: Self = Self {
        cost: Group::splat(f32::INFINITY.to_bits() as i32),
        winner: Group::splat(Match::NONE),
        place: Group::splat(0),
    };

    /// Costs below are exact; the others were rounded, but never to a value below.
    const EXACT: f32 = 16_777_216.0;

    /// The cheaper of this one and the disparity at `place`, a higher one than any before.
    #[inline(always)]
    fn or<P: Pairs>(
        self,
        pairs: &P,
        sums: Group<u32>,
        disparity: &WeightedDisparity,
        place: i16,
    ) -> Self {
        let costs = pairs.costs(sums, disparity.weight, disparity.bias);
        let mut bits = Group::splat(0);
        let mut cheapest = self;
        for l in 0..Group::ROWS {
            bits.0[l] = costs.0[l].to_bits() as i32;
            let takes = bits.0[l] < self.cost.0[l];
            if P::SELECTS {
                let here = Match(disparity.zero ^ sums.0[l]);
                cheapest.winner.0[l] = if takes { here } else { self.winner.0[l] };
            } else {
                // The last one that takes the lead is the highest.
                let place = i16::from(takes).wrapping_neg() & place;
                cheapest.place.0[l] = self.place.0[l].max(place);
            }
        }
        cheapest.cost = pairs.least(self.cost, bits);
        cheapest
    }

    /// The winners of all `sums`, recomputed in integers where a cost is too large for floats.
    #[inline(always)]
    fn winners<P: Pairs>(
        self,
        _: &P,
        sums: &[Group<u32>],
        disparities: &[WeightedDisparity],
    ) -> Winners {
        let mut most = 0;
        for cost in self.cost.0 {
            most = cost.max(most);
        }
        if most >= Self::EXACT.to_bits() as i32 {
            return Winners::in_integers(sums, disparities);
        }
        let mut cost = Group::splat(0);
        for l in 0..Group::ROWS {
            let exact = f32::from_bits(self.cost.0[l] as u32);
            // SAFETY: it is a whole number, from 0 to below `EXACT`.
            cost.0[l] = unsafe { exact.to_int_unchecked::<i32>() } as u32;
        }
        let mut winner = self.winner;
        if !P::SELECTS {
            for l in 0..Group::ROWS {
                let place = self.place.0[l] as usize;
                winner.0[l] = Match(disparities[place].zero ^ sums[place].0[l]);
            }
        }
        Winners { cost, winner }
    }
}

impl Winners {
    /// Fallback for a window that differs by 70 grey levels from its best match: few columns have
    /// one.
    #[cold]
    fn in_integers(sums: &[Group<u32>], disparities: &[WeightedDisparity]) -> Self {
        let mut winners = Self {
            cost: Group::splat(u32::MAX),
            winner: Group::splat(Match::NONE),
        };
        for (sums, disparity) in sums.iter().zip(disparities) {
            for l in 0..Group::ROWS {
                let cost = ssd(sums.0[l]) * disparity.whole_weight;
                if cost < winners.cost.0[l] {
                    winners.cost.0[l] = cost;
                    winners.winner.0[l] = Match(disparity.zero ^ sums.0[l]);
                }
            }
        }
        winners
    }
}

/// A disparity and the factor that turns its SSD into a cost.
#[derive(Clone, Copy, Debug)]
pub(super) struct WeightedDisparity {
    pub(super) whole_weight: u32,
    pub(super) weight: f32,
    /// −2²³ times the weight.
    bias: f32,
    /// The disparity's [`Match`] with an SSD of 0, XORed with [`ZERO`]: XOR with a sum gives the
    /// match.
    zero: u32,
}

impl WeightedDisparity {
    /// The disparity at `index`, counted from the first, with a weight below 2¹⁶.
    pub(super) fn new(index: u32, weight: u32) -> Self {
        Self {
            whole_weight: weight,
            weight: weight as f32,
            bias: -BIAS * weight as f32,
            zero: index << Match::BITS ^ ZERO,
        }
    }
}

/// The pixels that enter and leave the windows as they advance to a column.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    pixels: RowPairs,
    /// Difference of the squares.
    squares: Group<u32>,
}

impl Step {
    pub(super) const NONE: Self = Self {
        pixels: RowPairs::NONE,
        squares: Group::splat(0),
    };

    /// The step to column `x`, of a block's group of rows. Entering pixels are multiplied by
    /// `factors[0]`, leaving ones by `factors[1]`.
    #[inline(always)]
    fn to(x: usize, block: &[Lanes<u16>], group: usize, factors: [i16; 2]) -> Self {
        let come = rows(&block[x + REACH], group);
        let gone = rows(&block[x - REACH - 1], group);
        let mut step = Self::NONE;
        let mut pixels = [[0; Group::ROWS]; 2];
        for l in 0..Group::ROWS {
            // Pixels have 8 bits, so even twice one fits the signed 16 bits of a factor.
            pixels[0][l] = come[l] as i16 * factors[0];
            pixels[1][l] = gone[l] as i16 * factors[1];
            let [come, gone] = [come[l], gone[l]].map(u32::from);
            step.squares.0[l] = (come * come).wrapping_sub(gone * gone);
        }
        step.pixels = RowPairs::new(pixels);
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
    /// Steps of the right image, from its last column to its first: a search goes that way.
    steps: &'a [Step],
}

impl<'a> RowGroup<'a> {
    /// Group `group` of the rows of two blocks; `steps` has an element per column.
    #[inline(always)]
    pub(super) fn new(
        left: &'a [Lanes<u16>],
        right: &'a [Lanes<u16>],
        group: usize,
        steps: &'a mut [Step],
    ) -> Self {
        let width = right.len();
        for u in REACH + 1..width.saturating_sub(REACH) {
            steps[width - 1 - u] = Step::to(u, right, group, [1, 1]);
        }
        Self {
            left,
            right,
            group,
            steps,
        }
    }

    /// Advances `sums` to the window around `x` in the left image with each of the `windows` in the
    /// right one, from the rightmost on, and finds the cheapest. On entry they are those for `x -
    /// 1` and windows one pixel to the left.
    #[inline(always)]
    pub(super) fn slide(
        &self,
        pairs: &impl Pairs,
        x: usize,
        windows: Range<usize>,
        disparities: &[WeightedDisparity],
        sums: &mut [Group<u32>],
    ) -> Winners {
        // New windows: all for the first x, else the one at the left edge.
        let fresh = if x == REACH {
            windows.end
        } else {
            windows.end.min(REACH + 1)
        }
        .max(windows.start);
        let (slid, new) = sums.split_at_mut(windows.end - fresh);
        let (slid_disparities, new_disparities) = disparities.split_at(slid.len());
        let mut cheapest = Cheapest::NONE;
        if !slid.is_empty() {
            // (a − b)² = a² − 2ab + b²: the squares slide on their own, and −2ab comes from the
            // factors, for entering and leaving pixels.
            let left = Step::to(x, self.left, self.group, [-2, 2]);
            let width = self.right.len();
            let steps = &self.steps[width - windows.end..width - fresh];
            let slid = slid.iter_mut().zip(slid_disparities).zip(steps);
            for (place, ((sum, disparity), right)) in (0..).zip(slid) {
                *sum = pairs.sum(
                    *sum,
                    [left.squares, right.squares],
                    [left.pixels, right.pixels],
                );
                cheapest = cheapest.or(pairs, *sum, disparity, place);
            }
        }
        let first = slid_disparities.len() as i16;
        for (place, ((sum, disparity), u)) in (first..).zip(
            new.iter_mut()
                .zip(new_disparities)
                .zip((windows.start..fresh).rev()),
        ) {
            *sum = self.fresh(x, u);
            cheapest = cheapest.or(pairs, *sum, disparity, place);
        }
        cheapest.winners(pairs, sums, disparities)
    }

    /// The sum of the windows around `x` and `u`.
    #[inline(always)]
    fn fresh(&self, x: usize, u: usize) -> Group<u32> {
        let mut sum = Group::splat(ZERO);
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

#[cfg(test)]
mod tests {
    use super::super::pairs::Portable;
    use super::*;

    /// Costs that round to the same float are still distinguished, and among equal ones the first
    /// wins.
    #[test]
    fn the_cheapest_is_that_of_whole_numbers() {
        let disparities = [80, 81].map(|d| WeightedDisparity::new(d as u32, weight(d)));
        let [first, second] = disparities.map(|disparity| disparity.whole_weight);
        let costs_of = |ssd: u32, more: u32| [ssd, ssd * first / second + more];
        for ssd in (1..1000).chain(48_000..49_000).chain(500_000..501_000) {
            for ssds in [costs_of(ssd, 0), costs_of(ssd, 1)] {
                let sums = ssds.map(|ssd| Group::splat(ZERO ^ ssd));
                let found = (0..).zip(sums.iter().zip(&disparities));
                let found = found.fold(Cheapest::NONE, |cheapest, (place, (sums, disparity))| {
                    cheapest.or(&Portable, *sums, disparity, place)
                });
                let winners = found.winners(&Portable, &sums, &disparities);
                let costs = [ssds[0] * first, ssds[1] * second];
                let best = usize::from(costs[1] < costs[0]);
                assert_eq!(winners.cost, Group::splat(costs[best]), "{ssds:?}");
                let winner = winners.winner.0[7];
                assert_eq!(winner.index(), 80 + best as u32, "{ssds:?}");
                assert_eq!(winner.ssd(), ssds[best]);
            }
        }
    }
}
