//! The best disparity of every pixel from the sums over its paths, in both images.

use super::{Costs, DISPARITIES, Sums};
use crate::stereo::Reason;

/// What becomes of the sums of a row.
#[derive(Clone, Copy, Debug)]
pub struct SumTest {
    /// First disparity.
    pub first: i32,
    /// By how many per cent another disparity must be worse, 0 = off.
    pub uniqueness: u32,
}

/// The chosen disparities of a row.
pub struct ChosenRow<'a> {
    /// Of the left image, in 16ths of a pixel.
    pub left: &'a mut [i16],
    /// *Valid*, *ambiguous*, or *border* where no disparity leads into the right image.
    pub why: &'a mut [Reason],
    /// Of the right image, in pixels; **its pixels run backwards**, from the last but the first disparity on.
    pub right: &'a mut [i16],
    /// Least sums of the right image.
    pub right_sums: &'a mut [u16],
}

/// Sum of eight path costs where none is admissible.
const OUTSIDE: u16 = 8 * 255;

/// See [`super::choose_row`].
#[inline(always)]
pub(super) fn choose(sums: &[Sums], chunks: usize, test: &SumTest, row: &mut ChosenRow<'_>) {
    let width = row.left.len();
    row.right_sums.fill(OUTSIDE);
    for (x, sums) in sums.chunks_exact(chunks).enumerate() {
        let sums = &sums[..Costs::reached(x, test.first, chunks)];
        let (least, place) = least(sums);
        if least == OUTSIDE {
            (row.left[x], row.why[x]) = (0, Reason::Border);
            continue;
        }
        let other = u32::from(other(sums, place));
        let ambiguous = 100 * other < u32::from(least) * (100 + test.uniqueness);
        row.why[x] = if ambiguous { Reason::Ambiguous } else { Reason::Valid };
        row.left[x] = (16 * (test.first + place as i32) + fraction(sums, place, least)) as i16;

        let right = width - 1 - x..;
        let right_sums = row.right_sums[right.clone()].as_chunks_mut::<DISPARITIES>().0;
        let right = row.right[right].as_chunks_mut::<DISPARITIES>().0;
        for (chunk, (sums, (least, disparity))) in sums.iter().zip(right_sums.iter_mut().zip(right)).enumerate() {
            let first = test.first as i16 + (chunk * DISPARITIES) as i16;
            let (was, here) = (*least, *disparity);
            for i in 0..DISPARITIES {
                let takes = u16::from(sums.0[i] < was[i]).wrapping_neg() as i16;
                least[i] = was[i].min(sums.0[i]);
                disparity[i] = (first + i as i16) & takes | here[i] & !takes;
            }
        }
    }
}

/// The least of the sums and its place, the first at a tie: both in one word, so that one minimum finds them.
#[inline(always)]
fn least(sums: &[Sums]) -> (u16, u16) {
    let mut lanes = [u32::MAX; DISPARITIES];
    for (chunk, sums) in sums.iter().enumerate() {
        for (i, (lane, &sum)) in lanes.iter_mut().zip(&sums.0).enumerate() {
            *lane = (*lane).min(u32::from(sum) << 16 | (chunk * DISPARITIES + i) as u32);
        }
    }
    let mut least = u32::MAX;
    for lane in lanes {
        least = least.min(lane);
    }
    ((least >> 16) as u16, least as u16)
}

/// The least of the sums but for `place` and its neighbours.
#[inline(always)]
fn other(sums: &[Sums], place: u16) -> u16 {
    let mut lanes = [u16::MAX; DISPARITIES];
    for (chunk, sums) in sums.iter().enumerate() {
        for (i, (lane, &sum)) in lanes.iter_mut().zip(&sums.0).enumerate() {
            // 0 ..= 2 for the place and its neighbours.
            let near = ((chunk * DISPARITIES + i) as u16).wrapping_sub(place).wrapping_add(1);
            *lane = (*lane).min(sum | u16::from(near <= 2).wrapping_neg());
        }
    }
    let mut least = u16::MAX;
    for lane in lanes {
        least = least.min(lane);
    }
    least
}

/// Where between its neighbours the minimum lies, in 16ths.
#[inline(always)]
fn fraction(sums: &[Sums], place: u16, least: u16) -> i32 {
    let place = usize::from(place);
    let sum = |place: usize| i32::from(sums[place / DISPARITIES].0[place % DISPARITIES]);
    if place == 0 || place + 1 == sums.len() * DISPARITIES {
        return 0;
    }
    let (lower, higher, least) = (sum(place - 1), sum(place + 1), i32::from(least));
    if lower >= i32::from(OUTSIDE) || higher >= i32::from(OUTSIDE) {
        return 0;
    }
    let curvature = 2 * (lower.max(higher) - least);
    if curvature == 0 { 0 } else { (16 * (lower - higher) + (lower - higher).signum() * curvature / 2) / curvature }
}
