//! What `svl score` scores: the scenario that is named or meant, and its runs.

use super::Args;
use crate::cli::shared::source::{self, data_folder};
use crate::cli::shared::{recordings, usage};
use anyhow::bail;
use std::path::Path;
use svl::matcher::Algorithm;
use svl::scenario::{PairRange, Scenario, ScenarioSource};
use svl::score::Judge;
use svl::source::dataset::{Scene, SceneSource};
use svl::source::{Limited, RecordingSource, RunSource, Source, run_request};

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

/// The scenario's runs, each with its judge; those of an arena are recorded where the cache does
/// not hold them.
pub(super) fn runs(
    scenario: &Scenario,
    args: &Args,
    quiet: bool,
) -> anyhow::Result<Vec<(RunSource, Judge)>> {
    let mut range = PairRange::default();
    args.range.fill(&mut range);
    range.validate().map_err(usage::wrong)?;
    let of_range = |source: Box<dyn Source>| Limited::new(source, range, None);
    let mut runs = Vec::new();
    match &scenario.source {
        ScenarioSource::Arena { seeds, .. } => {
            for &seed in seeds {
                let path = recordings::cached_run(scenario, seed, quiet)?;
                let source = of_range(Box::new(RecordingSource::open(path)?));
                let source = args.reference.wrap(Box::new(source))?;
                runs.push(RunSource::new(source, Some(seed)));
            }
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
            let source = of_range(Box::new(SceneSource::new(scenes)));
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
        Ok((run, judge))
    });
    judged.collect()
}
