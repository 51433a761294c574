//! The results of a report: per algorithm, and per checkpoint and algorithm.

use super::best::{Best, SweepChoice, Unfit, by_algorithm};
use super::common::{RankedPairs, only};
use crate::rows::held::{RowRef, Rows};
use crate::rows::records::{CheckpointRow, FailureRow, MetricTotals, record};
use crate::rows::samples::{self, grouped};
use crate::subjects::accuracy::AccuracyRow;
use crate::subjects::drives::{self, DriveRow, DriveSummary, TrackRow};
use crate::subjects::pieces::{PieceRow, SeenShares, SightRow, narrowest, seen_shares};
use crate::subjects::recordings::{RecordingSummary, recordings};
use crate::subjects::reliability::ReliabilityRow;
use crate::subjects::sources::Sources;
use crate::subjects::speed::Speed;
use crate::subjects::stress::StressSummary;
use crate::subjects::witness::EstimateRow;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use svl_core::Result;
use svl_core::depth::GridSettings;
use svl_core::matcher::{self, MatcherSpec, ProgramRecord};
use svl_core::stereo::{CellRule, TruthOrigin};
use svl_files::slow_profile;
use svl_score::judge::{
    AreaChoice, Cases, ColumnChoice, METRICS, Measured, Metric, MetricOrigin, MetricSource as _,
    TruthLevel,
};
use svl_score::losses::Ending;
use svl_score::manifest::{Manifest, SCHEMA, hash};
use svl_score::scenario::DistanceRange;

/// The results of a report.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Results {
    /// Version of the files of a report, [`SCHEMA`].
    pub schema: u32,
    /// The end of the report, and the pairs that it misses.
    #[serde(flatten)]
    pub ending: Ending,
    /// Digest of the pairs' hashes in their order; absent without pairs.
    pub pairs_hash: Option<String>,
    /// Origins of the truths: each [`svl_core::stereo::TruthOrigin`] of the rows, once.
    pub truth: Vec<String>,
    /// The work that the times of the last session measure, or why it has none, if that is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub times: Option<String>,
    /// In the order in which they first appear in the rows.
    pub algorithms: Vec<AlgorithmSummary>,
    /// The prior and the exact distances, where cells are scored by distances.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub references: Vec<AlgorithmSummary>,
    /// By recording, then as the algorithms; empty for a single recording.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub recordings: Vec<RecordingSummary>,
    /// By number of the checkpoint, then as the algorithms.
    pub checkpoints: Vec<CheckpointSummary>,
    /// The units and tables that it is of.
    pub made_of: Sources,
    /// The best algorithms by the headline metrics; those of [`Results::new`] alone.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub best: Vec<Best>,
    /// The algorithms that may not be best by any metric, each with the reason.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub unfit: BTreeMap<String, Unfit>,
    /// The settings of swept algorithms.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub choices: Vec<SweepChoice>,
    /// Algorithms that failed on pairs.
    pub failed: Vec<FailedAlgorithm>,
    /// The warnings of the report, in their order.
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
    /// Errors that are estimated without truth, by area.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub estimates: Vec<EstimateRow>,
    /// Reaches of test pieces.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub pieces: Vec<PieceRow>,
    /// Delays of the topics whose maps were scored.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub latency: Vec<TopicDelay>,
    /// Drives, if the algorithms steered a robot, in the order of the algorithms.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub drives: Vec<DriveSummary>,
    /// Results per perturbation, level and algorithm, if pairs were perturbed.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub stress: Vec<StressSummary>,
    /// Facts that sentences and tables need besides.
    #[serde(skip)]
    pub(crate) basis: ResultBasis,
    /// The way that sentences and tables show them.
    #[serde(skip)]
    pub shown: Shown,
}

/// The way that results are shown.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shown {
    /// The metrics that tables show.
    pub columns: ColumnChoice,
    /// The metric that the user sorts the algorithms by.
    pub sort: Option<&'static Metric>,
    /// Rule by which cells were scored.
    pub rule: CellRule,
}

/// The rows of a report's tables, without those of the cells.
#[derive(Default)]
pub struct ReportTables {
    pub rows: Rows,
    pub failures: Vec<FailureRow>,
    pub checkpoints: Vec<CheckpointRow>,
    /// Accuracy of cells, where they are asked for.
    pub accuracy: Vec<AccuracyRow>,
    pub reliability: Vec<ReliabilityRow>,
    /// The rows of the references, where cells are scored by distances.
    pub references: Rows,
    pub estimates: Vec<EstimateRow>,
    /// Pairs of approaches to test pieces, and what they add up to.
    pub sights: Vec<SightRow>,
    pub pieces: Vec<PieceRow>,
    /// Doubts of the ways that robots drove.
    pub warnings: Vec<String>,
    pub drives: Vec<DriveRow>,
    pub tracks: Vec<TrackRow>,
}

/// The results of a report besides its tables.
#[derive(Default)]
pub struct ResultParts<'a> {
    pub ending: Ending,
    pub latency: Vec<TopicDelay>,
    pub made_of: Sources,
    /// Programs, failures and warnings.
    pub manifest: Option<&'a Manifest>,
    /// True if the times are of matching alone.
    pub is_measured: bool,
    /// The algorithms whose times may be compared have the same number.
    pub time_groups: BTreeMap<String, usize>,
}

/// Facts that sentences and tables need besides the results.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct ResultBasis {
    /// The pairs, their size and their runs.
    pub(crate) scope: ResultScope,
    /// The area whose numbers tables, sentences and plots have: that of the rows.
    pub(crate) area: AreaChoice,
    /// The pairs that the numbers are of.
    pub(crate) common: RankedPairs,
    /// The numbers of algorithms and references over their own pairs, for limits; empty where they
    /// are those that are shown.
    pub(crate) own: Vec<AlgorithmSummary>,
    /// The algorithms that report the truth itself.
    pub(crate) perfect: Vec<String>,
    /// The profile of svl's build, if its times are not those of svl.
    pub(crate) slow_profile: Option<String>,
    /// The part of the pairs that see a test piece, by its distance.
    pub(crate) seen: Vec<SeenShares>,
    pub(crate) is_measured: bool,
    /// The algorithms whose times may be compared have the same number; all of results without a
    /// report, which has none.
    pub(crate) time_groups: BTreeMap<String, usize>,
}

/// The extent of the results.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct ResultScope {
    /// Number of unperturbed pairs that any algorithm matched.
    pub pairs: u64,
    /// Widths and heights of the images, pixels, each once.
    pub sizes: Vec<(u32, u32)>,
    /// Recordings, courses or seeds.
    pub runs: u64,
    /// Pairs and cells that were scored against a truth, of the algorithm with the most; `None`
    /// without one.
    pub scored: Option<(u64, u64)>,
    /// The cells of the grid of a pair.
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

impl ResultScope {
    fn new(rows: &[RowRef<'_>], algorithms: &[AlgorithmSummary]) -> Self {
        let pairs = rows
            .iter()
            .map(|r| (r.origin().run_key(), r.sequence(), r.name()));
        let pairs: BTreeSet<_> = pairs.collect();
        let runs: BTreeSet<_> = rows.iter().map(|row| row.origin().run_key()).collect();
        let sizes: BTreeSet<_> = rows.iter().map(|row| (row.width(), row.height())).collect();
        let values =
            |name: &'static str| rows.iter().filter_map(move |row| row.metrics().get(name));
        Self {
            pairs: pairs.len() as u64,
            sizes: sizes.into_iter().collect(),
            runs: runs.len() as u64,
            scored: algorithms.iter().filter_map(AlgorithmSummary::scored).max(),
            cells_of_pair: values("scored_cells").fold(0.0, f64::max) as u64,
            by_distance: values("missed").count() as u64,
            knowing_floor: values("floor").count() as u64,
        }
    }
}

impl AlgorithmSummary {
    /// The results of the rows of an algorithm, at least one.
    fn new(rows: &[RowRef<'_>]) -> Self {
        let summary = Self {
            algorithm: rows[0].algorithm().to_owned(),
            pairs: rows.len() as u64,
            totals: samples::totals(rows),
            results_hash: Some(digest(rows.iter().map(|row| row.result_hash()))),
            ..Self::default()
        };
        // A map that others computed has no times.
        if rows.iter().all(|row| row.total_us().is_none()) {
            return summary;
        }
        let speed = Speed::from_rows(rows);
        let [p50, p95, p99, max] = [0.50, 0.95, 0.99, 1.0].map(|share| Some(speed.rank_ms(share)));
        let [smoothing, texture, matching, checks, filters, other] = speed.stages_ms.map(Some);
        let time_per_gd_s = speed.time_per_gd_s();
        Self {
            p50_ms: p50,
            p95_ms: p95,
            p99_ms: p99,
            max_ms: max,
            time_per_mp_s: Some(speed.time_per_mp_s()),
            time_per_gd_s,
            mde_per_s: time_per_gd_s.filter(|t| *t > 0.0).map(|t| 1e3 / t),
            smoothing_ms: smoothing,
            texture_ms: texture,
            matching_ms: matching,
            checks_ms: checks,
            filters_ms: filters,
            other_ms: other,
            outliers: Some(speed.outliers()),
            ..summary
        }
    }

    /// The mean times of [`crate::subjects::speed::STAGES`].
    pub(crate) fn stages_ms(&self) -> [Option<f64>; 6] {
        [
            self.smoothing_ms,
            self.texture_ms,
            self.matching_ms,
            self.checks_ms,
            self.filters_ms,
            self.other_ms,
        ]
    }

    /// Numbers of pairs and of cells that were scored against a truth; `None` if no pair has one.
    pub fn scored(&self) -> Option<(u64, u64)> {
        let count = |name| self.totals.get(name).map(|count| count as u64);
        count("scored_pairs").zip(count("scored_cells"))
    }

    /// Number of scored cells of an area; `None` if it has none.
    pub fn cells_in(&self, area: AreaChoice) -> Option<u64> {
        let right = Metric::find("right")?;
        self.totals.measured(right, area)?.cases.cells
    }

    /// The value of a metric, absent if it is not measured.
    pub fn value(&self, metric: &Metric) -> Option<f64> {
        metric.value_of(self.totals.measured(metric, self.totals.area())?)
    }

    /// Sets a metric of no area.
    fn set(&mut self, name: &str, value: Option<f64>, cases: Cases) {
        if let Some((metric, value)) = Metric::find(name).zip(value) {
            let own = Measured { value, cases };
            self.totals.set(metric, AreaChoice::default(), own);
        }
    }
}

impl CheckpointSummary {
    /// The results of the rows of a checkpoint and an algorithm, at least one.
    fn new(rows: &[&CheckpointRow]) -> Self {
        let flags = |flag: fn(&CheckpointRow) -> Option<bool>| {
            let flags: Vec<_> = rows.iter().filter_map(|row| flag(row)).collect();
            (!flags.is_empty()).then_some(flags)
        };
        Self {
            checkpoint: rows[0].checkpoint,
            name: rows[0].name.clone(),
            algorithm: rows[0].algorithm.clone(),
            frames: rows.iter().map(|row| row.frames).sum(),
            passed: rows.iter().map(|row| row.passed).sum(),
            // The best frame of all runs passes when the best frame of any run does.
            best_passed: flags(|row| row.best_passed).map(|all| all.contains(&true)),
            worst_passed: flags(|row| row.worst_passed).map(|all| !all.contains(&false)),
        }
    }

    /// Fraction of frames in which the checkpoint passes.
    pub fn share(&self) -> Option<f64> {
        (self.frames > 0).then(|| self.passed as f64 / self.frames as f64)
    }
}

impl Results {
    /// The results of these tables.
    ///
    /// # Errors
    /// The error of a perturbation that svl does not know.
    pub fn new(tables: &ReportTables, parts: ResultParts<'_>, shown: Shown) -> Result<Self> {
        let own = Self::from_tables(
            tables,
            &only(&tables.rows, None),
            &only(&tables.references, None),
        );
        let (common, pairs) = RankedPairs::new(&tables.rows, &tables.failures);
        // Each algorithm drives its own way and sees pairs of its own.
        let mut results = match pairs.as_ref().filter(|_| tables.drives.is_empty()) {
            None => own,
            Some(pairs) => {
                let references = only(&tables.references, Some(pairs));
                let rows = only(&tables.rows, Some(pairs));
                own.over_common(Self::from_tables(tables, &rows, &references))
            }
        };
        results.ending = parts.ending;
        results.latency = parts.latency;
        results.made_of = parts.made_of;
        results.accuracy.clone_from(&tables.accuracy);
        results.reliability.clone_from(&tables.reliability);
        results.estimates.clone_from(&tables.estimates);
        results.pieces.clone_from(&tables.pieces);
        results.basis.seen = seen_shares(&tables.sights);
        results.shown = shown;
        results.basis.common = common;
        results.basis.is_measured = parts.is_measured;
        results.basis.time_groups = parts.time_groups;
        if let Some(manifest) = parts.manifest {
            results.add_manifest(manifest);
            let grid: Option<GridSettings> = manifest.part("grid")?;
            let cells = grid.map_or(0, |grid| grid.shape().cells() as u64);
            let scope = &mut results.basis.scope;
            scope.cells_of_pair = scope.cells_of_pair.max(cells);
        }
        results.stress = results.stressed(tables)?;
        // The order matters: the manifest has the algorithms that failed on every pair, which are
        // sorted, too; the best is the first of equal ones.
        if let Some(metric) = results.shown.sort {
            results.sort_by(metric);
        }
        results.recordings = recordings(&tables.rows);
        let mut rows = by_algorithm(&tables.rows);
        rows.extend(by_algorithm(&tables.references));
        results.find_best(&rows, &tables.drives);
        let records = parts
            .manifest
            .map_or(&[][..], |manifest| &manifest.algorithms);
        results.choose_settings(records, &rows);
        Ok(results)
    }

    /// The sums of these rows and of what has none.
    fn from_tables(tables: &ReportTables, rows: &[RowRef<'_>], references: &[RowRef<'_>]) -> Self {
        let mut results = Self::over(rows, &tables.checkpoints, None);
        results.references = grouped(references, |row| row.algorithm(), AlgorithmSummary::new);
        for own in &mut results.references {
            own.results_hash = None;
            results.basis.scope.scored = results.basis.scope.scored.max(own.scored());
        }
        results.add_accuracy(&tables.accuracy);
        results.add_estimates(&tables.estimates);
        results.add_pieces(&tables.pieces);
        results.add_drives(&tables.drives, None);
        results
    }

    /// The results over the common pairs, with these over own pairs.
    fn over_common(mut self, common: Self) -> Self {
        let own = [&self.algorithms[..], &self.references].concat();
        for a in &mut self.algorithms {
            if let Some(shown) = common
                .algorithms
                .iter()
                .find(|own| own.algorithm == a.algorithm)
            {
                let results_hash = a.results_hash.take();
                *a = AlgorithmSummary {
                    results_hash,
                    ..shown.clone()
                };
            }
        }
        self.basis.scope.scored = common.basis.scope.scored;
        self.references = common.references;
        self.basis.own = own;
        self
    }

    /// The sums of the rows with that perturbation.
    pub fn from_rows(rows: &Rows, checkpoints: &[CheckpointRow], stress: Option<&str>) -> Self {
        let rows = rows.iter().filter(|row| row.stress() == stress);
        Self::over(&rows.collect::<Vec<_>>(), checkpoints, stress)
    }

    /// The sums of these rows, and of the checkpoints with that perturbation.
    fn over(rows: &[RowRef<'_>], checkpoints: &[CheckpointRow], stress: Option<&str>) -> Self {
        let checkpoints = checkpoints.iter();
        let checkpoints = checkpoints.filter(|row| row.stress.as_deref() == stress);
        let algorithms = grouped(rows, |row| row.algorithm(), AlgorithmSummary::new);
        let key = |row: &'_ CheckpointRow| (row.checkpoint, row.algorithm.clone());
        let checkpoints: Vec<_> = checkpoints.collect();
        let mut checkpoints = grouped(&checkpoints, key, CheckpointSummary::new);
        let order = |name: &str| algorithms.iter().position(|a| a.algorithm == name);
        // Stable: equal checkpoints of several algorithms follow the order of the rows.
        checkpoints.sort_by_key(|c| (c.checkpoint, order(&c.algorithm)));
        let area = rows.first().map(|row| row.metrics().area());
        let mut results = Self {
            schema: SCHEMA,
            pairs_hash: pairs_hash(rows),
            truth: truths(rows),
            basis: ResultBasis {
                scope: ResultScope::new(rows, &algorithms),
                area: area.unwrap_or_default(),
                ..ResultBasis::default()
            },
            algorithms,
            checkpoints,
            ..Self::default()
        };
        for i in 0..results.algorithms.len() {
            let passes = results.passes(&results.algorithms[i].algorithm, None);
            if let Some(Measured { value, cases }) = share_passed(passes) {
                results.algorithms[i].set("passed", Some(value), cases);
            }
        }
        results
    }

    /// Adds what only the manifest has.
    fn add_manifest(&mut self, manifest: &Manifest) {
        self.times.clone_from(&manifest.times);
        self.warnings.clone_from(&manifest.warnings);
        self.basis.slow_profile = slow_profile(manifest.profile.as_deref());
        for record in &manifest.algorithms {
            if matcher::find(&record.name).is_ok_and(MatcherSpec::is_truth) {
                self.basis.perfect.push(record.label.clone());
            }
            let program = record.program.clone();
            self.programs.extend(program.map(|program| ProgramSummary {
                algorithm: record.label.clone(),
                program,
            }));
            let mut summaries = self.algorithms.iter_mut();
            let summary = summaries.find(|a| a.algorithm == record.label);
            let failure = record.failure.as_ref();
            self.failed.extend(failure.map(|reason| FailedAlgorithm {
                algorithm: record.label.clone(),
                pairs: record.failed_pairs,
                on_every_pair: summary.is_none(),
                reason: reason.clone(),
            }));
            if let Some(summary) = summary {
                summary.memory_mb = record.memory_bytes.map(|bytes| bytes as f64 / 1e6);
                summary.failed_pairs = record.failed_pairs;
            } else if record.failed_pairs > 0 {
                let mut failed = AlgorithmSummary {
                    algorithm: record.label.clone(),
                    failed_pairs: record.failed_pairs,
                    ..AlgorithmSummary::default()
                };
                let scored = (!self.truth.is_empty()).then_some(0.0);
                failed.set("scored_pairs", scored, Cases::default());
                self.algorithms.push(failed);
            }
        }
    }

    /// Adds the digests of pairs and results, and the warnings, to the manifest.
    pub fn complete(&self, manifest: &mut Manifest) {
        manifest.warnings.clone_from(&self.warnings);
        manifest.doubts.clone_from(&self.ending.missing.doubts);
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
        let first = labels.next().map(|label| self.basis.time_groups.get(label));
        labels.all(|label| Some(self.basis.time_groups.get(label)) == first)
    }

    /// True if the times of all algorithms may be compared.
    pub(crate) fn has_comparable_times(&self) -> bool {
        self.are_times_comparable(self.algorithms.iter().map(|a| a.algorithm.as_str()))
    }

    /// The value of any metric, absent if it is not measured. `checkpoint`: the only one that
    /// counts, in place of all.
    pub fn value(&self, label: &str, metric: &Metric, checkpoint: Option<u32>) -> Option<f64> {
        metric.value_of(self.measurement(label, metric, checkpoint, self.basis.area)?)
    }

    /// [`Self::value`] over the cells of an area with its cases, however few.
    pub fn measurement(
        &self,
        label: &str,
        metric: &Metric,
        checkpoint: Option<u32>,
        area: AreaChoice,
    ) -> Option<Measured> {
        if checkpoint.is_some() {
            return share_passed(self.passes(label, checkpoint));
        }
        let mut all = self.algorithms.iter().chain(&self.references);
        let own = all.find(|a| a.algorithm == label)?;
        own.totals.measured(metric, area)
    }

    /// An algorithm or a reference over its own pairs, as limits are of.
    pub(crate) fn own(&self, label: &str) -> Option<&AlgorithmSummary> {
        let shown = self.algorithms.iter().chain(&self.references);
        self.basis
            .own
            .iter()
            .chain(shown)
            .find(|a| a.algorithm == label)
    }

    /// Number of frames in which checkpoints pass, and of those that show one. `checkpoint`: the
    /// only one that counts, in place of all.
    pub(crate) fn passes(&self, label: &str, checkpoint: Option<u32>) -> (u64, u64) {
        let own = self.checkpoints.iter().filter(|c| {
            c.algorithm == label && checkpoint.is_none_or(|number| c.checkpoint == number)
        });
        own.fold((0, 0), |(passed, frames), c| {
            (passed + c.passed, frames + c.frames)
        })
    }

    /// A metric of an algorithm's cells at those true distances.
    pub(crate) fn error_within(
        &self,
        label: &str,
        metric: &Metric,
        area: AreaChoice,
        range: DistanceRange,
    ) -> Option<Measured> {
        let mut rows = self.accuracy.iter().filter(|row| !row.is_of_pixels);
        let is_asked =
            |row: &&AccuracyRow| row.algorithm == label && row.area == area && row.range() == range;
        let row = rows.find(is_asked)?;
        match metric.origin {
            MetricOrigin::Cells { number, .. } => row.measured(number),
            _ => row.share(metric),
        }
    }

    /// Adds the errors of distances.
    fn add_accuracy(&mut self, rows: &[AccuracyRow]) {
        let cells = rows.iter().filter(|row| !row.is_of_pixels);
        for row in cells.filter(|row| row.is_of_all()) {
            let own = self.algorithms.iter_mut();
            for summary in own.filter(|own| own.algorithm == row.algorithm) {
                for metric in METRICS {
                    if let MetricOrigin::Cells { number, .. } = metric.origin
                        && let Some(own) = row.measured(number)
                    {
                        summary.totals.set(metric, row.area, own);
                    }
                }
            }
        }
    }

    /// Adds the estimated errors.
    fn add_estimates(&mut self, rows: &[EstimateRow]) {
        for row in rows {
            let own = self.algorithms.iter_mut();
            for summary in own.filter(|own| own.algorithm == row.algorithm) {
                for metric in METRICS {
                    let about = metric.estimated().and_then(|number| row.about(number));
                    if let Some(own) = about {
                        summary.totals.set(metric, row.area, own);
                    }
                }
            }
        }
    }

    /// Adds the reaches of the narrowest test piece.
    fn add_pieces(&mut self, rows: &[PieceRow]) {
        let reach = Metric::find("reach");
        for row in narrowest(rows) {
            let mut own = self.algorithms.iter_mut().chain(&mut self.references);
            let own = own.find(|own| own.algorithm == row.algorithm);
            if let (Some(own), Some(measured), Some(reach)) = (own, row.measured(), reach) {
                own.totals.set(reach, AreaChoice::default(), measured);
            }
        }
    }

    /// The estimated errors of an algorithm in an area.
    pub(crate) fn estimate(&self, label: &str, area: AreaChoice) -> Option<&EstimateRow> {
        let mut rows = self.estimates.iter();
        rows.find(|row| row.algorithm == label && row.area == area)
    }

    /// The estimated errors in the area that is shown, the best algorithm first; none where they
    /// are not shown.
    pub(crate) fn shown_estimates(&self) -> Vec<&EstimateRow> {
        let is_estimated = |metric: &&Metric| metric.estimated().is_some();
        let are_shown = self
            .shown
            .columns
            .metrics(self.kind())
            .iter()
            .any(is_estimated);
        let ranked = self.ranked_algorithms().into_iter().filter(|_| are_shown);
        let rows = ranked.filter_map(|a| self.estimate(&a.algorithm, self.basis.area));
        rows.collect()
    }

    /// Adds the results of drives with that perturbation.
    pub(crate) fn add_drives(&mut self, rows: &[DriveRow], stress: Option<&str>) {
        self.drives = drives::summarize(rows, stress);
        for summary in &mut self.algorithms {
            let own = rows.iter().filter(|row| row.stress.as_deref() == stress);
            let own = own.filter(|row| row.algorithm == summary.algorithm);
            for metric in METRICS.iter().filter(|metric| metric.is_of_drives()) {
                if let Some(measured) = drives::measured(metric, own.clone()) {
                    let area = AreaChoice::default();
                    summary.totals.set(metric, area, measured);
                }
            }
        }
        // Each algorithm drives its own way and sees pairs of its own.
        if !rows.is_empty() {
            self.basis.scope.pairs = self.algorithms.iter().map(|a| a.pairs).sum();
        }
    }

    /// The kind of the report by what was measured.
    pub fn kind(&self) -> TruthLevel {
        if !self.drives.is_empty() {
            return TruthLevel::Courses;
        }
        TruthLevel::from_measured(|name| {
            let mut algorithms = self.algorithms.iter();
            algorithms.any(|a| a.totals.get(name).is_some())
        })
    }

    /// Caveat above every table that needs a truth; absent if that is exact.
    pub fn caution(&self) -> Option<String> {
        caution(&self.truth)
    }
}

/// The fraction of the frames in which checkpoints pass.
fn share_passed((passed, frames): (u64, u64)) -> Option<Measured> {
    (frames > 0).then(|| Measured {
        value: passed as f64 / frames as f64,
        cases: Cases::items(frames),
    })
}

/// Caveat beside numbers that come of these origins of truths.
pub(crate) fn caution(truths: &[String]) -> Option<String> {
    let origins = truths.iter();
    let origins = origins.map(|truth| TruthOrigin::try_from(truth.clone()));
    let cautions: Vec<_> = origins
        .filter_map(|origin| origin.ok()?.caution())
        .collect();
    let exact = truths.len() > cautions.len() && !cautions.is_empty();
    let exact = exact.then(|| "partly against exact truth".to_owned());
    let words: Vec<_> = cautions.into_iter().chain(exact).collect();
    (!words.is_empty()).then(|| words.join("; "))
}

fn truths(rows: &[RowRef<'_>]) -> Vec<String> {
    let mut seen = BTreeSet::new();
    let truths = rows.iter().filter_map(|row| row.truth());
    let truths = truths.filter(|truth| seen.insert(*truth));
    truths.map(str::to_owned).collect()
}

/// Digest of the pairs, each once, in their order. A pair's rows are consecutive.
pub(crate) fn pairs_hash<'a>(rows: &[RowRef<'a>]) -> Option<String> {
    let pair = |row: &RowRef<'a>| (row.origin().run_key(), row.sequence(), row.pair_hash());
    // Each algorithm has a row per pair: neighbours.
    let pairs = rows.chunk_by(|a, b| pair(a) == pair(b));
    (!rows.is_empty()).then(|| digest(pairs.map(|own| own[0].pair_hash())))
}

fn digest<'a>(hashes: impl Iterator<Item = &'a str>) -> String {
    hash(&hashes.collect::<Vec<_>>().join("\n"))
}
