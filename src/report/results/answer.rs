//! The answer of a report: the best algorithm by the headline metrics and by time, and those that
//! are not told apart from it.

use super::best::{BEST, Best, Certainty, Other, PriorTest};
use super::choice::better_first;
use super::summary::{AlgorithmSummary, Results};
use crate::rows::records::Row;
use crate::rows::samples::{RunKey, grouped, resamples, run_key, sample};
use crate::show::words::ms;
use crate::subjects::drives::{self, DriveRow, MIN_DRIVEN};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use svl_core::joined;
use svl_score::bootstrap::{METHOD, Resamples, Sample, difference_interval};
use svl_score::judge::{Metric, TruthLevel};

/// Limits of an algorithm that may be called best, as fractions: of cells where distances are
/// scored, of pixels where disparities are. An algorithm that answers nothing misses nothing, so
/// right cells and coverage have limits, too.
pub(crate) struct Usable {
    /// Largest fraction of wrong cells.
    pub(crate) max_wrong: f64,
    /// Smallest fraction of right cells.
    min_right: f64,
    /// Largest fraction of pixels off by more than 2 px.
    max_bad: f64,
    /// Smallest fraction of pixels with a disparity.
    min_coverage: f64,
}

pub(crate) const USABLE: Usable = Usable {
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
pub(crate) fn answer_metrics(kind: TruthLevel) -> Vec<&'static Metric> {
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
    pub(crate) fn find_best(&mut self, rows: &[Row], drives: &[DriveRow]) {
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
        let ranked = self.ranked_algorithms();
        let is_driven = self.kind() == TruthLevel::Courses;
        let is_compared = |a: &&&AlgorithmSummary| {
            let sees = metric.name != "missed" || self.sees_near_obstacles(a);
            // A robot that finishes nothing may be ahead of one that does.
            let counts = self.is_usable(a) || self.has_driven(a);
            self.is_candidate(a) && counts && value(a).is_some() && sees
        };
        let mut usable: Vec<_> = ranked.iter().filter(is_compared).collect();
        // Stable: the first of equal ones is the best.
        usable.sort_by(|a, b| better_first(metric, value(a), value(b)));
        let labels: Vec<_> = usable.iter().map(|a| a.algorithm.as_str()).collect();
        let draws = if is_driven {
            course_draws(metric, &labels, drives)
        } else {
            pair_draws(metric, &labels, rows)
        };
        let (best, others) = draws.split_first()?;
        let certainties = others.iter().map(|other| certainty(best, other));
        let is_ahead = certainties.clone().all(|own| own == Certainty::Clear);
        if is_driven && !(is_ahead && labels.len() > 1 && self.is_usable(usable[0])) {
            return None;
        }
        let is_excluded = |a: &&&AlgorithmSummary| {
            let has_value = self.value(&a.algorithm, metric, None).is_some();
            has_value && (self.has_failed(a) || !self.is_believable(a, metric))
        };
        let excluded = ranked.iter().filter(|a| !self.is_reference(a));
        let excluded = excluded.filter(is_excluded);
        let excluded = excluded.map(|a| (a.algorithm.as_str(), Certainty::NotComparable));
        let others = labels[1..].iter().copied().zip(certainties).chain(excluded);
        let other = |(label, certainty): (&str, Certainty)| Other {
            algorithm: label.to_owned(),
            certainty,
        };
        Some(Best {
            metric,
            area: self.area_of(metric),
            algorithm: labels[0].to_owned(),
            value: value(usable[0])?,
            others: others.map(other).collect(),
        })
    }

    /// True for few wrong cells, some right ones and more than the prior has; for some pixels with
    /// a disparity; for a finished course. No other algorithm is called best.
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
                self.has_driven(algorithm) && share("finished").is_some_and(|share| share > 0.0)
            }
            TruthLevel::NoTruth => true,
        }
    }

    /// False for too little of the courses: a robot that stands hits nothing.
    pub(crate) fn has_driven(&self, algorithm: &AlgorithmSummary) -> bool {
        let mut drives = self.drives.iter();
        drives.any(|own| own.algorithm == algorithm.algorithm && own.has_driven)
    }

    /// False if few near obstacles are found: unknown ones are not missed, either.
    fn sees_near_obstacles(&self, algorithm: &AlgorithmSummary) -> bool {
        let found = Metric::find("found").and_then(|metric| algorithm.value(metric));
        found.is_none_or(|found| found >= MIN_FOUND)
    }

    /// [`Self::is_usable`] in words.
    fn usable_words(&self) -> String {
        let [wrong, right] = [USABLE.max_wrong, USABLE.min_right].map(|share| 100.0 * share);
        let [bad, coverage] = [USABLE.max_bad, USABLE.min_coverage].map(|share| 100.0 * share);
        let (driven, courses) = (100.0 * MIN_DRIVEN, METHOD.fewest_blocks);
        match self.kind() {
            TruthLevel::Disparities => {
                format!(
                    "at most {bad:.0} % pixels off > 2 px and at least {coverage:.0} % coverage"
                )
            }
            TruthLevel::Courses => format!(
                "a finished course, at least {driven:.0} % of the courses' length driven, and a \
                 difference from every other one beyond its 95 % interval over {courses} courses \
                 or more"
            ),
            _ => {
                let prior = match self.basis.prior_test {
                    PriorTest::Tested => ", and more right minus wrong cells than the prior",
                    _ => "",
                };
                format!("at most {wrong:.0} % wrong and at least {right:.0} % right cells{prior}")
            }
        }
    }

    /// The answer in a sentence, and the meanings of the marks; none for a single algorithm, whose
    /// row suffices.
    pub fn answer(&self) -> Vec<String> {
        if self.algorithms.iter().filter(|a| a.pairs > 0).count() < 2 {
            return Vec::new();
        }
        let order = self.shown.sort.and_then(|_| self.order_words());
        let order = order.map(|words| format!("The algorithms are {words}."));
        if self.best.is_empty() {
            let none = match self.kind() {
                TruthLevel::Courses => self.candidate_labels().len() > 1,
                _ => !self.algorithms.iter().any(|a| self.is_usable(a)),
            };
            let words = format!(
                "No algorithm has {}, so none is called best.",
                self.usable_words()
            );
            return none.then_some(words).into_iter().chain(order).collect();
        }
        let best: Vec<_> = self.best.iter().collect();
        let names = |own: &[&Best]| {
            let by = joined(own.iter().map(|best| best.metric.name));
            format!("{} by {by}", own[0].algorithm)
        };
        let names = grouped(&best, |best| &best.algorithm, names).join("; ");
        let shown = self.shown.columns.metrics(self.kind());
        let marked = self.best.iter().filter(|best| shown.contains(&best.metric));
        let others = marked.flat_map(|best| &best.others);
        let certainties: BTreeSet<_> = others.map(|other| other.certainty).collect();
        let marks = certainties.iter().map(|certainty| match certainty {
            Certainty::Clear => "",
            Certainty::NotToldApart => " = not told apart from the best.",
            Certainty::TooFew => " ? too few pairs to tell.",
            Certainty::NotComparable => {
                " ! not comparable: failed on pairs, or answers far later than it reports."
            }
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
        sentences.extend(order);
        sentences.extend(self.time_words());
        sentences.extend(self.choice_words());
        sentences
    }
}

impl Results {
    /// Times that are not told apart although they are far from each other, with the reason.
    fn time_words(&self) -> Option<String> {
        let best = self.best.iter().find(|best| best.metric.name == "time")?;
        let untold = best.others.iter();
        let untold = untold.filter(|other| other.certainty == Certainty::NotToldApart);
        let labels = [&best.algorithm]
            .into_iter()
            .chain(untold.map(|other| &other.algorithm));
        let own = labels.filter_map(|label| Some((label, self.value(label, best.metric, None)?)));
        let own: Vec<_> = own.collect();
        let is_far = own.iter().any(|(_, ms)| *ms > MAX_ALIKE * best.value);
        let busy = if self.is_disturbed() {
            "; the machine was busy"
        } else {
            ""
        };
        is_far.then(|| {
            let names = joined(own.iter().map(|(label, _)| label));
            let times = joined(own.iter().map(|(_, time)| ms(*time)));
            format!("By time {names} are not told apart ({times} ms{busy}).")
        })
    }
}

/// Times that differ by more than this factor do not look alike.
const MAX_ALIKE: f64 = 1.2;

/// The values of a metric in resamples; none for too few items.
type Draws = Option<Vec<f64>>;

/// The certainty of the difference of an algorithm from the best.
fn certainty(best: &Draws, other: &Draws) -> Certainty {
    let both = best.as_ref().zip(other.as_ref());
    match both.and_then(|(best, other)| difference_interval(best, other)) {
        None => Certainty::TooFew,
        Some((low, high)) if low > 0.0 || high < 0.0 => Certainty::Clear,
        Some(_) => Certainty::NotToldApart,
    }
}

/// A metric of frames in resamples of the pairs that all these algorithms have.
fn pair_draws(metric: &Metric, labels: &[&str], rows: &RowsByAlgorithm<'_>) -> Vec<Draws> {
    let all: Vec<_> = labels.iter().filter_map(|label| rows.get(label)).collect();
    let keys = all.first().into_iter().flat_map(|own| own.keys());
    let common = keys.filter(|key| all.iter().all(|own| own.contains_key(key)));
    let common: Vec<_> = common.collect();
    let rows_of = |label: &&str| -> Option<Vec<&Row>> {
        let own = rows.get(label)?;
        Some(common.iter().map(|key| own[key]).collect())
    };
    let first = labels.first().and_then(rows_of).unwrap_or_default();
    let resamples = resamples(&first);
    let draws = |label: &&str| sample(metric, &rows_of(label)?)?.draws(&resamples);
    labels.par_iter().map(draws).collect()
}

/// A number of drives in resamples of the courses.
fn course_draws(metric: &Metric, labels: &[&str], rows: &[DriveRow]) -> Vec<Draws> {
    let samples = labels.iter();
    let samples = samples.map(|label| drives::sample(metric, label, rows));
    let samples: Vec<_> = samples.collect();
    let courses = samples.first();
    let courses = courses.map(|own| own.as_ref().map_or(0, Sample::items));
    let courses = courses.unwrap_or_default();
    let resamples = Resamples::draw(&[courses], true);
    let samples = samples.iter();
    let samples = samples.map(|own| own.as_ref().filter(|own| own.items() == courses));
    samples.map(|own| own?.draws(&resamples)).collect()
}
