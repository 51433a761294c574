//! The headline metrics over several reports, the newest last: `svl compare R1 R2 -o trend.json`.

use super::scored_run::ScoredRun;
use super::text::is_ranked;
use crate::drives;
use crate::page::{PlotView, fill};
use crate::plot::{AlgorithmColors, Axis, Chart, Series, SeriesStyle};
use crate::rows::{MetricTotals, Row};
use crate::samples::{RunKey, resamples, run_key, sample_in};
use minijinja::context;
use serde::Serialize;
use std::collections::BTreeSet;
use svl_core::{Result, counted, joined};
use svl_score::bootstrap::{Interval, Resamples};
use svl_score::judge::{
    Cases, ColumnChoice, Measured, Metric, MetricOrigin, MetricUnit, TruthLevel,
};
use svl_score::manifest::Purpose;

/// The headline metrics of reports over the pairs of all of them.
#[derive(Debug, Serialize)]
pub struct Trend {
    pub scenario: String,
    /// The reports as they were named, the newest last.
    pub reports: Vec<String>,
    /// Number of pairs or courses that all of them have.
    pub pairs: usize,
    /// Reports that were scored otherwise or are incomplete, and pairs that are left out.
    pub cautions: Vec<String>,
    pub lines: Vec<TrendLine>,
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
    /// 95 % bootstrap interval; absent for too few blocks.
    pub interval: Option<Interval>,
    pub cases: Cases,
}

type PairKey<'a> = (RunKey<'a>, u64, &'a str, &'a str);

fn pair(row: &Row) -> PairKey<'_> {
    (run_key(row), row.sequence, &row.name, &row.pair_hash)
}

impl Trend {
    /// # Errors
    /// [`svl_core::Error::Invalid`] for a manifest that is not what svl writes.
    pub fn new(runs: &[ScoredRun]) -> Result<Self> {
        let [first, others @ ..] = runs else {
            return Ok(Self::over_common(runs, Vec::new()));
        };
        let mut cautions = Vec::new();
        for other in others {
            let purpose = match first.drives[..] {
                [] => Purpose::Compare,
                _ => Purpose::CompareDrives,
            };
            let differences = first.manifest.differences(&other.manifest, purpose)?;
            if !differences.is_empty() {
                let differences = differences.join("; ");
                let name = other.name.display();
                cautions.push(format!("{name} was scored differently ({differences})"));
            }
        }
        let incomplete = runs.iter().filter_map(|run| {
            let why = run.incomplete.as_ref()?;
            Some(format!("{} is incomplete: {why}", run.name.display()))
        });
        cautions.extend(incomplete);
        Ok(Self::over_common(runs, cautions))
    }

    fn over_common(runs: &[ScoredRun], mut cautions: Vec<String>) -> Self {
        let pairs = |run: &'_ ScoredRun| -> BTreeSet<String> {
            let rows = run.rows.iter().map(|row| format!("{:?}", pair(row)));
            let courses = run.drives.iter().map(|row| row.seed.to_string());
            if run.drives.is_empty() {
                rows.collect()
            } else {
                courses.collect()
            }
        };
        let sets: Vec<_> = runs.iter().map(pairs).collect();
        let is_common = |key: &String| sets.iter().all(|own| own.contains(key));
        let common: BTreeSet<_> = sets.iter().flatten().filter(|key| is_common(key)).collect();
        let most = sets.iter().map(BTreeSet::len).max().unwrap_or_default();
        if common.len() < most {
            let left = counted(most - common.len(), "pair");
            cautions.push(format!(
                "{left} or courses that some reports lack are left out"
            ));
        }
        let mut labels: Vec<&str> = Vec::new();
        for label in runs.iter().rev().flat_map(|run| run.labels()) {
            if !labels.contains(&label) {
                labels.push(label);
            }
        }
        let has = |name: &str| {
            let mut rows = runs.iter().flat_map(|run| &run.rows);
            rows.any(|row| row.metrics.get(name).is_some())
        };
        let kind = match runs.iter().all(|run| run.drives.is_empty()) {
            true => TruthLevel::from_measured(has),
            false => TruthLevel::Courses,
        };
        let mut metrics = ColumnChoice::Headline.metrics(kind);
        metrics.retain(|metric| {
            let is_known = !matches!(metric.origin, MetricOrigin::Checkpoints);
            is_ranked(metric) || is_known && metric.unit != MetricUnit::Ms
        });
        let lines = metrics.iter().flat_map(|metric| {
            labels.iter().map(|label| TrendLine {
                metric,
                algorithm: (*label).to_owned(),
                points: runs
                    .iter()
                    .map(|run| point(run, label, metric, &common))
                    .collect(),
            })
        });
        let is_measured = |line: &TrendLine| line.points.iter().any(Option::is_some);
        Self {
            scenario: runs
                .last()
                .map_or_else(String::new, |run| run.manifest.scenario.clone()),
            reports: runs
                .iter()
                .map(|run| run.name.display().to_string())
                .collect(),
            pairs: common.len(),
            cautions,
            lines: lines.filter(is_measured).collect(),
        }
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
            .map(|lines| {
                let metric = lines[0].metric;
                let unit = metric.unit.name().map(|unit| format!(", {unit}"));
                let words = metric.words.to_owned() + &unit.unwrap_or_default();
                let shown = |value: f64| match metric.unit {
                    MetricUnit::Share => 100.0 * value,
                    _ => value,
                };
                let series = lines.iter().flat_map(|line| {
                    let points = (1..).zip(&line.points);
                    let points = points.filter_map(|(i, own)| Some((f64::from(i), own.as_ref()?)));
                    let points: Vec<_> = points.collect();
                    let values = points
                        .iter()
                        .map(|(i, own)| (*i, shown(own.value)))
                        .collect();
                    let bars = points.iter().filter_map(|(i, own)| {
                        let ends = own.interval?;
                        let ends = [ends.0, ends.1].map(|end| (*i, shown(end))).to_vec();
                        Some(Series::new(&line.algorithm, SeriesStyle::Joined, ends))
                    });
                    let values = Series::new(&line.algorithm, SeriesStyle::Both, values);
                    bars.chain([values]).collect::<Vec<_>>()
                });
                let y = Axis::new(words.clone());
                let svg = Chart::untitled(Axis::new("report"), y, series).svg_in(&colors);
                PlotView::new(&words, "", svg)
            })
            .collect();
        let cautions = joined(&self.cautions);
        let view = context! {
            title => counted(self.reports.len(), "report"), scenario => self.scenario,
            reports => self.reports, pairs => self.pairs, cautions, charts, images => [(); 0],
        };
        fill(
            include_str!("trend.html"),
            "body { max-width: 76rem; }",
            &[],
            view,
        )
    }
}

/// A metric of an algorithm in a report, over pairs or courses that are common.
fn point(
    run: &ScoredRun,
    label: &str,
    metric: &'static Metric,
    common: &BTreeSet<&String>,
) -> Option<TrendPoint> {
    let (own, sample, resamples) = if run.drives.is_empty() {
        let is_own =
            |row: &&Row| row.algorithm == label && common.contains(&format!("{:?}", pair(row)));
        let rows: Vec<_> = run.rows.iter().filter(is_own).collect();
        let own = MetricTotals::new(&rows).measured(metric, run.area)?;
        (own, sample_in(metric, &rows, run.area)?, resamples(&rows))
    } else {
        let is_common = |row: &drives::DriveRow| common.contains(&row.seed.to_string());
        let rows: Vec<_> = run
            .drives
            .iter()
            .filter(|row| is_common(row))
            .cloned()
            .collect();
        let sample = drives::sample(metric, label, &rows)?;
        let cases = Cases::items(sample.items() as u64);
        let value = sample.total()?;
        let resamples = Resamples::draw(&[sample.items()], true);
        (Measured { value, cases }, sample, resamples)
    };
    Some(TrendPoint {
        value: metric.value_of(own)?,
        interval: sample.interval(&resamples),
        cases: own.cases,
    })
}
