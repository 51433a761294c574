//! Reliability of probabilities: predicted against observed (M. DeGroot and S. Fienberg, The
//! Comparison and Evaluation of Forecasters, 1983).

use crate::rows::records::{CellRow, record};
use crate::show::plot::chart::{Axis, Chart};
use crate::show::plot::series::{Series, SeriesStyle};
use serde::Serialize;
use std::collections::BTreeMap;
use svl_score::judge::Verdict;

record! {
    /// Cells of an algorithm whose probability to be right lies in a range. A cell counts if it is
    /// known and scored. Unperturbed pairs only.
    ReliabilityRow {
        /// Label of the algorithm, as `v3:max_disparity=64`.
        algorithm: String,
        /// Least probability of the range.
        from: f64,
        /// Probabilities are lower, except in the last range.
        to: f64,
        /// Number of cells.
        cells: u64,
        /// Mean probability.
        predicted: f64,
        /// Fraction of the cells that is right.
        right: f64,
    }
}

impl ReliabilityRow {
    /// The cells without their algorithm.
    pub(crate) fn bin(&self) -> ReliabilityBin {
        ReliabilityBin {
            from: self.from,
            to: self.to,
            cells: self.cells,
            predicted: self.predicted,
            right: self.right,
        }
    }
}

/// The cells whose probability lies in a range.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ReliabilityBin {
    pub from: f64,
    pub to: f64,
    pub cells: u64,
    /// Mean probability.
    pub predicted: f64,
    /// Fraction of them that is right.
    pub right: f64,
}

/// Cells by ranges of their probability.
#[derive(Clone, Debug)]
pub struct ReliabilityTally {
    ends: &'static [f64],
    /// Per range the number of cells, the sum of their probabilities, and the number of right ones.
    ranges: Vec<(u64, f64, u64)>,
}

/// Ends of a report's ranges: known cells have high probabilities.
const ENDS: [f64; 13] = [
    0.0, 0.2, 0.4, 0.6, 0.75, 0.85, 0.9, 0.925, 0.95, 0.97, 0.98, 0.99, 1.0,
];

/// Fewest cells of a range that is drawn.
const MIN_CELLS: u64 = 20;

impl ReliabilityTally {
    /// No cells, of ranges between these probabilities.
    pub fn new(ends: &'static [f64]) -> Self {
        Self {
            ends,
            ranges: vec![(0, 0.0, 0); ends.len().saturating_sub(1)],
        }
    }

    /// Adds a cell.
    pub fn add(&mut self, probability: f64, is_right: bool) {
        let range = self.ends.partition_point(|end| *end <= probability);
        // The last range has its end.
        let range = range.clamp(1, self.ranges.len().max(1)) - 1;
        if let Some((cells, sum, right)) = self.ranges.get_mut(range) {
            *cells += 1;
            *sum += probability;
            *right += u64::from(is_right);
        }
    }

    /// All ranges, also those without cells.
    pub fn bins(&self) -> Vec<ReliabilityBin> {
        let ends = self.ends.windows(2).zip(&self.ranges);
        let bin = |(ends, (cells, sum, right)): (&[f64], &(u64, f64, u64))| {
            let count = (*cells).max(1) as f64;
            ReliabilityBin {
                from: ends[0],
                to: ends[1],
                cells: *cells,
                predicted: sum / count,
                right: *right as f64 / count,
            }
        };
        ends.map(bin).collect()
    }
}

/// The probabilities of all algorithms, by label.
#[derive(Default)]
pub(crate) struct ReliabilityTallies(BTreeMap<String, ReliabilityTally>);

impl ReliabilityTallies {
    /// Adds the cells of a pair.
    pub(crate) fn add(&mut self, cells: &[CellRow]) {
        for cell in cells.iter().filter(|cell| cell.stress.is_none()) {
            let is_right = match cell.verdict {
                Verdict::Right => true,
                Verdict::Wrong => false,
                _ => continue,
            };
            let Some(probability) = cell.probability else {
                continue;
            };
            // Not by `entry`, which needs a label of its own for each cell.
            if !self.0.contains_key(&cell.algorithm) {
                let new = ReliabilityTally::new(&ENDS);
                self.0.insert(cell.algorithm.clone(), new);
            }
            if let Some(own) = self.0.get_mut(&cell.algorithm) {
                own.add(probability, is_right);
            }
        }
    }

    /// Per algorithm, in the order of the labels, the ranges that have cells.
    pub(crate) fn into_rows(self, labels: &[&str]) -> Vec<ReliabilityRow> {
        let mut rows = Vec::new();
        for label in labels {
            let bins = self.0.get(*label).map(ReliabilityTally::bins);
            let bins = bins.into_iter().flatten().filter(|bin| bin.cells > 0);
            rows.extend(bins.map(|bin| ReliabilityRow {
                algorithm: (*label).to_owned(),
                from: bin.from,
                to: bin.to,
                cells: bin.cells,
                predicted: bin.predicted,
                right: bin.right,
            }));
        }
        rows
    }
}

/// Caption of [`reliability_chart`].
pub(crate) const ABOUT: &str = "Fraction of right cells by the probability that the algorithm \
                                gives them; below the diagonal it is too sure. Ranges with 20 \
                                cells or more.";

/// Observed over predicted fractions under the names of algorithms, of ranges with enough cells;
/// none if no two ranges of an algorithm have.
pub fn reliability_chart(bins: Vec<(String, Vec<ReliabilityBin>)>) -> Option<Chart> {
    let series = |(name, bins): (String, Vec<ReliabilityBin>)| {
        let drawn = bins.iter().filter(|bin| bin.cells >= MIN_CELLS);
        let points = drawn.map(|bin| (100.0 * bin.predicted, 100.0 * bin.right));
        Series::new(&name, SeriesStyle::Both, points)
    };
    let mut series: Vec<_> = bins.into_iter().map(series).collect();
    series.retain(|series| !series.points.is_empty());
    let points = series.iter().flat_map(|series| &series.points);
    let least = points.map(|(x, y)| x.min(*y)).reduce(f64::min)?;
    // Both axes are the same, so that the diagonal is one.
    let from = ((least / 10.0).floor() * 10.0).min(90.0);
    let axis = |label: &str| Axis::share(label).with_range(from, 100.0);
    let diagonal = [(from, from), (100.0, 100.0)];
    series.push(Series::new("as predicted", SeriesStyle::Front, diagonal));
    let (x, y) = (axis("predicted right, %"), axis("observed right, %"));
    Chart::untitled(x, y, series).if_any()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_has_its_lower_end_and_the_last_one_both() {
        let mut tally = ReliabilityTally::new(&[0.0, 0.5, 1.0]);
        for (probability, is_right) in [(0.0, false), (0.4, true), (0.5, true), (1.0, true)] {
            tally.add(probability, is_right);
        }
        let bins = tally.bins().into_iter();
        let bins: Vec<_> = bins.map(|b| (b.cells, b.predicted, b.right)).collect();
        assert_eq!(bins, [(2, 0.2, 0.5), (2, 0.75, 1.0)]);
    }

    #[test]
    fn a_range_of_few_cells_is_not_drawn() {
        let mut tally = ReliabilityTally::new(&ENDS);
        let chart =
            |tally: &ReliabilityTally| reliability_chart(vec![("v5".to_owned(), tally.bins())]);
        (0..20).for_each(|_| tally.add(0.97, true));
        (0..19).for_each(|_| tally.add(0.93, true));
        assert_eq!(chart(&tally), None);
        tally.add(0.93, false);
        let drawn = chart(&tally).unwrap();
        assert_eq!(drawn.series[0].points.len(), 2);
        assert_eq!(drawn.x.range, Some((90.0, 100.0)));
    }
}
