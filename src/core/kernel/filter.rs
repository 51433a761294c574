//! Filters of grey rows: vertical smoothing, prefilters of block matching, the median of three by
//! three, bilinear resampling.

use super::pairs::{Group, Pairs};
use crate::stereo::Gray;

/// Pixels smoothed together.
const SMOOTHED: usize = 64;

/// See [`super::smooth_row`].
#[inline(always)]
pub(super) fn smooth(pairs: impl Pairs, image: &Gray, y: usize, weights: &[u32], out: &mut [u8]) {
    // The first weight has up to 17 bits, the others have 15.
    let split = [(weights[0] >> 2) as i16, (weights[0] & 3) as i16];
    for (block, out) in out.chunks_mut(SMOOTHED).enumerate() {
        let x = block * SMOOTHED;
        // Half of the divisor: the shift below then rounds to nearest.
        let mut sums = [1 << 15; SMOOTHED];
        let mut planes = [[0; SMOOTHED]; 2];
        let centre = smoothed_pixels(image, y, x);
        for i in 0..SMOOTHED {
            planes[0][i] = i16::from(centre[i]) << 2;
            planes[1][i] = i16::from(centre[i]);
        }
        add_planes(&pairs, &mut sums, &planes, split);
        let (two, one) = weights[1..].as_chunks::<2>();
        for (i, &[near, far]) in two.iter().enumerate() {
            sum_rows(image, y, 2 * i + 1, x, &mut planes[0]);
            sum_rows(image, y, 2 * i + 2, x, &mut planes[1]);
            add_planes(&pairs, &mut sums, &planes, [near as i16, far as i16]);
        }
        if let &[last] = one {
            sum_rows(image, y, weights.len() - 1, x, &mut planes[0]);
            // The other plane has no weight.
            add_planes(&pairs, &mut sums, &planes, [last as i16, 0]);
        }
        let smoothed = sums.map(|sum| (sum >> 16) as u8);
        out.copy_from_slice(&smoothed[..out.len()]);
    }
}

/// Pixels of row `y` from `x` on, zero beyond its end. Their number is fixed, so that the compiler
/// knows how many vectors they are.
#[inline(always)]
fn smoothed_pixels(image: &Gray, y: usize, x: usize) -> [u8; SMOOTHED] {
    let row = &image.row(y)[x..];
    match row.first_chunk() {
        Some(row) => *row,
        None => {
            let mut pixels = [0; SMOOTHED];
            pixels[..row.len()].copy_from_slice(row);
            pixels
        }
    }
}

/// Sums of the pixels `distance` above and below row `y`, from `x` on.
#[inline(always)]
fn sum_rows(image: &Gray, y: usize, distance: usize, x: usize, out: &mut [i16; SMOOTHED]) {
    let above = smoothed_pixels(image, y.saturating_sub(distance), x);
    let below = smoothed_pixels(image, (y + distance).min(image.height() - 1), x);
    for i in 0..SMOOTHED {
        out[i] = i16::from(above[i]) + i16::from(below[i]);
    }
}

/// Adds two planes of numbers by their weights.
#[inline(always)]
fn add_planes(
    pairs: &impl Pairs,
    sums: &mut [u32; SMOOTHED],
    planes: &[[i16; SMOOTHED]; 2],
    weights: [i16; 2],
) {
    let [a, b] = planes.each_ref().map(|plane| plane.as_chunks().0);
    let sums = sums.as_chunks_mut().0;
    for (sums, (&a, &b)) in sums.iter_mut().zip(a.iter().zip(b)) {
        let planes = pairs.pair_up(&[a, b]);
        *sums = pairs.add_weighted(Group(*sums), planes, weights).0;
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
            let above = u32::from(along(upper[i], right));
            let beneath = u32::from(along(lower[i], right));
            let sum = above * (256 - u32::from(below)) + beneath * u32::from(below);
            *out = ((sum + (1 << 15)) >> 16) as u8;
        }
    }
}
