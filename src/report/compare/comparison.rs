//! Comparison of two reports: of each metric its change, the interval of that, and the verdict.

use super::courses::CourseChanges;
use super::frames::FrameCounts;
use super::join::{Join, JoinedAlgorithm};
use super::scored_run::ScoredRun;
use crate::compare::courses::is_alike;
use crate::results::change::{
    Change, Changes, CheckpointName, Judgement, NotMeasured, decide, deciding, untested_changes,
};
use crate::rows::held::RowRef;
use crate::rows::samples::{paired, runs, sample_in};
use crate::subjects::accuracy::{AccuracyRow, RunRanges};
use crate::subjects::drives::DriveRow;
use crate::subjects::references::EXACT;
use serde::Serialize;
use std::collections::BTreeSet;
use std::path::PathBuf;
use svl_core::{Result, counted};
use svl_score::bootstrap::{self, TestMethod};
use svl_score::judge::{AreaChoice, Cases, METRICS, Metric, MetricUnit, signs};
use svl_score::manifest::{Manifest, Purpose};

/// The differences of the second report from the first, as `svl compare --json` prints them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    pub conclusion: Conclusion,
    /// The conclusion with its reason: the first line of every form.
    pub verdict: String,
    pub base: PathBuf,
    pub other: PathBuf,
    pub scenario: String,
    /// The cells that metrics of an area are of.
    pub area: AreaChoice,
    /// Differences in how they were scored, in words: if there are any, nothing is called better or
    /// worse.
    pub differences: Vec<String>,
    /// Origins of the truths of the two.
    pub truths: [Vec<String>; 2],
    /// Program, machine and threads of the two reports, on which times depend.
    pub origins: [String; 2],
    /// The incomplete reports, each with the reason.
    pub incomplete: Vec<(PathBuf, String)>,
    /// Algorithms that both reports have, in the order of the first.
    pub algorithms: Vec<AlgorithmChange>,
    /// Method that tells changes from chance. Each change is of one metric: of twenty metrics that
    /// did not change, one is called better or worse by chance, but for those that decide.
    pub method: TestMethod,
    /// Number of the metrics that decide, of all algorithms: they are tested at once, with Holm's
    /// correction.
    pub tested: usize,
    /// The share of the base's pairs below which nothing is said of all of them.
    pub min_common: f64,
    /// The algorithms of which fewer are compared, in words.
    pub few_in_common: Vec<String>,
    /// Algorithms of the first report that several of the second may be, in words.
    pub ambiguous: Vec<String>,
    /// Algorithms that only one report has, which are not compared.
    pub only_in_base: Vec<String>,
    pub only_in_other: Vec<String>,
    /// Algorithms, pairs and metrics that are not compared, each with the reason.
    pub not_compared: Vec<String>,
    /// Doubts about the verdict: incomplete reports, other pairs before, other machines.
    pub cautions: Vec<String>,
}

/// The verdict in a word, by the headline metrics that have a better direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Conclusion {
    Better,
    Worse,
    /// Some metrics are better, others worse.
    Mixed,
    /// All results are equal.
    NoChange,
    NotToldApart,
    /// Too few of the base's pairs are compared.
    FewInCommon,
    /// There is no interval.
    TooFewPairs,
    /// The same of drives.
    TooFewCourses,
    NotComparable,
}

/// One algorithm in both reports, over the pairs of both.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct AlgorithmChange {
    pub algorithm: String,
    /// Label in the second report, if that differs.
    pub other_algorithm: String,
    pub same_parameters: bool,
    pub pairs: usize,
    /// Pairs or courses of the first report.
    pub base_pairs: usize,
    /// Pairs of either report that the other does not have, or not with the same pixels.
    pub unmatched: usize,
    /// Pairs that the second failed on and of which the first has a result.
    pub newly_failed: usize,
    /// True if these are more than the second report's `allow_loss`.
    pub exceeds_losses: bool,
    /// Pairs before which the two have different pairs, of an algorithm whose results depend on
    /// them.
    pub other_past: usize,
    /// Blocks of neighbouring pairs that intervals rest on, about the number of independent pairs.
    pub blocks: usize,
    /// Pairs with equal pixels but another truth or calibration, by which they were scored.
    pub other_inputs: usize,
    /// Pairs whose results are equal to the bit.
    pub equal_results: usize,
    /// Pairs that became better and worse by their cells; absent if nothing may be called so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frames: Option<FrameCounts>,
    pub metrics: Vec<Change>,
    /// The errors of both by ranges of the true distance, if both have cells; those of pixels
    /// where both have the same pairs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub by_distance: Option<[Vec<AccuracyRow>; 2]>,
    /// Metrics that one of the reports does not measure, or neither.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub not_measured: Vec<NotMeasured>,
    /// Fraction of frames passed, per checkpoint.
    pub checkpoints: Vec<Change>,
    /// True if checkpoints of both are not compared, as they have not the same pairs.
    pub has_partial_checkpoints: bool,
    /// The courses of both reports of drives, which the numbers of pairs then count.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub courses: Option<CourseChanges>,
}

impl Comparison {
    /// The changes between joined reports. `min_common`: the share of the base's pairs below which
    /// nothing is said of all of them.
    ///
    /// # Errors
    /// The errors of reading the tables of cells; [`svl_core::Error::Invalid`] for a manifest that
    /// is not what svl writes.
    pub fn new(join: &Join<'_>, min_common: f64) -> Result<Self> {
        let [base, other] = join.runs;
        let algorithms = join.algorithms.iter();
        let algorithms = algorithms.map(|own| AlgorithmChange::new(join, own));
        let mut algorithms = algorithms.collect::<Result<Vec<_>>>()?;
        let deciding = algorithms.iter_mut().flat_map(|own| {
            let metrics = deciding(&own.metrics);
            let changes = own.metrics.iter_mut();
            changes.filter(move |change| metrics.contains(&change.metric))
        });
        let tested = decide(deciding);
        let few_in_common = algorithms.iter();
        let few_in_common = few_in_common.filter_map(|own| own.few_in_common(min_common));
        let mut incomplete = Vec::new();
        for (side, run) in join.runs.iter().enumerate() {
            let labels = join.algorithms.iter().map(|own| own.labels[side]);
            let why = run.incomplete(&labels.collect::<Vec<_>>())?;
            incomplete.extend(why.map(|why| (run.name.clone(), why)));
        }
        let mut comparison = Self {
            conclusion: Conclusion::NotComparable,
            verdict: String::new(),
            base: base.name.clone(),
            other: other.name.clone(),
            scenario: base.manifest.scenario.clone(),
            area: base.area,
            differences: differences(join, &algorithms)?,
            truths: join.runs.map(|run| run.manifest.truth.clone()),
            origins: join.runs.map(|run| origin(&run.manifest)),
            incomplete,
            method: if join.is_driven {
                signs::method(join.tests())
            } else {
                bootstrap::METHOD
            },
            tested,
            min_common,
            few_in_common: few_in_common.collect(),
            ambiguous: join.ambiguous.clone(),
            only_in_base: join.only_in(0),
            only_in_other: join.only_in(1),
            not_compared: Vec::new(),
            cautions: Vec::new(),
            algorithms,
        };
        if !comparison.is_judged() {
            let algorithms = comparison.algorithms.iter_mut();
            let all = algorithms.flat_map(AlgorithmChange::changes_mut);
            for change in all.filter(|change| change.judgement != Judgement::Equal) {
                change.judgement = Judgement::Unjudged;
            }
            let algorithms = comparison.algorithms.iter_mut();
            algorithms.for_each(|own| own.frames = None);
        }
        comparison.not_compared = comparison.why_not(join);
        comparison.cautions = comparison.doubts(join);
        comparison.conclusion = comparison.conclude();
        comparison.verdict = comparison.sentence();
        if !comparison.few_in_common.is_empty() && comparison.is_judged() {
            comparison.conclusion = Conclusion::FewInCommon;
            let few = comparison.few_in_common.join("; ");
            let (word, verdict) = (comparison.conclusion.word(), &comparison.verdict);
            comparison.verdict = format!("{word}: {few} (--min-common); of these {verdict}");
        }
        Ok(comparison)
    }

    /// True if any pair is compared.
    pub fn has_pairs(&self) -> bool {
        self.algorithms.iter().any(|own| own.pairs > 0)
    }

    /// True if anything may be called better or worse: other tolerances or cells give other scores
    /// of equal results.
    pub fn is_judged(&self) -> bool {
        self.differences.is_empty()
    }

    pub(super) fn is_driven(&self) -> bool {
        self.algorithms.iter().any(|own| own.courses.is_some())
    }

    /// The changes that decide, with their names.
    pub(super) fn ranked(&self) -> Vec<(String, &Change)> {
        self.named(|own| own.deciding().collect())
    }

    /// Losses beyond those that are allowed are worse.
    fn conclude(&self) -> Conclusion {
        let ranked = self.ranked();
        let is = |judgement| ranked.iter().any(|(_, own)| own.judgement == judgement);
        let is_worse = self.algorithms.iter().any(|own| own.exceeds_losses) || is(Judgement::Worse);
        let mut judgements = ranked.iter().map(|(_, own)| own.judgement);
        let is_tested = |own| ![Judgement::Equal, Judgement::TooFew].contains(&own);
        match (is_worse, is(Judgement::Better)) {
            _ if !self.is_judged() || !self.has_pairs() => Conclusion::NotComparable,
            (true, true) => Conclusion::Mixed,
            (true, false) => Conclusion::Worse,
            (false, true) => Conclusion::Better,
            _ if self.are_equal() => Conclusion::NoChange,
            _ if ranked.is_empty() => Conclusion::NotComparable,
            _ if !is(Judgement::TooFew) || judgements.any(is_tested) => Conclusion::NotToldApart,
            _ if self.is_driven() => Conclusion::TooFewCourses,
            _ => Conclusion::TooFewPairs,
        }
    }
}

/// The program and the machine that made a report.
fn origin(manifest: &Manifest) -> String {
    let revision = manifest.git_revision.as_deref();
    let revision = revision.unwrap_or("revision unknown");
    let profile = match manifest.profile.as_deref() {
        None | Some("release") => String::new(),
        Some(name) => format!(", profile {name}"),
    };
    let (svl, machine) = (&manifest.svl, &manifest.machine);
    let (processor, isa) = (&machine.processor, &machine.isa);
    let threads = counted(machine.threads, "thread");
    format!("svl {svl} ({revision}{profile}), {processor}, {isa}, {threads}")
}

/// The differences of the two scenarios, and of the inputs of common pairs.
fn differences(join: &Join<'_>, algorithms: &[AlgorithmChange]) -> Result<Vec<String>> {
    let purpose = if join.is_driven {
        Purpose::CompareDrives
    } else {
        Purpose::Compare
    };
    let [base, other] = join.runs.map(|run| &run.manifest);
    let mut differences = base.differences(other, purpose)?;
    if let Some(inputs @ 1..) = algorithms.iter().map(|own| own.other_inputs).max() {
        let pairs = counted(inputs, "pair");
        differences.push(format!("truth or calibration of {pairs}"));
    }
    Ok(differences)
}

impl AlgorithmChange {
    pub(super) fn new(join: &Join<'_>, own: &JoinedAlgorithm<'_>) -> Result<Self> {
        let records = [0, 1].map(|side| join.runs[side].record(own.labels[side]));
        let hashes = records.map(|record| record.map(|own| &own.parameters_hash));
        let allowed = join.runs[1].manifest.allow_loss()?.unwrap_or_default();
        let change = Self {
            algorithm: own.labels[0].to_owned(),
            other_algorithm: own.labels[1].to_owned(),
            same_parameters: hashes[0] == hashes[1],
            pairs: own.compared(),
            base_pairs: own.base_pairs,
            unmatched: own.unmatched,
            newly_failed: own.newly_failed,
            exceeds_losses: allowed.is_exceeded(own.newly_failed as u64, own.read_pairs as u64),
            other_past: own.other_past,
            ..Self::default()
        };
        if join.is_driven {
            Ok(change.with_courses(&own.courses, join.tests()))
        } else {
            change.with_pairs(join, own)
        }
    }

    fn with_pairs(self, join: &Join<'_>, own: &JoinedAlgorithm<'_>) -> Result<Self> {
        let [base, other] = join.runs;
        let [a, b] = [0, 1].map(|side| own.rows(side));
        let runs = runs(&a);
        let (mut errors, mut by_distance) = (None, None);
        if base.has_cells() && other.has_cells() {
            let ranges = RunRanges::new(&base.manifest)?;
            let (ours, before) = base.pair_errors(own.labels[0], &a, &ranges)?;
            let (theirs, after) = other.pair_errors(own.labels[1], &b, &ranges)?;
            errors = Some([ours, theirs]);
            let ranges = ranges.in_order(&before);
            // Errors of pixels are not known by pair.
            let has_same_pairs = own.unmatched == 0;
            let both = [(base, before, own.labels[0]), (other, after, own.labels[1])];
            by_distance = Some(both.map(|(run, tally, label)| {
                let rows = tally.into_rows(&[label], &ranges).into_iter();
                let cells = rows.filter(|row| row.area == base.area);
                let pixels = run.pixel_errors(label, &ranges).into_iter();
                cells.chain(pixels.filter(|_| has_same_pairs)).collect()
            }));
        }
        let Changes {
            measured: mut metrics,
            not_measured,
        } = Changes::over([&a, &b], errors.as_ref(), base.area, &runs, METRICS);
        metrics.extend(untested_changes(|metric, side| {
            join.runs[side].whole(metric, own.labels[side])
        }));
        if !are_times_comparable(join.runs, &own.pairs) {
            metrics.retain(|change| change.metric.unit != MetricUnit::Ms);
        }
        let [exact, _] = paired(&base.reference(EXACT), &a);
        for change in &mut metrics {
            if ["missed", "found"].contains(&change.metric.name) {
                let sample = sample_in(change.metric, &exact, base.area);
                change.exact = sample
                    .filter(|_| !exact.is_empty())
                    .and_then(|own| own.total());
            }
        }
        let checkpoints = checkpoint_changes(join.runs, own);
        let has_both = (0..2).all(|side| join.runs[side].has_checkpoints(own.labels[side]));
        let count =
            |is: fn(&[RowRef<'_>; 2]) -> bool| own.pairs.iter().filter(|pair| is(pair)).count();
        let mut change = Self {
            blocks: runs.blocks(),
            other_inputs: count(|[a, b]| a.input_hash() != b.input_hash()),
            equal_results: count(|[a, b]| a.result_hash() == b.result_hash()),
            frames: Some(FrameCounts::new(&own.pairs)),
            by_distance,
            metrics,
            not_measured,
            has_partial_checkpoints: checkpoints.is_empty() && has_both,
            checkpoints,
            ..self
        };
        if change.equal_results < change.pairs {
            change.changes_mut().for_each(Change::doubt_equality);
        }
        Ok(change)
    }

    /// All changes of the area.
    pub fn changes(&self) -> impl Iterator<Item = &Change> {
        self.metrics.iter().chain(&self.checkpoints)
    }

    /// The changes of the metrics that decide if it became better or worse: those of the headline
    /// with a better direction, but checkpoints and times.
    pub fn deciding(&self) -> impl Iterator<Item = &Change> {
        let metrics = deciding(&self.metrics);
        let changes = self.metrics.iter();
        changes.filter(move |own| metrics.contains(&own.metric))
    }

    /// The pairs of the base that are compared, in words, if they are too few.
    pub(super) fn few_in_common(&self, min_common: f64) -> Option<String> {
        let (common, all) = (self.pairs + self.newly_failed, self.base_pairs);
        // Without the digits that are not of the number as it was written.
        let percent = (1e6 * min_common).round() / 1e4;
        ((common as f64) < min_common * all as f64).then(|| {
            let things = counted(all, self.things());
            let own = &self.algorithm;
            format!("{common} of the base's {things} of {own}, fewer than {percent} %")
        })
    }

    fn changes_mut(&mut self) -> impl Iterator<Item = &mut Change> {
        self.metrics.iter_mut().chain(&mut self.checkpoints)
    }
}

impl AlgorithmChange {
    /// Adds changes that are real by an exact sign test over the courses of both reports: of the
    /// courses on which a number differs, as many become better as worse if nothing changed. How
    /// much it differs does not count, so that one bad course is one course.
    /// `tests`: the number of tests at once.
    pub(super) fn with_courses(self, courses: &[[&DriveRow; 2]], tests: usize) -> Self {
        let alike = courses.iter().filter(|own| is_alike(own));
        let (mut metrics, mut not_measured) = (Vec::new(), Vec::new());
        for metric in METRICS.iter().filter(|metric| metric.is_of_drives()) {
            match Change::from_drives(metric, courses, tests) {
                Ok(change) => metrics.push(change),
                Err(own) => not_measured.push(own),
            }
        }
        Self {
            blocks: courses.len(),
            equal_results: alike.count(),
            metrics,
            not_measured,
            courses: Some(CourseChanges::new(courses)),
            ..self
        }
    }
}

/// The changes of the checkpoints over the runs that both reports have completely.
fn checkpoint_changes(runs: [&ScoredRun; 2], own: &JoinedAlgorithm<'_>) -> Vec<Change> {
    let [base, other] =
        [0, 1].map(|side| runs[side].checkpoints(own.labels[side], &own.whole_runs[side]));
    let change = |(checkpoint, (name, a)): (u32, (&str, [u64; 2]))| {
        let (_, b) = *other.get(&checkpoint)?;
        let [a, b] = [a, b].map(|[frames, passed]| (passed, frames));
        let share = |(passed, frames)| (frames > 0).then(|| passed as f64 / frames as f64);
        let values = [share(a)?, share(b)?];
        let (name, interval) = (name.to_owned(), bootstrap::shares(a, b));
        let passed = Metric::find("passed")?;
        Some(Change {
            checkpoint: Some(CheckpointName { checkpoint, name }),
            cases: Some([a, b].map(|(_, frames)| Cases::items(frames))),
            ..Change::new(passed, values, values[1] - values[0], interval)
        })
    };
    base.into_iter().filter_map(change).collect()
}

/// True for times of two reports, each of one machine, and within a report only where one session
/// has both.
fn are_times_comparable(runs: [&ScoredRun; 2], pairs: &[[RowRef<'_>; 2]]) -> bool {
    let [ours, theirs] = runs.map(|run| {
        let sessions = run.rows.iter().map(|row| row.session());
        sessions.collect::<BTreeSet<_>>()
    });
    let is_one_report = !ours.is_disjoint(&theirs);
    let are_of_one_session = pairs.iter().all(|[a, b]| a.session() == b.session());
    let are_of_one_machine = runs.iter().all(|run| run.manifest.machines().len() == 1);
    (are_of_one_session || !is_one_report) && are_of_one_machine
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::change::{changes, verdict};
    use crate::rows::held::{Row, Rows};
    use crate::subjects::speed::tests::row;
    use svl_score::judge::MetricValues;

    const COMPARISONS: u64 = 60;

    /// A run of 280 pairs, in 20 blocks, scored by two programs that are exchangeable: each pair's
    /// two results go to one and to the other by a coin. The second has `loss` of its right cells
    /// wrong besides.
    fn coin(seed: u64, loss: f64) -> [Rows; 2] {
        let mut random = fastrand::Rng::with_seed(seed);
        let mut sides = [Rows::default(), Rows::default()];
        let mut drift = 0.0;
        for sequence in 0..280 {
            // Neighbouring pairs are about as hard.
            drift = 0.9 * drift + random.f64() - 0.5;
            let mut result = |loss: f64| {
                let share = 0.8 + 0.1 * drift - loss;
                let right = (0..60).filter(|_| random.f64() < share).count() as f64;
                let missed = (0..4).filter(|_| random.f64() < 0.2 - 0.1 * drift).count() as f64;
                let falsely = f64::from(u8::from(random.f64() < 0.05));
                let floor = f64::from(u8::from(random.f64() < 0.05));
                let metrics = MetricValues::from([
                    ("right", right),
                    ("wrong", ((60.0 - right) / 2.0).floor()),
                    ("unknown", ((60.0 - right) / 2.0).ceil()),
                    ("near", 4.0),
                    ("missed", missed),
                    ("found", 4.0 - missed),
                    ("false", falsely),
                    ("floor", floor),
                ]);
                Row {
                    sequence,
                    metrics,
                    result_hash: random.u64(..).to_string(),
                    ..row(1000, (64, 48), None)
                }
            };
            let mut both = [result(0.0), result(0.0)];
            if loss > 0.0 {
                both[1] = result(loss);
            } else if random.bool() {
                both.swap(0, 1);
            }
            for (side, own) in sides.iter_mut().zip(both) {
                side.push(&own);
            }
        }
        sides
    }

    /// The numbers of comparisons in which a metric that decides became worse, with Holm's
    /// correction and without.
    fn worse(loss: f64) -> [usize; 2] {
        let judged = (0..COMPARISONS).map(|seed| {
            let rows = coin(seed, loss);
            let [base, other] = rows.each_ref().map(|rows| rows.iter().collect::<Vec<_>>());
            let own = AlgorithmChange {
                metrics: changes(&base, &other, METRICS),
                ..AlgorithmChange::default()
            };
            let is_worse = |change: &Change| change.judgement == Judgement::Worse;
            let corrected = verdict(&base, &other);
            assert!(corrected.len() <= 5);
            [corrected.iter().any(is_worse), own.deciding().any(is_worse)]
        });
        judged.fold([0; 2], |[a, b], [own, alone]| {
            [a + usize::from(own), b + usize::from(alone)]
        })
    }

    #[test]
    fn exchangeable_programs_are_hardly_ever_worse() {
        let [corrected, alone] = worse(0.0);
        assert!(corrected <= 4 && alone > corrected, "{corrected} {alone}");
    }

    #[test]
    fn a_loss_of_three_points_is_found() {
        let [found, _] = worse(0.03);
        assert!(found >= 57, "{found}");
    }
}
