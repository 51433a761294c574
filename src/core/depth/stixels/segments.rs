//! The segments of a column, by dynamic programming.

use crate::stereo::Plane;
use std::ops::Range;

/// A segment: rows of the measurements, from the first to the last one with a disparity.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Segment {
    pub(super) rows: Range<usize>,
    /// Rows with a disparity.
    pub(super) measured: usize,
    /// Disparity of an object; `None` on the ground.
    pub(super) object_px: Option<f32>,
}

/// Cost of a disparity that is off by `e` pixels: `min(e² / 2, MISFIT)`.
const MISFIT: f32 = 8.0;
/// Cost of each segment.
const SEGMENT: f32 = 4.0;
/// Cost of an object that hangs above the ground, or in front of the object below it.
const FLOATING: f32 = 3.0;
/// Cost of an object seen through the ground, and of ground in front of the object below it.
const IMPOSSIBLE: f32 = 12.0;
/// Differences up to this are none, pixels.
const SAME_PX: f32 = 1.0;

/// Disparities of objects are tried in steps of this, pixels.
const STEP_PX: f32 = 0.5;
const MAX_STEPS: usize = 1024;

/// Memory for the columns of a plane of measurements.
pub(super) struct Segmentation<'a> {
    measured: &'a Plane<f32>,
    steps: usize,
    /// Costs of the first rows from the bottom as an object, per step of disparity.
    object: Vec<f32>,
    /// The same as ground.
    ground: Vec<f32>,
    /// Sums and numbers of the first measurements.
    sums: Vec<(f32, usize)>,
    /// The best segmentations of the first rows that end on the ground, and on an object.
    best: Vec<[Option<Ending>; 2]>,
}

/// The last segment of a segmentation.
#[derive(Clone, Copy, Debug)]
struct Ending {
    cost: f32,
    start: usize,
    /// The kind of the segment before, if there is one.
    before: Option<usize>,
    disparity_px: f32,
}

const GROUND: usize = 0;
const OBJECT: usize = 1;

impl<'a> Segmentation<'a> {
    pub(super) fn new(measured: &'a Plane<f32>) -> Self {
        let finite = measured.pixels().filter(|d| d.is_finite());
        let most = finite.fold(0.0, f32::max);
        let height = measured.height();
        let steps = ((most / STEP_PX).ceil() as usize + 1).min(MAX_STEPS);
        Self {
            measured,
            steps,
            object: vec![0.0; steps * (height + 1)],
            ground: vec![0.0; height + 1],
            sums: vec![(0.0, 0); height + 1],
            best: vec![[None; 2]; height],
        }
    }

    /// The segments of a column from the bottom up; `expected` is the ground's disparity in a row.
    /// Segments without any measurement are left out.
    pub(super) fn column(
        &mut self,
        column: usize,
        expected: impl Fn(usize) -> Option<f32>,
    ) -> Vec<Segment> {
        let height = self.measured.height();
        // From the bottom up.
        let disparity = |i: usize| self.measured.get(column, height - 1 - i);
        let ground = |i: usize| expected(height - 1 - i).filter(|px| *px > 0.0);
        let misfit = |d: f32, px: f32| {
            let e = d - px;
            (0.5 * e * e).min(MISFIT)
        };
        for i in 0..height {
            let d = disparity(i);
            let (sum, count) = self.sums[i];
            let is_measured = d.is_finite();
            self.sums[i + 1] = if is_measured {
                (sum + d, count + 1)
            } else {
                (sum, count)
            };
            self.ground[i + 1] = self.ground[i]
                + match ground(i) {
                    Some(px) if is_measured => misfit(d, px),
                    Some(_) => 0.0,
                    // Nothing above the horizon is ground.
                    None => f32::INFINITY,
                };
            let (before, costs) = self.object.split_at_mut((i + 1) * self.steps);
            let before = &before[i * self.steps..];
            for (step, (cost, before)) in costs.iter_mut().zip(before).enumerate() {
                let own = if is_measured {
                    misfit(d, step as f32 * STEP_PX)
                } else {
                    0.0
                };
                *cost = before + own;
            }
        }
        for end in 0..height {
            self.best[end] = [None; 2];
            for start in 0..=end {
                let below = start.checked_sub(1).map(|last| self.best[last]);
                let on_ground = self.ground[end + 1] - self.ground[start];
                if ground(end).is_some() && on_ground.is_finite() {
                    let foot = ground(start);
                    let order = |kind: usize, below_px: f32| match kind {
                        GROUND => None,
                        _ if foot.is_some_and(|px| px > below_px + SAME_PX) => Some(IMPOSSIBLE),
                        _ => Some(0.0),
                    };
                    let ending = ending(below, on_ground, start, f32::NAN, order);
                    keep(&mut self.best[end][GROUND], ending);
                }
                let (sum, count) = self.sums[end + 1];
                let (sum_before, count_before) = self.sums[start];
                if count == count_before {
                    continue;
                }
                let px = (sum - sum_before) / (count - count_before) as f32;
                let step = ((px / STEP_PX).round().max(0.0) as usize).min(self.steps - 1);
                let costs = [end + 1, start].map(|i| self.object[i * self.steps + step]);
                let foot = ground(start);
                let order = |kind: usize, below_px: f32| {
                    Some(match (kind, foot) {
                        (GROUND, Some(foot)) if px < foot - SAME_PX => IMPOSSIBLE,
                        (GROUND, Some(foot)) if px > foot + SAME_PX => FLOATING,
                        (OBJECT, _) if px > below_px + SAME_PX => FLOATING,
                        _ => 0.0,
                    })
                };
                let ending = ending(below, costs[0] - costs[1], start, px, order);
                keep(&mut self.best[end][OBJECT], ending);
            }
        }
        self.segments(column)
    }

    /// Follows the best segmentation back from its top.
    fn segments(&self, column: usize) -> Vec<Segment> {
        let height = self.measured.height();
        let mut segments = Vec::new();
        let mut end = height;
        let mut kind = [OBJECT, GROUND].into_iter().min_by(|a, b| {
            let cost = |kind: usize| {
                self.best[height - 1][kind].map_or(f32::INFINITY, |ending| ending.cost)
            };
            cost(*a).total_cmp(&cost(*b))
        });
        while let Some(of) = kind
            && let Some(ending) = self.best[end - 1][of]
        {
            let row = |i: usize| height - 1 - i;
            let mut rows = (ending.start..end)
                .map(row)
                .filter(|row| self.measured.get(column, *row).is_finite());
            if let Some(lowest) = rows.next() {
                let (highest, more) = rows.fold((lowest, 0), |(_, n), row| (row, n + 1));
                segments.push(Segment {
                    rows: highest..lowest + 1,
                    measured: more + 1,
                    object_px: (of == OBJECT).then_some(ending.disparity_px),
                });
            }
            (end, kind) = (ending.start, ending.before);
        }
        segments.reverse();
        segments
    }
}

/// The ending with a segment from `start` on, behind the best ones `below` it; `order` is the cost
/// of the two kinds above each other, given the lower one's kind and disparity.
fn ending(
    below: Option<[Option<Ending>; 2]>,
    cost: f32,
    start: usize,
    disparity_px: f32,
    order: impl Fn(usize, f32) -> Option<f32>,
) -> Option<Ending> {
    let whole = |before: Option<usize>, before_cost: f32| Ending {
        cost: before_cost + SEGMENT + cost,
        start,
        before,
        disparity_px,
    };
    let Some(below) = below else {
        return Some(whole(None, 0.0));
    };
    let behind = |kind: usize| {
        let lower = below[kind]?;
        Some(whole(
            Some(kind),
            lower.cost + order(kind, lower.disparity_px)?,
        ))
    };
    match [GROUND, OBJECT].map(behind) {
        [Some(a), Some(b)] => Some(if b.cost < a.cost { b } else { a }),
        [a, b] => a.or(b),
    }
}

fn keep(best: &mut Option<Ending>, other: Option<Ending>) {
    if let Some(other) = other
        && best.is_none_or(|best| other.cost < best.cost)
    {
        *best = Some(other);
    }
}
