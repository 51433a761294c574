//! The page of a comparison: one file that answers what changed, whether it is real, and on which
//! frame.

use super::comparison::{AlgorithmChange, Comparison};
use super::courses::CourseChanges;
use super::frames::{
    BothImages, ChangedFrame, FindLeft, FrameChange, changed_cells, changed_counts, changed_frames,
};
use super::join::Join;
use crate::pages::html::figures::FrameShot;
use crate::pages::html::frames::{
    cell_words, frame_name, is_wrong, obstacle_words, picture_colors, shot_pictures, shot_words,
    true_pictures, truth_words,
};
use crate::rows::records::{CellRow, Row};
use crate::rows::samples::run_key;
use crate::show::page::parts::{PageImages, fill};
use minijinja::{Value, context};
use svl_core::Result;
use svl_score::judge::ColumnChoice;

/// Limit of the cells that a caption lists.
const MAX_LISTED: usize = 3;

/// The page as HTML, all texts escaped.
///
/// # Errors
/// The errors of reading the tables of cells and the pictures; [`svl_core::Error::Invalid`] with
/// the error of the template engine.
pub fn page(comparison: &Comparison, join: &Join<'_>, find: &FindLeft<'_>) -> Result<String> {
    let stored = BothImages::new(join, find)?;
    let both = || comparison.algorithms.iter().zip(&join.algorithms);
    let frames = both().map(|(own, joined)| {
        let is_shown = own.frames.is_some() && own.equal_results < own.pairs;
        let frames = is_shown.then(|| changed_frames(joined, &stored));
        frames.unwrap_or_else(|| Ok(Vec::new()))
    });
    let frames = frames.collect::<Result<Vec<_>>>()?;
    let mut images = PageImages::default();
    let algorithms = comparison.algorithms.iter().zip(&frames);
    let algorithms: Vec<_> = algorithms
        .clone()
        .map(|(own, frames)| algorithm_view(own, frames))
        .collect();
    let figures = figures(comparison, &frames);
    let one_run = figures
        .windows(2)
        .all(|two| run_key(two[0].row()) == run_key(two[1].row()));
    let entries = figures.iter().enumerate().map(|(i, figure)| {
        let row = figure.row();
        let frame = || format!("frame {}", row.sequence);
        let words = one_run.then(frame).unwrap_or_else(|| row.origin_words());
        (format!("f{i}"), words)
    });
    let entries: Vec<_> = entries.collect();
    let pictured = comparison.algorithms.iter().zip(&frames);
    let pictured = pictured.filter(|(_, frames)| !frames.is_empty());
    let pictured: Vec<_> = pictured.map(|(own, _)| own.labels()).collect();
    let changes = FrameChange::ALL.map(FrameChange::word);
    let filters = changes.into_iter().map(|word| (word, word));
    let shots = || frames.iter().flatten().flat_map(|frame| &frame.shots);
    let mut records = join.runs.iter().flat_map(|run| &run.manifest.algorithms);
    let (base, other) = (comparison.base.display(), comparison.other.display());
    let word = comparison.conclusion.word();
    let view = context! {
        title => format!("{base} → {other}"), scenario => comparison.scenario,
        conclusion => comparison.conclusion, word,
        reason => comparison.verdict.strip_prefix(word), cautions => comparison.remarks(),
        overview => comparison.overview(), algorithms, method => comparison.method,
        tested => comparison.tested, is_driven => join.is_driven, entries, pictured,
        filters => filters.chain([("wrong", "wrong only")]).collect::<Vec<_>>(),
        figures => figures.iter().map(|own| own.view(&mut images)).collect::<Vec<_>>(),
        has_errors => shots().any(|shot| shot.errors.is_some()),
        has_v5 => records.any(|own| own.name == "v5"),
        reports => [base, other].map(|report| report.to_string()), origins => comparison.origins,
        images => images.into_views(), ..picture_colors()
    };
    let (page, style) = (include_str!("page.html"), include_str!("page.css"));
    fill(page, style, &[], view)
}

fn algorithm_view(own: &AlgorithmChange, frames: &[ChangedFrame]) -> Value {
    let numbers = own.frames.as_ref().map(|counts| {
        let number = |change: FrameChange| (change.word(), counts.number(change));
        FrameChange::ALL.map(number)
    });
    context! {
        title => own.title(), label => own.labels(), extent => own.extent(),
        note => note(own, frames), numbers,
        headline => own.drawn_table(&ColumnChoice::Headline),
        all => own.drawn_table(&ColumnChoice::All),
        item_words => own.item_words(), has_frames => !frames.is_empty(),
        courses => own.courses.as_ref().map(CourseChanges::table),
    }
}

/// A remark on what is missing of the frames, or why there are none.
fn note(own: &AlgorithmChange, frames: &[ChangedFrame]) -> Option<&'static str> {
    let has_cells = |frame: &ChangedFrame| frame.shots.iter().all(|shot| !shot.cells.is_empty());
    let words = match own.courses {
        Some(_) => return None,
        None if own.equal_results == own.pairs => "The results of all frames are equal.",
        None if own.frames.is_none() => "Frames that were scored differently are not compared.",
        None if frames.is_empty() => "No frame is better or worse by a truth of cells.",
        None if !frames.iter().all(has_cells) => {
            "A report has no table of cells, so its cells are not shown."
        }
        None => return None,
    };
    Some(words)
}

/// A pair with the changes of the algorithms that it is shown of.
struct ChangedPair<'a> {
    frames: Vec<(usize, &'a AlgorithmChange, &'a ChangedFrame)>,
}

/// The frames of all algorithms, each pair once.
fn figures<'a>(
    comparison: &'a Comparison,
    frames: &'a [Vec<ChangedFrame>],
) -> Vec<ChangedPair<'a>> {
    let mut figures: Vec<ChangedPair<'_>> = Vec::new();
    for (place, (own, frames)) in comparison.algorithms.iter().zip(frames).enumerate() {
        for frame in frames {
            let name = |frame: &ChangedFrame| frame_name(&frame.shots[0].row);
            let same = figures
                .iter_mut()
                .find(|figure| name(figure.frames[0].2) == name(frame));
            match same {
                Some(figure) => figure.frames.push((place, own, frame)),
                None => figures.push(ChangedPair {
                    frames: vec![(place, own, frame)],
                }),
            }
        }
    }
    figures
}

impl<'a> ChangedPair<'a> {
    fn row(&self) -> &'a Row {
        &self.frames[0].2.shots[0].row
    }

    /// The figure for the template.
    fn view(&self, images: &mut PageImages<'a>) -> Value {
        let shots = self.frames.iter();
        let shots = shots.flat_map(|(place, own, frame)| {
            [0, 1].map(|side| shot_view(*place, own, frame, side, images))
        });
        let shots: Vec<_> = shots.collect();
        let both = self.frames.iter().flat_map(|(.., frame)| &frame.shots);
        // The truth of all is shown once.
        let truth = both.max_by_key(|shot| (shot.true_preview.is_some(), !shot.cells.is_empty()));
        context! {
            title => self.row().origin_words(), about => "", is_film => false,
            frame => frame_name(self.row()), shots,
            truth => truth.map(|shot| true_pictures(shot, images)).unwrap_or_default(),
        }
    }
}

/// One side of a frame, the second with all that changed.
fn shot_view<'a>(
    place: usize,
    own: &AlgorithmChange,
    frame: &'a ChangedFrame,
    side: usize,
    images: &mut PageImages<'a>,
) -> Value {
    let shot = &frame.shots[side];
    let (algorithm, word) = (own.labels(), frame.change.word());
    let changed = changed_cells(&frame.shots);
    let places: Vec<_> = changed
        .iter()
        .map(|own| (own[0].column, own[0].row))
        .collect();
    let name = if own.algorithm == own.other_algorithm {
        format!("{algorithm} {}", ["before", "after"][side])
    } else {
        [&own.algorithm, &own.other_algorithm][side].clone()
    };
    let is = if is_wrong(shot) { "wrong" } else { "" };
    let reason = (side == 1).then(|| (word, changed_counts(&frame.shots)));
    context! {
        label => name, name, algorithm, place, reason,
        rank => "sample", is => format!("{word} {is}"), notes => notes(frame, shot, side, &changed),
        pictures => shot_pictures(shot, &places, images), ..shot_words(shot)
    }
}

/// The cells that changed, and the pictures that are missing.
fn notes(
    frame: &ChangedFrame,
    shot: &FrameShot,
    side: usize,
    changed: &[[&CellRow; 2]],
) -> Vec<String> {
    let cell = |own: &CellRow| cell_words(own) + obstacle_words(own);
    let words = changed.iter().take(MAX_LISTED).map(|[before, after]| {
        let (column, row, truth) = (before.column, before.row, truth_words(before));
        let (before, after) = (cell(before), cell(after));
        format!("({column}, {row}) {before} → {after}, true {truth}")
    });
    let more = changed.len().saturating_sub(MAX_LISTED);
    let words = words.chain((more > 0).then(|| format!("{more} more")));
    let words = words.collect::<Vec<_>>().join("; ");
    let changed = (side == 1 && !words.is_empty()).then(|| format!("changed: {words}"));
    let rows = "the report has only the rows of this frame: no disparity and error pictures";
    let rows = shot.preview.is_none().then(|| rows.to_owned());
    let why = frame.no_image.as_ref().filter(|_| side == 1);
    let why = why.map(|why| format!("no image: {why}"));
    changed.into_iter().chain(rows).chain(why).collect()
}
