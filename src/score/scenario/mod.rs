//! Scenarios: a TOML file with source, algorithms, cell rule, checkpoints and gate.

mod drive;
mod file;
mod filter;
mod latency;
mod limit;
mod pairs;
mod piece;
mod ranges;
mod recordings;
mod seeds;
mod source;
mod stress;
#[cfg(test)]
mod tests;
mod toml_error;
mod write;

pub use drive::{CellPart, CellStandsFor, DriveConfig, SteeringRule};
pub use filter::ScenarioFilter;
pub use latency::{CellKeys, Latency, MeasuredLatency};
pub use limit::{EXACT, Limit, PRIOR, WITNESS, is_of_witness, witness};
pub use pairs::{CropScale, PairRange};
pub use ranges::{DistanceRange, RangeEnds};
pub use recordings::{InputFile, InputFiles};
pub use seeds::SeedList;
pub use source::{ScenarioKind, SourceOptions, StampSource, flag, within};
pub use stress::{StressLevels, distinct_kinds};

use crate::judge::{Checkpoint, CheckpointPlace, ColumnChoice, Judge, PieceConfig, RobotSize};
use file::File;
use std::path::Path;
use svl_core::depth::GridSettings;
use svl_core::matcher::Algorithm;
use svl_core::stereo::{CellRule, hash_words};
use svl_core::{Error, Result, joined};
use svl_files::{read_text, safe_name};
use svl_sim::arena::{Arena, ArenaConfig, RandomScenes, WireObject};
use toml_error::toml_error;
use xxhash_rust::xxh3::xxh3_128;

/// Largest scenario file accepted, bytes.
const MAX_BYTES: u64 = 1 << 20;

/// Largest number of characters of a recording's name in that of its report.
const MAX_NAME: usize = 40;

/// Largest number of columns and of rows of a grid.
pub const MAX_GRID: usize = 64;

/// The name of a recording as that of a report's folder: of a longer one the beginning, and a hash
/// of it all, so that recordings that begin alike have folders of their own.
fn short_name(name: &str) -> String {
    match name.chars().count() {
        0..=MAX_NAME => safe_name(name, MAX_NAME),
        _ => format!(
            "{}-{}",
            safe_name(name, MAX_NAME - 7),
            &hash_words(xxh3_128(name.as_bytes()))[1..7]
        ),
    }
}

/// The description of a run: a validated scenario. It is made from a file or the command line, and
/// [`Scenario::to_toml`] writes it.
#[derive(Clone, Debug)]
pub struct Scenario {
    pub name: String,
    pub description: String,
    pub algorithms: Vec<Algorithm>,
    pub grid: GridSettings,
    pub cells: CellRule,
    /// The latency after which cells are scored, too.
    pub latency: Option<Latency>,
    /// The body whose way is free.
    pub robot: Option<RobotSize>,
    pub source: ScenarioSource,
    /// Options of the source; [`Scenario::with`] changes them.
    pub options: SourceOptions,
    pub checkpoints: Vec<Checkpoint>,
    /// The test pieces that the runs approach.
    pub piece: Option<PieceConfig>,
    /// Metrics that tables show.
    pub columns: ColumnChoice,
    /// The distances at which the ranges of errors end.
    pub ranges: RangeEnds,
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
    Recording(InputFiles),
}

impl Scenario {
    /// Reads and checks a scenario file.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] with line and column, or with the contradiction.
    #[inline]
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
        let runs = InputFiles {
            files: files.to_vec(),
            ..InputFiles::default()
        };
        let names: Vec<_> = runs.runs()?.into_iter().map(|run| run.name).collect();
        let (first, more) = (Path::new(&names[0]), names.len() - 1);
        let stem = first.file_stem().unwrap_or_default().to_string_lossy();
        let stem = short_name(&stem);
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
            latency: None,
            robot: None,
            source: ScenarioSource::Recording(runs),
            options,
            checkpoints: Vec::new(),
            piece: None,
            columns: ColumnChoice::Headline,
            ranges: RangeEnds::default(),
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
    /// The errors of [`InputFiles::runs`]; [`Error::Invalid`] for a checkpoint whose `file` is
    /// not among them, or whose frames or seconds are ambiguous.
    pub fn recordings(&self) -> Result<Vec<InputFile>> {
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
            let wrong = |what: String| {
                let what = format!("checkpoint {number} ({name}): {what}");
                Err(Error::Invalid(what))
            };
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
    /// The errors of [`Scenario::read`].
    #[inline]
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
                Some(RandomScenes::Boards) => "boards",
            },
            ScenarioSource::Drive { .. } => "courses",
            ScenarioSource::Dataset { .. } | ScenarioSource::Recording(_) => &self.name,
        }
    }

    /// True if each pair shows another scene, so that none has a past: data sets, random shapes.
    pub fn has_separate_pairs(&self) -> bool {
        match &self.source {
            ScenarioSource::Arena { config, .. } => {
                config.random.is_some_and(RandomScenes::are_layers)
            }
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
            pieces: self.piece.clone(),
            ..Judge::default()
        }
    }

    /// The algorithms' labels.
    pub fn labels(&self) -> Vec<&str> {
        self.algorithms.iter().map(Algorithm::label).collect()
    }
}
