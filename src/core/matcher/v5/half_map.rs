//! Disparities at half size: winners, checks, and filled gaps.

use super::census::{HalfImage, padded};
use super::sums::StripSums;
use crate::depth::decision::{fill_empty_rows, fill_row};
use crate::error::Result;
use crate::kernel::{Isa, RowWinners, WinnerTest, choose_winners, test_winners, winner_fractions};
use crate::stereo::{DisparityMap, Reason, buffer};
use rayon::prelude::*;
use std::ops::Range;

/// Rows summed at once.
const TILE: usize = 16;

/// State of the half image's pixels, in raster order.
pub(super) struct HalfMap {
    pub(super) size: (usize, usize),
    count: usize,
    /// Disparities in bins of 1/8 pixel of the full image.
    bins: Vec<i16>,
    /// The matching costs of the disparities.
    own: Vec<u8>,
    /// Result of the tests.
    why: Vec<Reason>,
    /// The least sums, those of rivals, and the right image's winners, which only the weighing of
    /// gaps reads.
    winners: [Vec<u8>; 3],
    /// 1 for a pixel that is seen.
    seen: Vec<u8>,
    /// True if any pixel is.
    pub(super) sees: bool,
    /// Bins of all pixels, gaps filled; meaningless if no pixel was seen.
    filled: Vec<i16>,
    bands: Vec<BandScratch>,
    band_rows: usize,
}

/// The planes of a [`HalfMap`].
#[derive(Clone, Copy)]
pub(super) struct HalfPixels<'a> {
    pub(super) size: (usize, usize),
    pub(super) count: usize,
    pub(super) bins: &'a [i16],
    pub(super) own: &'a [u8],
    pub(super) why: &'a [Reason],
    pub(super) least: &'a [u8],
    pub(super) second: &'a [u8],
    pub(super) right: &'a [u8],
    pub(super) seen: &'a [u8],
    pub(super) filled: &'a [i16],
}

struct BandScratch {
    sums: Vec<u8>,
    winners: RowWinners,
    /// Number of three rows that pass, per column, with one more pixel at both ends.
    passing: Vec<u8>,
    /// A row of the full image.
    row: (Vec<f32>, Vec<Reason>),
}

/// Elements per disparity in a row of sums: the row's pixels, and room for the shift by
/// disparities.
fn stride(width: usize, count: usize) -> usize {
    padded(width) + padded(count)
}

impl HalfMap {
    /// The map of `count` disparities.
    pub(super) fn new(size: (usize, usize), count: usize) -> Result<Self> {
        let (width, height) = size;
        // More bands than threads, so that a thread that finishes early finds another.
        let bands = match rayon::current_num_threads() {
            1 => 1,
            threads => 2 * threads,
        };
        let band_rows = height.div_ceil(bands).next_multiple_of(TILE);
        let scratch = || {
            Ok(BandScratch {
                sums: buffer(u8::MAX, TILE * count * stride(width, count))?,
                winners: RowWinners::new(padded(width)),
                passing: vec![0; width + 2],
                row: (
                    vec![0.0; 2 * width + 1],
                    vec![Reason::Border; 2 * width + 1],
                ),
            })
        };
        let pixels = width * height;
        Ok(Self {
            size,
            count,
            bins: buffer(0, pixels)?,
            own: buffer(0, pixels)?,
            why: buffer(Reason::Border, pixels)?,
            winners: [buffer(0, pixels)?, buffer(0, pixels)?, buffer(0, pixels)?],
            seen: buffer(0, pixels)?,
            sees: false,
            filled: buffer(0, pixels)?,
            bands: (0..height.div_ceil(band_rows))
                .map(|_| scratch())
                .collect::<Result<_>>()?,
            band_rows,
        })
    }

    /// Chooses the winners and tests them.
    pub(super) fn choose(
        &mut self,
        isa: Isa,
        sums: &StripSums,
        images: &[HalfImage; 2],
        test: &WinnerTest,
    ) {
        let ((width, _), count, band_rows) = (self.size, self.count, self.band_rows);
        let stride = stride(width, count);
        let pixels = band_rows * width;
        let [least, second, right] = &mut self.winners;
        let planes = (
            self.bins.par_chunks_mut(pixels),
            self.own.par_chunks_mut(pixels),
            self.why.par_chunks_mut(pixels),
            least.par_chunks_mut(pixels),
            second.par_chunks_mut(pixels),
            right.par_chunks_mut(pixels),
            &mut self.bands,
        );
        let bands = planes.into_par_iter().enumerate();
        bands.for_each(|(band, (bins, own, why, least, second, right, scratch))| {
            let rows = own.chunks_exact_mut(width).zip(why.chunks_exact_mut(width));
            for (i, (bins, (own, why))) in bins.chunks_exact_mut(width).zip(rows).enumerate() {
                let y = band * band_rows + i;
                if i % TILE == 0 {
                    sums.rows(isa, y, width, stride, &mut scratch.sums);
                }
                let row_sums = &scratch.sums[i % TILE * count * stride..][..count * stride];
                choose_winners(isa, row_sums, stride, &mut scratch.winners);
                winner_fractions(isa, &scratch.winners, count, bins);
                let censuses = images.each_ref().map(|image| image.censuses(y));
                test_winners(isa, test, &scratch.winners, censuses, own, why);
                let winners = &scratch.winners;
                for (to, from) in [
                    (&mut *least, &winners.least),
                    (&mut *second, &winners.second),
                    (&mut *right, &winners.right),
                ] {
                    to[i * width..][..width].copy_from_slice(&from[..width]);
                }
            }
        });
    }

    /// A pixel stays seen if at least five of the nine around it pass the tests. Gaps between seen
    /// pixels of a row are filled: by their mean, by the smaller of two that differ by more than
    /// `jump`, by the only one at the ends. A row without any uses the nearest row that has some.
    pub(super) fn fill(&mut self, jump: i32) {
        let (size, band_rows) = (self.size, self.band_rows);
        let (width, why, bins) = (size.0, &self.why, &self.bins);
        let pixels = band_rows * width;
        let planes = (
            self.seen.par_chunks_mut(pixels),
            self.filled.par_chunks_mut(pixels),
            &mut self.bands,
        );
        let bands = planes.into_par_iter().enumerate();
        bands.for_each(|(band, (seen, filled, scratch))| {
            let rows = seen
                .chunks_exact_mut(width)
                .zip(filled.chunks_exact_mut(width));
            for (y, (seen, filled)) in (band * band_rows..).zip(rows) {
                keep_majorities(why, size, y, &mut scratch.passing, seen);
                fill_row(&bins[y * width..][..width], seen, jump, filled);
            }
        });
        self.sees = fill_empty_rows(&self.seen, width, &mut self.filled);
    }

    /// The pixels for the weighing of gaps.
    pub(super) fn pixels(&self) -> HalfPixels<'_> {
        let [least, second, right] = &self.winners;
        HalfPixels {
            size: self.size,
            count: self.count,
            bins: &self.bins,
            own: &self.own,
            why: &self.why,
            least,
            second,
            right,
            seen: &self.seen,
            filled: &self.filled,
        }
    }

    /// Bins, seen flags, and the sum of the costs, for the columns of a row.
    pub(super) fn part(&self, y: usize, columns: &Range<usize>) -> (&[i16], &[u8], i64) {
        let start = y * self.size.0;
        let places = start + columns.start..start + columns.end;
        let own = self.own[places.clone()].iter();
        let cost: u32 = own.map(|&own| u32::from(own)).sum();
        (
            &self.filled[places.clone()],
            &self.seen[places],
            cost.into(),
        )
    }

    /// Writes the seen disparities of a level to the pair's map: each to all its pixels; what is
    /// left at the right and at the bottom copies its neighbour.
    pub(super) fn write(&mut self, level: usize, map: &mut DisparityMap) {
        let ((width, height), shift) = (self.size, level + 1);
        // The bands of the map; odd last rows may need one more band than there are.
        let full_rows = self.band_rows << shift;
        let rest = map.size().1.div_ceil(self.bands.len());
        let full_rows = full_rows.max(rest.next_multiple_of(1 << shift));
        let bands = &mut self.bands[..map.size().1.div_ceil(full_rows)];
        map.each_band_mut(full_rows, bands, |top, band, scratch| {
            let (disparities, reasons) = &mut scratch.row;
            for (y, mut row) in (top..).zip(band.into_rows()) {
                disparities.resize(row.width(), 0.0);
                reasons.resize(row.width(), Reason::Border);
                // All rows of a pixel are equal, and so are the rest.
                if y % (1 << shift) == 0 && y >> shift < height || y == top {
                    let start = (y >> shift).min(height - 1) * width;
                    let places = start..start + width;
                    let pixels = self.bins[places.clone()].iter();
                    let pixels = pixels.zip(&self.seen[places.clone()]);
                    let scale = (1 << level) as f32 / 8.0;
                    let disparity = |(bin, seen): (&i16, &u8)| match seen {
                        1 => f32::from(*bin) * scale,
                        _ => f32::INFINITY,
                    };
                    repeat(pixels.map(disparity), shift, disparities);
                    let pixels = self.why[places.clone()].iter().zip(&self.seen[places]);
                    let reason = |(why, seen): (&Reason, &u8)| match (seen, *why) {
                        // The pixel matched, but its neighbours failed.
                        (0, Reason::Valid) => Reason::Ambiguous,
                        (_, why) => why,
                    };
                    repeat(pixels.map(reason), shift, reasons);
                }
                row.write(&disparities[..], &reasons[..]);
            }
        });
    }
}

/// Writes each value `1 << shift` times, and the last one to what is left.
fn repeat<T: Copy>(values: impl Iterator<Item = T>, shift: usize, out: &mut [T]) {
    let mut last = None;
    let mut rest = &mut *out;
    if shift == 1 {
        // Half size, with pairs that the compiler writes at once.
        let (pairs, odd) = rest.as_chunks_mut::<2>();
        for (out, value) in pairs.iter_mut().zip(values) {
            (*out, last) = ([value; 2], Some(value));
        }
        rest = odd;
    } else {
        for value in values {
            let (own, others) = rest.split_at_mut(1 << shift);
            own.fill(value);
            (rest, last) = (others, Some(value));
        }
    }
    if let Some(last) = last {
        rest.fill(last);
    }
}

/// Marks the pixels of row `y` for which at least five of the nine around them pass.
fn keep_majorities(
    why: &[Reason],
    (width, height): (usize, usize),
    y: usize,
    passing: &mut [u8],
    seen: &mut [u8],
) {
    let row = |y: usize| &why[y * width..][..width];
    let passes = |why: Reason| u8::from(why == Reason::Valid);
    let [above, here, below] = [y.saturating_sub(1), y, (y + 1).min(height - 1)].map(row);
    let rows = above.iter().zip(here).zip(below);
    for (sum, ((above, here), below)) in passing[1..=width].iter_mut().zip(rows) {
        *sum = passes(*above) + passes(*here) + passes(*below);
    }
    passing[0] = passing[1];
    passing[width + 1] = passing[width];
    for ((seen, why), sums) in seen.iter_mut().zip(here).zip(passing.windows(3)) {
        *seen = passes(*why) & u8::from(sums[0] + sums[1] + sums[2] >= 5);
    }
}
