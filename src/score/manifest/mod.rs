//! The manifest of a run: version, scenario, algorithms with parameters, hashes, machine.

mod identity;

pub use identity::Purpose;

use crate::losses::LossLimit;
use crate::notice::Notice;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::error::Category;
use std::fs::read_to_string;
use std::io::Read;
use std::path::Path;
use svl_core::doubt::{Doubt, read_doubts};
use svl_core::kernel;
use svl_core::matcher::{self, Algorithm, ProgramRecord, Value};
use svl_core::stereo::{CellRule, hash_words};
use svl_core::{Error, Result, joined};
use svl_files::BuildInfo;
use svl_sim::arena::{ArenaConfig, RandomScenes};

/// The version of the files of a report: `schema` in `manifest.json` and `summary.json`.
///
/// Within one version, columns and keys keep their names, units and meanings; new ones may be
/// added anywhere. Renaming, removing or redefining one increments it.
pub const SCHEMA: u32 = 2;

/// The identity of a run, in every report (`manifest.json`) and in every result recording (metadata
/// `svl.run`).
///
/// Equal pairs, algorithms and parameters have equal result hashes, whatever the other fields.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Version of the files of a report, [`SCHEMA`].
    #[serde(default)]
    pub schema: u32,
    /// Unique to the run.
    pub run_id: String,
    /// RFC 3339, UTC.
    pub began: String,
    /// Version of svl.
    pub svl: String,
    /// Git revision of svl, if its build knew it.
    pub git_revision: Option<String>,
    /// Digest of the sources of svl that results depend on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sources: Option<String>,
    /// Cargo profile of the build, if known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub profile: Option<String>,
    pub scenario: String,
    /// Description of the run: the scenario that repeats it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub description: Option<serde_json::Value>,
    /// Names of the layers that options put around its sources, from the source outwards. The pairs
    /// of each run are registered and monitored besides.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub chain: Vec<String>,
    /// Number of bits used in the 16-bit images from which the pairs were made.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bits: Option<u8>,
    /// Digest of the pixels of all pairs in order, set at the end of the run.
    pub pairs_hash: Option<String>,
    /// Origins of the truths, in the text form of [`svl_core::stereo::TruthOrigin`], set at the end
    /// of the run.
    #[serde(default)]
    pub truth: Vec<String>,
    pub algorithms: Vec<AlgorithmRecord>,
    /// The recordings of the run; empty if a scenario generates its own frames.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub runs: Vec<InputRecord>,
    pub machine: Machine,
    /// Description of its times.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub times: Option<String>,
    /// Shard of the run, such as `3/16`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shard: Option<String>,
    /// The sessions whose rows a report has, in the order of their beginnings.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sessions: Vec<SessionRecord>,
    /// The warnings of the run, in order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
    /// Quantities that cannot be right.
    #[serde(
        default,
        skip_serializing_if = "Vec::is_empty",
        deserialize_with = "read_doubts"
    )]
    pub doubts: Vec<Doubt>,
}

/// A process that matched pairs of a report.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SessionRecord {
    /// `run_id` of the session, as in the column `session` of the rows.
    pub id: String,
    /// RFC 3339, UTC.
    pub began: String,
    pub machine: Machine,
    /// Cargo profile of the build, if known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub profile: Option<String>,
    /// Description of its times.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub times: Option<String>,
    /// Shard of the run, such as `3/16`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shard: Option<String>,
}

/// A recording, bag or folder of a run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputRecord {
    /// Name of the run in the rows.
    pub name: String,
    /// Original path.
    pub path: String,
    /// Size of a file.
    pub bytes: Option<u64>,
    /// Rectification of its pairs, selection of pairs, and changes to their images.
    pub changes: Option<String>,
    /// Hash of the calibration files that rectified its pairs, if any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<String>,
    /// Digest of the pixels of the pairs read, set at the end of the run: equal for equal images
    /// from any path.
    pub pairs_hash: Option<String>,
    /// True if each pair shows another scene.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub separate_pairs: bool,
    /// True if it has no times: its stamps are placeholders.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub is_untimed: bool,
}

/// An algorithm of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct AlgorithmRecord {
    /// Name in the registry.
    pub name: String,
    /// Label as the user wrote it.
    pub label: String,
    /// All its parameters, `key=value,...`.
    pub parameters: String,
    /// Each of them with its value.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub values: Vec<(String, String)>,
    /// The filters behind it, each with the hash of its weights, `+kind=hash`.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub filters: String,
    pub parameters_hash: String,
    /// Number of disparities searched per pixel, if its parameters determine it.
    pub disparities: Option<u32>,
    /// Digest of all its results in order, set at the end of the run.
    pub results_hash: Option<String>,
    /// True if a result depends on all earlier pairs of its run; set at the end of the run.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub has_run_memory: bool,
    /// Memory for its largest pair, if measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub memory_bytes: Option<usize>,
    /// Number of pairs on which it failed.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub failed_pairs: u64,
    /// Reason for the last of its failures.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failure: Option<String>,
    /// Identity and performance of the external program, if it runs one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub program: Option<ProgramRecord>,
}

impl AlgorithmRecord {
    /// True if it reports a map that others computed.
    pub fn is_recorded(&self) -> bool {
        matcher::find(&self.name).is_ok_and(matcher::MatcherSpec::is_recorded)
    }

    /// True if another program matches for it.
    pub fn is_program(&self) -> bool {
        matcher::find(&self.name).is_ok_and(matcher::MatcherSpec::is_program)
    }

    /// The value of a parameter that is a number.
    pub fn number(&self, parameter: &str) -> Option<f64> {
        let mut values = self.values.iter();
        values.find(|(name, _)| name == parameter)?.1.parse().ok()
    }

    /// Warnings about its program for the user, available at the end of the run.
    pub fn warnings(&self) -> impl Iterator<Item = Notice> {
        let of_program = self.program.iter().flat_map(ProgramRecord::warnings);
        of_program.map(|warning| Notice::new([&*self.label], warning))
    }
}

/// The machine. Times depend on it, results do not.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Machine {
    pub processor: String,
    /// Instruction set that the kernels run on.
    pub isa: String,
    pub threads: usize,
    /// Frequency governor of the first core, if the system reports it.
    pub governor: Option<String>,
}

/// Used by serde.
fn is_zero(n: &u64) -> bool {
    *n == 0
}

impl Manifest {
    /// The labels of the algorithms.
    pub fn labels(&self) -> impl Iterator<Item = &str> {
        self.algorithms.iter().map(|a| a.label.as_str())
    }

    /// True if each pair of a run shows another scene, though the pairs have times: random shapes,
    /// simulated or recorded.
    #[inline]
    pub fn has_separate_pairs(&self, run: Option<&str>) -> bool {
        let Some(run) = run else {
            let arena: Option<ArenaConfig> = self.part("arena").ok().flatten();
            let random = arena.and_then(|config| config.random);
            return random.is_some_and(RandomScenes::are_layers);
        };
        let record = self.runs.iter().find(|record| record.name == run);
        record.is_some_and(|record| record.separate_pairs)
    }

    /// True if the stamps of a recording are placeholders.
    pub fn is_untimed(&self, run: Option<&str>) -> bool {
        let mut records = self.runs.iter();
        records.any(|record| record.is_untimed && Some(record.name.as_str()) == run)
    }

    /// A part of the scenario.
    ///
    /// # Errors
    /// [`Error::Invalid`] if it is not what svl writes.
    pub fn part<T: DeserializeOwned>(&self, key: &str) -> Result<Option<T>> {
        let description = self.description.as_ref();
        let written = description.and_then(|value| value.get(key)).cloned();
        let part = written.map(serde_json::from_value).transpose();
        part.map_err(|e| {
            let name = &self.scenario;
            Error::Invalid(format!(
                "the report of '{name}': {key}: {e}; score it again"
            ))
        })
    }

    /// A run of `algorithms` on `scenario` that begins now, on this machine.
    ///
    /// # Errors
    /// If `SVL_ISA` names an instruction set that this CPU lacks.
    pub fn new(scenario: &str, algorithms: &[Algorithm]) -> Result<Self> {
        let now = jiff::Timestamp::now();
        let build = BuildInfo::current();
        // The process id distinguishes two runs that begin within one tick of the clock.
        let (now_ns, process) = (now.as_nanosecond(), std::process::id());
        let run_id = hash(&format!("{scenario} {now_ns} {process}"))[..12].to_owned();
        Ok(Self {
            schema: SCHEMA,
            run_id,
            began: format!("{now:.0}"),
            svl: build.version.to_owned(),
            git_revision: build.git_revision.map(str::to_owned),
            sources: build.sources.map(str::to_owned),
            profile: build.profile.map(str::to_owned),
            scenario: scenario.to_owned(),
            algorithms: algorithms.iter().map(AlgorithmRecord::new).collect(),
            machine: Machine::this()?,
            ..Self::default()
        })
    }

    /// Reads the manifest of a report.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] for anything but a manifest.
    #[inline]
    pub fn read(report: &Path) -> Result<Self> {
        read_json(&report.join("manifest.json"))
    }

    /// The run as a session of a report.
    pub fn session(&self) -> SessionRecord {
        SessionRecord {
            id: self.run_id.clone(),
            began: self.began.clone(),
            machine: self.machine.clone(),
            profile: self.profile.clone(),
            times: self.times.clone(),
            shard: self.shard.clone(),
        }
    }

    /// The machines it ran on, each once.
    pub fn machines(&self) -> Vec<&Machine> {
        let own = self.sessions.is_empty().then_some(&self.machine);
        let mut machines = Vec::new();
        let sessions = self.sessions.iter().map(|session| &session.machine);
        for machine in sessions.chain(own) {
            if !machines.contains(&machine) {
                machines.push(machine);
            }
        }
        machines
    }

    /// The options of the source, as in a scenario; files are in the runs.
    fn source_words(&self) -> Option<String> {
        let source = self.description.as_ref()?.get("source")?.as_object()?;
        let options = source.iter().filter(|(key, _)| *key != "files");
        let words = options.map(|(key, value)| match value.as_str() {
            Some(text) => format!("{key} {text}"),
            None => format!("{key} {value}"),
        });
        Some(joined(words))
    }

    /// The losses that its description allows.
    ///
    /// # Errors
    /// [`Error::Invalid`] if it is not a limit.
    pub fn allow_loss(&self) -> Result<Option<LossLimit>> {
        let description = self.description.as_ref();
        let written = description.and_then(|description| description.pointer("/source/allow_loss"));
        let limit = written.map(LossLimit::deserialize).transpose();
        limit.map_err(|e| Error::Invalid(format!("manifest: allow_loss: {e}")))
    }

    /// Records the rule that scores cells: it is a parameter of the algorithms that compute cells
    /// themselves.
    pub fn set_rule(&mut self, rule: CellRule) {
        for record in &mut self.algorithms {
            let answers = matcher::find(&record.name).is_ok_and(|spec| spec.cells.is_some());
            if answers {
                let algorithm = format!("{}:{}{}", record.name, record.parameters, record.filters);
                record.parameters_hash =
                    hash(&format!("{algorithm};{}", rule.right_words()))[..16].into();
            }
        }
    }

    /// Names and values for display. Names are unique, and no value is empty.
    pub fn entries(&self) -> Vec<(String, String)> {
        let machine = &self.machine;
        let revision = self.git_revision.as_deref().unwrap_or("revision unknown");
        let truth = (!self.truth.is_empty()).then(|| self.truth.join(", "));
        let fixed = [
            ("run", Some(self.run_id.clone())),
            ("began", Some(self.began.clone())),
            ("svl", Some(format!("{} ({revision})", self.svl))),
            ("profile", self.profile.clone()),
            ("scenario", Some(self.scenario.clone())),
            ("source", self.source_words()),
            ("bits of 16", self.bits.map(|bits| bits.to_string())),
            ("pairs hash", self.pairs_hash.clone()),
            ("truth", truth),
            ("processor", Some(machine.processor.clone())),
            ("instruction set", Some(machine.isa.clone())),
            ("threads", Some(machine.threads.to_string())),
            ("governor", machine.governor.clone()),
            ("times", self.times.clone()),
            ("shard", self.shard.clone()),
        ];
        let fixed = fixed.into_iter();
        let fixed = fixed.filter_map(|(name, value)| Some((name.to_owned(), value?)));
        let several = self.sessions.iter().filter(|_| self.sessions.len() > 1);
        fixed
            .chain(several.map(SessionRecord::entry))
            .chain(self.runs.iter().map(InputRecord::entry))
            .chain(self.algorithms.iter().flat_map(AlgorithmRecord::entries))
            .collect()
    }
}

impl SessionRecord {
    fn entry(&self) -> (String, String) {
        let Machine { processor, isa, .. } = &self.machine;
        let (began, threads) = (&self.began, self.machine.threads);
        let shard = self.shard.as_ref().map(|shard| format!(", shard {shard}"));
        let shard = shard.unwrap_or_default();
        let words = format!("{began}, {processor}, {isa}, {threads} threads{shard}");
        (format!("session {}", self.id), words)
    }
}

impl InputRecord {
    /// The recording at that path, named `name` in the rows.
    pub fn new(name: &str, path: &Path, changes: Option<String>) -> Self {
        let file = path.metadata().ok().filter(|metadata| metadata.is_file());
        Self {
            name: name.to_owned(),
            path: path.display().to_string(),
            bytes: file.map(|file| file.len()),
            changes,
            calibration: None,
            pairs_hash: None,
            separate_pairs: false,
            is_untimed: false,
        }
    }

    fn entry(&self) -> (String, String) {
        let bytes = self.bytes.map(|bytes| format!("{bytes} bytes"));
        let hash = self.pairs_hash.as_ref();
        let hash = hash.map(|hash| format!("pairs hash {hash}"));
        let parts = [Some(self.path.clone()), bytes, self.changes.clone(), hash];
        let parts = joined(parts.into_iter().flatten());
        (format!("recording {}", self.name), parts)
    }
}

impl AlgorithmRecord {
    fn new(algorithm: &Algorithm) -> Self {
        // Complete and in the order of the table, so that explicit defaults give the same hash.
        let filters = algorithm.filters().iter();
        let filters =
            filters.map(|filter| format!("+{}={}", filter.kind, hash_words(filter.hash())));
        let filters = filters.collect::<String>();
        let (name, parameters) = (algorithm.spec().name, algorithm.parameters().to_string());
        let files = files_of_command(algorithm);
        let hash = hash(&format!("{name}:{parameters}{filters}{files}"));
        let values = algorithm.parameters().iter();
        let values = values.map(|(name, value)| (name.to_owned(), value.to_string()));
        Self {
            name: name.to_owned(),
            label: algorithm.label().to_owned(),
            values: values.collect(),
            parameters,
            filters,
            parameters_hash: hash[..16].to_owned(),
            disparities: algorithm.disparities(),
            ..Self::default()
        }
    }

    fn entries(&self) -> impl Iterator<Item = (String, String)> {
        let label = &self.label;
        let results = self.results_hash.clone();
        let results = results.map(|hash| (format!("{label} results hash"), hash));
        let program = self.program.as_ref();
        let program = program.map(|program| (format!("{label} program"), program.words()));
        std::iter::once((self.label.clone(), self.parameters.clone() + &self.filters))
            .chain(program)
            .chain(results)
    }
}

/// Hashes of the files named in the command of a program: another program or model behind the same
/// command makes another algorithm.
fn files_of_command(algorithm: &Algorithm) -> String {
    let mut parameters = algorithm.parameters().iter();
    let Some((_, Value::Text(command))) = parameters.find(|(name, _)| *name == "command") else {
        return String::new();
    };
    let words = command.split(|c: char| c.is_whitespace() || "'\"=".contains(c));
    let hashes = words.filter_map(|word| {
        let path = Path::new(word);
        let is_file = path.is_file() && path.metadata().ok()?.len() <= MAX_PROGRAM_BYTES;
        let bytes = is_file.then(|| std::fs::read(path).ok()).flatten()?;
        Some(format!(";{word}={}", hash_bytes(&bytes)))
    });
    hashes.collect()
}

/// Largest program file that is hashed.
const MAX_PROGRAM_BYTES: u64 = 2 << 30;

impl Machine {
    fn this() -> Result<Self> {
        let cpuinfo = read_to_string("/proc/cpuinfo").unwrap_or_default();
        let mut lines = cpuinfo.lines();
        let model = lines.find_map(|line| line.strip_prefix("model name")?.split_once(": "));
        let processor = model.map_or(std::env::consts::ARCH, |(_, name)| name);
        let governor = read_to_string("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor").ok();
        Ok(Self {
            processor: processor.to_owned(),
            isa: kernel::isa()?.name().to_owned(),
            threads: rayon::current_num_threads(),
            governor: governor.map(|text| text.trim().to_owned()),
        })
    }
}

/// Reads a JSON file of a report.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] with the remedy for one that svl did not write like this.
pub fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T> {
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, e))?;
    serde_json::from_slice(&bytes).map_err(|e| {
        let what = match e.classify() {
            Category::Eof => "is cut off",
            Category::Data => "has other entries than this svl writes",
            Category::Syntax | Category::Io => "is damaged",
        };
        let cure = "copy the report again, or score it again";
        Error::format(path, format!("{what} (line {}): {cure}", e.line()))
    })
}

/// Hash of a text: XXH3, 128 bits.
pub fn hash(text: &str) -> String {
    hash_bytes(text.as_bytes())
}

/// Hash of bytes, the same as that of a text.
pub fn hash_bytes(bytes: &[u8]) -> String {
    hash_words(xxhash_rust::xxh3::xxh3_128(bytes))
}

/// Hash of a file's bytes.
///
/// # Errors
/// [`Error::Io`].
pub fn hash_file(path: &Path) -> Result<String> {
    let hashed = std::fs::File::open(path).and_then(hash_reader);
    hashed.map_err(|e| Error::io(path, e))
}

/// Hash of all bytes of a reader.
///
/// # Errors
/// The errors of the reader.
pub fn hash_reader(mut reader: impl Read) -> std::io::Result<String> {
    let mut hasher = xxhash_rust::xxh3::Xxh3Default::new();
    let mut bytes = vec![0; 1 << 16];
    loop {
        match reader.read(&mut bytes)? {
            0 => return Ok(hash_words(hasher.digest128())),
            n => hasher.update(&bytes[..n]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_decide_not_how_they_were_asked_for() {
        let algorithms: Vec<Algorithm> = ["v3", "v3:max_disparity=80", "v3:max_disparity=64", "v1"]
            .map(|a| a.parse().unwrap())
            .into();
        let manifest = Manifest::new("s", &algorithms).unwrap();
        let [plain, spelled, other, v1] = &manifest.algorithms[..] else {
            panic!()
        };
        assert_eq!(plain.parameters_hash, spelled.parameters_hash);
        assert_ne!(plain.parameters_hash, other.parameters_hash);
        assert_ne!(plain.parameters_hash, v1.parameters_hash);
        assert_ne!(manifest.run_id, Manifest::new("s", &[]).unwrap().run_id);
    }

    #[test]
    fn json_round_trip() {
        let manifest = Manifest::new("s", &["v3".parse().unwrap()]).unwrap();
        let json = serde_json::to_string(&manifest).unwrap();
        assert_eq!(serde_json::from_str::<Manifest>(&json).unwrap(), manifest);
    }
}
