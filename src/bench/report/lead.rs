//! Leads: which algorithm is best by a metric, and how surely it is better than the second.

use serde::Serialize;
use svl_data::score::Metric;

/// The best algorithm by a metric.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Lead {
    pub metric: &'static Metric,
    pub algorithm: String,
    pub value: f64,
    /// An algorithm that may not be called best is better by it.
    pub is_outdone: bool,
    /// Absent where no other algorithm has a value.
    pub second: Option<RunnerUp>,
}

/// The second best.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunnerUp {
    pub algorithm: String,
    pub value: f64,
    pub certainty: Certainty,
}

/// Result of the paired interval of a difference (95 %, the block bootstrap of `svl compare`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Certainty {
    /// It does not contain 0.
    Clear,
    /// It contains 0.
    NoDifference,
    /// Too few blocks of pairs for an interval.
    TooFewPairs,
    /// Too few courses for an interval.
    TooFewCourses,
}

impl Certainty {
    /// The words behind the second's value; empty where the difference is clear.
    pub(super) fn words(self) -> &'static str {
        match self {
            Self::Clear => "",
            Self::NoDifference => "no difference",
            Self::TooFewPairs => "too few pairs to tell",
            Self::TooFewCourses => "too few courses to tell",
        }
    }
}
