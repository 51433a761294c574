//! Leads: the best algorithm by a metric, and the significance of its lead over the second.

use serde::Serialize;
use svl_score::judge::{AreaChoice, Metric};

/// The best algorithm by a metric.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Lead {
    pub metric: &'static Metric,
    /// The cells that the metric is of; absent where it is of all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub area: Option<AreaChoice>,
    pub algorithm: String,
    pub value: f64,
    /// True if an algorithm that may not be called best is better by this metric.
    pub is_outdone: bool,
    /// True if an algorithm that misses as few as the second is left out, as it finds few near
    /// obstacles: unknown ones are not missed, either.
    pub is_of_seeing: bool,
    /// The second best; absent if no other algorithm has a value.
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
    /// The interval excludes 0.
    Clear,
    /// The interval contains 0.
    NoDifference,
    /// Too few blocks of pairs for an interval.
    TooFewPairs,
    /// Too few courses for an interval.
    TooFewCourses,
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

impl Certainty {
    /// The words after the second's value; empty if the difference is clear.
    pub(super) fn words(self) -> &'static str {
        match self {
            Self::Clear => "",
            Self::NoDifference => "no difference",
            Self::TooFewPairs => "too few pairs to tell",
            Self::TooFewCourses => "too few courses to tell, run more seeds",
        }
    }
}
