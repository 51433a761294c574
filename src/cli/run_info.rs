//! What identifies a run, for its rows, its Rerun recording and its report.

use std::time::{SystemTime, UNIX_EPOCH};
use svl::arena::{Arena, Wire};
use svl::matcher::Algorithm;
use svl::scenario::{Scenario, ScenarioSource};
use svl::score::CellRule;
use svl::sink::{Edges, Identity, RunInfo};
use svl::stereo::GridShape;

/// A name for a run that no other run has.
pub(super) fn run_id(scenario: &str) -> String {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    format!("{:012x}", hash(&format!("{scenario} {} {}", now.as_nanos(), std::process::id())) >> 80)
}

fn hash(text: &str) -> u128 {
    xxhash_rust::xxh3::xxh3_128(text.as_bytes())
}

pub(super) fn identity(
    run_id: &str,
    scenario: &str,
    algorithms: &[Algorithm],
    rule: CellRule,
    shape: GridShape,
) -> Identity {
    let parameters = |a: &Algorithm| {
        let hash = hash(&format!("{}:{}", a.spec().name, a.parameters())) as u64;
        (a.label().to_owned(), format!("{hash:016x}"))
    };
    Identity {
        run_id: run_id.to_owned(),
        scenario: scenario.to_owned(),
        seed: None,
        parameters: algorithms.iter().map(parameters).collect(),
        rule,
        shape,
    }
}

/// What the Rerun recording of a run is told at its beginning.
pub(super) fn rerun(identity: &Identity, algorithms: &[Algorithm], wireframe: Vec<Wire>) -> RunInfo {
    let about = |a: &Algorithm| (a.label().to_owned(), a.parameters().to_string());
    RunInfo {
        recording_id: identity.run_id.clone(),
        scenario: identity.scenario.clone(),
        algorithms: algorithms.iter().map(about).collect(),
        wireframe: wireframe.into_iter().map(|Wire { name, strips }| Edges { name, strips }).collect(),
        grid: identity.shape,
        rule: identity.rule,
    }
}

/// The outlines of the arena's things and the way of the run with that seed; none for other sources.
pub(super) fn wireframe(scenario: &Scenario, seed: Option<u64>) -> Vec<Wire> {
    match &scenario.source {
        ScenarioSource::Arena { config, seeds } => {
            Arena::new(config, seed.unwrap_or(seeds[0])).map(|a| a.wireframe()).unwrap_or_default()
        }
        ScenarioSource::Dataset { .. } => Vec::new(),
    }
}

/// Refuses to call a run done in which algorithms failed.
pub(super) fn complete(failures: u64) -> anyhow::Result<()> {
    match failures {
        0 => Ok(()),
        n => anyhow::bail!("algorithms failed on {n} pairs, as warned; all else is kept"),
    }
}

/// The machine and the program, as names and values.
pub(super) fn manifest(run_id: &str, algorithms: &[Algorithm]) -> svl::Result<Vec<(String, String)>> {
    let mut manifest = vec![
        ("run".to_owned(), run_id.to_owned()),
        (
            "svl".to_owned(),
            format!(
                "{} ({})",
                env!("CARGO_PKG_VERSION"),
                option_env!("SVL_GIT_REVISION").unwrap_or("revision unknown")
            ),
        ),
        ("processor".to_owned(), processor()),
        ("instruction set".to_owned(), svl::kernel::isa()?.name().to_owned()),
        ("threads".to_owned(), rayon::current_num_threads().to_string()),
    ];
    manifest.extend(algorithms.iter().map(|a| (a.label().to_owned(), a.parameters().to_string())));
    Ok(manifest)
}

/// The processor's name, or its kind.
pub(super) fn processor() -> String {
    let cpuinfo = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model =
        cpuinfo.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": ").map(|(_, name)| name));
    model.unwrap_or(std::env::consts::ARCH).to_owned()
}
