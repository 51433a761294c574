//! Sums of squared differences of windows of nine pixels that slide along the rows of a block.
//!
//! As a window moves on by one pixel, one square comes in and one goes out (thesis, section 5.3.3, "Optimization", and
//! figure 5.10).

use super::Lanes;
use super::ssd::CAP;

/// Half of the window: it covers x − 4 ..= x + 4.
pub(super) const REACH: usize = 4;

/// A number that sums squares.
pub(super) trait Sum: Copy {
    const ZERO: Self;
    /// What a square of that size counts.
    fn of(square: u16) -> Self;
    /// The sum after one square came in and one, which it contained, went out.
    fn slide(self, come: Self, gone: Self) -> Self;
}

/// Squares capped at [`CAP`].
impl Sum for u16 {
    const ZERO: Self = 0;

    #[inline(always)]
    fn of(square: u16) -> Self {
        square.min(CAP)
    }

    #[inline(always)]
    fn slide(self, come: Self, gone: Self) -> Self {
        self.wrapping_add(come).wrapping_sub(gone)
    }
}

/// Whole squares.
impl Sum for u32 {
    const ZERO: Self = 0;

    #[inline(always)]
    fn of(square: u16) -> Self {
        u32::from(square)
    }

    #[inline(always)]
    fn slide(self, come: Self, gone: Self) -> Self {
        self.wrapping_add(come).wrapping_sub(gone)
    }
}

/// Makes of `sums` those of the window around `x` in `left` with each of the `windows` in `right`, from the rightmost
/// on. Before, they were those for `x - 1` and windows one pixel to the left.
#[inline(always)]
pub(super) fn slide<S: Sum>(
    sums: &mut [Lanes<S>],
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
                sum.0[l] = sum.0[l].slide(come, gone);
            }
        }
    }
    for (sum, u) in new.iter_mut().zip((windows.start..fresh).rev()) {
        *sum = Lanes([S::ZERO; Lanes::COUNT]);
        for (a, b) in left[x - REACH..=x + REACH].iter().zip(&right[u - REACH..=u + REACH]) {
            for l in 0..Lanes::COUNT {
                sum.0[l] = sum.0[l].slide(square(a, b, l), S::ZERO);
            }
        }
    }
}

#[inline(always)]
fn square<S: Sum>(a: &Lanes<u16>, b: &Lanes<u16>, l: usize) -> S {
    // Pixels have 8 bits, so the square is right modulo 65536 whatever the difference's sign.
    let difference = a.0[l].wrapping_sub(b.0[l]);
    S::of(difference.wrapping_mul(difference))
}
