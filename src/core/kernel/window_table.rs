//! Hash table of windows by the sum of their pixels (thesis, section 5.3.4), and the search for the
//! cheapest match of a right window in it.

use super::pairs::{Group, Pairs};
use super::sliding_ssd::{REACH, WINDOW, short_weight, weight};
use crate::error::Result;
use crate::stereo::{Gray, Plane, buffer};
use std::ops::Range;

/// Words of the pixels of a window, four pixels each; the last word has one.
const WORDS: usize = WINDOW.div_ceil(4);
/// Windows compared at a time.
const CHUNK: usize = 2 * Group::ROWS;
/// Sums a window can have.
const SUMS: usize = WINDOW * 255 + 1;
/// Columns whose windows are together in the table.
const COLUMNS: usize = 64;

/// Windows whose sums differ by up to this are searched first: most windows find their match there,
/// and its cost bounds the rest of the search.
const FIRST: u32 = 32;
/// Invalid value: the sum of a window that is in no table.
pub const NO_SUM: u16 = u16::MAX;

/// A hash table of the left windows that those of a right row may match; the hash of a window is
/// the block of columns that contains it, and the sum of its nine pixels.
///
/// Buckets are contiguous, so that those of neighbouring sums are one range of indices. The pixels
/// of a window are in three planes of words, so that windows at neighbouring indices are compared
/// in one vector.
#[derive(Clone, Debug)]
pub struct WindowTable {
    /// Index at which each bucket begins, and the end of the last one.
    starts: Vec<u32>,
    /// Column of each window. There is room for a chunk after the last, also in the other planes.
    columns: Vec<u16>,
    /// Rank of its row.
    ranks: Vec<u16>,
    /// Four pixels each, the first in the lowest byte.
    words: [Vec<u32>; WORDS],
    /// Sums of the squares of the pixels.
    squares: Vec<u32>,
}

impl WindowTable {
    /// For rows of `width` pixels, at most [`crate::stereo::MAX_SIDE`], and windows up to
    /// `row_tolerance` rows away.
    pub fn new(width: usize, row_tolerance: usize) -> Result<Self> {
        let places = width * (2 * row_tolerance + 1) + CHUNK;
        let word = || buffer(0, places);
        Ok(Self {
            starts: buffer(0, width.div_ceil(COLUMNS) * SUMS + 1)?,
            columns: buffer(0, places)?,
            ranks: buffer(0, places)?,
            words: [word()?, word()?, word()?],
            squares: buffer(0, places)?,
        })
    }

    /// Fills the table with the windows of the rows of `image` around row `y`, up to
    /// `row_tolerance` away. `sums` are their sums, [`NO_SUM`] for windows to be skipped.
    pub fn fill(&mut self, image: &Gray, sums: &Plane<u16>, y: usize, row_tolerance: usize) {
        let rows = || y.saturating_sub(row_tolerance)..sums.height().min(y + row_tolerance + 1);
        let windows = |row: usize| {
            let windows = sums.row(row).iter().enumerate();
            windows.filter(|(_, sum)| **sum != NO_SUM)
        };
        let bucket = |x: usize, sum: u16| x / COLUMNS * SUMS + usize::from(sum);
        self.starts.fill(0);
        for row in rows() {
            windows(row).for_each(|(x, &sum)| self.starts[bucket(x, sum)] += 1);
        }
        let mut end = 0;
        for start in &mut self.starts {
            end += *start;
            *start = end;
        }
        // From here on starts are ends, and each window moves that of its bucket back by one.
        for row in rows() {
            // At equal distance the row above ranks first.
            let rank = 2 * row.abs_diff(y) - usize::from(row < y);
            for (x, &sum) in windows(row) {
                let start = &mut self.starts[bucket(x, sum)];
                *start -= 1;
                let place = *start as usize;
                (self.columns[place], self.ranks[place]) = (x as u16, rank as u16);
                let pixels = window(image.row(row), x);
                self.squares[place] = squares(pixels);
                self.words
                    .iter_mut()
                    .zip(words(pixels))
                    .for_each(|(words, word)| words[place] = word);
            }
        }
    }

    /// The indices of the windows in a block of columns whose sum is within `tolerance` of `sum`.
    #[inline(always)]
    fn near(&self, block: usize, sum: u32, tolerance: u32) -> Range<usize> {
        let first = sum.saturating_sub(tolerance) as usize;
        let end = ((sum + tolerance) as usize + 1).min(SUMS);
        let starts = &self.starts[block * SUMS..][..SUMS + 1];
        starts[first] as usize..starts[end] as usize
    }
}

/// The sums of the windows of `row` around the `marked` pixels, [`NO_SUM`] elsewhere.
pub fn window_sums(row: &[u8], marked: &[bool], out: &mut [u16]) {
    out.fill(NO_SUM);
    for (x, window) in (REACH..).zip(row.windows(WINDOW)) {
        if marked[x] {
            out[x] = window.iter().map(|&pixel| u16::from(pixel)).sum();
        }
    }
}

/// The left windows that a window of the right image is compared with.
#[derive(Clone, Copy)]
pub struct TableSearch<'a> {
    pub table: &'a WindowTable,
    /// Disparities, both ends included; cost is SSD · (25 + 4·|d|) and fits 32 bits.
    pub min_disparity: i32,
    pub max_disparity: i32,
    /// Largest difference between the sums of two windows.
    pub sum_tolerance: u32,
}

/// The cheapest left window of a right window: the match it proposes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Proposal {
    /// The match's SSD, `u32::MAX` if there is none.
    pub ssd: u32,
    pub disparity: i16,
    /// Row of the right window minus that of the left one.
    pub row_offset: i8,
}

impl Proposal {
    pub const NONE: Self = Self {
        ssd: u32::MAX,
        disparity: 0,
        row_offset: 0,
    };

    /// The cost of the match; without a match, more than any real one.
    pub fn cost(self) -> u32 {
        if self.ssd == u32::MAX {
            u32::MAX
        } else {
            self.ssd * weight(self.disparity.into())
        }
    }
}

/// See [`super::propose_row`].
#[inline(always)]
pub(super) fn propose_row(
    pairs: impl Pairs,
    search: &TableSearch<'_>,
    row: &[u8],
    out: &mut [Proposal],
) {
    out.fill(Proposal::NONE);
    let end = row.len().saturating_sub(REACH);
    for (u, proposal) in out.iter_mut().enumerate().take(end).skip(REACH) {
        let place = |disparity: i32| (u as i32 + disparity).clamp(0, end as i32) as usize;
        let columns = place(search.min_disparity)..place(search.max_disparity + 1);
        let blocks = || columns.start / COLUMNS..columns.end.div_ceil(COLUMNS);
        let window = Window::around(row, u);
        let near = |block: usize, tolerance: u32| {
            let tolerance = tolerance.min(search.sum_tolerance);
            search.table.near(block, window.sum, tolerance)
        };
        let mut best = Candidate::NONE;
        for block in blocks() {
            window.compare(&pairs, search, near(block, FIRST), &mut best);
        }
        for block in blocks() {
            let (first, all) = (near(block, FIRST), near(block, best.farthest_sum()));
            window.compare(&pairs, search, all.start..first.start, &mut best);
            window.compare(&pairs, search, first.end..all.end, &mut best);
        }
        *proposal = best.proposal(search.min_disparity);
    }
}

/// A cost, the rank of its row (0, above 1, below 2, two above 3, ...) and its disparity, counted
/// from the least, in one word: the least word is the best match.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Candidate(u64);

impl Candidate {
    const NONE: Self = Self(u64::MAX);

    #[inline(always)]
    fn new(cost: u32, rank_and_index: u32) -> Self {
        Self(u64::from(cost) << 32 | u64::from(rank_and_index))
    }

    #[inline(always)]
    fn cost(self) -> u32 {
        (self.0 >> 32) as u32
    }

    /// Largest difference of sums that can still win: nine differences that sum to s have squares
    /// of at least s² / 9, and no weight is below 25.
    #[inline(always)]
    fn farthest_sum(self) -> u32 {
        (self.cost() as f32 * (9.0 / 25.0)).sqrt() as u32 + 2
    }

    #[inline(always)]
    fn proposal(self, min_disparity: i32) -> Proposal {
        let (cost, rank, index) = (self.cost(), (self.0 >> 16) as u16, self.0 as u16);
        if cost == u32::MAX {
            return Proposal::NONE;
        }
        let disparity = min_disparity + i32::from(index);
        let distance = rank.div_ceil(2) as i8;
        let row_offset = if rank % 2 == 1 { distance } else { -distance };
        Proposal {
            ssd: cost / weight(disparity),
            disparity: disparity as i16,
            row_offset,
        }
    }
}

/// The pixels of the window around `x`.
#[inline(always)]
fn window(row: &[u8], x: usize) -> &[u8; WINDOW] {
    row[x - REACH..]
        .first_chunk()
        .expect("a window inside the row")
}

#[inline(always)]
fn squares(pixels: &[u8; WINDOW]) -> u32 {
    pixels.iter().map(|&pixel| u32::from(pixel).pow(2)).sum()
}

#[inline(always)]
fn words(pixels: &[u8; WINDOW]) -> [u32; WORDS] {
    std::array::from_fn(|k| {
        let pixel = |i: usize| pixels.get(4 * k + i).copied().unwrap_or(0);
        u32::from_le_bytes([pixel(0), pixel(1), pixel(2), pixel(3)])
    })
}

/// A window of the right image.
struct Window {
    u: u16,
    sum: u32,
    squares: u32,
    words: [u32; WORDS],
}

impl Window {
    #[inline(always)]
    fn around(row: &[u8], u: usize) -> Self {
        let pixels = window(row, u);
        Self {
            u: u as u16,
            sum: pixels.iter().map(|&pixel| u32::from(pixel)).sum(),
            squares: squares(pixels),
            words: words(pixels),
        }
    }

    /// Keeps in `best` the better of its content and the best match at those `places`.
    #[inline(always)]
    fn compare(
        &self,
        pairs: &impl Pairs,
        search: &TableSearch<'_>,
        places: Range<usize>,
        best: &mut Candidate,
    ) {
        let table = search.table;
        // Unrolled: `map` would be a call.
        let [first, second, third] = &table.words;
        let words = chunks(first, &places).iter();
        let words = words
            .zip(chunks(second, &places))
            .zip(chunks(third, &places));
        let windows = chunks(&table.columns, &places).iter();
        let windows = windows.zip(chunks(&table.ranks, &places));
        let windows = windows.zip(chunks(&table.squares, &places)).zip(words);
        let mut count = places.len();
        for (((columns, ranks), squares), ((first, second), third)) in windows {
            let mut ssds = [0; CHUNK];
            for (g, ssds) in ssds.as_chunks_mut().0.iter_mut().enumerate() {
                let group = |plane: &[u32; CHUNK]| Group(plane.as_chunks().0[g]);
                let words = [group(first), group(second), group(third)];
                // (l − r)² = l² + r² − 2·l·r
                let mut sums = group(squares);
                for sum in &mut sums.0 {
                    *sum += self.squares;
                }
                *ssds = pairs.subtract_twice(sums, words, self.words).0;
            }
            let mut costs = [0; CHUNK];
            let mut least = u32::MAX;
            for l in 0..CHUNK {
                // Right for all admissible matches.
                let weight = short_weight(columns[l].abs_diff(self.u));
                costs[l] = ssds[l].wrapping_mul(weight.into());
                least = least.min(costs[l]);
            }
            // Few chunks have a better match.
            if least <= best.cost() {
                *best = self.best(search, columns, ranks, &costs, count).min(*best);
            }
            count = count.wrapping_sub(CHUNK);
        }
    }

    /// The best of the first `count` matches of a chunk.
    #[inline(always)]
    fn best(
        &self,
        search: &TableSearch<'_>,
        columns: &[u16; CHUNK],
        ranks: &[u16; CHUNK],
        costs: &[u32; CHUNK],
        count: usize,
    ) -> Candidate {
        let first = i32::from(self.u) + search.min_disparity;
        let disparities = (search.max_disparity - search.min_disparity) as u32;
        let mut admissible = [u32::MAX; CHUNK];
        let mut least = u32::MAX;
        for l in 0..CHUNK {
            let index = (i32::from(columns[l]) - first) as u32;
            let inside = (index <= disparities) & (l < count);
            admissible[l] = if inside { costs[l] } else { u32::MAX };
            least = least.min(admissible[l]);
        }
        let mut place = u32::MAX;
        for l in 0..CHUNK {
            let index = (i32::from(columns[l]) - first) as u16;
            let here = u32::from(ranks[l]) << 16 | u32::from(index);
            place = place.min(if admissible[l] == least {
                here
            } else {
                u32::MAX
            });
        }
        Candidate::new(least, place)
    }
}

/// The `places` of a plane, and others up to the end of the last chunk.
#[inline(always)]
fn chunks<'a, T>(plane: &'a [T], places: &Range<usize>) -> &'a [[T; CHUNK]] {
    // The planes extend a chunk beyond the last window.
    &plane[places.start..].as_chunks().0[..places.len().div_ceil(CHUNK)]
}
