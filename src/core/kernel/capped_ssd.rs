//! Capped sums of squared differences (SSD) between windows of one image, for all rows of a block
//! at once: the reference values of the self check.
//!
//! When a window advances by one pixel, one square enters and one leaves (thesis, section 5.3.3,
//! "Optimization", and figure 5.10). The sums are kept in 16 bits, so a vector holds twice as many
//! as with 32: each square is capped at [`CAP`], so that nine of them fit. **A capped sum below
//! [`CAP`] is exact**, as none of its squares was capped, **and any other is at most the exact
//! sum.** So a minimum below [`CAP`] is the exact minimum; callers compute the rest one by one:
//! windows that differ by 28 grey levels or more on average.

use super::Lanes;
use super::sliding_ssd::{REACH, WINDOW};

/// Difference of a sum and the number kept, which is signed: SSE2 finds no other minimum.
const BIAS: u16 = 1 << 15;

/// Largest square in a capped sum.
pub const CAP: u16 = u16::MAX / WINDOW as u16;

/// What a square is kept with. Where one enters a sum and one leaves, it cancels out.
const RAISE: u16 = u16::MAX - CAP;

/// The number kept for a sum to which no square has been added.
const EMPTY: u16 = BIAS.wrapping_sub(RAISE.wrapping_mul(WINDOW as u16));

/// See [`super::least_ssd`].
#[inline(always)]
pub(super) fn least(block: &[Lanes<u16>], sums: &mut [Lanes<u16>], out: &mut [Lanes<u16>]) {
    out.fill(Lanes::splat(u16::MAX ^ BIAS));
    for x in REACH + 1..block.len().saturating_sub(REACH) {
        let (come, gone) = (&block[x + REACH], &block[x - REACH - 1]);
        let first = x.saturating_sub(sums.len()).max(REACH + 1);
        let (before, out) = out.split_at_mut(x);
        let here = &mut out[0];
        let mut least = *here;
        // From the window next to x to the left.
        let others = before[first..].iter_mut().rev();
        let come_others = block[first + REACH..x + REACH].iter().rev();
        let gone_others = block[first - REACH - 1..x - REACH - 1].iter().rev();
        for (sum, (there, (come_other, gone_other))) in sums
            .iter_mut()
            .zip(others.zip(come_others.zip(gone_others)))
        {
            for l in 0..Lanes::COUNT {
                let (come, gone) = (square(come, come_other, l), square(gone, gone_other, l));
                sum.0[l] = sum.0[l].wrapping_add(come).wrapping_sub(gone);
                // One sum serves both windows.
                least.0[l] = lesser(least.0[l], sum.0[l]);
                there.0[l] = lesser(there.0[l], sum.0[l]);
            }
        }
        // The window at the left edge is new.
        if let Some(sum) = sums.get_mut(x - REACH - 1) {
            *sum = Lanes::splat(EMPTY);
            for (a, b) in block[x - REACH..=x + REACH].iter().zip(block) {
                for l in 0..Lanes::COUNT {
                    sum.0[l] = sum.0[l].wrapping_add(square(a, b, l));
                }
            }
            meet(&mut least, &mut before[REACH], sum);
        }
        *here = least;
    }
    for out in out {
        for l in 0..Lanes::COUNT {
            out.0[l] ^= BIAS;
        }
    }
}

#[inline(always)]
fn meet(here: &mut Lanes<u16>, there: &mut Lanes<u16>, sum: &Lanes<u16>) {
    for l in 0..Lanes::COUNT {
        here.0[l] = lesser(here.0[l], sum.0[l]);
        there.0[l] = lesser(there.0[l], sum.0[l]);
    }
}

/// The lesser of two sums.
#[inline(always)]
fn lesser(a: u16, b: u16) -> u16 {
    (a as i16).min(b as i16) as u16
}

/// The squares of the differences of two columns, capped, plus [`RAISE`]: a saturating sum caps in
/// one operation, and SSE2 finds no minimum of numbers without a sign.
#[inline(always)]
fn square(a: &Lanes<u16>, b: &Lanes<u16>, l: usize) -> u16 {
    // Pixels have 8 bits, so the square is right modulo 65536 whatever the difference's sign.
    let difference = a.0[l].wrapping_sub(b.0[l]);
    difference.wrapping_mul(difference).saturating_add(RAISE)
}
