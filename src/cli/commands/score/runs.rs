//! What `svl score` scores: the scenario that is named or meant, and its runs.

use super::Args;
use crate::cli::shared::live::LiveTable;
use crate::cli::shared::source::{self, data_folder};
use crate::cli::shared::{recordings, usage};
use anyhow::bail;
use std::path::Path;
use svl::manifest::RunRecord;
use svl::matcher::Algorithm;
use svl::scenario::{PairRange, Scenario, ScenarioSource};
use svl::score::Judge;
use svl::source::dataset::{Scene, SceneSource};
use svl::source::{Limited, RecordingSource, RunSource, run_request};

/// The scenario that is named, or that of the recordings that are.
pub(super) fn scenario(args: &Args) -> anyhow::Result<Scenario> {
    let is_scenario = |what: &str| Path::new(what).extension().is_some_and(|e| e == "toml");
    let mut scenario = match &args.what[..] {
        [name] if name == "arena" => Scenario::arena()?,
        [path] if is_scenario(path) => Scenario::read(Path::new(path))?,
        recordings => {
            if let Some(name) = recordings.iter().find(|name| is_scenario(name)) {
                let cure = "name one scenario, or recordings";
                return Err(usage::wrong(format!("{name}: is a scenario; {cure}")));
            }
            Scenario::of_recordings(recordings, vec!["v5".parse()?])?
        }
    };
    if args.check {
        let ranges = scenario
            .algorithms
            .iter()
            .filter_map(Algorithm::max_disparity);
        let max = ranges.max().unwrap_or(80);
        scenario.algorithms = vec![format!("truth:max_disparity={max}").parse()?];
        scenario.gate.clear();
    }
    if !args.algo.is_empty() {
        let swept = args.algo.iter().map(|sweep| sweep.expand(args.sample));
        scenario.algorithms = swept.collect::<svl::Result<Vec<_>>>()?.concat();
    }
    if !args.scenes.is_empty() {
        let ScenarioSource::Dataset { scenes } = &mut scenario.source else {
            let what = &args.what[0];
            bail!("{what}: does not read scenes; --scenes is for scenarios that do");
        };
        scenes.clone_from(&args.scenes);
        // The page and the scenario's hash identify the scenes.
        let named = args.scenes.join(", ");
        scenario.description.push_str(&format!(
            "\n\nOf other scenes than the scenario's: {named}."
        ));
        scenario.text.push_str(&format!("\n# --scenes {named}\n"));
    }
    let is_recorded = matches!(scenario.source, ScenarioSource::Recording(_));
    if !is_recorded && (args.topics.is_given() || args.rectify.is_given()) {
        let words = "--left, --right, --side-by-side, --fps, --bits, --max-skew-ms, --truth and \
                     --calib are for recordings";
        return Err(usage::wrong(format!("{}: {words}", args.what[0])));
    }
    Ok(scenario)
}

/// A run with its judge.
pub(super) enum ScoredSource {
    Opened(Box<(RunSource, Judge)>),
    /// Of the arena with that seed, recorded when its turn comes: what comes before is on the
    /// screen by then.
    Arena(u64),
}

impl ScoredSource {
    /// The recording of the user's that it reads.
    pub(super) fn record(&self) -> Option<RunRecord> {
        match self {
            Self::Opened(opened) => opened.0.record.clone(),
            Self::Arena(_) => None,
        }
    }

    /// Opens it, recorded first where the cache does not hold it.
    pub(super) fn open(
        self,
        scenario: &Scenario,
        args: &Args,
        quiet: bool,
        table: &LiveTable,
    ) -> anyhow::Result<(RunSource, Judge)> {
        let seed = match self {
            Self::Opened(opened) => return Ok(*opened),
            Self::Arena(seed) => seed,
        };
        let path = recordings::cached_run(scenario, seed, quiet, Some(table))?;
        let source = Limited::new(Box::new(RecordingSource::open(path)?), range(args)?, None);
        let source = args.reference.wrap(Box::new(source))?;
        let mut run = RunSource::new(source, Some(seed));
        let judge = run.judge(&scenario.judge())?;
        Ok((run, judge))
    }
}

fn range(args: &Args) -> anyhow::Result<PairRange> {
    let mut range = PairRange::default();
    args.range.fill(&mut range);
    range.validate().map_err(usage::wrong)?;
    Ok(range)
}

/// The scenario's runs. All that the user names is opened, so that what is wrong with the last one
/// is said before the first is scored.
pub(super) fn runs(
    scenario: &Scenario,
    args: &Args,
    quiet: bool,
) -> anyhow::Result<Vec<ScoredSource>> {
    let range = range(args)?;
    let mut runs = Vec::new();
    match &scenario.source {
        ScenarioSource::Arena { seeds, .. } => {
            return Ok(seeds.iter().copied().map(ScoredSource::Arena).collect());
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
            runs.push(RunSource::new(source, None));
        }
        ScenarioSource::Recording(recorded) => {
            for run in scenario.recordings()? {
                let mut request = run_request(recorded, &run)?;
                args.topics.fill(&mut request);
                args.rectify.fill(&mut request);
                args.range.fill(&mut request.range);
                let mut opened = source::open(request, quiet)?;
                opened.source = args.reference.wrap(opened.source)?;
                runs.push(RunSource::of_recording(&run, opened));
            }
        }
    }
    let judge = scenario.judge();
    let judged = runs.into_iter().map(|mut run| {
        let judge = run.judge(&judge)?;
        Ok(ScoredSource::Opened(Box::new((run, judge))))
    });
    judged.collect()
}
