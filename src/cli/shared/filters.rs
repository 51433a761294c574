//! Filters behind the algorithms of a run.

use super::outputs::write;
use super::recordings::RECORDINGS;
use super::usage;
use super::windows::{LabelledRuns, train, windows};
use anyhow::{Context, bail};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use svl::filter::{FilterKind, FilterModel};
use svl::matcher::Algorithm;
use svl::scenario::{Scenario, ScenarioFilter, ScenarioSource};
use svl::source::ArenaSource;
use svl::train::{REVISION, TrainSettings};

/// The filters that the user names.
#[derive(clap::Args)]
pub(crate) struct FilterArgs {
    /// Run the algorithms behind a filter, too, which `svl train filter` wrote; may be given once
    /// for floor and once for too-close
    #[arg(
        long, value_name = "FILE.safetensors", value_parser = usage::ending(&["safetensors"])
    )]
    filter: Vec<PathBuf>,
}

impl FilterArgs {
    /// What they detect, with their files.
    pub(crate) fn files(&self, models: &[Arc<FilterModel>]) -> Vec<(FilterKind, PathBuf)> {
        let kinds = models.iter().map(|model| model.kind);
        kinds.zip(self.filter.iter().cloned()).collect()
    }

    /// They, as a scenario has them.
    pub(crate) fn of_scenario(&self) -> anyhow::Result<Vec<ScenarioFilter>> {
        let files = self.files(&self.models()?).into_iter();
        let filters = files.map(|(detects, file)| ScenarioFilter {
            detects,
            file: Some(file),
            scenario: Vec::new(),
            seeds: None,
        });
        Ok(filters.collect())
    }

    /// Reads them.
    pub(crate) fn models(&self) -> anyhow::Result<Vec<Arc<FilterModel>>> {
        let mut models: Vec<Arc<FilterModel>> = Vec::new();
        for path in &self.filter {
            let model = FilterModel::read(path)?;
            if let Some(other) = models.iter().position(|other| other.kind == model.kind) {
                let (one, two) = (self.filter[other].display(), path.display());
                let words = format!("{one} and {two}: both are of {}; name one", model.kind);
                return Err(usage::wrong(words));
            }
            models.push(Arc::new(model));
        }
        Ok(models)
    }
}

/// The algorithms, each without filters and, where there are some, behind all of them. The truth
/// has nothing to filter.
pub(crate) fn with_filters(
    algorithms: Vec<Algorithm>,
    filters: &[Arc<FilterModel>],
) -> Vec<Algorithm> {
    if filters.is_empty() {
        return algorithms;
    }
    let both = |algorithm: Algorithm| {
        let is_truth = algorithm.spec().name == "truth";
        let filtered = (!is_truth).then(|| algorithm.clone().filtered(filters));
        std::iter::once(algorithm).chain(filtered)
    };
    algorithms.into_iter().flat_map(both).collect()
}

/// The filters of a scenario: read, or trained first where the cache does not hold them.
pub(crate) fn of_scenario(
    scenario: &Scenario,
    quiet: bool,
) -> anyhow::Result<Vec<Arc<FilterModel>>> {
    let of = scenario.filters.iter();
    of.map(|filter| model(filter, scenario, quiet).map(Arc::new))
        .collect()
}

fn model(filter: &ScenarioFilter, scenario: &Scenario, quiet: bool) -> anyhow::Result<FilterModel> {
    let kind = filter.detects;
    if let Some(path) = &filter.file {
        let model = FilterModel::read(path)?;
        if model.kind != kind {
            bail!("{}: detects {}, not {kind}", path.display(), model.kind);
        }
        return Ok(model);
    }
    let training = filter.training(scenario)?;
    let spec = kind.spec();
    let settings = TrainSettings::default_of(kind);
    // Of all that the weights depend on.
    let mut key = format!("{REVISION} {settings:?} {:?}", spec.features);
    for of in &training {
        if let ScenarioSource::Arena { config, seeds } = &of.source {
            key.extend(seeds.iter().map(|seed| ArenaSource::hash(config, *seed)));
        }
    }
    let name = training.first().map_or("filter", |first| &first.name);
    let hash = svl::manifest::hash(&key);
    let path = Path::new(RECORDINGS).join(format!("{name}-{kind}-{hash:.12}.safetensors"));
    if path.exists() {
        return Ok(FilterModel::read(&path)?);
    }
    let runs = training
        .into_iter()
        .map(|training| LabelledRuns::open(training, None, quiet));
    let runs = runs.collect::<anyhow::Result<_>>()?;
    let (mut samples, _) = windows(kind, spec.features, settings.range_px, runs, quiet)?;
    let (model, training) = train(&mut samples, &settings, quiet)?;
    if training.interrupted {
        bail!("interrupted while the filter {kind} was trained");
    }
    // Under another name until it is whole.
    let part = path.with_extension("part");
    write(&part, model.to_bytes())?;
    std::fs::rename(&part, &path).with_context(|| path.display().to_string())?;
    Ok(model)
}
