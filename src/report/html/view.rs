//! What the template sees: the page with every number worded.

use super::super::rows::{CellRow, Row};
use super::super::words::{COLUMNS, Checkpoints, NOTES, ms, pass, percent, totals};
use super::{Page, Rank, Shot};
use crate::overlay::Mark;
use crate::score::Verdict;
use base64::{Engine as _, engine::general_purpose::STANDARD};
use serde::Serialize;

#[derive(Serialize)]
pub(super) struct View<'a> {
    title: &'a str,
    paragraphs: Vec<&'a str>,
    incomplete: Option<&'a str>,
    identity: &'a [(String, String)],
    groups: Vec<(&'static str, usize)>,
    heads: Vec<&'static str>,
    algorithms: Vec<(&'a str, Vec<String>)>,
    notes: &'static [(&'static str, &'static str)],
    checkpoints: CheckpointsView<'a>,
    figures: Vec<FigureView<'a>>,
    images: Vec<ImageView>,
}

#[derive(Serialize)]
struct CheckpointsView<'a> {
    algorithms: Vec<&'a str>,
    /// Name, and per algorithm best, worst, share in %.
    lines: Vec<(String, Vec<[String; 3]>)>,
    sums: Vec<[String; 3]>,
}

#[derive(Serialize)]
struct FigureView<'a> {
    title: &'a str,
    about: &'a str,
    shots: Vec<ShotView<'a>>,
}

#[derive(Serialize)]
struct ShotView<'a> {
    algorithm: &'a str,
    rank: &'static str,
    passed: Option<bool>,
    origin: String,
    cells: String,
    wrong: Vec<String>,
    numbers: String,
    width: usize,
    height: usize,
    pictures: Vec<PictureView>,
}

#[derive(Serialize)]
struct PictureView {
    label: &'static str,
    image: usize,
    marks: Vec<MarkView>,
}

#[derive(Serialize)]
struct MarkView {
    #[serde(flatten)]
    mark: Mark,
    center: (f64, f64),
    radius: f64,
    /// What the cell says, for pointer and screen reader.
    words: String,
    wrong: bool,
}

#[derive(Serialize)]
struct ImageView {
    base64: String,
    width: usize,
    height: usize,
}

/// Images in order of their first appearance, each once.
#[derive(Default)]
struct Images<'a>(Vec<(&'a [u8], (usize, usize))>);

impl<'a> Images<'a> {
    fn index(&mut self, png: &'a [u8], size: (usize, usize)) -> usize {
        self.0.iter().position(|image| *image == (png, size)).unwrap_or_else(|| {
            self.0.push((png, size));
            self.0.len() - 1
        })
    }

    fn into_views(self) -> Vec<ImageView> {
        let view = |(png, (width, height))| ImageView { base64: STANDARD.encode(png), width, height };
        self.0.into_iter().map(view).collect()
    }
}

impl<'a> View<'a> {
    pub(super) fn of(page: &'a Page) -> Self {
        let mut images = Images::default();
        let figures = page.figures.iter().map(|figure| FigureView {
            title: &figure.title,
            about: &figure.about,
            shots: figure.shots.iter().map(|shot| shot_view(shot, &mut images)).collect(),
        });
        let figures = figures.collect();
        let groups = COLUMNS.chunk_by(|a, b| a.group == b.group).map(|group| (group[0].group, group.len()));
        let cells = |algorithm| COLUMNS.iter().map(|column| (column.cell)(algorithm)).collect();
        Self {
            title: &page.title,
            incomplete: page.summary.incomplete.as_deref(),
            paragraphs: page.description.split("\n\n").map(str::trim).filter(|p| !p.is_empty()).collect(),
            identity: &page.identity,
            groups: groups.collect(),
            heads: COLUMNS.iter().map(|column| column.head).collect(),
            algorithms: page.summary.algorithms.iter().map(|a| (a.algorithm.as_str(), cells(a))).collect(),
            notes: NOTES,
            checkpoints: checkpoints_view(page),
            figures,
            images: images.into_views(),
        }
    }
}

fn checkpoints_view(page: &Page) -> CheckpointsView<'_> {
    let Checkpoints { algorithms, lines } = Checkpoints::of(&page.summary);
    let lines = lines.into_iter().map(|line| {
        let cells = line.cells.iter().map(|cell| {
            let best = pass(cell.and_then(|c| c.best_passed));
            let worst = pass(cell.and_then(|c| c.worst_passed));
            [best.to_owned(), worst.to_owned(), percent(cell.and_then(|c| c.share()))]
        });
        let cells = cells.collect();
        (line.name, cells)
    });
    let lines = lines.collect();
    let sums = algorithms.iter().map(|algorithm| totals(&page.summary, algorithm)).collect();
    CheckpointsView { algorithms, lines, sums }
}

fn shot_view<'a>(shot: &'a Shot, images: &mut Images<'a>) -> ShotView<'a> {
    let (width, height) = shot.size;
    let left = images.index(&shot.left_png, shot.size);
    let estimate = |cell: &CellRow| match cell.verdict {
        Verdict::Unknown => "unknown".to_owned(),
        Verdict::Wrong => format!("{}, wrong", depth(cell.distance_m, cell.median_px)),
        _ => depth(cell.distance_m, cell.median_px),
    };
    let truth = |cell: &CellRow| depth(cell.true_distance_m, cell.true_median_px);
    let mut pictures =
        vec![PictureView { label: "estimate", image: left, marks: mark_views(shot, &shot.estimate, estimate, true) }];
    if let Some(marks) = &shot.truth {
        pictures.push(PictureView { label: "truth", image: left, marks: mark_views(shot, marks, truth, false) });
    }
    if let Some(png) = &shot.preview_png {
        pictures.push(PictureView {
            label: "disparity: yellow near, dark far, black none",
            image: images.index(png, shot.size),
            marks: Vec::new(),
        });
    }
    let rank = match shot.rank {
        Some(Rank::Worst) => "worst frame",
        Some(Rank::Best) => "best frame",
        None => "",
    };
    ShotView {
        algorithm: &shot.row.algorithm,
        rank,
        passed: shot.passed,
        origin: origin(&shot.row),
        cells: cells(&shot.row),
        wrong: shot.cells.iter().filter(|c| c.verdict == Verdict::Wrong).map(wrong).collect(),
        numbers: numbers(&shot.row),
        width,
        height,
        pictures,
    }
}

fn mark_views(shot: &Shot, marks: &[Mark], words: impl Fn(&CellRow) -> String, judged: bool) -> Vec<MarkView> {
    let view = |mark: &Mark| {
        let at = (mark.column, mark.row);
        let cell = shot.cells.iter().find(|c| (c.column as usize, c.row as usize) == at);
        MarkView {
            mark: *mark,
            center: mark.cell.center(),
            radius: mark.cell.width.min(mark.cell.height) / 16.0,
            words: format!("({}, {}): {}", at.0, at.1, cell.map_or_else(|| "unknown".to_owned(), &words)),
            wrong: judged && cell.is_some_and(|c| c.verdict == Verdict::Wrong),
        }
    };
    marks.iter().map(view).collect()
}

fn origin(row: &Row) -> String {
    let seed = row.seed.map(|seed| format!("seed {seed}, ")).unwrap_or_default();
    format!("{seed}frame {}", row.sequence)
}

fn cells(row: &Row) -> String {
    match (row.cells_right, row.cells_wrong, row.cells_unknown) {
        (Some(right), Some(wrong), Some(unknown)) => {
            format!("cells: {right} right, {wrong} wrong, {unknown} unknown")
        }
        _ => String::new(),
    }
}

fn wrong(cell: &CellRow) -> String {
    let obstacle = match (cell.missed_obstacle, cell.false_obstacle) {
        (true, _) => ", obstacle missed",
        (_, true) => ", false obstacle",
        _ => "",
    };
    let estimate = depth(cell.distance_m, cell.median_px);
    let truth = depth(cell.true_distance_m, cell.true_median_px);
    format!("({}, {}) {estimate}, truly {truth}{obstacle}", cell.column, cell.row)
}

fn numbers(row: &Row) -> String {
    let shares = [
        (Some(row.coverage), "covered"),
        (row.invalid, "invalid"),
        (row.bad1, ">\u{a0}1\u{a0}px"),
        (row.bad2, ">\u{a0}2\u{a0}px"),
    ];
    let shares = shares.into_iter().filter(|(share, _)| share.is_some());
    let mut words: Vec<_> = shares.map(|(share, what)| format!("{}\u{a0}%\u{a0}{what}", percent(share))).collect();
    words.push(format!("{}\u{a0}ms", ms(row.total_us as f64 / 1000.0)));
    words.join(", ")
}

/// A distance where there is one, else the disparity.
fn depth(distance_m: Option<f64>, median_px: Option<f64>) -> String {
    match (distance_m, median_px) {
        (Some(distance_m), _) => format!("{distance_m:.2} m"),
        (None, Some(median_px)) => format!("{median_px:.1} px"),
        (None, None) => "nothing".to_owned(),
    }
}
