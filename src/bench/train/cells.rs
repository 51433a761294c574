//! Results of a training, for people.

use super::kinds::{KindCells, ReportedCells};
use super::learned_cells::{LearnedCells, LearnedScenario};
use super::reliability::{ReliabilityBin, reliability};
use crate::report::page::{PlotView, fill};
use crate::report::plot::{Axis, Chart, Series, SeriesStyle};
use crate::report::table::{Table, TableColumn, TerminalStyle};
use serde::Serialize;
use std::collections::HashSet;
use svl_core::Result;
use svl_core::depth::decision::{SafeChoice, VerdictTable, probability};
use svl_core::matcher::Algorithm;
use svl_data::fit::{CellFit, CellSample};

/// Figures of a fit, per scenario, and the calibration of its probabilities.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CellTraining {
    pub algorithm: String,
    pub steps: usize,
    /// Least probability of a cell that counts as known.
    pub confidence: f64,
    pub scenarios: Vec<ScenarioCells>,
    /// Results of kinds of scenes, each held out of the fit.
    pub kinds: Vec<KindCells>,
    /// Results of cells whose fold was held out of the fit.
    pub reliability: Vec<ReliabilityBin>,
    /// Mean logistic loss of held-out cells by the number of steps.
    pub losses: Vec<f64>,
}

/// The cells of a scenario.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ScenarioCells {
    pub name: String,
    /// True if it was no part of the fit.
    pub tested: bool,
    /// Runs and scenes.
    pub groups: usize,
    /// With a truth.
    pub cells: usize,
    /// Fraction that would be right if all cells were reported.
    pub right_of_all: f64,
    /// By the fitted table, held out.
    pub fitted: ReportedCells,
    /// By the algorithm's table.
    pub present: ReportedCells,
}

impl CellTraining {
    /// Figures of a fit of the table of `algorithm` to the first of the samples; the others, of
    /// scenarios that are only tested, were no part of it. `choice`: the algorithm's decision.
    pub fn new(
        algorithm: &Algorithm,
        choice: &SafeChoice,
        learned: &LearnedCells,
        fit: &CellFit,
    ) -> Self {
        let LearnedCells {
            samples, scenarios, ..
        } = learned;
        let table = &choice.table;
        let least_score = table.least_score;
        let score = |table: &VerdictTable, sample: &CellSample| {
            table.score(&sample.evidence.unwrap_or_default())
        };
        let tested = samples[fit.held_out.len()..].iter();
        let tested: Vec<_> = tested.map(|sample| score(&fit.table, sample)).collect();
        let scores = [fit.held_out.as_slice(), &tested].concat();
        let fitted = learned.kinds();
        // Also of what is only tested: a table that was fitted to other runs of its kind knows it.
        let mut by_kind = Vec::with_capacity(samples.len());
        for scenario in scenarios {
            let kind = fitted.iter().position(|kind| *kind == scenario.kind);
            let table = kind.map_or(Some(&fit.table), |kind| fit.without_kind.get(kind));
            let own = &samples[by_kind.len()..][..scenario.cells];
            by_kind.extend(own.iter().map(|of| table.map(|table| score(table, of))));
        }
        let present: Vec<_> = samples.iter().map(|sample| score(table, sample)).collect();
        let mut first = 0;
        let scenario = |of: &LearnedScenario| {
            let range = first..first + of.cells;
            first = range.end;
            let own = &samples[range.clone()];
            let share = |count: usize| count as f64 / of.cells.max(1) as f64;
            let reported = |is_known: &dyn Fn(usize) -> bool| {
                let known = range
                    .clone()
                    .filter(|&i| samples[i].is_reportable() && is_known(i));
                let (right, wrong): (Vec<_>, Vec<_>) = known.partition(|&i| samples[i].right);
                ReportedCells {
                    right: share(right.len()),
                    wrong: share(wrong.len()),
                }
            };
            let groups: HashSet<_> = own.iter().map(|sample| sample.group).collect();
            ScenarioCells {
                name: of.name.clone(),
                tested: of.tested,
                groups: groups.len(),
                cells: of.cells,
                right_of_all: share(own.iter().filter(|sample| sample.right).count()),
                fitted: reported(&|i| scores[i] >= least_score),
                present: reported(&|i| samples[i].known),
            }
        };
        let reportable: Vec<_> = (0..fit.held_out.len())
            .filter(|&i| samples[i].is_reportable())
            .collect();
        Self {
            algorithm: algorithm.label().to_owned(),
            steps: fit.table.steps.iter().map(|steps| steps.0.len()).sum(),
            confidence: probability(least_score),
            scenarios: scenarios.iter().map(scenario).collect(),
            kinds: KindCells::all(samples, &by_kind, &scores, &present, least_score, scenarios),
            reliability: reliability(samples, &reportable, &scores),
            losses: fit.losses.clone(),
        }
    }

    /// The page: one file without scripts, all texts escaped.
    ///
    /// # Errors
    /// [`svl_core::Error::Invalid`] with the error of the template engine or of the plotting
    /// library.
    pub fn page(&self, identity: Vec<(String, String)>) -> Result<String> {
        let line = |name: &str, form, points| Series {
            name: name.to_owned(),
            form,
            points,
        };
        let bins = self.reliability.iter().filter(|bin| bin.cells >= 20);
        let points = bins.map(|bin| (100.0 * bin.said, 100.0 * bin.right));
        let whole = |label: &str| Axis {
            range: Some((0.0, 100.0)),
            ..Axis::share(label)
        };
        let reliability = Chart {
            title: String::new(),
            x: whole("predicted, %"),
            y: whole("observed right, %"),
            series: vec![
                line("cells", SeriesStyle::Both, points.collect()),
                line(
                    "as predicted",
                    SeriesStyle::Line,
                    vec![(0.0, 0.0), (100.0, 100.0)],
                ),
            ],
        };
        let points = self.losses.iter().enumerate();
        let points = points.map(|(steps, loss)| (steps as f64, *loss)).collect();
        let losses = Chart {
            title: String::new(),
            x: Axis::new("steps"),
            y: Axis::new("logistic loss, held out"),
            series: vec![line("loss", SeriesStyle::Both, points)],
        };
        let view = TrainingView {
            training: self,
            scenarios: self.scenario_table(),
            kinds: KindCells::table(&self.kinds),
            confidences: KindCells::confidence_table(&self.kinds),
            charts: [
                PlotView {
                    title: "Reliability".into(),
                    about: "Fraction of right cells by the probability of a table, fitted without \
                            their part of the runs; ranges with 20 cells or more.",
                    svg: reliability.svg()?,
                },
                PlotView {
                    title: "Steps".into(),
                    about: "Loss on held-out runs by the number of steps.",
                    svg: losses.svg()?,
                },
                KindCells::curves(&self.kinds)?,
            ],
            images: [],
            identity,
            incomplete: None,
        };
        fill(include_str!("cells.html"), "", view)
    }
}

impl CellTraining {
    /// The cells of each scenario and the calibration of their probabilities.
    pub fn terminal(&self, style: TerminalStyle) -> String {
        let (steps, confidence) = (self.steps, self.confidence);
        let mut bins =
            Table::new("", "predicted, %").with_columns(["cells", "mean, %", "right, %"]);
        for bin in &self.reliability {
            let share = |share| match bin.cells {
                0 => String::new(),
                _ => percent(share, 1),
            };
            let range = format!("{} to {}", percent(bin.from, 0), percent(bin.to, 0));
            bins.push(
                range,
                [bin.cells.to_string(), share(bin.said), share(bin.right)],
            );
        }
        format!(
            "{steps} steps; % of cells, known from {confidence:.2} on\n{}\n% of cells known, % of \
             these wrong, calibration error in points, area of the ROC\n{}\n{}",
            self.scenario_table().terminal(style),
            KindCells::table(&self.kinds).terminal(style),
            bins.terminal(style)
        )
    }

    fn scenario_table(&self) -> Table {
        let mut table = Table::new("Cells", "scenario").with_columns(["runs", "cells"]);
        let shares = [
            ("all reported", "right, %"),
            ("fitted, held out", "right, %"),
            ("fitted, held out", "wrong, %"),
            ("table in use", "right, %"),
            ("table in use", "wrong, %"),
        ];
        let shares = shares.map(|(group, head)| TableColumn::new(group, head));
        table.columns.extend(shares);
        for of in &self.scenarios {
            let cells = [
                of.groups.to_string(),
                of.cells.to_string(),
                percent(of.right_of_all, 1),
                percent(of.fitted.right, 1),
                percent(of.fitted.wrong, 2),
                percent(of.present.right, 1),
                percent(of.present.wrong, 2),
            ];
            let tested = if of.tested { ", tested" } else { "" };
            table.push(format!("{}{tested}", of.name), cells);
        }
        table
    }
}

fn percent(share: f64, digits: usize) -> String {
    format!("{:.digits$}", 100.0 * share)
}

#[derive(Serialize)]
struct TrainingView<'a> {
    training: &'a CellTraining,
    scenarios: Table,
    kinds: Table,
    confidences: Table,
    charts: [PlotView; 3],
    images: [(); 0],
    identity: Vec<(String, String)>,
    incomplete: Option<String>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::stereo::CellEvidence;

    #[test]
    fn tests_of_a_fitted_kind_are_scored_without_it() {
        let algorithm: Algorithm = "v5".parse().unwrap();
        let choice = algorithm.safe_choice().unwrap().unwrap();
        let sample = CellSample {
            group: 0,
            evidence: Some(CellEvidence {
                report: 8,
                target: 8,
                features: [0; CellEvidence::FEATURES],
            }),
            right: true,
            known: true,
        };
        let base = |base| VerdictTable {
            base,
            ..choice.table.clone()
        };
        let scenario = |(kind, tested): (&str, bool)| LearnedScenario {
            name: kind.to_owned(),
            kind: kind.to_owned(),
            cells: 1,
            tested,
        };
        // Scenarios of the fit come first. The tables without a kind know nothing, the others all.
        let known = |scenarios: &[(&str, bool)], fitted: usize, without: usize| {
            let mut learned = LearnedCells::default();
            learned.samples = vec![sample; scenarios.len()];
            learned.scenarios = scenarios.iter().copied().map(scenario).collect();
            let fit = CellFit {
                table: base(90_000),
                held_out: vec![90_000; fitted],
                without_kind: vec![base(-90_000); without],
                losses: Vec::new(),
            };
            let training = CellTraining::new(&algorithm, &choice, &learned, &fit);
            let kinds = training.kinds.iter();
            let known = kinds.map(|kind| kind.held_out.map(|figures| figures.known));
            known.collect::<Vec<_>>()
        };
        let two = [
            ("arena", false),
            ("worlds", false),
            ("worlds", true),
            ("own", true),
        ];
        assert_eq!(known(&two, 2, 2), [Some(0.0), Some(0.0), Some(1.0)]);
        // One kind alone is never held out.
        let one = [("worlds", false), ("worlds", true), ("own", true)];
        assert_eq!(known(&one, 1, 0), [None, Some(1.0)]);
    }
}
