//! Winner-takes-all: the disparity of the least aggregated cost of every pixel, in both images,
//! with uniqueness test and sub-pixel fraction.

use super::{Lanes, VolumeShape};
use crate::error::Result;
use crate::stereo::{Reason, buffer};

const N: usize = Lanes::COUNT;

/// Least sum of eight path costs for a disparity that is not admissible.
const OUTSIDE: i16 = 8 * super::volume::OUTSIDE as i16;

/// Aggregated costs of a row of pixels: sums of eight path costs.
pub struct Totals {
    shape: VolumeShape,
    span: usize,
    /// By disparity, then pixel, padded with a block of [`OUTSIDE`] at both ends; and another row,
    /// so that there is a whole one after the last pixel, too.
    sums: Vec<i16>,
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
    pub fn new(shape: VolumeShape) -> Result<Self> {
        let span = shape.padded() + 2 * N;
        Ok(Self {
            shape,
            span,
            sums: buffer(OUTSIDE, (shape.count + 1) * span)?,
        })
    }

    /// The sums of the pixels from `x` on, from place `i` of the range on; from each place to the
    /// next `shift` pixels further.
    #[inline(always)]
    fn places<const W: usize>(
        &self,
        i: usize,
        x: i32,
        shift: usize,
    ) -> impl Iterator<Item = &[i16; W]> {
        let first = i * self.span + (x + N as i32) as usize;
        let places = self.sums[first..].chunks_exact(self.span + shift);
        places.map(|sums| sums.first_chunk().expect("a block"))
    }

    /// The sums of the pixels from `x` on at each place of the range.
    #[inline(always)]
    pub(super) fn places_mut<const W: usize>(
        &mut self,
        x: usize,
    ) -> impl Iterator<Item = &mut [i16; W]> {
        let places = self.sums[x + N..].chunks_exact_mut(self.span);
        places.map(|sums| sums.first_chunk_mut().expect("a block"))
    }

    /// The sum at place `i` of the range, of the pixel `x`.
    #[inline(always)]
    fn at(&self, i: usize, x: usize) -> i16 {
        self.sums[i * self.span + x + N]
    }
}

/// See [`super::choose_row`].
#[inline(always)]
pub(super) fn choose<const W: usize>(totals: &Totals, uniqueness: u32, row: &mut ChosenRow<'_>) {
    choose_left::<W>(totals, uniqueness, row);
    choose_right::<W>(totals, row);
}

/// The left image's winners.
#[inline(always)]
fn choose_left<const W: usize>(totals: &Totals, uniqueness: u32, row: &mut ChosenRow<'_>) {
    let shape = totals.shape;
    for (part, (left, why)) in row
        .left
        .chunks_mut(W)
        .zip(row.why.chunks_mut(W))
        .enumerate()
    {
        let (x, reached) = ((part * W) as i32, shape.reached_in(part * W / N));
        let places = || totals.places::<W>(0, x, 0).take(reached);
        let (least, place) = least(0, places());
        let other = other(places(), &place);
        let mut beside = [[0; W]; 2];
        for l in 0..W {
            let sum = |i: usize| {
                if i < reached {
                    totals.at(i, part * W + l)
                } else {
                    OUTSIDE
                }
            };
            let place = place[l] as usize;
            // Below the first place the index wraps to far beyond `reached`: outside.
            (beside[0][l], beside[1][l]) = (sum(place.wrapping_sub(1)), sum(place + 1));
        }
        let mut sixteenths = [0; W];
        for l in 0..W {
            let found = 16 * (shape.first + i32::from(place[l]))
                + fraction(beside[0][l], least[l], beside[1][l]);
            sixteenths[l] = if least[l] < OUTSIDE { found as i16 } else { 0 };
        }
        left.copy_from_slice(&sixteenths[..left.len()]);
        for (l, why) in why.iter_mut().enumerate() {
            // Cross-multiplied: a quotient would round.
            let limit = least[l] as u32 * (100 + uniqueness);
            let ambiguous = (other[l] < OUTSIDE) & (100 * (other[l] as u32) < limit);
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
}

/// The right image's winners, from the same sums (Hirschmüller 2008, section 2.3), along a diagonal
/// of the volume.
#[inline(always)]
fn choose_right<const W: usize>(totals: &Totals, row: &mut ChosenRow<'_>) {
    let shape = totals.shape;
    for (part, right) in row.right.as_chunks_mut::<W>().0.iter_mut().enumerate() {
        // The right pixel x meets the left one x + d.
        let x = (part * W) as i32 + shape.first;
        let place = |x: i32| (x.max(0) as usize).min(shape.count);
        let met = place(1 - W as i32 - x)..place(shape.width as i32 - x);
        let places = totals.places::<W>(met.start, x + met.start as i32, 1);
        let (least, place) = least(met.start, places.take(met.len()));
        for l in 0..W {
            let disparity = (shape.first + i32::from(place[l])) as i16;
            right[l] = if least[l] < OUTSIDE {
                disparity
            } else {
                ChosenRow::NONE
            };
        }
    }
}

/// The least sums over places of the range, the first of which is `first`, and their places, the
/// first at a tie.
#[inline(always)]
fn least<'a, const W: usize>(
    first: usize,
    places: impl Iterator<Item = &'a [i16; W]>,
) -> ([i16; W], [i16; W]) {
    let (mut least, mut place) = ([i16::MAX; W], [0i16; W]);
    for (i, sums) in places.enumerate() {
        let sums = *sums;
        for l in 0..W {
            // The place increases: the last one that takes the lead is the greatest.
            let takes = i16::from(sums[l] < least[l]).wrapping_neg();
            place[l] = place[l].max((first + i) as i16 & takes);
            least[l] = least[l].min(sums[l]);
        }
    }
    (least, place)
}

/// The least sums of all disparities except `place` and its neighbours.
#[inline(always)]
fn other<'a, const W: usize>(
    places: impl Iterator<Item = &'a [i16; W]>,
    place: &[i16; W],
) -> [i16; W] {
    let mut other = [i16::MAX; W];
    for (i, sums) in places.enumerate() {
        for l in 0..W {
            // 0 ..= 2 for the place and its neighbours.
            let near = (i as i16).wrapping_sub(place[l]).wrapping_add(1) as u16;
            let ruled_out = i16::from(near <= 2).wrapping_neg() & i16::MAX;
            other[l] = other[l].min(sums[l] | ruled_out);
        }
    }
    other
}

/// Sub-pixel position of the minimum between its neighbours, in 16ths: equiangular, two lines of
/// opposite slope, as Hamming distances grow linearly.
#[inline(always)]
fn fraction(lower: i16, least: i16, higher: i16) -> i32 {
    let between = (lower < OUTSIDE) & (higher < OUTSIDE);
    let rise = i32::from(lower.max(higher)) - i32::from(least);
    let fall = i32::from(lower) - i32::from(higher);
    // Half away from zero. The numbers are small enough for single precision to find the whole part
    // exactly.
    let sixteenths = ((16 * fall + fall.signum() * rise) as f32 / (2 * rise.max(1)) as f32) as i32;
    if between { sixteenths } else { 0 }
}
