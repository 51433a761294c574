//! The times of one algorithm.

use crate::rows::held::RowRef;
use svl_core::statistics::nearest_rank;

/// The modified Z-score, (t − median) / (1.4826 · median absolute deviation), from which a time is
/// an outlier: that of the program hyperfine (Iglewicz and Hoaglin, How to Detect and Handle
/// Outliers, 1993, take 3.5 for normal ones).
pub(crate) const MIN_OUTLIER_SCORE: f64 = 14.26;

/// Smallest number of pairs that have a spread.
const MIN_SPREAD_PAIRS: usize = 20;

/// The stages of matching; the last is what belongs to none.
pub(crate) const STAGES: [&str; 6] = [
    "smoothing",
    "texture",
    "matching",
    "checks",
    "filters",
    "other",
];

/// Times of the pairs of one algorithm.
pub(crate) struct Speed {
    /// µs, ascending.
    sorted: Vec<u64>,
    /// µs per pixel, ascending.
    per_pixel: Vec<f64>,
    /// µs per pixel and disparity, ascending, of the pairs whose disparities are known.
    per_disparity: Vec<f64>,
    /// Means of [`STAGES`], of the middle half of the pairs by time.
    pub(crate) stages_ms: [f64; 6],
}

impl Speed {
    /// Times of the rows of one algorithm, at least one.
    pub(crate) fn from_rows(rows: &[RowRef<'_>]) -> Self {
        let total_us = |row: &RowRef<'_>| row.total_us().unwrap_or_default();
        let per_pixel = |row: &RowRef<'_>| {
            total_us(row) as f64 / (f64::from(row.width()) * f64::from(row.height()))
        };
        let per_disparity = |row: &RowRef<'_>| Some(per_pixel(row) / f64::from(row.disparities()?));
        let ascending = |mut values: Vec<f64>| {
            values.sort_by(f64::total_cmp);
            values
        };
        let mut order = rows.to_vec();
        order.sort_by_key(|row| total_us(row));
        // The interquartile mean of all stages over the same pairs: medians of stages would not add
        // up to the median of totals.
        let middle = &order[order.len() / 4..(3 * order.len()).div_ceil(4)];
        let mean_ms = |us: fn(&RowRef<'_>) -> Option<u64>| {
            let us = middle.iter().map(|row| us(row).unwrap_or_default() as f64);
            us.sum::<f64>() / (1e3 * middle.len().max(1) as f64)
        };
        let mut stages_ms = [
            mean_ms(|row| row.smoothing_us()),
            mean_ms(|row| row.texture_us()),
            mean_ms(|row| row.matching_us()),
            mean_ms(|row| row.checks_us()),
            mean_ms(|row| row.filters_us()),
            0.0,
        ];
        // Stages are rounded to whole microseconds each, so their sum may exceed the total.
        stages_ms[5] = (mean_ms(|row| row.total_us()) - stages_ms.iter().sum::<f64>()).max(0.0);
        Self {
            per_pixel: ascending(rows.iter().map(per_pixel).collect()),
            per_disparity: ascending(rows.iter().filter_map(per_disparity).collect()),
            sorted: order.iter().map(total_us).collect(),
            stages_ms,
        }
    }

    /// The time that a fraction `share` of the pairs does not exceed.
    pub(crate) fn rank_ms(&self, share: f64) -> f64 {
        nearest_rank(&self.sorted, share).map_or(0.0, |us| us as f64 / 1e3)
    }

    /// Number of pairs whose time for their size is an outlier.
    pub(crate) fn outliers(&self) -> u64 {
        let Some(median) = nearest_rank(&self.per_pixel, 0.5) else {
            return 0;
        };
        let mut deviations: Vec<_> = self.per_pixel.iter().map(|t| (t - median).abs()).collect();
        deviations.sort_by(f64::total_cmp);
        let scale = 1.4826 * nearest_rank(&deviations, 0.5).unwrap_or_default();
        let slow = self.per_pixel.iter();
        let slow = slow.filter(|t| **t - median > MIN_OUTLIER_SCORE * scale);
        // Times in whole microseconds may all be equal, and a few do not show their spread: then
        // there is no scale for outliers.
        if self.per_pixel.len() >= MIN_SPREAD_PAIRS && scale > 0.0 {
            slow.count() as u64
        } else {
            0
        }
    }

    /// Median seconds per million pixels.
    pub(crate) fn time_per_mp_s(&self) -> f64 {
        nearest_rank(&self.per_pixel, 0.5).unwrap_or_default()
    }

    /// Median seconds per 10⁹ pixels times disparities.
    pub(crate) fn time_per_gd_s(&self) -> Option<f64> {
        nearest_rank(&self.per_disparity, 0.5).map(|us| 1e3 * us)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::rows::held::{Row, Rows};

    /// A row without metrics.
    pub(crate) fn row(total_us: u64, (width, height): (u32, u32), disparities: Option<u32>) -> Row {
        Row {
            session: String::new(),
            scenario: String::new(),
            sequence: 0,
            stamp_ns: 0,
            name: String::new(),
            seed: None,
            algorithm: "v3".into(),
            pair_hash: String::new(),
            parameters_hash: String::new(),
            width,
            height,
            disparities,
            smoothing_us: Some(100),
            texture_us: Some(0),
            matching_us: Some(total_us / 2),
            checks_us: Some(0),
            total_us: Some(total_us),
            metrics: Default::default(),
            run: None,
            filters_us: None,
            stress: None,
            input_hash: String::new(),
            result_hash: String::new(),
            truth: None,
        }
    }

    #[test]
    fn speed_statistics_equal_values_computed_by_hand() {
        // Half a megapixel in 10 ms with 20 disparities: 0.02 s/MP, 1 s/GD.
        let rows =
            [10_000, 1_000_000, 10_000, 10_000, 2_000].map(|us| row(us, (1000, 500), Some(20)));
        let rows: Rows = rows.into_iter().collect();
        let speed = Speed::from_rows(&rows.iter().collect::<Vec<_>>());
        assert_eq!(
            [0.5, 0.95, 1.0].map(|share| speed.rank_ms(share)),
            [10.0, 1000.0, 1000.0]
        );
        assert!((speed.time_per_mp_s() - 0.02).abs() < 1e-12);
        assert!((speed.time_per_gd_s().unwrap() - 1.0).abs() < 1e-12);
        // The middle three: neither the slowest nor the fastest.
        assert_eq!(speed.stages_ms, [0.1, 0.0, 5.0, 0.0, 0.0, 4.9]);
    }

    #[test]
    fn outliers_are_far_slower_than_the_spread() {
        let outliers = |us: &[u64]| {
            let rows: Rows = us.iter().map(|&us| row(us, (100, 100), None)).collect();
            Speed::from_rows(&rows.iter().collect::<Vec<_>>()).outliers()
        };
        // Median 1009, of the deviations 5: the limit is 1009 + 14.26 · 7.4 = 1115.
        let spread: Vec<u64> = (1000..1020).collect();
        assert_eq!(outliers(&[&spread[..], &[1110, 1200]].concat()), 1);
        assert_eq!(outliers(&[&spread[..5], &[9000]].concat()), 0);
        assert_eq!(outliers(&[&[1000; 30][..], &[9000]].concat()), 0);
    }

    #[test]
    fn unknown_disparities_have_no_speed_per_disparity() {
        let rows: Rows = [row(500, (10, 10), None)].into_iter().collect();
        let speed = Speed::from_rows(&[rows.row(0)]);
        assert_eq!((speed.time_per_gd_s(), speed.time_per_mp_s()), (None, 5.0));
        assert_eq!(
            speed.stages_ms.map(|ms| (1e3 * ms).round()),
            [100.0, 0.0, 250.0, 0.0, 0.0, 150.0]
        );
    }
}
