//! Half size: a binomial low-pass of four pixels in each direction, every second pixel kept.

/// See [`super::halve_row`].
#[inline(always)]
pub(super) fn halve(rows: [&[u8]; 4], smooth: &mut [u16], out: &mut [u16]) {
    low_pass::<u8, 4>(rows, smooth, out);
}

/// See [`super::quarter_row`].
#[inline(always)]
pub(super) fn quarter(rows: [&[u16]; 4], smooth: &mut [u16], out: &mut [u16]) {
    low_pass::<u16, 6>(rows, smooth, out);
}

/// The low-pass, its sum shifted with rounding.
#[inline(always)]
fn low_pass<T: Copy + Into<u16>, const SHIFT: u32>(
    rows: [&[T]; 4],
    smooth: &mut [u16],
    out: &mut [u16],
) {
    let width = rows[0].len();
    let inner = &mut smooth[1..=width];
    let [above, first, second, below] = rows.map(|row| &row[..width]);
    for (x, smooth) in inner.iter_mut().enumerate() {
        let at = |row: &[T]| -> u16 { row[x].into() };
        *smooth = at(above) + 3 * (at(first) + at(second)) + at(below);
    }
    smooth[0] = smooth[1];
    smooth[width + 1] = smooth[width];
    // Index `2x` holds the pixel before `2x`.
    for (x, out) in out.iter_mut().enumerate() {
        let [before, first, second, after] = *smooth[2 * x..].first_chunk().expect("four pixels");
        *out = (before + 3 * (first + second) + after + (1 << (SHIFT - 1))) >> SHIFT;
    }
}
