//! The runs of a scenario, opened to be scored.

use super::live::LiveTable;
use super::source::{self, RangeArgs, RectifyArgs, ReferenceArgs, TopicArgs, data_folder};
use super::{recordings, usage};
use anyhow::bail;
use clap::builder::NonEmptyStringValueParser;
use std::path::{Path, PathBuf};
use svl::manifest::RunRecord;
use svl::scenario::{PairRange, Scenario, ScenarioSource, SeedList};
use svl::score::Judge;
use svl::source::dataset::{Scene, SceneSource};
use svl::source::{Limited, RecordingSource, Request, RunSource, run_request};

/// What of a scenario's source the command line changes.
#[derive(clap::Args, Default)]
pub(crate) struct ScenarioSourceArgs {
    /// Folder of the data sets, for scenarios that read scenes [default: what SVL_DATASETS names]
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// These scenes below the folder of the data sets in place of the scenario's; DIR/* are all in
    /// a folder
    #[arg(
        long, value_name = "SCENE", num_args = 1..,
        value_parser = NonEmptyStringValueParser::new()
    )]
    scenes: Vec<String>,
    /// These seeds in place of the arena's, as 4..10 or 4,7,9
    #[arg(long, value_name = "SEEDS", value_parser = clap::value_parser!(SeedList))]
    seeds: Option<SeedList>,
    #[command(flatten)]
    topics: TopicArgs,
    #[command(flatten)]
    rectify: RectifyArgs,
    #[command(flatten)]
    range: RangeArgs,
    #[command(flatten)]
    pub(crate) reference: ReferenceArgs,
}

impl ScenarioSourceArgs {
    /// Whether other pairs are asked for than the source has, or another truth.
    pub(crate) fn changes_pairs(&self) -> bool {
        self.range.is_given() || self.reference.is_given()
    }

    /// Fills the request of a source that is no scenario's.
    pub(crate) fn fill(&self, request: &mut Request<'_>) {
        self.topics.fill(request);
        self.rectify.fill(request);
        self.range.fill(&mut request.range);
        let first = self.seeds.as_ref().and_then(|list| list.seeds().first());
        request.seed = first.copied().or(request.seed);
    }

    /// Changes the scenarios that the options are for; the user called the first one `named`.
    ///
    /// # Errors
    /// For an option that is for none of them.
    pub(crate) fn change(&self, scenarios: &mut [Scenario], named: &str) -> anyhow::Result<()> {
        if !self.scenes.is_empty() {
            let names = self.scenes.join(", ");
            let changed = scenarios.iter_mut().filter_map(|scenario| {
                let ScenarioSource::Dataset { scenes } = &mut scenario.source else {
                    return None;
                };
                scenes.clone_from(&self.scenes);
                note(scenario, "scenes", &names);
                Some(())
            });
            if changed.count() == 0 {
                bail!("{named}: does not read scenes; --scenes is for scenarios that do");
            }
        }
        if let Some(list) = &self.seeds {
            let changed = scenarios.iter_mut().filter_map(|scenario| {
                let (ScenarioSource::Arena { seeds, .. } | ScenarioSource::Drive { seeds, .. }) =
                    &mut scenario.source
                else {
                    return None;
                };
                *seeds = list.seeds().to_vec();
                note(scenario, "seeds", &list.to_string());
                Some(())
            });
            if changed.count() == 0 {
                bail!("{named}: is not of the arena; --seeds is for scenarios that are");
            }
        }
        let is_recorded = |of: &Scenario| matches!(of.source, ScenarioSource::Recording(_));
        if (self.topics.is_given() || self.rectify.is_given()) && !scenarios.iter().any(is_recorded)
        {
            let words = "--left, --right, --side-by-side, --fps, --bits, --max-skew-ms, --truth \
                         and --calib are for recordings";
            return Err(usage::wrong(format!("{named}: {words}")));
        }
        Ok(())
    }
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
            Ok(Scenario::of_recordings(recordings, vec!["v5".parse()?])?)
        }
    }
}

/// Says in the scenario what was changed: its page and its hash identify it.
pub(crate) fn note(scenario: &mut Scenario, what: &str, names: &str) {
    let words = format!("\n\nOf other {what} than the scenario's: {names}.");
    scenario.description.push_str(&words);
    scenario.text.push_str(&format!("\n# --{what} {names}\n"));
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
        args: &ScenarioSourceArgs,
        quiet: bool,
        table: Option<&LiveTable>,
    ) -> anyhow::Result<(RunSource, Judge)> {
        let seed = match self {
            Self::Opened(opened) => return Ok(*opened),
            Self::Arena(seed) => seed,
        };
        let path = recordings::cached_run(scenario, seed, quiet, table)?;
        let source = Limited::new(Box::new(RecordingSource::open(path)?), range(args)?, None);
        let source = args.reference.wrap(Box::new(source))?;
        let mut run = RunSource::new(source, Some(seed));
        let judge = run.judge(&scenario.judge())?;
        Ok((run, judge))
    }
}

fn range(args: &ScenarioSourceArgs) -> anyhow::Result<PairRange> {
    let mut range = PairRange::default();
    args.range.fill(&mut range);
    range.validate().map_err(usage::wrong)?;
    Ok(range)
}

/// The scenario's runs. All that the user names is opened, so that what is wrong with the last one
/// is said before the first is scored.
pub(crate) fn runs(
    scenario: &Scenario,
    args: &ScenarioSourceArgs,
    quiet: bool,
) -> anyhow::Result<Vec<ScoredSource>> {
    (0..count(scenario)?)
        .map(|place| run_at(scenario, args, place, quiet))
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
    args: &ScenarioSourceArgs,
    place: usize,
    quiet: bool,
) -> anyhow::Result<ScoredSource> {
    let range = range(args)?;
    let mut run = match &scenario.source {
        ScenarioSource::Arena { seeds, .. } => return Ok(ScoredSource::Arena(seeds[place])),
        ScenarioSource::Drive { .. } => {
            return Err(usage::wrong(format!(
                "scenario '{}' is driven: `svl score` runs it",
                scenario.name
            )));
        }
        ScenarioSource::Dataset { scenes } => {
            let Some(data) = data_folder(args.data.as_deref()) else {
                bail!(
                    "scenario '{}' reads scenes of data sets: name their folder with --data DIR \
                     or SVL_DATASETS",
                    scenario.name
                );
            };
            let scenes = Scene::find_all(&data, scenes)?;
            let source = Limited::new(Box::new(SceneSource::new(scenes)), range, None);
            let source = args.reference.wrap(Box::new(source))?;
            RunSource::new(source, None)
        }
        ScenarioSource::Recording(recorded) => {
            let run = &scenario.recordings()?[place];
            let mut request = run_request(recorded, run)?;
            args.topics.fill(&mut request);
            args.rectify.fill(&mut request);
            args.range.fill(&mut request.range);
            let mut opened = source::open(request, quiet)?;
            opened.source = args.reference.wrap(opened.source)?;
            RunSource::of_recording(run, opened)
        }
    };
    let judge = run.judge(&scenario.judge())?;
    Ok(ScoredSource::Opened(Box::new((run, judge))))
}
