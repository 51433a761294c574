//! The page of a comparison: one file that answers what changed, whether it is real, and on which
//! frame.

use super::comparison::{AlgorithmChange, Comparison};
use super::courses::CourseChanges;
use super::frames::{
    BothImages, CHANGES, ChangedFrame, FindLeft, change_word, changed_cells, changed_counts,
    changed_frames,
};
use super::join::Join;
use crate::pages::html::figures::FrameShot;
use crate::pages::html::frames::{
    cell_words, frame_name, is_wrong, obstacle_words, shot_pictures, shot_words, true_pictures,
    truth_words,
};
use crate::pages::html::scenes::picture_colors;
use crate::rows::held::Row;
use crate::rows::records::CellRow;
use crate::show::page::parts::{PageImages, fill};
use minijinja::{Value, context};
use std::collections::BTreeSet;
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
    let both = comparison.algorithms.iter().zip(&join.algorithms);
    let frames = both.map(|(own, joined)| {
        let is_shown = own.frames.is_some() && own.equal_results < own.pairs;
        let frames = is_shown.then(|| changed_frames(joined, &stored));
        frames.unwrap_or_else(|| Ok(Vec::new()))
    });
    let frames = frames.collect::<Result<Vec<_>>>()?;
    let mut images = PageImages::default();
    let both = || comparison.algorithms.iter().zip(&frames);
    let shown = || both().flat_map(|(own, frames)| frames.iter().map(move |frame| (own, frame)));
    let runs: BTreeSet<_> = shown()
        .map(|(_, frame)| frame.shots[0].row.origin().run_key())
        .collect();
    let entries = shown().enumerate().map(|(i, (_, frame))| {
        let words = match runs.len() {
            1 => format!("frame {}", frame.shots[0].row.sequence),
            _ => frame.shots[0].row.origin().words(),
        };
        (format!("f{i}"), words)
    });
    let entries: Vec<_> = entries.collect();
    let pictured = both().filter(|(_, frames)| !frames.is_empty());
    let pictured: Vec<_> = pictured.map(|(own, _)| own.labels()).collect();
    let figures = shown().enumerate();
    let figures = figures.map(|(i, (own, frame))| {
        let title = frame_title(join, &frame.shots[0].row);
        figure_view((i, title), own, frame, &mut images)
    });
    let figures: Vec<_> = figures.collect();
    let filters = CHANGES
        .map(change_word)
        .into_iter()
        .map(|word| (word, word));
    let mut shots = shown().flat_map(|(_, frame)| &frame.shots);
    let mut records = join.runs.iter().flat_map(|run| &run.manifest.algorithms);
    let (base, other) = (comparison.base.display(), comparison.other.display());
    let word = comparison.conclusion.word();
    let view = context! {
        title => format!("{base} → {other}"), scenario => comparison.scenario,
        conclusion => comparison.conclusion, word,
        reason => comparison.verdict.strip_prefix(word), cautions => comparison.remarks(),
        overview => comparison.overview(),
        algorithms => both().map(|(own, frames)| algorithm_view(own, frames)).collect::<Vec<_>>(),
        method => comparison.method,
        tested => comparison.tested, is_driven => join.is_driven, entries, pictured,
        filters => filters.chain([("wrong", "wrong only")]).collect::<Vec<_>>(),
        figures, has_errors => shots.any(|shot| shot.errors.is_some()),
        has_v5 => records.any(|own| own.name == "v5"),
        reports => [base, other].map(|report| report.to_string()), origins => comparison.origins,
        images => images.into_views(), ..picture_colors()
    };
    let (page, style) = (include_str!("page.html"), include_str!("page.css"));
    fill(page, style, &[], view)
}

fn algorithm_view(own: &AlgorithmChange, frames: &[ChangedFrame]) -> Value {
    let counts = own.frames.unwrap_or_default();
    let numbers = [counts.worse, counts.better, counts.equal];
    context! {
        title => own.title(), label => own.labels(), extent => own.extent(),
        note => note(own, frames),
        numbers => CHANGES.map(change_word).into_iter().zip(numbers).collect::<Vec<_>>(),
        headline => own.drawn_table(&ColumnChoice::Headline),
        all => own.drawn_table(&ColumnChoice::All),
        by_distance => own.distance_tables(),
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

/// The origin of a frame, and its time in the recording.
fn frame_title(join: &Join<'_>, row: &Row) -> String {
    let origin = row.origin().words();
    let run = join.runs[0].rows.iter();
    let run = run.filter(|own| own.origin().run_key() == row.origin().run_key());
    let began = run.filter_map(|row| row.origin().time_ns()).min();
    let is_timed = !join.runs[0].manifest.is_untimed(row.run.as_deref());
    let ns = row.origin().time_ns().zip(began).filter(|_| is_timed);
    let ns = ns.map(|(ns, began)| ns - began);
    ns.map_or(origin.clone(), |ns| {
        format!("{origin}, at {:.1} s", ns as f64 / 1e9)
    })
}

/// A frame before and after, for the template.
fn figure_view<'a>(
    (place, title): (usize, String),
    own: &AlgorithmChange,
    frame: &'a ChangedFrame,
    images: &mut PageImages<'a>,
) -> Value {
    let (algorithm, word) = (own.labels(), change_word(frame.change));
    let changed = changed_cells(&frame.shots);
    let places: Vec<_> = changed
        .iter()
        .map(|[own, _]| (own.column, own.row))
        .collect();
    let shots = [0, 1].map(|side| {
        let shot = &frame.shots[side];
        let name = if own.algorithm == own.other_algorithm {
            format!("{algorithm} {}", ["before", "after"][side])
        } else {
            [&own.algorithm, &own.other_algorithm][side].clone()
        };
        let is = if is_wrong(shot) { "wrong" } else { "" };
        let reason = (side == 1).then(|| (word, changed_counts(&frame.shots)));
        context! {
            label => name, name, algorithm, place, reason, rank => "sample",
            is => format!("{word} {is}"), notes => notes(frame, side, &changed),
            pictures => shot_pictures(shot, &places, images), ..shot_words(shot)
        }
    });
    // The truth of both is shown once.
    let shown = |shot: &&FrameShot| (shot.true_preview.is_some(), !shot.cells.is_empty());
    let truth = frame.shots.iter().max_by_key(shown);
    context! {
        title, about => "", is_film => false,
        frame => frame_name(&frame.shots[0].row), shots,
        truth => truth.map(|shot| true_pictures(shot, images)).unwrap_or_default(),
    }
}

/// The cells that changed, and the pictures that are missing.
fn notes(frame: &ChangedFrame, side: usize, changed: &[[&CellRow; 2]]) -> Vec<String> {
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
    let is_stored = frame.shots[side].preview.is_some();
    let rows = (!is_stored).then(|| rows.to_owned());
    let why = frame.no_image.as_ref().filter(|_| side == 1);
    let why = why.map(|why| format!("no image: {why}"));
    changed.into_iter().chain(rows).chain(why).collect()
}
