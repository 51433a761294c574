//! The page of a comparison: one file that answers what changed, whether it is real, on which
//! frame, and whether to merge.

mod cells;

use super::frames::{BothImages, ChangedFrame, ChangedFrames, FindLeft};
use super::scored_run::ScoredRun;
use super::text::change_table;
use super::{AlgorithmChange, Comparison, Conclusion, CourseChanges};
use crate::page::{ImageView, PageImages, fill};
use crate::table::Table;
use cells::ChangedFrameView;
use serde::Serialize;
use svl_core::{Result, counted};
use svl_score::judge::ColumnChoice;

/// Limit of the rows of what is worse besides the headline.
const MAX_BESIDES: usize = 3;
const HEADS: [&str; 2] = ["before", "after"];

/// Everything the page of a comparison shows.
pub struct ComparisonPage<'a> {
    comparison: &'a Comparison,
    /// Per algorithm of the comparison.
    frames: Vec<ChangedFrames>,
}

impl<'a> ComparisonPage<'a> {
    /// The page of the comparison of these two reports.
    ///
    /// # Errors
    /// The errors of reading the tables of cells and the pictures.
    pub fn new(
        comparison: &'a Comparison,
        base: &ScoredRun,
        other: &ScoredRun,
        find: &FindLeft<'_>,
    ) -> Result<Self> {
        let images = BothImages::new([base, other], find)?;
        let frames = comparison.algorithms.iter();
        let frames = frames.map(|algorithm| match algorithm.courses {
            Some(_) => Ok(ChangedFrames::default()),
            None => ChangedFrames::find(algorithm, &images),
        });
        Ok(Self {
            comparison,
            frames: frames.collect::<Result<_>>()?,
        })
    }

    /// The page as HTML, without scripts, all texts escaped.
    ///
    /// # Errors
    /// [`svl_core::Error::Invalid`] with the error of the template engine.
    pub fn render(&self) -> Result<String> {
        let comparison = self.comparison;
        let mut images = PageImages::default();
        let algorithms = comparison.algorithms.iter().zip(&self.frames);
        let algorithms =
            algorithms.map(|(own, frames)| ComparedAlgorithmView::new(own, frames, &mut images));
        let algorithms: Vec<_> = algorithms.collect();
        let conclusion = comparison.conclusion();
        let view = ComparisonView {
            title: format!(
                "{} → {}",
                comparison.base.display(),
                comparison.other.display()
            ),
            scenario: &comparison.scenario,
            conclusion,
            word: conclusion.word(),
            reason: comparison.verdict_reason(conclusion),
            advice: comparison.advice(),
            not_compared: comparison.not_compared().collect(),
            cautions: comparison.cautions().collect(),
            overview: (algorithms.len() > 1).then(|| comparison.overview(&ColumnChoice::Headline)),
            algorithms,
            level: comparison.method.level,
            fewest_blocks: comparison.method.fewest_blocks,
            tested: comparison.tested,
            is_driven: comparison.is_driven(),
            images: images.into_views(),
            identity: identity(comparison),
        };
        fill(include_str!("page.html"), include_str!("page.css"), view)
    }
}

/// The origin of the reports, and the method of the comparison.
fn identity(comparison: &Comparison) -> Vec<(&'static str, String)> {
    let Comparison {
        base,
        other,
        origins,
        method,
        ..
    } = comparison;
    let entry = |name: &'static str, value: String| (name, value);
    let seed = method.resamples.zip(method.seed);
    let length = method.block_length;
    let fixed = [
        entry("before", base.display().to_string()),
        entry("made by", origins[0].to_string()),
        entry("after", other.display().to_string()),
        entry("made by", origins[1].to_string()),
        entry("test", format!("{}, at {}", method.name, method.level)),
        entry("fewest blocks or courses", method.fewest_blocks.to_string()),
    ];
    let resamples =
        seed.map(|(resamples, seed)| entry("resamples", format!("{resamples}, seed {seed}")));
    let length =
        length.map(|length| entry("block length", format!("{length} pairs of a run of n")));
    fixed.into_iter().chain(resamples).chain(length).collect()
}

#[derive(Serialize)]
struct ComparisonView<'a> {
    title: String,
    scenario: &'a str,
    conclusion: Conclusion,
    word: &'static str,
    reason: String,
    advice: String,
    not_compared: Vec<String>,
    cautions: Vec<String>,
    /// A row for each of several algorithms.
    overview: Option<Table>,
    algorithms: Vec<ComparedAlgorithmView<'a>>,
    level: &'static str,
    fewest_blocks: usize,
    tested: usize,
    is_driven: bool,
    images: Vec<ImageView>,
    identity: Vec<(&'static str, String)>,
}

#[derive(Serialize)]
struct ComparedAlgorithmView<'a> {
    title: String,
    extent: String,
    headline: Table,
    besides: Table,
    /// Number of those that are worse besides and have no row.
    more_besides: usize,
    all: Table,
    worse: Vec<ChangedFrameView<'a>>,
    better: Vec<ChangedFrameView<'a>>,
    /// The courses that changed, and the number of those without a row.
    courses: Option<(Table, usize)>,
    /// A remark on what the frames lack, or why there are none.
    note: Option<String>,
}

impl<'a> ComparedAlgorithmView<'a> {
    fn new(
        algorithm: &AlgorithmChange,
        frames: &'a ChangedFrames,
        images: &mut PageImages<'a>,
    ) -> Self {
        let besides = algorithm.worse_besides();
        let more_besides = besides.len().saturating_sub(MAX_BESIDES);
        let shown = algorithm.shown(&ColumnChoice::Headline);
        let labels = if algorithm.algorithm == algorithm.other_algorithm {
            HEADS.map(str::to_owned)
        } else {
            [&algorithm.algorithm, &algorithm.other_algorithm].map(Clone::clone)
        };
        let views = frames.frames.iter();
        let views = views.map(|frame| (frame, ChangedFrameView::new(frame, &labels, images)));
        let (worse, better): (Vec<_>, Vec<_>) = views.partition(|(frame, _)| frame.harm.is_worse());
        let views = |frames: Vec<(&ChangedFrame, ChangedFrameView<'a>)>| {
            frames.into_iter().map(|(_, view)| view).collect()
        };
        Self {
            title: algorithm.title(),
            extent: algorithm.extent(),
            headline: change_table(HEADS, shown.into_iter()),
            besides: change_table(HEADS, besides.into_iter().take(MAX_BESIDES)),
            more_besides,
            all: change_table(HEADS, algorithm.changes()),
            worse: views(worse),
            better: views(better),
            courses: algorithm.courses.as_ref().map(CourseChanges::table),
            note: note(frames),
        }
    }
}

/// A remark on what is missing of the frames, or why there are none.
fn note(frames: &ChangedFrames) -> Option<String> {
    if let Some(why) = frames.none {
        return Some(why.to_owned());
    }
    let all = frames.frames.len();
    if frames
        .frames
        .iter()
        .any(|frame| frame.cells.iter().any(Vec::is_empty))
    {
        return Some("A report has no table of cells, so the cells are not shown.".to_owned());
    }
    let lacking = frames
        .frames
        .iter()
        .filter(|frame| frame.left.is_none())
        .count();
    let frames = match lacking {
        0 => return None,
        n if n == all => "these frames".to_owned(),
        n => counted(n as u64, "frame"),
    };
    Some(format!(
        "The cells of {frames} stand alone: their images are neither in the folders, nor rendered \
         by svl, nor in its own recordings."
    ))
}
