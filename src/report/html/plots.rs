//! The plots of the page.

use super::super::accuracy::AccuracyRow;
use super::super::page::PlotView;
use super::super::plot::{
    AlgorithmColors, Axis, Bars, Chart, CourseMap, Series, SeriesStyle, Strips,
};
use super::super::reliability::{ABOUT, ReliabilityRow, reliability_chart};
use super::super::results::{AlgorithmSummary, Results};
use super::super::stress::{NUMBERS, kinds};
use super::{ParameterSweep, ReportPage};
use serde::Serialize;
use svl_core::Result;
use svl_score::judge::{Metric, TruthLevel};
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
    x: PlotAxis,
    y: PlotAxis,
    /// The area of a disc, of 100.
    area: Option<PlotNumber>,
    /// The kind of run whose page begins with this plot.
    leads: Option<TruthLevel>,
}

struct PlotAxis {
    label: &'static str,
    is_log: bool,
    /// Less is better.
    is_cost: bool,
    number: PlotNumber,
}

const TIME: PlotAxis = PlotAxis {
    is_log: true,
    ..PlotAxis::cost("median ms per pair", |_, a| a.p50_ms)
};
const WRONG: PlotAxis = PlotAxis::cost("wrong, of the known cells, %", |_, a| wrong_of_known(a));
const BAD: PlotAxis = PlotAxis::cost("off by > 2 px, of the estimates, %", |_, a| {
    a.totals.get("bad2").map(percent)
});
const KNOWN: PlotAxis = PlotAxis::gain("known, of the cells, %", |_, a| known(a));
const COVERED: PlotAxis = PlotAxis::gain("estimated, of the visible pixels, %", |_, a| {
    a.totals
        .get("invalid")
        .map(|invalid| percent(1.0 - invalid))
});
const FINISHED: PlotAxis = PlotAxis::gain("courses finished, %", |summary, a| {
    let finished = summary.value(&a.algorithm, Metric::find("finished")?, None);
    finished.map(percent)
});
const COLLISIONS: PlotAxis = PlotAxis::cost("collisions per 100 m", |summary, a| {
    summary.value(&a.algorithm, Metric::find("collisions")?, None)
});
const UNRIVALLED: PlotAxis = PlotAxis::gain("unrivalled, of the cells, %", |_, a| {
    a.totals.get("unrivalled").map(percent)
});

const TRADE_OFFS: [TradeOff; 6] = [
    TradeOff {
        title: "Wrong against time",
        about: "Down and left is better. The area of a disc is the fraction of cells that are \
                known.",
        x: TIME,
        y: WRONG,
        area: Some(|_, a| known(a)),
        leads: Some(TruthLevel::Distances),
    },
    TradeOff {
        title: "Wrong pixels against time",
        about: "Down and left is better. The area of a disc is the fraction of visible pixels \
                with a disparity.",
        x: TIME,
        y: BAD,
        area: Some(COVERED.number),
        leads: Some(TruthLevel::Disparities),
    },
    TradeOff {
        title: "Collisions against courses finished",
        about: "Down and right is better.",
        x: FINISHED,
        y: COLLISIONS,
        area: None,
        leads: Some(TruthLevel::Courses),
    },
    TradeOff {
        title: "Unrivalled cells against time",
        about: "Up and left is better.",
        x: TIME,
        y: UNRIVALLED,
        area: None,
        leads: Some(TruthLevel::NoTruth),
    },
    TradeOff {
        title: "Wrong cells against known ones",
        about: "Down and right is better.",
        x: KNOWN,
        y: WRONG,
        area: None,
        leads: None,
    },
    TradeOff {
        title: "Wrong pixels against coverage",
        about: "Down and right is better.",
        x: COVERED,
        y: BAD,
        area: None,
        leads: None,
    },
];

/// The trade-offs that the run measures, that of its kind first.
pub(super) fn trade_offs(page: &ReportPage, colors: &AlgorithmColors<'_>) -> Result<Vec<PlotView>> {
    let kind = page.summary.kind();
    let mut shown: Vec<_> = TRADE_OFFS.iter().collect();
    // Stable.
    shown.sort_by_key(|trade_off| trade_off.leads != Some(kind));
    let plots = shown
        .into_iter()
        .map(|trade_off| scatter(page, trade_off, colors));
    plots.filter_map(Result::transpose).collect()
}

/// Plots of a perturbation: one per metric, its value over the levels.
pub(super) fn stress(page: &ReportPage, colors: &AlgorithmColors<'_>) -> Result<Vec<StressView>> {
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
                title: String::new(),
                x: Axis::new(format!("{}, {}", kind.name, kind.unit)),
                y: Axis::new(*axis),
                series,
            };
            (!chart.series.is_empty()).then(|| {
                Ok(PlotView {
                    title: (*title).into(),
                    about: "",
                    svg: chart.svg_in(colors)?,
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
    pub name: &'static str,
    about: &'static str,
    pub plots: Vec<PlotView>,
}

/// The courses from above: all, or those that failed or did not.
pub(super) fn maps(
    page: &ReportPage,
    colors: &AlgorithmColors<'_>,
    failed: Option<bool>,
) -> Result<Vec<PlotView>> {
    let map = |map: &CourseMap| {
        Ok(PlotView {
            title: map.title.clone().into(),
            about: "",
            svg: map.svg(colors)?,
        })
    };
    let shown = |map: &&CourseMap| failed.is_none_or(|failed| map.is_failed == failed);
    page.maps.iter().filter(shown).map(map).collect()
}

/// The algorithms but the references as discs, those of a sweep joined, and the front of those that
/// no other beats in both numbers; absent where no algorithm has both.
fn scatter(
    page: &ReportPage,
    trade_off: &TradeOff,
    colors: &AlgorithmColors<'_>,
) -> Result<Option<PlotView>> {
    let algorithms = page.summary.algorithms.iter();
    let algorithms: Vec<_> = algorithms
        .filter(|a| !page.summary.is_reference(a))
        .collect();
    let place = |a: &AlgorithmSummary| {
        let [x, y] = [&trade_off.x, &trade_off.y].map(|axis| (axis.number)(&page.summary, a));
        x.zip(y)
    };
    let find = |label: &str| {
        algorithms
            .iter()
            .find(|a| a.algorithm == label)
            .and_then(|a| place(a))
    };
    let is_swept = |label: &str| {
        let mut points = page.sweeps.iter().flat_map(|sweep| &sweep.points);
        points.any(|(_, name)| name == label)
    };
    let one = |name: &str, form, point| Series {
        name: name.to_owned(),
        form,
        points: vec![point],
    };
    // The front says which is faster.
    let has_time = trade_off.x.label == TIME.label;
    let has_front = !has_time || page.summary.has_comparable_times();
    let candidates = algorithms
        .iter()
        .filter(|a| has_front && page.summary.is_candidate(a));
    let mut series = vec![Series {
        name: String::new(),
        form: SeriesStyle::Front,
        points: front(trade_off, candidates.filter_map(|a| place(a)).collect()),
    }];
    let radius = |a: &AlgorithmSummary| {
        let area = trade_off.area.and_then(|area| area(&page.summary, a));
        disc_radius(area)
    };
    let alone = algorithms.iter().filter(|a| !is_swept(&a.algorithm));
    let discs = alone.filter_map(|a| {
        let form = SeriesStyle::Disc(radius(a));
        Some(one(&a.algorithm, form, place(a)?))
    });
    series.extend(discs);
    if page.sweeps.len() > MAX_LINES {
        let swept = algorithms.iter().filter(|a| is_swept(&a.algorithm));
        series.extend(swept.filter_map(|a| Some(shaded(&a.algorithm, place(a)?))));
    } else {
        for sweep in &page.sweeps {
            series.extend(joined(sweep, find));
        }
    }
    if series.iter().all(|s| s.points.is_empty()) {
        return Ok(None);
    }
    let chart = Chart {
        title: String::new(),
        x: trade_off.x.axis(),
        y: trade_off.y.axis(),
        series,
    };
    // Equal ones share a point.
    let name = |_: &Series, point| {
        let own = algorithms.iter().filter(|a| place(a) == Some(point));
        let labels: Vec<_> = own.map(|a| a.algorithm.as_str()).collect();
        labels.join(", ")
    };
    Ok(Some(PlotView {
        title: trade_off.title.into(),
        about: trade_off.about,
        svg: chart.svg_named(colors, &name)?,
    }))
}

/// Radius of a disc whose area stands for a percentage.
fn disc_radius(area: Option<f64>) -> u32 {
    area.map_or(10, |percent| (1.7 * percent.sqrt()).round() as u32)
        .max(5)
}

impl PlotAxis {
    /// A number of which less is better.
    const fn cost(label: &'static str, number: PlotNumber) -> Self {
        Self {
            label,
            is_log: false,
            is_cost: true,
            number,
        }
    }

    /// A number of which more is better.
    const fn gain(label: &'static str, number: PlotNumber) -> Self {
        Self {
            is_cost: false,
            ..Self::cost(label, number)
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

/// The points that no other beats in both numbers, from left to right.
fn front(trade_off: &TradeOff, mut points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    let cost = |axis: &PlotAxis, value: f64| if axis.is_cost { value } else { -value };
    let costs = |p: &(f64, f64)| [cost(&trade_off.x, p.0), cost(&trade_off.y, p.1)];
    let beats = |a: [f64; 2], b: [f64; 2]| a[0] <= b[0] && a[1] <= b[1] && a != b;
    let all: Vec<_> = points.iter().map(costs).collect();
    points.retain(|p| !all.iter().any(|other| beats(*other, costs(p))));
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    points
}

/// A sweep as a line with its values. Its first point names it.
fn joined(sweep: &ParameterSweep, find: impl Fn(&str) -> Option<(f64, f64)>) -> Vec<Series> {
    let points = sweep.points.iter();
    let places: Vec<_> = points
        .filter_map(|(value, label)| Some((value, label, find(label)?)))
        .collect();
    let line = Series {
        name: sweep.algorithm.clone(),
        form: SeriesStyle::Joined,
        points: places.iter().map(|(.., point)| *point).collect(),
    };
    let label = |(i, (value, label, point)): (usize, &(&String, &String, (f64, f64)))| {
        // A label without settings is how the algorithm is called in the tables.
        let value = if label.contains(':') {
            (*value).clone()
        } else {
            format!("{value}, {label}")
        };
        let (name, form) = match i {
            0 => {
                let name = format!("{}: {} = {value}", sweep.algorithm, sweep.parameter);
                (name, SeriesStyle::Caption)
            }
            _ => (value, SeriesStyle::Label),
        };
        Series {
            name,
            form,
            points: vec![*point],
        }
    };
    let labels = places.iter().enumerate().map(label);
    let shaded = places.iter().map(|(_, label, point)| shaded(label, *point));
    std::iter::once(line).chain(shaded).chain(labels).collect()
}

/// A point in the colour of its algorithm.
fn shaded(label: &str, point: (f64, f64)) -> Series {
    Series {
        name: label.to_owned(),
        form: SeriesStyle::Unkeyed,
        points: vec![point],
    }
}

/// Most sweeps that are drawn as lines: those of a grid would cover each other.
const MAX_LINES: usize = 6;

/// The median error over the distance; nothing without distances.
pub(super) fn accuracy(page: &ReportPage, colors: &AlgorithmColors<'_>) -> Result<Vec<PlotView>> {
    let summary = &page.summary;
    let algorithms = summary.algorithms.iter();
    let series = algorithms.filter(|a| !summary.is_reference(a)).map(|a| {
        let own = summary.accuracy.iter();
        let is_own = |row: &&AccuracyRow| {
            let is_range = row.area == summary.basis.area && !row.is_of_all();
            row.algorithm == a.algorithm && is_range
        };
        let own = own.filter(is_own);
        let points = own.filter_map(|row| Some((row.middle_m(), row.median_error_m?)));
        Series {
            name: a.algorithm.clone(),
            form: SeriesStyle::Both,
            points: points.filter(|(_, error_m)| *error_m > 0.0).collect(),
        }
    });
    let series: Vec<_> = series.filter(|series| !series.points.is_empty()).collect();
    if series.is_empty() {
        return Ok(Vec::new());
    }
    let log = |label: &str| Axis {
        log: true,
        ..Axis::new(label)
    };
    let chart = Chart {
        title: String::new(),
        x: log("true distance, m"),
        y: log("median error, m"),
        series,
    };
    Ok(vec![PlotView {
        title: "Error against distance".into(),
        about: "Median absolute error of the cells in each range of true distances.",
        svg: chart.svg_in(colors)?,
    }])
}

/// Observed over predicted fractions of right cells; nothing without probabilities.
pub(super) fn reliability(
    page: &ReportPage,
    colors: &AlgorithmColors<'_>,
) -> Result<Vec<PlotView>> {
    let rows = &page.summary.reliability;
    let algorithms = page.summary.algorithms.iter().map(|a| {
        let own = rows.iter().filter(|row| row.algorithm == a.algorithm);
        let bins = own.map(ReliabilityRow::bin).collect();
        (a.algorithm.clone(), bins)
    });
    let plot = |chart: Chart| {
        Ok(PlotView {
            title: "Reliability of probabilities".into(),
            about: ABOUT,
            svg: chart.svg_in(colors)?,
        })
    };
    let chart = reliability_chart(algorithms.collect());
    chart.into_iter().map(plot).collect()
}

/// Time of a stage of an algorithm.
type StageTime = fn(&AlgorithmSummary) -> Option<f64>;

/// Latency, and where the time goes; nothing without pairs.
pub(super) fn speed(page: &ReportPage, colors: &AlgorithmColors<'_>) -> Result<Vec<PlotView>> {
    if page.times_ms.is_empty() {
        return Ok(Vec::new());
    }
    let ranked = page.summary.ranked_algorithms();
    let times = |a: &&AlgorithmSummary| {
        let mut times = page.times_ms.iter();
        times.find(|(label, _)| *label == a.algorithm).cloned()
    };
    let latency = Strips {
        title: String::new(),
        label: "ms per pair".into(),
        strips: ranked.iter().filter_map(times).collect(),
    };
    let bars = stage_bars(page, &ranked);
    let shares = Bars {
        label: "fractions; the number: ms per pair".into(),
        ..bars.clone()
    };
    Ok(vec![
        PlotView {
            title: "Latency".into(),
            about: "Histogram of the times per pair; each strip has its own height scale.",
            svg: latency.svg(colors)?,
        },
        PlotView {
            title: "Time by stage".into(),
            about: "Mean over the half of the pairs nearest to the median.",
            svg: bars.svg()?,
        },
        PlotView {
            title: "Fraction of each stage".into(),
            about: "As fractions of the same times.",
            svg: shares.shares_svg()?,
        },
    ])
}

/// The mean time of each stage.
fn stage_bars(page: &ReportPage, ranked: &[&AlgorithmSummary]) -> Bars {
    let stages: [(&str, StageTime); 6] = [
        ("smoothing", |a| a.smoothing_ms),
        ("texture", |a| a.texture_ms),
        ("matching", |a| a.matching_ms),
        ("checks", |a| a.checks_ms),
        ("filters", |a| a.filters_ms),
        ("other", |a| a.other_ms),
    ];
    // Rows hold whole microseconds, so a stage below 1 % may be rounding alone.
    let counts = |stage: StageTime| {
        page.summary
            .algorithms
            .iter()
            .any(|a| stage(a) > a.p50_ms.map(|ms| 0.01 * ms))
    };
    let counted = stages.map(|(_, stage)| counts(stage));
    let times = |a: &&AlgorithmSummary| {
        let times = stages.iter().zip(counted);
        let times = times.map(|((_, stage), counts)| if counts { stage(a) } else { Some(0.0) });
        Some((a.algorithm.clone(), times.collect::<Option<_>>()?))
    };
    Bars {
        title: String::new(),
        label: "ms per pair".into(),
        parts: stages.iter().map(|(name, _)| (*name).to_owned()).collect(),
        bars: ranked.iter().filter_map(times).collect(),
    }
}
