//! The runs of a scenario, opened to be scored.

use crate::console::{Console, Unit, Watch};
use crate::record;
use crate::sink::RunningTable;
use crate::source::dataset::{Scene, SceneSource};
use crate::source::{
    self, ArenaSource, Chain, Opened, RecordingSource, Request, RunSource, Source, SourceKind,
    SourceMaps, SourceOrigin, ToldFloor, refuse_topics, run_request,
};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use svl_core::matcher::{Algorithm, MapPlace};
use svl_core::{Error, Result, interrupt};
use svl_grab::Host;
use svl_score::judge::Judge;
use svl_score::manifest::InputRecord;
use svl_score::scenario::{Scenario, ScenarioSource, SourceOptions};
use svl_sim::arena::Arena;

/// Gives each scenario those source options of the command line that it accepts. `named`: the
/// user's name of the first one.
///
/// # Errors
/// For an option that is for none of them, and for options that contradict each other.
pub fn change(scenarios: &mut [Scenario], given: &SourceOptions, named: &str) -> Result<()> {
    let kinds: Vec<_> = scenarios.iter().map(|own| own.options.kind).collect();
    given
        .refuse_others(&kinds)
        .map_err(|why| Error::Usage(format!("{named}: {why}")))?;
    for scenario in scenarios {
        *scenario = scenario
            .with(given)
            .map_err(|e| Error::Usage(e.to_string()))?;
    }
    Ok(())
}

/// The scenario that is named, or one of the recordings that are named.
pub fn named(what: &[String]) -> Result<Scenario> {
    let is_scenario = |what: &str| Path::new(what).extension().is_some_and(|e| e == "toml");
    let simulated = |name: &str| match SourceKind::without_files(name)?.origin {
        SourceOrigin::Simulated { scenario } => scenario,
        _ => None,
    };
    if let [name] = what
        && let Some(scenario) = simulated(name)
    {
        return scenario();
    }
    match what {
        [path] if is_scenario(path) => Scenario::read(Path::new(path)),
        recordings => {
            if let Some(name) = recordings.iter().find(|name| SourceKind::are_topics(name)) {
                let cure = format!("record them first, svl record {name} -o run.mcap");
                return Err(Error::Usage(format!("{name}: are live topics; {cure}")));
            }
            if let Some(name) = recordings.iter().find(|name| is_scenario(name)) {
                let cure = "name one scenario, or recordings";
                return Err(Error::Usage(format!("{name}: is a scenario; {cure}")));
            }
            Scenario::from_recordings(recordings, vec![Algorithm::default()])
        }
    }
}

/// A run with its judge.
pub enum ScoredSource {
    Opened(Box<(RunSource, Judge)>),
    /// A run of the arena with that seed, recorded only when it is reached: the screen shows all
    /// runs before it by then.
    Arena(u64),
}

impl ScoredSource {
    /// The recording of the user's that it reads.
    pub fn record(&self) -> Option<InputRecord> {
        match self {
            Self::Opened(opened) => opened.0.record.clone(),
            Self::Arena(_) => None,
        }
    }

    /// Names of the layers around its source.
    ///
    /// # Errors
    /// The errors of the scenario's options.
    pub fn chain(&self, scenario: &Scenario) -> Result<Vec<String>> {
        match self {
            Self::Opened(opened) => Ok(opened.0.chain.clone()),
            Self::Arena(_) => Ok(layers(scenario)?.words()),
        }
    }

    /// Seed of the arena's run.
    pub fn seed(&self) -> Option<u64> {
        match self {
            Self::Opened(_) => None,
            Self::Arena(seed) => Some(*seed),
        }
    }

    /// True if its pairs have a truth, and if they are raw.
    pub(crate) fn pair_kinds(&self, scenario: &Scenario) -> [bool; 2] {
        match self {
            Self::Opened(opened) => {
                let named = scenario.options.truth.is_some();
                [named || opened.0.has_truth, opened.0.is_raw]
            }
            Self::Arena(_) => [true, false],
        }
    }

    /// Opens the run, recorded first if the cache does not have it.
    pub fn open(
        self,
        scenario: &Scenario,
        console: &dyn Console,
        table: Option<&RunningTable>,
    ) -> Result<(RunSource, Judge)> {
        let seed = match self {
            Self::Opened(opened) => return Ok(*opened),
            Self::Arena(seed) => seed,
        };
        if let (Some(_), ScenarioSource::Arena { config, .. }) = (&scenario.piece, &scenario.source)
        {
            // Hundreds of short runs: rendered as they are matched, and not stored.
            let arena = Arena::new(config, seed)?;
            let floor = arena.above_floor_m().map(ToldFloor::below);
            let source = ArenaSource::new(arena, seed);
            let mut run = read(scenario, source, (Some(seed), floor))?;
            let judge = run.judge(&scenario.judge())?;
            return Ok((run, judge));
        }
        let path = cached_run(scenario, seed, console, table)?;
        let source = RecordingSource::open(path)?;
        let header = source.reader.header();
        let level = header.and_then(|header| header.camera_height_m);
        let floor = level.map(ToldFloor::below);
        let mut run = read(scenario, source, (Some(seed), floor))?;
        let judge = run.judge(&scenario.judge())?;
        Ok((run, judge))
    }
}

/// The layers that the scenario asks for: its pairs, with the truth that it asks for.
fn layers(scenario: &Scenario) -> Result<Chain> {
    let maps = Request::default().with_maps(&scenario.algorithms).maps;
    Ok(Chain {
        measure: SourceMaps::default().with_files(&maps)?,
        ..Chain::for_options(&scenario.options, false)
    })
}

/// A run of a source, in the layers of the scenario.
fn read(
    scenario: &Scenario,
    source: impl Source + 'static,
    (seed, floor): (Option<u64>, Option<ToldFloor>),
) -> Result<RunSource> {
    let maps = scenario.algorithms.iter().filter_map(Algorithm::recorded);
    refuse_topics(&maps.collect::<Vec<_>>(), &source.name())?;
    let layers = Chain {
        floor,
        ..layers(scenario)?
    };
    RunSource::new(Box::new(source), layers, seed)
}

/// The scenario's runs. All that the user names is opened, so that an error in the last one is
/// reported before the first is scored.
pub fn runs(scenario: &Scenario, console: &dyn Console) -> Result<Vec<ScoredSource>> {
    (0..checked_count(scenario)?)
        .map(|place| run_at(scenario, place, console))
        .collect()
}

/// Number of the scenario's runs, which its algorithms may match.
///
/// # Errors
/// [`Error::Usage`] with the algorithm whose maps they do not have.
pub(crate) fn checked_count(scenario: &Scenario) -> Result<usize> {
    let count = count(scenario)?;
    let has_files = |algorithm: &Algorithm| {
        let place = algorithm.recorded().map(|map| map.place);
        matches!(place, Some(MapPlace::Files { .. }))
    };
    if count > 1
        && let Some(algorithm) = scenario.algorithms.iter().find(|a| has_files(a))
    {
        return Err(Error::Usage(format!(
            "{}: files are those of one run, and there are {count}: name one",
            algorithm.label()
        )));
    }
    // Before the arena is recorded, which takes a while.
    if let ScenarioSource::Arena { .. } = scenario.source {
        let maps = scenario.algorithms.iter().filter_map(Algorithm::recorded);
        refuse_topics(&maps.collect::<Vec<_>>(), "the arena")?;
    }
    Ok(count)
}

/// Number of the scenario's runs.
fn count(scenario: &Scenario) -> Result<usize> {
    Ok(match &scenario.source {
        ScenarioSource::Arena { seeds, .. } | ScenarioSource::Drive { seeds, .. } => seeds.len(),
        ScenarioSource::Dataset { .. } => 1,
        ScenarioSource::Recording(_) => scenario.recordings()?.len(),
    })
}

/// The run at index `place`.
pub fn run_at(scenario: &Scenario, place: usize, console: &dyn Console) -> Result<ScoredSource> {
    let name = &scenario.name;
    let mut run = match &scenario.source {
        ScenarioSource::Arena { seeds, .. } => return Ok(ScoredSource::Arena(seeds[place])),
        ScenarioSource::Drive { .. } => {
            return Err(Error::Usage(format!(
                "scenario '{name}' is driven: `svl score` runs it"
            )));
        }
        ScenarioSource::Dataset { scenes } => {
            let Some(data) = data_folder(scenario.options.data.as_deref()) else {
                return Err(Error::Invalid(format!(
                    "scenario '{name}' reads scenes of data sets: name their folder with --data \
                     DIR or SVL_DATASETS"
                )));
            };
            let scenes = Scene::find_all(&data, scenes)?;
            read(scenario, SceneSource::new(scenes), (None, None))?
        }
        ScenarioSource::Recording(_) => {
            let run = &scenario.recordings()?[place];
            RunSource::from_recording(run, open(run_request(scenario, run)?, console)?)?
        }
    };
    // A sensor may have no measurement of the first pair.
    if scenario.piece.is_some() && !run.has_truth && scenario.options.truth.is_none() {
        return Err(Error::Invalid(format!(
            "{}: a test piece is found in the truth: --truth with a depth image, or a board on the \
             piece",
            run.title(name)
        )));
    }
    let judge = run.judge(&scenario.judge())?;
    Ok(ScoredSource::Opened(Box::new((run, judge))))
}

/// The folder of unnamed recordings, and of the cache of simulated runs.
pub const RECORDINGS: &str = "recordings";

/// The recording of an arena scenario with a seed, made first unless the cache has it.
///
/// # Errors
/// The errors of [`record::cached_run`]; [`Error::Interrupted`].
pub fn cached_run(
    scenario: &Scenario,
    seed: u64,
    console: &dyn Console,
    table: Option<&RunningTable>,
) -> Result<PathBuf> {
    let folder = Path::new(RECORDINGS);
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
    let pairs = match &scenario.source {
        ScenarioSource::Arena { config, .. } => Some(config.frames),
        _ => None,
    };
    let kind = scenario.kind();
    let work = format!("record {kind}, seed {seed}");
    let mut watch = Watch::new(console, &work, pairs, table);
    let cached = record::cached_run(folder, scenario, seed, &mut watch);
    if interrupt::requested() {
        return Err(Error::Invalid(format!(
            "interrupted while recording {kind}"
        )));
    }
    cached
}

/// Opens a source, with a progress bar if that takes long, and prints its notes.
///
/// # Errors
/// The errors of [`source::open`].
pub fn open(request: Request<'_>, console: &dyn Console) -> Result<Opened> {
    // Most sources open at once and show no bar.
    let bar = OnceLock::new();
    let step = |count| {
        bar.get_or_init(|| console.bar("rendering", Unit::Pairs, count))
            .step();
    };
    let opened = source::open(&Request {
        host: Host {
            stopped: interrupt::requested,
            preparing: &|line| console.note(line),
            progress: &step,
        },
        ..request
    });
    drop(bar);
    noted(opened?, console)
}

/// Opens a recording, and prints its notes.
///
/// # Errors
/// The errors of [`source::open_recording`].
pub fn open_recording(request: &Request<'_>, console: &dyn Console) -> Result<Opened> {
    let request = Request {
        host: Host {
            stopped: interrupt::requested,
            ..request.host
        },
        ..request.clone()
    };
    noted(source::open_recording(&request)?, console)
}

fn noted(opened: Opened, console: &dyn Console) -> Result<Opened> {
    opened.notes.iter().for_each(|note| console.note(note));
    Ok(opened)
}

/// The folder of the data sets: the one named, or that of `SVL_DATASETS`.
pub fn data_folder(named: Option<&Path>) -> Option<PathBuf> {
    let variable = || std::env::var_os("SVL_DATASETS").filter(|folder| !folder.is_empty());
    let named = named.map(Path::to_owned);
    named.or_else(|| variable().map(PathBuf::from))
}

/// Refuses algorithms that report maps which others computed, where pairs have none.
///
/// # Errors
/// [`Error::Usage`] with the first.
pub fn refuse_recorded(algorithms: &[Algorithm]) -> Result<()> {
    match algorithms.iter().find(|a| a.spec().is_recorded()) {
        None => Ok(()),
        Some(algorithm) => Err(Error::Usage(format!(
            "{}: matches no images; `svl score` and `svl replay` read its maps with the pairs of a \
             recording",
            algorithm.label()
        ))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::SOURCES;

    #[test]
    fn simulated_sources_are_named_by_their_scenarios() {
        let simulated = SOURCES.iter().filter(|kind| kind.is_simulated());
        for kind in simulated.filter(|kind| kind.is_scored()) {
            assert_eq!(named(&[kind.name.to_owned()]).unwrap().name, kind.name);
        }
    }

    #[test]
    fn topics_are_recorded_before_they_are_scored() {
        let topics = SOURCES.iter().filter_map(|kind| match &kind.origin {
            SourceOrigin::Topics(topics) => Some(topics.prefix),
            _ => None,
        });
        for name in topics {
            let refused = named(&[name.to_owned()]).unwrap_err().to_string();
            assert!(refused.contains(&format!("svl record {name}")), "{refused}");
        }
    }
}
