//! A comparison as test cases: which metrics must not become worse.

use super::comparison::{AlgorithmChange, Comparison};
use crate::results::change::{Change, Judgement, NotMeasured, is_ranked};
use crate::show::junit::{TestCase, TestResult};
use svl_score::judge::{Cases, ColumnChoice, Metric, MetricOrigin, MetricUnit};

impl Comparison {
    /// A case for the pairs or courses of each algorithm, as more failures leave fewer of them for
    /// every metric, and one for each metric that is tested. `fail_on`: those metrics; `None` is
    /// those that decide.
    pub fn cases(&self, fail_on: &[Option<&Metric>]) -> Vec<TestCase> {
        let mut cases = Vec::new();
        for own in &self.algorithms {
            let few = own.few_in_common(self.min_common);
            let failures = own.failures().filter(|_| own.exceeds_losses);
            let compared = match (failures, own.pairs) {
                (Some(words), _) => TestResult::Failed(words),
                (None, 0) => TestResult::Skipped(format!("no {} in common", own.things())),
                _ => few.map_or_else(
                    || TestResult::Passed(own.extent()),
                    |words| TestResult::Failed(format!("{words} (--min-common)")),
                ),
            };
            let mut add = |name: &str, result| {
                let name = format!("{}: {name}", own.labels());
                cases.push(TestCase { name, result });
            };
            add(&format!("{}s", own.things()), compared);
            for change in own.tested(fail_on) {
                add(
                    &change.name(),
                    change.test(own.blocks, self.method.fewest_blocks),
                );
            }
            for metric in own.untested(fail_on) {
                add(metric.metric.words, TestResult::Skipped(metric.words()));
            }
        }
        let mut named: Vec<&Metric> = fail_on.iter().copied().flatten().collect();
        named.retain(|metric| {
            let asked = [Some(*metric)];
            let mut own = self.algorithms.iter();
            !own.any(|own| {
                own.tested(&asked).next().is_some() || own.untested(&asked).next().is_some()
            })
        });
        cases.extend(named.into_iter().map(|metric| TestCase {
            name: metric.words.to_owned(),
            result: TestResult::Skipped(self.unmeasured(metric)),
        }));
        let things = self.algorithms.first();
        let things = things.map_or("pair", AlgorithmChange::things);
        let gone = self.only_in_base.iter();
        cases.extend(gone.map(|label| TestCase {
            name: format!("{label}: {things}s"),
            result: TestResult::Failed(format!("is not in {}", self.other.display())),
        }));
        cases
    }

    /// Why a metric that no algorithm has in both reports is not tested.
    fn unmeasured(&self, metric: &Metric) -> String {
        let is_partial = self
            .algorithms
            .iter()
            .any(|own| own.has_partial_checkpoints);
        if is_partial && matches!(metric.origin, MetricOrigin::Checkpoints) {
            "is counted over whole runs: score the same pairs".to_owned()
        } else {
            "is not measured in both reports".to_owned()
        }
    }
}

impl AlgorithmChange {
    /// The changes that [`Comparison::cases`] tests.
    pub fn tested(&self, fail_on: &[Option<&Metric>]) -> impl Iterator<Item = &Change> {
        let deciding: Vec<_> = self.deciding().map(|change| change.metric).collect();
        self.changes().filter(move |change| {
            let is_deciding = fail_on.contains(&None) && deciding.contains(&change.metric);
            is_deciding || fail_on.contains(&Some(change.metric))
        })
    }

    /// The metrics that it cannot test: those that are named, and those that decide and that the
    /// base measures.
    fn untested(&self, fail_on: &[Option<&Metric>]) -> impl Iterator<Item = &NotMeasured> {
        let headline = self.metrics(&ColumnChoice::Headline);
        self.not_measured.iter().filter(move |own| {
            let is_deciding = headline.contains(&own.metric) && is_ranked(own.metric);
            let is_asked = fail_on.contains(&None) && is_deciding && own.is_measured(0);
            is_asked || fail_on.contains(&Some(own.metric))
        })
    }
}

impl NotMeasured {
    /// True if that report measures it.
    fn is_measured(&self, side: usize) -> bool {
        let is_measured = |cases| self.metric.is_measured(&cases, self.metric.minimum);
        self.cases[side].is_some_and(is_measured)
    }

    fn words(&self) -> String {
        let cases = |side: usize| {
            let own = self.cases[side].unwrap_or_else(Cases::none);
            self.metric.cases_words(&own)
        };
        let minimum = self.metric.minimum_words(self.metric.minimum);
        format!(
            "is not measured: it rests on {} and {}, and needs {minimum}",
            cases(0),
            cases(1)
        )
    }
}

impl Change {
    /// The result for a change over that many blocks of pairs.
    fn test(&self, blocks: usize, min_blocks: usize) -> TestResult {
        let [base, other] = [self.base, self.other].map(|value| self.metric.show(value));
        let too_few = self.too_few_words();
        match self.judgement {
            Judgement::Worse => {
                let exact = self.exact_words();
                TestResult::Failed(format!("became worse, {base} to {other}{exact}"))
            }
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
