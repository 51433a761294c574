//! The summary of a run's rows: of the unperturbed pairs, and of the perturbed ones.

use super::results::Results;
use super::rows::{CheckpointRow, Row};
use super::stress::{MIN_KEPT, StressSummary};
use svl_core::Result;
use svl_score::judge::METRICS;
use svl_sim::stress::{Stress, StressKind};

impl Results {
    /// Sums up the rows of a run; those of perturbed pairs in [`Results::stress`].
    ///
    /// # Errors
    /// The errors of a perturbation that svl does not know.
    pub fn from_rows(rows: &[Row], checkpoints: &[CheckpointRow]) -> Result<Self> {
        let sums = |stress: Option<&str>| {
            let own = rows.iter().filter(|row| row.stress.as_deref() == stress);
            let runs = checkpoints.iter();
            let runs = runs.filter(|row| row.stress.as_deref() == stress);
            Self::from_pairs(&own.collect::<Vec<_>>(), &runs.collect::<Vec<_>>())
        };
        let base = sums(None);
        let stress = stressed(&base, rows, |text| sums(Some(text)))?;
        Ok(Self { stress, ..base })
    }
}

/// Summaries of the perturbed rows, each kind with the unperturbed pairs, `base`, as level 0.
fn stressed(
    base: &Results,
    rows: &[Row],
    sums: impl Fn(&str) -> Results,
) -> Result<Vec<StressSummary>> {
    let mut stresses: Vec<(&str, Stress)> = Vec::new();
    for text in rows.iter().filter_map(|row| row.stress.as_deref()) {
        if !stresses.iter().any(|(known, _)| *known == text) {
            stresses.push((text, text.parse()?));
        }
    }
    let mut summaries = Vec::new();
    for (i, (text, stress)) in stresses.iter().enumerate() {
        let kind = stress.kind();
        if stresses[..i]
            .iter()
            .all(|(_, other)| other.kind().name != kind.name)
        {
            let none = base.algorithms.iter();
            // A map that others computed has no perturbed pairs.
            let is_perturbed = |label: &str| {
                let mut perturbed = rows.iter().filter(|row| row.stress.is_some());
                perturbed.any(|row| row.algorithm == label)
            };
            let none = none.filter(|a| is_perturbed(&a.algorithm));
            summaries.extend(none.map(|a| summary(base, base, &a.algorithm, (kind, 0.0))));
        }
        let level = sums(text);
        let algorithms = level.algorithms.iter();
        let place = (kind, stress.level());
        summaries.extend(algorithms.map(|a| summary(base, &level, &a.algorithm, place)));
    }
    Ok(summaries)
}

/// The checkpoints that are passed `before` and not `now`, in words; `None` without any. Each has
/// its number, and its passed and all frames.
fn lost_checkpoints(before: &[(u32, u64, u64)], now: &[(u32, u64, u64)]) -> Option<String> {
    let is_passed = |all: &[(u32, u64, u64)], number: u32| {
        let found = all.iter().find(|(n, ..)| *n == number);
        found.is_some_and(|(_, passed, frames)| *frames > 0 && 2 * passed >= *frames)
    };
    let numbers = before.iter().map(|(number, ..)| *number);
    let lost = numbers.filter(|number| is_passed(before, *number) && !is_passed(now, *number));
    let lost: Vec<_> = lost.map(|number| number.to_string()).collect();
    let noun = if lost.len() == 1 {
        "checkpoint"
    } else {
        "checkpoints"
    };
    (!lost.is_empty()).then(|| format!("{noun} {}", lost.join(", ")))
}

fn summary(
    base: &Results,
    level: &Results,
    algorithm: &str,
    (kind, at): (&'static StressKind, f64),
) -> StressSummary {
    let value = |summary_of: &Results, name: &str| {
        let metric = METRICS.iter().find(|metric| metric.name == name)?;
        let mut algorithms = summary_of.algorithms.iter();
        let summary = algorithms.find(|a| a.algorithm == algorithm)?;
        summary.value(metric)
    };
    let pairs = level.algorithms.iter().find(|a| a.algorithm == algorithm);
    let pairs = pairs.map_or(0, |a| a.pairs);
    let passed = |summary_of: &Results| {
        let own = summary_of.checkpoints.iter();
        let own = own.filter(|c| c.algorithm == algorithm);
        own.map(|c| (c.checkpoint, c.passed, c.frames))
            .collect::<Vec<_>>()
    };
    let (now, before) = (passed(level), passed(base));
    let frames: u64 = now.iter().map(|(.., frames)| frames).sum();
    let share = |name: &str| Some((value(level, name)?, value(base, name)?));
    let fewer = |what: &str, (now, before): (f64, f64)| {
        (now < MIN_KEPT * before)
            .then(|| format!("{what} cells {:.0} %", 100.0 * (now / before - 1.0)))
    };
    let fewer = match share("right") {
        Some(shares) => fewer("right", shares),
        None => share("known").and_then(|shares| fewer("known", shares)),
    };
    let lost = lost_checkpoints(&before, &now);
    let broken: Vec<_> = lost.into_iter().chain(fewer).collect();
    StressSummary {
        kind: kind.name,
        level: at,
        algorithm: algorithm.to_owned(),
        pairs,
        right: value(level, "right"),
        wrong: value(level, "wrong"),
        known: value(level, "known"),
        missed: value(level, "missed"),
        checkpoints: (frames > 0)
            .then(|| now.iter().map(|(_, passed, _)| passed).sum::<u64>() as f64 / frames as f64),
        collisions: None,
        finished: None,
        broken: (!broken.is_empty()).then(|| broken.join(", ")),
    }
}
