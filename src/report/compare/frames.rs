//! The frames that changed most: by missed and false near obstacles, then by right minus wrong
//! cells.

use super::join::{Join, JoinedAlgorithm};
use super::scored_run::ScoredRun;
use crate::pages::html::figures::FrameShot;
use crate::rows::records::{CellRow, Row};
use crate::rows::samples::{is_scene, run_key};
use crate::units::pictures::StoredImage;
use crate::units::shots::LeftImages;
use std::cmp::Ordering;
use std::collections::HashMap;
use svl_core::stereo::{Cell, CellDepth, DepthGrid, GridShape};
use svl_files::overlay::{self, NEAR_M, Nearness};
use svl_score::judge::{Metric, MetricValues};
use svl_score::manifest::Manifest;

/// Limit of the frames of either direction.
const MAX_FRAMES: usize = 3;
/// Least time between two frames that are shown, ns: neighbours look alike.
const MIN_GAP_NS: u64 = 1_000_000_000;
/// Grey of an image that is not there.
const BLANK: u8 = 64;

/// A frame in both reports.
pub(super) struct ChangedFrame {
    pub is_worse: bool,
    /// Before and after; without tables of cells they have none.
    pub shots: [FrameShot; 2],
    /// The reason why neither a folder nor the recording has the left image.
    pub no_image: Option<String>,
}

/// Change of missed near obstacles, of false ones, and of wrong minus right cells; negative ones
/// are for the better. The first that is not 0 decides: a robot runs into what is missed, and only
/// stops for what is not there.
type FrameHarm = [f64; 3];

/// A frame that became neither better nor worse.
const NO_HARM: FrameHarm = [0.0; 3];

/// `None` without a truth of cells.
fn harm(before: &MetricValues, after: &MetricValues) -> Option<FrameHarm> {
    let change = |name| Some(after.get(name)? - before.get(name)?);
    // Without distances no obstacle is missed or false.
    let [missed, falsely] = ["missed", "false"].map(|name| change(name).unwrap_or_default());
    Some([missed, falsely, change("wrong")? - change("right")?])
}

/// The left image of a row's pair, found again where the report with that manifest has it from.
pub type FindLeft<'a> = dyn Fn(&Manifest, &Row) -> Result<StoredImage, String> + 'a;

/// The left images of both reports.
pub(super) struct BothImages<'a> {
    runs: [&'a ScoredRun; 2],
    images: [LeftImages; 2],
    find: &'a FindLeft<'a>,
}

impl<'a> BothImages<'a> {
    /// # Errors
    /// The errors of reading the pictures.
    pub fn new(join: &Join<'a>, find: &'a FindLeft<'a>) -> svl_core::Result<Self> {
        let runs = join.runs;
        let [a, b] = runs.map(|run| LeftImages::find(&run.folder));
        let images = [a?, b?];
        Ok(Self { runs, images, find })
    }

    /// True if a folder holds the image of the pair.
    fn hold(&self, pair: [&Row; 2]) -> bool {
        (0..2).any(|side| self.images[side].hold(pair[side]))
    }

    /// The image, or the reason why it is not there.
    fn read(&self, pair: [&Row; 2]) -> svl_core::Result<Result<StoredImage, String>> {
        for (images, row) in self.images.iter().zip(pair) {
            if let Some(found) = images.read(row)? {
                return Ok(Ok(found));
            }
        }
        let [first, second] = [0, 1].map(|i| (&self.runs[i].manifest, pair[i]));
        let found = (self.find)(first.0, first.1);
        Ok(found.or_else(|why| (self.find)(second.0, second.1).map_err(|_| why)))
    }
}

/// The rows of a pair, and the harm.
type ScoredPair<'a> = ([&'a Row; 2], FrameHarm);

/// The frames of an algorithm that changed most, those that became worse first.
///
/// # Errors
/// The errors of reading the tables of cells and the pictures.
pub(super) fn changed_frames(
    own: &JoinedAlgorithm<'_>,
    images: &BothImages<'_>,
) -> svl_core::Result<Vec<ChangedFrame>> {
    let scored = own.pairs.iter().filter_map(|pair| {
        let [before, after] = pair.map(|row| &row.metrics);
        Some((*pair, harm(before, after).filter(|harm| *harm != NO_HARM)?))
    });
    let mut scored: Vec<ScoredPair<'_>> = scored.collect();
    // Equal changes: those with an image come first. The sorts are stable.
    scored.sort_by_key(|(pair, _)| !images.hold(*pair));
    let order = |a: &FrameHarm, b: &FrameHarm| a.partial_cmp(b).unwrap_or(Ordering::Equal);
    let is_worse = |(_, harm): &ScoredPair<'_>| *harm > NO_HARM;
    let (mut worse, mut better): (Vec<_>, Vec<_>) = scored.into_iter().partition(is_worse);
    worse.sort_by(|(_, a), (_, b)| order(b, a));
    better.sort_by(|(_, a), (_, b)| order(a, b));
    let chosen = [spread(&worse), spread(&better)].concat();
    let mut cells: [Vec<Vec<CellRow>>; 2] = [0, 1].map(|_| vec![Vec::new(); chosen.len()]);
    for (side, cells) in cells.iter_mut().enumerate() {
        let rows: Vec<_> = chosen.iter().map(|(pair, _)| pair[side]).collect();
        let take = |i: usize, own: &[CellRow]| cells[i] = own.to_vec();
        images.runs[side].each_pair_of_cells(own.labels[side], &rows, take)?;
    }
    let frame = |(i, (pair, harm)): (usize, ScoredPair<'_>)| {
        let (left, no_image) = match images.read(pair)? {
            Ok((file, _)) => (Some(file), None),
            Err(why) => (None, Some(why)),
        };
        let mut shot = |side: usize| {
            let cells = std::mem::take(&mut cells[side][i]);
            shot(pair[side], cells, left.as_deref())
        };
        let mut shots = [shot(0)?, shot(1)?];
        // The truth of both is shown once.
        shots[0].truth = None;
        Ok(ChangedFrame {
            is_worse: harm > NO_HARM,
            shots,
            no_image,
        })
    };
    chosen.into_iter().enumerate().map(frame).collect()
}

/// The first ones that are no neighbours of each other.
fn spread<'a>(pairs: &[ScoredPair<'a>]) -> Vec<ScoredPair<'a>> {
    let mut chosen: Vec<ScoredPair<'_>> = Vec::new();
    for pair in pairs {
        let is_neighbour = |own: &ScoredPair<'_>| {
            let (row, own) = (pair.0[0], own.0[0]);
            let gap_ns = row.stamp_ns.abs_diff(own.stamp_ns);
            run_key(row) == run_key(own) && !is_scene(row) && gap_ns < MIN_GAP_NS
        };
        if chosen.len() < MAX_FRAMES && !chosen.iter().any(is_neighbour) {
            chosen.push(*pair);
        }
    }
    chosen
}

/// A frame as the page of `svl score` shows it, from the tables of a report. `left`: the file, or
/// nothing for a blank image.
fn shot(row: &Row, cells: Vec<CellRow>, left: Option<&[u8]>) -> svl_core::Result<FrameShot> {
    let size = (row.width as usize, row.height as usize);
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
    let blank = || svl_files::encode_png(size.0, size.1, &vec![BLANK; size.0 * size.1]);
    Ok(FrameShot {
        row: row.clone(),
        passed: None,
        failures: Vec::new(),
        findings: Vec::new(),
        left: left.map_or_else(blank, |file| Ok(file.to_vec()))?,
        size,
        estimate: marks(CellRow::depth),
        // The table of cells has no percentiles of the truth.
        truth: Some(marks(|cell| {
            Some(CellDepth::at(cell.true_median_px? as f32, None))
        })),
        preview: None,
        true_preview: None,
        errors: None,
        cells,
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
        assert_eq!(harm(&values(9.0), &values(7.0)), Some([0.0, 0.0, 2.0]));
        let none = MetricValues::default();
        assert_eq!(harm(&none, &values(7.0)), None);
    }
}
