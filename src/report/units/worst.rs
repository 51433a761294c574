//! The worst frames of an algorithm.

use crate::pages::html::figures::{CheckpointFigure, SceneFigure};
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;

/// The number of frames of an algorithm that a unit and a page show as its worst.
pub const MAX_WORST: usize = 5;
/// Frames that a choice keeps while more may come: a later, worse one within a second takes the
/// place of one that hid others.
const MAX_KEPT: usize = MAX_WORST + 8;
/// No two of the frames of a recording are within this time.
const MIN_APART_NS: u64 = 1_000_000_000;

/// The rank of a frame among the worst: by its missed cells, then by its wrong ones, then by its
/// largest error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Badness {
    pub missed: u64,
    pub wrong: u64,
    /// In tolerances of its cell.
    pub error: f64,
}

impl Badness {
    /// The worse is the greater.
    pub fn order(&self, other: &Self) -> Ordering {
        let counts = (self.missed, self.wrong).cmp(&(other.missed, other.wrong));
        counts.then(self.error.total_cmp(&other.error))
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

/// The worst of frames that come one by one.
pub struct WorstFrames<T>(Vec<WorstFrame<T>>);

impl<T> Default for WorstFrames<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T> WorstFrames<T> {
    /// True if a frame that is so bad may be one of the worst: never one without a missed or wrong
    /// cell.
    pub fn takes(&self, badness: &Badness) -> bool {
        let is_worse = |own: &WorstFrame<T>| badness.order(&own.badness).is_gt();
        // Neighbours of worse frames fill no place.
        let is_full = self.0.len() >= MAX_KEPT && self.chosen().len() == MAX_WORST;
        let is_bad = badness.missed + badness.wrong > 0;
        is_bad && (!is_full || self.0.iter().any(is_worse))
    }

    /// Adds a frame.
    pub fn add(&mut self, frame: WorstFrame<T>) {
        self.0.push(frame);
        // The first of equal ones leads.
        self.0.sort_by(|a, b| {
            let places = (a.run, a.place).cmp(&(b.run, b.place));
            b.badness.order(&a.badness).then(places)
        });
        if self.0.len() > MAX_KEPT {
            let chosen = self.chosen();
            let last = (0..self.0.len()).rfind(|i| !chosen.contains(i));
            self.0.remove(last.unwrap_or(MAX_KEPT));
        }
    }

    /// The frames that are left in the end, the worst first.
    pub fn finish(self) -> Vec<WorstFrame<T>> {
        let chosen = self.chosen();
        let all = self.0.into_iter().enumerate();
        let chosen = all.filter(|(i, _)| chosen.contains(i));
        chosen.map(|(_, frame)| frame).collect()
    }

    /// The places of the worst, each a second away from all worse ones of its run.
    fn chosen(&self) -> Vec<usize> {
        let mut chosen: Vec<usize> = Vec::new();
        for (i, frame) in self.0.iter().enumerate() {
            let is_near = |other: &usize| {
                let other = &self.0[*other];
                let stamps = other.stamp_ns.zip(frame.stamp_ns);
                let apart_ns = stamps.map(|(a, b)| a.abs_diff(b));
                other.run == frame.run && apart_ns.is_some_and(|ns| ns < MIN_APART_NS)
            };
            if chosen.len() < MAX_WORST && !chosen.iter().any(is_near) {
                chosen.push(i);
            }
        }
        chosen
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cmp::Reverse;

    fn chosen(frames: &[(u64, u64)]) -> Vec<(u64, u64)> {
        let mut worst = WorstFrames::default();
        for (place, &(tenths, wrong)) in frames.iter().enumerate() {
            let badness = Badness {
                wrong,
                ..Badness::default()
            };
            if worst.takes(&badness) {
                worst.add(WorstFrame {
                    badness,
                    run: 0,
                    place: place as u64,
                    stamp_ns: Some(tenths * 100_000_000),
                    picture: (tenths, wrong),
                });
            }
        }
        let worst = worst.finish().into_iter();
        worst.map(|frame| frame.picture).collect()
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
    fn missed_cells_come_before_wrong_ones_and_these_before_errors() {
        let bad = |missed, wrong, error| Badness {
            missed,
            wrong,
            error,
        };
        let order = [
            bad(0, 0, 9.0),
            bad(0, 1, 2.0),
            bad(0, 1, 3.0),
            bad(1, 0, 0.0),
        ];
        assert!(order.is_sorted_by(|a, b| a.order(b).is_lt()));
    }

    /// The choice is nearly that from all frames at once: the worst, and all others but one.
    #[test]
    fn frames_one_by_one_are_those_of_all() {
        let mut state = 1_u64;
        for count in 0..60 {
            let mut wrong = || {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1);
                1 + (state >> 33) % 40
            };
            let frames: Vec<_> = (0..count).map(|i| (4 * i, wrong())).collect();
            let mut sorted = frames.clone();
            sorted.sort_by_key(|(tenths, wrong)| (Reverse(*wrong), *tenths));
            let mut all: Vec<(u64, u64)> = Vec::new();
            for (tenths, wrong) in sorted {
                let is_apart = all.iter().all(|(other, _)| other.abs_diff(tenths) >= 10);
                all.extend((is_apart && all.len() < MAX_WORST).then_some((tenths, wrong)));
            }
            let own = chosen(&frames);
            assert_eq!(own.first(), all.first(), "{frames:?}");
            let shared = own.iter().filter(|frame| all.contains(frame)).count();
            assert!(shared + 1 >= all.len(), "{frames:?}");
        }
    }
}
