//! The plots of the page.

use super::super::plot::{Axis, Bars, Chart, Series, SeriesStyle, Strips};
use super::super::stress::{NUMBERS, kinds};
use super::super::summary::AlgorithmSummary;
use super::{ParameterSweep, ReportPage};
use serde::Serialize;
use svl_core::Result;
use svl_data::stress::StressKind;

#[derive(Serialize)]
pub(super) struct PlotView {
    title: &'static str,
    about: &'static str,
    svg: String,
}

/// A place of an algorithm in a plot, where it has one.
type PlotPoint = fn(&AlgorithmSummary) -> Option<(f64, f64)>;

/// A number of every algorithm.
type PlotNumber = fn(&AlgorithmSummary) -> Option<f64>;

fn percent(share: f64) -> f64 {
    100.0 * share
}

/// Share of wrong cells among the known ones, percent; absent where none is known.
fn wrong_of_known(a: &AlgorithmSummary) -> Option<f64> {
    let (right, wrong) = (a.totals.get("right")?, a.totals.get("wrong")?);
    (right + wrong > 0.0).then(|| percent(wrong / (right + wrong)))
}

/// Share of known cells among those with truth, percent.
fn known(a: &AlgorithmSummary) -> Option<f64> {
    let [right, wrong, unknown] = ["right", "wrong", "unknown"].map(|name| a.totals.get(name));
    let known = right? + wrong?;
    let cells = known + unknown?;
    (cells > 0.0).then(|| percent(known / cells))
}

/// Accuracy against speed: cells, and pixels.
pub(super) fn accuracy(page: &ReportPage) -> Result<Vec<PlotView>> {
    let time = || Axis {
        log: true,
        ..Axis::new("median ms per pair")
    };
    let cells: PlotPoint = |a| Some((a.p50_ms?, wrong_of_known(a)?));
    let pixels: PlotPoint = |a| Some((a.p50_ms?, percent(a.totals.get("bad2")?)));
    let about = "Better is farther left and lower.";
    let plots = [
        (
            "Wrong cells against time",
            cells,
            Axis::share("wrong, of the known cells, %"),
        ),
        (
            "Wrong pixels against time",
            pixels,
            Axis::share("off by > 2 px, of the estimates, %"),
        ),
    ];
    let plots = plots
        .into_iter()
        .map(|(title, place, y)| scatter(page, title, about, place, time(), y));
    Ok(plots
        .collect::<Result<Vec<_>>>()?
        .into_iter()
        .flatten()
        .collect())
}

/// Each number over the levels of a perturbation: a plot per number.
pub(super) fn stress(page: &ReportPage) -> Result<Vec<StressView>> {
    let all = &page.summary.stress;
    let view = |kind: &'static StressKind| {
        let own: Vec<_> = all.iter().filter(|s| s.kind == kind.name).collect();
        let mut algorithms: Vec<&str> = own.iter().map(|s| s.algorithm.as_str()).collect();
        algorithms.sort_by_key(|name| own.iter().position(|s| s.algorithm == *name));
        algorithms.dedup();
        let plots = NUMBERS.iter().filter_map(|(title, axis, number)| {
            let series: Vec<_> = algorithms
                .iter()
                .map(|algorithm| {
                    let points = own.iter().filter(|s| s.algorithm == *algorithm);
                    let mut points: Vec<_> =
                        points.filter_map(|s| Some((s.level, number(s)?))).collect();
                    points.sort_by(|a, b| a.0.total_cmp(&b.0));
                    Series {
                        name: (*algorithm).to_owned(),
                        form: SeriesStyle::Both,
                        points,
                    }
                })
                .filter(|series| !series.points.is_empty())
                .collect();
            let chart = Chart {
                title: (*title).to_owned(),
                x: Axis::new(format!("{}, {}", kind.name, kind.unit)),
                y: Axis::new(*axis),
                series,
            };
            (!chart.series.is_empty()).then(|| {
                Ok(PlotView {
                    title,
                    about: "",
                    svg: chart.svg()?,
                })
            })
        });
        Ok(StressView {
            name: kind.name,
            about: kind.summary,
            plots: plots.collect::<Result<_>>()?,
        })
    };
    kinds(all).into_iter().map(view).collect()
}

/// A perturbation on the page.
#[derive(Serialize)]
pub(super) struct StressView {
    name: &'static str,
    about: &'static str,
    plots: Vec<PlotView>,
}

/// Coverage against error: cells, and pixels.
pub(super) fn coverage(page: &ReportPage) -> Result<Vec<PlotView>> {
    let cells: PlotPoint = |a| Some((known(a)?, wrong_of_known(a)?));
    let pixels: PlotPoint = |a| {
        Some((
            percent(1.0 - a.totals.get("invalid")?),
            percent(a.totals.get("bad2")?),
        ))
    };
    let about = "Better is farther right and lower.";
    let plots = [
        (
            "Wrong cells against known ones",
            cells,
            "known, of the cells, %",
            "wrong, of the known cells, %",
        ),
        (
            "Wrong pixels against coverage",
            pixels,
            "estimated, of the visible pixels, %",
            "off by > 2 px, of the estimates, %",
        ),
    ];
    let plots = plots.into_iter().map(|(title, place, x, y)| {
        scatter(page, title, about, place, Axis::share(x), Axis::share(y))
    });
    Ok(plots
        .collect::<Result<Vec<_>>>()?
        .into_iter()
        .flatten()
        .collect())
}

/// The algorithms as points, those of a sweep joined; absent where no algorithm has both numbers.
fn scatter(
    page: &ReportPage,
    title: &'static str,
    about: &'static str,
    place: PlotPoint,
    x: Axis,
    y: Axis,
) -> Result<Option<PlotView>> {
    let of = |label: &str| {
        page.summary
            .algorithms
            .iter()
            .find(|a| a.algorithm == label)
            .and_then(place)
    };
    let swept = |label: &str| {
        page.sweeps
            .iter()
            .any(|sweep| sweep.points.iter().any(|(_, of)| of == label))
    };
    let one = |name: &str, form, point| Series {
        name: name.to_owned(),
        form,
        points: vec![point],
    };
    let alone = page
        .summary
        .algorithms
        .iter()
        .filter(|a| !swept(&a.algorithm));
    let mut series: Vec<_> = alone
        .filter_map(|a| Some(one(&a.algorithm, SeriesStyle::Named, place(a)?)))
        .collect();
    if page.sweeps.len() > MAX_LINES {
        series.extend(clouds(page, place));
    }
    let lines = page
        .sweeps
        .iter()
        .filter(|_| page.sweeps.len() <= MAX_LINES);
    for ParameterSweep { name, points } in lines {
        let places: Vec<_> = points
            .iter()
            .filter_map(|(value, label)| Some((value, label, of(label)?)))
            .collect();
        let line = places.iter().map(|(.., point)| *point).collect();
        series.push(Series {
            name: String::new(),
            form: SeriesStyle::Both,
            points: line,
        });
        series.extend(places.iter().enumerate().map(|(i, (value, label, point))| {
            // A label without settings is how the algorithm is called in the tables.
            // The first point names the sweep, the others only their value.
            let value = if label.contains(':') {
                (*value).clone()
            } else {
                format!("{value}, {label}")
            };
            match i {
                0 => one(&format!("{name} = {value}"), SeriesStyle::Caption, *point),
                _ => one(&value, SeriesStyle::Label, *point),
            }
        }));
    }
    if series.iter().all(|s| s.points.is_empty()) {
        return Ok(None);
    }
    let svg = Chart {
        title: String::new(),
        x,
        y,
        series,
    }
    .svg()?;
    Ok(Some(PlotView { title, about, svg }))
}

/// Most sweeps that are drawn as lines: those of a grid would cover each other.
const MAX_LINES: usize = 6;

/// The swept algorithms as points, a series for each kind of algorithm.
fn clouds(page: &ReportPage, place: PlotPoint) -> Vec<Series> {
    let mut clouds: Vec<Series> = Vec::new();
    for algorithm in &page.summary.algorithms {
        let holds = |sweep: &&ParameterSweep| {
            let mut points = sweep.points.iter();
            points.any(|(_, label)| *label == algorithm.algorithm)
        };
        let (Some(sweep), Some(point)) = (page.sweeps.iter().find(holds), place(algorithm)) else {
            continue;
        };
        // Sweeps are called `bm: uniqueness`.
        let kind = sweep.name.split(':').next().unwrap_or_default();
        match clouds.iter_mut().find(|cloud| cloud.name == kind) {
            Some(cloud) => cloud.points.push(point),
            None => clouds.push(Series {
                name: kind.to_owned(),
                form: SeriesStyle::Points,
                points: vec![point],
            }),
        }
    }
    clouds
}

/// Latency, and where the time goes; nothing without pairs.
pub(super) fn speed(page: &ReportPage) -> Result<Vec<PlotView>> {
    if page.times_ms.is_empty() {
        return Ok(Vec::new());
    }
    let latency = Strips {
        title: String::new(),
        label: "ms per pair".into(),
        strips: page.times_ms.clone(),
    };
    let stages: [(&str, PlotNumber); 6] = [
        ("smoothing", |a| a.smoothing_ms),
        ("texture", |a| a.texture_ms),
        ("matching", |a| a.matching_ms),
        ("checks", |a| a.checks_ms),
        ("filters", |a| a.filters_ms),
        ("other", |a| a.other_ms),
    ];
    // Rows hold whole microseconds, so a stage below 1 % may be rounding alone.
    let counts = |of: PlotNumber| {
        page.summary
            .algorithms
            .iter()
            .any(|a| of(a) > a.p50_ms.map(|ms| 0.01 * ms))
    };
    let counted = stages.map(|(_, of)| counts(of));
    let times = |a: &AlgorithmSummary| {
        let times = stages.iter().zip(counted);
        let times = times.map(|((_, of), counts)| if counts { of(a) } else { Some(0.0) });
        Some((a.algorithm.clone(), times.collect::<Option<_>>()?))
    };
    let bars = Bars {
        title: String::new(),
        label: "ms per pair".into(),
        parts: stages.iter().map(|(name, _)| (*name).to_owned()).collect(),
        bars: page.summary.algorithms.iter().filter_map(times).collect(),
    };
    let shares = Bars {
        label: "shares; the number: ms per pair".into(),
        ..bars.clone()
    };
    Ok(vec![
        PlotView {
            title: "Latency",
            about: "Histogram of the times per pair; each strip has its own height scale.",
            svg: latency.svg()?,
        },
        PlotView {
            title: "Time by stage",
            about: "Mean over the half of the pairs nearest to the median.",
            svg: bars.svg()?,
        },
        PlotView {
            title: "Share of each stage",
            about: "As shares of the same times.",
            svg: shares.shares_svg()?,
        },
    ])
}
