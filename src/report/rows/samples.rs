//! The values of a metric in rows, from which totals and intervals are drawn.

use super::held::RowRef;
use super::records::MetricTotals;
use std::collections::BTreeMap;
use svl_score::bootstrap::{RunLengths, Sample};
use svl_score::judge::{AreaChoice, Metric, MetricOrigin, MetricSource as _, MetricTotal};

/// The values of a metric in the area that is selected; absent if no pair has it.
pub(crate) fn sample(metric: &Metric, rows: &[RowRef<'_>]) -> Option<Sample> {
    let area = rows.first().map(|row| row.metrics().area());
    sample_in(metric, rows, area.unwrap_or_default())
}

/// The values of a metric in an area; absent if no pair has it.
pub(crate) fn sample_in(metric: &Metric, rows: &[RowRef<'_>], area: AreaChoice) -> Option<Sample> {
    let values = || {
        rows.iter()
            .map(|row| row.metrics().get_in(metric.name, area))
    };
    match metric.origin {
        MetricOrigin::Frame { total, .. } => match total {
            MetricTotal::Mean => {
                let part = |row: &RowRef<'_>| {
                    let mean = || Some([row.metrics().get_in(metric.name, area)?, 1.0]);
                    let parts = row.metrics().parts_in(metric, area).or_else(mean);
                    parts.unwrap_or_default()
                };
                Some(Sample::Ratio(rows.iter().map(part).collect()))
            }
            MetricTotal::Sum => values()
                .any(|v| v.is_some())
                .then(|| Sample::Count(values().map(Option::unwrap_or_default).collect())),
            MetricTotal::Share => {
                let part =
                    |row: &RowRef<'_>| row.metrics().parts_in(metric, area).unwrap_or_default();
                Some(Sample::Ratio(rows.iter().map(part).collect()))
            }
        },
        MetricOrigin::Time => {
            let ms = rows.iter();
            let ms = ms.map(|row| row.total_us().map(|us| us as f64 / 1000.0));
            Some(Sample::Median(
                ms.map(|ms| ms.into_iter().collect()).collect(),
            ))
        }
        MetricOrigin::Cells { .. }
        | MetricOrigin::Estimated { .. }
        | MetricOrigin::Checkpoints
        | MetricOrigin::Drives(_)
        | MetricOrigin::Pieces { .. } => None,
    }
}

/// The totals of rows, with the area that these select.
pub(crate) fn totals(rows: &[RowRef<'_>]) -> MetricTotals {
    let metrics: Vec<_> = rows.iter().map(|row| row.metrics()).collect();
    MetricTotals::new(
        &metrics,
        rows.iter().filter_map(|row| row.total_us()).collect(),
    )
}

/// A metric over all rows of an algorithm: a fraction or a mean, a sum, or the median of times.
pub(crate) fn total(metric: &Metric, rows: &[RowRef<'_>]) -> Option<f64> {
    sample(metric, rows)?.total()
}

/// The runs of rows, those of a run beside each other.
pub(crate) fn runs(rows: &[RowRef<'_>]) -> RunLengths {
    let lengths = rows.chunk_by(|a, b| a.origin().run_key() == b.origin().run_key());
    let lengths: Vec<_> = lengths.map(<[_]>::len).collect();
    // Scenes of a data set are independent of each other; frames of a recording are not, also where
    // their files have names.
    RunLengths::new(&lengths, rows.iter().all(|row| row.origin().is_scene()))
}

/// The rows of the pairs that both have, those of a run beside each other.
pub(crate) fn paired<'a>(base: &[RowRef<'a>], other: &[RowRef<'a>]) -> [Vec<RowRef<'a>>; 2] {
    let key = |row: &RowRef<'a>| (row.origin().run_key(), row.sequence(), row.name());
    let other: BTreeMap<_, _> = other.iter().map(|row| (key(row), *row)).collect();
    let base: BTreeMap<_, _> = base.iter().map(|row| (key(row), *row)).collect();
    let both = base
        .iter()
        .filter_map(|(key, row)| Some((*row, *other.get(key)?)));
    let (base, other) = both.unzip();
    [base, other]
}

/// The sums of rows of equal keys, in the order of their first ones.
pub(crate) fn grouped<T: Copy, K: Ord, S>(
    rows: &[T],
    key: impl Fn(T) -> K,
    sum: impl Fn(&[T]) -> S,
) -> Vec<S> {
    let mut groups: Vec<Vec<T>> = Vec::new();
    let mut places = BTreeMap::new();
    for row in rows {
        let place = *places.entry(key(*row)).or_insert(groups.len());
        match groups.get_mut(place) {
            Some(group) => group.push(*row),
            None => groups.push(vec![*row]),
        }
    }
    groups.iter().map(|own| sum(own)).collect()
}
