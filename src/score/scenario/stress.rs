//! A scenario's `[[stress]]`: the perturbations of its pairs, with their levels.

use serde::{Deserialize, Serialize};
use std::str::FromStr;
use svl_core::{Error, Result};
use svl_sim::stress::{Stress, StressKind};

/// A perturbation with its levels, in a scenario or written as `row_offset` and
/// `row_offset=0.5/1/2`.
#[derive(Clone, Debug, PartialEq)]
pub struct StressLevels(Vec<Stress>);

/// Form of a perturbation in a scenario.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StressTable {
    kind: String,
    levels: Option<Vec<f64>>,
}

impl StressLevels {
    /// # Errors
    /// [`Error::Usage`] for an unknown kind, and for levels out of range.
    pub fn new(kind: &str, levels: Option<&[f64]>) -> Result<Self> {
        let kind = StressKind::find(kind)?;
        let levels = levels.unwrap_or(kind.levels);
        let stresses = levels.iter().map(|level| Stress::new(kind, *level));
        let stresses: Vec<_> = stresses.collect::<Result<_>>()?;
        let twice = (1..stresses.len()).find(|&i| stresses[..i].contains(&stresses[i]));
        match twice {
            Some(i) => Err(Error::Usage(format!("stress {}: named twice", stresses[i]))),
            None if stresses.is_empty() => {
                Err(Error::Usage(format!("stress {}: needs a level", kind.name)))
            }
            None => Ok(Self(stresses)),
        }
    }

    /// The perturbation at each of its levels.
    pub fn stresses(&self) -> &[Stress] {
        &self.0
    }

    pub fn kind(&self) -> &'static StressKind {
        // There is at least one level.
        self.0[0].kind()
    }
}

/// Checks that each kind occurs once.
///
/// # Errors
/// [`Error::Usage`] for one that occurs twice.
pub fn distinct_kinds(stress: &[StressLevels]) -> Result<()> {
    let name = |i: usize| stress[i].kind().name;
    match (1..stress.len()).find(|&i| (0..i).any(|j| name(i) == name(j))) {
        Some(i) => Err(Error::Usage(format!(
            "stress {} occurs twice; name all its levels at once",
            name(i)
        ))),
        None => Ok(()),
    }
}

impl StressTable {
    pub(super) fn check(self) -> Result<StressLevels> {
        StressLevels::new(&self.kind, self.levels.as_deref())
    }
}

impl From<&StressLevels> for StressTable {
    fn from(levels: &StressLevels) -> Self {
        Self {
            kind: levels.kind().name.to_owned(),
            levels: Some(levels.stresses().iter().map(Stress::level).collect()),
        }
    }
}

impl FromStr for StressLevels {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let Some((kind, levels)) = text.split_once('=') else {
            return Self::new(text, None);
        };
        let level = |level: &str| {
            let wrong = || Error::Usage(format!("'{text}': expected KIND or KIND=LEVEL/LEVEL/…"));
            level.parse::<f64>().map_err(|_| wrong())
        };
        let levels: Vec<_> = levels.split('/').map(level).collect::<Result<_>>()?;
        Self::new(kind, Some(&levels))
    }
}
