//! Results of a training, for people.

use super::kinds::{KindCells, ReportedCells, ScoredCell, reliability};
use super::learned_cells::{LearnedScenario, TableRole, TableSamples};
use crate::fit::CellFit;
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::HashSet;
use svl_core::Result;
use svl_core::depth::decision::{VerdictTable, probability};
use svl_report::page::{PlotView, fill};
use svl_report::plot::{Axis, Chart, Series, SeriesStyle};
use svl_report::table::{Table, TableColumn, TerminalStyle};
use svl_report::{ReliabilityBin, reliability_chart};

/// Figures of a fit, per scenario, and the calibration of its probabilities.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CellTraining {
    pub table: TableRole,
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

impl ScenarioCells {
    fn new(scenario: &LearnedScenario, cells: &[ScoredCell<'_>], least_score: i64) -> Self {
        let all = cells.len();
        let groups: HashSet<_> = cells.iter().map(|cell| cell.sample.group).collect();
        let right = cells.iter().filter(|cell| cell.sample.right).count();
        let reportable = cells.iter().filter(|cell| cell.sample.is_reportable());
        let reportable: Vec<_> = reportable.copied().collect();
        Self {
            name: scenario.name.clone(),
            tested: scenario.tested,
            groups: groups.len(),
            cells: all,
            right_of_all: right as f64 / all.max(1) as f64,
            fitted: ReportedCells::new(&reportable, all, |cell| cell.held_out >= least_score),
            present: ReportedCells::new(&reportable, all, |cell| cell.sample.known),
        }
    }
}

impl CellTraining {
    /// Figures of a fit of a table to the first of the samples; the others, of scenarios that are
    /// only tested, were no part of it. `present`: the table in use.
    pub fn new(
        role: TableRole,
        present: &VerdictTable,
        learned: &TableSamples,
        fit: &CellFit,
    ) -> Self {
        let least_score = present.least_score;
        let cells = ScoredCell::all(learned, fit, present);
        let scenarios = cells.chunk_by(|a, b| a.scenario == b.scenario);
        let scenarios = scenarios.map(|own| {
            let scenario = &learned.scenarios[own[0].scenario];
            ScenarioCells::new(scenario, own, least_score)
        });
        let fitted = cells[..fit.held_out.len()].iter();
        let fitted = fitted
            .filter(|cell| cell.sample.is_reportable())
            .map(|cell| (cell.held_out, cell.sample.right));
        Self {
            table: role,
            steps: fit.table.steps.iter().map(|steps| steps.0.len()).sum(),
            confidence: probability(least_score),
            scenarios: scenarios.collect(),
            kinds: KindCells::all(&cells, &learned.scenarios, least_score),
            reliability: reliability(&fitted.collect::<Vec<_>>()),
            losses: fit.losses.clone(),
        }
    }

    /// The page of all tables: one file without scripts, all texts escaped.
    ///
    /// # Errors
    /// [`svl_core::Error::Invalid`] with the error of the template engine or of the plotting
    /// library.
    pub fn page(tables: &[Self], identity: Vec<(String, String)>) -> Result<String> {
        let view = json!({
            "tables": tables.iter().map(Self::view).collect::<Vec<_>>(),
            "images": [],
            "identity": identity,
            "incomplete": null,
        });
        fill(include_str!("cells.html"), "", &[], view)
    }

    fn view(&self) -> Value {
        let bins = vec![("cells".to_owned(), self.reliability.clone())];
        let reliability = reliability_chart(bins).unwrap_or_default();
        let points = self.losses.iter().enumerate();
        let points = points.map(|(steps, loss)| (steps as f64, *loss));
        let losses = Chart::untitled(
            Axis::new("steps"),
            Axis::new("logistic loss, held out"),
            [Series::new("loss", SeriesStyle::Both, points)],
        );
        json!({
            "words": self.table.words(),
            "training": self,
            "scenarios": self.scenario_table(),
            "kinds": KindCells::table(&self.kinds),
            "charts": [
                PlotView::new(
                    "Reliability",
                    "Fraction of right cells by the probability of a table, fitted without their \
                     part of the runs; ranges with 20 cells or more.",
                    reliability.svg(),
                ),
                PlotView::new(
                    "Steps",
                    "Loss on held-out runs by the number of steps.",
                    losses.svg(),
                ),
                KindCells::curves(&self.kinds),
            ],
        })
    }

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
                [
                    bin.cells.to_string(),
                    share(bin.predicted),
                    share(bin.right),
                ],
            );
        }
        format!(
            "{}: {steps} steps; % of cells, known from {confidence:.2} on\n{}\n% of cells known, % \
             of these wrong, calibration error in points, area of the ROC\n{}\n{}",
            self.table.words(),
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
        for scenario in &self.scenarios {
            let cells = [
                scenario.groups.to_string(),
                scenario.cells.to_string(),
                percent(scenario.right_of_all, 1),
                percent(scenario.fitted.right, 1),
                percent(scenario.fitted.wrong, 2),
                percent(scenario.present.right, 1),
                percent(scenario.present.wrong, 2),
            ];
            let tested = if scenario.tested { ", tested" } else { "" };
            table.push(format!("{}{tested}", scenario.name), cells);
        }
        table
    }
}

fn percent(share: f64, digits: usize) -> String {
    format!("{:.digits$}", 100.0 * share)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::CellSample;
    use svl_core::matcher::V5Model;
    use svl_core::stereo::CellEvidence;

    #[test]
    fn tests_of_a_fitted_kind_are_scored_without_it() {
        let present = V5Model::built_in().median;
        let sample = CellSample {
            group: 0,
            evidence: Some(CellEvidence {
                report: 8,
                target: 8,
                features: [0; CellEvidence::FEATURES],
                plain: 0,
            }),
            right: true,
            known: true,
        };
        let base = |base| VerdictTable {
            base,
            ..present.clone()
        };
        let scenario = |(kind, tested): (&str, bool)| LearnedScenario {
            name: kind.to_owned(),
            kind: kind.to_owned(),
            cells: 1,
            tested,
        };
        // Scenarios of the fit come first. The tables without a kind know nothing, the others all.
        let known = |scenarios: &[(&str, bool)], fitted: usize, without: usize| {
            let learned = TableSamples {
                samples: vec![sample; scenarios.len()],
                scenarios: scenarios.iter().copied().map(scenario).collect(),
            };
            let fit = CellFit {
                table: base(90_000),
                held_out: vec![90_000; fitted],
                without_kind: vec![base(-90_000); without],
                losses: Vec::new(),
            };
            let training = CellTraining::new(TableRole::Single, &present, &learned, &fit);
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
