//! The plots of the page.

use super::figures::{ParameterSweep, ReportPage};
use crate::results::summary::{AlgorithmSummary, Results};
use crate::show::page::plot_view::PlotView;
use crate::show::plot::bars::Bars;
use crate::show::plot::chart::{Axis, Chart};
use crate::show::plot::series::{AlgorithmColors, Series, SeriesStyle};
use crate::show::plot::strips::Strips;
use crate::subjects::pieces::SeenShares;
use crate::subjects::reliability::{ABOUT, ReliabilityRow, reliability_chart};
use crate::subjects::speed::STAGES;
use crate::subjects::stress::{NUMBERS, kinds};
use svl_score::judge::{Metric, MetricSource as _, TruthLevel};
use svl_sim::stress::StressKind;

fn percent(share: f64) -> f64 {
    100.0 * share
}

/// Fraction of wrong cells among the known ones, percent; absent where none is known.
fn wrong_of_known(a: &AlgorithmSummary) -> Option<f64> {
    let (right, wrong) = (a.totals.get("right")?, a.totals.get("wrong")?);
    (right + wrong > 0.0).then(|| percent(wrong / (right + wrong)))
}

/// Fraction of known cells among those with truth, percent.
fn known(a: &AlgorithmSummary) -> Option<f64> {
    let [right, wrong, unknown] = ["right", "wrong", "unknown"].map(|name| a.totals.get(name));
    let known = right? + wrong?;
    let cells = known + unknown?;
    (cells > 0.0).then(|| percent(known / cells))
}

/// A number of an algorithm, if it has one.
type PlotNumber = fn(&Results, &AlgorithmSummary) -> Option<f64>;

/// Two numbers that trade off against each other.
struct TradeOff {
    title: &'static str,
    about: &'static str,
    axes: [PlotAxis; 2],
    /// The area of a disc, of 100.
    area: Option<PlotNumber>,
}

#[derive(Clone, Copy)]
struct PlotAxis {
    label: &'static str,
    is_log: bool,
    number: PlotNumber,
}

const TIME: PlotAxis = PlotAxis {
    is_log: true,
    ..PlotAxis::new("median ms per pair", |_, a| a.p50_ms)
};
const WRONG: PlotAxis = PlotAxis::new("wrong, of the known cells, %", |_, a| wrong_of_known(a));
const BAD: PlotAxis = PlotAxis::new("off by > 2 px, of the estimates, %", |_, a| {
    a.totals.get("bad2").map(percent)
});
const KNOWN: PlotAxis = PlotAxis::new("known, of the cells, %", |_, a| known(a));
const COVERED: PlotAxis = PlotAxis::new("estimated, of the visible pixels, %", |_, a| {
    let invalid = a.totals.get("invalid");
    invalid.map(|invalid| percent(1.0 - invalid))
});
const FINISHED: PlotAxis = PlotAxis::new("courses finished, %", |summary, a| {
    let finished = summary.value(&a.algorithm, Metric::find("finished")?, None);
    finished.map(percent)
});
const COLLISIONS: PlotAxis = PlotAxis::new("collisions per 100 m", |summary, a| {
    summary.value(&a.algorithm, Metric::find("collisions")?, None)
});
const ESTIMATED: PlotAxis = PlotAxis::new("estimated right, of the cells, %", |_, a| {
    a.totals.get("estimated_right").map(percent)
});

/// The plots that pages of runs with distances, disparities, courses and no truth begin with, in
/// that order, then others.
const TRADE_OFFS: [TradeOff; 6] = [
    TradeOff {
        title: "Wrong against time",
        about: "Down and left is better. The area of a disc is the fraction of known cells.",
        axes: [TIME, WRONG],
        area: Some(|_, a| known(a)),
    },
    TradeOff {
        title: "Wrong pixels against time",
        about: "Down and left is better. The area of a disc is the fraction of visible pixels with \
                a disparity.",
        axes: [TIME, BAD],
        area: Some(COVERED.number),
    },
    TradeOff {
        title: "Collisions against courses finished",
        about: "Down and right is better.",
        axes: [FINISHED, COLLISIONS],
        area: None,
    },
    TradeOff {
        title: "Estimated right cells against time",
        about: "Up and left is better.",
        axes: [TIME, ESTIMATED],
        area: None,
    },
    TradeOff {
        title: "Wrong cells against known ones",
        about: "Down and right is better.",
        axes: [KNOWN, WRONG],
        area: None,
    },
    TradeOff {
        title: "Wrong pixels against coverage",
        about: "Down and right is better.",
        axes: [COVERED, BAD],
        area: None,
    },
];

/// The trade-offs that the run measures, that of its kind first.
pub(crate) fn trade_offs(page: &ReportPage, colors: &AlgorithmColors<'_>) -> Vec<PlotView> {
    let lead = match page.summary.kind() {
        TruthLevel::Distances => 0,
        TruthLevel::Disparities => 1,
        TruthLevel::Courses => 2,
        TruthLevel::NoTruth => 3,
    };
    let mut shown: Vec<_> = TRADE_OFFS.iter().collect();
    shown[..=lead].rotate_right(1);
    let shown = shown.into_iter();
    let plots = shown.filter_map(|trade_off| scatter(page, trade_off, colors));
    plots.collect()
}

/// Plots of a perturbation: its name, its meaning, and per metric its value over the levels.
pub(crate) type StressPlots = (&'static str, &'static str, Vec<PlotView>);

pub(crate) fn stress(page: &ReportPage, colors: &AlgorithmColors<'_>) -> Vec<StressPlots> {
    let all = &page.summary.stress;
    let view = |kind: &'static StressKind| {
        let own: Vec<_> = all.iter().filter(|s| s.kind == kind.name).collect();
        let mut algorithms: Vec<&str> = own.iter().map(|s| s.algorithm.as_str()).collect();
        algorithms.sort_by_key(|name| own.iter().position(|s| s.algorithm == *name));
        algorithms.dedup();
        let plots = NUMBERS.iter().filter_map(|number| {
            let series = algorithms.iter().map(|algorithm| {
                let points = own.iter().filter(|s| s.algorithm == *algorithm);
                let points = points.filter_map(|s| Some((s.level, number.plotted(s)?)));
                let mut points: Vec<_> = points.collect();
                points.sort_by(|a, b| a.0.total_cmp(&b.0));
                Series::new(algorithm, SeriesStyle::Both, points)
            });
            let x = Axis::new(format!("{}, {}", kind.name, kind.unit));
            let chart = Chart::untitled(x, Axis::new(number.heading()), series);
            let view = |chart: Chart| PlotView::new(number.words, "", chart.svg_in(colors));
            chart.if_any().map(view)
        });
        (kind.name, kind.summary, plots.collect())
    };
    kinds(all).into_iter().map(view).collect()
}

/// The courses from above: all, or those that failed or did not.
pub(crate) fn maps(
    page: &ReportPage,
    colors: &AlgorithmColors<'_>,
    failed: Option<bool>,
) -> Vec<PlotView> {
    let shown = page.maps.iter();
    let shown = shown.filter(|map| failed.is_none_or(|failed| map.is_failed == failed));
    let shown = shown.map(|map| PlotView::new(&map.title, "", map.svg(colors)));
    shown.collect()
}

/// The algorithms but the references as discs, those of a sweep joined; absent where less than two
/// algorithms have both numbers.
fn scatter(
    page: &ReportPage,
    trade_off: &TradeOff,
    colors: &AlgorithmColors<'_>,
) -> Option<PlotView> {
    let summary = &page.summary;
    let algorithms = summary.algorithms.iter();
    let algorithms = algorithms.filter(|a| !summary.is_reference(a));
    let place = |a: &&AlgorithmSummary| {
        let [x, y] = trade_off.axes.map(|axis| (axis.number)(summary, a));
        x.zip(y)
    };
    let placed: Vec<_> = algorithms.filter_map(|a| Some((a, place(&a)?))).collect();
    let find = |label: &str| {
        let own = placed.iter().find(|(a, _)| a.algorithm == label);
        own.map(|(_, point)| *point)
    };
    let (swept, alone): (Vec<_>, Vec<_>) = placed
        .iter()
        .partition(|(a, _)| page.is_swept(&a.algorithm));
    let discs = alone.iter().map(|(a, point)| {
        let area = trade_off.area.and_then(|area| area(summary, a));
        Series::new(
            &a.algorithm,
            SeriesStyle::Disc(disc_radius(area)),
            vec![*point],
        )
    });
    let mut series: Vec<_> = discs.collect();
    if page.sweeps.len() > MAX_LINES {
        series.extend(swept.iter().map(|(a, point)| shaded(&a.algorithm, *point)));
    } else {
        series.extend(page.sweeps.iter().flat_map(|sweep| joined(sweep, find)));
    }
    let [x, y] = trade_off.axes.map(|axis| axis.axis());
    let chart = Chart::untitled(x, y, series).if_any()?;
    // Equal ones share a point.
    let name = |_: &Series, point| {
        let own = placed.iter().filter(|(_, own)| *own == point);
        own.map(|(a, _)| a.algorithm.as_str())
            .collect::<Vec<_>>()
            .join(", ")
    };
    let svg = chart.svg_named(colors, &name);
    Some(PlotView::new(trade_off.title, trade_off.about, svg))
}

/// Radius of a disc whose area stands for a percentage.
fn disc_radius(area: Option<f64>) -> u32 {
    area.map_or(10, |percent| (1.7 * percent.sqrt()).round() as u32)
        .max(5)
}

impl PlotAxis {
    const fn new(label: &'static str, number: PlotNumber) -> Self {
        Self {
            label,
            is_log: false,
            number,
        }
    }

    fn axis(&self) -> Axis {
        if self.is_log {
            Axis {
                log: true,
                ..Axis::new(self.label)
            }
        } else if self.label.ends_with('%') {
            Axis::share(self.label)
        } else {
            Axis::new(self.label)
        }
    }
}

/// A sweep with its values. Its first point names it. A line joins its points if they go one way:
/// noise would make it a zigzag.
fn joined(sweep: &ParameterSweep, find: impl Fn(&str) -> Option<(f64, f64)>) -> Vec<Series> {
    let points = sweep.points.iter();
    let places: Vec<_> = points
        .filter_map(|(value, label)| Some((value, label, find(label)?)))
        .collect();
    let points = || places.iter().map(|(.., point)| *point);
    let is_ordered = points().is_sorted_by(|a, b| a.0 <= b.0);
    let is_ordered = is_ordered || points().is_sorted_by(|a, b| a.0 >= b.0);
    let line = || Series::new(&sweep.algorithm, SeriesStyle::Joined, points());
    let line = is_ordered.then(line);
    let label = |(i, (value, label, point)): (usize, &(&String, &String, (f64, f64)))| {
        // A label without settings is how the algorithm is called in the tables.
        let value = if label.contains(':') {
            (*value).clone()
        } else {
            format!("{value}, {label}")
        };
        let first = format!("{}: {} = {value}", sweep.algorithm, sweep.parameter);
        match i {
            0 => Series::new(&first, SeriesStyle::Caption, vec![*point]),
            _ => Series::new(&value, SeriesStyle::Label, vec![*point]),
        }
    };
    let labels = places.iter().enumerate().map(label);
    let shaded = places.iter().map(|(_, label, point)| shaded(label, *point));
    line.into_iter().chain(shaded).chain(labels).collect()
}

/// A point in the colour of its algorithm.
fn shaded(label: &str, point: (f64, f64)) -> Series {
    Series::new(label, SeriesStyle::Unkeyed, vec![point])
}

/// Most sweeps that are drawn as lines: those of a grid would cover each other.
const MAX_LINES: usize = 6;

/// The median error over the distance; nothing without distances.
pub(crate) fn accuracy(page: &ReportPage, colors: &AlgorithmColors<'_>) -> Vec<PlotView> {
    let summary = &page.summary;
    let algorithms = summary.algorithms.iter();
    let series = algorithms.filter(|a| !summary.is_reference(a)).map(|a| {
        let own = summary.accuracy.iter();
        let own = own.filter(|row| row.algorithm == a.algorithm);
        let own = own.filter(|row| row.area == summary.basis.area && !row.is_of_pixels);
        let own = own.filter(|row| !row.is_of_all() && !row.is_of_limit);
        let points = own.filter_map(|row| Some((row.mean_true_m?, row.median_error_m?)));
        let points = points.filter(|(_, error_m)| *error_m > 0.0);
        Series::new(&a.algorithm, SeriesStyle::Both, points)
    });
    let [x, y] = ["true distance, m", "median error, m"].map(Axis::log);
    let chart = Chart::untitled(x, y, series).if_any();
    let about =
        "Median absolute error of the cells in each range of true distances, at their mean.";
    let plot = |chart: Chart| PlotView::new("Median error of cells", about, chart.svg_in(colors));
    chart.map(plot).into_iter().collect()
}

/// Observed over predicted fractions of right cells; nothing without probabilities.
pub(crate) fn reliability(page: &ReportPage, colors: &AlgorithmColors<'_>) -> Vec<PlotView> {
    let algorithms = page.summary.algorithms.iter().map(|a| {
        let rows = page.summary.reliability.iter();
        let own = rows.filter(|row| row.algorithm == a.algorithm);
        (a.algorithm.clone(), own.map(ReliabilityRow::bin).collect())
    });
    let chart = reliability_chart(algorithms.collect());
    let title = "Reliability of probabilities";
    let plot = chart.map(|chart| PlotView::new(title, ABOUT, chart.svg_in(colors)));
    plot.into_iter().collect()
}

/// The part of the pairs that see a test piece over its distance, a plot for each piece.
pub(crate) fn pieces(page: &ReportPage, colors: &AlgorithmColors<'_>) -> Vec<PlotView> {
    let own = &page.summary.basis.seen;
    // In the order of the sizes.
    let plots = own.chunk_by(|a, b| a.size == b.size).filter_map(|own| {
        let size = &own[0].size;
        let line =
            |own: &SeenShares| Series::new(&own.algorithm, SeriesStyle::Both, own.points.clone());
        let series = own.iter().map(line);
        let y = Axis::share("pairs that see it, %").with_range(0.0, 100.0);
        let chart = Chart::untitled(Axis::new("distance of the piece, m"), y, series).if_any()?;
        let about = "Pairs that see the piece, of those in each 0.25 m of its distance.";
        Some(PlotView::new(size, about, chart.svg_in(colors)))
    });
    plots.collect()
}

/// Latency, and where the time goes; nothing without pairs.
pub(crate) fn speed(page: &ReportPage, colors: &AlgorithmColors<'_>) -> Vec<PlotView> {
    if page.times_ms.is_empty() {
        return Vec::new();
    }
    let ranked = page.summary.ranked_algorithms();
    let times = |a: &&AlgorithmSummary| {
        let mut times = page.times_ms.iter();
        times.find(|(label, _)| *label == a.algorithm).cloned()
    };
    let latency = Strips {
        label: "ms per pair".into(),
        strips: ranked.iter().filter_map(times).collect(),
    };
    let bars = stage_bars(page, &ranked);
    let shares = Bars {
        label: "fractions; the number: ms per pair".into(),
        ..bars.clone()
    };
    let histogram = "Histogram of the times per pair; each strip has its own height scale.";
    let means = "Mean over the half of the pairs nearest to the median.";
    let fractions = "As fractions of the same times.";
    vec![
        PlotView::new("Latency", histogram, latency.svg(colors)),
        PlotView::new("Time by stage", means, bars.svg()),
        PlotView::new("Fraction of each stage", fractions, shares.shares_svg()),
    ]
}

/// The mean time of each stage.
fn stage_bars(page: &ReportPage, ranked: &[&AlgorithmSummary]) -> Bars {
    // Rows hold whole microseconds, so a stage below 1 % may be rounding alone.
    let counts = |i: usize| {
        let mut all = page.summary.algorithms.iter();
        all.any(|a| a.stages_ms()[i] > a.p50_ms.map(|ms| 0.01 * ms))
    };
    let counted: Vec<_> = (0..STAGES.len()).map(counts).collect();
    let times = |a: &&AlgorithmSummary| {
        let times = a.stages_ms().into_iter().zip(&counted);
        let times = times.map(|(ms, counts)| if *counts { ms } else { Some(0.0) });
        Some((a.algorithm.clone(), times.collect::<Option<_>>()?))
    };
    Bars {
        title: String::new(),
        label: "ms per pair".into(),
        parts: STAGES.map(str::to_owned).into(),
        bars: ranked.iter().filter_map(times).collect(),
    }
}
