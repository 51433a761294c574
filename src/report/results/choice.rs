//! Which algorithms may be best, which is by each headline metric, and which are told apart from
//! it.

use super::best::{Best, Certainty, Other, RowsByAlgorithm, Unfit};
use super::change::{Change, Judgement, changes, verdict};
use super::summary::{AlgorithmSummary, Results};
use crate::rows::held::RowRef;
use crate::rows::samples::{paired, runs};
use crate::subjects::drives::{self, DriveRow};
use crate::subjects::references::PRIOR;
use std::cmp::Ordering;
use svl_score::bootstrap::{METHOD, RunLengths, Sample};
use svl_score::judge::{AreaChoice, Better, Metric, MetricSource as _, TruthLevel};

/// The largest per cent of wrong cells of an algorithm that may be called best.
pub(crate) const MAX_WRONG: u32 = 10;

/// The limits of an algorithm that may be called best: of cells where distances are scored, of
/// pixels where disparities are. An algorithm that answers nothing misses nothing, so right and
/// found cells, and coverage, have limits, too.
const LIMITS: [(TruthLevel, Unfit); 5] = [
    (TruthLevel::Distances, Unfit::Over("wrong", MAX_WRONG)),
    (TruthLevel::Distances, Unfit::Under("right", 10)),
    (TruthLevel::Distances, Unfit::Under("found", 50)),
    (TruthLevel::Disparities, Unfit::Over("bad2", 20)),
    (TruthLevel::Disparities, Unfit::Under("coverage", 10)),
];
/// Fewest near obstacles of which a part has to be found.
const MIN_NEAR: f64 = 10.0;
/// Least part of the most right cells: one that answers easy cells alone is wrong in none.
const MIN_RIGHT: f64 = 0.5;
/// Least difference of estimated right cells by which algorithms are in the right order.
pub(crate) const MIN_AHEAD: f64 = 0.03;
/// Fraction of right cells from which on the prior is no test: the scene hardly changes.
const MAX_PRIOR: f64 = 0.8;

/// The metrics by which algorithms are called best.
pub(crate) fn answer_metrics(kind: TruthLevel) -> Vec<&'static Metric> {
    let names: &[&str] = match kind {
        TruthLevel::Distances => &["right", "wrong", "missed"],
        TruthLevel::Disparities => &["total_bad2"],
        TruthLevel::Courses => &["finished", "collisions"],
        TruthLevel::NoTruth => &["estimated_right"],
    };
    names.iter().filter_map(|name| Metric::find(name)).collect()
}

/// Right minus wrong cells of an area, of the scored ones.
pub(crate) fn merit_sample(rows: &[RowRef<'_>], area: AreaChoice) -> Sample {
    let parts = |row: &RowRef<'_>| {
        let value = |name| row.metrics().get_in(name, area);
        let [right, wrong, unknown] = ["right", "wrong", "unknown"].map(value);
        let counts = right.zip(wrong).zip(unknown);
        counts.map_or([0.0; 2], |((right, wrong), unknown)| {
            [right - wrong, right + wrong + unknown]
        })
    };
    Sample::Ratio(rows.iter().map(parts).collect())
}

/// The change of right minus wrong cells of an area from rows to others of the same pairs.
fn merit_change([base, other]: [&[RowRef<'_>]; 2], area: AreaChoice) -> Option<Change> {
    let samples = [base, other].map(|rows| merit_sample(rows, area));
    let values = [samples[0].total()?, samples[1].total()?];
    let samples = [&samples[0], &samples[1]];
    Some(Change::from_samples(
        Metric::find("right")?,
        values,
        samples,
        &runs(base),
    ))
}

impl Results {
    /// Finds which algorithms may not be best, then the best of the others. `rows`: all unperturbed
    /// ones of algorithms and references.
    pub(crate) fn find_best(&mut self, rows: &RowsByAlgorithm<'_>, drives: &[DriveRow]) {
        let unfit = self.algorithms.iter();
        let unfit = unfit.filter_map(|a| Some((a.algorithm.clone(), self.unfit(a, rows)?)));
        self.unfit = unfit.collect();
        self.find_easy();
        let kind = self.kind();
        // Drives run beside each other, and their pairs differ.
        let is_timed = kind != TruthLevel::Courses && self.has_comparable_times();
        let time = Metric::find("time").filter(|_| is_timed);
        let metrics = answer_metrics(kind).into_iter().chain(time);
        // Numbers of different pairs cannot be compared.
        let metrics = metrics.filter(|_| !self.is_area_empty() && !self.has_own_pairs());
        let best = metrics.filter_map(|metric| self.best_by(metric, rows, drives));
        self.best = best.collect();
    }

    /// Finds the algorithms that are right in far fewer cells than another one that may be best.
    fn find_easy(&mut self) {
        let right = Metric::find("right").filter(|_| self.kind() == TruthLevel::Distances);
        let area = self.deciding_area();
        let value = |a: &AlgorithmSummary| {
            let right = right?;
            right.value_of(a.totals.measured(right, area)?)
        };
        let fit = self.algorithms.iter().filter(|a| self.may_be_best(a));
        let fit: Vec<_> = fit
            .filter_map(|a| Some((a.algorithm.clone(), value(a)?)))
            .collect();
        let most = fit.iter().map(|own| own.1).fold(0.0, f64::max);
        let easy = fit.into_iter().filter(|own| own.1 < MIN_RIGHT * most);
        let easy = easy.map(|(label, _)| (label, Unfit::Easy));
        self.unfit.extend(easy);
    }

    fn unfit(&self, a: &AlgorithmSummary, rows: &RowsByAlgorithm<'_>) -> Option<Unfit> {
        let kind = self.kind();
        let area = self.deciding_area();
        let value = |name| {
            let metric = Metric::find(name)?;
            metric.value_of(a.totals.measured(metric, area)?)
        };
        let is_tested = |name: &str| name != "found" || value("near") >= Some(MIN_NEAR);
        let percent = |name| {
            value(name)
                .filter(|_| is_tested(name))
                .map(|own| 100.0 * own)
        };
        let is_broken = |(level, limit): &&(TruthLevel, Unfit)| match *limit {
            _ if *level != kind => false,
            Unfit::Over(name, most) => percent(name) > Some(most.into()),
            Unfit::Under(name, least) => percent(name).is_some_and(|own| own < least.into()),
            _ => false,
        };
        let is_driven = kind == TruthLevel::Courses;
        let own = rows.get(&*a.algorithm).filter(|_| !is_driven);
        let is_few = || own.is_some_and(|own| runs(own).blocks() < METHOD.fewest_blocks);
        let is_absent = || {
            let label = a.algorithm.as_str();
            self.basis.common.is_absent(label) || !rows.contains_key(label)
        };
        if self.is_reference(a) || is_driven && !(self.has_driven(a) && a.failed_pairs == 0) {
            Some(Unfit::NotCompared)
        } else if !is_driven && is_absent() {
            Some(Unfit::Absent)
        } else if is_few() {
            Some(Unfit::TooFewPairs)
        } else if let Some((_, limit)) = LIMITS.iter().find(is_broken) {
            Some(*limit)
        } else {
            own.and_then(|own| self.beside_prior(own, rows))
        }
    }

    /// The cells that decide who may be best, whatever area is shown: those of the headline, unless
    /// there is none.
    pub(crate) fn deciding_area(&self) -> AreaChoice {
        let headline = AreaChoice::default();
        match self.most_cells(headline) {
            Some(1..) => headline,
            _ => self.basis.area,
        }
    }

    /// Tests right minus wrong cells against the prior's.
    fn beside_prior(&self, own: &[RowRef<'_>], rows: &RowsByAlgorithm<'_>) -> Option<Unfit> {
        let prior = rows.get(PRIOR).filter(|_| !self.is_still())?;
        let [prior, own] = paired(prior, own);
        let change = merit_change([&prior, &own], self.deciding_area());
        match change.map(|change| change.judgement) {
            Some(Judgement::Better) => None,
            Some(Judgement::TooFew) | None => Some(Unfit::TooFewPairs),
            _ => Some(Unfit::BehindPrior),
        }
    }

    /// True if the prior is right nearly everywhere, so that it is no test.
    pub(crate) fn is_still(&self) -> bool {
        let area = self.deciding_area();
        let right = Metric::find("right");
        let right =
            right.and_then(|right| right.value_of(self.measurement(PRIOR, right, None, area)?));
        right.is_some_and(|right| right >= MAX_PRIOR)
    }

    fn best_by(
        &self,
        metric: &'static Metric,
        rows: &RowsByAlgorithm<'_>,
        drives: &[DriveRow],
    ) -> Option<Best> {
        let value = |a: &AlgorithmSummary| self.ranked(a, metric);
        let ranked = self.ranked_algorithms().into_iter();
        let ranked = ranked.filter(|a| value(a).is_some());
        let mut fit: Vec<_> = ranked.filter(|a| self.may_be_best(a)).collect();
        // Stable: the first of equal ones is the best.
        fit.sort_by(|a, b| better_first(metric, value(a), value(b)));
        let (best, others) = fit.split_first()?;
        let certainties = others.iter().map(|other| {
            let labels = [&*best.algorithm, &*other.algorithm];
            self.certainty(metric, labels, rows, drives)
        });
        let certainties: Vec<_> = certainties.collect();
        let is_lone = others.is_empty() && (metric.name == "time" || self.has_one_algorithm());
        let is_driven = self.kind() == TruthLevel::Courses;
        let is_ahead = || certainties.iter().all(|own| *own == Certainty::Clear);
        let finishes = || {
            let finished = Metric::find("finished").and_then(|finished| best.value(finished));
            finished > Some(0.0)
        };
        if is_lone || is_driven && !(!others.is_empty() && is_ahead() && finishes()) {
            return None;
        }
        let other = |(a, certainty): (&&AlgorithmSummary, Certainty)| Other {
            algorithm: a.algorithm.clone(),
            certainty,
        };
        Some(Best {
            metric,
            area: self.area_of(metric),
            algorithm: best.algorithm.clone(),
            value: value(best)?,
            others: others.iter().zip(certainties).map(other).collect(),
        })
    }

    /// The certainty that the second algorithm is worse than the first.
    fn certainty(
        &self,
        metric: &'static Metric,
        labels: [&str; 2],
        rows: &RowsByAlgorithm<'_>,
        drives: &[DriveRow],
    ) -> Certainty {
        if metric.estimated().is_some() {
            let [best, other] = labels.map(|label| self.value(label, metric, None));
            let is_ahead = best
                .zip(other)
                .is_some_and(|(a, b)| (a - b).abs() >= MIN_AHEAD);
            return if is_ahead {
                Certainty::Clear
            } else {
                Certainty::NotToldApart
            };
        }
        let change = if self.kind() == TruthLevel::Courses {
            course_change(metric, labels, drives)
        } else {
            let own = labels.map(|label| rows.get(label).map_or(&[][..], Vec::as_slice));
            let [base, other] = paired(own[0], own[1]);
            let all = if metric.name == "time" {
                changes(&base, &other, [metric])
            } else {
                verdict(&base, &other)
            };
            all.into_iter().find(|change| change.metric == metric)
        };
        let is_faster = |own: &Change| own.interval.is_some_and(|(low, _)| low > 1.0);
        match change {
            Some(own) if own.judgement == Judgement::Worse => Certainty::Clear,
            Some(own) if metric.name == "time" && is_faster(&own) => Certainty::Clear,
            Some(own) if own.interval.is_some() => Certainty::NotToldApart,
            _ => Certainty::TooFew,
        }
    }

    /// The first algorithm that may be called best, else the first.
    pub(crate) fn cited(&self) -> Option<&str> {
        let ranked = self.ranked_algorithms();
        let fit = ranked.iter().find(|own| self.may_be_best(own));
        fit.or(ranked.first()).map(|own| own.algorithm.as_str())
    }

    /// True for an algorithm that may be called best.
    pub(crate) fn may_be_best(&self, algorithm: &AlgorithmSummary) -> bool {
        !self.unfit.contains_key(&algorithm.algorithm)
    }

    /// True for the truth, and for `blind`.
    pub(crate) fn is_reference(&self, algorithm: &AlgorithmSummary) -> bool {
        let label = &algorithm.algorithm;
        self.basis.perfect.contains(label) || label == "blind"
    }

    /// False for too little of the courses.
    fn has_driven(&self, algorithm: &AlgorithmSummary) -> bool {
        let mut drives = self.drives.iter();
        drives.any(|own| own.algorithm == algorithm.algorithm && own.has_driven)
    }

    /// True if an algorithm answered a pair.
    pub(crate) fn has_answers(&self) -> bool {
        self.algorithms.iter().any(|a| a.pairs > 0)
    }

    pub(crate) fn has_one_algorithm(&self) -> bool {
        self.algorithms.iter().filter(|a| a.pairs > 0).count() < 2
    }

    /// The labels of those that may be called best.
    pub(crate) fn candidate_labels(&self) -> Vec<&str> {
        let own = self.algorithms.iter().filter(|a| self.may_be_best(a));
        own.map(|a| a.algorithm.as_str()).collect()
    }

    /// Sorts the algorithms by a metric, the best first, those without a value last. Of a metric
    /// that has no better direction the largest is first.
    pub(crate) fn sort_by(&mut self, metric: &Metric) {
        // Before they are taken out: values are looked up among them.
        let keyed = self.algorithms.iter().cloned();
        let mut keyed: Vec<_> = keyed.map(|a| (self.ranked(&a, metric), a)).collect();
        keyed.sort_by(|(a, _), (b, _)| better_first(metric, *a, *b));
        self.algorithms = keyed.into_iter().map(|(_, algorithm)| algorithm).collect();
    }

    /// The value by which an algorithm is ranked: none for a time that is not believable, as that
    /// of a program that answers far later than it reports, nor for times that are not comparable.
    pub(crate) fn ranked(&self, algorithm: &AlgorithmSummary, metric: &Metric) -> Option<f64> {
        let label = &algorithm.algorithm;
        let mut programs = self.programs.iter();
        let mut is_doubtful =
            || programs.any(|run| run.algorithm == *label && run.program.is_time_doubtful());
        let is_time = metric.name == "time";
        let is_ranked = !is_time || self.has_comparable_times() && !is_doubtful();
        self.value(label, metric, None).filter(|_| is_ranked)
    }
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

/// The change of a number of drives over the courses of both algorithms.
fn course_change(metric: &'static Metric, labels: [&str; 2], rows: &[DriveRow]) -> Option<Change> {
    let [base, other] = labels.map(|label| drives::sample(metric, label, rows));
    let (base, other) = base.zip(other)?;
    let runs = RunLengths::new(&[base.items()], true);
    let values = [base.total()?, other.total()?];
    (base.items() == other.items())
        .then(|| Change::from_samples(metric, values, [&base, &other], &runs))
}

#[cfg(test)]
mod tests {
    use super::super::summary::{ReportTables, ResultParts, Shown};
    use super::*;
    use crate::rows::held::Row;
    use crate::rows::records::FailureRow;
    use crate::subjects::speed::tests::row;
    use svl_score::judge::MetricValues;

    /// Pairs of one cell each, right where that says so.
    fn rows(label: &str, pairs: u64, is_right: impl Fn(u64) -> bool) -> Vec<Row> {
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
    }

    fn results(algorithms: impl IntoIterator<Item = Vec<Row>>, prior: Vec<Row>) -> Results {
        let tables = ReportTables {
            rows: algorithms.into_iter().flatten().collect(),
            references: prior.into_iter().collect(),
            ..ReportTables::default()
        };
        Results::new(&tables, ResultParts::default(), Shown::default()).unwrap()
    }

    /// The results of an algorithm in as many pairs as the prior's.
    fn tested(pairs: u64, prior: fn(u64) -> bool, own: fn(u64) -> bool) -> Results {
        results([rows("own", pairs, own)], rows(PRIOR, pairs, prior))
    }

    #[test]
    fn numbers_of_different_pairs_make_none_the_best() {
        let is_easy = |i| i < 240;
        let easy = rows("easy", 240, |i| i % 20 != 0);
        let all = rows("all", 400, |i| is_easy(i) || i % 8 != 0);
        let half = rows(PRIOR, 400, |i| i % 2 == 0);
        let results = results([easy, all], half);
        let [easy, all] = ["easy", "all"].map(|label| {
            let right = Metric::find("right").unwrap();
            results.value(label, right, None).unwrap()
        });
        assert!(results.has_own_pairs() && easy == 0.95 && all == 0.95);
        assert!(results.best.is_empty());
        let answer = results.answer().join(" ");
        let words = "Only 240 of 400 pairs are common to all, so none is best; right minus wrong: ";
        assert!(answer.starts_with(words), "{answer}");
    }

    #[test]
    fn an_algorithm_is_ranked_from_half_of_the_pairs_on() {
        for (pairs, common, unfit) in [(10, 10, Unfit::TooFewPairs), (9, 20, Unfit::Absent)] {
            let own = [("all", 20), ("some", pairs)].map(|(label, n)| rows(label, n, |_| true));
            let found = results(own, Vec::new());
            let numbers = (found.basis.common.common, found.unfit["some"]);
            assert_eq!(numbers, (common, unfit));
        }
    }

    #[test]
    fn one_algorithm_that_answers_few_pairs_or_none_has_its_sentence() {
        let answers = |pairs| {
            let failed = |sequence| FailureRow {
                scenario: String::new(),
                run: None,
                seed: Some(1),
                sequence,
                algorithm: "own".into(),
                reason: String::new(),
                stress: None,
            };
            let tables = ReportTables {
                rows: rows("own", pairs, |_| true).into_iter().collect(),
                failures: (pairs..200).map(failed).collect(),
                references: rows(PRIOR, 200, |i| i.is_multiple_of(2))
                    .into_iter()
                    .collect(),
                ..ReportTables::default()
            };
            let own = Results::new(&tables, ResultParts::default(), Shown::default()).unwrap();
            [own.answer(), own.legend()].map(|lines| lines.join(" "))
        };
        let few = "It could not be best: less than half of the pairs answered (own); 60 pairs.";
        assert_eq!(answers(60), [few, "! own failed on 140 of 200 pairs."]);
        assert_eq!(answers(0)[0], "No algorithm answered any of 200 pairs.");
        assert_eq!(answers(200), ["", ""]);
    }

    #[test]
    fn an_algorithm_that_does_not_beat_the_prior_is_not_best() {
        let half = |i: u64| i.is_multiple_of(2);
        let few = |i: u64| i.is_multiple_of(20);
        let all_but_few = |i: u64| !i.is_multiple_of(20);
        let unfit = |pairs, prior, own| {
            let tested = tested(pairs, prior, own);
            tested.unfit.get("own").copied()
        };
        assert_eq!(unfit(200, half, all_but_few), None);
        // The scene hardly changes.
        assert_eq!(unfit(200, all_but_few, all_but_few), None);
        let over = Some(Unfit::Over("wrong", 10));
        assert_eq!(unfit(200, half, |i| i % 20 < 10), over);
        assert_eq!(unfit(20, few, all_but_few), Some(Unfit::TooFewPairs));
        let still = tested(200, all_but_few, |_| true);
        let words = still.cautions().join(" ");
        let is_still = words.contains("hardly changes") && words.contains("95.0 %");
        assert!(is_still, "{words}");
    }
}
