//! The scenario of a setting that was found.

use std::path::{Path, PathBuf};
use svl_core::Result;
use svl_core::filter::FilterKind;
use svl_score::scenario::{Scenario, ScenarioFilter};

/// The scenario that repeats a run with these algorithms, as a file of `folder`: the contents of
/// `scenario` without its limits, which are for other algorithms. `filters` replace its own.
///
/// # Errors
/// The errors of [`Scenario::to_toml`], and for a label that is not an algorithm.
pub fn scenario_toml(
    scenario: &Scenario,
    algorithms: &[String],
    filters: &[(FilterKind, PathBuf)],
    folder: &Path,
) -> Result<String> {
    let own = filters.iter().map(|(kind, file)| ScenarioFilter {
        detects: *kind,
        file: Some(file.clone()),
        scenario: Vec::new(),
        seeds: None,
    });
    let algorithms = algorithms.iter().map(|text| text.parse());
    let scenario = Scenario {
        algorithms: algorithms.collect::<Result<_>>()?,
        filters: match filters {
            [] => scenario.filters.clone(),
            _ => own.collect(),
        },
        gate: Vec::new(),
        ..scenario.clone()
    };
    scenario.to_toml(folder)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scenario_can_lie_elsewhere_with_its_filters() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
        let scenario = Scenario::read(&folder.join("floor.toml")).unwrap();
        let algorithms = ["v3:max_disparity=64", "v3"].map(str::to_owned);
        let elsewhere = tempfile::tempdir().unwrap();
        let written = |filters: &[(FilterKind, PathBuf)]| {
            let toml = scenario_toml(&scenario, &algorithms, filters, elsewhere.path()).unwrap();
            Scenario::parse(&toml, &elsewhere.path().join("best.toml")).unwrap()
        };
        let moved = written(&[]);
        assert_eq!(moved.labels(), ["v3:max_disparity=64", "v3"]);
        assert_eq!(
            (moved.grid, moved.cells, &moved.source),
            (scenario.grid, scenario.cells, &scenario.source)
        );
        let own = [&moved, &scenario].map(|scenario| {
            scenario.filters[0].training(scenario).unwrap()[0]
                .name
                .clone()
        });
        assert_eq!(own[0], own[1]);
        assert!(moved.gate.is_empty());
        let kind = scenario.filters[0].detects;
        let other = written(&[(kind, "/filters/own.safetensors".into())]);
        let file = other.filters[0].file.as_deref();
        assert!(file.unwrap().ends_with("filters/own.safetensors"));
    }
}
