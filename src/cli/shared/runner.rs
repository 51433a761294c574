//! Runs with a progress bar, and what is reported of them.

use super::progress::Progress;
use svl::arena::{Arena, WireObject};
use svl::counted;
use svl::manifest::Manifest;
use svl::run::{Matchers, Outcome, Pace, run};
use svl::scenario::{Scenario, ScenarioSource};
use svl::sink::{Edges, RunInfo, RunStart, Sink};
use svl::source::{AssumeRectified, Source, Watched};
use svl::stereo::Losses;

/// Runs a source through the algorithms, with a progress bar, and warns of what is in no frame.
/// The outcome holds also for a run that failed.
pub(crate) fn run_through(
    source: &mut dyn Source,
    matchers: &mut Matchers,
    start: &RunStart<'_>,
    pace: Pace,
    sinks: &mut [Box<dyn Sink>],
    title: &str,
    quiet: bool,
) -> (Outcome, svl::Result<()>) {
    let mut progress = Progress::new(title, source.pairs(), quiet);
    let mut rectified = AssumeRectified::new(source);
    let mut watched = Watched::new(&mut rectified);
    let ran = run(&mut watched, matchers, start, pace, sinks, &mut progress);
    progress.clear();
    report_losses(&watched.name(), &ran.0.losses);
    ran
}

/// Warns of everything of a source that is in no frame.
pub(crate) fn report_losses(name: &str, losses: &Losses) {
    let warn = |n: u64, what: &str, why: &str| {
        if n > 0 {
            tracing::warn!("{name}: {} dropped: {why}", counted(n, what));
        }
    };
    warn(losses.unreadable, "pair", "cannot be read");
    warn(
        losses.late,
        "image",
        "came too late for a partner, as the file is not in the order of its stamps; `mcap sort \
         FILE -o SORTED.mcap` makes a file with all pairs",
    );
    warn(losses.unpaired, "image", "without a partner");
}

/// What the Rerun recording of a run shows from the beginning.
pub(crate) fn rerun_info(manifest: &Manifest, wireframe: Vec<WireObject>) -> RunInfo {
    RunInfo {
        recording_id: manifest.run_id.clone(),
        scenario: manifest.scenario.clone(),
        algorithms: manifest
            .algorithms
            .iter()
            .map(|a| (a.label.clone(), a.parameters.clone()))
            .collect(),
        wireframe: wireframe
            .into_iter()
            .map(|WireObject { name, strips }| Edges { name, strips })
            .collect(),
    }
}

/// The outlines of the arena's solids and the path of the run with that seed; none for other
/// sources.
pub(crate) fn wireframe(scenario: &Scenario, seed: Option<u64>) -> Vec<WireObject> {
    match &scenario.source {
        ScenarioSource::Arena { config, seeds } => Arena::new(config, seed.unwrap_or(seeds[0]))
            .map(|a| a.wireframe())
            .unwrap_or_default(),
        ScenarioSource::Dataset { .. } => Vec::new(),
    }
}

/// Fails for a run that is not complete.
pub(crate) fn complete(outcome: &Outcome) -> anyhow::Result<()> {
    outcome.missing().map_or(Ok(()), |missing| {
        Err(anyhow::anyhow!("{missing}, as warned; all else is kept"))
    })
}
