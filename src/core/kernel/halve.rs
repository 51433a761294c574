//! Half size: a binomial low-pass of four pixels in each direction, every second pixel kept.

/// See [`super::halve_row`].
#[inline(always)]
pub(super) fn halve(rows: [&[u8]; 4], smooth: &mut [u16], out: &mut [u16]) {
    let width = rows[0].len();
    let inner = &mut smooth[1..=width];
    let [above, first, second, below] = rows.map(|row| &row[..width]);
    for (x, smooth) in inner.iter_mut().enumerate() {
        let at = |row: &[u8]| u16::from(row[x]);
        *smooth = at(above) + 3 * (at(first) + at(second)) + at(below);
    }
    smooth[0] = smooth[1];
    smooth[width + 1] = smooth[width];
    // Index `2x` holds the pixel before `2x`.
    for (x, out) in out.iter_mut().enumerate() {
        let [before, first, second, after] = *smooth[2 * x..].first_chunk().expect("four pixels");
        *out = (before + 3 * (first + second) + after + 8) >> 4;
    }
}
