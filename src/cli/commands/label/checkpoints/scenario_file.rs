//! The scenario that checkpoints are written to: begun for a source, or extended. Its text is kept
//! to the byte: a checkpoint is appended.

use super::draft::{Draft, LabelledCell, first_other};
use super::label::CellLabel;
use super::{Args, LabelStepper};
use crate::cli::commands::label::input::replace;
use crate::cli::shared::usage;
use anyhow::bail;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use svl::files::safe_name;
use svl::scenario::{Scenario, ScenarioSource, SeedList, SourceOptions};
use svl::score::{Checkpoint, CheckpointPlace, ExpectedCell, FrameOrigin, LabelledPair};
use svl::source::{ArenaSource, Opened};

/// The scenario file, and which of its runs is labelled.
pub(super) struct ScenarioFile {
    pub(super) path: PathBuf,
    pub(super) scenario: Scenario,
    /// Beginning of a file that is not yet there.
    begun: Option<String>,
    /// The run that is labelled, where there are several.
    file: Option<String>,
}

impl ScenarioFile {
    /// An existing scenario of `source`; none if there is no such file.
    ///
    /// # Errors
    /// The file is not a scenario, or does not list the source.
    pub(super) fn read(path: &Path, source: &str) -> anyhow::Result<Option<Self>> {
        let exists = path.try_exists();
        if !exists.map_err(|error| svl::Error::io(path, error))? {
            return Ok(None);
        }
        let scenario = Scenario::read(path)?;
        let shown = path.display();
        let file = match &scenario.source {
            ScenarioSource::Recording(_) => {
                let runs = scenario.recordings()?;
                let labelled = Path::new(source).canonicalize().ok();
                let same = |run: &Path| labelled.is_some() && run.canonicalize().ok() == labelled;
                let Some(run) = runs.iter().find(|run| same(&run.path)) else {
                    bail!(
                        "{shown}: {source} is not in its source.files; add it there, or name \
                         another scenario with -o"
                    );
                };
                (runs.len() > 1).then(|| run.name.clone())
            }
            // The arena is known once the source is open.
            ScenarioSource::Arena { .. } => None,
            ScenarioSource::Drive { .. } => {
                return Err(usage::wrong(format!(
                    "{shown}: its frames depend on the algorithm; label checkpoints of the arena \
                     or of recordings"
                )));
            }
            ScenarioSource::Dataset { .. } => {
                bail!("{shown}: scores scenes of data sets; name another scenario with -o")
            }
        };
        Ok(Some(Self {
            path: path.to_owned(),
            scenario,
            begun: None,
            file,
        }))
    }

    /// Begins a scenario, which is written with its first checkpoint. `options`: those with which
    /// it reads its source.
    pub(super) fn begin(
        path: &Path,
        args: &Args,
        opened: &Opened,
        options: SourceOptions,
    ) -> anyhow::Result<Self> {
        let text = begun(path, args, opened, options)?;
        Ok(Self {
            path: path.to_owned(),
            scenario: Scenario::parse(&text, path)?,
            begun: Some(text),
            file: None,
        })
    }

    /// Refuses the frames of another arena than the scenario's.
    pub(super) fn check(&self, opened: &Opened) -> anyhow::Result<()> {
        let ScenarioSource::Arena { config, seeds } = &self.scenario.source else {
            return Ok(());
        };
        let shown = self.path.display();
        if seeds.len() > 1 {
            bail!(
                "{shown}: has several seeds, and their frames show different scenes; \
                 name another scenario with -o"
            );
        }
        if opened.header.hash == Some(ArenaSource::hash(config, seeds[0])) {
            Ok(())
        } else {
            bail!("{shown}: is of another arena or seed; name another scenario with -o")
        }
    }

    /// Refuses a recording in which the pairs of the run's checkpoints are others.
    pub(super) fn check_pairs(
        &self,
        run: &FrameOrigin,
        stepper: &mut LabelStepper<'_>,
    ) -> anyhow::Result<()> {
        let first = stepper.frame.sequence;
        let own = |checkpoint: &&Checkpoint| run.is_in(checkpoint.file.as_deref());
        for checkpoint in self.scenario.checkpoints.iter().filter(own) {
            if let Some(LabelledPair { frame, .. }) = first_other(&checkpoint.pairs, stepper) {
                let Checkpoint { number, name, .. } = checkpoint;
                bail!(
                    "{}: checkpoint {number} ({name}) was labelled at another frame {frame} than \
                     this source has; name the recording of then, or another scenario with -o",
                    self.path.display()
                );
            }
        }
        stepper.go_to(first);
        Ok(())
    }

    /// The run that is labelled, as its checkpoints name it.
    pub(super) fn run(&self, start_ns: u64) -> FrameOrigin {
        let runs = self.scenario.recordings().unwrap_or_default();
        let only = || runs.first().map(|run| run.name.clone());
        FrameOrigin {
            name: self.file.clone().or_else(only).unwrap_or_default(),
            start_ns,
            ..FrameOrigin::default()
        }
    }

    /// The number of the next checkpoint.
    pub(super) fn next_number(&self) -> u32 {
        let numbers = self.scenario.checkpoints.iter().map(|own| own.number);
        numbers.max().map_or(1, |number| number.saturating_add(1))
    }

    /// Appends a checkpoint. Returns its number.
    ///
    /// # Errors
    /// The scenario would be invalid with it, or cannot be written; it is unchanged then.
    pub(super) fn write(&mut self, draft: &Draft, shown: u64) -> anyhow::Result<u32> {
        let mut text = match &self.begun {
            Some(text) => text.clone(),
            // It may have been edited since.
            None => {
                self.scenario = Scenario::read(&self.path)?;
                self.scenario.text.clone()
            }
        };
        let number = self.next_number();
        text += if text.ends_with('\n') { "\n" } else { "\n\n" };
        let added = BTreeMap::from([("checkpoint", [self.checkpoint(number, draft, shown)])]);
        text += &toml::to_string(&added)?;
        let scenario = Scenario::parse(&text, &self.path)?;
        scenario.recordings()?;
        if self.begun.is_some() && self.path.exists() {
            let shown = self.path.display();
            bail!("{shown}: was made meanwhile; quit, and start again to extend it");
        }
        replace(&self.path, &text, true)?;
        (self.scenario, self.begun) = (scenario, None);
        Ok(number)
    }

    fn checkpoint(&self, number: u32, draft: &Draft, shown: u64) -> Checkpoint {
        let (name, description) = draft.name.split_once(": ").unwrap_or((&draft.name, ""));
        let cells = draft.cells.iter();
        let must = cells.clone().filter(|cell| cell.label == CellLabel::Must);
        let seen = |&LabelledCell { at, label, .. }: &LabelledCell| match label {
            CellLabel::Seen(expectation) => Some(ExpectedCell { at, expectation }),
            CellLabel::Must => None,
        };
        Checkpoint {
            number,
            name: name.to_owned(),
            description: description.to_owned(),
            place: CheckpointPlace::Frames(draft.frames(shown)),
            file: self.file.clone(),
            pairs: draft.labelled().into_iter().cloned().collect(),
            cells: Vec::new(),
            must: must.map(|cell| cell.at).collect(),
            order: Vec::new(),
            expected: cells.filter_map(seen).collect(),
        }
    }
}

/// The text of a new scenario.
fn begun(
    path: &Path,
    args: &Args,
    opened: &Opened,
    mut options: SourceOptions,
) -> anyhow::Result<String> {
    let (stem, source) = (path.file_stem().unwrap_or_default(), &args.input.source);
    let scenario = opened.scenario.as_deref();
    let begun = match scenario.filter(|_| opened.recording.is_none()) {
        // Everything that the run depends on, and the rule by which its cells are scored.
        Some(arena) => {
            let seed = opened.header.seed.unwrap_or(1);
            options.seeds = Some(SeedList::new(vec![seed]).map_err(svl::Error::Usage)?);
            Scenario {
                checkpoints: Vec::new(),
                filters: Vec::new(),
                stress: Vec::new(),
                gate: Vec::new(),
                ..Scenario::parse(arena, path)?.with(&options)?
            }
        }
        None => Scenario {
            grid: args.grid.unwrap_or_default().into(),
            ..Scenario::from_recordings(&[source.to_owned()], Vec::new())?.with(&options)?
        },
    };
    let algorithm = args.algo.clone().map_or_else(|| "v3".parse(), Ok)?;
    let scenario = Scenario {
        name: safe_name(&stem.to_string_lossy(), 64),
        description: format!("What a person measured or saw in {source}"),
        algorithms: vec![algorithm],
        ..begun
    };
    let head = "# Begun by `svl label checkpoints`; docs/scoring.md lists what can be added.\n";
    let folder = path.parent().unwrap_or(Path::new(""));
    Ok(head.to_owned() + &scenario.to_toml(folder)?)
}
