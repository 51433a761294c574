//! Medians over three by three.

/// See [`super::median_row`].
#[inline(always)]
pub(super) fn row([above, row, below]: [&[i16]; 3], out: &mut [i16]) {
    let last = out.len() - 1;
    let rows = (&above[..=last], &row[..=last], &below[..=last]);
    if last >= 2 {
        for (x, out) in out[1..last].iter_mut().enumerate() {
            *out = median(sorted(rows, x), sorted(rows, x + 1), sorted(rows, x + 2));
        }
    }
    let (first, end) = (sorted(rows, 0), sorted(rows, last));
    out[0] = median(first, first, sorted(rows, 1.min(last)));
    out[last] = median(sorted(rows, last.saturating_sub(1)), end, end);
}

/// A column's three, least first.
#[inline(always)]
fn sorted((above, row, below): (&[i16], &[i16], &[i16]), x: usize) -> (i16, i16, i16) {
    let (a, b, c) = (above[x], row[x], below[x]);
    let (low, high) = (a.min(b), a.max(b));
    (low.min(c), low.max(high.min(c)), high.max(c))
}

/// Of three sorted columns: the middle one of the largest least, the middle of the middle and the
/// least largest.
#[inline(always)]
fn median(a: (i16, i16, i16), b: (i16, i16, i16), c: (i16, i16, i16)) -> i16 {
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
