//! The answer of a run: the best algorithm by the headline metrics, its significance, and the
//! fastest one with its cost.

use super::choice::better_first;
use super::drives::{self, DriveRow, MIN_DRIVEN};
use super::lead::{Certainty, Lead, PriorTest, RunnerUp};
use super::results::{AlgorithmSummary, Results};
use super::rows::Row;
use super::samples::{resamples, run_key, sample};
use super::words::value;
use std::collections::BTreeMap;
use svl_score::bootstrap::{Interval, Resamples, Sample};
use svl_score::judge::{Better, Metric, MetricUnit, TruthLevel};

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
    /// Finds the best algorithms. `rows` and `drives`: those that the summary is of.
    pub(super) fn find_leads(&mut self, rows: &[Row], drives: &[DriveRow]) {
        let rows: Vec<_> = rows.iter().filter(|row| row.stress.is_none()).collect();
        let lead = |metric| self.lead(metric, &rows, drives);
        let metrics = answer_metrics(self.kind()).into_iter();
        let leads: Vec<_> = metrics.filter_map(lead).collect();
        let fastest = leads
            .first()
            .and_then(|first| self.fastest(&first.algorithm, &rows));
        self.leads = leads.into_iter().chain(fastest).collect();
    }

    fn lead(&self, metric: &'static Metric, rows: &[&Row], drives: &[DriveRow]) -> Option<Lead> {
        let value = |a: &AlgorithmSummary| self.value(&a.algorithm, metric, None);
        // The best of all is the first of equal ones.
        let mut ranked = self.ranked_algorithms();
        ranked.retain(|a| self.is_candidate(a) && value(a).is_some());
        let is_blind =
            |a: &AlgorithmSummary| metric.name == "missed" && !self.sees_near_obstacles(a);
        let blind: Vec<_> = ranked.extract_if(.., |a| is_blind(a)).collect();
        ranked.sort_by(|a, b| better_first(metric, value(a), value(b)));
        let place = ranked.iter().position(|a| self.is_usable(a))?;
        let best = ranked[place];
        // Beside the best of the usable stands the next usable one.
        let mut others = ranked[place + 1..].iter();
        let is_shown = place == 0 && self.kind() != TruthLevel::Courses;
        let second = others.find(|a| is_shown || self.is_usable(a));
        let second = second.and_then(|second| {
            let labels = [best, second].map(|a| a.algorithm.as_str());
            let certainty = match self.kind() {
                TruthLevel::Courses => course_certainty(metric, labels, drives),
                _ => pair_certainty(metric, labels, rows),
            };
            Some(RunnerUp {
                algorithm: second.algorithm.clone(),
                value: value(second)?,
                certainty,
            })
        });
        let second_value = second.as_ref().map(|second| second.value);
        Some(Lead {
            metric,
            area: self.area_of(metric),
            algorithm: best.algorithm.clone(),
            value: value(best)?,
            is_outdone: place > 0,
            is_of_seeing: blind
                .iter()
                .any(|a| second_value.is_some() && value(a) <= second_value),
            second,
        })
    }

    /// The fastest of the algorithms that may be called best. Its second is the best one, or, if
    /// it is that itself, the next fastest. None for drives: each runs beside others, and their
    /// pairs differ.
    fn fastest(&self, best: &str, rows: &[&Row]) -> Option<Lead> {
        let is_compared = self.kind() != TruthLevel::Courses && self.has_comparable_times();
        let metric = Metric::find("time").filter(|_| is_compared)?;
        let median_ms = |a: &AlgorithmSummary| self.ranked(a, metric);
        let candidates = || self.algorithms.iter().filter(|a| self.is_candidate(a));
        let usable = candidates().filter(|a| self.is_usable(a));
        let mut timed: Vec<_> = usable.filter_map(|a| Some((median_ms(a)?, a))).collect();
        timed.sort_by(|a, b| a.0.total_cmp(&b.0));
        let &(value, fastest) = timed.first()?;
        let own = *timed.iter().find(|(_, a)| a.algorithm == best)?;
        let is_best = fastest.algorithm == best;
        let second = if is_best {
            timed.get(1).copied()
        } else {
            Some(own)
        };
        let certainty = |(_, a): (f64, &AlgorithmSummary)| {
            pair_certainty(metric, [&fastest.algorithm, &a.algorithm], rows)
        };
        let certainty = second.map(certainty);
        // Without a difference the best one is named, whichever happened to be faster.
        let is_equal = certainty == Some(Certainty::NoDifference) && !is_best;
        let (lead, second) = if is_equal {
            (own, Some((value, fastest)))
        } else {
            ((value, fastest), second)
        };
        let second = second
            .zip(certainty)
            .map(|((value, a), certainty)| RunnerUp {
                algorithm: a.algorithm.clone(),
                value,
                certainty,
            });
        Some(Lead {
            metric,
            area: None,
            algorithm: lead.1.algorithm.clone(),
            value: lead.0,
            is_outdone: candidates().any(|a| median_ms(a).is_some_and(|ms| ms < value)),
            is_of_seeing: false,
            second,
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

    /// The answer in one or two sentences; none for a single algorithm, whose row suffices.
    pub fn answer(&self) -> Vec<String> {
        if self.algorithms.iter().filter(|a| a.pairs > 0).count() < 2 {
            return Vec::new();
        }
        if self.leads.is_empty() {
            let none = !self.algorithms.iter().any(|a| self.is_usable(a));
            let words = format!(
                "No algorithm has {}, so none is called best.",
                self.usable_words()
            );
            return Vec::from_iter(none.then_some(words));
        }
        let mut sentences: Vec<(&str, Vec<String>)> = Vec::new();
        let is_time = |lead: &&Lead| lead.metric.unit == MetricUnit::Ms;
        for lead in self.leads.iter().filter(|lead| !is_time(lead)) {
            let words = self.lead_words(lead);
            match sentences
                .iter_mut()
                .find(|(algorithm, _)| *algorithm == lead.algorithm)
            {
                Some((_, parts)) => parts.push(words),
                None => sentences.push((&lead.algorithm, vec![words])),
            }
        }
        let sentence = |(algorithm, parts): (&str, Vec<String>)| {
            let last = parts.len() - 1;
            let listed = match last {
                0 => parts[0].clone(),
                _ => format!("{} and {}", parts[..last].join(", "), parts[last]),
            };
            format!("{algorithm} has {listed}.")
        };
        let sentences = sentences.into_iter().map(sentence);
        let fastest = self.leads.iter().find(is_time);
        let fastest = fastest.and_then(|lead| self.speed_words(lead));
        let passes = self.checkpoint_words();
        let is_outdone = self.leads.iter().any(|lead| lead.is_outdone);
        let usable = is_outdone.then(|| format!("Usable: {}.", self.usable_words()));
        let untold = (self.basis.prior_test == PriorTest::TooFewPairs)
            .then(|| "Too few pairs to tell if they beat the prior.".to_owned());
        let all = sentences
            .chain(passes)
            .chain(fastest)
            .chain(usable)
            .chain(untold);
        all.collect()
    }

    /// The usable algorithm that passes the most frames of checkpoints, if the first one is not.
    fn checkpoint_words(&self) -> Option<String> {
        let metric = Metric::find("passed")?;
        let passed = |label: &str| self.value(label, metric, None);
        let first = &self.leads.first()?.algorithm;
        let own = passed(first)?;
        let mut ranked = self.ranked_algorithms();
        ranked.retain(|a| self.is_candidate(a) && self.is_usable(a));
        ranked.sort_by(|a, b| better_first(metric, passed(&a.algorithm), passed(&b.algorithm)));
        let best = &ranked.first()?.algorithm;
        passed(best).filter(|most| *most > own)?;
        let [(most, frames), (own, _)] = [best, first].map(|label| self.passes(label, None));
        let words = "passes more checkpoint frames";
        Some(format!(
            "{best} {words} ({most} of {frames}, {first} {own})."
        ))
    }

    /// The fastest algorithm with its cost, in words.
    fn speed_words(&self, fastest: &Lead) -> Option<String> {
        let name = &fastest.algorithm;
        let usable = if fastest.is_outdone {
            " of the usable ones"
        } else {
            ""
        };
        let sizes = match self.basis.scope.sizes.len() {
            0 | 1 => String::new(),
            count => format!(", the median over {count} sizes"),
        };
        let time = format!("{} per pair{sizes}", value(fastest.metric, fastest.value));
        let second = fastest.second.as_ref();
        let second_words =
            second.map_or_else(String::new, |s| self.second_words(fastest.metric, s));
        let fast = if second.is_some_and(|s| s.certainty == Certainty::NoDifference) {
            "among the fastest"
        } else {
            "the fastest"
        };
        let first = self.leads.first()?;
        if first.algorithm == *name {
            return Some(format!(
                "{name} is also {fast}{usable} ({time}{second_words})."
            ));
        }
        let best = &first.algorithm;
        let own = |metric| Some(value(metric, self.value(name, metric, None)?));
        let cost = format!("{} {}", own(first.metric)?, self.words(first.metric));
        let most = self.coverage_words(name, best);
        Some(format!(
            "{name} is {fast}{usable} ({time}{second_words}), with {cost}{most}."
        ))
    }

    /// The coverage of two algorithms, where errors are of the estimated pixels alone.
    fn coverage_words(&self, name: &str, other: &str) -> String {
        let metric = Metric::find("coverage").filter(|_| self.kind() == TruthLevel::Disparities);
        let words = |metric| {
            let [own, others] = [name, other].map(|label| self.value(label, metric, None));
            let (own, others) = (value(metric, own?), value(metric, others?));
            Some(format!(" and {own} {} ({other} {others})", metric.words))
        };
        metric.and_then(words).unwrap_or_default()
    }

    /// The second best behind the value of the best.
    fn second_words(&self, metric: &Metric, second: &RunnerUp) -> String {
        let certainty = match second.certainty.words() {
            "" => String::new(),
            words => format!(": {words}"),
        };
        let label = &second.algorithm;
        let value = self.value_words(metric, label, second.value);
        format!(", {label} {value}{certainty}")
    }

    /// The words of a lead after the name of its algorithm and "has".
    fn lead_words(&self, lead: &Lead) -> String {
        let most = match lead.metric.better {
            Better::Less => "the fewest",
            _ => "the most",
        };
        let second = lead.second.as_ref();
        let value = self.value_words(lead.metric, &lead.algorithm, lead.value);
        let second = second.map_or_else(String::new, |s| {
            if self.value_words(lead.metric, &s.algorithm, s.value) == value {
                format!(", {} the same", s.algorithm)
            } else {
                self.second_words(lead.metric, s)
            }
        });
        let usable = if lead.is_outdone {
            " of the usable"
        } else {
            ""
        };
        let seeing = if lead.is_of_seeing {
            format!(" of those that find {:.0} %", 100.0 * MIN_FOUND)
        } else {
            String::new()
        };
        format!(
            "{most} {}{usable}{seeing} ({value}{second})",
            self.words(lead.metric)
        )
    }

    /// A value in a sentence. An algorithm that reports little misses little, so a number of missed
    /// obstacles has the fraction of found ones with it.
    fn value_words(&self, metric: &Metric, label: &str, number: f64) -> String {
        let found = Metric::find("found").filter(|_| metric.name == "missed");
        let found = found.and_then(|found| {
            let share = self.value(label, found, None)?;
            Some(format!(" with {} found", value(found, share)))
        });
        value(metric, number) + &found.unwrap_or_default()
    }
}

fn certainty(interval: Option<Interval>, too_few: Certainty) -> Certainty {
    match interval {
        None => too_few,
        Some((low, high)) if low > 0.0 || high < 0.0 => Certainty::Clear,
        Some(_) => Certainty::NoDifference,
    }
}

/// The difference of a metric of frames over the pairs that both algorithms have.
fn pair_certainty(metric: &Metric, labels: [&str; 2], rows: &[&Row]) -> Certainty {
    let [best, second] = labels.map(|label| {
        let own = rows.iter().filter(|row| row.algorithm == label);
        let keyed = own.map(|row| ((run_key(row), row.sequence, row.name.as_str()), *row));
        keyed.collect::<BTreeMap<_, _>>()
    });
    let both = best
        .iter()
        .filter_map(|(key, row)| Some((*row, *second.get(key)?)));
    let (best, second): (Vec<_>, Vec<_>) = both.unzip();
    let samples = [&best, &second].map(|rows| sample(metric, rows));
    let [Some(a), Some(b)] = samples else {
        return Certainty::TooFewPairs;
    };
    let interval = Sample::interval_between(&a, &b, |a, b| b - a, &resamples(&best));
    certainty(interval, Certainty::TooFewPairs)
}

/// The difference of a number of drives over the courses that both algorithms have.
fn course_certainty(metric: &Metric, labels: [&str; 2], rows: &[DriveRow]) -> Certainty {
    let samples = labels.map(|label| drives::sample(metric, label, rows));
    let [Some(a), Some(b)] = samples else {
        return Certainty::TooFewCourses;
    };
    if a.items() != b.items() {
        return Certainty::TooFewCourses;
    }
    let resamples = Resamples::draw(&[a.items()], true);
    let interval = Sample::interval_between(&a, &b, |a, b| b - a, &resamples);
    certainty(interval, Certainty::TooFewCourses)
}
