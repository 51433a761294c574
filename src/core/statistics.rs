//! Medians and quantiles. On few values the conventions differ, so each function's name states its
//! own.

/// The value of the nearest rank, `sorted[⌈n·share⌉ − 1]`: the smallest of the ascending values
/// that is not less than the fraction `share` of them. `None` without values.
pub fn nearest_rank<T: Copy>(sorted: &[T], share: f64) -> Option<T> {
    let rank = (share * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.max(1) - 1).or(sorted.last()).copied()
}

/// `sorted[⌊n·share⌋]`, the value above the nearest rank if `n·share` is whole. `None` without
/// values.
pub fn upper_rank<T: Copy>(sorted: &[T], share: f64) -> Option<T> {
    let index = (share * sorted.len() as f64) as usize;
    sorted.get(index).or(sorted.last()).copied()
}

/// The median by nearest rank: the lower of the two middle values for an even number. `None`
/// without values.
pub fn lower_median(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<_> = values.into_iter().collect();
    let index = values.len().checked_sub(1)? / 2;
    Some(*values.select_nth_unstable_by(index, f64::total_cmp).1)
}

/// The median; the upper of the two middle values for an even number. `None` without values.
pub fn upper_median(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<_> = values.into_iter().collect();
    let index = values.len() / 2;
    (index < values.len()).then(|| *values.select_nth_unstable_by(index, f64::total_cmp).1)
}

/// The median; the mean of the two middle values for an even number. `None` without values.
pub fn midpoint_median(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let values: Vec<_> = values.into_iter().collect();
    Some(0.5 * (lower_median(values.iter().copied())? + upper_median(values)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn conventions_differ_where_the_rank_is_whole() {
        let sorted = [1.0, 2.0, 3.0, 4.0];
        let shares = [0.0, 0.5, 0.51, 1.0];
        assert_eq!(
            shares.map(|p| nearest_rank(&sorted, p)),
            [1.0, 2.0, 3.0, 4.0].map(Some)
        );
        assert_eq!(
            shares.map(|p| upper_rank(&sorted, p)),
            [1.0, 3.0, 3.0, 4.0].map(Some)
        );
        let medians = |values: &[f64]| {
            let values = || values.iter().copied();
            [
                lower_median(values()),
                midpoint_median(values()),
                upper_median(values()),
            ]
        };
        assert_eq!(medians(&[4.0, 1.0, 3.0, 2.0]), [2.0, 2.5, 3.0].map(Some));
        assert_eq!(medians(&[9.0, 1.0, 3.0]), [Some(3.0); 3]);
        assert_eq!(medians(&[]), [None; 3]);
        assert_eq!(
            (nearest_rank::<u8>(&[], 0.5), upper_rank::<u8>(&[], 0.5)),
            (None, None)
        );
    }
}
