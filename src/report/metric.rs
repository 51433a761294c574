//! What a run is measured by: the vocabulary that comparisons and gates share.

use super::summary::AlgorithmSummary;
use serde::{Deserialize, Serialize};

/// A number of an algorithm in a run. Shares are 0..=1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Metric {
    /// Share of the judged cells whose distance is right.
    Right,
    /// Share of the judged cells whose distance is wrong.
    Wrong,
    /// Share of the judged cells that the algorithm left open.
    Unknown,
    /// Cells with an obstacle that was reported far.
    Missed,
    /// Cells without an obstacle that was reported near.
    False,
    /// Share of all pixels with a disparity.
    Coverage,
    /// Share of the visible pixels with truth that have no estimate.
    Invalid,
    /// Share of the estimated visible pixels that are off by more than 1 px.
    Bad1,
    /// As `bad1`, by more than 2 px.
    Bad2,
    /// Share of the frames showing a checkpoint in which it passes.
    Passed,
    /// Median time per pair; only as a ratio, as machines differ.
    Time,
}

/// Which way is better.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Better {
    More,
    Less,
    /// Neither: to say less is not to be wrong.
    Neither,
}

impl Metric {
    /// Those of single pairs, in the order of the tables.
    pub(super) const OF_PAIRS: [Self; 10] = [
        Self::Right,
        Self::Wrong,
        Self::Unknown,
        Self::Missed,
        Self::False,
        Self::Coverage,
        Self::Invalid,
        Self::Bad1,
        Self::Bad2,
        Self::Time,
    ];

    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Right => "right cells",
            Self::Wrong => "wrong cells",
            Self::Unknown => "unknown cells",
            Self::Missed => "missed obstacles",
            Self::False => "false obstacles",
            Self::Coverage => "coverage",
            Self::Invalid => "invalid pixels",
            Self::Bad1 => "pixels off > 1 px",
            Self::Bad2 => "pixels off > 2 px",
            Self::Passed => "frames passed",
            Self::Time => "median time",
        }
    }

    /// Whether it is a share, which is shown in percent.
    pub(super) fn is_share(self) -> bool {
        !matches!(self, Self::Missed | Self::False | Self::Time)
    }

    pub(super) fn better(self) -> Better {
        match self {
            Self::Right | Self::Passed => Better::More,
            Self::Unknown | Self::Coverage | Self::Invalid => Better::Neither,
            Self::Wrong | Self::Missed | Self::False | Self::Bad1 | Self::Bad2 | Self::Time => {
                Better::Less
            }
        }
    }

    /// A value as it is shown: a share in percent, a time as a multiple.
    pub(super) fn show(self, value: f64) -> String {
        match self {
            Self::Missed | Self::False => format!("{value:.0}"),
            Self::Time => format!("{value:.2}x"),
            _ => format!("{:.1} %", 100.0 * value),
        }
    }

    /// Its value in a summary, for a time in milliseconds; nothing where the run does not measure
    /// it.
    pub(super) fn of(self, summary: &AlgorithmSummary) -> Option<f64> {
        let of_cells = |count: Option<u64>| match (count?, summary.cells()?) {
            (_, 0) => None,
            (count, cells) => Some(count as f64 / cells as f64),
        };
        match self {
            Self::Right => of_cells(summary.cells_right),
            Self::Wrong => of_cells(summary.cells_wrong),
            Self::Unknown => of_cells(summary.cells_unknown),
            Self::Missed => summary.missed_obstacles.map(|n| n as f64),
            Self::False => summary.false_obstacles.map(|n| n as f64),
            Self::Coverage => Some(summary.coverage),
            Self::Invalid => summary.invalid,
            Self::Bad1 => summary.bad1,
            Self::Bad2 => summary.bad2,
            Self::Passed => None,
            Self::Time => Some(summary.p50_ms),
        }
    }
}
