//! A metric's values per pair, for bootstrap resamples.

use super::super::rows::Row;
use svl_core::statistics::lower_median;
use svl_data::score::{Metric, MetricOrigin, MetricTotal};

/// A metric's values for the pairs of a run.
pub(super) enum Sample {
    /// Numerator and denominator; the value is the ratio of their sums.
    Ratio(Vec<(f64, f64)>),
    /// The value is the sum.
    Count(Vec<f64>),
    /// The value is the median by nearest rank.
    Median(Vec<f64>),
}

impl Sample {
    /// The values of a metric; absent where no pair has it.
    pub(super) fn from_rows(metric: &Metric, rows: &[&Row]) -> Option<Self> {
        let values = || rows.iter().map(|row| row.metrics.get(metric.name));
        match metric.origin {
            MetricOrigin::Frame { total, .. } => match total {
                MetricTotal::Mean => Some(Self::Ratio(
                    values()
                        .map(|v| v.map_or((0.0, 0.0), |v| (v, 1.0)))
                        .collect(),
                )),
                MetricTotal::Sum => values()
                    .any(|v| v.is_some())
                    .then(|| Self::Count(values().map(Option::unwrap_or_default).collect())),
                MetricTotal::ShareOf(_) => {
                    let part = |row: &&Row| {
                        let part = row.metrics.get(metric.name);
                        part.zip(row.metrics.whole(metric)).unwrap_or_default()
                    };
                    Some(Self::Ratio(rows.iter().map(part).collect()))
                }
            },
            MetricOrigin::Time => Some(Self::Median(
                rows.iter()
                    .map(|row| row.total_us as f64 / 1000.0)
                    .collect(),
            )),
            MetricOrigin::Checkpoints | MetricOrigin::Drives(_) => None,
        }
    }

    /// Pairs.
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Ratio(parts) => parts.len(),
            Self::Count(values) | Self::Median(values) => values.len(),
        }
    }

    /// The metric over `items`, each as often as it stands there.
    pub(super) fn value(&self, items: &[usize]) -> Option<f64> {
        match self {
            Self::Ratio(parts) => {
                let sum = |(a, b): (f64, f64), &i: &usize| (a + parts[i].0, b + parts[i].1);
                let (numerator, denominator) = items.iter().fold((0.0, 0.0), sum);
                (denominator > 0.0).then(|| numerator / denominator)
            }
            Self::Count(values) => Some(items.iter().map(|&i| values[i]).sum()),
            Self::Median(values) => lower_median(items.iter().map(|&i| values[i])),
        }
    }
}
