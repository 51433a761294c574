//! The worst frames of an algorithm.

use crate::pages::html::figures::{CheckpointFigure, SceneFigure};
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;

/// The number of frames of an algorithm that a unit and a page show as its worst.
pub const MAX_WORST: usize = 5;
/// No two of the frames of a recording are within this time.
const MIN_APART_NS: u64 = 1_000_000_000;

/// The rank of a frame among the worst: by a test piece that is not seen, the nearest first, then
/// by its missed cells, then by its wrong ones, then by its largest error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Badness {
    /// The inverse of the distance of the test piece that is not seen, 1/m; 0 without one.
    pub unseen: f64,
    pub missed: u64,
    pub wrong: u64,
    /// In tolerances of its cell.
    pub error: f64,
}

impl Badness {
    /// The worse is the greater.
    pub fn order(&self, other: &Self) -> Ordering {
        let counts = (self.missed, self.wrong).cmp(&(other.missed, other.wrong));
        let nearness = self.unseen.total_cmp(&other.unseen);
        nearness
            .then(counts)
            .then(self.error.total_cmp(&other.error))
    }
}

/// A frame that is one of an algorithm's worst, or may be.
#[derive(Clone, Serialize, Deserialize)]
pub struct WorstFrame<T> {
    pub badness: Badness,
    /// The place of its run among all.
    pub run: usize,
    /// The place of the pair in its run.
    pub place: u64,
    /// Stamp of the pair; absent for a scene, which follows none.
    pub stamp_ns: Option<u64>,
    pub picture: T,
}

impl<T> WorstFrame<T> {
    /// The worse is the less, and of equal ones the first.
    fn order<U>(&self, other: &WorstFrame<U>) -> Ordering {
        let places = (self.run, self.place).cmp(&(other.run, other.place));
        other.badness.order(&self.badness).then(places)
    }

    /// The frame without its picture.
    pub fn key(&self) -> WorstFrame<()> {
        WorstFrame {
            badness: self.badness,
            run: self.run,
            place: self.place,
            stamp_ns: self.stamp_ns,
            picture: (),
        }
    }

    fn is_near<U>(&self, other: &WorstFrame<U>) -> bool {
        let stamps = self.stamp_ns.zip(other.stamp_ns);
        let apart_ns = stamps.map(|(a, b)| a.abs_diff(b));
        self.run == other.run && apart_ns.is_some_and(|ns| ns < MIN_APART_NS)
    }

    /// The frame with that picture, and its own.
    pub fn replace<U>(self, picture: U) -> (WorstFrame<U>, T) {
        let frame = WorstFrame {
            badness: self.badness,
            run: self.run,
            place: self.place,
            stamp_ns: self.stamp_ns,
            picture,
        };
        (frame, self.picture)
    }
}

/// The picture of a unit's frame.
#[derive(Clone, Serialize, Deserialize)]
pub enum WorstPicture {
    Frame(Box<CheckpointFigure>),
    Scene(Box<SceneFigure>),
    /// That of the frame or scene at its place, which the unit has besides.
    Sample,
}

/// The worst of frames that come one by one, those of a run in the order of their stamps. Each is
/// a second away from all worse ones of its run that are chosen. What is kept is all that may be
/// chosen, whatever comes before the first frame of the run or after the last one.
pub struct WorstFrames<T> {
    /// The worst first; of equal ones the first leads.
    frames: Vec<WorstFrame<T>>,
    /// The last run, and its first and last stamp.
    run: Option<(usize, [u64; 2])>,
    /// The last of as many frames as are chosen that are certain: no better one is.
    least: Option<WorstFrame<()>>,
}

impl<T> Default for WorstFrames<T> {
    fn default() -> Self {
        Self {
            frames: Vec::new(),
            run: None,
            least: None,
        }
    }
}

impl<T> WorstFrames<T> {
    /// Takes a frame if it may be one of the worst: never one without a fault.
    pub fn add(&mut self, frame: WorstFrame<()>, picture: impl FnOnce() -> T) {
        if let Some(now) = frame.stamp_ns {
            let known = self.run.filter(|(run, _)| *run == frame.run);
            let (_, [first, last]) = known.unwrap_or((frame.run, [now; 2]));
            self.run = Some((frame.run, [first.min(now), last.max(now)]));
        }
        let is_outdone = |least: &WorstFrame<()>| least.order(&frame).is_lt();
        let Badness { missed, wrong, .. } = frame.badness;
        let is_good = missed + wrong == 0 && frame.badness.unseen == 0.0;
        if is_good || self.least.as_ref().is_some_and(is_outdone) {
            return;
        }
        let worse = |own: &WorstFrame<T>| own.order(&frame).is_lt();
        let place = self.frames.partition_point(worse);
        let mut keys: Vec<_> = self.frames.iter().map(WorstFrame::key).collect();
        keys.insert(place, frame.clone());
        let mut needed = self.needed(&keys);
        if needed.remove(place) {
            let mut needed = needed.into_iter();
            self.frames.retain(|_| needed.next().unwrap_or_default());
            let place = self.frames.partition_point(|own| own.order(&frame).is_lt());
            self.frames.insert(place, frame.replace(picture()).0);
        }
    }

    /// The frames that are chosen if no others come, the worst first.
    pub fn finish(self) -> Vec<WorstFrame<T>> {
        let mut chosen: Vec<WorstFrame<T>> = Vec::new();
        for frame in self.frames {
            if chosen.len() < MAX_WORST && !chosen.iter().any(|own| own.is_near(&frame)) {
                chosen.push(frame);
            }
        }
        chosen
    }

    /// Per frame, the worst first, if it may be chosen, whatever other frames there are. Notes the
    /// last certain one.
    fn needed(&mut self, keys: &[WorstFrame<()>]) -> Vec<bool> {
        let mut needed: Vec<bool> = Vec::new();
        let mut certain = 0;
        for (i, own) in keys.iter().enumerate() {
            // The kept ones that are worse than a frame and may hide it.
            let near = |i: usize| {
                let worse = needed.iter().take(i).enumerate();
                let kept = worse.filter(|(_, is_needed)| **is_needed).map(|(j, _)| j);
                kept.filter(move |j| keys[*j].is_near(&keys[i]))
            };
            // Another frame hides it, or is hidden by one that hides this one, too.
            let is_hidden = near(i).any(|j| {
                let [before, after] = self.open_sides(&keys[j]);
                let is_between = (!before || own.stamp_ns <= keys[j].stamp_ns)
                    && (!after || own.stamp_ns >= keys[j].stamp_ns);
                is_between && near(j).all(|h| keys[h].is_near(own))
            });
            let is_needed = !is_hidden && certain < MAX_WORST;
            if is_needed && near(i).next().is_none() && self.open_sides(own) == [false; 2] {
                certain += 1;
                if certain == MAX_WORST {
                    self.least = Some(own.clone());
                }
            }
            needed.push(is_needed);
        }
        needed
    }

    /// True if a frame before the first of its run, or after the last, may be near.
    fn open_sides(&self, own: &WorstFrame<()>) -> [bool; 2] {
        let run = self.run.filter(|(run, _)| *run == own.run);
        let ends = run.zip(own.stamp_ns);
        ends.map_or([false; 2], |((_, ends), stamp_ns)| {
            ends.map(|end| end.abs_diff(stamp_ns) < MIN_APART_NS)
        })
    }
}

impl<T> WorstFrames<Option<T>> {
    /// The frames that may be chosen in the end, and whose pictures were not taken before, in the
    /// order in which they came.
    pub fn take_pictures(&mut self) -> Vec<WorstFrame<T>> {
        let frames = self.frames.iter_mut().filter_map(|frame| {
            let picture = frame.picture.take()?;
            Some(frame.key().replace(picture).0)
        });
        let mut frames: Vec<_> = frames.collect();
        frames.sort_by_key(|frame| (frame.run, frame.place));
        frames
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cmp::Reverse;

    /// The frames of a run that are chosen, in blocks of that many, by tenths of a second and
    /// number of wrong cells; and the most that a block keeps. `restarts`: each block is of another
    /// session.
    fn chosen_in(frames: &[(u64, u64)], block: usize, restarts: bool) -> (Vec<(u64, u64)>, usize) {
        let (mut all, mut worst) = (WorstFrames::default(), WorstFrames::default());
        let mut most = 0;
        for (number, own) in frames.chunks(block).enumerate() {
            if restarts {
                worst = WorstFrames::default();
            }
            for (i, &(tenths, wrong)) in own.iter().enumerate() {
                let frame = WorstFrame {
                    badness: Badness {
                        wrong,
                        ..Badness::default()
                    },
                    run: 0,
                    place: (number * block + i) as u64,
                    stamp_ns: Some(tenths * 100_000_000),
                    picture: (),
                };
                worst.add(frame, || Some((tenths, wrong)));
            }
            let own = worst.take_pictures();
            most = most.max(own.len());
            for frame in own {
                let (frame, picture) = frame.replace(());
                all.add(frame, || picture);
            }
        }
        let frames = all.finish().into_iter();
        (frames.map(|frame| frame.picture).collect(), most)
    }

    fn chosen(frames: &[(u64, u64)]) -> Vec<(u64, u64)> {
        chosen_in(frames, usize::MAX, false).0
    }

    #[test]
    fn frames_within_a_second_of_a_worse_one_are_not_shown() {
        let frames = [(0, 5), (8, 6), (16, 7), (30, 1), (39, 2), (49, 2)];
        assert_eq!(chosen(&frames), [(16, 7), (0, 5), (39, 2), (49, 2)]);
        // Neighbours of the worst do not keep a frame away that is far from it.
        let near = (0..9).map(|tenths| (tenths, 10 - tenths));
        let frames: Vec<_> = near.chain([(30, 1)]).collect();
        assert_eq!(chosen(&frames), [(0, 10), (30, 1)]);
    }

    #[test]
    fn a_frame_without_a_fault_is_none_of_the_worst() {
        assert_eq!(chosen(&[(0, 0), (10, 1), (20, 0)]), [(10, 1)]);
        assert!(chosen(&[(0, 0)]).is_empty());
    }

    #[test]
    fn a_piece_unseen_comes_before_missed_cells_these_before_wrong_ones_and_errors() {
        let bad = |unseen, missed, wrong, error| Badness {
            unseen,
            missed,
            wrong,
            error,
        };
        let order = [
            bad(0.0, 0, 0, 9.0),
            bad(0.0, 0, 1, 2.0),
            bad(0.0, 0, 1, 3.0),
            bad(0.0, 1, 0, 0.0),
            // At 2 m and at 1 m.
            bad(0.5, 0, 0, 0.0),
            bad(1.0, 0, 0, 0.0),
        ];
        assert!(order.is_sorted_by(|a, b| a.order(b).is_lt()));
    }

    /// The choice from all frames at once, by sorting.
    #[test]
    fn frames_in_blocks_are_those_of_all() {
        let mut state = 1_u64;
        let mut random = |limit: u64| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 33) % limit
        };
        let mut most = 0;
        for round in 0..600 {
            let (count, kinds, slow) = (random(200), 1 + random(40), round % 3);
            let mut now = (0, 0);
            let frames = (0..count).map(|_| {
                now.0 += 1 + random(1 + 8 * (slow % 2));
                // Neighbours are about as bad, or as bad as chance is.
                let step = random(3) as i64 - 1;
                let by_chance = slow == 2 || random(30) == 0;
                now.1 = if by_chance {
                    random(kinds) as i64
                } else {
                    (now.1 + step).max(0)
                };
                (now.0, now.1 as u64)
            });
            let frames: Vec<_> = frames.collect();
            let mut sorted = frames.clone();
            sorted.retain(|(_, wrong)| *wrong > 0);
            sorted.sort_by_key(|(tenths, wrong)| (Reverse(*wrong), *tenths));
            let mut all: Vec<(u64, u64)> = Vec::new();
            for (tenths, wrong) in sorted {
                let is_apart = all.iter().all(|(other, _)| other.abs_diff(tenths) >= 10);
                all.extend((is_apart && all.len() < MAX_WORST).then_some((tenths, wrong)));
            }
            for (block, restarts) in [(usize::MAX, false), (64, true), (64, false), (3, true)] {
                let (own, kept) = chosen_in(&frames, block, restarts);
                assert_eq!(own, all, "{block}: {frames:?}");
                most = most.max(if block == 64 { kept } else { 0 });
            }
        }
        assert!(most < 30, "a block keeps {most}");
    }
}
