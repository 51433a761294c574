//! Windows found by the sum of their pixels (thesis, section 5.3.4).

use super::slide::REACH;

/// Pixels of a window.
const WINDOW: usize = 2 * REACH + 1;
/// A window in a vector, with pixels behind it that do not count.
const PADDED: usize = 16;
/// Sums a window can have.
const SUMS: usize = WINDOW * 255 + 1;

/// A hash table of the windows of a row; the hash of a window is the sum of its nine pixels.
///
/// Buckets lie one after the other, so that those of neighbouring sums are one slice.
#[derive(Clone, Debug)]
pub struct WindowTable {
    /// Where the bucket of each sum begins in `columns`, and where the last one ends.
    starts: Vec<u16>,
    columns: Vec<u16>,
    /// The row, with room behind it for a vector.
    pixels: Vec<u8>,
}

impl WindowTable {
    /// For rows of `width` pixels, at most [`crate::stereo::MAX_SIDE`].
    pub fn new(width: usize) -> Self {
        Self { starts: vec![0; SUMS + 1], columns: vec![0; width], pixels: vec![0; width + PADDED] }
    }

    /// Takes the windows of `row` around the pixels that `marked` names and no others.
    pub fn fill(&mut self, row: &[u8], marked: &[bool]) {
        self.pixels[..row.len()].copy_from_slice(row);
        self.starts.fill(0);
        let windows = || row.windows(WINDOW).zip(&marked[REACH.min(marked.len())..]).enumerate();
        let sum = |window: &[u8]| window.iter().map(|&pixel| usize::from(pixel)).sum::<usize>();
        for (_, (window, _)) in windows().filter(|(_, (_, marked))| **marked) {
            self.starts[sum(window)] += 1;
        }
        let mut end = 0;
        for start in &mut self.starts {
            end += *start;
            *start = end;
        }
        // From here on starts are ends, and each window moves its bucket's back by one.
        for (i, (window, _)) in windows().filter(|(_, (_, marked))| **marked) {
            let start = &mut self.starts[sum(window)];
            *start -= 1;
            self.columns[usize::from(*start)] = (i + REACH) as u16;
        }
    }

    /// The columns of the windows whose sum is within `tolerance` of `sum`.
    #[inline(always)]
    fn near(&self, sum: u32, tolerance: u32) -> &[u16] {
        let first = sum.saturating_sub(tolerance) as usize;
        let end = ((sum + tolerance) as usize + 1).min(SUMS);
        &self.columns[usize::from(self.starts[first])..usize::from(self.starts[end])]
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
        let mut window = [0i16; PADDED];
        let mut sum = 0;
        for i in 0..WINDOW {
            let pixel = row[u - REACH + i];
            window[i] = i16::from(pixel);
            sum += u32::from(pixel);
        }
        let mut best = Candidate::NONE;
        for distance in 0..=search.row_tolerance {
            // The row above is the first of the two, so it wins at equal cost.
            let rows = [y.wrapping_sub(distance), y + distance];
            for &row in &rows[usize::from(distance == 0)..] {
                if let Some(table) = search.tables.get(row) {
                    let columns = table.near(sum, search.sum_tolerance.min(best.farthest_sum()));
                    let found = cheapest(search, columns, &table.pixels, u, &window);
                    if found.cost() < best.cost() {
                        best = found;
                        out[u].row_offset = (y as i32 - row as i32) as i8;
                    }
                }
            }
        }
        if best != Candidate::NONE {
            let disparity = search.min_disparity + best.index() as i32;
            out[u].disparity = disparity as i16;
            out[u].ssd = best.cost() / weight(disparity);
        }
    }
}

/// Cost and disparity, counted from the least, in one word: the least word is the least cost, then the least disparity.
#[derive(Clone, Copy, PartialEq)]
struct Candidate(u64);

impl Candidate {
    const NONE: Self = Self(u64::MAX);

    #[inline(always)]
    fn cost(self) -> u32 {
        (self.0 >> 32) as u32
    }

    #[inline(always)]
    fn index(self) -> u32 {
        self.0 as u32
    }

    /// Windows whose sums are farther apart cost more: nine differences that sum to s have squares of at least s² / 9,
    /// and the least weight is 25.
    #[inline(always)]
    fn farthest_sum(self) -> u32 {
        (self.cost() as f32 * (9.0 / 25.0)).sqrt() as u32 + 2
    }
}

#[inline(always)]
fn weight(disparity: i32) -> u32 {
    25 + 4 * disparity.unsigned_abs()
}

/// The cheapest match of `window`, around `u` in the right image, among the windows of a left row around `columns`.
#[inline(always)]
fn cheapest(search: &TableSearch<'_>, columns: &[u16], pixels: &[u8], u: usize, window: &[i16; PADDED]) -> Candidate {
    const CHUNK: usize = 64;
    let first = u as i32 + search.min_disparity;
    let count = (search.max_disparity - search.min_disparity) as u32;
    let mut best = Candidate::NONE.0;
    for columns in columns.chunks(CHUNK) {
        // Most are not in the range, unpredictably: set them aside without a branch.
        let mut inside = [0; CHUNK];
        let mut len = 0;
        for &x in columns {
            let index = (i32::from(x) - first) as u32;
            inside[len] = index;
            len += usize::from(index <= count);
        }
        for &index in &inside[..len] {
            let x = (first + index as i32) as usize;
            let cost = ssd(&pixels[x - REACH..], window) * weight(search.min_disparity + index as i32);
            best = best.min(u64::from(cost) << 32 | u64::from(index));
        }
    }
    Candidate(best)
}

/// The SSD of the window that `pixels` begins with.
#[inline(always)]
fn ssd(pixels: &[u8], window: &[i16; PADDED]) -> u32 {
    let pixels: &[u8; PADDED] = pixels[..PADDED].try_into().expect("as long");
    let mut sum = 0i32;
    for i in 0..PADDED {
        let difference = i16::from(pixels[i]) - window[i];
        let difference = if i < WINDOW { i32::from(difference) } else { 0 };
        sum += difference * difference;
    }
    sum as u32
}
