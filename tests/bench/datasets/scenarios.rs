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
            && let Some(dataset) = DATASETS.iter().find(|d| d.name == scenario.name)
        {
            assert_eq!(*scenes, [format!("{}/*", dataset.folder)]);
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
fn the_page_says_where_each_data_set_is_and_which_folder_it_gives() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/data-sets.md");
    let page = std::fs::read_to_string(page).unwrap();
    for dataset in DATASETS {
        let scenes = dataset.scenes.to_string();
        let row = page
            .lines()
            .find(|line| line.starts_with(&format!("| [{}] |", dataset.name)));
        let row = row.unwrap_or_else(|| panic!("no row of {}", dataset.name));
        assert_says(row, &[dataset.licence, dataset.folder, &scenes]);
        assert_says(
            &page,
            &[&format!("\n[{}]: {}\n", dataset.name, dataset.home)],
        );
    }
}
