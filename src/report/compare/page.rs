//! The page of a comparison: one file that answers what changed, whether it is real, and on which
//! frame.

use super::comparison::{AlgorithmChange, Comparison};
use super::courses::CourseChanges;
use super::frames::{
    BothImages, ChangedFrame, FindLeft, changed_cells, changed_counts, changed_frames,
};
use super::join::Join;
use crate::pages::html::frames::{cell_words, obstacle_words, shot_view, truth_words};
use crate::rows::records::CellRow;
use crate::show::page::parts::{PageImages, fill};
use minijinja::{Value, context};
use svl_core::Result;
use svl_score::judge::ColumnChoice;

/// Limit of the cells that a caption lists.
const MAX_LISTED: usize = 3;

/// The page as HTML, without scripts, all texts escaped.
///
/// # Errors
/// The errors of reading the tables of cells and the pictures; [`svl_core::Error::Invalid`] with
/// the error of the template engine.
pub fn page(comparison: &Comparison, join: &Join<'_>, find: &FindLeft<'_>) -> Result<String> {
    let stored = BothImages::new(join, find)?;
    let frames = join.algorithms.iter();
    let frames = frames.map(|own| changed_frames(own, &stored));
    let frames = frames.collect::<Result<Vec<_>>>()?;
    let mut images = PageImages::default();
    let algorithms = comparison.algorithms.iter().zip(&frames);
    let algorithms = algorithms.map(|(own, frames)| algorithm_view(own, frames, &mut images));
    let algorithms: Vec<_> = algorithms.collect();
    let (base, other) = (comparison.base.display(), comparison.other.display());
    let word = comparison.conclusion.word();
    let view = context! {
        title => format!("{base} → {other}"), scenario => comparison.scenario,
        conclusion => comparison.conclusion, word,
        reason => comparison.verdict.strip_prefix(word), cautions => comparison.remarks(),
        overview => comparison.overview(), algorithms, method => comparison.method,
        tested => comparison.tested, is_driven => join.is_driven, images => images.into_views(),
        reports => [base, other].map(|report| report.to_string()), origins => comparison.origins,
    };
    let (page, style) = (include_str!("page.html"), include_str!("page.css"));
    fill(page, style, &[], view)
}

fn algorithm_view<'a>(
    own: &AlgorithmChange,
    frames: &'a [ChangedFrame],
    images: &mut PageImages<'a>,
) -> Value {
    let names = if own.algorithm == own.other_algorithm {
        ["before", "after"]
    } else {
        [&*own.algorithm, &*own.other_algorithm]
    };
    let views = frames.iter().map(|frame| frame_view(frame, names, images));
    context! {
        title => own.title(), extent => own.extent(), note => note(own, frames),
        headline => own.table(&ColumnChoice::Headline), all => own.table(&ColumnChoice::All),
        course_words => own.course_words(),
        courses => own.courses.as_ref().map(CourseChanges::table),
        frames => views.collect::<Vec<_>>(),
    }
}

/// A remark on what is missing of the frames, or why there are none.
fn note(own: &AlgorithmChange, frames: &[ChangedFrame]) -> Option<&'static str> {
    let has_cells = |frame: &ChangedFrame| frame.shots.iter().all(|shot| !shot.cells.is_empty());
    let words = match own.courses {
        Some(_) => return None,
        None if own.equal_results == own.pairs => "The results of all frames are equal.",
        None if frames.is_empty() => "No frame is better or worse by a truth of cells.",
        None if !frames.iter().all(has_cells) => {
            "A report has no table of cells, so its cells are not shown."
        }
        None => return None,
    };
    Some(words)
}

/// A frame before and after, with the cells that changed.
fn frame_view<'a>(frame: &'a ChangedFrame, names: [&str; 2], images: &mut PageImages<'a>) -> Value {
    let changed = changed_cells(&frame.shots);
    let place = |[cell, _]: &[&CellRow; 2]| (cell.column, cell.row);
    let places: Vec<_> = changed.iter().map(place).collect();
    let shots = frame.shots.iter();
    let shots = shots.map(|shot| shot_view(shot, &places, images));
    let cell = |own: &CellRow| cell_words(own) + obstacle_words(own);
    let words = changed.iter().take(MAX_LISTED).map(|[before, after]| {
        let (column, row, truth) = (before.column, before.row, truth_words(before));
        format!(
            "({column}, {row}) {} → {}, true {truth}",
            cell(before),
            cell(after)
        )
    });
    let more = changed.len().saturating_sub(MAX_LISTED);
    let words = words.chain((more > 0).then(|| format!("{more} more")));
    context! {
        title => frame.shots[0].row.origin_words(), reason => changed_counts(&frame.shots),
        is_worse => frame.is_worse, no_image => frame.no_image,
        changed => words.collect::<Vec<_>>().join("; "),
        shots => names.into_iter().zip(shots).collect::<Vec<_>>(),
    }
}
