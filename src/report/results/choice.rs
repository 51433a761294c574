//! Choice among many algorithms: sorted by a metric, the best by each, and the Pareto front.

use super::summary::{AlgorithmSummary, ProgramSummary, Results};
use std::cmp::Ordering;
use svl_score::judge::{Better, Metric, TruthLevel};

impl Results {
    /// Sorts the algorithms by a metric, the best first, those without a value last. Of a metric
    /// that has no better direction the largest is first.
    pub(crate) fn sort_by(&mut self, metric: &Metric) {
        // Before they are taken out: values are looked up among them.
        let keyed = self.algorithms.iter().cloned();
        let mut keyed: Vec<_> = keyed.map(|a| (self.ranked(&a, metric), a)).collect();
        keyed.sort_by(|(a, _), (b, _)| better_first(metric, *a, *b));
        self.algorithms = keyed.into_iter().map(|(_, algorithm)| algorithm).collect();
    }

    /// True for an algorithm that may be called best: it has a result of every pair, and is not a
    /// reference at an end of the scale, the truth or `blind`.
    pub(crate) fn is_candidate(&self, algorithm: &AlgorithmSummary) -> bool {
        !self.is_reference(algorithm) && !self.has_failed(algorithm)
    }

    /// True if it has no result of some pairs.
    pub(crate) fn has_failed(&self, algorithm: &AlgorithmSummary) -> bool {
        let mut failed = self.failed.iter();
        failed.any(|f| f.algorithm == algorithm.algorithm)
    }

    /// True for the truth and for `blind`.
    pub(crate) fn is_reference(&self, algorithm: &AlgorithmSummary) -> bool {
        let label = &algorithm.algorithm;
        self.basis.perfect.contains(label) || label == "blind"
    }

    /// The labels of those that may be called best.
    pub(crate) fn candidate_labels(&self) -> Vec<&str> {
        let candidates = self.candidates().into_iter();
        candidates.map(|a| a.algorithm.as_str()).collect()
    }

    fn candidates(&self) -> Vec<&AlgorithmSummary> {
        let algorithms = self.algorithms.iter();
        let is_shown = |a: &&AlgorithmSummary| {
            self.is_candidate(a) && (self.kind() != TruthLevel::Courses || self.has_driven(a))
        };
        algorithms.filter(is_shown).collect()
    }

    /// The value by which an algorithm is ranked: none for a time that is not believable, nor for
    /// times that are not comparable.
    pub(crate) fn ranked(&self, algorithm: &AlgorithmSummary, metric: &Metric) -> Option<f64> {
        let value = self.value(&algorithm.algorithm, metric, None);
        let is_ranked = || self.is_believable(algorithm, metric) && self.has_comparable_times();
        value.filter(|_| metric.name != "time" || is_ranked())
    }

    /// False for the time of a program that answers far later than it reports.
    pub(crate) fn is_believable(&self, algorithm: &AlgorithmSummary, metric: &Metric) -> bool {
        let mut programs = self.programs.iter();
        let is_doubtful = |run: &ProgramSummary| {
            run.algorithm == algorithm.algorithm && run.program.is_time_doubtful()
        };
        metric.name != "time" || !programs.any(is_doubtful)
    }

    /// The objectives of the kind of run that it measures, and the algorithms that no other one
    /// dominates: at least as good by all of them, and better by one.
    pub fn front(&self) -> (Vec<&'static Metric>, Vec<&str>) {
        let objectives: &[_] = match self.kind() {
            TruthLevel::Distances | TruthLevel::NoTruth => &OBJECTIVES,
            TruthLevel::Disparities => &["bad2", "coverage", "time"],
            // Drives run beside each other, so their times decide nothing.
            TruthLevel::Courses => &["finished", "collisions"],
        };
        let candidates = self.candidates();
        let value = |a: &&AlgorithmSummary, metric: &Metric| self.ranked(a, metric);
        let (objectives, front) = pareto_front(&candidates, objectives, value);
        (
            objectives,
            front.iter().map(|a| a.algorithm.as_str()).collect(),
        )
    }
}

/// The objectives of a robot.
const OBJECTIVES: [&str; 4] = ["right", "wrong", "unrivalled", "time"];

/// The objectives that any of the items has a value for, and the items that no other one dominates:
/// at least as good by all of them, and better by one.
fn pareto_front<'a, T>(
    items: &'a [T],
    objectives: &[&str],
    value: impl Fn(&T, &Metric) -> Option<f64>,
) -> (Vec<&'static Metric>, Vec<&'a T>) {
    let objectives = objectives.iter().map(|name| Metric::find(name));
    let is_measured = |metric: &&Metric| items.iter().any(|item| value(item, metric).is_some());
    let objectives: Vec<_> = objectives.flatten().filter(is_measured).collect();
    let dominates = |a: &T, b: &T| {
        let orders = || {
            let values = objectives.iter().map(|m| (m, value(a, m), value(b, m)));
            values.map(|(m, a, b)| better_first(m, a, b))
        };
        orders().all(Ordering::is_le) && orders().any(Ordering::is_lt)
    };
    let is_free = |b: &&T| !items.iter().any(|a| dominates(a, b));
    let front = items.iter().filter(is_free).collect();
    (objectives, front)
}

/// The better value first, none last.
pub(crate) fn better_first(metric: &Metric, a: Option<f64>, b: Option<f64>) -> Ordering {
    match (a, b) {
        (Some(a), Some(b)) => match metric.better {
            Better::Less => a.total_cmp(&b),
            Better::Zero => a.abs().total_cmp(&b.abs()),
            Better::More | Better::Neither => b.total_cmp(&a),
        },
        (a, b) => b.is_some().cmp(&a.is_some()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rows::records::Row;
    use crate::subjects::speed::tests::row;

    /// Rows of one pair: the label, the time and the fractions of right and of wrong cells in
    /// tenths.
    fn summary(results: &[(&str, u64, f64, f64)]) -> Results {
        let rows: Vec<_> = results
            .iter()
            .map(|&(label, us, right, wrong)| {
                let mut row = Row {
                    algorithm: label.into(),
                    ..row(us, (64, 48), None)
                };
                let cells = [
                    ("right", right),
                    ("wrong", wrong),
                    ("unknown", 10.0 - right - wrong),
                    ("false", 0.0),
                ];
                for (name, value) in cells {
                    row.metrics.set(name, Some(value));
                }
                row
            })
            .collect();
        Results::from_rows(&rows, &[], None)
    }

    #[test]
    fn the_front_holds_what_no_other_dominates() {
        let mut summary = summary(&[
            ("slow and good", 9000, 9.0, 0.0),
            ("dominated", 9000, 8.0, 1.0),
            ("quick", 1000, 4.0, 1.0),
            ("as quick and worse", 1000, 4.0, 2.0),
        ]);
        assert_eq!(summary.front().1, ["slow and good", "quick"]);
        summary.sort_by(Metric::find("wrong").unwrap());
        let order: Vec<_> = summary
            .algorithms
            .iter()
            .map(|a| a.algorithm.as_str())
            .collect();
        assert_eq!(order[..1], ["slow and good"]);
        assert_eq!(order[3], "as quick and worse");
    }
}
