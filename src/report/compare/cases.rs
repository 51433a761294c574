//! A comparison as test cases: which metrics must not become worse.

use super::{AlgorithmChange, Change, Comparison, Judgement};
use crate::junit::{TestCase, TestResult};
use svl_score::judge::{Metric, MetricUnit};

impl Comparison {
    /// A case for the pairs or courses of each algorithm, as more failures leave fewer of them for
    /// every metric, and one for each metric that is tested. `fail_on`: those metrics; `None` is
    /// any but times, as the machine varies between runs.
    pub fn cases(&self, fail_on: &[Option<&Metric>]) -> Vec<TestCase> {
        let mut cases = Vec::new();
        for own in &self.algorithms {
            let compared = match (own.failures(), own.pairs) {
                (Some(words), _) => TestResult::Failed(words),
                (None, 0) => TestResult::Skipped(format!("no {} in common", own.things())),
                _ => TestResult::Passed(own.extent()),
            };
            let name = format!("{}: {}s", own.labels(), own.things());
            cases.push(TestCase {
                name,
                result: compared,
            });
            cases.extend(own.tested(fail_on).map(|change| TestCase {
                name: format!("{}: {}", own.labels(), change.name()),
                result: change.test(own.blocks, self.method.fewest_blocks),
            }));
        }
        let things = self.algorithms.first();
        let things = things.map_or("pair", AlgorithmChange::things);
        let gone = self.only_in_base.iter();
        cases.extend(gone.map(|label| TestCase {
            name: format!("{label}: {things}s"),
            result: TestResult::Failed(format!("is not in {}", self.other.display())),
        }));
        cases
    }
}

impl AlgorithmChange {
    /// The changes that [`Comparison::cases`] tests.
    pub fn tested(&self, fail_on: &[Option<&Metric>]) -> impl Iterator<Item = &Change> {
        self.changes().filter(move |change| {
            let are_all = fail_on.contains(&None) && change.metric.unit != MetricUnit::Ms;
            are_all || fail_on.contains(&Some(change.metric))
        })
    }
}

impl Change {
    /// The result for a change over that many blocks of pairs.
    fn test(&self, blocks: usize, min_blocks: usize) -> TestResult {
        let [base, other] = [self.base, self.other].map(|value| self.metric.show(value));
        let too_few = self.too_few_words();
        match self.judgement {
            Judgement::Worse => TestResult::Failed(format!("became worse, {base} to {other}")),
            _ if self.metric.unit == MetricUnit::Ms => TestResult::Skipped(
                "times of two runs vary with the machine; a [[gate]] of the ratio to another \
                 algorithm tests them"
                    .to_owned(),
            ),
            Judgement::TooFew if blocks < min_blocks && self.metric.is_of_frames() => {
                TestResult::Skipped(format!(
                    "{base} to {other}, but too few independent pairs for an interval ({blocks} \
                     blocks, at least {min_blocks}): score more pairs"
                ))
            }
            Judgement::TooFew if self.is_for_the_worse() => TestResult::Skipped(format!(
                "{base} to {other}, but {too_few} to tell: score more"
            )),
            Judgement::TooFew => TestResult::Passed(format!("{base} to {other}, {too_few}")),
            _ => TestResult::Passed(format!("{base} to {other}")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn too_few_values_leave_only_a_change_for_the_worse_open() {
        let is_open = |name, base: f64, other: f64, blocks| {
            let metric = Metric::find(name).unwrap();
            let change = Change::new(metric, [base, other], other - base, None);
            matches!(change.test(blocks, 8), TestResult::Skipped(_))
        };
        assert!(is_open("wrong", 0.1, 0.2, 20) && is_open("right", 0.2, 0.1, 20));
        assert!(!is_open("wrong", 0.2, 0.1, 20) && !is_open("right", 0.1, 0.2, 20));
        // Nothing is known of too few blocks.
        assert!(is_open("wrong", 0.2, 0.1, 7) && is_open("right", 0.1, 0.2, 7));
    }
}
