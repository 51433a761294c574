//! The checkpoints' frames: worst and best frame of every algorithm, as in the thesis's figure 7.3.

use super::super::rows::{CellRow, Row};
use super::super::words::ms;
use super::{CheckpointFigure, FrameShot, Rank};
use crate::page::{MarkView, PageImages, PictureView};
use serde::Serialize;
use svl_core::stereo::CellState;
use svl_files::overlay::Mark;
use svl_score::judge::{AreaChoice, CellFinding, METRICS, Metric, MetricTotal, Verdict};

#[derive(Serialize)]
pub(super) struct FigureView<'a> {
    pub checkpoint: Option<u32>,
    pub title: &'a str,
    /// True for successive frames of one drive.
    is_film: bool,
    about: &'a str,
    shots: Vec<ShotView<'a>>,
}

#[derive(Serialize)]
pub(crate) struct ShotView<'a> {
    algorithm: &'a str,
    rank: Rank,
    /// Time of a frame of a film.
    moment: String,
    passed: Option<bool>,
    origin: String,
    cells: String,
    failures: &'a [String],
    wrong: Vec<String>,
    missing: Vec<&'a str>,
    numbers: String,
    pub pictures: Vec<PictureView<'a>>,
}

impl<'a> FigureView<'a> {
    /// `place`: that of an algorithm among all.
    pub(super) fn new(
        figure: &'a CheckpointFigure,
        images: &mut PageImages<'a>,
        place: impl Fn(&str) -> usize,
    ) -> Self {
        let shots = figure.shots.iter();
        let shots = shots.map(|(rank, shot)| shot_view(*rank, shot, images));
        let mut shots: Vec<_> = shots.collect();
        let is_film = figure.checkpoint.is_none() && figure.at_s.is_none();
        if let (true, Some((_, last))) = (is_film, figure.shots.last()) {
            for ((_, shot), view) in figure.shots.iter().zip(&mut shots) {
                let before_ns = last.row.stamp_ns.saturating_sub(shot.row.stamp_ns);
                view.moment = match before_ns {
                    0 => "collision".to_owned(),
                    _ => format!("{:.1} s before", before_ns as f64 / 1e9),
                };
            }
        }
        shots.sort_by_key(|shot| place(shot.algorithm));
        Self {
            checkpoint: figure.checkpoint,
            title: &figure.title,
            is_film,
            about: &figure.about,
            shots,
        }
    }

    /// True if the worst frame of an algorithm fails.
    pub(super) fn fails(&self, algorithm: &str) -> bool {
        let mut shots = self.shots.iter();
        shots.any(|s| s.algorithm == algorithm && s.rank == Rank::Worst && s.passed == Some(false))
    }
}

pub(crate) fn shot_view<'a>(
    rank: Rank,
    shot: &'a FrameShot,
    images: &mut PageImages<'a>,
) -> ShotView<'a> {
    let mut picture = |label, file, marks| images.picture(label, file, shot.size, marks);
    let marks = mark_views(shot, &shot.estimate, cell_words, true);
    let mut pictures = vec![picture("estimate", &shot.left, marks)];
    if let Some(marks) = &shot.truth {
        pictures.push(picture(
            "truth",
            &shot.left,
            mark_views(shot, marks, truth_words, false),
        ));
    }
    let maps = [
        ("disparity", &shot.preview),
        ("true disparity", &shot.true_preview),
        ("error", &shot.errors),
    ];
    for (label, file) in maps {
        pictures.extend(file.iter().map(|file| picture(label, file, Vec::new())));
    }
    let missing = shot.findings.iter().filter(|finding| !finding.is_wrong);
    ShotView {
        algorithm: &shot.row.algorithm,
        rank,
        moment: String::new(),
        passed: shot.passed,
        origin: shot.row.origin_words(),
        cells: cells(&shot.row),
        failures: &shot.failures,
        wrong: wrong_cells(shot),
        missing: missing.map(|finding| finding.words.as_str()).collect(),
        numbers: numbers(&shot.row),
        pictures,
    }
}

fn mark_views(
    shot: &FrameShot,
    marks: &[Mark],
    words: impl Fn(&CellRow) -> String,
    judged: bool,
) -> Vec<MarkView> {
    let view = |mark: &Mark| {
        let at = (mark.column, mark.row);
        let cell = shot
            .cells
            .iter()
            .find(|c| (c.column as usize, c.row as usize) == at);
        let words = cell.map_or_else(|| "unknown".to_owned(), &words);
        let contradicts = |finding: &CellFinding| finding.is_wrong && finding.at == [at.0, at.1];
        let wrong = judged
            && (cell.is_some_and(|c| c.verdict == Verdict::Wrong)
                || shot.findings.iter().any(contradicts));
        MarkView::new(*mark, format!("({}, {}): {words}", at.0, at.1), wrong)
    };
    marks.iter().map(view).collect()
}

/// True for metrics that do not apply to a single frame.
fn counts_filters(metric: &Metric) -> bool {
    metric.group == "filters"
}

/// Number of cells of each kind, by the rule of the headline, in all areas: a picture shows all.
pub(super) fn cells(row: &Row) -> String {
    let group = Metric::find("right").map(|metric| metric.group);
    let is_share = |metric: &&Metric| {
        Some(metric.group) == group && matches!(metric.column(), Some((_, MetricTotal::ShareOf(_))))
    };
    let count = |metric: &Metric| {
        let cells = row.metrics.get_in(metric.name, AreaChoice::All)?;
        Some(format!("{cells} {}", metric.head))
    };
    let counts: Vec<_> = METRICS.iter().filter(is_share).filter_map(count).collect();
    match counts[..] {
        [] => String::new(),
        _ => format!("cells: {}", counts.join(", ")),
    }
}

/// The first wrong cells in words; the crosses show all.
fn wrong_cells(shot: &FrameShot) -> Vec<String> {
    const MAX_LISTED: usize = 3;
    let expected = shot.findings.iter().filter(|finding| finding.is_wrong);
    let expected = expected.map(|finding| finding.words.clone());
    let cells = shot.cells.iter().filter(|c| c.verdict == Verdict::Wrong);
    let mut all: Vec<_> = expected.chain(cells.map(wrong)).collect();
    let more = all.len().saturating_sub(MAX_LISTED);
    all.truncate(MAX_LISTED);
    all.extend((more > 0).then(|| format!("{more} more")));
    all
}

fn wrong(cell: &CellRow) -> String {
    format!(
        "({}, {}) {}, true {}{}",
        cell.column,
        cell.row,
        estimated(cell),
        truth_words(cell),
        obstacle_words(cell)
    )
}

/// The obstacle of a cell in words, if it is missed or false.
pub(crate) fn obstacle_words(cell: &CellRow) -> &'static str {
    match (cell.missed, cell.r#false) {
        (true, _) => ", obstacle missed",
        (_, true) => ", false obstacle",
        _ => "",
    }
}

/// The truth of a cell in words.
pub(crate) fn truth_words(cell: &CellRow) -> String {
    depth(cell.true_distance_m, cell.true_median_px)
}

/// The result of a cell in words.
pub(crate) fn cell_words(cell: &CellRow) -> String {
    match cell.verdict {
        Verdict::Unknown if cell.state == Some(CellState::Near) => estimated(cell),
        Verdict::Unknown => format!("unknown{}", probability(cell, cell.probability)),
        Verdict::Wrong => format!("{}, wrong", estimated(cell)),
        _ => estimated(cell),
    }
}

/// The report of a cell in words, with the probability that it is right, if there is one.
fn estimated(cell: &CellRow) -> String {
    let depth = depth(cell.distance_m, cell.median_px);
    match cell.state {
        Some(CellState::TooClose) => format!("too close, nearer than {depth}"),
        Some(CellState::Near) => format!("near{}", probability(cell, cell.near_probability)),
        Some(CellState::Far) => format!("far{}", probability(cell, cell.probability)),
        _ => format!("{depth}{}", probability(cell, cell.probability)),
    }
}

fn probability(cell: &CellRow, value: Option<f64>) -> String {
    let words = |p: f64| match 100.0 * p {
        // Never certain.
        percent if percent > 99.0 => format!(" ({}: > 99 %)", cell.algorithm),
        percent => format!(" ({}: {percent:.0} %)", cell.algorithm),
    };
    value.map_or_else(String::new, words)
}

/// The metrics of the frame's pixels, and the time, in words.
pub(super) fn numbers(row: &Row) -> String {
    let is_mean = |metric: &&Metric| {
        !counts_filters(metric) && matches!(metric.column(), Some((_, MetricTotal::Mean)))
    };
    let words = |metric: &Metric| {
        let value = metric.show(row.metrics.get(metric.name)?);
        Some(format!("{value} {}", metric.head))
    };
    let time = row
        .total_us
        .map(|us| format!("{} ms", ms(us as f64 / 1000.0)));
    let numbers = METRICS.iter().filter(is_mean).filter_map(words).chain(time);
    let unbroken = numbers.map(|words| words.replace(' ', "\u{a0}"));
    unbroken.collect::<Vec<_>>().join(", ")
}

/// The distance if there is one, else the disparity; 0 px is at infinity.
fn depth(distance_m: Option<f64>, median_px: Option<f64>) -> String {
    match (distance_m, median_px) {
        (Some(distance_m), _) => format!("{distance_m:.2} m"),
        (None, Some(median_px)) if median_px <= 0.0 => "at infinity".to_owned(),
        (None, Some(median_px)) => format!("{median_px:.1} px"),
        (None, None) => "nothing".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::depth;

    #[test]
    fn no_disparity_is_infinitely_far() {
        let words = [
            (Some(4.96), Some(2.0)),
            (None, Some(0.0)),
            (None, Some(2.0)),
        ];
        let words = words.map(|(distance_m, px)| depth(distance_m, px));
        assert_eq!(words, ["4.96 m", "at infinity", "2.0 px"]);
    }
}
