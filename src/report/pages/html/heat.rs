//! The heat map of a sweep over two parameters.

use super::figures::ReportPage;
use super::shades::{parameter_values, swept, swept_records};
use crate::show::plot::heat::{HeatCell, HeatGrid};
use crate::show::words::number;
use svl_score::judge::{Better, MetricUnit, TruthLevel};

/// The number that algorithms are ranked by, over the values of two parameters, and its caption:
/// that of a page whose sweeps are of one kind of algorithms, over these; none unless they are two.
pub(crate) fn heat_map(page: &ReportPage) -> Option<(HeatGrid, String)> {
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
        let place = [down, across].map(|parameter| record.number(parameter));
        Some((own, place, summary.merit(own)?))
    });
    let merits: Vec<_> = merits.collect();
    let all = || merits.iter().map(|(.., merit)| *merit);
    let (most, worst) = (all().reduce(f64::max)?, all().reduce(f64::min)?);
    let usable = merits.iter().filter(|(own, ..)| summary.may_be_best(own));
    let best = usable.map(|(.., merit)| *merit).reduce(f64::max);
    let [rows, columns] = [down, across].map(|parameter| parameter_values(&records, parameter));
    let (unit, better) = (summary.first_metric()?.unit, summary.first_metric()?.better);
    // The merit of a cost is negative.
    let is_cost = summary.kind() != TruthLevel::Distances && better != Better::More;
    let cell = |y: f64, x: f64| {
        let own = merits.iter().find(|own| own.1 == [Some(y), Some(x)]);
        own.map(|(own, _, merit)| HeatCell {
            label: own.algorithm.clone(),
            text: number(unit, if is_cost { -merit } else { *merit }),
            place: if most > worst {
                (merit - worst) / (most - worst)
            } else {
                1.0
            },
            is_best: best == Some(*merit),
        })
    };
    let percent = if unit == MetricUnit::Share { ", %" } else { "" };
    let row = |y: &f64| {
        (
            y.to_string(),
            columns.iter().map(|x| cell(*y, *x)).collect(),
        )
    };
    let grid = HeatGrid {
        title: format!("{name}: {}{percent}", summary.merit_words()?),
        rows: rows.iter().map(row).collect(),
        columns: columns.iter().map(f64::to_string).collect(),
        down: down.to_owned(),
        across: across.to_owned(),
    };
    let about = format!(
        "Over {down} and {across}. The best usable one is framed; the table has all metrics."
    );
    Some((grid, about))
}
