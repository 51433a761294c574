//! The heat map of a sweep over two parameters.

use super::ReportPage;
use super::shades::{parameter_value, parameter_values, swept, swept_records};
use crate::page::PlotView;
use crate::plot::{HeatCell, HeatGrid};
use crate::words::number;
use serde::Serialize;
use svl_core::Result;
use svl_score::judge::{Better, MetricUnit, TruthLevel};

/// The number that algorithms are ranked by, over the values of two parameters.
#[derive(Serialize)]
pub(super) struct HeatMap {
    #[serde(flatten)]
    grid: HeatGrid,
    about: String,
}

impl HeatMap {
    /// That of a page whose sweeps are of one kind of algorithms, over these parameters; none
    /// unless they are two.
    pub(super) fn new(page: &ReportPage) -> Option<Self> {
        let [down, across] = swept(page)[..] else {
            return None;
        };
        let name = &page.sweeps.first()?.algorithm;
        if page.sweeps.iter().any(|sweep| sweep.algorithm != *name) {
            return None;
        }
        let records = swept_records(page, name);
        let summary = &page.summary;
        let merits = records.iter().filter_map(|record| {
            let mut algorithms = summary.algorithms.iter();
            let own = algorithms.find(|a| a.algorithm == record.label)?;
            let place = [down, across].map(|parameter| parameter_value(record, parameter));
            Some((record.label.as_str(), place, summary.merit(own)?))
        });
        let merits: Vec<_> = merits.collect();
        let merit = |(_, _, merit): &(&str, [Option<f64>; 2], f64)| *merit;
        let most = merits.iter().map(merit).reduce(f64::max)?;
        let is_usable = |own: &&(&str, [Option<f64>; 2], f64)| {
            let mut algorithms = summary.algorithms.iter();
            algorithms.any(|a| a.algorithm == own.0 && summary.is_usable(a))
        };
        let best = merits.iter().filter(is_usable).map(merit).reduce(f64::max);
        let worst = merits.iter().map(merit).reduce(f64::min)?;
        let (rows, columns) = (
            parameter_values(&records, down),
            parameter_values(&records, across),
        );
        let (unit, better) = (summary.first_metric()?.unit, summary.first_metric()?.better);
        // The merit of a cost is negative.
        let is_cost = summary.kind() != TruthLevel::Distances && better != Better::More;
        let cell = |y: f64, x: f64| {
            let mut own = merits.iter().filter(|own| own.1 == [Some(y), Some(x)]);
            let (label, _, merit) = *own.next()?;
            Some(HeatCell {
                label: label.to_owned(),
                text: number(unit, if is_cost { -merit } else { merit }),
                place: if most > worst {
                    (merit - worst) / (most - worst)
                } else {
                    1.0
                },
                is_best: best == Some(merit),
            })
        };
        let percent = if unit == MetricUnit::Share { ", %" } else { "" };
        let words = summary.merit_words()?;
        let row = |y: &f64| {
            let cells = columns.iter().map(|x| cell(*y, *x)).collect();
            (y.to_string(), cells)
        };
        Some(Self {
            grid: HeatGrid {
                title: format!("{name}: {words}{percent}"),
                rows: rows.iter().map(row).collect(),
                columns: columns.iter().map(f64::to_string).collect(),
                down: down.to_owned(),
                across: across.to_owned(),
            },
            about: format!(
                "Over {down} and {across}. The best usable one is framed; the table has all \
                 metrics."
            ),
        })
    }

    /// The same as a plot.
    pub(super) fn plot(&self) -> Result<PlotView> {
        Ok(PlotView {
            title: self.grid.title.clone().into(),
            about: "",
            svg: self.grid.svg()?,
        })
    }
}
