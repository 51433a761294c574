//! The hypotheses of a lattice's pixels, and what is measured for each.

use super::super::census::HalfImage;
use super::super::half_map::HalfPixels;
use super::super::sums::StripSums;
use super::lines::{NONE, Nearest};
use super::{Band, LANES};
use crate::kernel::{GapCandidates, HYPOTHESES, Isa, describe_hypotheses};
use crate::stereo::Reason;
use std::ops::Range;

/// Reach of the windows around a pixel.
const NEAR: usize = 2;
const WIDE: usize = 7;

/// Seen pixels of the window of a pixel that keeps its disparity: all.
const SURE: u8 = 25;

/// Planes that the hypotheses are read from.
pub(super) struct Candidates<'a> {
    /// Columns and rows of the lattice.
    pub(super) lattice: (usize, usize),
    pub(super) half: HalfPixels<'a>,
    pub(super) image: &'a HalfImage,
    pub(super) sums: &'a StripSums,
    pub(super) quarter: HalfPixels<'a>,
    pub(super) quarter_sums: &'a StripSums,
    pub(super) seen: &'a [u8],
    pub(super) unique: &'a [u8],
    pub(super) along_rows: &'a [Nearest],
    pub(super) along_columns: &'a [Nearest],
}

/// A pixel that keeps its disparity, or a block of pixels to be weighed, with their places in the
/// lattice.
pub(super) enum Step<'a> {
    Sure(usize, i16),
    Block(&'a GapCandidates, &'a [usize]),
}

/// Sums over the windows around a row's pixels: seen pixels of the wide one; steps of grey along
/// rows and along columns in the near one.
pub(super) struct RowSums {
    columns: Vec<u16>,
    seen: Vec<u16>,
    across: Vec<u16>,
    down: Vec<u16>,
}

/// Sums of `2·reach + 1` neighbours, fewer at the ends.
fn run_sums(columns: &[u16], reach: usize, out: &mut [u16]) {
    let mut sum: u16 = columns[..reach.min(columns.len())].iter().sum();
    for (x, out) in out.iter_mut().enumerate() {
        sum += columns.get(x + reach).copied().unwrap_or(0);
        *out = sum;
        sum -= if x >= reach { columns[x - reach] } else { 0 };
    }
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

/// Counts the seen pixels around those of row `y`, and computes how unique their winners are.
pub(super) fn measure_row(map: &HalfPixels<'_>, y: usize, seen: &mut [u8], unique: &mut [u8]) {
    let (width, height) = map.size;
    unique.fill(0);
    for row in around(y, NEAR, height) {
        let row = &map.seen[row * width..][..width];
        unique
            .iter_mut()
            .zip(row)
            .for_each(|(sum, seen)| *sum += seen);
    }
    for (x, seen) in seen.iter_mut().enumerate() {
        *seen = unique[around(x, NEAR, width)].iter().sum();
    }
    let rows = [map.least, map.second].map(|plane| &plane[y * width..][..width]);
    for (unique, (least, second)) in unique.iter_mut().zip(rows[0].iter().zip(rows[1])) {
        *unique = uniqueness(*least, *second);
    }
}

impl RowSums {
    pub(super) fn new(width: usize) -> Self {
        let row = || vec![0; width];
        Self {
            columns: row(),
            seen: row(),
            across: row(),
            down: row(),
        }
    }

    fn load(&mut self, of: &Candidates<'_>, y: usize) {
        let (width, height) = of.half.size;
        self.columns.fill(0);
        for row in around(y, WIDE, height) {
            let row = &of.half.seen[row * width..][..width];
            let sums = self.columns.iter_mut().zip(row);
            sums.for_each(|(sum, seen)| *sum += u16::from(*seen));
        }
        run_sums(&self.columns, WIDE, &mut self.seen);
        self.columns.fill(0);
        for row in around(y, NEAR, height) {
            let row = of.image.row(row);
            let steps = row.windows(2).map(|pair| pair[0].abs_diff(pair[1]));
            let sums = self.columns[1..].iter_mut().zip(steps);
            sums.for_each(|(sum, step)| *sum += step);
        }
        run_sums(&self.columns, NEAR, &mut self.across);
        self.columns.fill(0);
        for row in around(y, NEAR, height) {
            let rows = of
                .image
                .row(row)
                .iter()
                .zip(of.image.row(row.saturating_sub(1)));
            let sums = self.columns.iter_mut().zip(rows);
            sums.for_each(|(sum, (a, b))| *sum += a.abs_diff(*b));
        }
        run_sums(&self.columns, NEAR, &mut self.down);
    }
}

impl Candidates<'_> {
    /// Shows the pixels at these places of whole rows of the lattice to a function.
    pub(super) fn each(
        &self,
        isa: Isa,
        places: Range<usize>,
        band: &mut Band,
        take: &mut dyn FnMut(Step<'_>),
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
            if column == 0 {
                sums.load(self, 2 * row);
            }
            let pixel = 2 * row * width + 2 * column;
            if self.half.seen[pixel] == 1 && self.seen[pixel] >= SURE {
                take(Step::Sure(place, self.half.bins[pixel]));
                continue;
            }
            self.load(candidates, block.len(), (column, row), sums);
            block.push(place);
            if block.len() == LANES {
                describe_hypotheses(isa, candidates);
                take(Step::Block(candidates, block));
                block.clear();
            }
        }
        if !block.is_empty() {
            describe_hypotheses(isa, candidates);
            take(Step::Block(candidates, block));
        }
    }

    /// Loads a pixel of the lattice into a lane.
    fn load(
        &self,
        of: &mut GapCandidates,
        lane: usize,
        (column, row): (usize, usize),
        sums: &RowSums,
    ) {
        let (half, quarter) = (&self.half, &self.quarter);
        let (width, height) = half.size;
        let (x, y) = (2 * column, 2 * row);
        let pixel = y * width + x;
        let small = [column.min(quarter.size.0 - 1), row.min(quarter.size.1 - 1)];
        let small_pixel = small[1] * quarter.size.0 + small[0];
        let bin_at = |pixel: usize| i32::from(half.bins[pixel]);
        let quality = |pixel: usize| Quality {
            seen: self.seen[pixel].into(),
            unique: self.unique[pixel].into(),
            own: half.own[pixel].into(),
        };

        let mut found = [None; HYPOTHESES];
        let lines = [
            &self.along_rows[row * self.lattice.0 + column],
            &self.along_columns[column * self.lattice.1 + row],
        ];
        for (axis, line) in lines.into_iter().enumerate() {
            for (direction, seen) in line.iter().enumerate() {
                for (next, seen) in seen.iter().enumerate().filter(|(_, seen)| seen.at != NONE) {
                    let at = usize::from(seen.at);
                    let (from, here) = [(y * width + at, x), (at * width + x, y)][axis];
                    found[1 + 2 * axis + direction + 4 * next] = Some(Hypothesis {
                        from,
                        bin: bin_at(from),
                        distance: at.abs_diff(here) as i32,
                        barrier: seen.barrier.into(),
                        ends: 0,
                        quality: quality(from),
                    });
                }
            }
            if let [Some(a), Some(b)] = [found[1 + 2 * axis], found[2 + 2 * axis]] {
                found[9 + axis] = Some(Hypothesis::between(a, b));
            }
        }
        found[0] = Some(Hypothesis {
            from: pixel,
            bin: bin_at(pixel),
            distance: 0,
            barrier: 0,
            ends: 0,
            quality: quality(pixel),
        });
        let small_bin = 2 * i32::from(quarter.bins[small_pixel]);
        let small_quality = Quality {
            seen: 25 * i32::from(quarter.why[small_pixel] == Reason::Valid),
            unique: uniqueness(quarter.least[small_pixel], quarter.second[small_pixel]).into(),
            own: quarter.own[small_pixel].into(),
        };
        found[11] = Some(Hypothesis {
            from: pixel,
            bin: small_bin.min(16 * half.count as i32 - 1),
            distance: 0,
            barrier: 0,
            ends: 0,
            quality: small_quality,
        });

        let grey = |pixel: usize| i32::from(self.image.row(pixel / width)[pixel % width]);
        let here = grey(pixel);
        let least = i32::from(half.least[pixel]);
        let small_least = i32::from(quarter.least[small_pixel]);
        for (k, hypothesis) in found.into_iter().enumerate() {
            of.exists[k][lane] = hypothesis.is_some();
            let Some(hypothesis) = hypothesis else {
                continue;
            };
            let bin = hypothesis.bin;
            let disparity = ((bin as usize + 8) / 16).min(half.count - 1);
            let small_disparity = ((bin as usize + 16) / 32).min(quarter.count - 1);
            of.bin[k][lane] = bin;
            of.distance[k][lane] = hypothesis.distance;
            of.barrier[k][lane] = hypothesis.barrier;
            of.grey[k][lane] = (here - grey(hypothesis.from)).abs();
            of.excess[k][lane] = self.sums.at([x, y], disparity) - least;
            of.quarter_excess[k][lane] = self.quarter_sums.at(small, small_disparity) - small_least;
            of.leads_out[k][lane] = (x < disparity).into();
            of.right[k][lane] = match x.checked_sub(disparity) {
                Some(_) => 16 * i32::from(half.right[pixel - disparity]) - bin,
                None => 0,
            };
            of.seen[k][lane] = hypothesis.quality.seen;
            of.unique[k][lane] = hypothesis.quality.unique;
            of.own[k][lane] = hypothesis.quality.own;
            of.ends[k][lane] = hypothesis.ends;
        }
        of.filled[lane] = half.filled[pixel].into();
        let why = half.why[pixel];
        let agrees = matches!(why, Reason::Valid | Reason::Ambiguous);
        let Quality { seen, unique, own } = quality(pixel);
        // Places 10 and 11 are computed with the features.
        let features = [
            64 * i32::from(half.seen[pixel]),
            64 * i32::from(agrees),
            (85 * own) >> 4,
            2 * unique,
            (128 * x / width) as i32 - 64,
            (128 * y / height) as i32 - 64,
            sums.across[x].into(),
            sums.down[x].into(),
            (5 * seen) >> 1,
            (73 * i32::from(sums.seen[x])) >> 8,
            0,
            0,
            least,
            (here >> 3) - 64,
            2 * small_quality.unique,
            64 * small_quality.seen / 25,
            small_bin - bin_at(pixel),
        ];
        for (to, feature) in of.pixel.iter_mut().zip(features) {
            to[lane] = feature;
        }
    }
}

/// A disparity that the scene may have at a pixel.
#[derive(Clone, Copy)]
struct Hypothesis {
    /// Where it was seen.
    from: usize,
    bin: i32,
    distance: i32,
    barrier: i32,
    /// Difference of the ends of an interpolation.
    ends: i32,
    quality: Quality,
}

/// What is known of a winner: seen pixels of the 25 around, uniqueness, cost.
#[derive(Clone, Copy)]
struct Quality {
    seen: i32,
    unique: i32,
    own: i32,
}

impl Hypothesis {
    /// Interpolated between the nearest seen pixels on both sides, rounded.
    fn between(a: Self, b: Self) -> Self {
        let distance = a.distance + b.distance;
        let sum = a.bin * b.distance + b.bin * a.distance;
        Self {
            from: a.from,
            bin: (2 * sum + distance) / (2 * distance),
            distance: a.distance.max(b.distance),
            barrier: a.barrier.max(b.barrier),
            ends: a.bin - b.bin,
            quality: Quality {
                seen: a.quality.seen.min(b.quality.seen),
                unique: a.quality.unique.min(b.quality.unique),
                own: a.quality.own.max(b.quality.own),
            },
        }
    }
}
