//! Stress in numbers: what each algorithm makes of pairs that are made worse, and at which level it
//! breaks.

use crate::stress::StressKind;
use serde::Serialize;

/// An algorithm on all pairs at one level of a perturbation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StressSummary {
    /// Name of the perturbation.
    pub kind: &'static str,
    /// 0 for the pairs as they are.
    pub level: f64,
    pub algorithm: String,
    pub pairs: u64,
    /// Shares of the cells with truth.
    pub right: Option<f64>,
    pub wrong: Option<f64>,
    /// Share of all cells.
    pub known: Option<f64>,
    /// Missed obstacles per pair.
    pub missed: Option<f64>,
    /// Share of the frames of checkpoints that pass.
    pub checkpoints: Option<f64>,
    /// Why it counts as broken at this level.
    pub broken: Option<String>,
}

/// A number of a perturbed run: its name, its axis, its value.
pub(super) type StressNumber = (
    &'static str,
    &'static str,
    fn(&StressSummary) -> Option<f64>,
);

/// What the page draws against the level.
pub(super) const NUMBERS: [StressNumber; 5] = [
    ("Right cells", "right, %", |s| s.right.map(|v| 100.0 * v)),
    ("Wrong cells", "wrong, %", |s| s.wrong.map(|v| 100.0 * v)),
    ("Known cells", "known, %", |s| s.known.map(|v| 100.0 * v)),
    ("Missed obstacles", "missed per pair", |s| s.missed),
    ("Checkpoints", "frames passed, %", |s| {
        s.checkpoints.map(|v| 100.0 * v)
    }),
];

/// The kinds, as they come first.
pub(super) fn kinds(stress: &[StressSummary]) -> Vec<&'static StressKind> {
    let mut kinds: Vec<&'static str> = stress.iter().map(|s| s.kind).collect();
    kinds.dedup();
    kinds
        .iter()
        .filter_map(|kind| StressKind::find(kind).ok())
        .collect()
}
