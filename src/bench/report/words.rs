//! Columns, notes and number formats of a summary, shared by terminal, Markdown and HTML.

use super::summary::{AlgorithmSummary, CheckpointSummary, FailedAlgorithm, Summary};
use svl_core::counted;
use svl_data::score::{METRICS, Metric, MetricUnit};

/// Shown for a number that does not exist.
pub(super) const NONE: &str = "–";

/// A column of a table with a line per algorithm.
pub(super) struct Column {
    /// Heads the column and its neighbours of the same group.
    pub(super) group: &'static str,
    pub(super) head: &'static str,
    /// Characters it takes on the terminal.
    pub(super) width: usize,
    number: ColumnSource,
}

enum ColumnSource {
    Metric(&'static Metric),
    Summary(fn(&AlgorithmSummary) -> String),
}

impl Column {
    const fn new(
        group: &'static str,
        head: &'static str,
        width: usize,
        number: fn(&AlgorithmSummary) -> String,
    ) -> Self {
        Self {
            group,
            head,
            width,
            number: ColumnSource::Summary(number),
        }
    }

    fn is_metric(&self) -> bool {
        matches!(self.number, ColumnSource::Metric(_))
    }

    /// Its number of an algorithm in words.
    pub(super) fn cell(&self, summary: &AlgorithmSummary) -> String {
        match self.number {
            ColumnSource::Metric(metric) => summary
                .value(metric)
                .map_or_else(|| NONE.to_owned(), |value| number(metric.unit, value)),
            ColumnSource::Summary(number) => number(summary),
        }
    }
}

/// The table of algorithms, after the algorithm's name: the metrics of frames, and the time.
pub(super) fn columns() -> Vec<Column> {
    let metrics = METRICS.iter().filter(|metric| metric.column().is_some());
    let metrics = metrics.map(|metric| Column {
        group: metric.group,
        head: metric.head,
        // At least as wide as 100.0.
        width: metric.head.chars().count().max(5),
        number: ColumnSource::Metric(metric),
    });
    let pairs = Column::new("", PAIRS, 6, |a| a.pairs.to_string());
    let times = [
        Column::new("ms per pair", "p50", 7, |a| ms(a.p50_ms)),
        Column::new("ms per pair", "p99", 7, |a| ms(a.p99_ms)),
        Column::new("", "MB", 6, |a| digits(a.memory_mb)),
    ];
    std::iter::once(pairs).chain(metrics).chain(times).collect()
}

/// The table of speeds, likewise.
pub(super) fn speed_columns() -> Vec<Column> {
    let column = Column::new;
    vec![
        column("ms per pair", "p50", 7, |a| ms(a.p50_ms)),
        column("ms per pair", "p95", 7, |a| ms(a.p95_ms)),
        column("ms per pair", "p99", 7, |a| ms(a.p99_ms)),
        column("ms per pair", "max", 7, |a| ms(a.max_ms)),
        column("by size", "s/MP", 7, |a| digits(Some(a.time_per_mp_s))),
        column("by size", "s/GD", 7, |a| digits(a.time_per_gd_s)),
        column("by size", "MDE/s", 6, |a| digits(a.mde_per_s)),
        column("stages, ms", "smoothing", 9, |a| ms(a.smoothing_ms)),
        column("stages, ms", "texture", 7, |a| ms(a.texture_ms)),
        column("stages, ms", "matching", 8, |a| ms(a.matching_ms)),
        column("stages, ms", "checks", 6, |a| ms(a.checks_ms)),
        column("stages, ms", "filters", 7, |a| match a.filters_ms > 0.0 {
            true => ms(a.filters_ms),
            false => NONE.to_owned(),
        }),
        column("stages, ms", "other", 6, |a| ms(a.other_ms)),
    ]
}

/// The columns in which some algorithm has a number.
pub(super) fn shown(mut columns: Vec<Column>, summary: &Summary) -> Vec<Column> {
    columns.retain(|column| summary.algorithms.iter().any(|a| column.cell(a) != NONE));
    columns
}

/// A line per algorithm: its name and its cells, those that failed on every pair last.
pub(super) fn lines<'a>(
    columns: &[Column],
    summary: &'a Summary,
) -> impl Iterator<Item = (&'a str, Vec<String>)> {
    let line = |a: &'a AlgorithmSummary| {
        let cells = columns.iter().map(|column| column.cell(a));
        (a.algorithm.as_str(), cells.collect())
    };
    let failed = |failed: &'a FailedAlgorithm| {
        let cell = |column: &Column| if column.head == PAIRS { "0" } else { NONE };
        let cells = columns.iter().map(|column| cell(column).to_owned());
        (failed.algorithm.as_str(), cells.collect())
    };
    let failed = summary
        .failed
        .iter()
        .filter(|f| f.on_every_pair)
        .map(failed);
    summary.algorithms.iter().map(line).chain(failed)
}

const PAIRS: &str = "pairs";

/// What the columns of times mean: term and meaning.
const TIME_NOTES: &[(&str, &str)] = &[
    (
        "p50, p99",
        "by nearest rank, so that p99 is the slowest pair where there are fewer than 100",
    ),
    (
        "s/MP, s/GD",
        "seconds per million pixels, and per 10⁹ pixels times disparities tried: of the median \
         pair",
    ),
    (
        "MDE/s",
        "million pixels times disparities tried a second: of the median pair",
    ),
    ("MB", "memory for the largest pair, disparity map included"),
    (
        "stages",
        "means over the half of the pairs nearest to the median; other: what belongs to no stage",
    ),
];

/// The notes on those columns, which stand below their table.
pub(super) fn notes(columns: &[Column], summary: &Summary) -> Vec<(&'static str, String)> {
    let metrics = columns.iter().filter_map(|column| match column.number {
        ColumnSource::Metric(metric) => metric.note,
        ColumnSource::Summary(_) => None,
    });
    let times = TIME_NOTES.iter().filter(|(term, _)| {
        columns
            .iter()
            .any(|c| c.group.starts_with(term) || term.contains(c.head))
    });
    let times = times.map(|(term, meaning)| (*term, (*meaning).to_owned()));
    // Obstacles have a distance, so they are counted where there is a calibration.
    let mut algorithms = summary.algorithms.iter();
    let has_rig = algorithms.any(|algorithm| algorithm.totals.get("missed").is_some());
    let rule = summary.rule.for_rig(has_rig);
    let metrics = metrics.map(|note| note(rule));
    let has_times = columns.iter().any(|column| column.head == "p99");
    let of_times = summary.times.clone().map(|times| ("times", times));
    let programs = summary.programs.iter();
    let programs = programs.map(|p| ("program", format!("{}: {}", p.algorithm, p.program.words())));
    let profile = summary.slow_profile.clone().map(|words| ("build", words));
    let of_times = of_times
        .into_iter()
        .chain(profile)
        .chain(outliers(summary))
        .chain(programs);
    let times = times.chain(of_times.filter(|_| has_times));
    let absent = absent(summary).map(|words| ("no truth", words));
    let absent = absent.filter(|_| columns.iter().any(|column| column.is_metric()));
    let choices = summary.choices().into_iter();
    let choices = choices.filter(|_| columns.iter().any(|column| column.is_metric()));
    let failed = failed(summary).filter(|_| columns.iter().any(|c| c.head == PAIRS));
    let failed = failed.map(|words| ("failed", words));
    let scored = scored(summary).filter(|_| columns.iter().any(|column| column.is_metric()));
    let scored = scored.map(|words| ("scored", words));
    let metrics = failed.into_iter().chain(scored).chain(metrics);
    metrics.chain(times).chain(absent).chain(choices).collect()
}

/// Numbers of pairs and cells with a ground truth: once where all algorithms agree, else of each.
fn scored(summary: &Summary) -> Option<String> {
    let of = summary.algorithms.iter();
    let of = of.filter_map(|a| Some((a.algorithm.as_str(), a.scored_cells?, a.scored_pairs?)));
    let of: Vec<_> = of.collect();
    let words = |cells: u64, pairs: u64| {
        format!("{} of {}", counted(cells, "cell"), counted(pairs, "pair"))
    };
    let (_, cells, pairs) = *of.first()?;
    if of.iter().all(|other| (other.1, other.2) == (cells, pairs)) {
        return Some(format!(
            "{}, which have a ground truth",
            words(cells, pairs)
        ));
    }
    let each = of
        .iter()
        .map(|(name, cells, pairs)| format!("{name} {}", words(*cells, *pairs)));
    Some(each.collect::<Vec<_>>().join("; "))
}

/// The algorithms that failed on pairs, with the reasons.
pub(super) fn failed(summary: &Summary) -> Option<String> {
    let failed = summary.failed.iter();
    let failed = failed.map(|f| {
        let pairs = match f.on_every_pair {
            true => "every pair".to_owned(),
            false => counted(f.pairs, "pair"),
        };
        format!("{} on {pairs}: {}", f.algorithm, f.reason)
    });
    let words = failed.collect::<Vec<_>>().join("; ");
    (!words.is_empty()).then_some(words)
}

/// Which algorithms have outliers among their times.
fn outliers(summary: &Summary) -> Option<(&'static str, String)> {
    // Else svl's own reading and writing makes them.
    let of = summary
        .algorithms
        .iter()
        .filter(|a| summary.measured && a.outliers > 0);
    let of = of.map(|a| {
        format!(
            "{} of {}'s {}",
            a.outliers,
            a.algorithm,
            counted(a.pairs, "pair")
        )
    });
    let of: Vec<_> = of.collect();
    let cure = "the machine was busy; an idle one, or --repeat, gives better times";
    // Of a long search the number says enough.
    let words = match of.len() {
        0 => return None,
        1..=8 => format!("{} took far longer than the others: {cure}", of.join(", ")),
        n => format!("{n} algorithms have pairs that took far longer than the others: {cure}"),
    };
    Some(("outliers", words))
}

/// Which columns are not there as the run has no truth.
fn absent(summary: &Summary) -> Option<String> {
    let against = METRICS.iter().filter(|metric| metric.against_truth);
    let measured = |metric: &&Metric| {
        let mut algorithms = summary.algorithms.iter();
        algorithms.any(|algorithm| algorithm.value(metric).is_some())
    };
    if summary.algorithms.is_empty() || against.clone().any(|metric| measured(&metric)) {
        return None;
    }
    let heads: Vec<_> = against.map(|metric| metric.head).collect();
    Some(format!(
        "{} are not shown, as they need it",
        heads.join(", ")
    ))
}

/// A value in a table, whose head says the unit.
pub(super) fn number(unit: MetricUnit, value: f64) -> String {
    match unit {
        MetricUnit::Share => format!("{:.1}", 100.0 * value),
        MetricUnit::Count => format!("{value:.0}"),
        MetricUnit::Px => format!("{value:.2}"),
        MetricUnit::Per100M => format!("{value:.1}"),
        MetricUnit::Ms => ms(value),
    }
}

/// A share as a percentage with one decimal.
pub(super) fn percent(share: Option<f64>) -> String {
    share.map_or_else(|| NONE.to_owned(), |s| format!("{:.1}", 100.0 * s))
}

pub(super) fn ms(time_ms: f64) -> String {
    format!("{time_ms:.2}")
}

/// Three digits that count.
fn digits(number: Option<f64>) -> String {
    let Some(number) = number else {
        return NONE.to_owned();
    };
    // Digits before the decimal point; negative for leading zeros behind it.
    let whole = if number > 0.0 {
        number.log10().floor() as i32 + 1
    } else {
        1
    };
    format!("{number:.*}", (3 - whole).clamp(0, 6) as usize)
}

/// What is said of a checkpoint that no frame shows.
pub(super) const NEVER_SEEN: &str = "never seen";

/// How the cells of the table of checkpoints are read.
pub(super) const VERDICTS: &str = "✓ passes, ✗ fails: best, then worst frame of all runs; number: \
                                   share of the frames that pass, %";

/// A mark for a frame that passed or failed.
pub(super) fn mark(passed: bool) -> char {
    if passed { '✓' } else { '✗' }
}

/// The checkpoints as a table: a line per algorithm, a column per checkpoint and one for all of
/// them.
pub(super) struct Checkpoints<'a> {
    /// Heads of the columns, the last being that of all.
    pub(super) heads: Vec<String>,
    /// Each algorithm with its cells.
    pub(super) lines: Vec<(&'a str, Vec<CheckpointCell>)>,
}

/// A checkpoint's verdict on an algorithm, or the sum of all.
#[derive(Clone, Copy)]
pub(super) enum CheckpointCell {
    NeverSeen,
    Seen {
        best: bool,
        worst: bool,
        share: f64,
    },
    /// Of how many checkpoints the best frames pass, the worst frames pass; share of the frames of
    /// all.
    All {
        seen: usize,
        best: usize,
        worst: usize,
        share: f64,
    },
}

impl CheckpointCell {
    fn new(checkpoint: Option<&CheckpointSummary>) -> Self {
        let seen = checkpoint.and_then(|c| {
            Some(Self::Seen {
                best: c.best_passed?,
                worst: c.worst_passed?,
                share: c.share()?,
            })
        });
        seen.unwrap_or(Self::NeverSeen)
    }

    /// Over the checkpoints of one algorithm that some frame shows.
    fn all<'a>(checkpoints: impl Iterator<Item = &'a CheckpointSummary>) -> Self {
        let seen: Vec<_> = checkpoints.filter(|c| c.frames > 0).collect();
        let count = |passed: fn(&CheckpointSummary) -> Option<bool>| {
            seen.iter().filter(|c| passed(c) == Some(true)).count()
        };
        let sum =
            |of: fn(&CheckpointSummary) -> u64| seen.iter().map(|c| of(c)).sum::<u64>() as f64;
        if seen.is_empty() {
            return Self::NeverSeen;
        }
        let share = sum(|c| c.passed) / sum(|c| c.frames);
        Self::All {
            seen: seen.len(),
            best: count(|c| c.best_passed),
            worst: count(|c| c.worst_passed),
            share,
        }
    }
}

impl std::fmt::Display for CheckpointCell {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match *self {
            Self::NeverSeen => f.write_str(NEVER_SEEN),
            Self::Seen { best, worst, share } => {
                write!(
                    f,
                    "{}{} {:>5}",
                    mark(best),
                    mark(worst),
                    percent(Some(share))
                )
            }
            Self::All {
                seen,
                best,
                worst,
                share,
            } => {
                write!(
                    f,
                    "{best}/{seen} {worst}/{seen} {:>5}",
                    percent(Some(share))
                )
            }
        }
    }
}

impl<'a> Checkpoints<'a> {
    /// Nothing when the run has no checkpoints.
    pub(super) fn from_summary(summary: &'a Summary) -> Option<Self> {
        let mut algorithms: Vec<&str> = Vec::new();
        let mut numbers: Vec<(u32, &str)> = Vec::new();
        for c in &summary.checkpoints {
            if !algorithms.contains(&c.algorithm.as_str()) {
                algorithms.push(&c.algorithm);
            }
            if !numbers.iter().any(|(number, _)| *number == c.checkpoint) {
                numbers.push((c.checkpoint, &c.name));
            }
        }
        let line = |algorithm: &'a str| {
            let own = || {
                summary
                    .checkpoints
                    .iter()
                    .filter(move |c| c.algorithm == algorithm)
            };
            let cells = numbers
                .iter()
                .map(|(number, _)| CheckpointCell::new(own().find(|c| c.checkpoint == *number)));
            (
                algorithm,
                cells.chain([CheckpointCell::all(own())]).collect(),
            )
        };
        let heads = numbers
            .iter()
            .map(|(number, name)| format!("{number} {name}"))
            .chain(["all".to_owned()]);
        let lines: Vec<_> = algorithms.iter().map(|algorithm| line(algorithm)).collect();
        (!lines.is_empty()).then(|| Self {
            heads: heads.collect(),
            lines,
        })
    }
}
