//! `[[filter]]`: a filter behind the scenario's algorithms, from a file or trained first.

use super::{Scenario, ScenarioSource, SeedList};
use crate::error::{Error, Result};
use crate::filter::FilterKind;
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// A filter of a scenario. Its algorithms are run without filters and behind all of them.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScenarioFilter {
    #[serde(deserialize_with = "kind")]
    pub detects: FilterKind,
    /// A trained filter, relative to the scenario's folder.
    pub file: Option<PathBuf>,
    /// A scenario of the arena to train it on first, likewise.
    pub scenario: Option<PathBuf>,
    /// Seeds in place of that scenario's.
    pub seeds: Option<SeedList>,
}

fn kind<'de, D: serde::Deserializer<'de>>(text: D) -> std::result::Result<FilterKind, D::Error> {
    let name = String::deserialize(text)?;
    name.parse().map_err(serde::de::Error::custom)
}

impl ScenarioFilter {
    /// Checks it on its own, and takes its paths from the scenario's folder.
    pub(super) fn check(mut self, folder: &Path) -> Result<Self> {
        let wrong = |what: &str| Err(Error::Invalid(format!("filter {}: {what}", self.detects)));
        match (&self.file, &self.scenario, &self.seeds) {
            (Some(_), Some(_), _) | (None, None, _) => {
                return wrong("takes either file or scenario");
            }
            (Some(_), None, Some(_)) => return wrong("seeds belong to a training scenario"),
            _ => {}
        }
        for path in [&mut self.file, &mut self.scenario].into_iter().flatten() {
            *path = folder.join(&*path);
        }
        Ok(self)
    }

    /// The training scenario, with the seeds to train on.
    ///
    /// # Errors
    /// Those of [`Scenario::read`]; [`Error::Format`] for one that is not of the arena, or has a
    /// seed that `scored` is scored on.
    pub fn training(&self, scored: &Scenario) -> Result<Option<Scenario>> {
        let Some(path) = &self.scenario else {
            return Ok(None);
        };
        let mut training = Scenario::read(path)?;
        let wrong = |what: String| Err(Error::format(path, what));
        let ScenarioSource::Arena { seeds, .. } = &mut training.source else {
            return wrong("is not of the arena, which alone labels windows by truth".into());
        };
        if let Some(given) = &self.seeds {
            *seeds = given.seeds().to_vec();
        }
        if let ScenarioSource::Arena { seeds: scored, .. } = &scored.source
            && let Some(seed) = seeds.iter().find(|seed| scored.contains(seed))
        {
            return wrong(format!(
                "filter {}: seed {seed} would be trained on and scored; take others",
                self.detects
            ));
        }
        Ok(Some(training))
    }
}
