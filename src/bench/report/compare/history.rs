//! Reports in the order of their dates: each metric over svl's revisions.

use super::ScoredRun;
use crate::report::page::{PlotView, fill};
use crate::report::plot::{Axis, Chart, Series, SeriesStyle};
use crate::report::samples::{RunKey, run_key};
use crate::report::table::{NONE, Table, TableColumn, TerminalStyle, wrapped};
use crate::report::{Row, Summary};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use svl_core::{Error, Result};
use svl_data::manifest::Purpose;
use svl_data::score::{METRICS, Metric, MetricOrigin, MetricUnit};

/// Every metric of the reports of equal scenarios, over their dates.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct History {
    /// By scenario, in the order of their first reports.
    pub scenarios: Vec<ScenarioHistory>,
    /// Names that are left out: reports that a later one replaced, and whatever is not a
    /// report.
    pub left_out: Vec<LeftOut>,
}

/// A folder that is not a part of a history.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct LeftOut {
    pub path: PathBuf,
    pub reason: &'static str,
}

/// The reports of one scenario.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ScenarioHistory {
    pub scenario: String,
    /// By date.
    pub reports: Vec<HistoryReport>,
    /// The number of pairs that all reports have, on which they are compared; absent for drives.
    pub pairs: Option<usize>,
    /// Algorithms that do not have the same pairs in all reports, with the number that they are
    /// compared on.
    pub fewer: Vec<(String, usize)>,
    pub lines: Vec<HistoryLine>,
}

/// A report, and the svl and the machine that made it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct HistoryReport {
    pub folder: PathBuf,
    /// RFC 3339, UTC.
    pub began: String,
    /// Git revision of svl, where its build knew it.
    pub revision: Option<String>,
    pub processor: String,
    /// The number of its pairs; absent for drives.
    pub pairs: Option<usize>,
    /// Reason why it is incomplete.
    pub incomplete: Option<String>,
}

/// A metric of an algorithm in each report, absent if the report does not have it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HistoryLine {
    pub algorithm: String,
    pub metric: &'static Metric,
    /// The processor that a time is of: times of several machines are not joined.
    pub processor: Option<String>,
    pub values: Vec<Option<f64>>,
}

/// A pair of a report: seed and recording, number, and hash of all that it was scored on.
type HistoryPair<'a> = (RunKey<'a>, u64, &'a str);

fn pair(row: &Row) -> HistoryPair<'_> {
    (run_key(row), row.sequence, row.input_hash.as_str())
}

/// A report with its pairs, and per label those that the algorithm has a result of.
struct PairedReport<'a> {
    run: &'a ScoredRun,
    pairs: BTreeSet<HistoryPair<'a>>,
    of_algorithms: BTreeMap<&'a str, BTreeSet<HistoryPair<'a>>>,
}

impl<'a> PairedReport<'a> {
    fn new(run: &'a ScoredRun) -> Self {
        let mut of_algorithms = BTreeMap::<_, BTreeSet<_>>::new();
        for row in &run.rows {
            let own = of_algorithms.entry(row.algorithm.as_str()).or_default();
            own.insert(pair(row));
        }
        Self {
            run,
            pairs: run.rows.iter().map(pair).collect(),
            of_algorithms,
        }
    }
}

/// The pairs that are in all of these sets.
fn common_pairs<'p, 'a: 'p>(
    sets: impl IntoIterator<Item = &'p BTreeSet<HistoryPair<'a>>>,
) -> BTreeSet<HistoryPair<'a>> {
    let mut sets = sets.into_iter();
    let first = sets.next().cloned().unwrap_or_default();
    sets.fold(first, |a, b| a.intersection(b).copied().collect())
}

impl History {
    /// Puts reports in order. Folders whose names end with `.earlier-N` hold what a later report
    /// replaced, and are left out, as is anything else that is not a report: a shell's `reports/*`
    /// names that too.
    ///
    /// # Errors
    /// [`Error::Invalid`] where there is no report; as [`ScoredRun::named`] and
    /// [`Summary::from_rows`].
    pub fn from_reports(names: &[String]) -> Result<Self> {
        let (mut runs, mut left_out) = (Vec::new(), Vec::new());
        for name in names {
            let folder = PathBuf::from(name);
            let file = folder.file_name().unwrap_or_default().to_string_lossy();
            let reason = if file.contains(".earlier-") {
                Some("a later report replaced it")
            } else if folder.exists() && !folder.join("manifest.json").is_file() {
                Some("not a report of `svl score`")
            } else {
                None
            };
            match reason {
                Some(reason) => left_out.push(LeftOut {
                    path: folder,
                    reason,
                }),
                None => runs.push(ScoredRun::named(name)?),
            }
        }
        if runs.is_empty() {
            let what = "none of these is a report of `svl score`; name some, or reports/*";
            return Err(Error::Invalid(what.to_owned()));
        }
        runs.sort_by(|a, b| a.manifest.began.cmp(&b.manifest.began));
        let mut scenarios: Vec<Vec<PairedReport<'_>>> = Vec::new();
        for run in &runs {
            let report = PairedReport::new(run);
            let mut own = None;
            for of in &mut scenarios {
                let (first, manifest) = (&of[0], &of[0].run.manifest);
                let differences = manifest.differences(&run.manifest, Purpose::History)?;
                let has_common = || !first.pairs.is_disjoint(&report.pairs);
                if differences.is_empty() && (!run.drives.is_empty() || has_common()) {
                    own = Some(of);
                    break;
                }
            }
            match own {
                Some(of) => of.push(report),
                None => scenarios.push(vec![report]),
            }
        }
        let scenarios = scenarios.iter().map(|runs| ScenarioHistory::new(runs));
        Ok(Self {
            scenarios: scenarios.collect::<Result<_>>()?,
            left_out,
        })
    }

    /// The reports of each scenario, and a line per algorithm and metric.
    pub fn terminal(&self, style: TerminalStyle) -> String {
        let mut parts = Vec::new();
        for scenario in &self.scenarios {
            let reports = scenario.report_table().terminal(style);
            let notes = scenario.notes().into_iter();
            let notes: String = notes.map(|note| wrapped(&note, 2, style.width)).collect();
            let lines = scenario.line_table().terminal(style);
            let name = &scenario.scenario;
            parts.push(format!("{name}\n{reports}{notes}\n{lines}"));
        }
        let mut text = parts.join("\n");
        for LeftOut { path, reason } in &self.left_out {
            text.push_str(&format!("{}: left out, {reason}\n", path.display()));
        }
        text
    }

    /// The page with a plot per metric: one file without scripts, all texts escaped.
    ///
    /// # Errors
    /// [`svl_core::Error::Invalid`] with what the template engine or the plotting library says.
    pub fn page(&self) -> Result<String> {
        let scenarios = self.scenarios.iter().map(|scenario| {
            Ok(ScenarioView {
                scenario: &scenario.scenario,
                reports: scenario.report_table(),
                notes: scenario.notes(),
                plots: scenario.plots()?,
            })
        });
        let view = HistoryView {
            scenarios: scenarios.collect::<Result<_>>()?,
            left_out: &self.left_out,
            images: [],
            identity: [],
            incomplete: None,
        };
        fill(include_str!("history.html"), "", view)
    }

    /// Writes each plot of the page as an SVG file into a folder.
    ///
    /// # Errors
    /// As [`History::page`]; [`Error::Io`] with the file.
    pub fn write_figures(&self, folder: &Path) -> Result<()> {
        for scenario in &self.scenarios {
            for plot in scenario.plots()? {
                plot.write(folder, &scenario.scenario)?;
            }
        }
        Ok(())
    }
}

impl ScenarioHistory {
    fn new(reports: &[PairedReport<'_>]) -> Result<Self> {
        let runs: Vec<_> = reports.iter().map(|report| report.run).collect();
        let is_driven = runs.iter().any(|run| !run.drives.is_empty());
        let common = common_pairs(reports.iter().map(|report| &report.pairs));
        // Pairs that an algorithm failed on in one report are not its own in the others.
        let labels = reports
            .iter()
            .flat_map(|report| report.of_algorithms.keys());
        let labels: BTreeSet<_> = labels.copied().collect();
        let of_algorithms = labels.into_iter().map(|label| {
            let own = || reports.iter().filter_map(|of| of.of_algorithms.get(label));
            let common = common_pairs(own());
            let is_whole = own().all(|own| own.len() == common.len());
            (label, (common, is_whole))
        });
        let of_algorithms: BTreeMap<_, _> = of_algorithms.collect();
        // Checkpoints are of whole runs.
        let are_equal = of_algorithms.values().all(|(_, is_whole)| *is_whole);
        let summaries = runs.iter().map(|run| {
            let is_common = |row: &&Row| {
                let common = of_algorithms.get(row.algorithm.as_str());
                is_driven || common.is_some_and(|(common, _)| common.contains(&pair(row)))
            };
            let rows: Vec<_> = run.rows.iter().filter(is_common).cloned().collect();
            let checkpoints = if are_equal { &run.checkpoints[..] } else { &[] };
            let mut summary = Summary::from_rows(&rows, checkpoints)?;
            summary.add_drives(&run.drives);
            Ok(summary)
        });
        let summaries = summaries.collect::<Result<Vec<_>>>()?;
        let mut algorithms: Vec<&str> = Vec::new();
        for summary in summaries.iter().flat_map(|summary| &summary.algorithms) {
            if !algorithms.contains(&summary.algorithm.as_str()) {
                algorithms.push(&summary.algorithm);
            }
        }
        let processor = |run: &ScoredRun| run.manifest.machine.processor.clone();
        let processors: BTreeSet<_> = runs.iter().map(|run| processor(run)).collect();
        let of_machine = |metric: &Metric| match metric.origin {
            MetricOrigin::Time => processors.iter().cloned().map(Some).collect(),
            _ => vec![None],
        };
        let line = |algorithm: &str, metric: &'static Metric, own: Option<String>| {
            let reports = summaries.iter().zip(&runs);
            let value = |(summary, run): (&Summary, &&ScoredRun)| {
                let is_own = own
                    .as_ref()
                    .is_none_or(|own| run.has_times() && *own == processor(run));
                is_own.then(|| summary.value(algorithm, metric, None))?
            };
            HistoryLine {
                algorithm: algorithm.to_owned(),
                metric,
                values: reports.map(value).collect(),
                processor: own,
            }
        };
        let mut lines = Vec::new();
        for algorithm in algorithms {
            for metric in METRICS {
                let own = of_machine(metric).into_iter();
                lines.extend(own.map(|own| line(algorithm, metric, own)));
            }
        }
        lines.retain(|line| line.values.iter().any(Option::is_some));
        let report = |PairedReport { run, pairs, .. }: &PairedReport<'_>| HistoryReport {
            folder: run.folder.clone(),
            began: run.manifest.began.clone(),
            revision: run.manifest.git_revision.clone(),
            processor: processor(run),
            pairs: (!is_driven).then_some(pairs.len()),
            incomplete: run.incomplete.clone(),
        };
        Ok(Self {
            scenario: runs[0].manifest.scenario.clone(),
            reports: reports.iter().map(report).collect(),
            pairs: (!is_driven).then_some(common.len()),
            fewer: of_algorithms
                .iter()
                .filter(|(_, (_, is_whole))| !is_driven && !is_whole)
                .map(|(label, (common, _))| ((*label).to_owned(), common.len()))
                .collect(),
            lines,
        })
    }

    /// True if the reports are of several machines.
    fn has_machines(&self) -> bool {
        let processors = self.reports.windows(2);
        processors
            .into_iter()
            .any(|two| two[0].processor != two[1].processor)
    }

    /// Notes on the pairs that are compared, if not all are, a line each.
    fn notes(&self) -> Vec<String> {
        let common = self.uneven();
        let common = common.map(|common| format!("Compared on the {common} pairs of all reports."));
        let fewer = self.fewer.iter();
        let fewer = fewer.map(|(label, n)| format!("{label}: compared on its {n} common pairs."));
        let mut notes: Vec<_> = common.into_iter().chain(fewer).collect();
        if !notes.is_empty() {
            notes.push("Checkpoints are of whole runs, so they are not compared.".to_owned());
        }
        notes
    }

    /// The number of common pairs, if not all reports have the same ones.
    fn uneven(&self) -> Option<usize> {
        let mut reports = self.reports.iter();
        self.pairs
            .filter(|common| reports.any(|report| report.pairs != Some(*common)))
    }

    fn plots(&self) -> Result<Vec<PlotView>> {
        let plot = |metric: &'static Metric| {
            let own = self.lines.iter().filter(|line| line.metric == metric);
            let series: Vec<_> = own
                .map(|line| Series {
                    name: match &line.processor {
                        Some(processor) if self.has_machines() => {
                            format!("{}, {processor}", line.algorithm)
                        }
                        _ => line.algorithm.clone(),
                    },
                    form: SeriesStyle::Both,
                    points: (1..)
                        .zip(&line.values)
                        .map(|(i, value)| (f64::from(i), shown(metric, *value)))
                        .collect(),
                })
                .collect();
            let y = match metric.unit {
                MetricUnit::Share => Axis::share(format!("{}, %", metric.name)),
                MetricUnit::Count => Axis::new(metric.name),
                MetricUnit::Px => Axis::new(format!("{}, px", metric.name)),
                MetricUnit::Ms => Axis::new(format!("{}, ms", metric.name)),
                MetricUnit::Per100M => Axis::new(format!("{} per 100 m", metric.name)),
            };
            let chart = Chart {
                title: String::new(),
                x: Axis {
                    range: Some((0.5, self.reports.len() as f64 + 0.5)),
                    ..Axis::new("report")
                },
                y,
                series,
            };
            (!chart.series.is_empty()).then(|| {
                Ok(PlotView {
                    title: metric.name.into(),
                    about: metric.words,
                    svg: chart.svg()?,
                })
            })
        };
        METRICS.iter().filter_map(plot).collect()
    }
}

/// The value of a metric for a plot; not finite if it is absent.
fn shown(metric: &Metric, value: Option<f64>) -> f64 {
    let scale = match metric.unit {
        MetricUnit::Share => 100.0,
        MetricUnit::Count | MetricUnit::Px | MetricUnit::Ms | MetricUnit::Per100M => 1.0,
    };
    value.map_or(f64::NAN, |value| scale * value)
}

impl ScenarioHistory {
    /// The reports, with the numbers of their pairs if these differ.
    fn report_table(&self) -> Table {
        let mut table = Table::new("", "report").with_texts(["began", "revision"]);
        table.columns.push(TableColumn::new("", "pairs"));
        table.columns.push(TableColumn {
            is_optional: true,
            ..TableColumn::text("", "processor")
        });
        table.columns.push(TableColumn::text("", "folder"));
        for (i, report) in (1..).zip(&self.reports) {
            let revision = report.revision.as_deref().unwrap_or("unknown");
            let pairs = report.pairs.filter(|_| self.uneven().is_some());
            let folder = report.folder.display().to_string();
            let cells = [
                report.began.clone(),
                revision.to_owned(),
                pairs.map(|n| n.to_string()).unwrap_or_default(),
                report.processor.clone(),
                match &report.incomplete {
                    Some(why) => format!("{folder}, incomplete: {why}"),
                    None => folder,
                },
            ];
            table.push(i.to_string(), cells);
        }
        table.remove_empty_columns();
        table
    }

    fn line_table(&self) -> Table {
        let table = Table::new("", "algorithm").with_texts(["metric", "over the reports"]);
        let mut table = table.with_columns(["first", "last"]);
        for line in &self.lines {
            let show = |value: Option<&Option<f64>>| {
                let value = value.copied().flatten();
                value.map_or(NONE.to_owned(), |value| line.metric.show(value))
            };
            let (first, last) = (show(line.values.first()), show(line.values.last()));
            let metric = line.metric.name.to_owned();
            let cells = [metric, sparkline(&line.values), first, last];
            table.push(&line.algorithm, cells);
        }
        table
    }
}

/// A block per report, from the least value to the greatest: the last twenty.
fn sparkline(values: &[Option<f64>]) -> String {
    let last = &values[values.len().saturating_sub(20)..];
    let finite = || last.iter().flatten();
    let low = finite().copied().fold(f64::INFINITY, f64::min);
    let high = finite().copied().fold(f64::NEG_INFINITY, f64::max);
    let block = |value: &Option<f64>| match value {
        None => ' ',
        // All equal: in the middle.
        Some(_) if high <= low => '▄',
        Some(value) => {
            let level = 7.0 * (value - low) / (high - low);
            ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'][level.round() as usize]
        }
    };
    last.iter().map(block).collect()
}

#[derive(Serialize)]
struct HistoryView<'a> {
    scenarios: Vec<ScenarioView<'a>>,
    left_out: &'a [LeftOut],
    images: [(); 0],
    identity: [(); 0],
    incomplete: Option<&'a str>,
}

#[derive(Serialize)]
struct ScenarioView<'a> {
    scenario: &'a str,
    reports: Table,
    notes: Vec<String>,
    plots: Vec<PlotView>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sparklines_span_their_values() {
        let line = |values: &[Option<f64>]| sparkline(values);
        assert_eq!(line(&[Some(1.0), None, Some(2.0), Some(1.5)]), "▁ █▅");
        assert_eq!(line(&[Some(3.0), Some(3.0)]), "▄▄");
        assert_eq!(line(&[Some(0.0); 30]).chars().count(), 20);
    }
}
