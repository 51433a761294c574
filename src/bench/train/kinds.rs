//! Cells of each kind of scenes by a table that was fitted without that kind.

use super::learned_cells::LearnedScenario;
use super::reliability::reliability;
use crate::report::page::PlotView;
use crate::report::plot::{Axis, Chart, Series, SeriesStyle};
use crate::report::table::{Table, TableColumn};
use serde::Serialize;
use svl_core::Result;
use svl_core::depth::decision;
use svl_data::fit::CellSample;
use svl_data::fit::filter::RocCurve;

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
    /// Wrong fraction of the known cells if the first table knows as many as the second.
    pub wrong_at_equal: Option<f64>,
    /// Known fraction of all cells, and fraction of these that is wrong, of the first table.
    pub curve: Vec<(f64, f64)>,
    /// Results of cells that are known from some usual probabilities on.
    pub by_confidence: Vec<ConfidenceCells>,
}

/// The cells of a kind that are known from a probability on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ConfidenceCells {
    pub confidence: f64,
    /// By a table fitted without their part of the runs.
    pub without_run: ReportedCells,
    /// By a table fitted without their kind, if there is one.
    pub without_kind: Option<ReportedCells>,
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

/// Probabilities from which cells may be known.
const CONFIDENCES: [f64; 5] = [0.75, 0.8, 0.85, 0.9, 0.95];

impl KindCells {
    /// The figures of each kind. Scores are log odds, in thousandths: by the tables without each
    /// kind, where there is one; by those without each part of the runs; by the algorithm's.
    pub(super) fn all(
        samples: &[CellSample],
        held_out: &[Option<i64>],
        runs_held_out: &[i64],
        present: &[i64],
        least_score: i64,
        scenarios: &[LearnedScenario],
    ) -> Vec<Self> {
        let mut kinds: Vec<(&str, Vec<usize>)> = Vec::new();
        let mut first = 0;
        for scenario in scenarios {
            let range = first..first + scenario.cells;
            first = range.end;
            match kinds.iter_mut().find(|(kind, _)| *kind == scenario.kind) {
                Some((_, cells)) => cells.extend(range),
                None => kinds.push((&scenario.kind, range.collect())),
            }
        }
        let kind = |(name, cells): (&str, Vec<usize>)| {
            let all = cells.len();
            let mut ranked = cells;
            ranked.retain(|&i| samples[i].is_reportable());
            let figures = |scores: &[i64], is_known: &dyn Fn(usize) -> bool| {
                TableFigures::new(samples, &ranked, all, scores, is_known)
            };
            let is_held_out = ranked.iter().all(|&i| held_out[i].is_some());
            let without: Vec<_> = held_out
                .iter()
                .map(|score| score.unwrap_or(i64::MIN))
                .collect();
            let by_held_out =
                is_held_out.then(|| figures(&without, &|i| without[i] >= least_score));
            let by_present = figures(present, &|i| samples[i].known);
            ranked.sort_by_key(|&i| std::cmp::Reverse(without[i]));
            let wrong_of = |known: usize| {
                let wrong = ranked[..known].iter().filter(|&&i| !samples[i].right);
                wrong.count() as f64 / known.max(1) as f64
            };
            let equal = ranked.iter().filter(|&&i| samples[i].known).count();
            let reported = |scores: &[i64], least: i64| {
                let count = |right: bool| {
                    let of = ranked.iter().filter(|&&i| samples[i].right == right);
                    of.filter(|&&i| scores[i] >= least).count() as f64 / all.max(1) as f64
                };
                ReportedCells {
                    right: count(true),
                    wrong: count(false),
                }
            };
            let by_confidence = CONFIDENCES.map(|confidence| {
                let least = decision::least_score(confidence);
                ConfidenceCells {
                    confidence,
                    without_run: reported(runs_held_out, least),
                    without_kind: is_held_out.then(|| reported(&without, least)),
                }
            });
            let points = 1..=if is_held_out { POINTS } else { 0 };
            let points = points.map(|point| ranked.len() * point / POINTS);
            Self {
                name: name.to_owned(),
                cells: all,
                held_out: by_held_out,
                present: by_present,
                wrong_at_equal: is_held_out.then(|| wrong_of(equal)),
                curve: points
                    .map(|known| (known as f64 / all as f64, wrong_of(known)))
                    .collect(),
                by_confidence: by_confidence.into(),
            }
        };
        kinds.into_iter().map(kind).collect()
    }

    /// The figures of all kinds.
    pub(super) fn table(kinds: &[Self]) -> Table {
        let mut table = Table::new("Kinds", "kind").with_columns(["cells"]);
        let heads = ["known", "wrong", "error", "area"];
        for group in ["without its kind", "table in use"] {
            let columns = heads.map(|head| TableColumn::new(group, head));
            table.columns.extend(columns);
        }
        let equal = TableColumn::new("equal known", "wrong");
        table.columns.push(equal);
        let percent = |share: f64| format!("{:.1}", 100.0 * share);
        for kind in kinds {
            let figures = |of: Option<&TableFigures>| {
                let Some(of) = of else {
                    return Default::default();
                };
                [
                    percent(of.known),
                    format!("{:.2}", 100.0 * of.wrong),
                    percent(of.calibration_error),
                    format!("{:.3}", of.area),
                ]
            };
            let equal = kind.wrong_at_equal;
            let equal = equal.map_or_else(String::new, |wrong| format!("{:.2}", 100.0 * wrong));
            let cells = std::iter::once(kind.cells.to_string())
                .chain(figures(kind.held_out.as_ref()))
                .chain(figures(Some(&kind.present)))
                .chain([equal]);
            table.push(&kind.name, cells);
        }
        table
    }

    /// The figures of all kinds by confidence.
    pub(super) fn confidence_table(kinds: &[Self]) -> Table {
        let mut table = Table::new("Confidence", "kind").with_columns(["known from"]);
        let heads = ["right, %", "wrong, %"];
        for group in ["without their runs", "without its kind"] {
            let columns = heads.map(|head| TableColumn::new(group, head));
            table.columns.extend(columns);
        }
        for kind in kinds {
            for of in &kind.by_confidence {
                let percent = |share: f64| format!("{:.2}", 100.0 * share);
                let figures = |of: ReportedCells| [percent(of.right), percent(of.wrong)];
                let cells = std::iter::once(format!("{:.2}", of.confidence))
                    .chain(figures(of.without_run))
                    .chain(of.without_kind.map(figures).unwrap_or_default());
                table.push(&kind.name, cells);
            }
        }
        table
    }

    /// Wrong against known cells.
    ///
    /// # Errors
    /// [`svl_core::Error::Invalid`] with the error of the plotting library.
    pub(super) fn curves(kinds: &[Self]) -> Result<PlotView> {
        let series = kinds.iter().map(|kind| Series {
            name: kind.name.clone(),
            form: SeriesStyle::Line,
            points: (kind.curve.iter())
                .map(|(known, wrong)| (100.0 * known, 100.0 * wrong))
                .collect(),
        });
        let chart = Chart {
            title: String::new(),
            x: Axis::share("known, % of cells"),
            y: Axis::share("wrong, % of known"),
            series: series.collect(),
        };
        Ok(PlotView {
            title: "Wrong against known cells".into(),
            about: "By a table that was fitted without the kind, at every threshold.",
            svg: chart.svg()?,
        })
    }
}

impl TableFigures {
    fn new(
        samples: &[CellSample],
        reportable: &[usize],
        all: usize,
        scores: &[i64],
        is_known: &dyn Fn(usize) -> bool,
    ) -> Self {
        let known = reportable.iter().copied().filter(|&i| is_known(i));
        let (right, wrong): (Vec<_>, Vec<_>) = known.partition(|&i| samples[i].right);
        let known = right.len() + wrong.len();
        let bins = reliability(samples, reportable, scores);
        let errors = bins
            .iter()
            .map(|bin| bin.cells as f64 * (bin.said - bin.right).abs());
        let scored = reportable
            .iter()
            .map(|&i| (scores[i] as f32, samples[i].right));
        Self {
            known: known as f64 / all.max(1) as f64,
            wrong: wrong.len() as f64 / known.max(1) as f64,
            calibration_error: errors.sum::<f64>() / reportable.len().max(1) as f64,
            area: RocCurve::new(&scored.collect::<Vec<_>>(), 1.0).area,
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
        let scores = [3000, -3000, 2000, 1000, 4000, -4000].map(Some);
        let scenario = |kind: &str| LearnedScenario {
            name: kind.to_owned(),
            kind: kind.to_owned(),
            cells: 2,
            tested: false,
        };
        let scenarios = ["arena", "worlds", "arena"].map(scenario);
        let kinds = KindCells::all(&samples, &scores, &[2000; 6], &[0; 6], 1735, &scenarios);
        let [arena, worlds] = &kinds[..] else {
            panic!("{kinds:?}");
        };
        assert_eq!((arena.cells, worlds.cells), (4, 2));
        // Two of four are known, both right; the algorithm knows all, half of them wrong.
        let [arena_without, worlds_without] = [arena, worlds].map(|of| of.held_out.unwrap());
        assert_eq!((arena_without.known, arena_without.wrong), (0.5, 0.0));
        let present = arena.present;
        assert_eq!(
            (present.known, present.wrong, present.area),
            (1.0, 0.5, 0.5)
        );
        assert_eq!((arena.wrong_at_equal, arena_without.area), (Some(0.5), 1.0));
        // Predicted 95.3 and 98.2 % of two right ones, 4.7 and 1.8 % of two wrong ones.
        assert!((arena_without.calibration_error - 0.0325).abs() < 1e-3);
        // One half is predicted, and one half right.
        assert_eq!(present.calibration_error, 0.0);
        // The only known one of the other kind is wrong, and ranked above the right one.
        assert_eq!((worlds_without.known, worlds_without.wrong), (0.5, 1.0));
        assert_eq!(worlds_without.area, 0.0);
        assert_eq!(arena.curve.last(), Some(&(1.0, 0.5)));
        // 2 is 0.88 as log odds: all are known from 0.85 on, and none from 0.9 on.
        let [.., at_85, at_90, _] = &worlds.by_confidence[..] else {
            panic!("{worlds:?}");
        };
        let reported = |of: ReportedCells| (of.right, of.wrong);
        assert_eq!((at_85.confidence, at_90.confidence), (0.85, 0.9));
        assert_eq!(reported(at_85.without_run), (0.5, 0.5));
        assert_eq!(reported(at_90.without_run), (0.0, 0.0));
        assert_eq!(at_85.without_kind.map(reported), Some((0.0, 0.5)));
        // Without a table that was fitted to other kinds there are no such figures.
        let scenario = LearnedScenario {
            cells: 6,
            ..scenarios[0].clone()
        };
        let one = &KindCells::all(&samples, &[None; 6], &[2000; 6], &[0; 6], 1735, &[scenario])[0];
        assert_eq!((one.held_out, one.wrong_at_equal), (None, None));
        assert!(one.curve.is_empty() && one.by_confidence[0].without_kind.is_none());
        assert_eq!(reported(one.by_confidence[0].without_run), (0.5, 0.5));
    }
}
