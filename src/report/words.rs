//! How a summary's numbers are worded, once for terminal, Markdown and HTML.

use super::summary::{AlgorithmSummary, CheckpointSummary, Summary};

/// Stands for a number that does not exist.
pub(super) const NONE: &str = "–";

/// A column of the table of algorithms.
pub(super) struct Column {
    /// Heads the column and its neighbours of the same group.
    pub(super) group: &'static str,
    pub(super) head: &'static str,
    /// Characters it takes on the terminal.
    pub(super) width: usize,
    pub(super) cell: fn(&AlgorithmSummary) -> String,
}

/// The table of algorithms, after the algorithm's name.
pub(super) const COLUMNS: &[Column] = &[
    Column {
        group: "",
        head: "pairs",
        width: 6,
        cell: |a| a.pairs.to_string(),
    },
    Column {
        group: "cells, %",
        head: "right",
        width: 5,
        cell: |a| share_of_cells(a, a.cells_right),
    },
    Column {
        group: "cells, %",
        head: "wrong",
        width: 5,
        cell: |a| share_of_cells(a, a.cells_wrong),
    },
    Column {
        group: "cells, %",
        head: "unknown",
        width: 7,
        cell: |a| share_of_cells(a, a.cells_unknown),
    },
    Column {
        group: "obstacles",
        head: "missed",
        width: 6,
        cell: |a| count(a.missed_obstacles),
    },
    Column {
        group: "obstacles",
        head: "false",
        width: 5,
        cell: |a| count(a.false_obstacles),
    },
    Column {
        group: "pixels, %",
        head: "cover",
        width: 5,
        cell: |a| percent(Some(a.coverage)),
    },
    Column {
        group: "pixels, %",
        head: "invalid",
        width: 7,
        cell: |a| percent(a.invalid),
    },
    Column {
        group: "pixels, %",
        head: ">1 px",
        width: 5,
        cell: |a| percent(a.bad1),
    },
    Column {
        group: "pixels, %",
        head: ">2 px",
        width: 5,
        cell: |a| percent(a.bad2),
    },
    Column {
        group: "ms per pair",
        head: "p50",
        width: 7,
        cell: |a| ms(a.p50_ms),
    },
    Column {
        group: "ms per pair",
        head: "p99",
        width: 7,
        cell: |a| ms(a.p99_ms),
    },
];

/// The table of speeds, likewise.
pub(super) const SPEED: &[Column] = &[
    Column {
        group: "ms per pair",
        head: "p50",
        width: 7,
        cell: |a| ms(a.p50_ms),
    },
    Column {
        group: "ms per pair",
        head: "p95",
        width: 7,
        cell: |a| ms(a.p95_ms),
    },
    Column {
        group: "ms per pair",
        head: "p99",
        width: 7,
        cell: |a| ms(a.p99_ms),
    },
    Column {
        group: "ms per pair",
        head: "max",
        width: 7,
        cell: |a| ms(a.max_ms),
    },
    Column {
        group: "by size",
        head: "s/MP",
        width: 7,
        cell: |a| digits(Some(a.time_per_mp_s)),
    },
    Column {
        group: "by size",
        head: "s/GD",
        width: 7,
        cell: |a| digits(a.time_per_gd_s),
    },
    Column {
        group: "by size",
        head: "MDE/s",
        width: 6,
        cell: |a| digits(a.mde_per_s),
    },
    Column {
        group: "stages, ms",
        head: "smoothing",
        width: 9,
        cell: |a| ms(a.smoothing_ms),
    },
    Column {
        group: "stages, ms",
        head: "texture",
        width: 7,
        cell: |a| ms(a.texture_ms),
    },
    Column {
        group: "stages, ms",
        head: "matching",
        width: 8,
        cell: |a| ms(a.matching_ms),
    },
    Column {
        group: "stages, ms",
        head: "checks",
        width: 6,
        cell: |a| ms(a.checks_ms),
    },
    Column {
        group: "stages, ms",
        head: "other",
        width: 6,
        cell: |a| ms(a.other_ms),
    },
];

/// The columns in which some algorithm has a number.
pub(super) fn shown(columns: &'static [Column], summary: &Summary) -> Vec<&'static Column> {
    let told = |column: &&Column| summary.algorithms.iter().any(|a| (column.cell)(a) != NONE);
    columns.iter().filter(told).collect()
}

/// What the columns mean, below the tables: term and meaning.
const NOTES: &[(&str, &str)] = &[
    (
        "cells",
        "of those with truth; right within the scenario's tolerance; unknown is not wrong",
    ),
    (
        "obstacles",
        "cells truly nearer than 0.5 m reported beyond 0.75 m (missed), and the reverse (false)",
    ),
    (
        "cover",
        "pixels with a disparity; a mean over the pairs, as are the next three",
    ),
    (
        "invalid",
        "pixels without one, of those with truth that both cameras see",
    ),
    (
        ">1 px, >2 px",
        "pixels off by more, of those with truth that both cameras see and a disparity",
    ),
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
    (
        "stages",
        "means over the half of the pairs nearest to the median; other: what belongs to no stage",
    ),
];

/// The notes on those columns.
pub(super) fn notes(columns: &[&Column]) -> Vec<(&'static str, &'static str)> {
    let about = |term: &str| {
        columns
            .iter()
            .any(|c| c.group.starts_with(term) || term.contains(c.head))
    };
    NOTES
        .iter()
        .filter(|(term, _)| about(term))
        .copied()
        .collect()
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

fn count(number: Option<u64>) -> String {
    number.map_or_else(|| NONE.to_owned(), |n| n.to_string())
}

fn share_of_cells(algorithm: &AlgorithmSummary, number: Option<u64>) -> String {
    let cells = algorithm.cells().filter(|&n| n > 0);
    percent(
        number
            .zip(cells)
            .map(|(number, cells)| number as f64 / cells as f64),
    )
}

/// The checkpoints as a table: a line per algorithm, a column per checkpoint and one for all of
/// them.
pub(super) struct Checkpoints<'a> {
    /// Heads of the columns, the last being that of all.
    pub(super) heads: Vec<String>,
    /// Each algorithm with its cells.
    pub(super) lines: Vec<(&'a str, Vec<Cell>)>,
}

/// A checkpoint's verdict on an algorithm, or the sum of all.
#[derive(Clone, Copy)]
pub(super) enum Cell {
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

impl Cell {
    fn of(checkpoint: Option<&CheckpointSummary>) -> Self {
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

impl std::fmt::Display for Cell {
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
    pub(super) fn of(summary: &'a Summary) -> Option<Self> {
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
                .map(|(number, _)| Cell::of(own().find(|c| c.checkpoint == *number)));
            (algorithm, cells.chain([Cell::all(own())]).collect())
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
