//! Comparison of two runs: changes of metrics with confidence intervals.

mod conclusion;
mod courses;
mod frames;
mod matched;
mod page;
mod past;
mod scored_run;
mod text;

use super::accuracy::{PairErrors, RangeErrors};
use super::rows::Row;
use super::samples::{RunKey, resamples, run_key, sample_in};
pub use conclusion::{Conclusion, JudgedComparison};
use courses::{CourseChanges, are_driven};
pub use frames::FindLeft;
use matched::MatchedLabels;
pub use page::ComparisonPage;
pub use scored_run::ScoredRun;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use svl_core::{Error, Result, counted};
use svl_score::bootstrap::{self, Interval, Resamples, Sample, TestMethod};
use svl_score::judge::{AreaChoice, Better, METRICS, Metric, MetricOrigin, MetricUnit};
use svl_score::losses::Incomplete;
use svl_score::manifest::{Manifest, Purpose};
use svl_score::sign_test;
pub use text::signed;

/// The differences of the second run from the first.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
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
    /// Origin of the two reports; times depend on it.
    pub origins: [ReportOrigin; 2],
    /// Folders of the incomplete reports, each with the reason.
    pub incomplete: Vec<(PathBuf, String)>,
    /// Algorithms that both runs have, in the order of the first.
    pub algorithms: Vec<AlgorithmChange>,
    /// Method that tells changes from chance. Each change is of one metric: of twenty metrics that
    /// did not change, one is called better or worse by chance.
    pub method: TestMethod,
    /// Metrics and checkpoints of all algorithms that are tested at once.
    pub tested: usize,
    /// Algorithms that only one run has, which are not compared.
    pub only_in_base: Vec<String>,
    pub only_in_other: Vec<String>,
    /// Algorithms of both runs that are not compared as the user mapped others to their namesakes.
    pub left_out: Vec<String>,
    /// Algorithms that only one run has, but the other with other parameters: `BASE=OTHER`.
    pub proposed_maps: Vec<String>,
    /// Differences of the pairs that the runs selected, as options: `--every 1 and 5`.
    pub selections: Vec<String>,
    /// Reasons why errors of distances are not compared.
    pub without_cells: BTreeSet<String>,
}

/// The program and the machine that made a report.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ReportOrigin {
    /// Version and revision.
    pub svl: String,
    pub processor: String,
    pub isa: String,
    pub threads: usize,
    /// The work that its times measure, in words, if that is known.
    pub times: Option<String>,
}

/// One algorithm in both runs, over the pairs that both took.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AlgorithmChange {
    pub algorithm: String,
    /// Label in the second run, if that differs.
    pub other_algorithm: String,
    pub same_parameters: bool,
    pub pairs: usize,
    /// Pairs of either run that the other does not have, or not with the same pixels.
    pub unmatched: usize,
    /// Pairs that the second run failed on and of which the first has a result.
    pub newly_failed: usize,
    /// Pairs before which the two runs have different pairs, of an algorithm whose results depend
    /// on them.
    pub other_past: usize,
    /// Blocks of neighbouring pairs that intervals rest on, about the number of independent pairs.
    pub blocks: usize,
    /// Pairs with equal pixels but another truth or calibration, by which they were scored.
    pub other_inputs: usize,
    /// Pairs whose results are equal to the bit.
    pub equal_results: usize,
    pub metrics: Vec<Change>,
    /// The metrics of the other areas, by the names of the areas.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub areas: BTreeMap<&'static str, Vec<Change>>,
    /// Fraction of frames passed, per checkpoint.
    pub checkpoints: Vec<CheckpointChange>,
    /// True if checkpoints of both runs are not compared, as they have not the same pairs.
    pub has_partial_checkpoints: bool,
    /// The courses of both reports of drives, which the numbers of pairs then count.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub courses: Option<CourseChanges>,
}

/// A number in both runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    pub metric: &'static Metric,
    pub base: f64,
    pub other: f64,
    /// `other - base`; of times `other / base`; of a metric that is best at 0 the change of its
    /// magnitude.
    pub difference: f64,
    /// 95 % bootstrap interval of the difference; absent for too few pairs or frames.
    pub interval: Option<Interval>,
    pub judgement: Judgement,
}

impl Change {
    /// The difference as a multiple of its interval's width; 0 without one.
    fn sureness(&self) -> f64 {
        self.interval.map_or(0.0, |(low, high)| {
            self.difference.abs() / (high - low).max(f64::MIN_POSITIVE)
        })
    }

    /// True if the second value is the worse one, whether that is real or not.
    pub fn is_for_the_worse(&self) -> bool {
        match self.metric.better {
            Better::More => self.difference < 0.0,
            Better::Less | Better::Zero => self.difference > 0.0,
            Better::Neither => false,
        }
    }
}

/// A checkpoint in both runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CheckpointChange {
    pub checkpoint: u32,
    pub name: String,
    #[serde(flatten)]
    pub change: Change,
}

/// Significance of a difference, and its direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Judgement {
    /// The results are equal.
    Equal,
    /// The interval contains 0.
    Unclear,
    /// There is no interval: too few independent pairs, or frames of a checkpoint, have a value.
    TooFew,
    Better,
    Worse,
    /// The interval excludes 0, but neither direction is better.
    Differs,
    /// Times, which vary with the machine, and metrics of reports that were scored differently.
    Unjudged,
}

impl ReportOrigin {
    fn new(manifest: &Manifest) -> Self {
        let revision = manifest
            .git_revision
            .as_deref()
            .unwrap_or("revision unknown");
        let profile = manifest.profile.as_deref();
        let profile = profile.filter(|name| *name != "release");
        let profile = profile.map_or_else(String::new, |name| format!(", profile {name}"));
        Self {
            svl: format!("{} ({revision}{profile})", manifest.svl),
            processor: manifest.machine.processor.clone(),
            isa: manifest.machine.isa.clone(),
            threads: manifest.machine.threads,
            times: manifest.times.clone(),
        }
    }
}

impl Comparison {
    /// Compares the algorithms that `map` names, as `BASE=OTHER`, and of the others those of equal
    /// labels; without a map, where each run has just one, these two.
    ///
    /// # Errors
    /// [`Incomplete`] when the runs have no algorithm or no pair in common, so that nothing
    /// is compared; [`Error::Invalid`] for drives and pairs, and for a map of algorithms that they
    /// do not have.
    pub fn from_runs(base: &ScoredRun, other: &ScoredRun, map: &[String]) -> Result<Self> {
        let is_driven = are_driven(base, other)?;
        let matched = MatchedLabels::new(&base.manifest, &other.manifest, map)?;
        let shown = || format!("{} and {}", base.folder.display(), other.folder.display());
        if matched.both.is_empty() {
            let words = matched.none_words();
            let words = format!("{}: {words}", shown());
            return Err(Error::other(Incomplete(words)));
        }
        let algorithms = matched.both.iter();
        let algorithms = algorithms.map(|labels| {
            if is_driven {
                Ok(AlgorithmChange::from_drives(base, other, *labels))
            } else {
                AlgorithmChange::from_runs(base, other, *labels)
            }
        });
        let algorithms = algorithms.collect::<Result<Vec<_>>>()?;
        if algorithms
            .iter()
            .all(|a| a.pairs == 0 && a.newly_failed == 0)
        {
            let things = algorithms[0].things();
            return Err(Error::other(Incomplete(format!(
                "{}: no {things} in common: their {things}s differ, as those of other scenarios, \
                 seeds or arena versions do",
                shown()
            ))));
        }
        let mut comparison = Self {
            base: base.folder.clone(),
            other: other.folder.clone(),
            scenario: base.manifest.scenario.clone(),
            area: base.area(),
            differences: differences(base, other, &algorithms)?,
            truths: [base, other].map(|run| run.manifest.truth.clone()),
            origins: [base, other].map(|run| ReportOrigin::new(&run.manifest)),
            incomplete: [base, other]
                .into_iter()
                .filter_map(|run| Some((run.folder.clone(), run.incomplete.clone()?)))
                .collect(),
            method: if is_driven {
                sign_test::METHOD
            } else {
                bootstrap::METHOD
            },
            tested: algorithms
                .iter()
                .map(|algorithm| algorithm.changes().count())
                .sum(),
            algorithms,
            proposed_maps: matched.proposed_maps(),
            only_in_base: matched.only_in_base,
            only_in_other: matched.only_in_other,
            left_out: matched.left_out,
            selections: past::selections(&base.selection()?, &other.selection()?),
            without_cells: [base, other]
                .into_iter()
                .filter(|run| !is_driven && !run.has_cells())
                .map(ScoredRun::without_cells)
                .collect(),
        };
        if !comparison.is_judged() {
            let algorithms = comparison.algorithms.iter_mut();
            let changes = algorithms.flat_map(AlgorithmChange::changes_mut);
            changes.for_each(Change::withdraw);
        }
        Ok(comparison)
    }

    /// True if any pair is compared, or one that the second run alone failed on.
    pub fn has_pairs(&self) -> bool {
        let mut algorithms = self.algorithms.iter();
        algorithms.any(|algorithm| algorithm.pairs > 0 || algorithm.newly_failed > 0)
    }

    /// True if anything may be called better or worse: other tolerances or cells give other scores
    /// of equal results.
    pub fn is_judged(&self) -> bool {
        self.differences.is_empty()
    }
}

/// The changes of the metrics from rows to other rows of the same pairs, one to one, those of a run
/// beside each other.
pub fn changes(base: &[&Row], other: &[&Row]) -> Vec<Change> {
    let area = base.first().map(|row| row.metrics.area());
    changes_over(
        [base, other],
        None,
        area.unwrap_or_default(),
        &resamples(base),
    )
}

/// The runs whose pairs both reports have completely: checkpoint tables hold sums only. `common`
/// and `all`: the rows of the common pairs and all rows, of each report.
fn complete_runs<'a>(common: [&[&'a Row]; 2], all: [&[&'a Row]; 2]) -> Vec<RunKey<'a>> {
    let mut runs: Vec<_> = common[0].iter().map(|row| run_key(row)).collect();
    // The rows of a run are neighbours.
    runs.dedup();
    let count = |rows: &[&Row], run| rows.iter().filter(|row| run_key(row) == run).count();
    runs.retain(|&run| (0..2).all(|i| count(common[i], run) == count(all[i], run)));
    runs
}

/// The changes of the metrics in an area. `errors`: those of distances in the pairs of both, if
/// both have cells.
fn changes_over(
    rows: [&[&Row]; 2],
    errors: Option<&[Vec<PairErrors>; 2]>,
    area: AreaChoice,
    resamples: &Resamples,
) -> Vec<Change> {
    // Metrics that no pair has, and checkpoints, have no sample.
    let change = |metric: &'static Metric| {
        let samples = match metric.origin {
            MetricOrigin::Cells { number, .. } => errors?
                .each_ref()
                .map(|pairs| Some(RangeErrors::sample(number, pairs, area))),
            _ => rows.map(|rows| sample_in(metric, rows, area)),
        };
        let [Some(a), Some(b)] = samples else {
            return None;
        };
        Change::from_samples(metric, &a, &b, resamples)
    };
    METRICS.iter().filter_map(change).collect()
}

/// The differences of the two scenarios, and of the inputs of common pairs.
fn differences(
    base: &ScoredRun,
    other: &ScoredRun,
    algorithms: &[AlgorithmChange],
) -> Result<Vec<String>> {
    let purpose = if algorithms.iter().any(|own| own.courses.is_some()) {
        Purpose::CompareDrives
    } else {
        Purpose::Compare
    };
    let (base, other) = (&base.manifest, &other.manifest);
    let mut differences = base.differences(other, purpose)?;
    let inputs = algorithms.iter().map(|change| change.other_inputs).max();
    if let Some(inputs @ 1..) = inputs {
        let pairs = counted(inputs, "pair");
        differences.push(format!("truth or calibration of {pairs}"));
    }
    Ok(differences)
}

impl AlgorithmChange {
    /// The label of the algorithm, or those of two.
    pub fn labels(&self) -> String {
        if self.other_algorithm == self.algorithm {
            self.algorithm.clone()
        } else {
            format!("{} → {}", self.algorithm, self.other_algorithm)
        }
    }

    /// The subject of the comparison: one algorithm, or two.
    pub fn title(&self) -> String {
        let labels = self.labels();
        if self.other_algorithm != self.algorithm || self.same_parameters {
            labels
        } else {
            format!("{labels} (other parameters)")
        }
    }

    /// All changes with their names.
    pub fn changes(&self) -> impl Iterator<Item = (String, &Change)> {
        let metrics = self.metrics.iter();
        let metrics = metrics.map(|change| (change.metric.words.to_owned(), change));
        let checkpoints = self.checkpoints.iter();
        metrics.chain(checkpoints.map(|c| {
            let name = format!("checkpoint {} {}", c.checkpoint, c.name);
            (name, &c.change)
        }))
    }

    /// All changes, those of other areas included.
    fn changes_mut(&mut self) -> impl Iterator<Item = &mut Change> {
        let areas = self.areas.values_mut().flatten();
        let checkpoints = self.checkpoints.iter_mut();
        let checkpoints = checkpoints.map(|checkpoint| &mut checkpoint.change);
        self.metrics.iter_mut().chain(areas).chain(checkpoints)
    }

    fn from_runs(
        base: &ScoredRun,
        other: &ScoredRun,
        (label, other_label): (&str, &str),
    ) -> Result<Self> {
        let (ours, theirs) = (base.rows(label), other.rows(other_label));
        let pairs = common_pairs(&ours, &theirs);
        let (a, b): (Vec<_>, Vec<_>) = pairs.iter().copied().unzip();
        let all = [&ours, &theirs].map(|rows| rows.values().copied().collect::<Vec<_>>());
        let runs = complete_runs([&a, &b], [&all[0], &all[1]]);
        let visits = other.checkpoints(other_label, &runs);
        let resamples = resamples(&a);
        let has_run_memory = base.has_run_memory(label) || other.has_run_memory(other_label);
        let equal_results = pairs
            .iter()
            .filter(|(a, b)| a.result_hash == b.result_hash)
            .count();
        let has_cells = base.has_cells() && other.has_cells();
        let errors = if has_cells {
            Some([
                base.pair_errors(label, &a)?,
                other.pair_errors(other_label, &b)?,
            ])
        } else {
            None
        };
        let changes = |area| changes_over([&a, &b], errors.as_ref(), area, &resamples);
        let mut metrics = changes(base.area());
        let others = AreaChoice::ALL
            .into_iter()
            .filter(|area| *area != base.area());
        let others = others.map(|area| {
            let mut own = changes(area);
            own.retain(|change| change.metric.by_area);
            (area.name(), own)
        });
        let areas = others.filter(|(_, own)| !own.is_empty()).collect();
        if !are_times_comparable(base, other, &pairs) {
            metrics.retain(|change| change.metric.unit != MetricUnit::Ms);
        }
        let checkpoint = |(number, (name, frames, passed)): (u32, (&str, u64, u64))| {
            let (_, other_frames, other_passed) = *visits.get(&number)?;
            let change = Change::from_shares((passed, frames), (other_passed, other_frames))?;
            Some(CheckpointChange {
                checkpoint: number,
                name: name.to_owned(),
                change,
            })
        };
        let checkpoints = base.checkpoints(label, &runs).into_iter();
        let checkpoints: Vec<_> = checkpoints.filter_map(checkpoint).collect();
        let has_both = base.has_checkpoints(label) && other.has_checkpoints(other_label);
        let mut change = Self {
            algorithm: label.to_owned(),
            other_algorithm: other_label.to_owned(),
            same_parameters: base.parameters_hash(label) == other.parameters_hash(other_label),
            pairs: pairs.len(),
            newly_failed: other.failed_of(other_label, ours.keys().map(|key| (key.0, key.1))),
            unmatched: ours.len() + theirs.len() - 2 * pairs.len(),
            other_inputs: pairs
                .iter()
                .filter(|(a, b)| a.input_hash != b.input_hash)
                .count(),
            equal_results,
            other_past: if has_run_memory {
                past::other_past(&ours, &theirs)
            } else {
                0
            },
            blocks: resamples.blocks(),
            metrics,
            areas,
            has_partial_checkpoints: checkpoints.is_empty() && has_both,
            checkpoints,
            courses: None,
        };
        // Equal numbers of unequal results are a coincidence, as wide as the interval.
        if equal_results < pairs.len() {
            change.changes_mut().for_each(Change::withdraw_equal);
        }
        Ok(change)
    }
}

/// The rows of the pairs that both have: equal numbers are not enough, as another seed or version
/// of the arena renders other pixels.
fn common_pairs<'a, K: Ord>(
    ours: &BTreeMap<K, &'a Row>,
    theirs: &BTreeMap<K, &'a Row>,
) -> Vec<(&'a Row, &'a Row)> {
    let both = ours
        .iter()
        .filter_map(|(key, row)| Some((*row, *theirs.get(key)?)));
    both.filter(|(a, b)| a.pair_hash == b.pair_hash).collect()
}

/// True for times of two reports, and within a report only where one session has both.
fn are_times_comparable(base: &ScoredRun, other: &ScoredRun, pairs: &[(&Row, &Row)]) -> bool {
    let sessions = |rows: &[&Row]| -> BTreeSet<String> {
        rows.iter().map(|row| row.session.clone()).collect()
    };
    let is_one_report = !sessions(&base.all_rows()).is_disjoint(&sessions(&other.all_rows()));
    let are_of_one_session = pairs.iter().all(|(a, b)| a.session == b.session);
    let is_mixed = is_one_report && !are_of_one_session;
    !is_mixed && base.has_times() && other.has_times()
}

impl Change {
    fn from_samples(
        metric: &'static Metric,
        base: &Sample,
        other: &Sample,
        resamples: &Resamples,
    ) -> Option<Self> {
        let difference: fn(f64, f64) -> f64 = match (metric.unit, metric.better) {
            // Times scale with the machine, so their change is a factor.
            (MetricUnit::Ms, _) => |a, b| b / a,
            (_, Better::Zero) => |a, b| b.abs() - a.abs(),
            _ => |a, b| b - a,
        };
        let (a, b) = (base.total()?, other.total()?);
        let interval = Sample::interval_between(base, other, difference, resamples);
        Some(Self::new(metric, (a, b), difference(a, b), interval))
    }

    fn from_shares(base: (u64, u64), other: (u64, u64)) -> Option<Self> {
        let share =
            |(passed, frames): (u64, u64)| (frames > 0).then(|| passed as f64 / frames as f64);
        let (a, b) = (share(base)?, share(other)?);
        Some(Self::new(
            Metric::find("passed")?,
            (a, b),
            b - a,
            bootstrap::shares(base, other),
        ))
    }

    /// Withdraws better and worse: the two runs have different scenarios.
    fn withdraw(&mut self) {
        if self.judgement != Judgement::Equal {
            self.judgement = Judgement::Unjudged;
        }
    }

    fn withdraw_equal(&mut self) {
        if self.judgement == Judgement::Equal {
            self.judgement = match self.interval {
                Some(_) => Judgement::Unclear,
                None => Judgement::TooFew,
            };
        }
    }

    /// The things of which there are too few for an interval.
    pub fn too_few_words(&self) -> &'static str {
        match self.metric.origin {
            MetricOrigin::Checkpoints => "too few frames",
            MetricOrigin::Drives(_) => "too few courses",
            _ => "too few pairs",
        }
    }

    fn new(
        metric: &'static Metric,
        (base, other): (f64, f64),
        difference: f64,
        interval: Option<Interval>,
    ) -> Self {
        let judgement = match interval {
            // Equal on these pairs: the interval is empty and proves nothing.
            _ if base == other => Judgement::Equal,
            // All pairs of a run are of one moment: their spread does not include how the machine
            // varies between runs.
            _ if metric.unit == MetricUnit::Ms => Judgement::Unjudged,
            Some((low, high)) if low > 0.0 || high < 0.0 => {
                match (metric.better, difference > 0.0) {
                    (Better::Neither, _) => Judgement::Differs,
                    (Better::More, true) | (Better::Less | Better::Zero, false) => {
                        Judgement::Better
                    }
                    _ => Judgement::Worse,
                }
            }
            Some(_) => Judgement::Unclear,
            None => Judgement::TooFew,
        };
        Self {
            metric,
            base,
            other,
            difference,
            interval,
            judgement,
        }
    }
}
