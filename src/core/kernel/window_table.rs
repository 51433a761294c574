//! Hash table of windows by the sum of their pixels (thesis, section 5.3.4), and the search for the
//! cheapest match of a right window in it.

use super::pairs::{Group, Pairs};
use super::sliding_ssd::{REACH, WINDOW, weight};
use crate::stereo::{Gray, Plane};

/// Pairs of pixels of a window; the last pair is half empty.
const PAIRS: usize = WINDOW.div_ceil(2);
/// Windows compared at a time.
const CHUNK: usize = 2 * Group::ROWS;
/// Sums a window can have.
const SUMS: usize = WINDOW * 255 + 1;

/// Windows whose sums differ by up to this are searched first: most windows find their match there,
/// and its cost bounds the rest of the search.
const FIRST: u32 = 32;
/// Invalid value: the sum of a window that is in no table.
pub const NO_SUM: u16 = u16::MAX;

/// A hash table of the left windows that those of a right row may match; the hash of a window is
/// the sum of its nine pixels.
///
/// Buckets are contiguous, so that those of neighbouring sums are one range of indices. The pixels
/// of a window are in five planes of pairs, so that windows at neighbouring indices are compared in
/// one vector.
#[derive(Clone, Debug)]
pub struct WindowTable {
    /// Index at which the bucket of each sum begins, and the end of the last one.
    starts: Vec<u32>,
    /// Per window the rank of its row, then 16 bits for its column. There is room for a chunk after
    /// the last, also in the other planes.
    windows: Vec<u32>,
    pairs: [Vec<[i16; 2]>; PAIRS],
    /// Sums of the squares of the pixels.
    squares: Vec<u32>,
}

impl WindowTable {
    /// For rows of `width` pixels, at most [`crate::stereo::MAX_SIDE`], and windows up to
    /// `row_tolerance` rows away.
    pub fn new(width: usize, row_tolerance: usize) -> Self {
        let places = width * (2 * row_tolerance + 1) + CHUNK;
        Self {
            starts: vec![0; SUMS + 1],
            windows: vec![0; places],
            pairs: std::array::from_fn(|_| vec![[0; 2]; places]),
            squares: vec![0; places],
        }
    }

    /// Fills the table with the windows of the rows of `image` around row `y`, up to
    /// `row_tolerance` away. `sums` are their sums, [`NO_SUM`] for windows to be skipped.
    pub fn fill(&mut self, image: &Gray, sums: &Plane<u16>, y: usize, row_tolerance: usize) {
        let rows = || y.saturating_sub(row_tolerance)..sums.height().min(y + row_tolerance + 1);
        self.starts.fill(0);
        for row in rows() {
            sums.row(row)
                .iter()
                .filter(|sum| **sum != NO_SUM)
                .for_each(|&sum| self.starts[usize::from(sum)] += 1);
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
            for (x, &sum) in sums
                .row(row)
                .iter()
                .enumerate()
                .filter(|(_, sum)| **sum != NO_SUM)
            {
                let start = &mut self.starts[usize::from(sum)];
                *start -= 1;
                let place = *start as usize;
                self.windows[place] = (rank << 16 | x) as u32;
                let pixels = window(image.row(row), x);
                self.squares[place] = squares(pixels);
                self.pairs
                    .iter_mut()
                    .zip(pairs(pixels))
                    .for_each(|(pairs, pair)| pairs[place] = pair);
            }
        }
    }

    /// The indices of the windows whose sum is within `tolerance` of `sum`.
    #[inline(always)]
    fn near(&self, sum: u32, tolerance: u32) -> std::ops::Range<usize> {
        let first = sum.saturating_sub(tolerance) as usize;
        let end = ((sum + tolerance) as usize + 1).min(SUMS);
        self.starts[first] as usize..self.starts[end] as usize
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
        let window = Window::around(row, u);
        let mut best = [Candidate::NONE; CHUNK];
        let near = search
            .table
            .near(window.sum, search.sum_tolerance.min(FIRST));
        window.compare(&pairs, search, near.clone(), &mut best);
        let tolerance = search.sum_tolerance.min(least(&best).farthest_sum());
        if tolerance > FIRST {
            let rest = search.table.near(window.sum, tolerance);
            window.compare(&pairs, search, rest.start..near.start, &mut best);
            window.compare(&pairs, search, near.end..rest.end, &mut best);
        }
        *proposal = least(&best).proposal(search.min_disparity);
    }
}

/// A cost, the rank of its row (0, above 1, below 2, two above 3, ...) and its disparity, counted
/// from the least, in one word: the least word is the best match.
#[derive(Clone, Copy, PartialEq)]
struct Candidate(u64);

impl Candidate {
    const NONE: Self = Self(u64::MAX);

    #[inline(always)]
    fn new(cost: u32, rank_and_index: u32) -> Self {
        Self(u64::from(cost) << 32 | u64::from(rank_and_index))
    }

    /// Largest difference of sums that can still win: nine differences that sum to s have squares
    /// of at least s² / 9, and no weight is below 25.
    #[inline(always)]
    fn farthest_sum(self) -> u32 {
        ((self.0 >> 32) as f32 * (9.0 / 25.0)).sqrt() as u32 + 2
    }

    #[inline(always)]
    fn proposal(self, min_disparity: i32) -> Proposal {
        let (cost, rank, index) = ((self.0 >> 32) as u32, (self.0 >> 16) as u16, self.0 as u16);
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

#[inline(always)]
fn least(candidates: &[Candidate; CHUNK]) -> Candidate {
    let mut least = u64::MAX;
    for candidate in candidates {
        least = least.min(candidate.0);
    }
    Candidate(least)
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
fn pairs(pixels: &[u8; WINDOW]) -> [[i16; 2]; PAIRS] {
    std::array::from_fn(|k| {
        [2 * k, 2 * k + 1].map(|i| if i < WINDOW { i16::from(pixels[i]) } else { 0 })
    })
}

/// A window of the right image.
struct Window {
    u: usize,
    sum: u32,
    squares: u32,
    /// Its pixels times −2, the same for all windows that it is compared with.
    pairs: [Group<[i16; 2]>; PAIRS],
}

impl Window {
    #[inline(always)]
    fn around(row: &[u8], u: usize) -> Self {
        let pixels = window(row, u);
        Self {
            u,
            sum: pixels.iter().map(|&pixel| u32::from(pixel)).sum(),
            squares: squares(pixels),
            pairs: pairs(pixels).map(|pair| Group::splat(pair.map(|pixel| -2 * pixel))),
        }
    }

    /// Keeps in `best` the best of its content and the matches at those `places`.
    #[inline(always)]
    fn compare(
        &self,
        pairs: &impl Pairs,
        search: &TableSearch<'_>,
        places: std::ops::Range<usize>,
        best: &mut [Candidate; CHUNK],
    ) {
        let table = search.table;
        let first = self.u as i32 + search.min_disparity;
        let count = (search.max_disparity - search.min_disparity) as u32;
        for start in places.clone().step_by(CHUNK) {
            let windows: &[u32; CHUNK] = chunk(&table.windows, start);
            let len = (places.end - start) as u32;
            // (l − r)² = l² − 2·l·r + r²
            let mut ssds = [0; CHUNK];
            for (group, ssds) in ssds.as_chunks_mut().0.iter_mut().enumerate() {
                let start = start + group * Group::ROWS;
                let mut sums = Group(*chunk(&table.squares, start));
                for (left, right) in table.pairs.iter().zip(self.pairs) {
                    sums = pairs.add_products(sums, [Group(*chunk(left, start)), right]);
                }
                *ssds = sums.0;
            }
            let mut costs = [0; CHUNK];
            let mut ranks_and_indices = [0; CHUNK];
            for l in 0..CHUNK {
                let index = ((windows[l] & 0xffff) as i32 - first) as u32;
                let cost = ssds[l]
                    .wrapping_add(self.squares)
                    .wrapping_mul(weight(search.min_disparity.wrapping_add(index as i32)));
                costs[l] = if (index <= count) & ((l as u32) < len) {
                    cost
                } else {
                    u32::MAX
                };
                ranks_and_indices[l] = windows[l] & !0xffff | index & 0xffff;
            }
            for l in 0..CHUNK {
                best[l].0 = best[l]
                    .0
                    .min(Candidate::new(costs[l], ranks_and_indices[l]).0);
            }
        }
    }
}

#[inline(always)]
fn chunk<T, const N: usize>(places: &[T], start: usize) -> &[T; N] {
    // The planes extend a chunk beyond the last window.
    places[start..].first_chunk().expect("room for a chunk")
}
