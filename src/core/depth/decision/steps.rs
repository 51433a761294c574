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

    /// Adds `score` to those of `value` and greater ones.
    pub fn raise_from(&mut self, value: i64, score: i64) {
        let above = value - 1;
        let before = self.score(value);
        let greater = self.0.partition_point(|step| step.0 <= above);
        let first = self.0[..greater].partition_point(|step| step.0 < above);
        self.0.splice(first..greater, [(above, before)]);
        self.0[first..].iter_mut().for_each(|step| step.1 += score);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scores_are_raised_from_a_value_on() {
        for steps in [vec![], vec![(13, 5)], vec![(5, 3), (20, 9)], vec![(12, 1), (13, 2), (14, 4)]] {
            let before = Steps(steps);
            let mut after = before.clone();
            after.raise_from(14, 100);
            after.validate().unwrap();
            for value in 0..30 {
                let raised = if value >= 14 { 100 } else { 0 };
                assert_eq!(after.score(value), before.score(value) + raised, "{before:?}");
            }
        }
    }
}
