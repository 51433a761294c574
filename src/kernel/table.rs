//! Windows found by the sum of their pixels (thesis, section 5.3.4).

use super::slide::REACH;

/// Pixels of a window.
const WINDOW: usize = 2 * REACH + 1;
/// Windows compared at a time.
const CHUNK: usize = 32;
/// Sums a window can have.
const SUMS: usize = WINDOW * 255 + 1;

/// A hash table of the windows of a row; the hash of a window is the sum of its nine pixels.
///
/// Buckets lie one after the other, so that those of neighbouring sums are one range of places. A place's pixels stand
/// in nine planes, so that windows at neighbouring places are compared at a time.
#[derive(Clone, Debug)]
pub struct WindowTable {
    /// The place where the bucket of each sum begins, and where the last one ends.
    starts: Vec<u16>,
    /// Column per place, with room for a chunk behind the last, as the pixels have.
    columns: Vec<u16>,
    pixels: [Vec<u8>; WINDOW],
}

impl WindowTable {
    /// For rows of `width` pixels, at most [`crate::stereo::MAX_SIDE`].
    pub fn new(width: usize) -> Self {
        let places = width + CHUNK;
        Self { starts: vec![0; SUMS + 1], columns: vec![0; places], pixels: std::array::from_fn(|_| vec![0; places]) }
    }

    /// Takes the windows of `row` around the pixels that `marked` names and no others.
    pub fn fill(&mut self, row: &[u8], marked: &[bool]) {
        self.starts.fill(0);
        let windows = || {
            let marked = &marked[REACH.min(marked.len())..];
            (REACH..).zip(row.windows(WINDOW).zip(marked)).filter_map(|(x, (window, &marked))| {
                let sum = window.iter().map(|&pixel| usize::from(pixel)).sum::<usize>();
                marked.then_some((x, window, sum))
            })
        };
        windows().for_each(|(.., sum)| self.starts[sum] += 1);
        let mut end = 0;
        for start in &mut self.starts {
            end += *start;
            *start = end;
        }
        // From here on starts are ends, and each window moves its bucket's back by one.
        for (x, window, sum) in windows() {
            self.starts[sum] -= 1;
            let place = usize::from(self.starts[sum]);
            self.columns[place] = x as u16;
            self.pixels.iter_mut().zip(window).for_each(|(pixels, &pixel)| pixels[place] = pixel);
        }
    }

    /// The places of the windows whose sum is within `tolerance` of `sum`.
    #[inline(always)]
    fn near(&self, sum: u32, tolerance: u32) -> std::ops::Range<usize> {
        let first = sum.saturating_sub(tolerance) as usize;
        let end = ((sum + tolerance) as usize + 1).min(SUMS);
        usize::from(self.starts[first])..usize::from(self.starts[end])
    }
}

/// What a window of the right image may match.
#[derive(Clone, Copy)]
pub struct TableSearch<'a> {
    /// The left image's windows, a table per row.
    pub tables: &'a [WindowTable],
    /// Disparities, both ends included; cost is SSD · (25 + 4·|d|) and fits 32 bits.
    pub min_disparity: i32,
    pub max_disparity: i32,
    /// Farthest that the sums of two windows may be apart.
    pub sum_tolerance: u32,
    /// Farthest that their rows may be apart.
    pub row_tolerance: usize,
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
        if self.ssd == u32::MAX { u32::MAX } else { self.ssd * (25 + 4 * self.disparity.unsigned_abs() as u32) }
    }
}

/// See [`super::claim_row`].
#[inline(always)]
pub(super) fn claim_row(search: &TableSearch<'_>, row: &[u8], y: usize, out: &mut [Claim]) {
    out.fill(Claim::NONE);
    for u in REACH..row.len().saturating_sub(REACH) {
        let mut window = [0; WINDOW];
        let mut sum = 0;
        for i in 0..WINDOW {
            window[i] = u16::from(row[u - REACH + i]);
            sum += u32::from(window[i]);
        }
        let mut best = [Candidate::NONE; CHUNK];
        compare(search, &window, u, search.tables.get(y), sum, search.sum_tolerance, 0, &mut best);
        let tolerance = search.sum_tolerance.min(least(&best).farthest_sum());
        for distance in 1..=search.row_tolerance {
            let [above, below] = [y.wrapping_sub(distance), y + distance].map(|row| search.tables.get(row));
            let rank = 2 * distance as u32 - 1;
            compare(search, &window, u, above, sum, tolerance, rank, &mut best);
            compare(search, &window, u, below, sum, tolerance, rank + 1, &mut best);
        }
        out[u] = least(&best).claim(search.min_disparity);
    }
}

/// A cost, the rank of its row (0, above 1, below 2, two above 3, ...) and its disparity, counted from the least, in one
/// word: the least word is the best match.
#[derive(Clone, Copy, PartialEq)]
struct Candidate(u64);

impl Candidate {
    const NONE: Self = Self(u64::MAX);

    #[inline(always)]
    fn new(cost: u32, rank: u32, index: u32) -> Self {
        Self(u64::from(cost) << 32 | u64::from(rank << 16 | index))
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

/// Keeps in `best` the better of it and the matches of `window`, around `u` in the right image and of that `sum`, in the
/// left row of that `table` and `rank`.
#[inline(always)]
fn compare(
    search: &TableSearch<'_>,
    window: &[u16; WINDOW],
    u: usize,
    table: Option<&WindowTable>,
    sum: u32,
    tolerance: u32,
    rank: u32,
    best: &mut [Candidate; CHUNK],
) {
    let Some(table) = table else { return };
    let places = table.near(sum, tolerance);
    let first = u as i32 + search.min_disparity;
    let count = (search.max_disparity - search.min_disparity) as u32;
    for start in places.clone().step_by(CHUNK) {
        let columns = chunk(&table.columns, start);
        let pixels: [&[u8; CHUNK]; WINDOW] = table.pixels.each_ref().map(|pixels| chunk(pixels, start));
        let len = (places.end - start) as u32;
        let mut ssds = [0; CHUNK];
        for l in 0..CHUNK {
            for i in 0..WINDOW {
                // Right modulo 65536 whatever the difference's sign.
                let difference = u16::from(pixels[i][l]).wrapping_sub(window[i]);
                ssds[l] += u32::from(difference.wrapping_mul(difference));
            }
        }
        let mut costs = [0; CHUNK];
        let mut indices = [0; CHUNK];
        for l in 0..CHUNK {
            indices[l] = (i32::from(columns[l]) - first) as u32;
            let cost = ssds[l].wrapping_mul(weight(search.min_disparity.wrapping_add(indices[l] as i32)));
            costs[l] = if (indices[l] <= count) & ((l as u32) < len) { cost } else { u32::MAX };
        }
        for l in 0..CHUNK {
            best[l].0 = best[l].0.min(Candidate::new(costs[l], rank, indices[l]).0);
        }
    }
}

#[inline(always)]
fn chunk<T>(places: &[T], start: usize) -> &[T; CHUNK] {
    // Places end a chunk behind the last window's.
    places[start..].first_chunk().expect("room for a chunk")
}
