//! The units of a report: what its sessions measured. Measuring writes them, all else reads them.
//!
//! ```text
//! units/plan.json                        what the report is of: scenario, algorithms, runs
//! units/sessions/SESSION.json            a process that matched
//! units/RUN/run.json                     what belongs to no algorithm: pairs, losses, warnings
//! units/RUN/00003-SESSION.rows.csv       a table of a block: the rows of all its algorithms
//! units/RUN/00003-SESSION.json           its seal: which results the tables hold, and their hashes
//! ```
//!
//! A unit is one algorithm over a block of [`BLOCK`] pairs of a run, or one drive. A seal is
//! renamed into place after each batch of pairs, and counts the bytes of the tables that it is of:
//! what was written after it is not read.

mod block;
mod kept;
mod store;
mod tables;

pub use block::{BlockWriter, Seal, SealedPair};
pub use kept::KeptResults;
pub use store::remove_file;
pub use store::{StoredSeal, StoredSession, Units, files_of};
pub use tables::{ReportTables, RunUnits, collect_tables, made_of, read_tables, write_tables};

use super::drives::{CoursePlan, DriveRow, TrackRow};
use super::html::{CheckpointFigure, FrameShot, SceneFigure};
use super::prior::TruthRow;
use super::rows::{CellRow, FailureRow, Record, Row};
use super::summary::TopicDelay;
use serde::{Deserialize, Serialize};
use serde_json::value::{RawValue, to_raw_value};
use svl_core::stereo::Losses;
use svl_core::{Error, Result};
use svl_score::judge::CheckpointFrame;
use svl_score::losses::Missing;
use svl_score::manifest::{AlgorithmRecord, Manifest, RunRecord, hash};
use svl_score::plausibility::MeasuredScales;

/// Number of selected pairs of a run in a block.
pub const BLOCK: u64 = 64;

/// Limit of the algorithms with pictures: the first of the report.
const MAX_PICTURED: usize = 8;

/// The folder of the units in a report's.
pub const UNITS: &str = "units";

/// What a report is of, as the last `svl score` on its folder asked for it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReportPlan {
    /// [`unit_format`] of the program that wrote it.
    #[serde(default)]
    pub format: String,
    pub manifest: Manifest,
    /// All runs, in their order.
    pub runs: Vec<ReportRun>,
    /// Per algorithm of the manifest the hash of all that its results depend on besides the pairs.
    pub identities: Vec<String>,
    /// Per limit of the scenario its line in the file.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub limit_lines: Vec<usize>,
    /// Pairs that were lost as live topics were recorded for it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lost: Option<Missing>,
}

/// The pictures of a block; a change of [`FrameShot`] or [`SceneFigure`] changes it.
const PICTURES: &str = "pictures with truth and errors";

/// Identifies the columns of all tables of units, and their pictures: other versions of svl have
/// others.
pub fn unit_format() -> String {
    let tables = [
        Row::columns(),
        CellRow::columns(),
        FailureRow::columns(),
        DriveRow::columns(),
        TrackRow::columns(),
        TruthRow::columns(),
    ];
    let names = tables.iter().flatten().map(|column| column.name);
    hash(&names.chain([PICTURES]).collect::<Vec<_>>().join("\n"))
}

impl ReportPlan {
    /// True if the runs are drives.
    pub fn is_driven(&self) -> bool {
        let description = self.manifest.description.as_ref();
        let kind = description.and_then(|value| value.pointer("/source/kind"));
        kind.is_some_and(|kind| kind == "drive")
    }

    /// The labels of the algorithms, in their order.
    /// The labels of the algorithms that match a run: a map that others computed is not that of
    /// perturbed pairs.
    pub fn labels_of(&self, run: &ReportRun) -> Vec<&str> {
        let own = |record: &&AlgorithmRecord| run.stress.is_none() || !record.is_recorded();
        let records = self.manifest.algorithms.iter().filter(own);
        records.map(|record| record.label.as_str()).collect()
    }

    pub fn labels(&self) -> Vec<&str> {
        self.manifest.labels().collect()
    }

    /// The algorithms with pictures: a page is to be sent around.
    pub fn pictured(&self) -> Vec<&str> {
        self.manifest.labels().take(MAX_PICTURED).collect()
    }

    /// The identity of an algorithm of the plan.
    pub fn identity(&self, label: &str) -> Option<&str> {
        let place = self.manifest.labels().position(|own| own == label)?;
        Some(&self.identities[place])
    }
}

/// The key of a run in the rows.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct ReportRun {
    pub run: Option<String>,
    pub seed: Option<u64>,
    pub stress: Option<String>,
}

impl ReportRun {
    /// The name of its folder: words for a reader, and a hash.
    pub fn folder(&self) -> String {
        let seed = self.seed.map(|seed| format!("seed-{seed}"));
        let words = [self.run.clone(), seed, self.stress.clone()];
        let words: Vec<_> = words.into_iter().flatten().collect();
        let is_safe = |c: char| c.is_ascii_alphanumeric() || "_-.".contains(c);
        let safe = |c: char| if is_safe(c) { c } else { '-' };
        let name: String = words.join("-").chars().take(60).map(safe).collect();
        let name = name.trim_start_matches('.');
        format!("{name}-{}", &hash(&format!("{self:?}"))[..8])
    }

    /// In words.
    pub fn words(&self) -> String {
        let seed = self.seed.map(|seed| format!("seed {seed}"));
        let words = [self.run.clone(), seed, self.stress.clone()];
        let words: Vec<_> = words.into_iter().flatten().collect();
        if words.is_empty() {
            "the scenes".to_owned()
        } else {
            words.join(", ")
        }
    }
}

/// What a run has besides the results of algorithms.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunFacts {
    pub run: ReportRun,
    pub record: Option<RunRecord>,
    /// The files that were read, as they were.
    pub files: Vec<FileStamp>,
    /// What is known once all its pairs were read.
    pub end: Option<RunEndFacts>,
    /// The error that ended it early.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
    pub warnings: Vec<RunWarning>,
    /// The factors between the truth and the algorithms.
    pub scales: MeasuredScales,
    /// Delays of the topics that it reads maps from.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub latency: Vec<TopicDelay>,
    /// The runs that were registered before it, whose pairs it has no copies of.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub after: Vec<String>,
}

impl RunFacts {
    /// Adds what another process knows of the same run.
    pub fn join(&mut self, other: Self) {
        let new = other.warnings.into_iter();
        new.for_each(|warning| warning.add_to(&mut self.warnings));
        self.end = self.end.take().or(other.end);
        self.record = self.record.take().or(other.record);
        if self.latency.is_empty() {
            self.latency = other.latency;
        }
        for (label, scale) in other.scales.algorithms {
            self.scales.algorithms.entry(label).or_insert(scale);
        }
    }
}

/// What is known once all pairs of a run were read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunEndFacts {
    /// Number of its pairs.
    pub pairs: u64,
    /// Digest of the input hashes of its pairs in their order.
    pub inputs: String,
    pub losses: Losses,
}

/// A warning of a run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RunWarning {
    /// Without the names of its algorithms.
    pub text: String,
    /// The algorithms that it is of; empty for one of the run itself.
    pub algorithms: Vec<String>,
}

impl RunWarning {
    /// A warning, which names its algorithms before a colon; none for that of a failure on a pair,
    /// which a table has.
    pub fn new(warning: String, labels: &[&str]) -> Option<Self> {
        let for_run = |text| Self {
            text,
            algorithms: Vec::new(),
        };
        let Some((head, text)) = warning.split_once(": ") else {
            return Some(for_run(warning));
        };
        let failed = head.split_once(" on pair ");
        if failed.is_some_and(|(label, _)| labels.contains(&label)) {
            return None;
        }
        let named: Vec<_> = head.split(", ").collect();
        Some(if named.iter().all(|name| labels.contains(name)) {
            Self {
                text: text.to_owned(),
                algorithms: named.into_iter().map(str::to_owned).collect(),
            }
        } else {
            for_run(warning)
        })
    }

    /// Adds a warning to others: of one text the algorithms together.
    pub fn add_to(self, warnings: &mut Vec<Self>) {
        let is_same = |own: &&mut Self| {
            own.text == self.text && own.algorithms.is_empty() == self.algorithms.is_empty()
        };
        match warnings.iter_mut().find(is_same) {
            Some(own) => {
                for label in self.algorithms {
                    if !own.algorithms.contains(&label) {
                        own.algorithms.push(label);
                    }
                }
            }
            None => warnings.push(self),
        }
    }

    /// Its words, if it is of the run or of some of these algorithms.
    pub fn words(&self, labels: &[&str]) -> Option<String> {
        let named = labels.iter().copied();
        let named = named.filter(|label| self.algorithms.iter().any(|own| own == label));
        let named: Vec<_> = named.collect();
        match (self.algorithms.is_empty(), named.is_empty()) {
            (true, _) => Some(self.text.clone()),
            (false, true) => None,
            (false, false) => Some(format!("{}: {}", named.join(", "), self.text)),
        }
    }
}

/// A file as it was when it was read.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct FileStamp {
    pub path: String,
    pub bytes: u64,
    /// Time of its last change, since 1970.
    pub modified_ns: u64,
}

/// An image file, and the size of the image that it is of.
pub type StoredImage = (Vec<u8>, (usize, usize));

/// Pictures of the pairs of a block.
#[derive(Clone, Default, Serialize, Deserialize)]
pub struct BlockPictures {
    /// The best and the worst frame of each checkpoint and algorithm, by number of the checkpoint.
    pub checkpoints: Vec<CheckpointShot>,
    /// Frames by their places in the run.
    pub samples: Vec<(u64, CheckpointFigure)>,
    /// Scenes by their places in the run.
    pub scenes: Vec<(u64, SceneFigure)>,
}

impl BlockPictures {
    /// The numbers of the pairs that they show.
    pub fn sequences(&self) -> impl Iterator<Item = u64> {
        let samples = self.samples.iter().flat_map(|(_, figure)| &figure.shots);
        let scenes = self.scenes.iter().flat_map(|(_, scene)| &scene.shots);
        let checkpoints = self.checkpoints.iter().map(|shot| shot.sequence);
        checkpoints
            .chain(samples.map(|(_, shot)| shot.row.sequence))
            .chain(scenes.map(|shot| shot.row.sequence))
    }

    /// The left image of the row's pair, if they show it: the file, and the size of the image.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a picture is not what svl writes.
    pub fn left(self, row: &Row) -> Result<Option<StoredImage>> {
        let is_own = |own: &Row| own.pair_hash == row.pair_hash;
        for shot in self
            .checkpoints
            .iter()
            .filter(|shot| shot.sequence == row.sequence)
        {
            let shot = shot.shot()?;
            if is_own(&shot.row) {
                return Ok(Some((shot.left, shot.size)));
            }
        }
        let samples = self
            .samples
            .into_iter()
            .flat_map(|(_, figure)| figure.shots);
        let mut samples = samples.filter(|(_, shot)| is_own(&shot.row));
        if let Some((_, shot)) = samples.next() {
            return Ok(Some((shot.left, shot.size)));
        }
        let shows = |scene: &SceneFigure| scene.shots.iter().any(|shot| is_own(&shot.row));
        let mut scenes = self.scenes.into_iter().filter(|(_, scene)| shows(scene));
        Ok(scenes.next().map(|(_, scene)| (scene.left, scene.size)))
    }
}

/// The picture of a frame that shows a checkpoint.
#[derive(Clone, Serialize, Deserialize)]
pub struct CheckpointShot {
    pub algorithm: String,
    pub checkpoint: u32,
    pub sequence: u64,
    frame: StoredFrame,
    /// Parsed only if it is shown.
    shot: Box<RawValue>,
}

/// The result of a checkpoint in a frame.
#[derive(Clone, Copy, Serialize, Deserialize)]
struct StoredFrame {
    passed: bool,
    missing: usize,
    wrong: usize,
    order_holds: bool,
    /// None if it is infinite.
    error: Option<f64>,
}

impl CheckpointShot {
    /// The picture of a frame with the result of that checkpoint.
    ///
    /// # Errors
    /// [`Error::Invalid`] for numbers that JSON does not have.
    pub fn new(checkpoint: u32, frame: &CheckpointFrame, shot: &FrameShot) -> Result<Self> {
        let stored = to_raw_value(shot);
        Ok(Self {
            algorithm: shot.row.algorithm.clone(),
            checkpoint,
            sequence: shot.row.sequence,
            frame: StoredFrame {
                passed: frame.passed,
                missing: frame.missing,
                wrong: frame.wrong,
                order_holds: frame.order_holds,
                error: Some(frame.error).filter(|error| error.is_finite()),
            },
            shot: stored.map_err(|e| Error::Invalid(format!("pictures: {e}")))?,
        })
    }

    /// The result of the checkpoint.
    pub fn frame(&self) -> CheckpointFrame {
        CheckpointFrame {
            passed: self.frame.passed,
            missing: self.frame.missing,
            wrong: self.frame.wrong,
            order_holds: self.frame.order_holds,
            error: self.frame.error.unwrap_or(f64::INFINITY),
        }
    }

    /// The picture.
    ///
    /// # Errors
    /// [`Error::Invalid`] if it is not what svl writes.
    pub fn shot(&self) -> Result<FrameShot> {
        let shot = serde_json::from_str(self.shot.get());
        shot.map_err(|e| Error::Invalid(format!("pictures: {e}")))
    }
}

/// What a drive has besides its rows.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DriveFacts {
    pub course: CoursePlan,
}
