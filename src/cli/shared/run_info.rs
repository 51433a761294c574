//! What a run is told at its beginning, and whether it is complete at its end.

use svl::arena::{Arena, Wire};
use svl::manifest::Manifest;
use svl::run::Outcome;
use svl::scenario::{Scenario, ScenarioSource};
use svl::sink::{Edges, Identity, RunInfo};

/// What the Rerun recording of a run is told at its beginning.
pub(crate) fn rerun(manifest: &Manifest, identity: &Identity, wireframe: Vec<Wire>) -> RunInfo {
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
            .map(|Wire { name, strips }| Edges { name, strips })
            .collect(),
        grid: identity.shape,
        rule: identity.rule,
    }
}

/// The outlines of the arena's things and the way of the run with that seed; none for other
/// sources.
pub(crate) fn wireframe(scenario: &Scenario, seed: Option<u64>) -> Vec<Wire> {
    match &scenario.source {
        ScenarioSource::Arena { config, seeds } => Arena::new(config, seed.unwrap_or(seeds[0]))
            .map(|a| a.wireframe())
            .unwrap_or_default(),
        ScenarioSource::Dataset { .. } => Vec::new(),
    }
}

/// Refuses to call a run done that lacks something.
pub(crate) fn complete(outcome: &Outcome) -> anyhow::Result<()> {
    outcome.lacks().map_or(Ok(()), |lacks| {
        Err(anyhow::anyhow!("{lacks}, as warned; all else is kept"))
    })
}
