//! Filters of grey rows: vertical smoothing, prefilters of block matching, the median of three by
//! three, bilinear resampling.

use crate::stereo::Gray;

/// Pixels smoothed together.
const SMOOTHED: usize = 64;

/// See [`super::smooth_row`].
#[inline(always)]
pub(super) fn smooth(image: &Gray, y: usize, weights: &[u32], out: &mut [u8]) {
    let last = image.height() - 1;
    for (block, out) in out.chunks_mut(SMOOTHED).enumerate() {
        let start = block * SMOOTHED;
        // Blocks of one size, so that the compiler knows how many vectors they are.
        let pixels = |y: usize| -> [u8; SMOOTHED] {
            let row = &image.row(y)[start..];
            row.first_chunk().copied().unwrap_or_else(|| {
                let mut pixels = [0; SMOOTHED];
                pixels[..row.len()].copy_from_slice(row);
                pixels
            })
        };
        // Half of the divisor: the shift below then rounds to nearest.
        let mut sums = [1 << 15; SMOOTHED];
        let centre = pixels(y);
        for i in 0..SMOOTHED {
            sums[i] += weights[0] * u32::from(centre[i]);
        }
        for (k, &weight) in weights.iter().enumerate().skip(1) {
            let (above, below) = (pixels(y.saturating_sub(k)), pixels((y + k).min(last)));
            for i in 0..SMOOTHED {
                sums[i] += weight * (u32::from(above[i]) + u32::from(below[i]));
            }
        }
        let smoothed = sums.map(|sum| (sum >> 16) as u8);
        out.copy_from_slice(&smoothed[..out.len()]);
    }
}

/// Largest response either way; responses are stored with it added, 0 ..= 62.
pub const PREFILTER_CAP: i16 = 31;

/// See [`super::sobel_row`].
#[inline(always)]
pub(super) fn sobel([above, row, below]: [&[u8]; 3], out: &mut [u8]) {
    let width = out.len();
    out.fill(PREFILTER_CAP as u8);
    if width < 3 {
        return;
    }
    let step = |row: &[u8], i: usize| i16::from(row[i + 2]) - i16::from(row[i]);
    let (above, row, below) = (&above[..width], &row[..width], &below[..width]);
    for (i, out) in out[1..width - 1].iter_mut().enumerate() {
        *out = capped(step(above, i) + 2 * step(row, i) + step(below, i));
    }
}

/// See [`super::log_row`].
#[inline(always)]
pub(super) fn log([above2, above, row, below, below2]: [&[u8]; 5], out: &mut [u8]) {
    let width = out.len();
    out.fill(PREFILTER_CAP as u8);
    if width < 5 {
        return;
    }
    let at = |row: &[u8], i: usize| i16::from(row[i]);
    let [above2, above, row, below, below2] =
        [above2, above, row, below, below2].map(|row| &row[..width]);
    for (i, out) in out[2..width - 2].iter_mut().enumerate() {
        let sides = |row: &[u8]| at(row, i + 1) + 2 * at(row, i + 2) + at(row, i + 3);
        let ends = at(row, i) + at(row, i + 4) + at(above2, i + 2) + at(below2, i + 2);
        let middle = 2 * (at(row, i + 1) + at(row, i + 3)) - 16 * at(row, i + 2);
        *out = capped(-((ends + middle + sides(above) + sides(below)) >> 1));
    }
}

#[inline(always)]
fn capped(response: i16) -> u8 {
    (response.clamp(-PREFILTER_CAP, PREFILTER_CAP) + PREFILTER_CAP) as u8
}

/// See [`super::median_row`].
#[inline(always)]
pub(super) fn median([above, row, below]: [&[i16]; 3], out: &mut [i16]) {
    let last = out.len() - 1;
    let rows = (&above[..=last], &row[..=last], &below[..=last]);
    if last >= 2 {
        for (x, out) in out[1..last].iter_mut().enumerate() {
            *out = median_of_nine(sorted(rows, x), sorted(rows, x + 1), sorted(rows, x + 2));
        }
    }
    let (first, end) = (sorted(rows, 0), sorted(rows, last));
    out[0] = median_of_nine(first, first, sorted(rows, 1.min(last)));
    out[last] = median_of_nine(sorted(rows, last.saturating_sub(1)), end, end);
}

/// A column's three, least first.
#[inline(always)]
fn sorted((above, row, below): (&[i16], &[i16], &[i16]), x: usize) -> (i16, i16, i16) {
    let (a, b, c) = (above[x], row[x], below[x]);
    let (low, high) = (a.min(b), a.max(b));
    (low.min(c), low.max(high.min(c)), high.max(c))
}

/// Median of three sorted columns: the middle one of the largest minimum, the median of the medians
/// and the smallest maximum.
#[inline(always)]
fn median_of_nine(a: (i16, i16, i16), b: (i16, i16, i16), c: (i16, i16, i16)) -> i16 {
    middle(
        a.0.max(b.0).max(c.0),
        middle(a.1, b.1, c.1),
        a.2.min(b.2).min(c.2),
    )
}

#[inline(always)]
fn middle(a: i16, b: i16, c: i16) -> i16 {
    a.min(b).max(a.max(b).min(c))
}

/// Pixels whose sources are fetched before any is weighted: enough that the bytes stored are
/// available when they are loaded as vectors.
const FETCHED: usize = 1024;

/// See [`super::remap_row`].
#[inline(always)]
pub(super) fn remap(
    source: &[u8],
    stride: usize,
    places: &[u32],
    parts: [&[u8]; 2],
    out: &mut [u8],
) {
    let [right, below] = parts.map(|parts| parts.chunks(FETCHED));
    for (((places, right), below), out) in places
        .chunks(FETCHED)
        .zip(right)
        .zip(below)
        .zip(out.chunks_mut(FETCHED))
    {
        // Two neighbours in one load.
        let (mut upper, mut lower) = ([0u16; FETCHED], [0u16; FETCHED]);
        let two = |at: usize| u16::from_le_bytes([source[at], source[at + 1]]);
        for ((&place, upper), lower) in places.iter().zip(&mut upper).zip(&mut lower) {
            let at = place as usize;
            (*upper, *lower) = (two(at), two(at + stride));
        }
        let along = |two: u16, right: u8| {
            (two & 255) * (256 - u16::from(right)) + (two >> 8) * u16::from(right)
        };
        for (i, (out, (&right, &below))) in out.iter_mut().zip(right.iter().zip(below)).enumerate()
        {
            let (above, beneath) = (
                u32::from(along(upper[i], right)),
                u32::from(along(lower[i], right)),
            );
            let sum = above * (256 - u32::from(below)) + beneath * u32::from(below);
            *out = ((sum + (1 << 15)) >> 16) as u8;
        }
    }
}
