//! Stress in numbers: the results of each algorithm on perturbed pairs, and the level at which it
//! breaks.

use super::drives::{DriveRow, DriveSummary, summarize};
use serde::Serialize;
use std::collections::BTreeMap;
use svl_sim::stress::StressKind;

/// An algorithm on all pairs at one level of a perturbation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StressSummary {
    /// Name of the perturbation.
    pub kind: &'static str,
    /// Level; 0 for the unperturbed pairs.
    pub level: f64,
    pub algorithm: String,
    pub pairs: u64,
    /// Fractions of the cells with truth.
    pub right: Option<f64>,
    pub wrong: Option<f64>,
    /// Fraction of all cells.
    pub known: Option<f64>,
    /// Number of missed obstacles.
    pub missed: Option<f64>,
    /// Fraction of the frames of checkpoints that pass.
    pub checkpoints: Option<f64>,
    /// Collisions per 100 m of drives.
    pub collisions: Option<f64>,
    /// Fraction of the courses that drives finished.
    pub finished: Option<f64>,
    /// Reason why it counts as broken at this level.
    pub broken: Option<String>,
}

/// A number of a perturbed run: its name, its axis, its value.
pub(super) type StressNumber = (
    &'static str,
    &'static str,
    fn(&StressSummary) -> Option<f64>,
);

/// Values that the page draws against the level.
pub(super) const NUMBERS: [StressNumber; 7] = [
    ("Collisions", "per 100 m", |s| s.collisions),
    ("Courses finished", "finished, %", |s| {
        s.finished.map(|v| 100.0 * v)
    }),
    ("Right cells", "right, %", |s| s.right.map(|v| 100.0 * v)),
    ("Wrong cells", "wrong, %", |s| s.wrong.map(|v| 100.0 * v)),
    ("Known cells", "known, %", |s| s.known.map(|v| 100.0 * v)),
    ("Missed obstacles", "missed", |s| s.missed),
    ("Checkpoints", "frames passed, %", |s| {
        s.checkpoints.map(|v| 100.0 * v)
    }),
];

/// An algorithm counts as broken if it keeps less than this fraction of its unperturbed result: of
/// its right cells, or without a truth of its known ones, and of the courses that it finished.
pub(super) const MIN_KEPT: f64 = 0.9;

/// Adds the result of drives with such pairs; `plain`: the result of the unperturbed drives.
pub(super) fn add_drives(stress: &mut [StressSummary], plain: &[DriveSummary], rows: &[DriveRow]) {
    let mut by_level: BTreeMap<String, Vec<DriveSummary>> = BTreeMap::new();
    for s in stress {
        let text = format!("{}={}", s.kind, s.level);
        let drives = match s.level {
            0.0 => plain,
            _ => (by_level.entry(text)).or_insert_with_key(|text| summarize(rows, Some(text))),
        };
        let is_own = |d: &&DriveSummary| d.algorithm == s.algorithm;
        let Some(own) = drives.iter().find(is_own) else {
            continue;
        };
        let finished = own.finished_share();
        let before = plain.iter().find(is_own).map(DriveSummary::finished_share);
        if let Some(before) = before.filter(|before| finished < MIN_KEPT * before) {
            let less = 100.0 * (finished / before - 1.0);
            let fewer = format!("courses finished {less:.0} %");
            let broken = s.broken.take().into_iter().chain([fewer]);
            s.broken = Some(broken.collect::<Vec<_>>().join(", "));
        }
        (s.collisions, s.finished) = (own.collisions_per_100m, Some(finished));
    }
}

/// The kinds, in the order of their first rows.
pub(super) fn kinds(stress: &[StressSummary]) -> Vec<&'static StressKind> {
    let mut kinds: Vec<&'static str> = stress.iter().map(|s| s.kind).collect();
    kinds.dedup();
    let kinds = kinds.iter();
    let kinds = kinds.filter_map(|kind| StressKind::find(kind).ok());
    kinds.collect()
}
