//! Scores of log odds by steps.

use serde::{Deserialize, Serialize};
use std::ops::RangeInclusive;

/// Scores by a value: that of the last step which the value exceeds, else 0.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Steps(pub Vec<(i64, i64)>);

/// Greatest number in a table.
pub(super) const MAX_NUMBER: i64 = 1_000_000_000;

/// Fault in the text of a [`super::VerdictTable`], in one line.
#[derive(Debug, thiserror::Error)]
pub enum TableFault {
    #[error(transparent)]
    Json(#[from] serde_json::Error),
    #[error("{0} is {1}, outside {2:?}")]
    Range(&'static str, i64, RangeInclusive<i64>),
    /// The rank of a table for another decision, and that of this one.
    #[error("rank is {0}, expected {1}")]
    Rank(i64, i64),
    #[error("time.least_score is beyond {MAX_NUMBER}")]
    LeastScore,
    /// The others have the key of the steps.
    #[error("{0}: its values do not rise")]
    Values(String),
    #[error("{0}: a number is beyond {MAX_NUMBER}")]
    Number(String),
    #[error("{0}: its scores must begin at 0 and never {1}")]
    Scores(&'static str, &'static str),
}

impl Steps {
    pub fn score(&self, value: i64) -> i64 {
        let reached = self.0.iter().rev().find(|(above, _)| value > *above);
        reached.map_or(0, |(_, score)| *score)
    }

    /// # Errors
    /// Values that do not rise, or numbers that are too large; `key` is that of the steps.
    pub(super) fn validate(&self, key: &str) -> Result<(), TableFault> {
        if !self.0.is_sorted_by(|a, b| a.0 < b.0) {
            return Err(TableFault::Values(key.to_owned()));
        }
        let mut numbers = self.0.iter().flat_map(|(above, score)| [above, score]);
        if numbers.any(|number| number.unsigned_abs() > MAX_NUMBER.unsigned_abs()) {
            return Err(TableFault::Number(key.to_owned()));
        }
        Ok(())
    }
}
