//! The frames that changed most: by missed and false near obstacles, then by right minus wrong
//! cells.

use super::join::{Join, JoinedAlgorithm};
use super::scored_run::ScoredRun;
use crate::pages::html::figures::FrameShot;
use crate::rows::held::{Row, RowRef};
use crate::rows::records::CellRow;
use crate::units::pictures::StoredImage;
use crate::units::shots::StoredShots;
use serde::Serialize;
use std::cmp::Ordering;
use std::collections::HashMap;
use svl_core::counted;
use svl_core::stereo::{Cell, CellDepth, DepthGrid, GridShape};
use svl_files::overlay::{self, NEAR_M, Nearness};
use svl_score::judge::{Metric, MetricSource};
use svl_score::manifest::Manifest;

/// Limit of the frames of a kind that are shown for their change alone.
const MAX_CHANGED: usize = 3;
/// Limit of the frames of a kind: the others are those that both reports have pictures of.
const MAX_FRAMES: usize = 5;
/// Least time between two frames that are shown, ns: neighbours look alike.
const MIN_GAP_NS: u64 = 1_000_000_000;
/// Grey of an image that is not there.
const BLANK: u8 = 64;

/// A frame in both reports.
pub(super) struct ChangedFrame {
    pub change: Ordering,
    /// Before and after; without tables of cells they have none.
    pub shots: [FrameShot; 2],
    /// The reason why neither a folder nor the recording has the left image.
    pub no_image: Option<String>,
}

/// Worse, better and equal frames, by their harm.
pub(super) const CHANGES: [Ordering; 3] = [Ordering::Greater, Ordering::Less, Ordering::Equal];

pub(super) fn change_word(change: Ordering) -> &'static str {
    match change {
        Ordering::Greater => "worse",
        Ordering::Less => "better",
        Ordering::Equal => "equal",
    }
}

/// The numbers of pairs by the changes of their cells.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct FrameCounts {
    pub better: usize,
    pub equal: usize,
    pub worse: usize,
    /// Pairs without a truth of cells, whose results are not equal.
    pub unscored: usize,
}

impl FrameCounts {
    pub(super) fn new(pairs: &[[RowRef<'_>; 2]]) -> Self {
        let changes = pairs.iter().map(|pair| Some(order(&harm(pair)?, &NO_HARM)));
        let changes: Vec<_> = changes.collect();
        let count = |change| changes.iter().filter(|own| **own == change).count();
        let [worse, better, equal] = CHANGES.map(|change| count(Some(change)));
        Self {
            better,
            equal,
            worse,
            unscored: count(None),
        }
    }

    pub(super) fn words(&self) -> String {
        let better = counted(self.better, "frame");
        let words = format!(
            "{better} better, {} equal, {} worse",
            self.equal, self.worse
        );
        match self.unscored {
            0 => words,
            frames => format!("{words}, {frames} without a truth of cells"),
        }
    }
}

/// Change of missed near obstacles, of false ones, and of wrong minus right cells; negative ones
/// are for the better. The first that is not 0 decides: a robot runs into what is missed, and only
/// stops for what is not there.
type FrameHarm = [f64; 3];

/// A frame that became neither better nor worse.
const NO_HARM: FrameHarm = [0.0; 3];

fn order(a: &FrameHarm, b: &FrameHarm) -> Ordering {
    a.partial_cmp(b).unwrap_or(Ordering::Equal)
}

/// `None` without a truth of cells, unless the results are equal.
fn harm([before, after]: &[RowRef<'_>; 2]) -> Option<FrameHarm> {
    let is_equal = before.result_hash() == after.result_hash();
    let harm = metric_harm(before.metrics(), after.metrics());
    harm.or_else(|| is_equal.then_some(NO_HARM))
}

fn metric_harm(before: impl MetricSource, after: impl MetricSource) -> Option<FrameHarm> {
    let change = |name| Some(after.get(name)? - before.get(name)?);
    // Without distances no obstacle is missed or false.
    let [missed, falsely] = ["missed", "false"].map(|name| change(name).unwrap_or_default());
    Some([missed, falsely, change("wrong")? - change("right")?])
}

/// The left image of a row's pair, found again where the report with that manifest has it from.
pub type FindLeft<'a> = dyn Fn(&Manifest, &Row) -> Result<StoredImage, String> + 'a;

/// The pictures of both reports.
pub(super) struct BothImages<'a> {
    runs: [&'a ScoredRun; 2],
    stored: [StoredShots; 2],
    find: &'a FindLeft<'a>,
}

impl<'a> BothImages<'a> {
    /// # Errors
    /// The errors of reading the pictures.
    pub fn new(join: &Join<'a>, find: &'a FindLeft<'a>) -> svl_core::Result<Self> {
        let runs = join.runs;
        let [a, b] = runs.map(|run| StoredShots::find(&run.folder));
        let stored = [a?, b?];
        Ok(Self { runs, stored, find })
    }

    /// Number of the reports that hold no picture of the pair.
    fn missing(&self, pair: &[RowRef<'_>; 2]) -> usize {
        let held = (0..2).filter(|side| self.stored[*side].hold(pair[*side]));
        2 - held.count()
    }

    /// The left image from where a report has it, or the reason why it is not there.
    fn find(&self, pair: [RowRef<'_>; 2]) -> Result<Vec<u8>, String> {
        let [first, second] = [0, 1].map(|i| (&self.runs[i].manifest, pair[i]));
        let found = (self.find)(first.0, &first.1.to_row());
        let found = found.or_else(|why| (self.find)(second.0, &second.1.to_row()).map_err(|_| why));
        found.map(|(file, _)| file)
    }
}

/// The rows of a pair, and the harm.
type ScoredPair<'a> = ([RowRef<'a>; 2], FrameHarm);

/// The frames of an algorithm that changed most, those that became worse first, and some that both
/// reports have pictures of.
///
/// # Errors
/// The errors of reading the tables of cells and the pictures.
pub(super) fn changed_frames(
    own: &JoinedAlgorithm<'_>,
    images: &BothImages<'_>,
) -> svl_core::Result<Vec<ChangedFrame>> {
    let scored = own.pairs.iter();
    let scored = scored.filter_map(|pair| Some((*pair, harm(pair)?)));
    let mut scored: Vec<ScoredPair<'_>> = scored.collect();
    // Equal changes: those with pictures come first. The sorts are stable.
    scored.sort_by_key(|(pair, _)| images.missing(pair));
    let chosen = CHANGES.iter().flat_map(|change| {
        let is_own = |(_, harm): &&ScoredPair<'_>| order(harm, &NO_HARM) == *change;
        let mut pairs: Vec<_> = scored.iter().filter(is_own).copied().collect();
        pairs.sort_by(|(_, a), (_, b)| match change {
            Ordering::Less => order(a, b),
            _ => order(b, a),
        });
        let mut chosen = Vec::new();
        spread(&pairs, MAX_CHANGED, &mut chosen);
        pairs.retain(|(pair, _)| images.missing(pair) == 0);
        spread(&pairs, MAX_FRAMES, &mut chosen);
        chosen
    });
    let chosen: Vec<_> = chosen.collect();
    let mut cells: [Vec<Vec<CellRow>>; 2] = [0, 1].map(|_| vec![Vec::new(); chosen.len()]);
    for (side, cells) in cells.iter_mut().enumerate() {
        let rows: Vec<_> = chosen.iter().map(|(pair, _)| pair[side]).collect();
        let take = |i: usize, own: &[CellRow]| cells[i] = own.to_vec();
        images.runs[side].each_pair_of_cells(own.labels[side], &rows, take)?;
    }
    let frame = |(i, (pair, harm)): (usize, ScoredPair<'_>)| {
        let [a, b] = [0, 1].map(|side| images.stored[side].read(&pair[side].to_row()));
        let mut stored = [a?, b?];
        let left = stored.iter().flatten().next();
        let left = left.map(|shot| shot.left.clone());
        let left = left.map_or_else(|| images.find(pair), Ok);
        let mut shot = |side: usize| {
            let row = pair[side].to_row();
            let cells = std::mem::take(&mut cells[side][i]);
            let stored = stored[side].take();
            let stored = stored.filter(|shot| shot.row.algorithm == row.algorithm);
            shot(row, cells, stored, left.as_ref().ok())
        };
        Ok(ChangedFrame {
            change: order(&harm, &NO_HARM),
            shots: [shot(0)?, shot(1)?],
            no_image: left.err(),
        })
    };
    chosen.into_iter().enumerate().map(frame).collect()
}

/// Adds the first ones that are no neighbours of each other, up to `limit`.
fn spread<'a>(pairs: &[ScoredPair<'a>], limit: usize, chosen: &mut Vec<ScoredPair<'a>>) {
    for pair in pairs {
        let is_neighbour = |own: &ScoredPair<'_>| {
            let (row, own) = (pair.0[0], own.0[0]);
            let gap_ns = row.stamp_ns().abs_diff(own.stamp_ns());
            row.is(own)
                || row.origin().run_key() == own.origin().run_key()
                    && !row.origin().is_scene()
                    && gap_ns < MIN_GAP_NS
        };
        if chosen.len() < limit && !chosen.iter().any(is_neighbour) {
            chosen.push(*pair);
        }
    }
}

/// A frame as the page of `svl score` shows it, as the report stored it, else from its tables.
/// `left`: the file, or nothing for a blank image.
fn shot(
    row: Row,
    cells: Vec<CellRow>,
    stored: Option<FrameShot>,
    left: Option<&Vec<u8>>,
) -> svl_core::Result<FrameShot> {
    let size = (row.width as usize, row.height as usize);
    let blank = || svl_files::encode_png(size.0, size.1, &vec![BLANK; size.0 * size.1]);
    let shot = match stored {
        Some(shot) => FrameShot { row, ..shot },
        None => FrameShot {
            row,
            left: left.map_or_else(blank, |file| Ok(file.clone()))?,
            size,
            ..FrameShot::default()
        },
    };
    if !shot.cells.is_empty() {
        return Ok(shot);
    }
    let most = |number: fn(&CellRow) -> u32| cells.iter().map(number).max().unwrap_or(0) as usize;
    let shape = GridShape {
        columns: 1 + most(|cell| cell.column),
        rows: 1 + most(|cell| cell.row),
    };
    let nearness = nearness(&cells, size.0);
    let marks = |depth: fn(&CellRow) -> Option<CellDepth>| {
        let cells = cells.iter().map(|cell| Cell {
            depth: depth(cell),
            ..Cell::UNKNOWN
        });
        let grid = DepthGrid::new(shape, cells.collect());
        grid.map_or_else(|_| Vec::new(), |grid| overlay::marks(&grid, size, nearness))
    };
    Ok(FrameShot {
        estimate: marks(|cell| cell.depth(None)),
        // The table of cells has no percentiles of the truth.
        truth: Some(marks(|cell| {
            Some(CellDepth::at(cell.true_median_px? as f32, None))
        })),
        cells,
        ..shot
    })
}

/// The scale of the squares: a true distance gives the disparity of [`NEAR_M`].
fn nearness(cells: &[CellRow], width: usize) -> Nearness {
    let px_m = cells.iter();
    let mut px_m = px_m.filter_map(|own| Some(own.true_median_px? * own.true_distance_m?));
    let truths = cells.iter().filter_map(|cell| cell.true_median_px);
    let near_px = match px_m.next() {
        Some(px_m) => (px_m / NEAR_M).min(width as f64 / 4.0),
        None => truths.fold(1.0, f64::max),
    };
    Nearness::new(near_px, 0.0)
}

/// The counts of a frame that changed, in words, the most important first.
pub(super) fn changed_counts(shots: &[FrameShot; 2]) -> String {
    let words = |name: &&str| {
        let [before, after] = shots.each_ref().map(|shot| shot.row.metrics.get(name));
        let (before, after) = (before?, after?);
        let words = Metric::find(name)?.words;
        (before != after).then(|| format!("{words} {before} → {after}"))
    };
    let names = ["missed", "false", "right", "wrong", "unknown"];
    let names = names.iter().filter_map(words).collect::<Vec<_>>();
    names.join(", ")
}

/// The cells with another verdict before and after, or another obstacle, these first.
pub(super) fn changed_cells(shots: &[FrameShot; 2]) -> Vec<[&CellRow; 2]> {
    let place = |cell: &CellRow| (cell.column, cell.row);
    let obstacle = |cell: &CellRow| (cell.missed, cell.r#false);
    let after = shots[1].cells.iter().map(|cell| (place(cell), cell));
    let after: HashMap<_, _> = after.collect();
    let both = shots[0].cells.iter();
    let both = both.filter_map(|cell| Some([cell, *after.get(&place(cell))?]));
    let is_other = |[a, b]: &[&CellRow; 2]| a.verdict != b.verdict || obstacle(a) != obstacle(b);
    let mut changed: Vec<_> = both.filter(is_other).collect();
    // The sort is stable.
    changed.sort_by_key(|[a, b]| obstacle(a) == obstacle(b));
    changed
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_score::judge::MetricValues;

    #[test]
    fn obstacles_count_before_cells_and_missed_ones_first() {
        let ordered = [
            [2.0, -3.0, -9.0],
            [1.0, 4.0, 0.0],
            [0.0, 1.0, -5.0],
            [0.0, 0.0, 7.0],
            NO_HARM,
            [0.0, -1.0, 9.0],
            [-1.0, 8.0, 9.0],
        ];
        assert!(ordered.is_sorted_by(|a, b| a > b));
    }

    #[test]
    fn without_distances_cells_decide() {
        let values = |right| MetricValues::from([("right", right), ("wrong", 1.0)]);
        assert_eq!(metric_harm(values(9.0), values(7.0)), Some([0.0, 0.0, 2.0]));
        let none = MetricValues::default();
        assert_eq!(metric_harm(none, values(7.0)), None);
    }
}
