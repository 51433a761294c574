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

type Lanes<T> = [T; LANES];

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

    /// SSDs of the window at `x` at offsets `j ..` of the list; negative where the offset is inadmissible.
    ///
    /// Unless `FRESH`, the window visited before was the one at `x - 1`.
    #[inline(always)]
    fn ssds<const FRESH: bool>(&mut self, x: usize, j: usize) -> Lanes<i32> {
        // `pad` is larger than −first by more than the window's reach.
        let at = (self.pad as i32 + self.first) as usize + x + j;
        let energy = lanes(&self.other_energy, at);
        let products: &mut Lanes<i32> = (&mut self.products[j..j + LANES]).try_into().expect("LANES elements");
        let mut sum;
        if FRESH {
            sum = *lanes(&self.start, j);
            for i in 0..WINDOW {
                let (p, q) = (self.probe[x + i - REACH], lanes(&self.other, at + i - REACH));
                (0..LANES).for_each(|l| sum[l] += p * q[l]);
            }
        } else {
            sum = *products;
            let (new, old) = (self.probe[x + REACH], self.probe[x - REACH - 1]);
            let (q_new, q_old) = (lanes(&self.other, at + REACH), lanes(&self.other, at - REACH - 1));
            (0..LANES).for_each(|l| sum[l] += new * q_new[l] - old * q_old[l]);
        }
        *products = sum;
        std::array::from_fn(|l| sum[l] + energy[l] + self.probe_energy[x])
    }

    #[inline(always)]
    fn winner<const FRESH: bool>(&mut self, x: usize, weights: &[u32]) -> Winner {
        let mut best = [u32::MAX; LANES];
        let mut index = [0u32; LANES];
        for j in (0..self.products.len()).step_by(LANES) {
            let ssd = self.ssds::<FRESH>(x, j);
            let weight = lanes(weights, j);
            for l in 0..LANES {
                let inadmissible = (ssd[l] >> 31) as u32;
                let cost = (ssd[l] as u32).wrapping_mul(weight[l]) | inadmissible;
                index[l] = if cost <= best[l] { j as u32 } else { index[l] };
                best[l] = best[l].min(cost);
            }
        }
        let cost = best.iter().fold(u32::MAX, |least, &c| least.min(c));
        let j = (0..LANES).map(|l| if best[l] == cost { index[l] + l as u32 } else { 0 }).fold(0, u32::max);
        Winner { offset: self.first + j as i32, ssd: cost / weights[j as usize] }
    }

    #[inline(always)]
    fn least<const FRESH: bool>(&mut self, x: usize) -> u32 {
        let mut least = [u32::MAX; LANES];
        for j in (0..self.products.len()).step_by(LANES) {
            let ssd = self.ssds::<FRESH>(x, j);
            // A negative SSD is a huge one when read as unsigned.
            (0..LANES).for_each(|l| least[l] = least[l].min(ssd[l] as u32));
        }
        let least = least.iter().fold(u32::MAX, |least, &s| least.min(s));
        if least <= Self::MAX_SSD { least } else { Self::NONE }
    }
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
    let mut next = None;
    for &x in windows {
        let fresh = next != Some(x);
        next = Some(x + 1);
        let x = x as usize;
        out.push(if fresh { search.winner::<true>(x, weights) } else { search.winner::<false>(x, weights) });
    }
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
        out.push(if fresh { search.least::<true>(x) } else { search.least::<false>(x) });
    }
}

/// `out[x]` = Σ of the squares of `row[x ..= x + 8]`.
#[inline(always)]
fn energies(row: &[u8], out: &mut [i32]) {
    for (x, out) in out.iter_mut().enumerate() {
        *out = (0..WINDOW).map(|i| i32::from(row[x + i])).map(|p| p * p).sum();
    }
}

#[inline(always)]
fn lanes<T>(slice: &[T], at: usize) -> &Lanes<T> {
    slice[at..at + LANES].try_into().expect("LANES elements")
}
