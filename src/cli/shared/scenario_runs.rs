//! The runs of a scenario, opened to be scored.

use super::live::LiveTable;
use super::source::{self, data_folder};
use super::{recordings, usage};
use anyhow::bail;
use std::path::Path;
use svl::manifest::RunRecord;
use svl::matcher::Algorithm;
use svl::scenario::{Scenario, ScenarioSource, SourceOptions};
use svl::score::Judge;
use svl::source::dataset::{Scene, SceneSource};
use svl::source::{Limited, RecordingSource, ReferenceSource, RunSource, Source, run_request};

/// Gives scenarios the source options of the command line, each those that it takes; the user
/// called the first one `named`.
///
/// # Errors
/// For an option that is for none of them, and for options that contradict each other.
pub(crate) fn change(
    scenarios: &mut [Scenario],
    given: &SourceOptions,
    named: &str,
) -> anyhow::Result<()> {
    let kinds: Vec<_> = scenarios
        .iter()
        .map(|scenario| scenario.options.kind)
        .collect();
    given
        .refuse_others(&kinds)
        .map_err(|why| usage::wrong(format!("{named}: {why}")))?;
    for scenario in scenarios {
        *scenario = scenario.with(given).map_err(usage::wrong)?;
    }
    Ok(())
}

/// The scenario that is named, or that of the recordings that are.
pub(crate) fn named(what: &[String]) -> anyhow::Result<Scenario> {
    let is_scenario = |what: &str| Path::new(what).extension().is_some_and(|e| e == "toml");
    match what {
        [name] if name == "arena" => Ok(Scenario::arena()?),
        [path] if is_scenario(path) => Ok(Scenario::read(Path::new(path))?),
        recordings => {
            if let Some(name) = recordings.iter().find(|name| is_scenario(name)) {
                let cure = "name one scenario, or recordings";
                return Err(usage::wrong(format!("{name}: is a scenario; {cure}")));
            }
            Ok(Scenario::of_recordings(
                recordings,
                vec![Algorithm::default()],
            )?)
        }
    }
}

/// A run with its judge.
pub(crate) enum ScoredSource {
    Opened(Box<(RunSource, Judge)>),
    /// Of the arena with that seed, recorded when its turn comes: what comes before is on the
    /// screen by then.
    Arena(u64),
}

impl ScoredSource {
    /// The recording of the user's that it reads.
    pub(crate) fn record(&self) -> Option<RunRecord> {
        match self {
            Self::Opened(opened) => opened.0.record.clone(),
            Self::Arena(_) => None,
        }
    }

    /// Seed of the arena's run.
    pub(crate) fn seed(&self) -> Option<u64> {
        match self {
            Self::Opened(_) => None,
            Self::Arena(seed) => Some(*seed),
        }
    }

    /// Opens it, recorded first where the cache does not hold it.
    pub(crate) fn open(
        self,
        scenario: &Scenario,
        quiet: bool,
        table: Option<&LiveTable>,
    ) -> anyhow::Result<(RunSource, Judge)> {
        let seed = match self {
            Self::Opened(opened) => return Ok(*opened),
            Self::Arena(seed) => seed,
        };
        let path = recordings::cached_run(scenario, seed, quiet, table)?;
        let source = read(scenario, RecordingSource::open(path)?)?;
        let mut run = RunSource::new(source, Some(seed));
        let judge = run.judge(&scenario.judge())?;
        Ok((run, judge))
    }
}

/// The pairs of a source that the scenario asks for, with the truth that it asks for.
fn read(scenario: &Scenario, source: impl Source + 'static) -> anyhow::Result<Box<dyn Source>> {
    let source = Limited::new(Box::new(source), scenario.options.range(), None);
    let references = scenario.options.references()?;
    Ok(match &references[..] {
        [] => Box::new(source),
        references => Box::new(ReferenceSource::new(Box::new(source), references)?),
    })
}

/// The scenario's runs. All that the user names is opened, so that what is wrong with the last one
/// is said before the first is scored.
pub(crate) fn runs(scenario: &Scenario, quiet: bool) -> anyhow::Result<Vec<ScoredSource>> {
    (0..count(scenario)?)
        .map(|place| run_at(scenario, place, quiet))
        .collect()
}

/// The number of the scenario's runs.
pub(crate) fn count(scenario: &Scenario) -> anyhow::Result<usize> {
    Ok(match &scenario.source {
        ScenarioSource::Arena { seeds, .. } | ScenarioSource::Drive { seeds, .. } => seeds.len(),
        ScenarioSource::Dataset { .. } => 1,
        ScenarioSource::Recording(_) => scenario.recordings()?.len(),
    })
}

/// The run at that place.
pub(crate) fn run_at(
    scenario: &Scenario,
    place: usize,
    quiet: bool,
) -> anyhow::Result<ScoredSource> {
    let mut run = match &scenario.source {
        ScenarioSource::Arena { seeds, .. } => return Ok(ScoredSource::Arena(seeds[place])),
        ScenarioSource::Drive { .. } => {
            return Err(usage::wrong(format!(
                "scenario '{}' is driven: `svl score` runs it",
                scenario.name
            )));
        }
        ScenarioSource::Dataset { scenes } => {
            let Some(data) = data_folder(scenario.options.data.as_deref()) else {
                bail!(
                    "scenario '{}' reads scenes of data sets: name their folder with --data DIR \
                     or SVL_DATASETS",
                    scenario.name
                );
            };
            let scenes = Scene::find_all(&data, scenes)?;
            RunSource::new(read(scenario, SceneSource::new(scenes))?, None)
        }
        ScenarioSource::Recording(_) => {
            let run = &scenario.recordings()?[place];
            RunSource::of_recording(run, source::open(run_request(scenario, run)?, quiet)?)
        }
    };
    let judge = run.judge(&scenario.judge())?;
    Ok(ScoredSource::Opened(Box::new((run, judge))))
}
