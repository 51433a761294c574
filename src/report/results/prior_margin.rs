//! The test against the prior: nothing is called best that does not beat who looks at nothing.

use super::best::PriorTest;
use super::summary::Results;
use crate::rows::records::Row;
use crate::rows::samples::resamples;
use std::collections::BTreeMap;
use svl_score::bootstrap::{Sample, middle};
use svl_score::judge::{Metric, TruthLevel};

/// Fraction of right cells from which on the prior is no test: the scene hardly changes.
const MIN_RIGHT: f64 = 0.8;

impl Results {
    /// Finds the algorithms that do not beat the prior by right minus wrong cells, beyond the 95 %
    /// interval. `rows` and `prior`: those that the summary is of.
    pub(crate) fn test_prior(&mut self, rows: &[Row], prior: &[Row]) {
        let right = Metric::find("right").filter(|_| self.kind() == TruthLevel::Distances);
        let Some(right) = right.and_then(|right| self.prior.as_ref()?.value(right)) else {
            return;
        };
        if right >= MIN_RIGHT {
            self.basis.prior_test = PriorTest::Still;
            return;
        }
        let key = |row: &'_ Row| (row.seed, row.run.clone(), row.sequence, row.name.clone());
        let prior: BTreeMap<_, _> = prior.iter().map(|row| (key(row), row)).collect();
        self.basis.prior_test = PriorTest::Tested;
        for label in self.algorithms.iter().map(|a| &a.algorithm) {
            let own = rows.iter();
            let own = own.filter(|r| r.algorithm == *label && r.stress.is_none());
            let both = own.filter_map(|row| Some((row, *prior.get(&key(row))?)));
            let (own, prior): (Vec<_>, Vec<_>) = both.unzip();
            let samples = [&prior, &own].map(|rows| merit_sample(rows));
            let resamples = resamples(&own);
            let [base, other] = &samples;
            let draws = Sample::draws_between(base, other, |a, b| b - a, &resamples);
            match draws.and_then(middle) {
                None => self.basis.prior_test = PriorTest::TooFewPairs,
                Some((low, _)) if low > 0.0 => {}
                Some(_) => self.basis.behind_prior.push(label.clone()),
            }
        }
    }

    /// The prior in words, where it limits what the numbers say.
    pub(crate) fn prior_words(&self) -> Option<String> {
        let metric = Metric::find("right")?;
        let right = self.prior.as_ref()?.value(metric)?;
        let words = metric.words;
        (self.basis.prior_test == PriorTest::Still).then(|| {
            format!(
                "the scene hardly changes: who looks at nothing (prior) has {} {words}",
                metric.show(right)
            )
        })
    }
}

/// Right minus wrong cells, of the scored ones.
pub(crate) fn merit_sample(rows: &[&Row]) -> Sample {
    let parts = |row: &&Row| {
        let [right, wrong, unknown] = ["right", "wrong", "unknown"].map(|n| row.metrics.get(n));
        let counts = right.zip(wrong).zip(unknown);
        counts.map_or([0.0; 2], |((right, wrong), unknown)| {
            [right - wrong, right + wrong + unknown]
        })
    };
    Sample::Ratio(rows.iter().map(parts).collect())
}

#[cfg(test)]
mod tests {
    use super::super::summary::{ReportTables, ResultParts, Shown};
    use super::*;
    use crate::subjects::prior::PRIOR;
    use crate::subjects::speed::tests::row;
    use svl_score::judge::MetricValues;

    /// Pairs of one cell each in seven blocks or more; the prior's and the algorithm's right ones.
    fn tested(pairs: u64, prior: fn(u64) -> bool, own: fn(u64) -> bool) -> Results {
        let rows = |label: &str, is_right: fn(u64) -> bool| -> Vec<_> {
            let row = |sequence| {
                let right = f64::from(u8::from(is_right(sequence)));
                Row {
                    algorithm: label.into(),
                    seed: Some(1),
                    sequence,
                    metrics: MetricValues::from([
                        ("right", right),
                        ("wrong", 1.0 - right),
                        ("unknown", 0.0),
                        ("false", 0.0),
                    ]),
                    ..row(1000, (64, 48), None)
                }
            };
            (0..pairs).map(row).collect()
        };
        let tables = ReportTables {
            rows: rows("own", own),
            prior: rows(PRIOR, prior),
            ..ReportTables::default()
        };
        Results::new(&tables, ResultParts::default(), Shown::default()).unwrap()
    }

    #[test]
    fn an_algorithm_that_does_not_beat_the_prior_is_behind_it() {
        let half = |i: u64| i.is_multiple_of(2);
        let all_but_few = |i: u64| !i.is_multiple_of(20);
        let better = tested(200, half, all_but_few);
        assert_eq!(better.basis.prior_test, PriorTest::Tested);
        assert!(better.basis.behind_prior.is_empty() && better.is_usable(&better.algorithms[0]));
        for own in [half, |i: u64| i.is_multiple_of(3)] {
            let behind = tested(200, half, own);
            assert_eq!(behind.basis.behind_prior, ["own"]);
            assert!(!behind.is_usable(&behind.algorithms[0]));
        }
        // Few pairs, and a scene that hardly changes, tell nothing.
        let few = tested(20, half, |_| true);
        assert_eq!(
            (few.basis.prior_test, few.basis.behind_prior.len()),
            (PriorTest::TooFewPairs, 0)
        );
        let still = tested(200, all_but_few, |_| true);
        assert_eq!(
            (still.basis.prior_test, still.basis.behind_prior.len()),
            (PriorTest::Still, 0)
        );
        let words = still.prior_words().unwrap();
        assert!(
            words.contains("hardly changes") && words.contains("95.0 %"),
            "{words}"
        );
    }
}
