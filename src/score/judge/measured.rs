//! Values with the cases that they rest on: one rule for what is not measured, for metrics, gates
//! and comparisons.

use serde::Serialize;

/// The cases of a metric; `*` in their words is the plural.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CaseKind {
    /// Pairs, frames of a checkpoint, or courses that have a value; metres driven.
    Items(&'static str),
    /// The sum of these metrics, over the cells of the metric's area or of all.
    Sum(&'static [&'static str], &'static str),
    /// Cells with an error of distance, of those that are known and have a finite true distance.
    Errors(&'static str),
    /// Frames that follow another one, with the changes of their cells at rest.
    Changes(&'static str),
}

/// The fewest cases of a value; with fewer it is not measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Minimum {
    /// Number of cases; of changes that of the frames.
    pub cases: u64,
    /// Share of the cells that could have had a value, of metrics that leave some of them out.
    pub share: Option<f64>,
}

impl Minimum {
    pub const ONE: Self = Self {
        cases: 1,
        share: None,
    };
}

/// The cases that a value rests on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Cases {
    /// Pairs, frames or courses with a value; of rates of drives the whole metres driven; 0 where
    /// only cells count.
    pub items: u64,
    /// Cells or obstacles; absent of metrics whose cases are the items.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cells: Option<u64>,
    /// The cells that could have had a value, of metrics that leave some of them out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub possible: Option<u64>,
}

/// A value, and the cases that it rests on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    pub value: f64,
    pub cases: Cases,
}

impl Cases {
    pub fn items(items: u64) -> Self {
        Self {
            items,
            ..Self::default()
        }
    }

    /// The cases of a metric without a value.
    pub fn none() -> Self {
        Self {
            cells: Some(0),
            ..Self::default()
        }
    }

    /// The number that a minimum limits.
    pub(super) fn count(&self, kind: CaseKind) -> u64 {
        match kind {
            CaseKind::Items(_) | CaseKind::Changes(_) => self.items,
            CaseKind::Sum(..) | CaseKind::Errors(_) => self.cells.unwrap_or_default(),
        }
    }
}

/// A number of cases in the words of their kind.
pub(super) fn counted(count: u64, words: &str) -> String {
    format!(
        "{count} {}",
        words.replace('*', if count == 1 { "" } else { "s" })
    )
}
