//! A run in numbers: per algorithm, and per checkpoint and algorithm.

use super::accuracy::AccuracyRow;
use super::drives::{self, DriveRow, DriveSummary};
use super::lead::{Lead, PriorTest};
use super::reliability::ReliabilityRow;
use super::rows::{CheckpointRow, MetricTotals, Record, Row, metric_totals, record};
use super::samples::run_key;
use super::sources::Sources;
use super::speed::Speed;
use super::stress::StressSummary;
use polars::prelude::{DataFrame, PolarsResult};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use svl_core::matcher::{self, MatcherSpec, ProgramRecord};
use svl_core::stereo::{CellRule, TruthOrigin};
use svl_core::{Error, Result};
use svl_files::slow_profile;
use svl_score::judge::{
    AreaChoice, ColumnChoice, DriveNumber, METRICS, Metric, MetricOrigin, MetricValues, RunKind,
};
use svl_score::losses::RunEnding;
use svl_score::manifest::{Manifest, SCHEMA, hash};

/// The results of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Summary {
    /// Version of the files of a report, [`SCHEMA`].
    pub schema: u32,
    /// The end of the run, and the pairs that it misses.
    #[serde(flatten)]
    pub ending: RunEnding,
    /// Digest of the pairs' hashes in their order; absent without pairs.
    pub pairs_hash: Option<String>,
    /// Origins of the truths: each [`svl_core::stereo::TruthOrigin`] of the rows, once.
    pub truth: Vec<String>,
    /// In the order in which they first appear in the rows.
    pub algorithms: Vec<AlgorithmSummary>,
    /// The prior, which looks at nothing; absent where cells are not scored by distances.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub prior: Option<AlgorithmSummary>,
    /// By number of the checkpoint, then as the algorithms.
    pub checkpoints: Vec<CheckpointSummary>,
    /// The units and tables that it is of.
    pub made_of: Sources,
    /// The best algorithms by the headline metrics; found by [`Summary::find_leads`].
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub leads: Vec<Lead>,
    /// Algorithms that failed on pairs.
    pub failed: Vec<FailedAlgorithm>,
    /// The warnings of the run, in their order.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
    /// Algorithms that matched as programs of their own.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub programs: Vec<ProgramSummary>,
    /// Errors of distances by range, where cells have distances.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub accuracy: Vec<AccuracyRow>,
    /// Probabilities of cells by range, where an algorithm gives them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub reliability: Vec<ReliabilityRow>,
    /// Delays of the topics whose maps were scored.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub latency: Vec<TopicDelay>,
    /// Drives, if the algorithms steered a robot, in the order of the algorithms.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub drives: Vec<DriveSummary>,
    /// Results per perturbation, level and algorithm, if pairs were perturbed.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub stress: Vec<StressSummary>,
    /// The pairs, their size and their runs.
    #[serde(skip)]
    pub scope: RunScope,
    /// The metrics that tables show.
    #[serde(skip)]
    pub columns: ColumnChoice,
    /// The area whose numbers tables, sentences and plots have.
    #[serde(skip)]
    pub area: AreaChoice,
    /// True if the algorithms are in the order that the user chose.
    #[serde(skip)]
    pub is_sorted: bool,
    /// The test against the prior, and the algorithms that do not beat it.
    #[serde(skip)]
    pub prior_test: PriorTest,
    #[serde(skip)]
    pub behind_prior: Vec<String>,
    /// The algorithms that report the truth itself.
    #[serde(skip)]
    pub perfect: Vec<String>,
    /// Rule by which cells were scored.
    #[serde(skip)]
    pub rule: CellRule,
    /// The work that the times measure, if that is known.
    #[serde(skip)]
    pub times: Option<String>,
    /// The profile of svl's build, if its times are not those of svl.
    #[serde(skip)]
    pub slow_profile: Option<String>,
    /// True if they are of matching alone.
    #[serde(skip)]
    pub measured: bool,
    /// The algorithms whose times may be compared have the same number; all of a run without a
    /// report, which has none.
    #[serde(skip)]
    pub time_groups: BTreeMap<String, usize>,
}

/// The extent of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RunScope {
    /// Number of unperturbed pairs that any algorithm matched.
    pub pairs: u64,
    /// Widths and heights of the images, pixels, each once.
    pub sizes: Vec<(u32, u32)>,
    /// Recordings, courses or seeds.
    pub runs: u64,
    /// Pairs and cells that were scored against a truth, of the algorithm with the most; `None`
    /// without one.
    pub scored: Option<(u64, u64)>,
    /// The most cells of a pair that were scored.
    pub cells_of_pair: u64,
    /// Rows whose cells are scored by distances, and those of them that know what is floor.
    pub by_distance: u64,
    pub knowing_floor: u64,
}

/// An algorithm without a result of some pairs, which `failures.csv` lists.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FailedAlgorithm {
    pub algorithm: String,
    /// The number of pairs that it failed on.
    pub pairs: u64,
    /// True if it has no result at all.
    pub on_every_pair: bool,
    /// The reason why it failed on the last of them.
    pub reason: String,
}

/// A program behind an algorithm.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ProgramSummary {
    pub algorithm: String,
    #[serde(flatten)]
    pub program: ProgramRecord,
}

/// Log time minus stamp of a topic's messages and of the left images: transport and processing on
/// the robot, not time of matching.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TopicDelay {
    pub topic: String,
    /// Name of the recording.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub run: Option<String>,
    /// Median and 99th percentile, by nearest rank; none without stamps.
    pub topic_ms: Option<[f64; 2]>,
    pub images_ms: Option<[f64; 2]>,
}

record! {
    #[derive(Default)]
    /// One algorithm over all pairs. A number is absent if no pair has it: an algorithm that failed
    /// on every pair has a row without numbers.
    AlgorithmSummary {
        /// Label of the algorithm, as `v3:max_disparity=64`.
        algorithm: String,
        /// Number of pairs with a result of the algorithm.
        pairs: u64,
        /// Sum or mean of each metric of frames.
        totals: MetricTotals,
        /// Median time per pair by nearest rank.
        p50_ms: Option<f64>,
        /// 95th percentile of the time by nearest rank.
        p95_ms: Option<f64>,
        /// 99th percentile of the time by nearest rank: with fewer than a hundred pairs the
        /// slowest.
        p99_ms: Option<f64>,
        /// Time of the slowest pair.
        max_ms: Option<f64>,
        /// Median seconds per million pixels.
        time_per_mp_s: Option<f64>,
        /// Median seconds per 10⁹ pixels times disparities.
        time_per_gd_s: Option<f64>,
        /// Million pixels times disparities per second, of the median pair.
        mde_per_s: Option<f64>,
        /// Mean time of smoothing over the half of the pairs whose total is nearest to the median,
        /// so that the stages add up and an outlier does not count.
        smoothing_ms: Option<f64>,
        /// Mean time of the texture filter over the same pairs.
        texture_ms: Option<f64>,
        /// Mean time of matching over the same pairs.
        matching_ms: Option<f64>,
        /// Mean time of the consistency checks over the same pairs.
        checks_ms: Option<f64>,
        /// Mean time outside all stages over the same pairs.
        other_ms: Option<f64>,
        /// Digest of the hashes of its results in their order.
        results_hash: Option<String>,
        /// Number of pairs whose time per pixel is an outlier: a modified Z-score above 14.26.
        outliers: Option<u64>,
        /// Memory for its largest pair, 10⁶ bytes, if it was measured.
        memory_mb: Option<f64>,
        /// Mean time of filters over the same pairs.
        filters_ms: Option<f64>,
        /// Number of pairs that it failed on, perturbed ones included.
        failed_pairs: u64,
    }
}

record! {
    /// One checkpoint through one algorithm over all runs.
    CheckpointSummary {
        /// Number of the checkpoint in the scenario.
        checkpoint: u32,
        /// Name of the checkpoint.
        name: String,
        /// Label of the algorithm, as `v3:max_disparity=64`.
        algorithm: String,
        /// Number of frames that show the checkpoint.
        frames: u64,
        /// Number of these frames in which the checkpoint passes.
        passed: u64,
        /// True if the best frame of all runs passes; absent if no frame shows the checkpoint.
        best_passed: Option<bool>,
        /// True if the worst frame of all runs passes.
        worst_passed: Option<bool>,
    }
}

impl RunScope {
    fn new(rows: &[Row]) -> Self {
        let pairs: BTreeSet<_> = rows
            .iter()
            .map(|r| (run_key(r), r.sequence, &r.name))
            .collect();
        let runs: BTreeSet<_> = rows.iter().map(run_key).collect();
        let sizes: BTreeSet<_> = rows.iter().map(|row| (row.width, row.height)).collect();
        let with = |name: &str| {
            rows.iter()
                .filter(|r| r.metrics.get(name).is_some())
                .count()
        };
        Self {
            pairs: pairs.len() as u64,
            sizes: sizes.into_iter().collect(),
            runs: runs.len() as u64,
            scored: None,
            cells_of_pair: rows
                .iter()
                .filter_map(|row| row.metrics.get("scored_cells"))
                .fold(0.0, f64::max) as u64,
            by_distance: with("missed") as u64,
            knowing_floor: with("floor") as u64,
        }
    }
}

impl AlgorithmSummary {
    /// Numbers of pairs and of cells that were scored against a truth; `None` if no pair has one.
    pub fn scored(&self) -> Option<(u64, u64)> {
        let count = |name| self.totals.get(name).map(|count| count as u64);
        count("scored_pairs").zip(count("scored_cells"))
    }

    /// Number of scored cells of an area; `None` if it has none.
    pub fn cells_in(&self, area: AreaChoice) -> Option<u64> {
        let parts = ["right", "wrong", "unknown"].iter();
        let counts = parts.map(|name| self.totals.get_in(name, area));
        counts.sum::<Option<f64>>().map(|cells| cells as u64)
    }

    /// As [`Self::scored`], the cells that a metric is of.
    pub fn scored_for(&self, metric: &Metric, area: AreaChoice) -> Option<(u64, u64)> {
        let (pairs, cells) = self.scored()?;
        let of_area = || self.cells_in(area).unwrap_or_default();
        Some((pairs, if metric.by_area { of_area() } else { cells }))
    }

    /// The value of a metric of frames, absent if the run does not measure it; for other metrics
    /// see [`Summary::value`].
    pub fn value(&self, metric: &Metric) -> Option<f64> {
        self.value_in(metric, self.totals.area())
    }

    /// As [`Self::value`], of the cells of an area.
    pub fn value_in(&self, metric: &Metric, area: AreaChoice) -> Option<f64> {
        match metric.origin {
            MetricOrigin::Frame { .. } | MetricOrigin::Cells { .. } => {
                self.totals.value_in(metric, area)
            }
            MetricOrigin::Time => self.p50_ms,
            MetricOrigin::Checkpoints | MetricOrigin::Drives(_) => None,
        }
    }
}

impl CheckpointSummary {
    /// Fraction of frames in which the checkpoint passes.
    pub fn share(&self) -> Option<f64> {
        (self.frames > 0).then(|| self.passed as f64 / self.frames as f64)
    }
}

impl Summary {
    /// Sums up rows, whatever their perturbation.
    pub(super) fn from_frames_of(rows: &[Row], checkpoints: &[CheckpointRow]) -> Result<Self> {
        let summary = Row::frame(rows).and_then(|frame| {
            let checkpoints = CheckpointRow::frame(checkpoints)?;
            let mut summary = Self {
                scope: RunScope::new(rows),
                ..Self::from_frames(&frame, &checkpoints)?
            };
            let area = rows.first().map(|row| row.metrics.area());
            summary.select(area.unwrap_or_default());
            Ok(summary.with_scored())
        });
        summary.map_err(|e| Error::Invalid(format!("summary of {} rows: {e}", rows.len())))
    }

    fn with_scored(mut self) -> Self {
        self.scope.scored = self
            .algorithms
            .iter()
            .filter_map(AlgorithmSummary::scored)
            .max();
        self
    }

    /// Completes the manifest with the digests of pairs and results, and the summary with the
    /// values that only the manifest has.
    pub fn complete(&mut self, manifest: &mut Manifest) {
        self.times.clone_from(&manifest.times);
        self.warnings.clone_from(&manifest.warnings);
        self.slow_profile = slow_profile(manifest.profile.as_deref());
        for record in &manifest.algorithms {
            if matcher::find(&record.name).is_ok_and(MatcherSpec::is_truth) {
                self.perfect.push(record.label.clone());
            }
            let program = record.program.clone();
            self.programs.extend(program.map(|program| ProgramSummary {
                algorithm: record.label.clone(),
                program,
            }));
            let mut summaries = self.algorithms.iter_mut();
            let summary = summaries.find(|a| a.algorithm == record.label);
            self.failed
                .extend(record.failure.as_ref().map(|reason| FailedAlgorithm {
                    algorithm: record.label.clone(),
                    pairs: record.failed_pairs,
                    on_every_pair: summary.is_none(),
                    reason: reason.clone(),
                }));
            if let Some(summary) = summary {
                summary.memory_mb = record.memory_bytes.map(|bytes| bytes as f64 / 1e6);
                summary.failed_pairs = record.failed_pairs;
            } else if record.failed_pairs > 0 {
                self.algorithms.push(AlgorithmSummary {
                    algorithm: record.label.clone(),
                    totals: if self.truth.is_empty() {
                        MetricTotals::default()
                    } else {
                        MetricTotals(MetricValues::from([("scored_pairs", 0.0)]))
                    },
                    failed_pairs: record.failed_pairs,
                    ..AlgorithmSummary::default()
                });
            }
        }
        manifest.pairs_hash.clone_from(&self.pairs_hash);
        manifest.truth.clone_from(&self.truth);
        for record in &mut manifest.algorithms {
            let summary = self.algorithms.iter().find(|a| a.algorithm == record.label);
            record.results_hash = summary.and_then(|a| a.results_hash.clone());
        }
    }

    /// True if the times of these algorithms may be compared: those of each block are of one
    /// session.
    pub fn are_times_comparable<'a>(&self, mut labels: impl Iterator<Item = &'a str>) -> bool {
        let first = labels.next().map(|label| self.time_groups.get(label));
        labels.all(|label| Some(self.time_groups.get(label)) == first)
    }

    /// True if the times of all algorithms may be compared.
    pub(super) fn has_comparable_times(&self) -> bool {
        self.are_times_comparable(self.algorithms.iter().map(|a| a.algorithm.as_str()))
    }

    /// The value of any metric, absent if the run does not measure it. `checkpoint`: the only one
    /// that counts, in place of all.
    pub fn value(&self, label: &str, metric: &Metric, checkpoint: Option<u32>) -> Option<f64> {
        self.value_in(label, metric, checkpoint, self.area)
    }

    /// As [`Self::value`], of the cells of an area.
    pub fn value_in(
        &self,
        label: &str,
        metric: &Metric,
        checkpoint: Option<u32>,
        area: AreaChoice,
    ) -> Option<f64> {
        match metric.origin {
            MetricOrigin::Frame { .. } | MetricOrigin::Cells { .. } | MetricOrigin::Time => {
                let mut all = self.algorithms.iter().chain(&self.prior);
                all.find(|a| a.algorithm == label)?.value_in(metric, area)
            }
            MetricOrigin::Checkpoints => {
                let (passed, frames) = self.passes(label, checkpoint);
                (frames > 0).then(|| passed as f64 / frames as f64)
            }
            MetricOrigin::Drives(number) => {
                let own = self.drives.iter().find(|d| d.algorithm == label)?;
                match number {
                    DriveNumber::Finished => Some(own.finished_share()),
                    DriveNumber::Collisions => own.collisions_per_100m,
                    DriveNumber::NearMisses => own.near_misses_per_100m,
                    DriveNumber::Driven => Some(own.route_m),
                }
            }
        }
    }

    /// Number of frames in which checkpoints pass, and of those that show one. `checkpoint`: the
    /// only one that counts, in place of all.
    pub(super) fn passes(&self, label: &str, checkpoint: Option<u32>) -> (u64, u64) {
        let own = self.checkpoints.iter().filter(|c| {
            c.algorithm == label && checkpoint.is_none_or(|number| c.checkpoint == number)
        });
        own.fold((0, 0), |(passed, frames), c| {
            (passed + c.passed, frames + c.frames)
        })
    }

    /// Adds the errors of distances.
    pub fn add_accuracy(&mut self, rows: &[AccuracyRow]) {
        for row in rows.iter().filter(|row| row.is_of_all()) {
            let own = self.algorithms.iter_mut();
            for summary in own.filter(|own| own.algorithm == row.algorithm) {
                for metric in METRICS {
                    if let MetricOrigin::Cells { number, .. } = metric.origin {
                        let value = row.number(number);
                        summary.totals.0.set_in(metric.name, row.area, value);
                    }
                }
            }
        }
        self.accuracy = rows.to_vec();
    }

    /// Selects the area whose numbers all tables, sentences and plots have.
    fn select(&mut self, area: AreaChoice) {
        self.area = area;
        for own in &mut self.algorithms {
            own.totals.0 = own.totals.0.in_area(area);
        }
    }

    /// Adds the prior, of its rows.
    ///
    /// # Errors
    /// As [`Summary::from_rows`].
    pub fn add_prior(&mut self, rows: &[Row]) -> Result<()> {
        let mut summary = Self::from_frames_of(rows, &[])?;
        self.prior = summary.algorithms.pop().map(|prior| AlgorithmSummary {
            results_hash: None,
            ..prior
        });
        Ok(())
    }

    /// Adds the results of drives.
    pub fn add_drives(&mut self, rows: &[DriveRow]) {
        self.drives = drives::summarize(rows, None);
        // Each algorithm drives its own way and sees pairs of its own.
        if !rows.is_empty() {
            self.scope.pairs = self.algorithms.iter().map(|a| a.pairs).sum();
        }
        super::stress::add_drives(&mut self.stress, &self.drives, rows);
    }

    /// The kind of the run by what was measured.
    pub fn kind(&self) -> RunKind {
        let has = |name: &str| self.algorithms.iter().any(|a| a.totals.get(name).is_some());
        match self.drives[..] {
            [] => RunKind::from_measured(has),
            _ => RunKind::Courses,
        }
    }

    /// Caveat above every table that needs a truth; absent if that is exact.
    pub fn caution(&self) -> Option<String> {
        caution(&self.truth)
    }

    /// Sums up the tables of [`super::Row`] and [`super::CheckpointRow`].
    fn from_frames(rows: &DataFrame, checkpoints: &DataFrame) -> PolarsResult<Self> {
        let algorithms: Vec<_> = groups(rows, &["algorithm"])?
            .iter()
            .map(algorithm)
            .collect::<PolarsResult<_>>()?;
        let mut checkpoints: Vec<_> = groups(checkpoints, &["checkpoint", "algorithm"])?
            .iter()
            .map(checkpoint)
            .collect::<PolarsResult<_>>()?;
        let order = |name: &str| algorithms.iter().position(|a| a.algorithm == name);
        // Stable: equal checkpoints of several algorithms follow the order of the rows.
        checkpoints.sort_by_key(|c| (c.checkpoint, order(&c.algorithm)));
        Ok(Self {
            schema: SCHEMA,
            pairs_hash: pairs_hash(rows)?,
            truth: truths(rows)?,
            algorithms,
            checkpoints,
            ..Self::default()
        })
    }
}

/// Caveat beside numbers that come of these origins of truths.
pub(super) fn caution(truths: &[String]) -> Option<String> {
    let origins = truths
        .iter()
        .map(|truth| TruthOrigin::try_from(truth.clone()));
    let cautions: Vec<_> = origins
        .filter_map(|origin| origin.ok()?.caution())
        .collect();
    let exact = truths.len() > cautions.len() && !cautions.is_empty();
    let exact = exact.then(|| "partly against exact truth".to_owned());
    let words: Vec<_> = cautions.into_iter().chain(exact).collect();
    (!words.is_empty()).then(|| words.join("; "))
}

fn truths(rows: &DataFrame) -> PolarsResult<Vec<String>> {
    let mut truths: Vec<String> = Vec::new();
    for truth in rows.column("truth")?.str()?.iter().flatten() {
        if !truths.iter().any(|known| known == truth) {
            truths.push(truth.to_owned());
        }
    }
    Ok(truths)
}

/// Non-empty groups, in order of appearance.
fn groups(frame: &DataFrame, by: &[&str]) -> PolarsResult<Vec<DataFrame>> {
    if frame.height() == 0 {
        Ok(Vec::new())
    } else {
        // Polars cannot partition an empty frame without columns.
        frame.partition_by_stable(by.iter().copied(), true)
    }
}

fn algorithm(rows: &DataFrame) -> PolarsResult<AlgorithmSummary> {
    let summary = AlgorithmSummary {
        algorithm: first(rows, "algorithm")?,
        pairs: rows.height() as u64,
        totals: metric_totals(rows)?,
        results_hash: Some(digest(rows.column("result_hash")?.str()?.iter().flatten())),
        ..AlgorithmSummary::default()
    };
    // A map that others computed has no times.
    if rows.column("total_us")?.null_count() == rows.height() {
        return Ok(summary);
    }
    let speed = Speed::from_rows(rows)?;
    let [
        smoothing_ms,
        texture_ms,
        matching_ms,
        checks_ms,
        filters_ms,
        other_ms,
    ] = speed.stages_ms.map(Some);
    let time_per_gd_s = speed.time_per_gd_s();
    Ok(AlgorithmSummary {
        p50_ms: Some(speed.rank_ms(0.50)),
        p95_ms: Some(speed.rank_ms(0.95)),
        p99_ms: Some(speed.rank_ms(0.99)),
        max_ms: Some(speed.rank_ms(1.0)),
        time_per_mp_s: Some(speed.time_per_mp_s()),
        time_per_gd_s,
        mde_per_s: time_per_gd_s.filter(|t| *t > 0.0).map(|t| 1e3 / t),
        smoothing_ms,
        texture_ms,
        matching_ms,
        checks_ms,
        filters_ms,
        other_ms,
        outliers: Some(speed.outliers()),
        ..summary
    })
}

fn checkpoint(runs: &DataFrame) -> PolarsResult<CheckpointSummary> {
    let best = flags(runs, "best_passed")?;
    let worst = flags(runs, "worst_passed")?;
    Ok(CheckpointSummary {
        checkpoint: runs
            .column("checkpoint")?
            .u32()?
            .first()
            .unwrap_or_default(),
        name: first(runs, "name")?,
        algorithm: first(runs, "algorithm")?,
        frames: sum(runs, "frames")?.unwrap_or_default(),
        passed: sum(runs, "passed")?.unwrap_or_default(),
        // The best frame of all runs passes when the best frame of any run does.
        best_passed: (!best.is_empty()).then(|| best.contains(&true)),
        worst_passed: (!worst.is_empty()).then(|| !worst.contains(&false)),
    })
}

/// A pair's rows are consecutive.
fn pairs_hash(rows: &DataFrame) -> PolarsResult<Option<String>> {
    if rows.height() == 0 {
        return Ok(None);
    }
    let (seeds, sequences) = (rows.column("seed")?.u64()?, rows.column("sequence")?.u64()?);
    let (runs, hashes) = (rows.column("run")?.str()?, rows.column("pair_hash")?.str()?);
    let mut pairs: Vec<_> = seeds
        .iter()
        .zip(runs.iter().zip(sequences.iter()))
        .zip(hashes.iter())
        .collect();
    // Each algorithm has a row per pair; dedup leaves one per pair, as they are neighbours.
    pairs.dedup();
    Ok(Some(digest(pairs.into_iter().filter_map(|(_, hash)| hash))))
}

fn digest<'a>(hashes: impl Iterator<Item = &'a str>) -> String {
    hash(&hashes.collect::<Vec<_>>().join("\n"))
}

fn first(group: &DataFrame, column: &str) -> PolarsResult<String> {
    Ok(group
        .column(column)?
        .str()?
        .first()
        .unwrap_or_default()
        .to_owned())
}

fn sum(group: &DataFrame, column: &str) -> PolarsResult<Option<u64>> {
    let column = group.column(column)?.u64()?;
    Ok(column.iter().flatten().reduce(|a, b| a + b))
}

fn flags(group: &DataFrame, column: &str) -> PolarsResult<Vec<bool>> {
    Ok(group.column(column)?.bool()?.iter().flatten().collect())
}
