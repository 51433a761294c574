//! The filters of a scenario, behind its algorithms.

use super::windows::{LabelledInputs, train, windows};
use super::{REVISION, TrainSettings};
use std::path::Path;
use std::sync::Arc;
use svl_bench::console::Console;
use svl_bench::runs::RECORDINGS;
use svl_bench::source::ArenaSource;
use svl_core::filter::FilterModel;
use svl_core::matcher::Algorithm;
use svl_core::{Error, Result};
use svl_files::outputs::write;
use svl_score::manifest::hash;
use svl_score::scenario::{Scenario, ScenarioFilter, ScenarioSource};

/// The algorithms, each without filters and, where there are some, behind all of them. The truth
/// has nothing to filter.
pub fn with_filters(algorithms: Vec<Algorithm>, filters: &[Arc<FilterModel>]) -> Vec<Algorithm> {
    if filters.is_empty() {
        return algorithms;
    }
    let both = |algorithm: Algorithm| {
        let filtered = (!algorithm.spec().is_truth()).then(|| algorithm.clone().filtered(filters));
        std::iter::once(algorithm).chain(filtered)
    };
    algorithms.into_iter().flat_map(both).collect()
}

/// The filters of a scenario: read, or trained first if the cache does not have them.
#[inline]
pub fn scenario_filters(
    scenario: &Scenario,
    console: &dyn Console,
) -> Result<Vec<Arc<FilterModel>>> {
    let filters = scenario.filters.iter();
    filters
        .map(|filter| model(filter, scenario, console).map(Arc::new))
        .collect()
}

#[inline]
fn model(
    filter: &ScenarioFilter,
    scenario: &Scenario,
    console: &dyn Console,
) -> Result<FilterModel> {
    let kind = filter.detects;
    if let Some(path) = &filter.file {
        let model = FilterModel::read(path)?;
        if model.kind != kind {
            let (path, own) = (path.display(), model.kind);
            return Err(Error::Invalid(format!("{path}: detects {own}, not {kind}")));
        }
        return Ok(model);
    }
    let training = filter.training(scenario)?;
    let spec = kind.spec();
    let settings = TrainSettings::default_of(kind);
    // The key has all that the weights depend on.
    let mut key = format!("{REVISION} {settings:?} {:?}", spec.features);
    for source_scenario in &training {
        if let ScenarioSource::Arena { config, seeds } = &source_scenario.source {
            key.extend(seeds.iter().map(|seed| ArenaSource::hash(config, *seed)));
        }
    }
    let name = training.first().map_or("filter", |first| &first.name);
    let hash = hash(&key);
    let path = Path::new(RECORDINGS).join(format!("{name}-{kind}-{hash:.12}.safetensors"));
    if path.exists() {
        return FilterModel::read(&path);
    }
    let training = training.into_iter();
    let runs = training.map(|training| LabelledInputs::open(training, None, console));
    let runs = runs.collect::<Result<_>>()?;
    let (mut samples, fitted) = windows(kind, settings.range_px, runs, console)?;
    let (model, training) = train(&mut samples, &fitted, &settings, console)?;
    if training.interrupted {
        return Err(Error::Invalid(format!(
            "interrupted while the filter {kind} was trained"
        )));
    }
    // Under another name until the file is complete.
    let part = path.with_extension("part");
    write(&part, model.to_bytes())?;
    std::fs::rename(&part, &path).map_err(|e| Error::io(&path, e))?;
    Ok(model)
}
