//! Scenarios: a TOML file with source, algorithms, cell rule, checkpoints and gate.

mod drive;
mod filter;
mod limit;
mod pairs;
mod recordings;
mod seeds;
mod source;
mod stress;
mod write;

pub use drive::{CellPart, CellStandsFor, DriveConfig, SteeringRule};
pub use filter::ScenarioFilter;
pub use limit::Limit;
pub use pairs::{CropScale, PairRange};
pub use recordings::{RecordingRun, RecordingRuns};
pub use seeds::SeedList;
pub use source::{ScenarioKind, SourceOptions, flag, within};
pub use stress::{StressLevels, distinct_kinds};

use svl_core::depth::GridSettings;
use svl_core::matcher::Algorithm;
use svl_core::{Error, Result, joined};
use svl_files::read_text;
use svl_sim::arena::{Arena, ArenaConfig, RandomScenes, WireObject};

use crate::judge::{Checkpoint, CheckpointPlace, ColumnChoice, Judge};
use serde::{Deserialize, Serialize};
use source::algorithm_of;
use std::path::Path;
use stress::StressTable;
use svl_core::stereo::{CellRule, GridShape};

/// Largest scenario file accepted, bytes.
const MAX_BYTES: u64 = 1 << 20;

/// Largest number of columns and of rows of a grid.
pub const MAX_GRID: usize = 64;

/// The description of a run: a validated scenario. It is made from a file or the command line, and
/// [`Scenario::to_toml`] writes it.
#[derive(Clone, Debug)]
pub struct Scenario {
    pub name: String,
    pub description: String,
    pub algorithms: Vec<Algorithm>,
    pub grid: GridSettings,
    pub cells: CellRule,
    pub source: ScenarioSource,
    /// Options of the source; [`Scenario::with`] changes them.
    pub options: SourceOptions,
    pub checkpoints: Vec<Checkpoint>,
    /// Metrics that tables show.
    pub columns: ColumnChoice,
    /// Filters with which the algorithms are also run; at most one of a kind.
    pub filters: Vec<ScenarioFilter>,
    /// Perturbations of the pairs, scored in addition to the original ones; each kind once.
    pub stress: Vec<StressLevels>,
    /// Limits of the gate; their algorithms are resolved together with those of the command line.
    pub gate: Vec<Limit>,
    /// The text of the file.
    pub text: String,
}

/// Source of a scenario's frames.
#[derive(Clone, Debug, PartialEq)]
pub enum ScenarioSource {
    /// The simulated arena, one run per seed.
    Arena {
        config: Box<ArenaConfig>,
        seeds: Vec<u64>,
    },
    /// Courses like the arena, driven by the algorithms, one per seed.
    Drive {
        config: Box<ArenaConfig>,
        drive: Box<DriveConfig>,
        seeds: Vec<u64>,
    },
    /// Scenes below the folder of data sets, as accepted by `Scene::find_all` of `svl-bench`:
    /// folders, numbered scenes of a folder, or all scenes of a folder with `*` as the last part.
    Dataset { scenes: Vec<String> },
    /// Recordings, bags and folders of pairs, one run per file.
    Recording(RecordingRuns),
}

/// The file before validation.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    name: String,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    description: String,
    #[serde(default = "v5")]
    algorithms: Vec<String>,
    #[serde(default, skip_serializing_if = "is_headline")]
    columns: ColumnChoice,
    #[serde(default)]
    grid: GridSettings,
    #[serde(default)]
    cells: CellRule,
    source: SourceOptions,
    arena: Option<ArenaConfig>,
    drive: Option<DriveConfig>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    checkpoint: Vec<Checkpoint>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    filter: Vec<ScenarioFilter>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    stress: Vec<StressTable>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    gate: Vec<toml::Spanned<Limit>>,
}

fn is_headline(columns: &ColumnChoice) -> bool {
    *columns == ColumnChoice::Headline
}

fn v5() -> Vec<String> {
    vec!["v5".to_owned()]
}

impl Scenario {
    /// Reads and checks a scenario file.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] with line and column, or with the contradiction.
    pub fn read(path: &Path) -> Result<Self> {
        let text = read_text(path, MAX_BYTES).map_err(|error| match path.parent() {
            Some(folder) if folder.ends_with("scenarios") && !folder.exists() => {
                let cure = "svl's repository has the folder scenarios/: run this in a checkout";
                Error::format(
                    path,
                    format!("no such file; {cure}, or use `arena`, built in"),
                )
            }
            _ => error,
        })?;
        Self::parse(&text, path)
    }

    /// The arena of the thesis's chapter 7, compiled in: the default scenario.
    ///
    /// # Errors
    /// None unless svl was built with a broken `scenarios/arena.toml`.
    pub fn arena() -> Result<Self> {
        Self::parse(
            include_str!("arena.toml"),
            Path::new("scenarios/arena.toml"),
        )
    }

    /// Recordings without a scenario: the thesis's grid, the default rule for cells, no checkpoints
    /// and no gate. It is named after its first file.
    ///
    /// # Errors
    /// [`Error::Invalid`] if there is no file.
    pub fn from_recordings(files: &[String], algorithms: Vec<Algorithm>) -> Result<Self> {
        let options = SourceOptions {
            files: files.to_vec(),
            ..SourceOptions::default()
        };
        options.validate()?;
        let runs = RecordingRuns {
            files: files.to_vec(),
            ..RecordingRuns::default()
        };
        let names: Vec<_> = runs.runs()?.into_iter().map(|run| run.name).collect();
        let (first, more) = (Path::new(&names[0]), names.len() - 1);
        let safe = |c: char| {
            if c.is_ascii_alphanumeric() || c == '-' || c == '_' {
                c
            } else {
                '-'
            }
        };
        let stem = first.file_stem().unwrap_or_default().to_string_lossy();
        let stem: String = stem.chars().take(40).map(safe).collect();
        let name = match (stem.as_str(), more) {
            ("", _) => "recordings".to_owned(),
            (_, 0) => stem,
            _ => format!("{stem}-and-{more}-more"),
        };
        Ok(Self {
            name,
            description: String::new(),
            algorithms,
            grid: GridSettings::default(),
            cells: CellRule::default(),
            source: ScenarioSource::Recording(runs),
            options,
            checkpoints: Vec::new(),
            columns: ColumnChoice::Headline,
            filters: Vec::new(),
            stress: Vec::new(),
            gate: Vec::new(),
            text: String::new(),
        })
    }

    /// The scenario with other source options: those set in `given`, as far as they apply to
    /// scenarios of its kind.
    ///
    /// # Errors
    /// [`Error::Usage`] and [`Error::Invalid`] for options that contradict each other or the
    /// scenario's.
    pub fn with(&self, given: &SourceOptions) -> Result<Self> {
        let options = self.options.with(&given.for_kind(self.options.kind)?)?;
        // With the names used on the command line.
        options.check()?;
        options.validate()?;
        let mut source = self.source.clone();
        match &mut source {
            ScenarioSource::Arena { seeds, .. } | ScenarioSource::Drive { seeds, .. } => {
                *seeds = options.seeds();
            }
            ScenarioSource::Dataset { scenes } => scenes.clone_from(&options.scenes),
            ScenarioSource::Recording(_) => {}
        }
        Ok(Self {
            options,
            source,
            ..self.clone()
        })
    }

    /// The files of a scenario of recordings, a run each; empty for other scenarios.
    ///
    /// # Errors
    /// Those of [`RecordingRuns::runs`]; [`Error::Invalid`] for a checkpoint whose `file` is not
    /// among them, or whose frames or seconds are ambiguous.
    pub fn recordings(&self) -> Result<Vec<RecordingRun>> {
        let ScenarioSource::Recording(runs) = &self.source else {
            return Ok(Vec::new());
        };
        let runs = runs.runs()?;
        for Checkpoint {
            number,
            name,
            place,
            file,
            ..
        } in &self.checkpoints
        {
            let wrong = |what: String| invalid(format!("checkpoint {number} ({name}): {what}"));
            let names = || joined(runs.iter().map(|run| &run.name));
            let count = |file: &String| runs.iter().filter(|run| run.path.ends_with(file)).count();
            match (file, place) {
                (Some(file), _) if count(file) != 1 => {
                    let found = if count(file) == 0 { "none" } else { "several" };
                    return wrong(format!(
                        "file = '{file}' is {found} of the files: {}",
                        names()
                    ));
                }
                (None, CheckpointPlace::Frames(_) | CheckpointPlace::Seconds(_))
                    if runs.len() > 1 =>
                {
                    return wrong(format!("name its file, file = one of: {}", names()));
                }
                _ => {}
            }
        }
        Ok(runs)
    }

    /// Checks a scenario's text; `path` is for the errors.
    ///
    /// # Errors
    /// As [`Scenario::read`].
    pub fn parse(text: &str, path: &Path) -> Result<Self> {
        let file: File = toml::from_str(text).map_err(|e| toml_error(&e, text, path))?;
        file.check(text, path.parent().unwrap_or(Path::new("")))
            .map_err(|e| Error::format(path, e.to_string()))
    }

    /// Outlines of the arena's solids and the robot's path, in the run with that seed. Other
    /// sources have none.
    pub fn wireframe(&self, seed: Option<u64>) -> Vec<WireObject> {
        match &self.source {
            ScenarioSource::Arena { config, seeds } => {
                Arena::wireframe(config, seed.unwrap_or(seeds[0])).unwrap_or_default()
            }
            ScenarioSource::Drive { .. }
            | ScenarioSource::Dataset { .. }
            | ScenarioSource::Recording(_) => Vec::new(),
        }
    }

    /// Kind of its scenes: what is similar in all of them. The arena and its variants are one kind;
    /// data sets and recordings have the name of their scenario.
    pub fn kind(&self) -> &str {
        match &self.source {
            ScenarioSource::Arena { config, .. } => match config.random {
                None => "arena",
                Some(RandomScenes::Worlds) => "worlds",
                Some(RandomScenes::Shapes) => "shapes",
            },
            ScenarioSource::Drive { .. } => "courses",
            ScenarioSource::Dataset { .. } | ScenarioSource::Recording(_) => &self.name,
        }
    }

    /// True if each pair shows another scene, so that none has a past: data sets, random shapes.
    pub fn has_separate_pairs(&self) -> bool {
        match &self.source {
            ScenarioSource::Arena { config, .. } => config.random == Some(RandomScenes::Shapes),
            ScenarioSource::Dataset { .. } => true,
            ScenarioSource::Drive { .. } | ScenarioSource::Recording(_) => false,
        }
    }

    /// Rules by which the frames are scored.
    pub fn judge(&self) -> Judge {
        Judge {
            grid: self.grid,
            cells: self.cells,
            checkpoints: self.checkpoints.clone(),
            photometric: true,
            ..Judge::default()
        }
    }

    /// The algorithms' labels.
    pub fn labels(&self) -> Vec<&str> {
        self.algorithms.iter().map(Algorithm::label).collect()
    }
}

impl File {
    /// Checks name, grid, rule and checkpoints.
    fn check_head(&self) -> Result<()> {
        let safe = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        if self.name.is_empty() || self.name.len() > 64 || !self.name.chars().all(safe) {
            return invalid(format!(
                "name '{}' must be letters, digits, '-' and '_': it names folders",
                self.name
            ));
        }
        let GridSettings {
            columns,
            rows,
            min_valid,
            decision: _,
        } = self.grid;
        if !(1..=MAX_GRID).contains(&columns)
            || !(1..=MAX_GRID).contains(&rows)
            || !(0.0..=1.0).contains(&min_valid)
        {
            return invalid(format!(
                "grid: columns and rows are 1..={MAX_GRID}, min_valid 0..=1"
            ));
        }
        self.cells.validate()?;
        for (i, checkpoint) in self.checkpoint.iter().enumerate() {
            checkpoint.validate(self.grid.shape())?;
            if self.checkpoint[..i]
                .iter()
                .any(|c| c.number == checkpoint.number)
            {
                return invalid(format!(
                    "checkpoint {} occurs twice; give each its own number",
                    checkpoint.number
                ));
            }
        }
        Ok(())
    }

    fn check(self, text: &str, folder: &Path) -> Result<Scenario> {
        self.check_head()?;
        if self.algorithms.is_empty() {
            return invalid(
                "algorithms is empty: name at least one, as `svl algos` lists them".into(),
            );
        }
        let algorithms = self
            .algorithms
            .iter()
            .map(|text| algorithm_of(text, folder).parse())
            .collect::<Result<Vec<Algorithm>>>()?;
        let gate = self.gate.into_iter().map(|limit| {
            let limit = check_limit(limit, text, &self.checkpoint)?;
            Ok(limit.renamed(&|name| algorithm_of(name, folder)))
        });
        let gate = gate.collect::<Result<_>>()?;
        for (i, filter) in self.filter.iter().enumerate() {
            if self.filter[..i].iter().any(|f| f.detects == filter.detects) {
                return invalid(format!("filter {} occurs twice", filter.detects));
            }
        }
        let filters = self.filter.into_iter().map(|filter| filter.check(folder));
        let filters = filters.collect::<Result<_>>()?;
        let stress = self.stress.into_iter().map(StressTable::check);
        let stress = stress.collect::<Result<Vec<_>>>()?;
        distinct_kinds(&stress)?;
        let options = self.source.rooted(folder);
        options.validate()?;
        let source = source(&options, self.arena, self.drive, self.grid.shape(), folder)?;
        if matches!(source, ScenarioSource::Drive { .. }) && !self.checkpoint.is_empty() {
            let belongs = "is for pairs that do not depend on the algorithm, not for drives";
            return invalid(format!("[[checkpoint]] {belongs}"));
        }
        for checkpoint in &self.checkpoint {
            check_place(checkpoint, &source)?;
        }
        Ok(Scenario {
            name: self.name,
            description: self.description,
            algorithms,
            grid: self.grid,
            cells: self.cells,
            source,
            options,
            checkpoints: self.checkpoint,
            columns: self.columns,
            filters,
            stress,
            gate,
            text: text.to_owned(),
        })
    }
}

fn check_limit(
    limit: toml::Spanned<Limit>,
    text: &str,
    checkpoints: &[Checkpoint],
) -> Result<Limit> {
    let line = line(text, limit.span().start);
    let limit = Limit {
        line,
        ..limit.into_inner()
    };
    limit.validate()?;
    match limit.checkpoint {
        Some(number) if !checkpoints.iter().any(|c| c.number == number) => invalid(format!(
            "gate in line {line}: there is no checkpoint {number}"
        )),
        _ => Ok(limit),
    }
}

/// Rejects a checkpoint at frames that the source cannot have.
fn check_place(checkpoint: &Checkpoint, source: &ScenarioSource) -> Result<()> {
    let wrong = |what: &str| {
        let Checkpoint { number, name, .. } = checkpoint;
        invalid(format!("checkpoint {number} ({name}): {what}"))
    };
    match (source, &checkpoint.place) {
        (ScenarioSource::Dataset { .. }, CheckpointPlace::Pose { .. }) => {
            wrong("at_m needs poses, which data-set scenes do not have; name them by frames")
        }
        (ScenarioSource::Dataset { .. }, CheckpointPlace::Seconds(_)) => {
            wrong("seconds need stamps, which data-set scenes do not have; name them by frames")
        }
        (ScenarioSource::Recording(_), _) => Ok(()),
        _ if checkpoint.file.is_some() => wrong("file belongs to kind = \"recording\""),
        _ => Ok(()),
    }
}

/// The source of validated options, with the tables for its kind.
fn source(
    options: &SourceOptions,
    arena: Option<ArenaConfig>,
    drive: Option<DriveConfig>,
    grid: GridShape,
    folder: &Path,
) -> Result<ScenarioSource> {
    use ScenarioKind::{Arena, Dataset, Drive, Recording};
    if arena.is_some() && !matches!(options.kind, Arena | Drive) {
        return invalid("[arena] belongs to kind = \"arena\"".into());
    }
    if drive.is_some() && options.kind != Drive {
        return invalid("[drive] belongs to kind = \"drive\"".into());
    }
    Ok(match options.kind {
        Arena => {
            let config = arena.unwrap_or_default();
            config.check_random()?;
            ScenarioSource::Arena {
                config: Box::new(config),
                seeds: options.seeds(),
            }
        }
        Drive => {
            let (config, drive) = (arena.unwrap_or_default(), drive.unwrap_or_default());
            if config.random.is_some() {
                return invalid("arena.random belongs to kind = \"arena\"".into());
            }
            drive.validate(grid, config.frames, config.rate_hz)?;
            ScenarioSource::Drive {
                config: Box::new(config),
                drive: Box::new(drive),
                seeds: options.seeds(),
            }
        }
        Dataset => ScenarioSource::Dataset {
            scenes: options.scenes.clone(),
        },
        Recording => ScenarioSource::Recording(RecordingRuns {
            files: options.files.clone(),
            folder: folder.to_owned(),
        }),
    })
}

fn invalid<T>(what: String) -> Result<T> {
    Err(Error::Invalid(what))
}

/// Line number of the byte at `at`, from 1.
fn line(text: &str, at: usize) -> usize {
    text.get(..at).unwrap_or(text).matches('\n').count() + 1
}

/// The parser's message, which has several lines, in one, with line and column.
/// The keys without a default: of the file, of its tables, and of each in its lists of tables.
const REQUIRED: [(&str, &[&str]); 6] = [
    ("", &["name", "source"]),
    ("source", &["kind"]),
    ("checkpoint", &["number", "name"]),
    ("filter", &["detects"]),
    ("stress", &["kind"]),
    ("gate", &["algorithm", "metric"]),
];

/// Keys of [`REQUIRED`] that a scenario lacks.
fn missing_keys(text: &str) -> Vec<String> {
    let Ok(file) = text.parse::<toml::Table>() else {
        return Vec::new();
    };
    let mut missing = Vec::new();
    let mut look = |table: &toml::Table, keys: &[&str], place: String| {
        let absent = keys.iter().filter(|key| !table.contains_key(**key));
        missing.extend(absent.map(|key| format!("{key}{place}")));
    };
    for (name, keys) in REQUIRED {
        match file.get(name) {
            None if name.is_empty() => look(&file, keys, String::new()),
            Some(toml::Value::Table(table)) => look(table, keys, format!(" of [{name}]")),
            Some(toml::Value::Array(tables)) => {
                for (i, table) in (1..).zip(tables.iter().filter_map(toml::Value::as_table)) {
                    look(table, keys, format!(" of [[{name}]] {i}"));
                }
            }
            _ => {}
        }
    }
    missing
}

fn toml_error(error: &toml::de::Error, text: &str, path: &Path) -> Error {
    let mut message = plain(&error.message().lines().collect::<Vec<_>>().join(" "));
    // serde stops at the first.
    if message.starts_with("missing field") {
        let missing = missing_keys(text);
        if missing.len() > 1 {
            let what = format!("missing {}", missing.join(", "));
            return Error::format(path, what);
        }
        message = message.replacen("field", "key", 1);
    }
    let place = error.span().map(|span| {
        let before = text.get(..span.start).unwrap_or(text);
        let line = line(text, span.start);
        let column = before.rsplit('\n').next().unwrap_or("").chars().count() + 1;
        format!("line {line}, column {column}: ")
    });
    Error::format(path, format!("{}{message}", place.unwrap_or_default()))
}

/// serde's message in terms of TOML instead of Rust types.
fn plain(message: &str) -> String {
    let Some((found, expected)) = message.split_once(", expected ") else {
        return message.to_owned();
    };
    let expected = match expected.split(' ').collect::<Vec<_>>()[..] {
        ["struct" | "map", ..] | ["a", "map"] | ["internally", "tagged", ..] => "a table",
        ["u8" | "u16" | "u32" | "u64" | "usize"] => "a whole number, 0 or more",
        ["i8" | "i16" | "i32" | "i64" | "isize"] => "a whole number",
        ["f32" | "f64"] => "a number",
        ["a", "boolean"] => "true or false",
        ["a", "sequence"] => "a list",
        ["a", "tuple", "of", "size", size] | ["an", "array", "of", "length", size] => {
            &format!("a list of {size}")
        }
        _ => expected,
    };
    let kind = found
        .strip_prefix("invalid type: ")
        .or(found.strip_prefix("invalid value: "));
    let found = match kind.unwrap_or(found) {
        "map" => "a table",
        "sequence" => "a list",
        other => other.strip_prefix("floating point ").unwrap_or(other),
    };
    format!("{found}, expected {expected}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Scenario> {
        Scenario::parse(text, Path::new("s.toml"))
    }

    const MINIMAL: &str = "name = \"m\"\ndescription = \"\"\nalgorithms = \
                           [\"v3\"]\n[cells]\njudge = \"distance\"\n[source]\nkind = \"arena\"\n";

    #[test]
    fn errors_name_no_types_of_rust() {
        for (line, words) in [
            (
                "[grid]\nrows = \"3\"",
                "string \"3\", expected a whole number, 0 or more",
            ),
            (
                "[grid]\nrows = -1",
                "integer `-1`, expected a whole number, 0 or more",
            ),
            (
                "[[gate]]\n[arena]\nrobot = 3",
                "integer `3`, expected a table",
            ),
            ("[arena.world]\nblocks = {}", "a table, expected a list"),
            (
                "[arena.world]\nwidth_m = true",
                "boolean `true`, expected a number",
            ),
        ] {
            let error = parse(&format!("{MINIMAL}{line}\n"))
                .unwrap_err()
                .to_string();
            assert!(error.contains(words), "{line}: {error}");
        }
    }

    #[test]
    fn random_worlds_have_no_keys_of_their_own_and_no_drives() {
        let error = |text: &str| parse(text).unwrap_err().to_string();
        let own = error(&format!(
            "{MINIMAL}[arena]\nrandom = \"worlds\"\nsensor.gain_db = 1.0\n"
        ));
        assert!(own.contains("arena.sensor"), "{own}");
        let drive = MINIMAL.replace("\"arena\"", "\"drive\"");
        let driven = error(&format!("{drive}[arena]\nrandom = \"worlds\"\n"));
        assert!(driven.contains("arena.random belongs to"), "{driven}");
    }

    #[test]
    fn omitted_keys_have_the_thesis_defaults() {
        // A name and a source suffice.
        let scenario = parse("name = \"m\"\n[source]\nkind = \"arena\"\n").unwrap();
        assert_eq!(scenario.algorithms[0].label(), "v5");
        assert_eq!(scenario.cells, CellRule::default());
        assert_eq!((scenario.grid.columns, scenario.grid.rows), (5, 3));
        assert_eq!(
            scenario.source,
            ScenarioSource::Arena {
                config: Box::default(),
                seeds: vec![1]
            }
        );
    }

    #[test]
    fn every_key_is_documented() {
        let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/scenario.md");
        // The published crate does not include docs/.
        let Ok(docs) = std::fs::read_to_string(docs) else {
            return;
        };
        let cells = "[cells]\njudge = \"distance\"\nzz = 1\n";
        let checkpoint = "[[checkpoint]]\nnumber = 1\nname = \"a\"\n";
        let expected_cell = format!("{checkpoint}frames = [0, 1]\n[[checkpoint.cell]]\nzz = 1\n");
        let sections = [
            "zz = 1\n".to_owned(),
            "[grid]\nzz = 1\n".to_owned(),
            cells.to_owned(),
            cells.replace("distance", "disparity"),
            "source = { zz = 1 }\n".to_owned(),
            format!("{checkpoint}zz = 1\n"),
            expected_cell,
            "[[gate]]\nzz = 1\n".to_owned(),
            "[[filter]]\nzz = 1\n".to_owned(),
            "[[stress]]\nzz = 1\n".to_owned(),
            "[drive]\nzz = 1\n".to_owned(),
            "[drive.steering]\nzz = 1\n".to_owned(),
            "[arena]\nzz = 1\n".to_owned(),
            "[arena.rig]\nzz = 1\n".to_owned(),
            "[arena.sensor]\nzz = 1\n".to_owned(),
            "[arena.robot]\nzz = 1\n".to_owned(),
            "[arena.world]\nzz = 1\n".to_owned(),
            "[arena.world]\nblocks = [{ zz = 1 }]\n".to_owned(),
            "[arena.world]\nballs = [{ zz = 1 }]\n".to_owned(),
            "[arena.robot]\npath = [{ zz = 1 }]\n".to_owned(),
        ];
        for section in sections {
            let error = parse(&section).unwrap_err().to_string();
            // unknown field `zz`, expected one of `columns`, `rows`, …
            let (_, keys) = error.split_once("expected ").expect(&error);
            let keys: Vec<_> = keys.split('`').skip(1).step_by(2).collect();
            assert!(!keys.is_empty(), "{error}");
            for key in keys {
                let is_told = docs.split(|c: char| !c.is_alphanumeric() && c != '_');
                assert!(
                    is_told.into_iter().any(|word| word == key),
                    "{section}: {key}"
                );
            }
        }
    }

    #[test]
    fn the_embedded_arena_is_whole() {
        let arena = Scenario::arena().unwrap();
        assert_eq!(arena.checkpoints.len(), 6);
    }

    #[test]
    fn errors_name_line_and_column() {
        let error = parse(&MINIMAL.replace("kind", "kidn"))
            .unwrap_err()
            .to_string();
        assert!(
            error.starts_with("s.toml: line 7, column 1: unknown field `kidn`"),
            "{error}"
        );
        assert!(!error.contains('\n'));
        let error = parse("name = [").unwrap_err().to_string();
        assert!(error.starts_with("s.toml: line 1, column 9: "), "{error}");
    }

    #[test]
    fn contradictions_are_named() {
        for (from, to, word) in [
            ("\"m\"", "\"../m\"", "name"),
            ("[\"v3\"]", "[]", "algorithms"),
            ("\"v3\"", "\"v33\"", "did you mean 'v3'"),
            ("\"arena\"", "\"dataset\"", "scenes"),
            (
                "kind = \"arena\"",
                "kind = \"arena\"\nseeds = [1, 1]",
                "seeds",
            ),
            ("[source]", "[grid]\ncolumns = 0\n[source]", "columns"),
        ] {
            let error = parse(&MINIMAL.replacen(from, to, 1))
                .unwrap_err()
                .to_string();
            assert!(error.contains(word), "{to}: {error}");
        }
    }

    #[test]
    fn cells_take_tolerances_and_distances() {
        let cells = |keys: &str| {
            parse(&MINIMAL.replacen("\"distance\"", &format!("\"distance\"\n{keys}"), 1))
        };
        assert_eq!(cells("").unwrap().cells, CellRule::default());
        let set = cells("tolerance_m = 0.05\nobstacle_m = 0.4\nclear_m = 0.9")
            .unwrap()
            .cells;
        let expected = CellRule::Distance {
            tolerance_m: 0.05,
            tolerance_percent: 20.0,
            obstacle_m: 0.4,
            clear_m: 0.9,
        };
        assert_eq!(set, expected);
        assert!(set.right_words().starts_with("within 0.05 m or 20 %"));
        for (keys, words) in [
            (
                "tolerance_m = 0",
                "cells.tolerance_m = 0: must be a positive number",
            ),
            (
                "tolerance_percent = -5",
                "cells.tolerance_percent = -5: must be",
            ),
            ("obstacle_m = inf", "cells.obstacle_m = inf: must be"),
            ("clear_m = nan", "cells.clear_m = NaN: must be"),
            (
                "clear_m = 0.5",
                "cells.obstacle_m = 0.5: must be below cells.clear_m = 0.5",
            ),
            ("tolerance_px = 2", "tolerance_px"),
            ("obstacle_m = \"near\"", "expected a number"),
        ] {
            let error = cells(keys).unwrap_err().to_string();
            assert!(
                error.contains(words) && !error.contains('\n'),
                "{keys}: {error}"
            );
        }
    }

    #[test]
    fn limits_are_checked_and_know_their_lines() {
        let gate = |limit: &str| parse(&format!("{MINIMAL}[[gate]]\nalgorithm = \"v3\"\n{limit}"));
        let scenario = gate("metric = \"time\"\nrelative_to = \"bm\"\nmax = 2").unwrap();
        assert_eq!(
            (scenario.gate[0].line, scenario.gate[0].max),
            (8, Some(2.0))
        );
        for (limit, word) in [
            ("metric = \"wrong\"", "gate in line 8: needs min or max"),
            ("metric = \"wrong\"\nmax = 5", "5 % is 0.05"),
            ("metric = \"wrong\"\nmax = nan", "0 or more"),
            (
                "metric = \"wrong\"\nmin = 0.2\nmax = 0.1",
                "min is above max",
            ),
            ("metric = \"time\"\nmax = 5", "relative_to"),
            (
                "metric = \"wrong\"\nmax = 0.1\nrelative_to = \"v1\"",
                "absolute",
            ),
            ("metric = \"wrong\"\nmax = 0.1\ncheckpoint = 1", "passed"),
            (
                "metric = \"passed\"\nmin = 0.1\ncheckpoint = 1",
                "no checkpoint 1",
            ),
            (
                "metric = \"time\"\nmax = 1\nrelative_to = \"v3\"",
                "names the algorithm itself",
            ),
            ("metric = \"wrnog\"\nmax = 1", "line 10"),
        ] {
            let error = gate(limit).unwrap_err().to_string();
            assert!(error.contains(word), "{limit}: {error}");
        }
    }
}
