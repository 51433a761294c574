//! The frames that changed most: by missed and false near obstacles, then by right minus wrong
//! cells.

use super::scored_run::ScoredRun;
use super::{AlgorithmChange, common_pairs};
use crate::rows::{CellRow, Row};
use crate::samples::{is_scene, run_key};
use crate::shots::LeftImages;
use crate::units::StoredImage;
use std::cmp::Ordering;
use std::collections::HashMap;
use svl_core::Result;
use svl_score::judge::MetricValues;
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
    /// Cells in both reports; empty without tables of cells.
    pub cells: [Vec<CellRow>; 2],
    pub harm: FrameHarm,
    /// The left image, if a folder holds it.
    pub left: Option<StoredImage>,
}

/// The numbers by which a frame became worse; negative ones are for the better. The first that is
/// not 0 decides: a robot runs into what is missed, and only stops for what is not there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FrameHarm {
    /// Change of missed near obstacles, of false ones, and of wrong minus right cells.
    changes: [f64; 3],
}

impl FrameHarm {
    /// `None` without a truth of cells.
    fn between(before: &MetricValues, after: &MetricValues) -> Option<Self> {
        let change = |name| Some(after.get(name)? - before.get(name)?);
        // Without distances no obstacle is missed or false.
        let [missed, falsely] = ["missed", "false"].map(|name| change(name).unwrap_or_default());
        Some(Self {
            changes: [missed, falsely, change("wrong")? - change("right")?],
        })
    }

    fn total_cmp(&self, other: &Self) -> Ordering {
        let pairs = self.changes.iter().zip(&other.changes);
        let orders = pairs.map(|(own, other)| own.total_cmp(other));
        orders.fold(Ordering::Equal, Ordering::then)
    }

    /// The number that decides.
    fn leading(&self) -> f64 {
        let mut changes = self.changes.iter();
        changes
            .find(|change| **change != 0.0)
            .copied()
            .unwrap_or(0.0)
    }

    pub fn is_worse(&self) -> bool {
        self.leading() > 0.0
    }

    /// The reason why the frame is shown: what changed, the most important first.
    pub fn words(&self) -> String {
        let [missed, falsely, cells] = self.changes;
        let words = |change: f64, thing: &str, rest: &str| {
            let more = if change > 0.0 { "more" } else { "fewer" };
            let number = change.abs();
            let plural = if number == 1.0 { "" } else { "s" };
            (change != 0.0).then(|| format!("{number} {more} {thing}{plural}{rest}"))
        };
        let cells = (cells != 0.0).then(|| format!("right minus wrong cells {:+}", -cells));
        let parts = [
            words(missed, "near obstacle", " missed"),
            words(falsely, "false near obstacle", ""),
            cells,
        ];
        parts.into_iter().flatten().collect::<Vec<_>>().join(", ")
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
    /// The errors of reading the tables of cells and the pictures.
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
        let scored = differing.filter_map(|(a, b)| {
            let harm = FrameHarm::between(&a.metrics, &b.metrics)?;
            Some((*a, *b, harm))
        });
        let mut scored: Vec<_> = scored.collect();
        if scored.is_empty() {
            return Ok(none(
                "Without a truth of cells no frame is better or worse.",
            ));
        }
        // Equal changes: those with an image come first. The sort is stable.
        scored.sort_by_key(|pair| !images.hold(pair.0));
        scored.sort_by(|a, b| b.2.total_cmp(&a.2));
        let mut chosen = spread(scored.iter().filter(|pair| pair.2.leading() > 0.0));
        let mut better: Vec<_> = scored
            .iter()
            .filter(|pair| pair.2.leading() < 0.0)
            .collect();
        better.sort_by(|a, b| a.2.total_cmp(&b.2));
        chosen.extend(spread(better.into_iter()));
        if chosen.is_empty() {
            return Ok(none(
                "No frame has more or fewer missed or false near obstacles, or right minus wrong \
                 cells.",
            ));
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
        let frame = |(a, b, harm): &ScoredPair<'_>| {
            let mut own = |i: usize| cells[i].remove(&a.pair_hash).unwrap_or_default();
            Ok(ChangedFrame {
                cells: [own(0), own(1)],
                left: images.read(a)?,
                rows: [a, b].map(|row| (*row).clone()),
                harm: *harm,
            })
        };
        Ok(Self {
            frames: chosen.into_iter().map(frame).collect::<Result<_>>()?,
            none: None,
        })
    }
}

/// The rows of a pair, and what it became worse by.
type ScoredPair<'a> = (&'a Row, &'a Row, FrameHarm);

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

#[cfg(test)]
mod tests {
    use super::*;

    fn harm(missed: f64, falsely: f64, cells: f64) -> FrameHarm {
        FrameHarm {
            changes: [missed, falsely, cells],
        }
    }

    #[test]
    fn obstacles_count_before_cells_and_missed_ones_first() {
        let ordered = [
            harm(2.0, -3.0, -9.0),
            harm(1.0, 4.0, 0.0),
            harm(0.0, 1.0, -5.0),
            harm(0.0, 0.0, 7.0),
            harm(0.0, 0.0, 0.0),
            harm(0.0, -1.0, 9.0),
            harm(-1.0, 8.0, 9.0),
        ];
        assert!(ordered.is_sorted_by(|a, b| a.total_cmp(b).is_gt()));
        let signs = ordered.map(|harm| harm.leading().total_cmp(&0.0) as i8);
        assert_eq!(signs, [1, 1, 1, 1, 0, -1, -1]);
    }

    #[test]
    fn the_reason_names_what_changed() {
        let words = "2 more near obstacles missed, 1 fewer false near obstacle, right minus wrong \
                     cells -4";
        assert_eq!(harm(2.0, -1.0, 4.0).words(), words);
        assert_eq!(harm(0.0, 0.0, -3.0).words(), "right minus wrong cells +3");
        assert_eq!(harm(-1.0, 0.0, 0.0).words(), "1 fewer near obstacle missed");
    }

    #[test]
    fn without_distances_cells_decide() {
        let values = |right| MetricValues::from([("right", right), ("wrong", 1.0)]);
        let found = FrameHarm::between(&values(9.0), &values(7.0));
        assert_eq!(found, Some(harm(0.0, 0.0, 2.0)));
        let none = MetricValues::default();
        assert_eq!(FrameHarm::between(&none, &values(7.0)), None);
    }
}
