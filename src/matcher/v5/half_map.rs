//! The disparities of the half image: winners, checks, and the gaps filled.

use super::census::{HalfImage, padded};
use super::sums::StripSums;
use crate::kernel::{Isa, RowWinners, choose_winners, winner_fractions};
use crate::stereo::{DisparityMap, Reason};
use rayon::prelude::*;

/// Rows that are summed up at once.
const TILE: usize = 16;

/// What is known of the pixels of the half image, in raster order.
pub(super) struct HalfMap {
    size: (usize, usize),
    count: usize,
    winners: Vec<Winner>,
    bands: Vec<BandScratch>,
    band_rows: usize,
    /// Sums of three rows, a pixel more at both ends.
    columns: Vec<u8>,
    /// 1 where a pixel is seen.
    seen: Vec<u8>,
    /// Bins of all pixels, the gaps filled; of no meaning where no pixel was seen.
    filled: Vec<i16>,
}

/// What is made of a pixel's sums.
#[derive(Clone, Copy)]
struct Winner {
    /// Disparity in bins of 1/8 pixel of the full image.
    bin: i16,
    /// The matching cost of the disparity.
    own: u8,
    /// Whether it passes the tests, or why not.
    why: Reason,
}

struct BandScratch {
    sums: Vec<u8>,
    winners: RowWinners,
    bins: Vec<i16>,
}

/// What a winner must pass, and the cost of leaving the image.
#[derive(Clone, Copy)]
pub(super) struct WinnerTest {
    pub(super) unique: u32,
    pub(super) out: u8,
}

/// Pixels of a disparity of a row of sums: the row's, and as many as the disparities shift it.
fn stride(width: usize, count: usize) -> usize {
    padded(width) + padded(count)
}

impl HalfMap {
    pub(super) fn new(size: (usize, usize), count: usize) -> Self {
        let (width, height) = size;
        // More bands than threads, so that a thread that finishes early finds another.
        let bands = match rayon::current_num_threads() {
            1 => 1,
            threads => 2 * threads,
        };
        let band_rows = height.div_ceil(bands).next_multiple_of(TILE);
        let scratch = || BandScratch {
            sums: vec![0; TILE * count * stride(width, count)],
            winners: RowWinners::new(padded(width)),
            bins: vec![0; padded(width)],
        };
        let winner = Winner {
            bin: 0,
            own: 0,
            why: Reason::Border,
        };
        Self {
            size,
            count,
            winners: vec![winner; width * height],
            bands: (0..height.div_ceil(band_rows)).map(|_| scratch()).collect(),
            band_rows,
            columns: vec![0; width + 2],
            seen: vec![0; width * height],
            filled: vec![0; width * height],
        }
    }

    /// Chooses the winners and tests them.
    pub(super) fn choose(
        &mut self,
        isa: Isa,
        sums: &StripSums,
        images: &[HalfImage; 2],
        test: WinnerTest,
    ) {
        let ((width, _), count, band_rows) = (self.size, self.count, self.band_rows);
        let stride = stride(width, count);
        let bands = self.winners.par_chunks_mut(band_rows * width);
        let bands = bands.zip(&mut self.bands).enumerate();
        bands.for_each(|(band, (winners, scratch))| {
            for (i, winners) in winners.chunks_exact_mut(width).enumerate() {
                let y = band * band_rows + i;
                if i % TILE == 0 {
                    sums.rows(isa, y, width, stride, &mut scratch.sums);
                }
                let of_row = &scratch.sums[i % TILE * count * stride..][..count * stride];
                choose_winners(isa, of_row, stride, &mut scratch.winners);
                winner_fractions(isa, &scratch.winners, count, &mut scratch.bins);
                for (x, winner) in winners.iter_mut().enumerate() {
                    let (why, own) = test.winner(images, &scratch.winners, (x, y));
                    *winner = Winner {
                        bin: scratch.bins[x],
                        own,
                        why,
                    };
                }
            }
        });
    }

    /// A pixel stays seen when at least five of the nine around it pass the tests.
    pub(super) fn keep_majorities(&mut self) {
        let (width, height) = self.size;
        let winners = &self.winners;
        let row = |y: usize| &winners[y * width..][..width];
        let passes = |winner: &Winner| u8::from(winner.why == Reason::Valid);
        for (y, seen) in self.seen.chunks_exact_mut(width).enumerate() {
            let [above, here, below] = [y.saturating_sub(1), y, (y + 1).min(height - 1)].map(row);
            for (x, sum) in self.columns[1..=width].iter_mut().enumerate() {
                *sum = passes(&above[x]) + passes(&here[x]) + passes(&below[x]);
            }
            self.columns[0] = self.columns[1];
            self.columns[width + 1] = self.columns[width];
            for ((seen, winner), sums) in seen.iter_mut().zip(here).zip(self.columns.windows(3)) {
                let around = sums[0] + sums[1] + sums[2];
                *seen = passes(winner) & u8::from(around >= 5);
            }
        }
    }

    /// Fills the gaps between seen pixels of a row: by their mean, by the smaller of two that differ
    /// by more than `jump`, by the only one at the ends. A row without any takes the nearest one.
    pub(super) fn fill(&mut self, jump: i32) {
        let (width, height) = self.size;
        let seen_in = |y: usize| &self.seen[y * width..][..width];
        for y in 0..height {
            let (seen, winners) = (seen_in(y), &self.winners[y * width..][..width]);
            let filled = &mut self.filled[y * width..][..width];
            let mut before: Option<(usize, i16)> = None;
            for x in (0..width).filter(|&x| seen[x] == 1) {
                let bin = winners[x].bin;
                let (from, value) = match before {
                    None => (0, bin),
                    Some((at, left)) if i32::from(left.abs_diff(bin)) > jump => {
                        (at + 1, left.min(bin))
                    }
                    Some((at, left)) => (at + 1, (left + bin) >> 1),
                };
                filled[from..x].fill(value);
                filled[x] = bin;
                before = Some((x, bin));
            }
            if let Some((at, bin)) = before {
                filled[at + 1..].fill(bin);
            }
        }
        let has_any = |y: usize| self.seen[y * width..][..width].contains(&1);
        // Rows that have some and rows that are copied do not overlap.
        let mut above = None;
        for y in 0..height {
            if has_any(y) {
                above = Some(y);
                continue;
            }
            let below = (y + 1..height).find(|&other| has_any(other));
            let nearest = match (above, below) {
                (Some(above), Some(below)) if below - y < y - above => below,
                (Some(row), _) | (None, Some(row)) => row,
                (None, None) => return,
            };
            self.filled
                .copy_within(nearest * width..(nearest + 1) * width, y * width);
        }
    }

    pub(super) fn size(&self) -> (usize, usize) {
        self.size
    }

    /// Whether any pixel is seen.
    pub(super) fn sees(&self) -> bool {
        self.seen.contains(&1)
    }

    /// Bins, which pixels are seen, and the sum of the costs, of a row's columns.
    pub(super) fn part(&self, y: usize, columns: &std::ops::Range<usize>) -> (&[i16], &[u8], i64) {
        let places = y * self.size.0 + columns.start..y * self.size.0 + columns.end;
        let costs = self.winners[places.clone()].iter();
        let cost: u32 = costs.map(|winner| u32::from(winner.own)).sum();
        (
            &self.filled[places.clone()],
            &self.seen[places],
            i64::from(cost),
        )
    }

    /// Writes the seen disparities to the full image: each to its four pixels, an odd last column or
    /// row as its neighbour.
    pub(super) fn write(&self, map: &mut DisparityMap) {
        let (width, height) = self.size;
        for (y, mut row) in map.rows_mut().enumerate() {
            let start = (y / 2).min(height - 1) * width;
            for x in 0..row.width() {
                let place = start + (x / 2).min(width - 1);
                let winner = self.winners[place];
                match winner.why {
                    _ if self.seen[place] == 1 => row.accept(x, f32::from(winner.bin) / 8.0),
                    // Its neighbours failed.
                    Reason::Valid => row.reject(x, Reason::Ambiguous),
                    why => row.reject(x, why),
                }
            }
        }
    }
}

impl WinnerTest {
    /// Whether the winner of a pixel passes, and its cost.
    fn winner(
        self,
        [left, right]: &[HalfImage; 2],
        winners: &RowWinners,
        (x, y): (usize, usize),
    ) -> (Reason, u8) {
        let best = usize::from(winners.best[x]);
        let Some(match_x) = x.checked_sub(best) else {
            return (Reason::Border, self.out);
        };
        let own = left.distance(right, y, x, match_x);
        if usize::from(winners.right[match_x]) != best {
            return (Reason::Inconsistent, own);
        }
        let (least, second) = (u32::from(winners.least[x]), u32::from(winners.second[x]));
        let is_unique = match second {
            // There is no other.
            255 => self.unique > 0,
            _ => self.unique * (second - least) >= least + 8,
        };
        (
            if is_unique {
                Reason::Valid
            } else {
                Reason::Ambiguous
            },
            own,
        )
    }
}
