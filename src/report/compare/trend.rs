//! The headline metrics over several reports, the newest last: `svl compare R1 R2 -o trend.json`.

use super::scored_run::ScoredRun;
use crate::rows::held::RowRef;
use crate::rows::samples::{self, runs, sample_in};
use crate::show::page::parts::fill;
use crate::show::page::plot_view::PlotView;
use crate::show::plot::chart::{Axis, Chart};
use crate::show::plot::series::{AlgorithmColors, Series, SeriesStyle};
use crate::show::table::model::Table;
use crate::show::words::NONE;
use crate::subjects::drives;
use minijinja::context;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use svl_core::{Result, counted, joined};
use svl_score::bootstrap::{Interval, RunLengths};
use svl_score::judge::{
    Cases, ColumnChoice, Measured, Metric, MetricSource as _, MetricUnit, TruthLevel,
};
use svl_score::manifest::{AlgorithmRecord, Purpose};

/// The headline metrics of reports over the pairs of all of them.
#[derive(Debug, Serialize)]
pub struct Trend {
    pub scenario: String,
    /// The reports as they were named, the newest last.
    pub reports: Vec<String>,
    /// The origins of the reports.
    pub origins: Vec<TrendOrigin>,
    /// Number of pairs or courses that all of them have.
    pub pairs: usize,
    /// Reports that were scored otherwise or are incomplete, and pairs that are left out.
    pub cautions: Vec<String>,
    pub lines: Vec<TrendLine>,
}

/// The moment and the program of a report.
#[derive(Debug, Serialize)]
pub struct TrendOrigin {
    /// RFC 3339, UTC.
    pub began: String,
    /// Git revision of svl, if its build knew it.
    pub git_revision: Option<String>,
}

/// A metric of an algorithm in each report.
#[derive(Debug, Serialize)]
pub struct TrendLine {
    pub metric: &'static Metric,
    pub algorithm: String,
    /// `None` where a report does not measure it.
    pub points: Vec<Option<TrendPoint>>,
}

/// A metric in a report.
#[derive(Debug, Serialize)]
pub struct TrendPoint {
    pub value: f64,
    /// 95 % interval; absent for too few blocks.
    pub interval: Option<Interval>,
    pub cases: Cases,
    /// The parameters that changed since the report before that has the algorithm: its line is
    /// interrupted there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub other_settings: Option<String>,
}

/// A pair by its place and pixels.
fn pair(row: RowRef<'_>) -> String {
    let key = (
        row.origin().run_key(),
        row.sequence(),
        &row.name(),
        &row.pair_hash(),
    );
    format!("{key:?}")
}

impl Trend {
    /// # Errors
    /// [`svl_core::Error::Invalid`] for a manifest that is not what svl writes.
    pub fn new(runs: &[ScoredRun]) -> Result<Self> {
        let is_driven = runs.iter().any(|run| !run.drives.is_empty());
        let kinds = [
            (Purpose::Compare, "pair"),
            (Purpose::CompareDrives, "course"),
        ];
        let (purpose, noun) = kinds[usize::from(is_driven)];
        let mut cautions = Vec::new();
        for run in runs {
            let name = run.name.display();
            let differences = runs[0].manifest.differences(&run.manifest, purpose)?;
            if !differences.is_empty() {
                let differences = differences.join("; ");
                cautions.push(format!("{name} was scored differently ({differences})"));
            }
            let why = run.incomplete(&run.labels())?;
            cautions.extend(why.map(|why| format!("{name} is incomplete: {why}")));
        }
        let keys = |run: &ScoredRun| -> BTreeSet<_> {
            let courses = run.drives.iter().map(|row| row.seed.to_string());
            let pairs = run.rows.iter().filter(|_| !is_driven).map(pair);
            pairs.chain(courses).collect()
        };
        // A report of other data would leave nothing of the others.
        let newest = runs.last().map(keys).unwrap_or_default();
        let keyed = runs.iter().map(|run| (run, keys(run)));
        let (others, keyed): (Vec<_>, Vec<_>) =
            keyed.partition(|(_, keys)| keys.is_disjoint(&newest));
        for (run, _) in others {
            let name = run.name.display();
            cautions.push(format!(
                "{name} is left out: it shares no {noun} with the newest report"
            ));
        }
        let (runs, sets): (Vec<_>, Vec<_>) = keyed.into_iter().unzip();
        let both = sets.iter().cloned().reduce(|a, b| &a & &b);
        let common = both.unwrap_or_default();
        let most = sets.iter().map(BTreeSet::len).max().unwrap_or_default();
        if common.len() < most {
            let left = counted(most - common.len(), noun);
            cautions.push(format!("{left} that some reports lack are left out"));
        }
        if !runs.is_sorted_by_key(|run| &run.manifest.began) {
            cautions.push("the reports are not in the order of their dates".to_owned());
        }
        let labels: BTreeSet<_> = runs.iter().flat_map(|run| run.labels()).collect();
        let rows = || runs.iter().flat_map(|run| run.rows.iter());
        let has = |name: &str| rows().any(|row| row.metrics().get(name).is_some());
        let driven = Some(TruthLevel::Courses).filter(|_| is_driven);
        let kind = driven.unwrap_or_else(|| TruthLevel::from_measured(has));
        let metrics = ColumnChoice::Headline.metrics(kind);
        let lines = metrics.iter().flat_map(|metric| {
            labels.iter().map(|label| {
                let points = (0..runs.len()).map(|i| {
                    let mut before = runs[..i].iter().rev().filter_map(|run| run.record(label));
                    let both = before.next().zip(runs[i].record(label));
                    Some(TrendPoint {
                        other_settings: both.and_then(|(a, b)| changed_settings(a, b)),
                        ..point(runs[i], label, metric, &common)?
                    })
                });
                TrendLine {
                    metric,
                    algorithm: (*label).to_owned(),
                    points: points.collect(),
                }
            })
        });
        let lines = lines.filter(|line| line.points.iter().any(Option::is_some));
        let reports = runs.iter().map(|run| run.name.display().to_string());
        let origins = runs.iter().map(|run| TrendOrigin {
            began: run.manifest.began.clone(),
            git_revision: run.manifest.git_revision.clone(),
        });
        Ok(Self {
            origins: origins.collect(),
            scenario: runs[0].manifest.scenario.clone(),
            reports: reports.collect(),
            pairs: common.len(),
            cautions,
            lines: lines.collect(),
        })
    }

    /// The page: a plot per metric, a line per algorithm.
    ///
    /// # Errors
    /// [`svl_core::Error::Invalid`] with the error of the template engine.
    pub fn page(&self) -> Result<String> {
        let labels: BTreeSet<_> = self.lines.iter().map(|line| &*line.algorithm).collect();
        let colors = AlgorithmColors::new(labels);
        let metrics = self.lines.chunk_by(|a, b| a.metric == b.metric);
        let charts: Vec<_> = metrics
            .filter_map(|lines| {
                let metric = lines[0].metric;
                let unit = metric.unit.name().map(|unit| format!(", {unit}"));
                let words = metric.words.to_owned() + &unit.unwrap_or_default();
                let shown = |value: f64| match metric.unit {
                    MetricUnit::Share => 100.0 * value,
                    _ => value,
                };
                let series = lines.iter().flat_map(|line| {
                    let points = line.points.iter().enumerate();
                    let points = points.filter_map(|(i, own)| Some((i, own.as_ref()?)));
                    let points: Vec<_> = points.collect();
                    let x = |i: usize| 1.0 + i as f64;
                    let values = points.iter().flat_map(|(i, own)| {
                        // A point without a place interrupts the line.
                        let gap = own.other_settings.as_ref().map(|_| (f64::NAN, f64::NAN));
                        gap.into_iter().chain([(x(*i), shown(own.value))])
                    });
                    let bars = points.iter().filter_map(|(i, own)| {
                        let ends = own.interval?;
                        let ends = [ends.0, ends.1].map(|end| (x(*i), shown(end)));
                        Some(Series::new(&line.algorithm, SeriesStyle::Joined, ends))
                    });
                    let marks = points
                        .iter()
                        .filter(|(_, own)| own.other_settings.is_some());
                    let marks = marks.map(|(i, own)| {
                        let place = [(x(*i), shown(own.value))];
                        Series::new("other settings", SeriesStyle::Label, place)
                    });
                    let values = Series::new(&line.algorithm, SeriesStyle::Both, values);
                    bars.chain([values]).chain(marks).collect::<Vec<_>>()
                });
                let y = Axis::new(words.clone());
                let chart = Chart::untitled(Axis::new("report"), y, series).if_any()?;
                let svg =
                    chart.svg_named(&colors, &|series, (x, _)| self.tip(series, x as usize - 1));
                Some(PlotView::new(&words, "", svg))
            })
            .collect();
        let cautions = joined(&self.cautions);
        let view = context! {
            title => counted(self.reports.len(), "report"), scenario => self.scenario,
            reports => self.table(), pairs => self.pairs, cautions, charts, images => [(); 0],
        };
        fill(include_str!("trend.html"), "", &[], view)
    }

    /// The changes of settings in a report, by algorithm.
    fn other_settings(&self, report: usize) -> BTreeMap<&str, &str> {
        let settings = self.lines.iter().filter_map(|line| {
            let words = line.points[report].as_ref()?.other_settings.as_ref()?;
            Some((&*line.algorithm, &**words))
        });
        settings.collect()
    }

    /// The name of a point with date, commit and a change of settings.
    fn tip(&self, series: &Series, report: usize) -> String {
        let settings = self.other_settings(report).remove(&*series.name);
        let settings = settings.map(|words| format!("other settings: {words}"));
        let parts = [series.name.clone()].into_iter();
        joined(parts.chain(self.origins[report].words()).chain(settings))
    }

    /// The reports with date, commit and changes of settings.
    fn table(&self) -> Table {
        let mut table = Table::new("", "report").with_texts(["date", "commit", "other settings"]);
        for (i, (name, origin)) in self.reports.iter().zip(&self.origins).enumerate() {
            let settings = self.other_settings(i).into_iter();
            let settings = settings.map(|(label, words)| format!("{label}: {words}"));
            let settings = settings.collect::<Vec<_>>().join("; ");
            let cells = origin.words().into_iter().chain([settings]);
            table.push(format!("{} {name}", i + 1), cells);
        }
        table.remove_empty_columns();
        table
    }
}

impl TrendOrigin {
    /// Date and commit.
    fn words(&self) -> [String; 2] {
        let date = self.began.get(..16).unwrap_or(&self.began);
        let revision = self.git_revision.as_deref().unwrap_or(NONE);
        [date.replace('T', " "), revision.to_owned()]
    }
}

/// The parameters that differ, with both values.
fn changed_settings(before: &AlgorithmRecord, after: &AlgorithmRecord) -> Option<String> {
    let old = |name: &String| {
        let mut values = before.values.iter();
        values.find(|own| own.0 == *name).map_or(NONE, |own| &own.1)
    };
    let values = after.values.iter();
    let changed = values.filter(|own| !before.values.contains(own));
    let changed = changed.map(|(name, value)| format!("{name} {} → {value}", old(name)));
    let words = changed.collect::<Vec<_>>().join(", ");
    let others = || "another program, filter or rule of cells".to_owned();
    let words = Some(words).filter(|words| !words.is_empty());
    (before.parameters_hash != after.parameters_hash).then(|| words.unwrap_or_else(others))
}

/// A metric of an algorithm in a report, over the pairs or courses of all reports.
fn point(
    run: &ScoredRun,
    label: &str,
    metric: &'static Metric,
    common: &BTreeSet<String>,
) -> Option<TrendPoint> {
    let rows = run.rows.iter().filter(|row| row.algorithm() == label);
    let rows: Vec<_> = rows.filter(|row| common.contains(&pair(*row))).collect();
    let drives = run
        .drives
        .iter()
        .filter(|row| common.contains(&row.seed.to_string()));
    let drives: Vec<_> = drives.cloned().collect();
    let driven = drives::sample(metric, label, &drives);
    // Times vary with the machine, and checkpoints are of whole runs.
    let sample = driven.or_else(|| {
        let sample = sample_in(metric, &rows, run.area)?;
        (metric.unit != MetricUnit::Ms).then_some(sample)
    })?;
    let (own, runs) = if drives.is_empty() {
        let totals = samples::totals(&rows);
        (totals.measured(metric, run.area)?, runs(&rows))
    } else {
        let (value, cases) = (sample.total()?, Cases::items(sample.items() as u64));
        (
            Measured { value, cases },
            RunLengths::new(&[sample.items()], true),
        )
    };
    Some(TrendPoint {
        value: metric.value_of(own)?,
        interval: sample.interval(&runs),
        cases: own.cases,
        other_settings: None,
    })
}
