//! Gaps between seen disparities, filled like occluded surfaces: they belong to the farther one.

/// Fills the gaps of a row between the `bins` of pixels that are `seen`, 0 or 1: by the mean of
/// both ends; by the smaller of two that differ by more than `jump`; at the row's ends by the only
/// one. A row without any seen pixel is left unchanged.
pub fn fill_row(bins: &[i16], seen: &[u8], jump: i32, filled: &mut [i16]) {
    let mut before: Option<(usize, i16)> = None;
    for (x, (&bin, _)) in bins
        .iter()
        .zip(seen)
        .enumerate()
        .filter(|(_, (_, seen))| **seen == 1)
    {
        let (from, value) = match before {
            None => (0, bin),
            Some((at, left)) if i32::from(left.abs_diff(bin)) > jump => (at + 1, left.min(bin)),
            Some((at, left)) => (at + 1, left.midpoint(bin)),
        };
        filled[from..x].fill(value);
        filled[x] = bin;
        before = Some((x, bin));
    }
    if let Some((at, bin)) = before {
        filled[at + 1..].fill(bin);
    }
}

/// Copies to each row of `filled` without any seen pixel the nearest row that has some; if two are
/// equally near, the upper one. Returns true if there is such a row.
pub fn fill_empty_rows(seen: &[u8], width: usize, filled: &mut [i16]) -> bool {
    let height = seen.len() / width;
    let has_any = |y: usize| seen[y * width..][..width].contains(&1);
    let mut above = None;
    for y in 0..height {
        if has_any(y) {
            above = Some(y);
            continue;
        }
        let below = (y + 1..height).find(|&other| has_any(other));
        let nearest = match (above, below) {
            (Some(above), Some(below)) if below - y < y - above => below,
            (Some(row), _) | (None, Some(row)) => row,
            (None, None) => return false,
        };
        filled.copy_within(nearest * width..(nearest + 1) * width, y * width);
    }
    true
}
