//! What a metric takes from every pair, ready to be drawn from again and again.

use super::super::metric::Metric;
use super::super::rows::Row;
use crate::statistics::lower_median;

/// A metric's part in every pair of a run.
pub(super) enum Sample {
    /// Numerator and denominator; the value is the ratio of their sums.
    Ratio(Vec<(f64, f64)>),
    /// The value is the sum.
    Count(Vec<f64>),
    /// The value is the median by nearest rank.
    Median(Vec<f64>),
}

impl Sample {
    /// Nothing where no pair has the metric.
    pub(super) fn of(metric: Metric, rows: &[&Row]) -> Option<Self> {
        let cells =
            |row: &Row| Some((row.cells_right? + row.cells_wrong? + row.cells_unknown?) as f64);
        let of_cells = |part: fn(&Row) -> Option<u64>| {
            let ratio = |row: &&Row| {
                part(row)
                    .zip(cells(row))
                    .map_or((0.0, 0.0), |(part, all)| (part as f64, all))
            };
            Some(Self::Ratio(rows.iter().map(ratio).collect()))
        };
        let count = |part: fn(&Row) -> Option<u64>| {
            let counts: Vec<_> = rows.iter().map(|row| part(row)).collect();
            let some = counts.iter().any(Option::is_some);
            some.then(|| Self::Count(counts.into_iter().map(|n| n.unwrap_or(0) as f64).collect()))
        };
        let mean = |part: fn(&Row) -> Option<f64>| {
            Some(Self::Ratio(
                rows.iter()
                    .map(|row| part(row).map_or((0.0, 0.0), |v| (v, 1.0)))
                    .collect(),
            ))
        };
        match metric {
            Metric::Right => of_cells(|row| row.cells_right),
            Metric::Wrong => of_cells(|row| row.cells_wrong),
            Metric::Unknown => of_cells(|row| row.cells_unknown),
            Metric::Missed => count(|row| row.missed_obstacles),
            Metric::False => count(|row| row.false_obstacles),
            Metric::Coverage => mean(|row| Some(row.coverage)),
            Metric::Invalid => mean(|row| row.invalid),
            Metric::Bad1 => mean(|row| row.bad1),
            Metric::Bad2 => mean(|row| row.bad2),
            Metric::Time => Some(Self::Median(
                rows.iter()
                    .map(|row| row.total_us as f64 / 1000.0)
                    .collect(),
            )),
            Metric::Passed => None,
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
