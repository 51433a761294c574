//! Winner-takes-all: the disparity of the least aggregated cost of every pixel, in both images,
//! with uniqueness test and sub-pixel fraction.

use super::{Lanes, VolumeShape};
use crate::stereo::Reason;

const N: usize = Lanes::COUNT;

/// Least sum of eight path costs for a disparity that is not admissible.
const OUTSIDE: u16 = 8 * super::volume::OUTSIDE as u16;

/// Aggregated costs of a row of pixels: sums of eight path costs.
pub struct Totals {
    shape: VolumeShape,
    span: usize,
    /// By disparity, then pixel, padded with a block of [`OUTSIDE`] at both ends.
    sums: Vec<u16>,
}

/// The chosen disparities of a row.
pub struct ChosenRow<'a> {
    /// In the left image, in 16ths of a pixel.
    pub left: &'a mut [i16],
    /// *Valid*, *ambiguous*, or *border* where no disparity leads into the right image.
    pub why: &'a mut [Reason],
    /// In the right image, in pixels, whole blocks; [`ChosenRow::NONE`] if no disparity leads into
    /// the left image.
    pub right: &'a mut [i16],
}

impl ChosenRow<'_> {
    /// No disparity.
    pub const NONE: i16 = i16::MIN;
}

impl Totals {
    /// For rows of volumes of that shape.
    pub fn new(shape: VolumeShape) -> Self {
        let span = shape.padded() + 2 * N;
        Self {
            shape,
            span,
            sums: vec![OUTSIDE; shape.count * span],
        }
    }

    /// The sums at place `i` of the range, of the pixels from `x` on.
    #[inline(always)]
    fn at(&self, i: usize, x: i32) -> &[u16; N] {
        self.sums[i * self.span..][..self.span][(x + N as i32) as usize..]
            .first_chunk()
            .expect("a block at both ends")
    }

    #[inline(always)]
    pub(super) fn at_mut(&mut self, i: usize, x: usize) -> &mut [u16; N] {
        self.sums[i * self.span..][..self.span][x + N..]
            .first_chunk_mut()
            .expect("a block at both ends")
    }
}

/// See [`super::choose_row`].
#[inline(always)]
pub(super) fn choose(totals: &Totals, uniqueness: u32, row: &mut ChosenRow<'_>) {
    let shape = totals.shape;
    for (block, (left, why)) in row
        .left
        .chunks_mut(N)
        .zip(row.why.chunks_mut(N))
        .enumerate()
    {
        let (x, reached) = ((block * N) as i32, shape.reached_in(block));
        let (least, place) = least(totals, 0..reached, |_| x);
        let other = other(totals, x, reached, &place);
        let mut beside = [[0; N]; 2];
        for l in 0..N {
            let sum = |i: usize| {
                if i < reached {
                    totals.at(i, x)[l]
                } else {
                    OUTSIDE
                }
            };
            let place = usize::from(place[l]);
            // Below the first place the index wraps to far beyond `reached`: outside.
            (beside[0][l], beside[1][l]) = (sum(place.wrapping_sub(1)), sum(place + 1));
        }
        let mut sixteenths = [0; N];
        for l in 0..N {
            let found = 16 * (shape.first + i32::from(place[l]))
                + fraction(beside[0][l], least[l], beside[1][l]);
            sixteenths[l] = if least[l] < OUTSIDE { found as i16 } else { 0 };
        }
        left.copy_from_slice(&sixteenths[..left.len()]);
        for (l, why) in why.iter_mut().enumerate() {
            // Cross-multiplied: a quotient would round.
            let limit = u32::from(least[l]) * (100 + uniqueness);
            let ambiguous = (other[l] < OUTSIDE) & (100 * u32::from(other[l]) < limit);
            let reason = if ambiguous {
                Reason::Ambiguous
            } else {
                Reason::Valid
            };
            *why = if least[l] < OUTSIDE {
                reason
            } else {
                Reason::Border
            };
        }
    }
    // The right image's winners come from the same sums (Hirschmüller 2008, section 2.3), along a
    // diagonal of the volume.
    for (block, right) in row.right.as_chunks_mut::<N>().0.iter_mut().enumerate() {
        // The right pixel x meets the left one x + d.
        let x = (block * N) as i32 + shape.first;
        let place = |x: i32| (x.max(0) as usize).min(shape.count);
        let met = place(1 - N as i32 - x)..place(shape.width as i32 - x);
        let (least, place) = least(totals, met, |i| x + i as i32);
        for l in 0..N {
            let disparity = (shape.first + i32::from(place[l])) as i16;
            right[l] = if least[l] < OUTSIDE {
                disparity
            } else {
                ChosenRow::NONE
            };
        }
    }
}

/// The least sums over a part of the range and their places, the first at a tie.
#[inline(always)]
fn least(
    totals: &Totals,
    range: std::ops::Range<usize>,
    x: impl Fn(usize) -> i32,
) -> ([u16; N], [u16; N]) {
    let (mut least, mut place) = ([u16::MAX; N], [0u16; N]);
    for i in range {
        let sums = totals.at(i, x(i));
        // Masks and a copy: a choice becomes a conditional store, which is a branch where the
        // instruction set has none.
        let (was, before) = (least, place);
        for l in 0..N {
            let takes = u16::from(sums[l] < was[l]).wrapping_neg();
            place[l] = (i as u16 & takes) | (before[l] & !takes);
            least[l] = was[l].min(sums[l]);
        }
    }
    (least, place)
}

/// The least sums of all disparities except `place` and its neighbours.
#[inline(always)]
fn other(totals: &Totals, x: i32, reached: usize, place: &[u16; N]) -> [u16; N] {
    let mut other = [u16::MAX; N];
    for i in 0..reached {
        let sums = totals.at(i, x);
        for l in 0..N {
            // 0 ..= 2 for the place and its neighbours.
            let near = (i as u16).wrapping_sub(place[l]).wrapping_add(1);
            other[l] = other[l].min(sums[l] | u16::from(near <= 2).wrapping_neg());
        }
    }
    other
}

/// Sub-pixel position of the minimum between its neighbours, in 16ths: equiangular, two lines of
/// opposite slope, as Hamming distances grow linearly.
#[inline(always)]
fn fraction(lower: u16, least: u16, higher: u16) -> i32 {
    let between = (lower < OUTSIDE) & (higher < OUTSIDE);
    let rise = i32::from(lower.max(higher)) - i32::from(least);
    let fall = i32::from(lower) - i32::from(higher);
    // Half away from zero. The numbers are small enough for single precision to find the whole part
    // exactly.
    let sixteenths = ((16 * fall + fall.signum() * rise) as f32 / (2 * rise.max(1)) as f32) as i32;
    if between { sixteenths } else { 0 }
}
