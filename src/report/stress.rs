//! Stress in numbers: what each algorithm makes of pairs that are made worse, and at which level it
//! breaks.

use super::rows::{CheckpointRow, Row};
use super::side_table::SideTable;
use super::summary::Summary;
use super::words::{NONE, percent};
use crate::error::Result;
use crate::score::METRICS;
use crate::stress::{Stress, StressKind};
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

/// Below this share of its right cells, or where there is no truth of its known ones, an algorithm
/// counts as broken.
const KEPT: f64 = 0.9;

/// Summaries of the perturbed rows, each kind with the unperturbed pairs as level 0.
pub(super) fn summarize(rows: &[Row], checkpoints: &[CheckpointRow]) -> Result<Vec<StressSummary>> {
    let mut stresses: Vec<(&str, Stress)> = Vec::new();
    for text in rows.iter().filter_map(|row| row.stress.as_deref()) {
        if !stresses.iter().any(|(known, _)| *known == text) {
            stresses.push((text, text.parse()?));
        }
    }
    if stresses.is_empty() {
        return Ok(Vec::new());
    }
    let of = |stress: Option<&str>| {
        let rows = rows.iter().filter(|row| row.stress.as_deref() == stress);
        let of_checkpoints = checkpoints.iter();
        let of_checkpoints = of_checkpoints.filter(|row| row.stress.as_deref() == stress);
        Summary::from_frames_of(
            &rows.cloned().collect::<Vec<_>>(),
            &of_checkpoints.cloned().collect::<Vec<_>>(),
        )
    };
    let base = of(None)?;
    let mut summaries = Vec::new();
    for (i, (text, stress)) in stresses.iter().enumerate() {
        let kind = stress.kind();
        if stresses[..i]
            .iter()
            .all(|(_, other)| other.kind().name != kind.name)
        {
            let none = base.algorithms.iter();
            summaries.extend(none.map(|a| summary(&base, &base, &a.algorithm, (kind, 0.0))));
        }
        let level = of(Some(text))?;
        let algorithms = level.algorithms.iter();
        let place = (kind, stress.level());
        summaries.extend(algorithms.map(|a| summary(&base, &level, &a.algorithm, place)));
    }
    Ok(summaries)
}

fn summary(
    base: &Summary,
    level: &Summary,
    algorithm: &str,
    (kind, at): (&'static StressKind, f64),
) -> StressSummary {
    let value = |of: &Summary, name: &str| {
        let metric = METRICS.iter().find(|metric| metric.name == name)?;
        let summary = of.algorithms.iter().find(|a| a.algorithm == algorithm)?;
        summary.value(metric)
    };
    let pairs = level.algorithms.iter().find(|a| a.algorithm == algorithm);
    let pairs = pairs.map_or(0, |a| a.pairs);
    let passed = |of: &Summary| {
        let own = of.checkpoints.iter().filter(|c| c.algorithm == algorithm);
        own.map(|c| (c.checkpoint, c.passed, c.frames))
            .collect::<Vec<_>>()
    };
    let (now, before) = (passed(level), passed(base));
    let frames: u64 = now.iter().map(|(.., frames)| frames).sum();
    let passes = |passed: u64, frames: u64| frames > 0 && 2 * passed >= frames;
    let is_lost = |number: u32| {
        let of = |all: &[(u32, u64, u64)]| {
            let found = all.iter().find(|(n, ..)| *n == number);
            found.is_some_and(|(_, passed, frames)| passes(*passed, *frames))
        };
        of(&before) && !of(&now)
    };
    let lost: Vec<_> = before.iter().filter(|(n, ..)| is_lost(*n)).collect();
    let lost: Vec<_> = lost.iter().map(|(n, ..)| n.to_string()).collect();
    let share = |name: &str| Some((value(level, name)?, value(base, name)?));
    let fewer = |what: &str, (now, before): (f64, f64)| {
        (now < KEPT * before).then(|| format!("{what} cells {:.0} %", 100.0 * (now / before - 1.0)))
    };
    let fewer = match share("right") {
        Some(shares) => fewer("right", shares),
        None => share("known").and_then(|shares| fewer("known", shares)),
    };
    let noun = if lost.len() == 1 {
        "checkpoint"
    } else {
        "checkpoints"
    };
    let lost = (!lost.is_empty()).then(|| format!("{noun} {}", lost.join(", ")));
    let broken: Vec<_> = lost.into_iter().chain(fewer).collect();
    StressSummary {
        kind: kind.name,
        level: at,
        algorithm: algorithm.to_owned(),
        pairs,
        right: value(level, "right"),
        wrong: value(level, "wrong"),
        known: value(level, "known"),
        missed: value(level, "missed").map(|missed| missed / pairs.max(1) as f64),
        checkpoints: (frames > 0)
            .then(|| now.iter().map(|(_, passed, _)| passed).sum::<u64>() as f64 / frames as f64),
        broken: (!broken.is_empty()).then(|| broken.join(", ")),
    }
}

/// The kinds, as they come first.
pub(super) fn kinds(stress: &[StressSummary]) -> Vec<&'static StressKind> {
    let mut kinds: Vec<&'static str> = stress.iter().map(|s| s.kind).collect();
    kinds.dedup();
    kinds
        .iter()
        .filter_map(|kind| StressKind::find(kind).ok())
        .collect()
}

/// A table per kind: right cells against the level, and where each algorithm breaks.
pub(super) fn tables(stress: &[StressSummary]) -> Vec<SideTable> {
    let mut tables: Vec<_> = kinds(stress)
        .into_iter()
        .map(|kind| table(kind, stress))
        .collect();
    if let Some(last) = tables.last_mut() {
        let words = "the least level at which a checkpoint that passed in half of its frames does \
                     not any more, or a tenth of the right cells is lost (without truth: of the \
                     known ones)";
        last.notes.push(("breaks at", words.to_owned()));
    }
    tables
}

fn table(kind: &'static StressKind, stress: &[StressSummary]) -> SideTable {
    let own: Vec<_> = stress.iter().filter(|s| s.kind == kind.name).collect();
    let mut levels: Vec<f64> = own.iter().map(|s| s.level).collect();
    levels.sort_by(f64::total_cmp);
    levels.dedup();
    let mut algorithms: Vec<&str> = Vec::new();
    for s in &own {
        if !algorithms.contains(&s.algorithm.as_str()) {
            algorithms.push(&s.algorithm);
        }
    }
    let has_truth = own.iter().any(|s| s.right.is_some());
    let line = |algorithm: &str| {
        let at = |level: f64| {
            own.iter()
                .find(|s| s.algorithm == algorithm && s.level == level)
        };
        let share = |s: &&&StressSummary| if has_truth { s.right } else { s.known };
        let cells = levels
            .iter()
            .map(|level| percent(at(*level).as_ref().and_then(share)));
        // By size: a perturbation to either side breaks at its smallest.
        let mut by_size = levels.clone();
        by_size.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
        let breaks = by_size.iter().filter_map(|level| at(*level));
        let breaks = breaks
            .map(|s| Some((s.level, s.broken.as_ref()?)))
            .find_map(|found| found);
        let breaks = match breaks {
            Some((level, why)) => format!("{level}: {why}"),
            None => NONE.to_owned(),
        };
        (algorithm.to_owned(), cells.chain([breaks]).collect())
    };
    let what = if has_truth { "right" } else { "known" };
    let heads = levels.iter().map(|level| match level {
        0.0 => "as it is".to_owned(),
        level => level.to_string(),
    });
    let words = format!(
        "{}; numbers: {what} cells, %, by level, {}: {}",
        kind.summary, kind.unit, kind.formula
    );
    SideTable {
        title: format!("Stress: {}, {}", kind.name, kind.unit),
        first: "algorithm",
        heads: heads.chain(["breaks at".to_owned()]).collect(),
        lines: algorithms.into_iter().map(line).collect(),
        notes: vec![(kind.name, words)],
    }
}
