//! Scores of log odds by steps.

use serde::{Deserialize, Serialize};

/// Scores by a value: that of the last step which the value exceeds, else 0.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Steps(pub Vec<(i64, i64)>);

/// Greatest number in a table.
pub(super) const MAX_NUMBER: i64 = 1_000_000_000;

impl Steps {
    pub fn score(&self, value: i64) -> i64 {
        let reached = self.0.iter().rev().find(|(above, _)| value > *above);
        reached.map_or(0, |(_, score)| *score)
    }

    /// # Errors
    /// The fault, in words: values that do not rise, or numbers that are too large.
    pub(super) fn validate(&self) -> Result<(), String> {
        if !self.0.is_sorted_by(|a, b| a.0 < b.0) {
            return Err("its values do not rise".to_owned());
        }
        let is_large = |number: i64| number.unsigned_abs() > MAX_NUMBER.unsigned_abs();
        match self
            .0
            .iter()
            .any(|(above, score)| is_large(*above) || is_large(*score))
        {
            true => Err(format!("a number is beyond {MAX_NUMBER}")),
            false => Ok(()),
        }
    }
}
