//! The answer of a report: the best algorithm by the headline metrics and by time, and those that
//! are not told apart from it.

use super::best::{BEST, Best, Certainty, Other, PriorTest};
use super::choice::better_first;
use super::drives::{self, DriveRow, MIN_DRIVEN};
use super::results::{AlgorithmSummary, Results};
use super::rows::Row;
use super::samples::{RunKey, resamples, run_key, sample};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use svl_core::joined;
use svl_score::bootstrap::{Interval, Resamples, Sample};
use svl_score::judge::{Metric, TruthLevel};

/// Limits of an algorithm that may be called best, as fractions: of cells where distances are
/// scored, of pixels where disparities are. An algorithm that answers nothing misses nothing, so
/// right cells and coverage have limits, too.
pub(super) struct Usable {
    /// Largest fraction of wrong cells.
    pub(super) max_wrong: f64,
    /// Smallest fraction of right cells.
    min_right: f64,
    /// Largest fraction of pixels off by more than 2 px.
    max_bad: f64,
    /// Smallest fraction of pixels with a disparity.
    min_coverage: f64,
}

pub(super) const USABLE: Usable = Usable {
    max_wrong: 0.1,
    min_right: 0.1,
    max_bad: 0.2,
    min_coverage: 0.1,
};

/// Fraction of found near obstacles below which the number of missed ones says nothing.
const MIN_FOUND: f64 = 0.5;
const MIN_FOUND_WORDS: &str = "at least half of the near obstacles";

/// The rows of each algorithm by run, number and name of the pair.
type RowsByAlgorithm<'a> = BTreeMap<&'a str, BTreeMap<(RunKey<'a>, u64, &'a str), &'a Row>>;

/// The metrics by which algorithms are called best.
pub(super) fn answer_metrics(kind: TruthLevel) -> Vec<&'static Metric> {
    let names: &[&str] = match kind {
        TruthLevel::Distances => &["right", "wrong", "missed"],
        TruthLevel::Disparities => &["total_bad2"],
        TruthLevel::Courses => &["finished", "collisions"],
        TruthLevel::NoTruth => &["unrivalled", "agreed"],
    };
    names.iter().filter_map(|name| Metric::find(name)).collect()
}

impl Results {
    /// Finds the best algorithms. `rows` and `drives`: those that the results are of.
    pub(super) fn find_best(&mut self, rows: &[Row], drives: &[DriveRow]) {
        let mut by_algorithm: RowsByAlgorithm<'_> = BTreeMap::new();
        for row in rows.iter().filter(|row| row.stress.is_none()) {
            let own = by_algorithm.entry(&row.algorithm).or_default();
            own.insert((run_key(row), row.sequence, &row.name), row);
        }
        let kind = self.kind();
        // Drives run beside each other, and their pairs differ.
        let is_timed = kind != TruthLevel::Courses && self.has_comparable_times();
        let time = Metric::find("time").filter(|_| is_timed);
        let metrics = answer_metrics(kind).into_iter().chain(time);
        let best = metrics.filter_map(|metric| self.best_by(metric, &by_algorithm, drives));
        self.best = best.collect();
    }

    fn best_by(
        &self,
        metric: &'static Metric,
        rows: &RowsByAlgorithm<'_>,
        drives: &[DriveRow],
    ) -> Option<Best> {
        let value = |a: &AlgorithmSummary| self.ranked(a, metric);
        let mut usable = self.ranked_algorithms();
        usable.retain(|a| self.is_candidate(a) && self.is_usable(a) && value(a).is_some());
        if metric.name == "missed" {
            usable.retain(|a| self.sees_near_obstacles(a));
        }
        // Stable: the first of equal ones is the best.
        usable.sort_by(|a, b| better_first(metric, value(a), value(b)));
        let (best, others) = usable.split_first()?;
        let other = |other: &&AlgorithmSummary| {
            let labels = [best, other].map(|a| a.algorithm.as_str());
            let certainty = match self.kind() {
                TruthLevel::Courses => course_certainty(metric, labels, drives),
                _ => pair_certainty(metric, labels, rows),
            };
            Other {
                algorithm: other.algorithm.clone(),
                certainty,
            }
        };
        Some(Best {
            metric,
            area: self.area_of(metric),
            algorithm: best.algorithm.clone(),
            value: value(best)?,
            others: others.par_iter().map(other).collect(),
        })
    }

    /// True for few wrong cells, some right ones and more than the prior has; for some pixels with
    /// a disparity; for some of the courses driven. No other algorithm is called best.
    pub(crate) fn is_usable(&self, algorithm: &AlgorithmSummary) -> bool {
        if self.basis.behind_prior.contains(&algorithm.algorithm) {
            return false;
        }
        let share = |name| algorithm.value(Metric::find(name)?);
        let reaches = |name, min| share(name).is_none_or(|share| share >= min);
        let is_within = |name, max| share(name).is_none_or(|share| share <= max);
        match self.kind() {
            TruthLevel::Distances => {
                reaches("right", USABLE.min_right) && is_within("wrong", USABLE.max_wrong)
            }
            TruthLevel::Disparities => {
                reaches("coverage", USABLE.min_coverage) && is_within("bad2", USABLE.max_bad)
            }
            TruthLevel::Courses => {
                let mut drives = self.drives.iter();
                let own = drives.find(|d| d.algorithm == algorithm.algorithm);
                own.is_some_and(|own| own.has_driven)
            }
            TruthLevel::NoTruth => true,
        }
    }

    /// False if few near obstacles are found: unknown ones are not missed, either.
    fn sees_near_obstacles(&self, algorithm: &AlgorithmSummary) -> bool {
        let found = Metric::find("found").and_then(|metric| algorithm.value(metric));
        found.is_none_or(|found| found >= MIN_FOUND)
    }

    /// [`Self::is_usable`] in words.
    fn usable_words(&self) -> String {
        let percent = |share: f64| 100.0 * share;
        match self.kind() {
            TruthLevel::Disparities => format!(
                "at most {:.0} % pixels off > 2 px and at least {:.0} % coverage",
                percent(USABLE.max_bad),
                percent(USABLE.min_coverage)
            ),
            TruthLevel::Courses => format!(
                "at least {:.0} % of the courses' length driven",
                percent(MIN_DRIVEN)
            ),
            _ => {
                let prior = match self.basis.prior_test {
                    PriorTest::Tested => ", and more right minus wrong cells than the prior",
                    _ => "",
                };
                format!(
                    "at most {:.0} % wrong and at least {:.0} % right cells{prior}",
                    percent(USABLE.max_wrong),
                    percent(USABLE.min_right)
                )
            }
        }
    }

    /// The answer in a sentence, and the meanings of the marks; none for a single algorithm, whose
    /// row suffices.
    pub fn answer(&self) -> Vec<String> {
        if self.algorithms.iter().filter(|a| a.pairs > 0).count() < 2 {
            return Vec::new();
        }
        if self.best.is_empty() {
            let none = !self.algorithms.iter().any(|a| self.is_usable(a));
            let words = format!(
                "No algorithm has {}, so none is called best.",
                self.usable_words()
            );
            return Vec::from_iter(none.then_some(words));
        }
        let mut names: Vec<(&str, Vec<&str>)> = Vec::new();
        for best in &self.best {
            let own = names.iter_mut().find(|(name, _)| *name == best.algorithm);
            match own {
                Some((_, metrics)) => metrics.push(best.metric.name),
                None => names.push((&best.algorithm, vec![best.metric.name])),
            }
        }
        let names = names
            .iter()
            .map(|(name, metrics)| format!("{name} by {}", joined(metrics.iter())));
        let names = names.collect::<Vec<_>>().join("; ");
        let shown = self.shown.columns.metrics(self.kind());
        let marked = self.best.iter().filter(|best| shown.contains(&best.metric));
        let others = marked.flat_map(|best| &best.others);
        let certainties: BTreeSet<_> = others.map(|other| other.certainty).collect();
        let items = if self.kind() == TruthLevel::Courses {
            "courses"
        } else {
            "pairs"
        };
        let marks = certainties.iter().filter_map(|certainty| match certainty {
            Certainty::Clear => None,
            Certainty::NoDifference => Some(" = not told apart from the best.".to_owned()),
            Certainty::TooFew => Some(format!(" ? too few {items} to tell.")),
        });
        let marks: String = marks.collect();
        let mut sentences = vec![format!("{BEST} best: {names}.{marks}")];
        if self.kind() != TruthLevel::NoTruth {
            let usable = self.usable_words();
            let of_missed = self.best.iter().any(|best| best.metric.name == "missed");
            let found = of_missed.then(|| format!("; by missed if they find {MIN_FOUND_WORDS}"));
            let found = found.unwrap_or_default();
            sentences.push(format!(
                "Only algorithms with {usable} are called best{found}."
            ));
        }
        if self.basis.prior_test == PriorTest::TooFewPairs {
            sentences.push("Too few pairs to tell if they beat the prior.".to_owned());
        }
        sentences
    }
}

fn certainty(interval: Option<Interval>) -> Certainty {
    match interval {
        None => Certainty::TooFew,
        Some((low, high)) if low > 0.0 || high < 0.0 => Certainty::Clear,
        Some(_) => Certainty::NoDifference,
    }
}

/// The difference of a metric of frames over the pairs that both algorithms have.
fn pair_certainty(metric: &Metric, labels: [&str; 2], rows: &RowsByAlgorithm<'_>) -> Certainty {
    let [Some(best), Some(second)] = labels.map(|label| rows.get(label)) else {
        return Certainty::TooFew;
    };
    let both = best
        .iter()
        .filter_map(|(key, row)| Some((*row, *second.get(key)?)));
    let (best, second): (Vec<_>, Vec<_>) = both.unzip();
    let samples = [&best, &second].map(|rows| sample(metric, rows));
    let [Some(a), Some(b)] = samples else {
        return Certainty::TooFew;
    };
    let interval = Sample::interval_between(&a, &b, |a, b| b - a, &resamples(&best));
    certainty(interval)
}

/// The difference of a number of drives over the courses that both algorithms have.
fn course_certainty(metric: &Metric, labels: [&str; 2], rows: &[DriveRow]) -> Certainty {
    let samples = labels.map(|label| drives::sample(metric, label, rows));
    let [Some(a), Some(b)] = samples else {
        return Certainty::TooFew;
    };
    if a.items() != b.items() {
        return Certainty::TooFew;
    }
    let resamples = Resamples::draw(&[a.items()], true);
    let interval = Sample::interval_between(&a, &b, |a, b| b - a, &resamples);
    certainty(interval)
}
