//! The scenario files of the data sets.

use crate::common::assert_says;
use std::path::Path;
use svl::scenario::{Scenario, ScenarioSource};
use svl::source::dataset::DATASETS;

#[test]
fn every_scenario_is_whole_and_every_data_set_has_one() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios");
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|e| e != "toml") {
            continue;
        }
        let scenario = Scenario::read(&path).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(path.file_stem().unwrap().to_str().unwrap(), scenario.name);
        assert!(
            scenario.text.starts_with("# "),
            "{}: says nothing of what it tests and why",
            scenario.name
        );
        if let ScenarioSource::Dataset { scenes } = &scenario.source
            && DATASETS.iter().any(|d| d.name == scenario.name)
        {
            assert!(
                scenes
                    .iter()
                    .all(|scene| scene.starts_with(&format!("{}/", scenario.name))),
                "{}",
                scenario.name
            );
        }
        names.push(scenario.name);
    }
    for dataset in DATASETS {
        assert!(
            names.iter().any(|name| name == dataset.name),
            "no scenario reads {}",
            dataset.name
        );
    }
}

#[test]
fn data_sets_are_consistent() {
    for dataset in DATASETS {
        assert!(
            dataset.home.starts_with("https://")
                && !dataset.licence.is_empty()
                && !dataset.citation.is_empty()
        );
        let usual = dataset.parts(&[]).unwrap();
        assert!(!usual.is_empty(), "{}", dataset.name);
        for part in dataset.parts {
            assert!(
                part.base.starts_with("https://") && part.base.ends_with('/'),
                "{}",
                part.base
            );
            assert_eq!(
                dataset.parts(&[part.name.to_lowercase()]).unwrap()[0].name,
                part.name
            );
            assert!(!part.files.is_empty() && part.megabytes > 0);
        }
        assert_says(
            &dataset.parts(&["nonsense".into()]).unwrap_err(),
            &["nonsense"],
        );
    }
}
