//! `[[filter]]`: a filter after the scenario's algorithms, from a file or trained first.

use super::{Scenario, ScenarioSource, SeedList, SourceOptions};
use serde::{Deserialize, Serialize, Serializer};
use std::path::{Path, PathBuf};
use svl_core::filter::FilterKind;
use svl_core::{Error, Result};

/// A filter of a scenario. Its algorithms are run without filters and with all of them.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScenarioFilter {
    #[serde(serialize_with = "name", deserialize_with = "kind")]
    pub detects: FilterKind,
    /// A trained filter, relative to the scenario's folder.
    pub file: Option<PathBuf>,
    /// Scenarios of the arena to train it on first, also relative to it.
    #[serde(
        default,
        deserialize_with = "one_or_more",
        skip_serializing_if = "Vec::is_empty"
    )]
    pub scenario: Vec<PathBuf>,
    /// Seeds instead of those of the scenarios.
    pub seeds: Option<SeedList>,
}

fn name<S: Serializer>(kind: &FilterKind, to: S) -> std::result::Result<S::Ok, S::Error> {
    to.serialize_str(kind.name())
}

fn kind<'de, D: serde::Deserializer<'de>>(text: D) -> std::result::Result<FilterKind, D::Error> {
    let name = String::deserialize(text)?;
    name.parse().map_err(serde::de::Error::custom)
}

/// A path, or a list of paths.
fn one_or_more<'de, D: serde::Deserializer<'de>>(
    value: D,
) -> std::result::Result<Vec<PathBuf>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged, expecting = "expected a scenario, or a list of some")]
    enum Paths {
        One(PathBuf),
        More(Vec<PathBuf>),
    }
    Ok(match Paths::deserialize(value)? {
        Paths::One(path) => vec![path],
        Paths::More(paths) => paths,
    })
}

impl ScenarioFilter {
    /// Checks it alone, and resolves its paths relative to the scenario's folder.
    pub(super) fn check(mut self, folder: &Path) -> Result<Self> {
        let wrong = |what: &str| Err(Error::Invalid(format!("filter {}: {what}", self.detects)));
        match (&self.file, &self.scenario[..], &self.seeds) {
            (Some(_), [_, ..], _) | (None, [], _) => {
                return wrong("needs either file or scenario");
            }
            (Some(_), [], Some(_)) => return wrong("seeds belong to a training scenario"),
            _ => {}
        }
        for path in self.file.iter_mut().chain(&mut self.scenario) {
            *path = folder.join(&*path);
        }
        Ok(self)
    }

    /// The training scenarios, with the seeds to train on.
    ///
    /// # Errors
    /// The errors of [`Scenario::read`]; [`Error::Format`] for one that does not use the arena, or
    /// shares a seed with `scored`.
    #[inline]
    pub fn training(&self, scored: &Scenario) -> Result<Vec<Scenario>> {
        let training = self.scenario.iter().map(|path| {
            let mut training = Scenario::read(path)?;
            let wrong = |what: String| Err(Error::format(path, what));
            if self.seeds.is_some() {
                training = training.with(&SourceOptions {
                    seeds: self.seeds.clone(),
                    ..SourceOptions::default()
                })?;
            }
            let ScenarioSource::Arena { seeds, .. } = &training.source else {
                return wrong(
                    "does not use the arena, the only source that labels windows by truth".into(),
                );
            };
            if let ScenarioSource::Arena { seeds: scored, .. } = &scored.source
                && let Some(seed) = seeds.iter().find(|seed| scored.contains(seed))
            {
                return wrong(format!(
                    "filter {}: seed {seed} would be trained on and scored; use others",
                    self.detects
                ));
            }
            Ok(training)
        });
        training.collect()
    }
}
