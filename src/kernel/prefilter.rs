//! Prefilters of grey rows: edges instead of grey levels, capped, so that cameras may differ in
//! brightness.

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
