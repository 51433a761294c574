//! The checkpoints' frames: worst and best frame of every algorithm, as in the thesis's figure 7.3.

use super::figures::{CheckpointFigure, FrameShot, Rank};
use super::replays::Replays;
use crate::rows::held::Row;
use crate::rows::records::CellRow;
use crate::show::page::parts::{MarkView, PageImages};
use crate::show::words::ms;
use minijinja::{Value, context};
use svl_core::stereo::CellState;
use svl_files::overlay::Mark;
use svl_score::judge::{
    AreaChoice, CellFinding, METRICS, Metric, MetricSource as _, MetricTotal, Verdict,
};

/// A figure for the template. `place`: that of an algorithm among all.
pub(crate) fn figure_view<'a>(
    figure: &'a CheckpointFigure,
    images: &mut PageImages<'a>,
    place: impl Fn(&str) -> usize,
    replays: &Replays,
) -> Value {
    let is_film = figure.is_film;
    let last = figure.shots.last().filter(|_| is_film);
    let last = last.map(|(_, last)| last.row.stamp_ns);
    let moment = |row: &Row| match last?.saturating_sub(row.stamp_ns) {
        0 => Some("collision".to_owned()),
        before_ns => Some(format!("{:.1} s before", before_ns as f64 / 1e9)),
    };
    let mut shots: Vec<_> = figure.shots.iter().collect();
    shots.sort_by_key(|(_, shot)| place(&shot.row.algorithm));
    let first = shots.first().map(|(_, shot)| &shot.row);
    let is_same = |row: &Row| first.is_some_and(|first| first.pair_hash == row.pair_hash);
    // The truth of a pair stands once.
    let is_one_pair = !is_film && shots.iter().all(|(_, shot)| is_same(&shot.row));
    let frame = first.filter(|_| is_one_pair).map(frame_name);
    let truth = shots.first().filter(|_| is_one_pair);
    let truth = truth.map(|(_, shot)| true_pictures(shot, images));
    let shots = shots.into_iter().map(|(rank, shot)| {
        let mut pictures = shot_pictures(shot, &[], images);
        if !is_one_pair {
            pictures.extend(true_pictures(shot, images));
        }
        let (rank, failed) = match rank {
            Rank::Failed(place) => ("sample", Some(place)),
            Rank::Worst => ("worst", None),
            Rank::Best => ("best", None),
            Rank::Sample => ("sample", None),
        };
        // That frame alone.
        let at_s = replays
            .at_s(shot.row.origin())
            .map(|at_s| [at_s - 0.002, at_s + 0.002]);
        let millis = |s: f64| (s * 1e3).round() / 1e3;
        let replay = at_s.and_then(|span_s| replays.command(shot.row.origin(), span_s.map(millis)));
        let algorithm = &shot.row.algorithm;
        let name = moment(&shot.row).unwrap_or_else(|| algorithm.clone());
        let (label, place) = (format!("{algorithm} {rank}"), place(algorithm));
        let is = if is_wrong(shot) { "wrong" } else { "" };
        context! {
            rank, failed, place, is, name, label, pictures, replay,
            algo => replays.algorithm(algorithm), run => shot.row.origin().run_name(),
            ..shot_words(shot)
        }
    });
    let shots: Vec<_> = shots.collect();
    let CheckpointFigure {
        checkpoint,
        title,
        about,
        shows,
        ..
    } = figure;
    let shows: Vec<_> = checkpoint.iter().chain(shows).collect();
    let truth = truth.unwrap_or_default();
    context! { checkpoint, title, about, is_film, frame, truth, shots, shows }
}

/// The words of a frame in links: its run and number.
pub(crate) fn frame_name(row: &Row) -> String {
    format!("{}/{}", row.origin().run_name(), row.sequence)
}

/// True for a frame that the filter of wrong ones leaves.
pub(crate) fn is_wrong(shot: &FrameShot) -> bool {
    let has = |name| shot.row.metrics.get(name).is_some_and(|cells| cells > 0.0);
    has("missed") || has("wrong") || shot.passed == Some(false)
}

/// Estimate, disparities and errors of an algorithm. `changed`: the columns and rows of the cells
/// that are outlined.
pub(crate) fn shot_pictures<'a>(
    shot: &'a FrameShot,
    changed: &[(u32, u32)],
    images: &mut PageImages<'a>,
) -> Vec<Value> {
    let marks = shot.estimate.iter();
    let marks = marks.map(|mark| mark_view(shot, mark, cell_words, true, changed));
    let pictures = [
        ("estimate", shot.marked_left(), marks.collect()),
        ("disparity", shot.preview.as_ref(), Vec::new()),
        ("error", shot.errors.as_ref(), Vec::new()),
    ];
    drawn(shot, pictures, images)
}

/// The truth of the pair.
pub(crate) fn true_pictures<'a>(shot: &'a FrameShot, images: &mut PageImages<'a>) -> Vec<Value> {
    let marks = shot.truth.as_ref().map(|truth| {
        let marks = truth.iter();
        let marks = marks.map(|mark| mark_view(shot, mark, truth_words, false, &[]));
        marks.collect()
    });
    let left = marks.as_ref().and_then(|_: &Vec<_>| shot.marked_left());
    let pictures = [
        ("truth", left, marks.unwrap_or_default()),
        ("true disparity", shot.true_preview.as_ref(), Vec::new()),
    ];
    drawn(shot, pictures, images)
}

/// The label of a picture, its file if there is one, and its marks.
type ShotPicture<'a> = (&'a str, Option<&'a Vec<u8>>, Vec<MarkView>);

fn drawn<'a, const N: usize>(
    shot: &'a FrameShot,
    pictures: [ShotPicture<'a>; N],
    images: &mut PageImages<'a>,
) -> Vec<Value> {
    let pictures = pictures
        .into_iter()
        .filter_map(|(label, file, marks)| Some(images.picture(label, file?, shot.size, marks)));
    pictures.collect()
}

impl FrameShot {
    /// The left image, if there are cells to mark in it.
    fn marked_left(&self) -> Option<&Vec<u8>> {
        Some(&self.left).filter(|_| !self.cells.is_empty())
    }
}

/// The words below the pictures.
pub(crate) fn shot_words(shot: &FrameShot) -> Value {
    let missing = shot.findings.iter().filter(|finding| !finding.is_wrong);
    context! {
        algorithm => shot.row.algorithm, passed => shot.passed, origin => shot.row.origin().words(),
        cells => cells(&shot.row), failures => shot.failures, wrong => wrong_cells(shot),
        missing => missing.map(|finding| &finding.words).collect::<Vec<_>>(),
        numbers => numbers(&shot.row),
    }
}

fn mark_view(
    shot: &FrameShot,
    mark: &Mark,
    words: fn(&CellRow) -> String,
    is_judged: bool,
    changed: &[(u32, u32)],
) -> MarkView {
    let at = (mark.column as u32, mark.row as u32);
    let cell = shot.cells.iter().find(|cell| (cell.column, cell.row) == at);
    let words = cell.map_or_else(|| "unknown".to_owned(), words);
    let contradicts = |own: &CellFinding| own.is_wrong && own.at == [mark.column, mark.row];
    let is_wrong = cell.is_some_and(|cell| cell.verdict == Verdict::Wrong)
        || shot.findings.iter().any(contradicts);
    let words = format!("({}, {}): {words}", at.0, at.1);
    let mut view = MarkView::new(*mark, words, is_judged && is_wrong);
    view.changed = changed.contains(&at);
    view
}

/// Number of cells of each kind, by the rule of the headline, in all areas: a picture shows all.
pub(crate) fn cells(row: &Row) -> String {
    let group = Metric::find("right").map(|metric| metric.group);
    let is_share = |metric: &&Metric| {
        Some(metric.group) == group && matches!(metric.column(), Some((_, MetricTotal::Share)))
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
pub(crate) fn numbers(row: &Row) -> String {
    // Filters count over many frames.
    let is_mean = |metric: &&Metric| {
        metric.group != "filters" && matches!(metric.column(), Some((_, MetricTotal::Mean)))
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
