//! The answer of a run: which algorithm is best by the headline metrics, how surely, and which is
//! faster at what cost.

use super::choice::better_first;
use super::drives::{self, DriveRow};
use super::lead::{Certainty, Lead, RunnerUp};
use super::rows::Row;
use super::samples::{resamples, run_key, sample};
use super::summary::{AlgorithmSummary, Summary};
use super::words::value;
use std::collections::BTreeMap;
use svl_data::bootstrap::{Interval, Resamples, Sample};
use svl_data::score::{Better, Metric, RunKind};

/// Share of wrong cells above which an algorithm is not called best by anything.
pub(super) const MOST_WRONG: f64 = 0.1;

/// The metrics by which algorithms are called best.
fn answer_metrics(kind: RunKind) -> Vec<&'static Metric> {
    let names: &[&str] = match kind {
        RunKind::Distances => &["right", "wrong", "missed25"],
        RunKind::Disparities => &["bad2"],
        RunKind::Courses => &["finished", "collisions"],
        RunKind::NoTruth => &["unrivalled", "agreed"],
    };
    names.iter().filter_map(|name| Metric::find(name)).collect()
}

impl Summary {
    /// Finds the best algorithms. `rows` and `drives`: those that the summary is of.
    pub fn find_leads(&mut self, rows: &[Row], drives: &[DriveRow]) {
        let rows: Vec<_> = rows.iter().filter(|row| row.stress.is_none()).collect();
        let lead = |metric| self.lead(metric, &rows, drives);
        self.leads = answer_metrics(self.kind())
            .into_iter()
            .filter_map(lead)
            .collect();
    }

    fn lead(&self, metric: &'static Metric, rows: &[&Row], drives: &[DriveRow]) -> Option<Lead> {
        let value = |a: &AlgorithmSummary| self.value(&a.algorithm, metric, None);
        // The best of all is the first of equal ones.
        let candidates = self.candidates();
        let mut ranked = self.ranked_algorithms();
        ranked.retain(|a| candidates.contains(a) && value(a).is_some());
        ranked.sort_by(|a, b| better_first(metric, value(a), value(b)));
        let trusted = self.trusted();
        let is_trusted = |a: &&AlgorithmSummary| trusted.iter().any(|t| t.algorithm == a.algorithm);
        let place = ranked.iter().position(is_trusted)?;
        let best = ranked[place];
        let second = ranked.get(place + 1).and_then(|second| {
            let labels = [best, second].map(|a| a.algorithm.as_str());
            let certainty = match self.kind() {
                RunKind::Courses => of_courses(metric, labels, drives),
                _ => of_pairs(metric, labels, rows),
            };
            Some(RunnerUp {
                algorithm: second.algorithm.clone(),
                value: value(second)?,
                certainty,
            })
        });
        Some(Lead {
            metric,
            algorithm: best.algorithm.clone(),
            value: value(best)?,
            is_outdone: place > 0,
            second,
        })
    }

    /// The algorithms that may be called best: those with a result of every pair and few wrong
    /// cells.
    fn trusted(&self) -> Vec<&AlgorithmSummary> {
        let mut trusted = self.candidates();
        let wrong = Metric::find("wrong").filter(|_| self.kind() == RunKind::Distances);
        let share = |a: &AlgorithmSummary| wrong.and_then(|metric| a.value(metric));
        trusted.retain(|a| share(a).is_none_or(|wrong| wrong <= MOST_WRONG));
        trusted
    }

    /// The answer in one or two sentences; none for a single algorithm, whose row says it all.
    pub fn answer(&self) -> Vec<String> {
        if self.algorithms.iter().filter(|a| a.pairs > 0).count() < 2 {
            return Vec::new();
        }
        if self.leads.is_empty() {
            let has_wrong = self.kind() == RunKind::Distances && self.trusted().is_empty();
            let words = "All algorithms have more than 10 % wrong cells, so none is called best.";
            return Vec::from_iter(has_wrong.then(|| words.to_owned()));
        }
        let mut sentences: Vec<(&str, Vec<String>)> = Vec::new();
        for lead in &self.leads {
            let words = words(lead);
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
        sentences.chain(self.speed_answer()).collect()
    }

    /// Which algorithm is faster than the best one, and at what cost.
    fn speed_answer(&self) -> Option<String> {
        let (time, first) = (Metric::find("time")?, self.leads.first()?);
        let of = |label: &str| self.algorithms.iter().find(|a| a.algorithm == label);
        let best = of(&first.algorithm)?;
        let own = self.ranked(best, time)?;
        let trusted = self.trusted();
        let timed = trusted
            .iter()
            .filter_map(|a| Some((self.ranked(a, time)?, *a)));
        let (fastest_ms, fastest) = timed.min_by(|a, b| a.0.total_cmp(&b.0))?;
        if self.kind() == RunKind::Courses {
            return None;
        }
        let [fastest_time, own_time] = [fastest_ms, own].map(|ms| value(time, ms));
        Some(if fastest.algorithm == best.algorithm {
            format!("It is also the fastest ({own_time} per pair).")
        } else {
            let cost = self.value(&fastest.algorithm, first.metric, None)?;
            let cost = value(first.metric, cost);
            format!(
                "{} is the fastest ({fastest_time} per pair, {} {own_time}), with {cost} {}.",
                fastest.algorithm, best.algorithm, first.metric.words
            )
        })
    }
}

/// A lead behind the name of its algorithm and "has".
fn words(lead: &Lead) -> String {
    let most = match lead.metric.better {
        Better::Less => "the fewest",
        _ => "the most",
    };
    let second = lead.second.as_ref().map(|second| {
        let certainty = second.certainty.words();
        let certainty = if certainty.is_empty() {
            String::new()
        } else {
            format!(": {certainty}")
        };
        let value = value(lead.metric, second.value);
        format!(", {} {value}{certainty}", second.algorithm)
    });
    let value = value(lead.metric, lead.value);
    format!(
        "{most} {} ({value}{})",
        lead.metric.words,
        second.unwrap_or_default()
    )
}

fn certainty(interval: Option<Interval>, too_few: Certainty) -> Certainty {
    match interval {
        None => too_few,
        Some((low, high)) if low > 0.0 || high < 0.0 => Certainty::Clear,
        Some(_) => Certainty::NoDifference,
    }
}

/// The difference of a metric of frames over the pairs that both algorithms have.
fn of_pairs(metric: &Metric, labels: [&str; 2], rows: &[&Row]) -> Certainty {
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
fn of_courses(metric: &Metric, labels: [&str; 2], rows: &[DriveRow]) -> Certainty {
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
