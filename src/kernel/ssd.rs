//! Sums of squared differences between windows of one row and windows of another, over a range of offsets.
//!
//! `Σ (p − q)² = Σ p² + Σ q² − 2 Σ p·q`: the first two sums, the windows' energies, are computed once per row; the
//! third slides along a run of windows, one product coming in and one going out (thesis, section 5.3.3,
//! "Optimization", and figure 5.10). Lanes run over the offsets, so a window that nobody asks for costs nothing.

/// Half of the window: it covers x − 4 ..= x + 4.
const REACH: usize = 4;
const WINDOW: usize = 2 * REACH + 1;
const LANES: usize = 16;
/// Added to the SSD of an inadmissible offset; it makes it negative, which no real one is, even when added twice.
const POISON: i32 = i32::MIN / 4;

/// The best offset of a window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Winner {
    pub offset: i32,
    pub ssd: u32,
}

/// Compares windows of a probe row with those of another row of the same width, `first ..= last` pixels to the right.
pub struct Search {
    first: i32,
    /// Zeros before the first pixel of `other`.
    pad: usize,
    /// −2 times the probe's pixels.
    probe: Vec<i32>,
    /// Energy of the window around each pixel.
    probe_energy: Vec<i32>,
    other: Vec<i32>,
    /// As `probe_energy`; [`POISON`] where no window fits.
    other_energy: Vec<i32>,
    /// −2 Σ p·q per offset, for the window last visited.
    products: Vec<i32>,
    /// What `products` begins with: zero, or [`POISON`] for offsets not asked for.
    start: Vec<i32>,
    table: Vec<u32>,
}

impl Search {
    /// The least SSD of a window without any admissible offset.
    pub const NONE: u32 = u32::MAX;

    /// The largest SSD there is.
    pub const MAX_SSD: u32 = WINDOW as u32 * 255 * 255;

    /// For rows of `width` pixels and offsets `first ..= last`, without offset 0 unless `zero`.
    ///
    /// Offsets at which no window can lie in both rows are left out, so memory is proportional to `width`.
    pub fn new(width: usize, first: i32, last: i32, zero: bool) -> Self {
        // A row has at most MAX_SIDE pixels, far below i32's range.
        let farthest = width.saturating_sub(WINDOW) as i32;
        let (first, last) = (first.clamp(-farthest, farthest + 1), last.clamp(-farthest - 1, farthest));
        let offsets = usize::try_from(last - first + 1).unwrap_or(0);
        let padded = offsets.next_multiple_of(LANES);
        let pad = first.min(0).unsigned_abs() as usize + REACH + 1;
        let length = pad + width + first.max(0) as usize + padded + REACH;
        let asked = |j: usize| j < offsets && (zero || j as i32 + first != 0);
        Self {
            first,
            pad,
            probe: vec![0; width],
            probe_energy: vec![0; width],
            other: vec![0; length],
            other_energy: vec![POISON; length],
            products: vec![0; padded],
            table: vec![0; padded],
            start: (0..padded).map(|j| if asked(j) { 0 } else { POISON }).collect(),
        }
    }

    /// The offsets from the first one on, rounded up to whole lanes: as many as there must be weights.
    pub fn offsets(&self) -> impl Iterator<Item = i32> {
        self.first..self.first + self.products.len() as i32
    }

    #[inline(always)]
    fn load(&mut self, probe: &[u8], other: &[u8]) {
        let width = probe.len();
        let inside = REACH..width - REACH;
        self.probe.iter_mut().zip(probe).for_each(|(p, &pixel)| *p = -2 * i32::from(pixel));
        energies(probe, &mut self.probe_energy[inside.clone()]);
        self.other[self.pad..].iter_mut().zip(other).for_each(|(q, &pixel)| *q = i32::from(pixel));
        energies(other, &mut self.other_energy[self.pad..][inside]);
    }

    /// Puts −2 Σ p·q of the window at `x` into `products` and hands `with` the slices to finish an SSD per offset.
    #[inline(always)]
    fn visit(&mut self, x: usize, fresh: bool) -> (&[i32], &[i32], i32) {
        let Self { products, probe, other, .. } = self;
        let n = products.len();
        // `pad` is larger than −first by more than the window's reach.
        let at = (self.pad as i32 + self.first) as usize + x;
        if fresh {
            fill(products, &self.start, &probe[x - REACH..], &other[at - REACH..]);
        } else {
            let (new, old) = (probe[x + REACH], probe[x - REACH - 1]);
            slide(products, new, &other[at + REACH..], old, &other[at - REACH - 1..]);
        }
        (&self.products, &self.other_energy[at..at + n], self.probe_energy[x])
    }
}

#[inline(always)]
fn fill(products: &mut [i32], start: &[i32], probe: &[i32], other: &[i32]) {
    let n = products.len();
    let (start, other) = (&start[..n], &other[..n + WINDOW - 1]);
    let probe: &[i32; WINDOW] = probe.first_chunk().expect("a whole window");
    for j in 0..n {
        let mut sum = start[j];
        for i in 0..WINDOW {
            sum += probe[i] * other[j + i];
        }
        products[j] = sum;
    }
}

#[inline(always)]
fn slide(products: &mut [i32], new: i32, other_new: &[i32], old: i32, other_old: &[i32]) {
    for (sum, (q_new, q_old)) in products.iter_mut().zip(other_new.iter().zip(other_old)) {
        *sum += new * q_new - old * q_old;
    }
}

#[inline(always)]
fn costs(products: &[i32], energy: &[i32], probe_energy: i32, weights: &[u32], costs: &mut [u32]) -> u32 {
    let n = costs.len();
    let (products, energy, weights) = (&products[..n], &energy[..n], &weights[..n]);
    let mut least = u32::MAX;
    for j in 0..n {
        let ssd = products[j] + energy[j] + probe_energy;
        let inadmissible = (ssd >> 31) as u32;
        costs[j] = (ssd as u32).wrapping_mul(weights[j]) | inadmissible;
        least = least.min(costs[j]);
    }
    least
}

/// See [`super::winners`].
#[inline(always)]
pub(super) fn winners(
    search: &mut Search,
    probe: &[u8],
    other: &[u8],
    weights: &[u32],
    windows: &[u32],
    out: &mut Vec<Winner>,
) {
    out.clear();
    if windows.is_empty() {
        return;
    }
    search.load(probe, other);
    let first = search.first;
    let mut table = std::mem::take(&mut search.table);
    let mut next = None;
    for &x in windows {
        let fresh = next != Some(x);
        next = Some(x + 1);
        let x = x as usize;
        let (products, energy, probe_energy) = search.visit(x, fresh);
        let cost = costs(products, energy, probe_energy, weights, &mut table);
        let mut index = 0;
        for j in 0..table.len() {
            index = if table[j] == cost { j as u32 } else { index };
        }
        out.push(Winner { offset: first + index as i32, ssd: cost / weights[index as usize] });
    }
    search.table = table;
}

/// See [`super::least_ssd`].
#[inline(always)]
pub(super) fn least(search: &mut Search, probe: &[u8], other: &[u8], windows: &[u32], out: &mut Vec<u32>) {
    out.clear();
    if windows.is_empty() {
        return;
    }
    search.load(probe, other);
    let mut next = None;
    for &x in windows {
        let fresh = next != Some(x);
        next = Some(x + 1);
        let x = x as usize;
        let (products, energy, probe_energy) = search.visit(x, fresh);
        let mut least = u32::MAX;
        for (sum, energy) in products.iter().zip(energy) {
            least = least.min((sum + energy + probe_energy) as u32);
        }
        out.push(if least <= Search::MAX_SSD { least } else { Search::NONE });
    }
}

/// `out[x]` = Σ of the squares of `row[x ..= x + 8]`.
#[inline(always)]
fn energies(row: &[u8], out: &mut [i32]) {
    for (x, out) in out.iter_mut().enumerate() {
        *out = (0..WINDOW).map(|i| i32::from(row[x + i])).map(|p| p * p).sum();
    }
}
