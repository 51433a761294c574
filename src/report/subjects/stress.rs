//! Stress in numbers: the results of each algorithm on perturbed pairs, and their table.

use crate::show::table::model::{Table, TableCell, TableColumn};
use crate::show::words::{NONE, number};
use serde::Serialize;
use std::collections::BTreeMap;
use svl_score::judge::{Measured, Metric, MetricUnit};
use svl_sim::stress::StressKind;

/// An algorithm on all pairs, or all courses, at one level of a perturbation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StressSummary {
    /// Name of the perturbation.
    pub kind: &'static str,
    /// Level; 0 for the unperturbed pairs.
    pub level: f64,
    pub algorithm: String,
    /// Pairs with a result.
    pub pairs: u64,
    /// The numbers that tell what breaks, by the names of their metrics; `missed` is a fraction of
    /// the near obstacles.
    #[serde(flatten)]
    pub values: BTreeMap<&'static str, f64>,
    /// Reason why it counts as broken at this level.
    pub broken: Option<String>,
    /// Reason why that is not known.
    pub untold: Option<&'static str>,
}

/// A number of perturbed pairs, or of drives with them.
pub(crate) struct StressNumber {
    /// The metric.
    pub(crate) name: &'static str,
    pub(crate) words: &'static str,
    pub(crate) unit: MetricUnit,
    /// The least loss that breaks an algorithm, if it has one.
    pub(crate) loss: Option<Loss>,
}

/// A loss; only one that is no chance counts, too.
pub(crate) enum Loss {
    By(f64),
    /// A fraction of the unperturbed number.
    Part(f64),
}

/// The numbers that tables and plots show, in the order in which reasons name them.
pub(crate) const NUMBERS: [StressNumber; 13] = {
    use MetricUnit::{Per100M, Share};
    const fn number(
        name: &'static str,
        words: &'static str,
        unit: MetricUnit,
        loss: Option<Loss>,
    ) -> StressNumber {
        StressNumber {
            name,
            words,
            unit,
            loss,
        }
    }
    [
        number("missed", "missed near", Share, Some(Loss::By(0.05))),
        number("found", "found near", Share, Some(Loss::By(0.1))),
        number("wrong", "wrong", Share, Some(Loss::By(0.05))),
        number("right", "right", Share, Some(Loss::Part(0.1))),
        number("passed", "frames passed", Share, None),
        number("same", "same", Share, Some(Loss::By(1.0 - MIN_SAME))),
        number("changed", "changed", Share, None),
        number("gone", "gone", Share, None),
        number("phantoms", "phantoms", Share, None),
        number("collisions", "collisions", Per100M, Some(Loss::By(0.0))),
        number("finished", "finished", Share, Some(Loss::By(0.0))),
        number("near_misses", "near misses", Per100M, Some(Loss::By(0.0))),
        number("late", "late", Share, None),
    ]
};

/// Without a truth an algorithm breaks below this fraction of the cells that it knows unperturbed.
pub(crate) const MIN_SAME: f64 = 0.9;

impl StressNumber {
    /// The heading above its columns, and the label of its axis: its name and its unit.
    pub(crate) fn heading(&self) -> String {
        let unit = self.unit.name().unwrap_or_default();
        format!("{}, {unit}", self.words)
    }

    /// The value of a level as a plot shows it.
    pub(crate) fn plotted(&self, summary: &StressSummary) -> Option<f64> {
        let value = *summary.values.get(self.name)?;
        Some(match self.unit {
            MetricUnit::Share => 100.0 * value,
            _ => value,
        })
    }

    /// A measured value: a count as a fraction of its cases.
    pub(crate) fn value(&self, metric: &Metric, own: Measured) -> Option<f64> {
        let cells = own.cases.cells.unwrap_or(1).max(1) as f64;
        let value = metric.value_of(own)?;
        let is_count = metric.unit == MetricUnit::Count;
        Some(if is_count { value / cells } else { value })
    }
}

/// The kinds, in the order of their first rows.
pub(crate) fn kinds(stress: &[StressSummary]) -> Vec<&'static StressKind> {
    let mut kinds: Vec<&'static str> = stress.iter().map(|s| s.kind).collect();
    kinds.dedup();
    let kinds = kinds.iter();
    let kinds = kinds.filter_map(|kind| StressKind::find(kind).ok());
    kinds.collect()
}

pub(crate) fn stress_table(kind: &'static StressKind, stress: &[StressSummary]) -> Table {
    let own: Vec<_> = stress.iter().filter(|s| s.kind == kind.name).collect();
    let mut levels: Vec<f64> = own.iter().map(|s| s.level).collect();
    levels.sort_by(f64::total_cmp);
    levels.dedup();
    let title = format!("Stress: {}, {}", kind.name, kind.unit);
    let mut table = Table::new(title, "algorithm").with_texts(["breaks at"]);
    let mut algorithms: Vec<&str> = own.iter().map(|s| s.algorithm.as_str()).collect();
    algorithms.sort_by_key(|label| own.iter().position(|s| s.algorithm == *label));
    algorithms.dedup();
    for label in &algorithms {
        let mut levels = own
            .iter()
            .filter(|s| s.algorithm == *label)
            .collect::<Vec<_>>();
        // By magnitude: an algorithm breaks at the smallest level that it fails, to either side.
        levels.sort_by(|a, b| a.level.abs().total_cmp(&b.level.abs()));
        let breaks = levels
            .iter()
            .find_map(|s| Some(format!("{}: {}", s.level, s.broken.as_ref()?)));
        let untold = || {
            levels
                .iter()
                .find_map(|s| s.untold)
                .unwrap_or(NONE)
                .to_owned()
        };
        table.push(*label, [breaks.unwrap_or_else(untold)]);
    }
    let columns = NUMBERS
        .iter()
        .flat_map(|own| levels.iter().map(move |level| (own, *level)));
    for (entry, level) in columns {
        let value = |label: &str| {
            let mut own = own.iter().filter(|s| s.algorithm == label);
            own.find(|s| s.level == level)?
                .values
                .get(entry.name)
                .copied()
        };
        let values: Vec<_> = algorithms.iter().map(|label| value(label)).collect();
        if values.iter().all(Option::is_none) {
            continue;
        }
        let head = if level == 0.0 {
            "none".to_owned()
        } else {
            level.to_string()
        };
        table.columns.push(TableColumn::new(entry.heading(), head));
        for (row, value) in table.rows.iter_mut().zip(values) {
            let text = value.map(|value| number(entry.unit, value));
            row.push(TableCell::Text(text.unwrap_or_else(|| NONE.to_owned())));
        }
    }
    let (summary, unit, formula) = (kind.summary, kind.unit, kind.formula);
    table.note(kind.name, format!("{summary}; level, {unit}: {formula}"));
    table
}
