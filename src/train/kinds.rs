//! Cells of each kind of scenes by a table that was fitted without that kind.

use super::learned_cells::{LearnedScenario, TableSamples};
use crate::fit::filter::RocCurve;
use crate::fit::{CellFit, CellSample};
use serde::Serialize;
use svl_core::depth::decision::{VerdictTable, probability};
use svl_report::page::PlotView;
use svl_report::plot::{Axis, Chart, Series, SeriesStyle};
use svl_report::table::{Table, TableColumn};
use svl_report::{ReliabilityBin, ReliabilityTally};

/// A sample with its scores: log odds, in thousandths.
#[derive(Clone, Copy, Debug)]
pub(super) struct ScoredCell<'a> {
    pub(super) sample: &'a CellSample,
    /// Place of its scenario.
    pub(super) scenario: usize,
    /// By a table fitted without its part of the runs.
    pub(super) held_out: i64,
    /// By a table fitted without its kind, if there is one.
    pub(super) without_kind: Option<i64>,
    /// By the algorithm's table.
    pub(super) present: i64,
}

/// The cells of a kind.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct KindCells {
    pub name: String,
    /// With a truth.
    pub cells: usize,
    /// By a table fitted without the kind; `None` if it is fitted to this kind alone.
    pub held_out: Option<TableFigures>,
    /// By the algorithm's table.
    pub present: TableFigures,
    /// Known fraction of all cells, and fraction of these that is wrong, of the first table.
    pub curve: Vec<(f64, f64)>,
}

/// Fractions of all cells.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ReportedCells {
    pub right: f64,
    pub wrong: f64,
}

/// Figures of a table on one kind.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TableFigures {
    /// Fraction of all cells.
    pub known: f64,
    /// Fraction of the known cells.
    pub wrong: f64,
    /// Mean difference of predicted and observed fraction, over ranges of probability, weighted by
    /// their cells (expected calibration error).
    pub calibration_error: f64,
    /// Area under the ROC curve: probability that of a right and a wrong cell the right one has the
    /// higher probability.
    pub area: f64,
}

/// Points of a curve.
const POINTS: usize = 50;

/// Ends of the ranges of probability.
const ENDS: [f64; 10] = [0.0, 0.2, 0.4, 0.6, 0.75, 0.85, 0.9, 0.95, 0.98, 1.0];

/// Cells, each with its score and true if it is right, by ranges of probability.
pub(super) fn reliability(cells: &[(i64, bool)]) -> Vec<ReliabilityBin> {
    let mut tally = ReliabilityTally::new(&ENDS);
    for &(score, is_right) in cells {
        tally.add(probability(score), is_right);
    }
    tally.bins()
}

impl<'a> ScoredCell<'a> {
    /// The cells of all scenarios, one scenario after the other. `table`: the algorithm's.
    pub(super) fn all(
        learned: &'a TableSamples,
        fit: &CellFit,
        table: &VerdictTable,
    ) -> Vec<ScoredCell<'a>> {
        let kinds = learned.kinds();
        let mut cells = Vec::with_capacity(learned.samples.len());
        for (scenario, own) in learned.scenarios.iter().enumerate() {
            let kind = kinds.iter().position(|kind| *kind == own.kind);
            // Also for a scenario that is only tested: a table that was fitted to other runs of its
            // kind knows it.
            let without_kind = kind.map_or(Some(&fit.table), |kind| fit.without_kind.get(kind));
            let first = cells.len();
            let samples = learned.samples[first..][..own.cells].iter().enumerate();
            cells.extend(samples.map(|(i, sample)| {
                let score =
                    |table: &VerdictTable| table.score(&sample.evidence.unwrap_or_default());
                let held_out = fit.held_out.get(first + i).copied();
                Self {
                    sample,
                    scenario,
                    held_out: held_out.unwrap_or_else(|| score(&fit.table)),
                    without_kind: without_kind.map(score),
                    present: score(table),
                }
            }));
        }
        cells
    }
}

impl KindCells {
    /// The figures of each kind.
    pub(super) fn all(
        cells: &[ScoredCell<'_>],
        scenarios: &[LearnedScenario],
        least_score: i64,
    ) -> Vec<Self> {
        let mut kinds: Vec<(&str, Vec<ScoredCell<'_>>)> = Vec::new();
        for own in cells.chunk_by(|a, b| a.scenario == b.scenario) {
            let name = scenarios[own[0].scenario].kind.as_str();
            match kinds.iter_mut().find(|(kind, _)| *kind == name) {
                Some((_, cells)) => cells.extend(own),
                None => kinds.push((name, own.to_vec())),
            }
        }
        let kinds = kinds.into_iter();
        kinds
            .map(|(name, cells)| Self::new(name, cells, least_score))
            .collect()
    }

    fn new(name: &str, mut ranked: Vec<ScoredCell<'_>>, least_score: i64) -> Self {
        let all = ranked.len();
        ranked.retain(|cell| cell.sample.is_reportable());
        let is_held_out = ranked.iter().all(|cell| cell.without_kind.is_some());
        let without = |cell: &ScoredCell<'_>| cell.without_kind.unwrap_or(i64::MIN);
        let is_known = |cell: &ScoredCell<'_>| without(cell) >= least_score;
        let held_out = is_held_out.then(|| TableFigures::new(&ranked, all, without, is_known));
        let present =
            TableFigures::new(&ranked, all, |cell| cell.present, |cell| cell.sample.known);
        ranked.sort_by_key(|cell| std::cmp::Reverse(without(cell)));
        let wrong_share = |known: usize| {
            let wrong = ranked[..known].iter().filter(|cell| !cell.sample.right);
            wrong.count() as f64 / known.max(1) as f64
        };
        let points = 1..=if is_held_out { POINTS } else { 0 };
        let points = points.map(|point| ranked.len() * point / POINTS);
        let curve = points.map(|known| (known as f64 / all as f64, wrong_share(known)));
        Self {
            name: name.to_owned(),
            cells: all,
            held_out,
            present,
            curve: curve.collect(),
        }
    }

    /// The figures of all kinds.
    pub(super) fn table(kinds: &[Self]) -> Table {
        let mut table = Table::new("Kinds", "kind").with_columns(["cells"]);
        let heads = ["known", "wrong", "error", "area"];
        for group in ["without its kind", "table in use"] {
            let columns = heads.map(|head| TableColumn::new(group, head));
            table.columns.extend(columns);
        }
        let percent = |share: f64| format!("{:.1}", 100.0 * share);
        for kind in kinds {
            let figures = |table_figures: Option<&TableFigures>| {
                let Some(table_figures) = table_figures else {
                    return Default::default();
                };
                [
                    percent(table_figures.known),
                    format!("{:.2}", 100.0 * table_figures.wrong),
                    percent(table_figures.calibration_error),
                    format!("{:.3}", table_figures.area),
                ]
            };
            let cells = std::iter::once(kind.cells.to_string())
                .chain(figures(kind.held_out.as_ref()))
                .chain(figures(Some(&kind.present)));
            table.push(&kind.name, cells);
        }
        table
    }

    /// Wrong against known cells.
    ///
    /// # Errors
    /// [`svl_core::Error::Invalid`] with the error of the plotting library.
    pub(super) fn curves(kinds: &[Self]) -> PlotView {
        let series = kinds.iter().map(|kind| {
            let curve = kind.curve.iter();
            let points = curve.map(|(known, wrong)| (100.0 * known, 100.0 * wrong));
            Series::new(&kind.name, SeriesStyle::Line, points)
        });
        let x = Axis::share("known, % of cells");
        let chart = Chart::untitled(x, Axis::share("wrong, % of known"), series);
        PlotView::new(
            "Wrong against known cells",
            "By a table that was fitted without the kind, at every threshold.",
            chart.svg(),
        )
    }
}

impl ReportedCells {
    /// The known ones of the reportable cells, as fractions of `all`.
    pub(super) fn new(
        reportable: &[ScoredCell<'_>],
        all: usize,
        is_known: impl Fn(&ScoredCell<'_>) -> bool,
    ) -> Self {
        let share = |right: bool| {
            let known = reportable.iter().filter(|cell| is_known(cell));
            let count = known.filter(|cell| cell.sample.right == right).count();
            count as f64 / all.max(1) as f64
        };
        Self {
            right: share(true),
            wrong: share(false),
        }
    }
}

impl TableFigures {
    fn new(
        reportable: &[ScoredCell<'_>],
        all: usize,
        score: impl Fn(&ScoredCell<'_>) -> i64,
        is_known: impl Fn(&ScoredCell<'_>) -> bool,
    ) -> Self {
        let known = reportable.iter().filter(|cell| is_known(cell));
        let wrong = known.clone().filter(|cell| !cell.sample.right).count();
        let known = known.count();
        let scored = reportable.iter();
        let scored: Vec<_> = scored
            .map(|cell| (score(cell), cell.sample.right))
            .collect();
        let errors = reliability(&scored)
            .into_iter()
            .map(|bin| bin.cells as f64 * (bin.predicted - bin.right).abs());
        let ranked = scored.iter().map(|&(score, right)| (score as f32, right));
        Self {
            known: known as f64 / all.max(1) as f64,
            wrong: wrong as f64 / known.max(1) as f64,
            calibration_error: errors.sum::<f64>() / reportable.len().max(1) as f64,
            area: RocCurve::new(&ranked.collect::<Vec<_>>(), 1.0).area,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::stereo::CellEvidence;

    #[test]
    fn figures_are_those_of_each_kind() {
        let sample = |right, known| CellSample {
            group: 0,
            evidence: Some(CellEvidence {
                report: 8,
                target: 8,
                features: [0; CellEvidence::FEATURES],
                plain: 0,
            }),
            right,
            known,
        };
        // The first kind has two scenarios around the second one; its wrong cells score least.
        let samples = [
            sample(true, true),
            sample(false, true),
            sample(false, false),
            sample(true, false),
            sample(true, true),
            sample(false, true),
        ];
        let scores = [3000, -3000, 2000, 1000, 4000, -4000];
        let cells = |scenario: fn(usize) -> usize, is_held_out: bool| -> Vec<_> {
            let cell = |(i, sample)| ScoredCell {
                sample,
                scenario: scenario(i),
                held_out: 2000,
                without_kind: is_held_out.then_some(scores[i]),
                present: 0,
            };
            samples.iter().enumerate().map(cell).collect()
        };
        let scenario = |kind: &str| LearnedScenario {
            name: kind.to_owned(),
            kind: kind.to_owned(),
            cells: 2,
            tested: false,
        };
        let scenarios = ["arena", "worlds", "arena"].map(scenario);
        let kinds = KindCells::all(&cells(|i| i / 2, true), &scenarios, 1735);
        let [arena, worlds] = &kinds[..] else {
            panic!("{kinds:?}");
        };
        assert_eq!((arena.cells, worlds.cells), (4, 2));
        // Two of four are known, both right; the algorithm knows all, half of them wrong.
        let [arena_without, worlds_without] = [arena, worlds].map(|kind| kind.held_out.unwrap());
        assert_eq!((arena_without.known, arena_without.wrong), (0.5, 0.0));
        let present = arena.present;
        assert_eq!(
            (present.known, present.wrong, present.area),
            (1.0, 0.5, 0.5)
        );
        assert_eq!(arena_without.area, 1.0);
        // Predicted 95.3 and 98.2 % of two right ones, 4.7 and 1.8 % of two wrong ones.
        assert!((arena_without.calibration_error - 0.0325).abs() < 1e-3);
        // One half is predicted, and one half right.
        assert_eq!(present.calibration_error, 0.0);
        // The only known one of the other kind is wrong, and ranked above the right one.
        assert_eq!((worlds_without.known, worlds_without.wrong), (0.5, 1.0));
        assert_eq!(worlds_without.area, 0.0);
        assert_eq!(arena.curve.last(), Some(&(1.0, 0.5)));
        // Without a table that was fitted to other kinds there are no such figures.
        let scenario = LearnedScenario {
            cells: 6,
            ..scenarios[0].clone()
        };
        let one = &KindCells::all(&cells(|_| 0, false), &[scenario], 1735)[0];
        assert!(one.held_out.is_none() && one.curve.is_empty());
    }
}
