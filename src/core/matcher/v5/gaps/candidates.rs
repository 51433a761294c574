//! The hypotheses of a lattice's pixels, with the measurements of each.

use super::super::census::HalfImage;
use super::super::half_map::HalfPixels;
use super::super::sums::{PixelSums, StripSums};
use super::lines::{NONE, NearestSeen, SeenPixel};
use crate::kernel::{GapCandidates, Group, HYPOTHESES, Isa, PIXEL_FEATURES, describe_hypotheses};
use crate::stereo::Reason;
use std::ops::Range;

pub(super) const LANES: usize = Group::ROWS;

/// Reach of the windows around a pixel.
const NEAR_REACH: usize = 2;
const WIDE_REACH: usize = 7;

/// Number of seen pixels around a seen pixel that keeps its disparity: most of the 25.
const MIN_SEEN: u8 = 13;

/// Quality of a pixel's winner: seen pixels of the 25 around, uniqueness 0..=127, cost.
#[derive(Clone, Copy, Default)]
pub(super) struct Quality {
    seen: u8,
    unique: u8,
    own: u8,
}

/// Planes that the hypotheses are read from.
pub(super) struct Measured<'a> {
    /// Columns and rows of the lattice, and of the half image those of which it has one, as powers
    /// of two.
    pub(super) lattice: (usize, usize),
    pub(super) steps: [u32; 2],
    pub(super) half: HalfPixels<'a>,
    pub(super) image: &'a HalfImage,
    pub(super) sums: &'a StripSums,
    pub(super) quarter: HalfPixels<'a>,
    pub(super) quarter_sums: &'a StripSums,
    pub(super) quality: &'a [Quality],
    pub(super) along_rows: &'a [NearestSeen],
    pub(super) along_columns: &'a [NearestSeen],
}

/// Memory of a task.
pub(super) struct Band {
    candidates: Box<GapCandidates>,
    /// Places of the lanes' pixels in the band.
    places: Vec<usize>,
    sums: RowSums,
}

impl Band {
    pub(super) fn new(width: usize) -> Self {
        Self {
            candidates: Box::default(),
            places: Vec::with_capacity(LANES),
            sums: RowSums::new(width),
        }
    }
}

/// A pixel that keeps its disparity, or a block of pixels to be weighed, with their places in the
/// lattice.
pub(super) enum GapStep<'a> {
    Sure(usize, i16),
    Block(&'a GapCandidates, &'a [usize]),
}

/// Sums over the rows around a row, by column: seen pixels of the wide window; steps of grey along
/// rows and along columns in the near one.
pub(super) struct RowSums {
    seen: Vec<u16>,
    across: Vec<u16>,
    down: Vec<u16>,
}

/// Rows within reach.
fn around(y: usize, reach: usize, height: usize) -> Range<usize> {
    y.saturating_sub(reach)..height.min(y + reach + 1)
}

/// `min(⌊64·(second − least) / (least + 8)⌋, 127)`; the quotient of such small floats is not
/// rounded up to a whole number.
fn uniqueness(least: u8, second: u8) -> u8 {
    let rise = 64 * (i32::from(second) - i32::from(least));
    ((rise as f32 / (i32::from(least) + 8) as f32) as i32).min(127) as u8
}

/// Measures the winners of row `y`.
pub(super) fn measure_row(map: &HalfPixels<'_>, y: usize, out: &mut [Quality]) {
    let (width, height) = map.size;
    out.fill(Quality::default());
    // Sums of columns first, in a place that is written again.
    for row in around(y, NEAR_REACH, height) {
        let row = &map.seen[row * width..][..width];
        let columns = out.iter_mut().zip(row);
        columns.for_each(|(out, seen)| out.unique += seen);
    }
    // The window's sum moves along the row.
    let mut sum = out
        .iter()
        .take(NEAR_REACH)
        .map(|quality| quality.unique)
        .sum();
    for x in 0..width {
        sum += out.get(x + NEAR_REACH).map_or(0, |quality| quality.unique);
        out[x].seen = sum;
        sum -= x
            .checked_sub(NEAR_REACH)
            .map_or(0, |first| out[first].unique);
    }
    let [least, second, own] =
        [map.least, map.second, map.own].map(|plane| &plane[y * width..][..width]);
    for (x, out) in out.iter_mut().enumerate() {
        (out.unique, out.own) = (uniqueness(least[x], second[x]), own[x]);
    }
}

impl RowSums {
    pub(super) fn new(width: usize) -> Self {
        let row = || vec![0; width];
        Self {
            seen: row(),
            across: row(),
            down: row(),
        }
    }

    fn load(&mut self, measured: &Measured<'_>, y: usize) {
        let (width, height) = measured.half.size;
        self.seen.fill(0);
        for row in around(y, WIDE_REACH, height) {
            let row = &measured.half.seen[row * width..][..width];
            let sums = self.seen.iter_mut().zip(row);
            sums.for_each(|(sum, seen)| *sum += u16::from(*seen));
        }
        self.across.fill(0);
        self.down.fill(0);
        for y in around(y, NEAR_REACH, height) {
            let row = measured.image.row(y);
            let above = measured.image.row(y.saturating_sub(1));
            let sums = self.across[1..].iter_mut().zip(row.iter().zip(&row[1..]));
            sums.for_each(|(sum, (a, b))| *sum += a.abs_diff(*b));
            let sums = self.down.iter_mut().zip(row.iter().zip(above));
            sums.for_each(|(sum, (a, b))| *sum += a.abs_diff(*b));
        }
    }
}

impl Measured<'_> {
    /// Shows the pixels at these places of whole rows of the lattice to a function.
    pub(super) fn each(
        &self,
        isa: Isa,
        places: Range<usize>,
        band: &mut Band,
        take: &mut dyn FnMut(GapStep<'_>),
    ) {
        let Band {
            candidates,
            places: block,
            sums,
        } = band;
        block.clear();
        let width = self.half.size.0;
        for place in places {
            let (column, row) = (place % self.lattice.0, place / self.lattice.0);
            let [x, y] = [column << self.steps[0], row << self.steps[1]];
            if column == 0 {
                sums.load(self, y);
            }
            let pixel = y * width + x;
            if self.half.seen[pixel] == 1 && self.quality[pixel].seen >= MIN_SEEN {
                take(GapStep::Sure(place, self.half.bins[pixel]));
                continue;
            }
            self.load(candidates, block.len(), [column, row], sums);
            block.push(place);
            if block.len() == LANES {
                describe_hypotheses(isa, candidates);
                take(GapStep::Block(candidates, block));
                block.clear();
            }
        }
        if !block.is_empty() {
            describe_hypotheses(isa, candidates);
            take(GapStep::Block(candidates, block));
        }
    }

    /// Loads a pixel of the lattice into a lane.
    fn load(
        &self,
        candidates: &mut GapCandidates,
        lane: usize,
        [column, row]: [usize; 2],
        sums: &RowSums,
    ) {
        // The compiler then knows that it is within bounds.
        let lane = lane % LANES;
        let (half, width) = (&self.half, self.half.size.0);
        let (x, y) = (column << self.steps[0], row << self.steps[1]);
        let pixel = y * width + x;
        let grey = i32::from(self.image.at(x, y));
        let small = self.quarter_pixel([x, y]);
        let path_sums = self.sums.pixel([x, y]);
        let small_sums = self.quarter_sums.pixel(small.place);

        for exists in &mut candidates.exists {
            exists[lane] = false;
        }
        let measured = HypothesisPixel {
            x,
            grey,
            right: &half.right[y * width..=pixel],
            counts: [half.count, self.quarter.count],
            sums: [&path_sums, &small_sums],
            least: [half.least[pixel].into(), small.least],
        };
        let own = Hypothesis {
            bin: half.bins[pixel].into(),
            distance: 0,
            barrier: 0,
            grey,
            ends: 0,
            quality: self.quality[pixel],
        };
        measured.put(candidates, lane, 0, own);
        self.put_seen(&measured, candidates, lane, [column, row]);
        if !small.is_beyond {
            let small_hypothesis = Hypothesis {
                bin: small.bin,
                quality: small.quality,
                ..own
            };
            measured.put(candidates, lane, 11, small_hypothesis);
        }

        candidates.filled[lane] = half.filled[pixel].into();
        let features = self.pixel_features([x, y], &own, &small, sums);
        for (to, feature) in candidates.pixel.iter_mut().zip(features) {
            to[lane] = feature;
        }
    }

    /// The pixel at quarter size that covers a pixel of the half image.
    #[inline]
    fn quarter_pixel(&self, [x, y]: [usize; 2]) -> QuarterPixel {
        let quarter = &self.quarter;
        let (width, height) = quarter.size;
        let place = [(x / 2).min(width - 1), (y / 2).min(height - 1)];
        let pixel = place[1] * width + place[0];
        let bin = i32::from(quarter.bins[pixel]);
        // The winner's own disparity, of both ends of its bins.
        let is_beyond = (bin + 8) / 16 > (self.half.count as i32 - 1) / 2;
        QuarterPixel {
            place,
            is_beyond,
            bin: (2 * bin).min(16 * self.half.count as i32 - 1),
            quality: Quality {
                seen: 25 * u8::from(!is_beyond && quarter.why[pixel] == Reason::Valid),
                unique: uniqueness(quarter.least[pixel], quarter.second[pixel]),
                own: quarter.own[pixel],
            },
            least: quarter.least[pixel].into(),
        }
    }

    /// Measures the hypotheses 1 to 10: those seen along the row and the column of a pixel, and
    /// those interpolated between the nearest of them.
    #[inline]
    fn put_seen(
        &self,
        measured: &HypothesisPixel<'_>,
        candidates: &mut GapCandidates,
        lane: usize,
        [column, row]: [usize; 2],
    ) {
        let (x, y) = (column << self.steps[0], row << self.steps[1]);
        let lines = [
            &self.along_rows[row * self.lattice.0 + column],
            &self.along_columns[column * self.lattice.1 + row],
        ];
        for (axis, line) in lines.into_iter().enumerate() {
            let find = |seen: &SeenPixel| {
                let at = usize::from(seen.at);
                let (from, from_here) = [([at, y], x), ([x, at], y)][axis];
                let pixel = from[1] * self.half.size.0 + from[0];
                Hypothesis {
                    bin: self.half.bins[pixel].into(),
                    distance: at.abs_diff(from_here) as i32,
                    barrier: seen.barrier.into(),
                    grey: self.image.at(from[0], from[1]).into(),
                    ends: 0,
                    quality: self.quality[pixel],
                }
            };
            let mut nearest = [None; 2];
            for (direction, [first, other]) in line.iter().enumerate() {
                if first.at != NONE {
                    let found = find(first);
                    nearest[direction] = Some(found);
                    measured.put(candidates, lane, 1 + 2 * axis + direction, found);
                }
                if other.at != NONE {
                    measured.put(candidates, lane, 5 + 2 * axis + direction, find(other));
                }
            }
            if let [Some(a), Some(b)] = nearest {
                measured.put(candidates, lane, 9 + axis, Hypothesis::between(a, b));
            }
        }
    }

    /// The features of a pixel, whose own winner is `own`.
    #[inline]
    fn pixel_features(
        &self,
        [x, y]: [usize; 2],
        own: &Hypothesis,
        small: &QuarterPixel,
        sums: &RowSums,
    ) -> [i32; PIXEL_FEATURES] {
        let half = &self.half;
        let (width, height) = half.size;
        let pixel = y * width + x;
        let agrees = matches!(half.why[pixel], Reason::Valid | Reason::Ambiguous);
        let near = |sums: &[u16]| {
            sums[around(x, NEAR_REACH, width)]
                .iter()
                .sum::<u16>()
                .into()
        };
        let wide: u16 = sums.seen[around(x, WIDE_REACH, width)].iter().sum();
        [
            64 * i32::from(half.seen[pixel]),
            64 * i32::from(agrees),
            (85 * i32::from(own.quality.own)) >> 4,
            2 * i32::from(own.quality.unique),
            (128 * x / width) as i32 - 64,
            (128 * y / height) as i32 - 64,
            near(&sums.across),
            near(&sums.down),
            (5 * i32::from(own.quality.seen)) >> 1,
            (73 * i32::from(wide)) >> 8,
            // These two are computed with the features of the hypotheses.
            0,
            0,
            half.least[pixel].into(),
            (own.grey >> 3) - 64,
            2 * i32::from(small.quality.unique),
            64 * i32::from(small.quality.seen / 25),
            small.bin - own.bin,
        ]
    }
}

/// The winner of a pixel at quarter size.
struct QuarterPixel {
    place: [usize; 2],
    /// True if the winner is farther than the half image's range.
    is_beyond: bool,
    /// Bin of the half image.
    bin: i32,
    quality: Quality,
    /// Least path cost.
    least: i32,
}

/// A pixel of which hypotheses are measured; of pairs, the first is at half size, the second at
/// quarter size.
struct HypothesisPixel<'a> {
    x: usize,
    grey: i32,
    /// The right image's winners, up to the pixel's column.
    right: &'a [u8],
    counts: [usize; 2],
    sums: [&'a PixelSums<'a>; 2],
    /// The pixel's least path costs.
    least: [i32; 2],
}

impl HypothesisPixel<'_> {
    /// Measures hypothesis `k`. A function, because a closure would read each variable and test
    /// each bound again.
    fn put(&self, candidates: &mut GapCandidates, lane: usize, k: usize, hypothesis: Hypothesis) {
        assert!(k < HYPOTHESES);
        // The compiler then knows that it is within bounds.
        let lane = lane % LANES;
        let bin = hypothesis.bin;
        let disparity = ((bin as u32 + 8) / 16).min(self.counts[0] as u32 - 1) as usize;
        let small = ((bin as u32 + 16) / 32).min(self.counts[1] as u32 - 1) as usize;
        candidates.exists[k][lane] = true;
        candidates.bin[k][lane] = bin;
        candidates.distance[k][lane] = hypothesis.distance;
        candidates.barrier[k][lane] = hypothesis.barrier;
        candidates.grey[k][lane] = (self.grey - hypothesis.grey).abs();
        candidates.excess[k][lane] = self.sums[0].at(disparity) - self.least[0];
        candidates.quarter_excess[k][lane] = self.sums[1].at(small) - self.least[1];
        let there = self.x.checked_sub(disparity);
        candidates.leads_out[k][lane] = there.is_none().into();
        candidates.right[k][lane] = there.map_or(0, |x| 16 * i32::from(self.right[x]) - bin);
        candidates.seen[k][lane] = hypothesis.quality.seen.into();
        candidates.unique[k][lane] = hypothesis.quality.unique.into();
        candidates.own[k][lane] = hypothesis.quality.own.into();
        candidates.ends[k][lane] = hypothesis.ends;
    }
}

/// A disparity that the scene may have at a pixel.
#[derive(Clone, Copy)]
struct Hypothesis {
    bin: i32,
    distance: i32,
    barrier: i32,
    /// Grey level where it was seen.
    grey: i32,
    /// Difference of the ends of an interpolation.
    ends: i32,
    quality: Quality,
}

impl Hypothesis {
    /// Interpolated between the nearest seen pixels on both sides, rounded.
    fn between(a: Self, b: Self) -> Self {
        let distance = a.distance + b.distance;
        let sum = a.bin * b.distance + b.bin * a.distance;
        Self {
            bin: ((2 * sum + distance) as u32 / (2 * distance) as u32) as i32,
            distance: a.distance.max(b.distance),
            barrier: a.barrier.max(b.barrier),
            grey: a.grey,
            ends: a.bin - b.bin,
            quality: Quality {
                seen: a.quality.seen.min(b.quality.seen),
                unique: a.quality.unique.min(b.quality.unique),
                own: a.quality.own.max(b.quality.own),
            },
        }
    }
}
