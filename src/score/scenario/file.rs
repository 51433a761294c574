//! The file of a scenario, and its validation.

use super::source::algorithm_of;
use super::stress::StressTable;
use super::toml_error::line;
use super::{
    CellKeys, DriveConfig, InputFiles, Limit, MAX_GRID, RangeEnds, Scenario, ScenarioFilter,
    ScenarioKind, ScenarioSource, SourceOptions, distinct_kinds,
};
use crate::judge::{Checkpoint, CheckpointPlace, ColumnChoice, PieceConfig, RobotSize};
use serde::{Deserialize, Serialize};
use std::path::Path;
use svl_core::depth::GridSettings;
use svl_core::matcher::Algorithm;
use svl_core::stereo::GridShape;
use svl_core::{Error, Result};
use svl_files::safe_name;
use svl_sim::arena::ArenaConfig;

/// The file before validation.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    pub(super) name: String,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub(super) description: String,
    #[serde(default = "v5")]
    pub(super) algorithms: Vec<String>,
    #[serde(default, skip_serializing_if = "is_headline")]
    pub(super) columns: ColumnChoice,
    #[serde(default, skip_serializing_if = "RangeEnds::is_empty")]
    pub(super) ranges: RangeEnds,
    #[serde(default)]
    pub(super) grid: GridSettings,
    #[serde(default)]
    pub(super) cells: CellKeys,
    pub(super) robot: Option<RobotSize>,
    pub(super) source: SourceOptions,
    pub(super) arena: Option<ArenaConfig>,
    pub(super) drive: Option<DriveConfig>,
    pub(super) piece: Option<PieceConfig>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) checkpoint: Vec<Checkpoint>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) filter: Vec<ScenarioFilter>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) stress: Vec<StressTable>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) gate: Vec<toml::Spanned<Limit>>,
}

fn is_headline(columns: &ColumnChoice) -> bool {
    *columns == ColumnChoice::Headline
}

fn v5() -> Vec<String> {
    vec!["v5".to_owned()]
}

impl File {
    /// Checks name, grid, rule and checkpoints.
    fn check_head(&self) -> Result<()> {
        if self.name.is_empty() || self.name != safe_name(&self.name, 64) {
            return invalid(format!(
                "name '{}' must be letters, digits, '-', '_' and '.' (not first): it names folders",
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
        self.cells.rule.validate()?;
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

    pub(super) fn check(self, text: &str, folder: &Path) -> Result<Scenario> {
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
        let grid = self.grid.shape();
        let source = source(&options, self.arena, self.drive, grid, &algorithms, folder)?;
        if matches!(source, ScenarioSource::Drive { .. }) && !self.checkpoint.is_empty() {
            let belongs = "is for pairs that do not depend on the algorithm, not for drives";
            return invalid(format!("[[checkpoint]] {belongs}"));
        }
        for checkpoint in &self.checkpoint {
            check_place(checkpoint, &source)?;
        }
        let mut scenario = Scenario {
            name: self.name,
            description: self.description,
            algorithms,
            grid: self.grid,
            cells: self.cells.rule,
            latency: self.cells.latency_ms,
            robot: self.robot,
            source,
            options,
            checkpoints: self.checkpoint,
            piece: None,
            columns: self.columns,
            ranges: self.ranges,
            filters,
            stress,
            gate,
            text: text.to_owned(),
        };
        scenario.check_motion()?;
        if let Some(piece) = self.piece {
            scenario.set_piece(piece)?;
        }
        Ok(scenario)
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
    algorithms: &[Algorithm],
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
            drive.validate(grid, config.frames, config.rate_hz, algorithms)?;
            ScenarioSource::Drive {
                config: Box::new(config),
                drive: Box::new(drive),
                seeds: options.seeds(),
            }
        }
        Dataset => ScenarioSource::Dataset {
            scenes: options.scenes.clone(),
        },
        Recording => ScenarioSource::Recording(InputFiles {
            files: options.files.clone(),
            folder: folder.to_owned(),
        }),
    })
}

fn invalid<T>(what: String) -> Result<T> {
    Err(Error::Invalid(what))
}
