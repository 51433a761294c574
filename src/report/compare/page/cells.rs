//! A frame of the page: its cells before, after, and in truth.

use crate::compare::frames::ChangedFrame;
use crate::page::{PageImages, PictureView};
use crate::rows::CellRow;
use serde::Serialize;
use svl_core::stereo::{CellState, GridShape};
use svl_files::overlay::Rect;
use svl_score::judge::Verdict;

/// Limit of the cells that the caption lists.
const MAX_LISTED: usize = 3;
/// Metrics that the caption counts, with their words.
const COUNTS: [(&str, &str); 5] = [
    ("right", "right"),
    ("wrong", "wrong"),
    ("unknown", "unknown"),
    ("missed", "missed near obstacles"),
    ("false", "false ones"),
];

#[derive(Serialize)]
pub(super) struct ChangedFrameView<'a> {
    origin: String,
    /// The reason why it is shown.
    reason: String,
    counts: String,
    /// The cells with another verdict in words, changes of obstacles first.
    changes: Vec<String>,
    panels: Vec<CellsView<'a>>,
}

/// The cells of an image.
#[derive(Serialize)]
struct CellsView<'a> {
    label: String,
    width: u32,
    height: u32,
    picture: Option<PictureView<'a>>,
    cells: Vec<CellView>,
}

#[derive(Serialize)]
struct CellView {
    #[serde(flatten)]
    bounds: Rect,
    center: (f64, f64),
    /// Height of its text.
    size: f64,
    class: &'static str,
    text: String,
    words: String,
    is_changed: bool,
}

impl<'a> ChangedFrameView<'a> {
    /// `labels`: those of the two algorithms.
    pub fn new(frame: &'a ChangedFrame, labels: &[String; 2], images: &mut PageImages<'a>) -> Self {
        let [a, b] = &frame.rows;
        let counts = COUNTS.iter().filter_map(|(name, words)| {
            let (before, after) = a.metrics.get(name).zip(b.metrics.get(name))?;
            Some(format!("{words} {before} → {after}"))
        });
        let counts: Vec<_> = counts.collect();
        let pairs = frame.cells[0].iter().filter_map(|cell| {
            let other = frame.cells[1]
                .iter()
                .find(|other| place(other) == place(cell))?;
            Some((cell, other))
        });
        let is_other = |(a, b): &CellPair<'_>| a.verdict != b.verdict || obstacle(a, b).is_some();
        let mut changed: Vec<_> = pairs.filter(is_other).collect();
        // The sort is stable.
        changed.sort_by_key(|(a, b)| obstacle(a, b).is_none());
        let places: Vec<_> = changed.iter().map(|(cell, _)| place(cell)).collect();
        let mut changes: Vec<_> = changed.iter().map(change_words).collect();
        let more = changes.len().saturating_sub(MAX_LISTED);
        changes.truncate(MAX_LISTED);
        changes.extend((more > 0).then(|| format!("{more} more")));
        let is_changed = |cell: &CellRow| places.contains(&place(cell));
        let mut panel = |label: &str, cells: &[CellRow], is_truth: bool| {
            let shape = shape(cells);
            let size = (a.width as usize, a.height as usize);
            let view =
                |cell: &CellRow| CellView::new(cell, (shape, size), is_truth, is_changed(cell));
            let left = frame.left.as_ref();
            CellsView {
                label: label.to_owned(),
                width: a.width,
                height: a.height,
                picture: left.map(|(file, size)| images.picture("left", file, *size, Vec::new())),
                cells: cells.iter().map(view).collect(),
            }
        };
        let panels = vec![
            panel(&labels[0], &frame.cells[0], false),
            panel(&labels[1], &frame.cells[1], false),
            panel("truth", &frame.cells[0], true),
        ];
        let has_cells = frame.cells.iter().all(|cells| !cells.is_empty());
        Self {
            origin: a.origin_words(),
            reason: frame.harm.words(),
            counts: counts.join(", "),
            changes,
            panels: if has_cells { panels } else { Vec::new() },
        }
    }
}

fn place(cell: &CellRow) -> (u32, u32) {
    (cell.column, cell.row)
}

/// The shape of the grid of all these cells.
fn shape(cells: &[CellRow]) -> GridShape {
    let most = |number: fn(&CellRow) -> u32| cells.iter().map(number).max().unwrap_or(0) as usize;
    GridShape {
        columns: 1 + most(|cell| cell.column),
        rows: 1 + most(|cell| cell.row),
    }
}

impl CellView {
    fn new(
        cell: &CellRow,
        (shape, size): (GridShape, (usize, usize)),
        is_truth: bool,
        is_changed: bool,
    ) -> Self {
        let (x, y) = shape.pixels((cell.column as usize, cell.row as usize), size);
        let bounds = Rect {
            x: x.start as f64,
            y: y.start as f64,
            width: x.len() as f64,
            height: y.len() as f64,
        };
        let text = if is_truth { truth(cell) } else { report(cell) };
        let class = match cell.verdict {
            _ if is_truth => "true",
            Verdict::Right => "right",
            Verdict::Wrong => "wrong",
            Verdict::Unknown => "unknown",
            Verdict::NoTruth => "none",
        };
        Self {
            bounds,
            center: bounds.center(),
            size: (bounds.width / 3.6).min(bounds.height / 2.5),
            class,
            words: format!(
                "({}, {}): {text} {}",
                cell.column,
                cell.row,
                cell.verdict.name()
            ),
            text,
            is_changed,
        }
    }
}

/// The distance of a cell as it is written into it, or the disparity where there is none.
fn number(distance_m: Option<f64>, disparity_px: Option<f64>) -> Option<String> {
    match (distance_m, disparity_px) {
        (Some(m), _) if m < 10.0 => Some(format!("{m:.2}")),
        (Some(m), _) => Some(format!("{m:.1}")),
        (None, Some(px)) => Some(format!("{px:.1} px")),
        (None, None) => None,
    }
}

fn truth(cell: &CellRow) -> String {
    number(cell.true_distance_m, cell.true_median_px).unwrap_or_default()
}

fn report(cell: &CellRow) -> String {
    let number = number(cell.distance_m, cell.median_px);
    match cell.state {
        Some(CellState::Near) => "near".to_owned(),
        Some(CellState::TooClose) => format!("<{}", number.unwrap_or_default()),
        Some(CellState::Unknown) => "?".to_owned(),
        _ => number.unwrap_or_else(|| "?".to_owned()),
    }
}

/// A cell before and after.
type CellPair<'a> = (&'a CellRow, &'a CellRow);

/// The change of its obstacle in words, if there is one.
fn obstacle(before: &CellRow, after: &CellRow) -> Option<&'static str> {
    let is = [
        (before.missed, after.missed),
        (before.r#false, after.r#false),
    ];
    match is {
        [(false, true), _] => Some("an obstacle is missed"),
        [_, (false, true)] => Some("a false obstacle"),
        [(true, false), _] if after.verdict == Verdict::Unknown => {
            Some("an obstacle is unknown, not missed any more")
        }
        [(true, false), _] => Some("an obstacle is not missed any more"),
        [_, (true, false)] => Some("a false obstacle less"),
        _ => None,
    }
}

/// A cell with another verdict.
fn change_words((before, after): &CellPair<'_>) -> String {
    let obstacle = obstacle(before, after).map_or_else(String::new, |words| format!(", {words}"));
    format!(
        "({}, {}) {} → {}: {} → {}, true {}{obstacle}",
        before.column,
        before.row,
        before.verdict.name(),
        after.verdict.name(),
        report(before),
        report(after),
        truth(after),
    )
}
