//! The best algorithm by a metric and why others may not be; the best setting of a sweep.

use crate::rows::held::{RowRef, Rows};
use serde::Serialize;
use std::collections::BTreeMap;
use svl_score::judge::{AreaChoice, Metric};

/// The best of the algorithms that may be, by a metric.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Best {
    pub metric: &'static Metric,
    /// The cells that the metric is of; absent where it is of all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub area: Option<AreaChoice>,
    pub algorithm: String,
    pub value: f64,
    /// The others that may be best, the better first.
    pub others: Vec<Other>,
}

/// An algorithm that is not the best by a metric.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Other {
    pub algorithm: String,
    pub certainty: Certainty,
}

/// Result of the test of an algorithm against the best: that of `svl compare`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Certainty {
    /// It is worse.
    Clear,
    NotToldApart,
    /// Too few blocks of pairs, or too few courses.
    TooFew,
}

/// The mark of the best in tables.
pub(crate) const BEST: &str = "*";
/// The mark of an algorithm that may not be best, and that of one of which too few pairs tell.
pub(crate) const UNFIT: &str = "x";
pub(crate) const FEW_PAIRS: &str = "?";
/// The mark of an algorithm that failed on pairs.
pub(crate) const FAILED: &str = "!";

impl Certainty {
    /// The mark in tables.
    pub(crate) fn mark(self) -> &'static str {
        match self {
            Self::Clear => "",
            Self::NotToldApart => "=",
            Self::TooFew => FEW_PAIRS,
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

/// Why an algorithm may not be best.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Unfit {
    /// The truth and `blind`, at the ends of the scale; a robot that stands, or failed.
    NotCompared,
    /// It answered less than half of the pairs.
    Absent,
    /// A metric is over its limit, per cent, or under it.
    Over(&'static str, u32),
    Under(&'static str, u32),
    /// It is right in less than half of the cells of another one that may be best: one that
    /// answers easy cells alone is wrong in none.
    Easy,
    /// It is not better than the prior.
    BehindPrior,
    /// Too few independent pairs tell it from the prior and from others.
    TooFewPairs,
}

impl Unfit {
    /// The mark in the columns of the metrics that name a best.
    pub(crate) fn mark(self) -> &'static str {
        match self {
            Self::NotCompared => "",
            Self::TooFewPairs => FEW_PAIRS,
            _ => UNFIT,
        }
    }
}

/// The unperturbed rows of each algorithm, in their order.
pub(crate) type RowsByAlgorithm<'a> = BTreeMap<&'a str, Vec<RowRef<'a>>>;

pub(crate) fn by_algorithm(rows: &Rows) -> RowsByAlgorithm<'_> {
    let mut algorithms = RowsByAlgorithm::new();
    for row in rows.iter().filter(|row| row.stress().is_none()) {
        algorithms.entry(row.algorithm()).or_default().push(row);
    }
    algorithms
}

/// The settings of an algorithm, and the one to use.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SweepChoice {
    /// The kind of the algorithm, and the number of its settings.
    pub algorithm: String,
    pub settings: usize,
    /// The metric that chose; absent for right minus wrong cells.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub metric: Option<&'static Metric>,
    /// The best setting of those that may be best; absent with the reason.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub setting: Option<BestSetting>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

/// The best setting over all pairs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BestSetting {
    pub label: String,
    /// The score on the pairs that chose it.
    pub own_score: f64,
    /// The mean of the scores of the halves' choices, each on the half that did not choose it.
    pub score: f64,
    /// Number of settings that are not told apart from it.
    pub alike: usize,
}
