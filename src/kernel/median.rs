//! Medians over three by three.

/// See [`super::median_row`].
#[inline(always)]
pub(super) fn row(rows: [&[i16]; 3], out: &mut [i16]) {
    let last = out.len() - 1;
    let [above, row, below] = rows.map(|row| &row[..=last]);
    // The median of nine is that of the largest of the columns' least, the median of their medians and the least of
    // their largest.
    let sorted = |x: usize| {
        let (a, b, c) = (above[x], row[x], below[x]);
        let (low, high) = (a.min(b), a.max(b));
        [low.min(c), low.max(high.min(c)), high.max(c)]
    };
    let median = |columns: [usize; 3]| {
        let [a, b, c] = columns.map(sorted);
        let low = a[0].max(b[0]).max(c[0]);
        let middle = middle(a[1], b[1], c[1]);
        let high = a[2].min(b[2]).min(c[2]);
        self::middle(low, middle, high)
    };
    if last >= 2 {
        for (x, out) in out[1..last].iter_mut().enumerate() {
            *out = median([x, x + 1, x + 2]);
        }
    }
    out[0] = median([0, 0, 1.min(last)]);
    out[last] = median([last.saturating_sub(1), last, last]);
}

#[inline(always)]
fn middle(a: i16, b: i16, c: i16) -> i16 {
    a.min(b).max(a.max(b).min(c))
}
