//! The frames that changed most: those of a comparison by right minus wrong cells.

use super::scored_run::ScoredRun;
use super::{AlgorithmChange, common_pairs};
use crate::rows::{CellRow, Row};
use crate::samples::{is_scene, run_key};
use crate::shots::LeftImages;
use crate::units::StoredImage;
use std::collections::HashMap;
use svl_core::Result;
use svl_score::manifest::Manifest;

/// Limit of the frames of either direction.
const MAX_FRAMES: usize = 3;
/// Least time between two frames that are shown, ns: neighbours look alike.
const MIN_GAP_NS: u64 = 1_000_000_000;

/// The frames of an algorithm that changed most, those that became worse first.
#[derive(Default)]
pub(super) struct ChangedFrames {
    pub frames: Vec<ChangedFrame>,
    /// Why there are none, in words.
    pub none: Option<&'static str>,
}

/// A frame in both runs.
pub(super) struct ChangedFrame {
    /// Before and after.
    pub rows: [Row; 2],
    /// Its cells in both; empty without tables of cells.
    pub cells: [Vec<CellRow>; 2],
    /// Right minus wrong cells, before and after.
    pub scores: [f64; 2],
    /// The left image, if a folder holds it.
    pub left: Option<StoredImage>,
}

impl ChangedFrame {
    /// The change of right minus wrong cells.
    pub fn change(&self) -> f64 {
        self.scores[1] - self.scores[0]
    }
}

/// The left image of a row's pair, found again where the report with that manifest has it from,
/// under that name of its recording.
pub type FindLeft<'a> = dyn Fn(&Manifest, Option<&str>, &Row) -> Option<StoredImage> + 'a;

/// The left images of both reports.
pub(super) struct BothImages<'a> {
    runs: [&'a ScoredRun; 2],
    images: [LeftImages; 2],
    find: &'a FindLeft<'a>,
}

impl<'a> BothImages<'a> {
    pub fn new(runs: [&'a ScoredRun; 2], find: &'a FindLeft<'a>) -> Result<Self> {
        let [base, other] = runs;
        let images = [base.left_images()?, other.left_images()?];
        Ok(Self { runs, images, find })
    }

    /// True if a folder holds the image of the row's pair.
    fn hold(&self, row: &Row) -> bool {
        let mut sides = self.runs.iter().zip(&self.images);
        sides.any(|(run, images)| images.hold(row, run.own_key(row).0.1))
    }

    fn read(&self, row: &Row) -> Result<Option<StoredImage>> {
        for (run, images) in self.runs.iter().zip(&self.images) {
            let ((_, name), _) = run.own_key(row);
            if let Some(found) = images.read(row, name)? {
                return Ok(Some(found));
            }
        }
        let mut runs = self.runs.iter();
        Ok(runs.find_map(|run| {
            let ((_, name), _) = run.own_key(row);
            (self.find)(&run.manifest, name, row)
        }))
    }
}

impl ChangedFrames {
    /// # Errors
    /// Those of reading the tables of cells and the pictures.
    pub fn find(algorithm: &AlgorithmChange, images: &BothImages<'_>) -> Result<Self> {
        let [base, other] = images.runs;
        let labels = [&*algorithm.algorithm, &*algorithm.other_algorithm];
        let (ours, theirs) = (base.rows(labels[0]), other.rows(labels[1]));
        let pairs = common_pairs(&ours, &theirs);
        let none = |why| Self {
            frames: Vec::new(),
            none: Some(why),
        };
        if pairs.iter().all(|(a, b)| a.result_hash == b.result_hash) {
            return Ok(none("The results of all frames are equal."));
        }
        let differing = pairs.iter().filter(|(a, b)| a.result_hash != b.result_hash);
        let scored = differing.filter_map(|(a, b)| Some((*a, *b, [score(a)?, score(b)?])));
        let mut scored: Vec<_> = scored.collect();
        if scored.is_empty() {
            return Ok(none(
                "Without a truth of cells no frame is better or worse.",
            ));
        }
        // Equal changes: those with an image come first. The sort is stable.
        let place = |pair: &ScoredPair<'_>| (-change(pair).abs(), !images.hold(pair.0));
        let order = |a: &(f64, bool), b: &(f64, bool)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        scored.sort_by(|a, b| order(&place(a), &place(b)));
        let worse = spread(scored.iter().filter(|pair| change(pair) < 0.0));
        let better = spread(scored.iter().filter(|pair| change(pair) > 0.0));
        let chosen: Vec<_> = worse.into_iter().chain(better).collect();
        if chosen.is_empty() {
            return Ok(none("No frame has more or fewer right minus wrong cells."));
        }
        let rows = |side: usize| chosen.iter().map(move |pair| [pair.0, pair.1][side]);
        let mut cells = [0, 1].map(|_| HashMap::new());
        for (i, run) in images.runs.iter().enumerate() {
            let wanted: HashMap<_, _> = rows(i).map(|row| (run.own_key(row), row)).collect();
            run.each_pair_of_cells(labels[i], |key, own| {
                if let Some(row) = wanted.get(&key) {
                    cells[i].insert(&row.pair_hash, own.to_vec());
                }
            })?;
        }
        let frame = |(a, b, scores): &ScoredPair<'_>| {
            let mut own = |i: usize| cells[i].remove(&a.pair_hash).unwrap_or_default();
            Ok(ChangedFrame {
                cells: [own(0), own(1)],
                left: images.read(a)?,
                rows: [a, b].map(|row| (*row).clone()),
                scores: *scores,
            })
        };
        Ok(Self {
            frames: chosen.into_iter().map(frame).collect::<Result<_>>()?,
            none: None,
        })
    }
}

/// The rows of a pair, and right minus wrong cells of each.
type ScoredPair<'a> = (&'a Row, &'a Row, [f64; 2]);

fn change(pair: &ScoredPair<'_>) -> f64 {
    pair.2[1] - pair.2[0]
}

fn score(row: &Row) -> Option<f64> {
    Some(row.metrics.get("right")? - row.metrics.get("wrong")?)
}

/// The first ones that are no neighbours of each other.
fn spread<'a, 'b: 'a>(pairs: impl Iterator<Item = &'a ScoredPair<'b>>) -> Vec<&'a ScoredPair<'b>> {
    let mut chosen: Vec<&ScoredPair<'_>> = Vec::new();
    for pair in pairs {
        let is_neighbour = |own: &&&ScoredPair<'_>| {
            let (row, own) = (pair.0, own.0);
            let gap_ns = row.stamp_ns.abs_diff(own.stamp_ns);
            run_key(row) == run_key(own) && !is_scene(row) && gap_ns < MIN_GAP_NS
        };
        if chosen.len() < MAX_FRAMES && chosen.iter().find(is_neighbour).is_none() {
            chosen.push(pair);
        }
    }
    chosen
}
