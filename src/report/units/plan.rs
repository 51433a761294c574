//! The list of a report: what it is of, as digests.

use serde::{Deserialize, Serialize};
use svl_core::Result;
use svl_core::depth::{CellDecision, GridSettings};
use svl_files::safe_name;
use svl_score::losses::Missing;
use svl_score::manifest::{AlgorithmRecord, Manifest, Purpose, hash};
use svl_score::scenario::is_of_witness;

/// Limit of the algorithms with pictures: the first of the report.
const MAX_PICTURED: usize = 8;

/// What a report is of, as the last `svl score` on its folder asked for it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReportPlan {
    /// Form of its units, by the program that wrote it.
    format: String,
    pub manifest: Manifest,
    /// All runs, in their order.
    pub runs: Vec<ReportRun>,
    /// The algorithm by which errors are estimated, if they are.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub witness: Option<PlannedWitness>,
    /// Per limit of the scenario its line in the file.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub limit_lines: Vec<usize>,
    /// Pairs that were lost as live topics were recorded for it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lost: Option<Missing>,
}

/// The witness of a report: an algorithm that no table shows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlannedWitness {
    pub record: AlgorithmRecord,
    /// True if it is asked for, also where there is a truth.
    pub is_asked: bool,
}

impl PlannedWitness {
    /// True if it matches the pairs of a run.
    fn is_of(&self, run: &ReportRun) -> bool {
        run.stress.is_none() && !run.is_raw && (self.is_asked || !run.has_truth)
    }
}

/// An algorithm of a report, as far as its units depend on it.
pub struct PlannedAlgorithm<'a> {
    pub label: &'a str,
    /// Digest of the algorithm, its parameters and its name in the rows.
    pub digest: String,
    /// True if a result depends on all earlier pairs of its run.
    pub has_run_memory: bool,
    /// The name of the maps that it reports, if others computed them.
    pub maps: Option<String>,
}

impl ReportPlan {
    /// The report of these runs under the options of a manifest, with units of that form. `runs`:
    /// their keys; they get their digests here.
    ///
    /// # Errors
    /// The errors of [`Manifest::identity_hash`].
    pub fn new(format: String, manifest: Manifest, mut runs: Vec<ReportRun>) -> Result<Self> {
        let options = manifest.identity_hash(Purpose::Keep)?;
        for run in &mut runs {
            let key = (&run.run, run.seed, &run.stress);
            run.digest = hash(&format!("{format} {options} {key:?}"));
        }
        Ok(Self {
            format,
            manifest,
            runs,
            witness: None,
            limit_lines: Vec::new(),
            lost: None,
        })
    }

    /// True if both are of the same runs under the same options.
    pub fn has_runs_of(&self, other: &Self) -> bool {
        self.runs == other.runs
    }

    /// True if the runs are drives.
    pub fn is_driven(&self) -> bool {
        let description = self.manifest.description.as_ref();
        let kind = description.and_then(|value| value.pointer("/source/kind"));
        kind.is_some_and(|kind| kind == "drive")
    }

    /// True if the runs approach test pieces.
    pub fn has_pieces(&self) -> bool {
        let description = self.manifest.description.as_ref();
        description.is_some_and(|value| value.get("piece").is_some())
    }

    /// The labels of the algorithms, in their order.
    pub fn labels(&self) -> Vec<&str> {
        self.manifest.labels().collect()
    }

    /// The algorithms with pictures: a page is to be sent around.
    pub fn pictured(&self) -> Vec<&str> {
        self.manifest.labels().take(MAX_PICTURED).collect()
    }

    /// The algorithms that match a run: a map that others computed is not that of perturbed pairs.
    pub fn algorithms_of(&self, run: &ReportRun) -> Vec<PlannedAlgorithm<'_>> {
        let is_own = |record: &&AlgorithmRecord| run.stress.is_none() || !record.is_recorded();
        let records = self.manifest.algorithms.iter().filter(is_own);
        let witness = self.witness.iter().filter(|own| own.is_of(run));
        let records = records.chain(witness.map(|own| &own.record));
        records.map(PlannedAlgorithm::new).collect()
    }

    /// True if it tells errors that are estimated, or why there are none.
    pub(crate) fn has_estimates(&self) -> bool {
        let has_truth = self.runs.iter().any(|run| run.has_truth);
        self.witness.is_some() || !has_truth && !self.is_driven()
    }

    /// Why the errors of an algorithm cannot be estimated, whatever its cells.
    pub(crate) fn why_no_estimate(&self, label: &str) -> Option<String> {
        let mut records = self.manifest.algorithms.iter();
        let record = records.find(|own| own.label == label)?;
        let grid: GridSettings = self.manifest.part("grid").ok()?.unwrap_or_default();
        let why = if is_of_witness(&record.name) {
            "v5 is the witness: a board in view (--truth board:9x6) or labels give a number"
        } else if grid.decision == CellDecision::Safe {
            "decision = \"safe\" is of v5, the witness: a board in view or labels give a number"
        } else if self.runs.iter().any(|run| run.is_raw) {
            "its pairs are raw, and matched as they are: svl calibrate board"
        } else {
            return None;
        };
        Some(why.to_owned())
    }

    /// The digests of all algorithms.
    pub fn digests(&self) -> Vec<String> {
        let witness = self.witness.iter().map(|own| &own.record);
        let records = self.manifest.algorithms.iter().chain(witness);
        let records = records.map(|own| PlannedAlgorithm::new(own).digest);
        records.collect()
    }

    /// Digest of all runs and algorithms.
    pub fn digest(&self) -> String {
        hash(&format!("{:?} {:?}", self.runs, self.digests()))
    }
}

impl<'a> PlannedAlgorithm<'a> {
    fn new(record: &'a AlgorithmRecord) -> Self {
        let AlgorithmRecord {
            name,
            label,
            parameters,
            parameters_hash,
            has_run_memory,
            ..
        } = record;
        Self {
            label,
            digest: hash(&format!("{label}={name}:{parameters_hash}")),
            has_run_memory: *has_run_memory,
            maps: record.is_recorded().then(|| format!("{name}:{parameters}")),
        }
    }
}

/// A run of a report.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct ReportRun {
    /// The key of the run in the rows.
    pub run: Option<String>,
    pub seed: Option<u64>,
    pub stress: Option<String>,
    /// True if its pairs have a truth, and if they are raw ones that are matched as they are.
    #[serde(default)]
    pub has_truth: bool,
    #[serde(default)]
    pub is_raw: bool,
    /// Digest of the key, of the options of the run and of svl's sources.
    pub digest: String,
}

impl ReportRun {
    fn keys(&self, seed: &str) -> Vec<String> {
        let seed = self.seed.map(|number| format!("{seed}{number}"));
        let keys = [self.run.clone(), seed, self.stress.clone()];
        keys.into_iter().flatten().collect()
    }

    /// The name of its folder: words for a reader, and its digest.
    pub fn folder(&self) -> String {
        let name = safe_name(&self.keys("seed-").join("-"), 60);
        format!("{name}-{}", &self.digest[..16])
    }

    /// In words.
    pub fn words(&self) -> String {
        match &self.keys("seed ")[..] {
            [] => "the scenes".to_owned(),
            keys => keys.join(", "),
        }
    }
}

/// Number of selected pairs of a run in a block.
pub const BLOCK: u64 = 64;
