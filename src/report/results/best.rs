//! The best algorithm by a metric, and how sure that is; the best setting of a sweep.

use serde::Serialize;
use svl_score::judge::{AreaChoice, Metric};

/// The best of the usable algorithms by a metric.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Best {
    pub metric: &'static Metric,
    /// The cells that the metric is of; absent where it is of all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub area: Option<AreaChoice>,
    pub algorithm: String,
    pub value: f64,
    /// The other usable algorithms with a value, the better first.
    pub others: Vec<Other>,
}

/// An algorithm that is not the best by a metric.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Other {
    pub algorithm: String,
    pub certainty: Certainty,
}

/// Result of the paired interval of the difference from the best (95 %, the block bootstrap of
/// `svl compare`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Certainty {
    /// The interval excludes 0.
    Clear,
    /// The interval contains 0.
    NotToldApart,
    /// Too few blocks of pairs, or too few courses, for an interval.
    TooFew,
    /// It failed on pairs, or its time is not believable.
    NotComparable,
}

/// The mark of the best in tables.
pub(crate) const BEST: &str = "*";

impl Certainty {
    /// The mark in tables.
    fn mark(self) -> &'static str {
        match self {
            Self::Clear => "",
            Self::NotToldApart => "=",
            Self::TooFew => "?",
            Self::NotComparable => "!",
        }
    }
}

impl Best {
    /// The mark of an algorithm in the column of the metric.
    pub(crate) fn mark(&self, label: &str) -> &'static str {
        let other = self.others.iter().find(|other| other.algorithm == label);
        match other {
            _ if label == self.algorithm => BEST,
            Some(other) => other.certainty.mark(),
            None => "",
        }
    }
}

/// The setting of a swept algorithm to use.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SweepChoice {
    /// The kind of the algorithm, and the number of its settings.
    pub algorithm: String,
    pub settings: usize,
    /// The metric that chose; absent for right minus wrong cells.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub metric: Option<&'static Metric>,
    /// Label of the best setting over all pairs, and its score on them, which chose it.
    pub setting: String,
    pub own_score: f64,
    /// The best settings over every other block, and over the others.
    pub halves: [String; 2],
    /// The mean of the scores of these, each on the blocks that did not choose it.
    pub score: f64,
}

/// The test of algorithms against the prior.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PriorTest {
    /// There is no prior.
    #[default]
    None,
    /// `Results::behind_prior` has those that do not beat it.
    Tested,
    /// Too few blocks of pairs for an interval.
    TooFewPairs,
    /// The prior is right nearly everywhere, so it is no test.
    Still,
}
