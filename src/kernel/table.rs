//! Windows found by the sum of their pixels (thesis, section 5.3.4).

use super::slide::REACH;
use crate::stereo::{Gray, Plane};

/// Pixels of a window.
const WINDOW: usize = 2 * REACH + 1;
/// Windows compared at a time.
const CHUNK: usize = 32;
/// Sums a window can have.
const SUMS: usize = WINDOW * 255 + 1;

/// Sums this far apart are looked up first: most windows find their match there, and it bounds the rest of the search.
const FIRST: u32 = 32;
/// What stands for the sum of a window that is in no table.
pub const NO_SUM: u16 = u16::MAX;

/// A hash table of the left windows that those of a right row may match; the hash of a window is the sum of its nine
/// pixels.
///
/// Buckets lie one after the other, so that those of neighbouring sums are one range of places. A place's pixels stand
/// in nine planes, so that windows at neighbouring places are compared at a time.
#[derive(Clone, Debug)]
pub struct WindowTable {
    /// The place where the bucket of each sum begins, and where the last one ends.
    starts: Vec<u32>,
    /// Per place the rank of the window's row, then 16 bits for its column. There is room for a chunk behind the last,
    /// and so there is in the pixels.
    windows: Vec<u32>,
    pixels: [Vec<u16>; WINDOW],
}

impl WindowTable {
    /// For rows of `width` pixels, at most [`crate::stereo::MAX_SIDE`], and windows up to `row_tolerance` rows away.
    pub fn new(width: usize, row_tolerance: usize) -> Self {
        let places = width * (2 * row_tolerance + 1) + CHUNK;
        Self { starts: vec![0; SUMS + 1], windows: vec![0; places], pixels: std::array::from_fn(|_| vec![0; places]) }
    }

    /// Takes the windows of the rows of `image` around row `y`, as near as `row_tolerance`. Their sums stand in `sums`.
    pub fn fill(&mut self, image: &Gray, sums: &Plane<u16>, y: usize, row_tolerance: usize) {
        let rows = || y.saturating_sub(row_tolerance)..sums.height().min(y + row_tolerance + 1);
        self.starts.fill(0);
        for row in rows() {
            sums.row(row).iter().filter(|sum| **sum != NO_SUM).for_each(|&sum| self.starts[usize::from(sum)] += 1);
        }
        let mut end = 0;
        for start in &mut self.starts {
            end += *start;
            *start = end;
        }
        // From here on starts are ends, and each window moves its bucket's back by one.
        for row in rows() {
            // The row above is the better of two at one distance.
            let rank = 2 * row.abs_diff(y) - usize::from(row < y);
            for (x, &sum) in sums.row(row).iter().enumerate().filter(|(_, sum)| **sum != NO_SUM) {
                let start = &mut self.starts[usize::from(sum)];
                *start -= 1;
                let place = *start as usize;
                self.windows[place] = (rank << 16 | x) as u32;
                let window = &image.row(row)[x - REACH..];
                self.pixels.iter_mut().zip(window).for_each(|(pixels, &pixel)| pixels[place] = u16::from(pixel));
            }
        }
    }

    /// The places of the windows whose sum is within `tolerance` of `sum`.
    #[inline(always)]
    fn near(&self, sum: u32, tolerance: u32) -> std::ops::Range<usize> {
        let first = sum.saturating_sub(tolerance) as usize;
        let end = ((sum + tolerance) as usize + 1).min(SUMS);
        self.starts[first] as usize..self.starts[end] as usize
    }
}

/// The sums of the windows of `row` around the pixels that `marked` names, [`NO_SUM`] elsewhere.
pub fn window_sums(row: &[u8], marked: &[bool], out: &mut [u16]) {
    out.fill(NO_SUM);
    for (x, window) in (REACH..).zip(row.windows(WINDOW)) {
        if marked[x] {
            out[x] = window.iter().map(|&pixel| u16::from(pixel)).sum();
        }
    }
}

/// What a window of the right image may match.
#[derive(Clone, Copy)]
pub struct TableSearch<'a> {
    pub table: &'a WindowTable,
    /// Disparities, both ends included; cost is SSD · (25 + 4·|d|) and fits 32 bits.
    pub min_disparity: i32,
    pub max_disparity: i32,
    /// Farthest that the sums of two windows may be apart.
    pub sum_tolerance: u32,
}

/// The left window that a right window takes for its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Claim {
    /// The match's SSD, `u32::MAX` where there is none.
    pub ssd: u32,
    pub disparity: i16,
    /// Row of the right window less that of the left one.
    pub row_offset: i8,
}

impl Claim {
    pub const NONE: Self = Self { ssd: u32::MAX, disparity: 0, row_offset: 0 };

    /// What the claim costs, more than any real one where there is none.
    pub fn cost(self) -> u32 {
        if self.ssd == u32::MAX { u32::MAX } else { self.ssd * weight(self.disparity.into()) }
    }
}

/// See [`super::claim_row`].
#[inline(always)]
pub(super) fn claim_row(search: &TableSearch<'_>, row: &[u8], out: &mut [Claim]) {
    out.fill(Claim::NONE);
    let end = row.len().saturating_sub(REACH);
    for (u, claim) in out.iter_mut().enumerate().take(end).skip(REACH) {
        let window = Window::around(row, u);
        let mut best = [Candidate::NONE; CHUNK];
        let near = search.table.near(window.sum, search.sum_tolerance.min(FIRST));
        window.compare(search, near.clone(), &mut best);
        let tolerance = search.sum_tolerance.min(least(&best).farthest_sum());
        if tolerance > FIRST {
            let rest = search.table.near(window.sum, tolerance);
            window.compare(search, rest.start..near.start, &mut best);
            window.compare(search, near.end..rest.end, &mut best);
        }
        *claim = least(&best).claim(search.min_disparity);
    }
}

/// A cost, the rank of its row (0, above 1, below 2, two above 3, ...) and its disparity, counted from the least, in one
/// word: the least word is the best match.
#[derive(Clone, Copy, PartialEq)]
struct Candidate(u64);

impl Candidate {
    const NONE: Self = Self(u64::MAX);

    #[inline(always)]
    fn new(cost: u32, rank_and_index: u32) -> Self {
        Self(u64::from(cost) << 32 | u64::from(rank_and_index))
    }

    /// Windows whose sums are farther apart cost more: nine differences that sum to s have squares of at least s² / 9,
    /// and no weight is below 25.
    #[inline(always)]
    fn farthest_sum(self) -> u32 {
        ((self.0 >> 32) as f32 * (9.0 / 25.0)).sqrt() as u32 + 2
    }

    #[inline(always)]
    fn claim(self, min_disparity: i32) -> Claim {
        let (cost, rank, index) = ((self.0 >> 32) as u32, (self.0 >> 16) as u16, self.0 as u16);
        if cost == u32::MAX {
            return Claim::NONE;
        }
        let disparity = min_disparity + i32::from(index);
        let distance = rank.div_ceil(2) as i8;
        let row_offset = if rank % 2 == 1 { distance } else { -distance };
        Claim { ssd: cost / weight(disparity), disparity: disparity as i16, row_offset }
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

#[inline(always)]
fn weight(disparity: i32) -> u32 {
    25 + 4 * disparity.unsigned_abs()
}

/// A window of the right image.
struct Window {
    u: usize,
    pixels: [u16; WINDOW],
    sum: u32,
}

impl Window {
    #[inline(always)]
    fn around(row: &[u8], u: usize) -> Self {
        let mut window = Self { u, pixels: [0; WINDOW], sum: 0 };
        for i in 0..WINDOW {
            window.pixels[i] = u16::from(row[u - REACH + i]);
            window.sum += u32::from(row[u - REACH + i]);
        }
        window
    }

    /// Keeps in `best` the better of what it holds and the matches at those `places`.
    #[inline(always)]
    fn compare(&self, search: &TableSearch<'_>, places: std::ops::Range<usize>, best: &mut [Candidate; CHUNK]) {
        let table = search.table;
        let first = self.u as i32 + search.min_disparity;
        let count = (search.max_disparity - search.min_disparity) as u32;
        for start in places.clone().step_by(CHUNK) {
            let windows = chunk(&table.windows, start);
            let pixels: [&[u16; CHUNK]; WINDOW] = table.pixels.each_ref().map(|pixels| chunk(pixels, start));
            let len = (places.end - start) as u32;
            let mut ssds = [0; CHUNK];
            for l in 0..CHUNK {
                for (left, &right) in pixels.iter().zip(&self.pixels) {
                    // Right modulo 65536 whatever the difference's sign.
                    let difference = left[l].wrapping_sub(right);
                    ssds[l] += u32::from(difference.wrapping_mul(difference));
                }
            }
            let mut costs = [0; CHUNK];
            let mut ranks_and_indices = [0; CHUNK];
            for l in 0..CHUNK {
                let index = ((windows[l] & 0xffff) as i32 - first) as u32;
                let cost = ssds[l].wrapping_mul(weight(search.min_disparity.wrapping_add(index as i32)));
                costs[l] = if (index <= count) & ((l as u32) < len) { cost } else { u32::MAX };
                ranks_and_indices[l] = windows[l] & !0xffff | index & 0xffff;
            }
            for l in 0..CHUNK {
                best[l].0 = best[l].0.min(Candidate::new(costs[l], ranks_and_indices[l]).0);
            }
        }
    }
}

#[inline(always)]
fn chunk<T>(places: &[T], start: usize) -> &[T; CHUNK] {
    // Places end a chunk behind the last window's.
    places[start..].first_chunk().expect("room for a chunk")
}
