//! A metric's values per pair, for bootstrap resamples.

use super::super::rows::Row;
use svl_data::bootstrap::Sample;
use svl_data::score::{Metric, MetricOrigin, MetricTotal};

/// The values of a metric; absent where no pair has it.
pub(super) fn sample(metric: &Metric, rows: &[&Row]) -> Option<Sample> {
    let values = || rows.iter().map(|row| row.metrics.get(metric.name));
    match metric.origin {
        MetricOrigin::Frame { total, .. } => match total {
            MetricTotal::Mean => Some(Sample::Ratio(
                values()
                    .map(|v| v.map_or((0.0, 0.0), |v| (v, 1.0)))
                    .collect(),
            )),
            MetricTotal::Sum => values()
                .any(|v| v.is_some())
                .then(|| Sample::Count(values().map(Option::unwrap_or_default).collect())),
            MetricTotal::ShareOf(_) => {
                let part = |row: &&Row| {
                    let part = row.metrics.get(metric.name);
                    part.zip(row.metrics.whole(metric)).unwrap_or_default()
                };
                Some(Sample::Ratio(rows.iter().map(part).collect()))
            }
        },
        MetricOrigin::Time => Some(Sample::Median(
            rows.iter()
                .map(|row| row.total_us as f64 / 1000.0)
                .collect(),
        )),
        MetricOrigin::Checkpoints | MetricOrigin::Drives(_) => None,
    }
}
