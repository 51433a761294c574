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

/// The cheapest disparity of a window in each row of a block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Winners {
    /// Least `capped SSD · weight`.
    pub cost: Lanes<u32>,
    /// Its disparity, counted from the first.
    pub index: Lanes<u32>,
}

impl Winners {
    /// Nothing compared yet.
    pub const NONE: Self = Self { cost: Lanes([u32::MAX; Lanes::COUNT]), index: Lanes([0; Lanes::COUNT]) };
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
        if from >= to {
            continue;
        }
        for (j, sum) in sums[from..to].iter_mut().enumerate() {
            let u = (x - first) as usize - from - j;
            if column == REACH || u == REACH {
                *sum = window(left, column, right, u);
            } else {
                slide(sum, left, column, right, u);
            }
        }
        let (sums, weights) = (&sums[from..to], &weights[from..to]);
        let (fours, rest) = sums.as_chunks::<4>();
        let (weights_of_fours, weights_of_rest) = weights.as_chunks::<4>();
        for (i, (sums, weights)) in fours.iter().zip(weights_of_fours).enumerate() {
            select(sums, weights, from + 4 * i, winners);
        }
        for (i, (sum, weight)) in rest.iter().zip(weights_of_rest).enumerate() {
            select(&[*sum], &[*weight], from + 4 * fours.len() + i, winners);
        }
    }
}

/// See [`super::least_ssd`].
#[inline(always)]
pub(super) fn least(block: &[Lanes<u16>], sums: &mut [Lanes<u16>], out: &mut [Lanes<u16>]) {
    out.fill(Lanes([u16::MAX; Lanes::COUNT]));
    for x in REACH..block.len().saturating_sub(REACH) {
        for (offset, sum) in (1..=x - REACH).zip(sums.iter_mut()) {
            let u = x - offset;
            if u == REACH {
                *sum = window(block, x, block, u);
            } else {
                slide(sum, block, x, block, u);
            }
            // One sum serves both windows.
            let [here, there] = out.get_disjoint_mut([x, u]).expect("offset is not 0");
            for l in 0..Lanes::COUNT {
                here.0[l] = here.0[l].min(sum.0[l]);
                there.0[l] = there.0[l].min(sum.0[l]);
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

/// The capped SSD of the windows around `x` in `left` and `u` in `right`.
#[inline(always)]
fn window(left: &[Lanes<u16>], x: usize, right: &[Lanes<u16>], u: usize) -> Lanes<u16> {
    let mut sum = Lanes([0; Lanes::COUNT]);
    for (a, b) in left[x - REACH..=x + REACH].iter().zip(&right[u - REACH..=u + REACH]) {
        for l in 0..Lanes::COUNT {
            sum.0[l] += square(a, b, l);
        }
    }
    sum
}

/// Moves `sum` on to the windows around `x` and `u` from those one pixel to the left.
#[inline(always)]
fn slide(sum: &mut Lanes<u16>, left: &[Lanes<u16>], x: usize, right: &[Lanes<u16>], u: usize) {
    let (new, old) = ((&left[x + REACH], &right[u + REACH]), (&left[x - REACH - 1], &right[u - REACH - 1]));
    for l in 0..Lanes::COUNT {
        sum.0[l] = sum.0[l].wrapping_add(square(new.0, new.1, l)).wrapping_sub(square(old.0, old.1, l));
    }
}

/// Lets the disparities from `index` on compete with the winners so far, which keep their place at equal cost.
#[inline(always)]
fn select<const N: usize>(sums: &[Lanes<u16>; N], weights: &[u32; N], index: usize, winners: &mut Winners) {
    for l in 0..Lanes::COUNT {
        let (mut best, mut best_index) = (winners.cost.0[l], winners.index.0[l]);
        for k in 0..N {
            let cost = u32::from(sums[k].0[l]) * weights[k];
            best_index = if cost < best { (index + k) as u32 } else { best_index };
            best = best.min(cost);
        }
        (winners.cost.0[l], winners.index.0[l]) = (best, best_index);
    }
}
