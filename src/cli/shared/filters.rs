//! Filters behind the algorithms of a run.

use super::usage;
use std::path::PathBuf;
use std::sync::Arc;
use svl::filter::{FilterKind, FilterModel};
use svl::scenario::ScenarioFilter;

/// The filters that the user names.
#[derive(Clone, clap::Args)]
pub(crate) struct FilterArgs {
    /// Run the algorithms behind a filter, too
    ///
    /// A file that `svl train filter` wrote. May be given once for floor and once for too-close.
    #[arg(
        long, value_name = "FILE", value_parser = usage::ending(&["safetensors"]),
        help_heading = "Input"
    )]
    filter: Vec<PathBuf>,
}

impl FilterArgs {
    /// Their kinds, with their files.
    pub(crate) fn files(&self, models: &[Arc<FilterModel>]) -> Vec<(FilterKind, PathBuf)> {
        let kinds = models.iter().map(|model| model.kind);
        kinds.zip(self.filter.iter().cloned()).collect()
    }

    /// They, as a scenario has them.
    pub(crate) fn scenario_filters(&self) -> anyhow::Result<Vec<ScenarioFilter>> {
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
