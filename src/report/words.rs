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
    Column { group: "", head: "pairs", width: 6, cell: |a| a.pairs.to_string() },
    Column { group: "cells, %", head: "right", width: 5, cell: |a| share_of_cells(a, a.cells_right) },
    Column { group: "cells, %", head: "wrong", width: 5, cell: |a| share_of_cells(a, a.cells_wrong) },
    Column { group: "cells, %", head: "unknown", width: 7, cell: |a| share_of_cells(a, a.cells_unknown) },
    Column { group: "obstacles", head: "missed", width: 6, cell: |a| count(a.missed_obstacles) },
    Column { group: "obstacles", head: "false", width: 5, cell: |a| count(a.false_obstacles) },
    Column { group: "pixels, %", head: "cover", width: 5, cell: |a| percent(Some(a.coverage)) },
    Column { group: "pixels, %", head: "invalid", width: 7, cell: |a| percent(a.invalid) },
    Column { group: "pixels, %", head: ">1 px", width: 5, cell: |a| percent(a.bad1) },
    Column { group: "pixels, %", head: ">2 px", width: 5, cell: |a| percent(a.bad2) },
    Column { group: "ms per pair", head: "p50", width: 7, cell: |a| ms(a.p50_ms) },
    Column { group: "ms per pair", head: "p99", width: 7, cell: |a| ms(a.p99_ms) },
];

/// What the columns mean, below the table: term and meaning.
pub(super) const NOTES: &[(&str, &str)] = &[
    ("cells", "of those with truth; right within the scenario's tolerance; unknown is not wrong"),
    ("obstacles", "cells truly nearer than 0.5 m reported beyond 0.75 m (missed), and the reverse (false)"),
    ("cover", "pixels with a disparity; a mean over the pairs, as are the next three"),
    ("invalid", "pixels without one, of those with truth that both cameras see"),
    (">1 px, >2 px", "pixels off by more, of those with truth that both cameras see and a disparity"),
    ("p50, p99", "by nearest rank, so that p99 is the slowest pair where there are fewer than 100"),
];

/// A share as a percentage with one decimal.
pub(super) fn percent(share: Option<f64>) -> String {
    share.map_or_else(|| NONE.to_owned(), |s| format!("{:.1}", 100.0 * s))
}

pub(super) fn ms(time_ms: f64) -> String {
    format!("{time_ms:.2}")
}

/// Whether a frame passed.
pub(super) fn pass(passed: Option<bool>) -> &'static str {
    match passed {
        Some(true) => "pass",
        Some(false) => "fail",
        None => NONE,
    }
}

fn count(number: Option<u64>) -> String {
    number.map_or_else(|| NONE.to_owned(), |n| n.to_string())
}

fn share_of_cells(algorithm: &AlgorithmSummary, number: Option<u64>) -> String {
    let cells = algorithm.cells().filter(|&n| n > 0);
    percent(number.zip(cells).map(|(number, cells)| number as f64 / cells as f64))
}

/// The checkpoints as a table: a line each, then their sum.
pub(super) struct Checkpoints<'a> {
    /// What the columns are, in order of the summary.
    pub(super) algorithms: Vec<&'a str>,
    pub(super) lines: Vec<Line<'a>>,
}

/// A line of [`Checkpoints`] with a cell for every algorithm.
pub(super) struct Line<'a> {
    pub(super) name: String,
    /// Nothing where the algorithm never came to the checkpoint's table.
    pub(super) cells: Vec<Option<&'a CheckpointSummary>>,
}

/// The sum of one algorithm's checkpoints: best frames passed, worst frames passed (`5/6`), share of frames passed (%).
pub(super) fn totals(summary: &Summary, algorithm: &str) -> [String; 3] {
    let own: Vec<_> = summary.checkpoints.iter().filter(|c| c.algorithm == algorithm).collect();
    let of = |passed: fn(&CheckpointSummary) -> Option<bool>| {
        format!("{}/{}", own.iter().filter(|c| passed(c) == Some(true)).count(), own.len())
    };
    let frames: u64 = own.iter().map(|c| c.frames).sum();
    let passed: u64 = own.iter().map(|c| c.passed).sum();
    let share = (frames > 0).then(|| passed as f64 / frames as f64);
    [of(|c| c.best_passed), of(|c| c.worst_passed), percent(share)]
}

impl<'a> Checkpoints<'a> {
    pub(super) fn of(summary: &'a Summary) -> Self {
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
        let cell = |number, algorithm: &&str| {
            summary.checkpoints.iter().find(|c| c.checkpoint == number && c.algorithm == *algorithm)
        };
        let line = |&(number, name): &(u32, &str)| Line {
            name: format!("{number} {name}"),
            cells: algorithms.iter().map(|algorithm| cell(number, algorithm)).collect(),
        };
        let lines = numbers.iter().map(line).collect();
        Self { algorithms, lines }
    }
}
