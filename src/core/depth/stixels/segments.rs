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
/// Disparities that differ by at most this count as equal, pixels.
const SAME_PX: f32 = 1.0;

/// Disparities of objects are tried in steps of this, pixels.
const STEP_PX: f32 = 0.5;
/// Twice what the greatest range of svl's algorithms needs; disparities beyond count as the last.
const MAX_STEPS: usize = 8192;

/// Memory for the columns of a plane of measurements.
pub(super) struct Segmentation<'a> {
    measured: &'a Plane<f32>,
    /// The disparity of the first step, a multiple of [`STEP_PX`].
    first_px: f32,
    steps: usize,
    /// Costs of the first rows from the bottom as an object, per step of disparity.
    object: Vec<f32>,
    /// The same as ground.
    ground: Vec<f32>,
    /// The ground's disparity per row from the bottom, below the horizon.
    expected: Vec<Option<f32>>,
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
        let finite = || measured.pixels().filter(|d| d.is_finite());
        let most = finite().fold(0.0, f32::max);
        let first_px = (finite().fold(most, f32::min) / STEP_PX).floor() * STEP_PX;
        let height = measured.height();
        let steps = (((most - first_px) / STEP_PX).ceil() as usize + 1).min(MAX_STEPS);
        Self {
            measured,
            first_px,
            steps,
            object: vec![0.0; steps * (height + 1)],
            ground: vec![0.0; height + 1],
            expected: vec![None; height],
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
        for (i, px) in self.expected.iter_mut().enumerate() {
            *px = expected(height - 1 - i).filter(|px| *px > 0.0);
        }
        self.add_costs(column);
        self.best.fill([None; 2]);
        for start in 0..height {
            // The best segmentation below it is complete.
            self.extend(start);
        }
        self.segments(column)
    }

    /// Adds up the measurements of a column and the costs of its rows, from the bottom up.
    fn add_costs(&mut self, column: usize) {
        let misfit = |d: f32, px: f32| {
            let e = d - px;
            (0.5 * e * e).min(MISFIT)
        };
        let height = self.measured.height();
        for i in 0..height {
            let d = self.measured.get(column, height - 1 - i);
            let (sum, count) = self.sums[i];
            let is_measured = d.is_finite();
            self.sums[i + 1] = if is_measured {
                (sum + d, count + 1)
            } else {
                (sum, count)
            };
            self.ground[i + 1] = self.ground[i]
                + match self.expected[i] {
                    Some(px) if is_measured => misfit(d, px),
                    Some(_) => 0.0,
                    // Nothing above the horizon is ground.
                    None => f32::INFINITY,
                };
            let (before, costs) = self.object.split_at_mut((i + 1) * self.steps);
            let before = &before[i * self.steps..];
            for (step, (cost, before)) in costs.iter_mut().zip(before).enumerate() {
                let own = if is_measured {
                    misfit(d, self.first_px + step as f32 * STEP_PX)
                } else {
                    0.0
                };
                *cost = before + own;
            }
        }
    }

    /// Keeps the segments from `start` on that are the best ones to their ends.
    fn extend(&mut self, start: usize) {
        let height = self.measured.height();
        let below = Below::new(start.checked_sub(1).map(|last| self.best[last]));
        let foot = self.expected[start];
        let (cost, before) = below.cost_under_ground(foot);
        for end in start..height {
            let on_ground = self.ground[end + 1] - self.ground[start];
            if !on_ground.is_finite() {
                break;
            }
            keep(
                &mut self.best[end][GROUND],
                Ending {
                    cost: cost + SEGMENT + on_ground,
                    start,
                    before,
                    disparity_px: f32::NAN,
                },
            );
        }
        let (sum_before, count_before) = self.sums[start];
        for end in start..height {
            let (sum, count) = self.sums[end + 1];
            if count == count_before {
                continue;
            }
            let px = (sum - sum_before) / (count - count_before) as f32;
            // The nearest step.
            let step = (px - self.first_px) / STEP_PX + 0.5;
            let step = (step as usize).min(self.steps - 1);
            let costs = [end + 1, start].map(|i| self.object[i * self.steps + step]);
            let (cost, before) = below.cost_under_object(foot, px);
            keep(
                &mut self.best[end][OBJECT],
                Ending {
                    cost: cost + SEGMENT + (costs[0] - costs[1]),
                    start,
                    before,
                    disparity_px: px,
                },
            );
        }
    }

    /// Follows the best segmentation back from its top.
    fn segments(&self, column: usize) -> Vec<Segment> {
        let height = self.measured.height();
        let mut segments = Vec::new();
        let mut end = height;
        let mut next_kind = [OBJECT, GROUND].into_iter().min_by(|a, b| {
            let cost = |kind: usize| {
                self.best[height - 1][kind].map_or(f32::INFINITY, |ending| ending.cost)
            };
            cost(*a).total_cmp(&cost(*b))
        });
        while let Some(kind) = next_kind
            && let Some(ending) = self.best[end - 1][kind]
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
                    object_px: (kind == OBJECT).then_some(ending.disparity_px),
                });
            }
            (end, next_kind) = (ending.start, ending.before);
        }
        segments.reverse();
        segments
    }
}

/// The best segmentations below a segment, infinitely costly where there are none.
struct Below {
    /// True at the bottom of the column.
    is_bottom: bool,
    ground: f32,
    object: f32,
    object_px: f32,
}

impl Below {
    fn new(best: Option<[Option<Ending>; 2]>) -> Self {
        let [ground, object] = best.unwrap_or_default();
        Self {
            is_bottom: best.is_none(),
            ground: ground.map_or(f32::INFINITY, |ending| ending.cost),
            object: object.map_or(f32::INFINITY, |ending| ending.cost),
            object_px: object.map_or(0.0, |ending| ending.disparity_px),
        }
    }

    /// Cost and kind below ground whose lowest disparity is `foot`: never ground.
    fn cost_under_ground(&self, foot: Option<f32>) -> (f32, Option<usize>) {
        let is_in_front = foot.is_some_and(|px| px > self.object_px + SAME_PX);
        match self.is_bottom {
            true => (0.0, None),
            false if is_in_front => (self.object + IMPOSSIBLE, Some(OBJECT)),
            false => (self.object, Some(OBJECT)),
        }
    }

    /// The lesser cost and its kind below an object at `px`, where the ground has `foot`.
    fn cost_under_object(&self, foot: Option<f32>, px: f32) -> (f32, Option<usize>) {
        if self.is_bottom {
            return (0.0, None);
        }
        let on_ground = match foot {
            Some(foot) if px < foot - SAME_PX => self.ground + IMPOSSIBLE,
            Some(foot) if px > foot + SAME_PX => self.ground + FLOATING,
            _ => self.ground,
        };
        let on_object = if px > self.object_px + SAME_PX {
            self.object + FLOATING
        } else {
            self.object
        };
        if on_object < on_ground {
            (on_object, Some(OBJECT))
        } else {
            (on_ground, Some(GROUND))
        }
    }
}

fn keep(best: &mut Option<Ending>, other: Ending) {
    if other.cost < best.map_or(f32::INFINITY, |best| best.cost) {
        *best = Some(other);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The segments of a column by the definition of their costs: each sum is computed anew, and
    /// the best segmentations below are tried one by one.
    fn by_definition(column: &[f32], expected: &[Option<f32>]) -> Vec<Segment> {
        let height = column.len();
        // From the bottom up.
        let measured: Vec<_> = column.iter().rev().copied().collect();
        let ground: Vec<_> = expected.iter().rev().copied().collect();
        let misfit = |i: usize, px: f32| match measured[i] - px {
            _ if measured[i].is_infinite() => 0.0,
            e => (0.5 * e * e).min(MISFIT),
        };
        // Per last row and kind: cost, disparity, and the ends of the segments with their kinds.
        type Found = (f32, f32, Vec<(usize, usize, usize, f32)>);
        let mut best: Vec<[Option<Found>; 2]> = vec![[None, None]; height];
        for end in 0..height {
            for start in 0..=end {
                let seen: Vec<_> = (start..=end).filter(|&i| measured[i].is_finite()).collect();
                let on_ground = (start..=end)
                    .map(|i| ground[i].map(|px| misfit(i, px)))
                    .sum::<Option<f32>>();
                let mean = seen.iter().map(|&i| measured[i]).sum::<f32>() / seen.len() as f32;
                let step = (mean / STEP_PX + 0.5).floor() * STEP_PX;
                let as_object = (start..=end).map(|i| misfit(i, step)).sum::<f32>();
                for kind in [GROUND, OBJECT] {
                    let (own, px) = match (kind, on_ground) {
                        (GROUND, Some(cost)) => (cost, f32::NAN),
                        (OBJECT, _) if !seen.is_empty() => (as_object, mean),
                        _ => continue,
                    };
                    let mut lower: Vec<(f32, Vec<_>)> = Vec::new();
                    if start == 0 {
                        lower.push((0.0, Vec::new()));
                    } else {
                        for below in [GROUND, OBJECT] {
                            let Some((cost, below_px, segments)) = &best[start - 1][below] else {
                                continue;
                            };
                            let order = match (below, kind, ground[start]) {
                                (GROUND, GROUND, _) => continue,
                                (GROUND, _, Some(foot)) if px < foot - SAME_PX => IMPOSSIBLE,
                                (GROUND, _, Some(foot)) if px > foot + SAME_PX => FLOATING,
                                (OBJECT, GROUND, Some(foot)) if foot > below_px + SAME_PX => {
                                    IMPOSSIBLE
                                }
                                (OBJECT, OBJECT, _) if px > below_px + SAME_PX => FLOATING,
                                _ => 0.0,
                            };
                            lower.push((cost + order, segments.clone()));
                        }
                    }
                    for (cost, mut segments) in lower {
                        let whole = cost + SEGMENT + own;
                        if best[end][kind]
                            .as_ref()
                            .is_none_or(|(least, ..)| whole < *least)
                        {
                            segments.push((start, end, kind, px));
                            best[end][kind] = Some((whole, px, segments));
                        }
                    }
                }
            }
        }
        let found = best[height - 1].iter().flatten();
        let least = found.min_by(|a, b| a.0.total_cmp(&b.0));
        let segments = least.map_or(Vec::new(), |(.., segments)| segments.clone());
        let segment = |(start, end, kind, px): (usize, usize, usize, f32)| {
            let seen: Vec<_> = (start..=end).filter(|&i| measured[i].is_finite()).collect();
            let (first, last) = (seen.first()?, seen.last()?);
            Some(Segment {
                rows: height - 1 - last..height - first,
                measured: seen.len(),
                object_px: (kind == OBJECT).then_some(px),
            })
        };
        segments.into_iter().filter_map(segment).collect()
    }

    #[test]
    fn segments_are_those_of_the_definition() {
        let mut state = 1_u64;
        let mut random = |most: u64| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 33) % most
        };
        let mut kinds = [0; 2];
        for case in 0..400 {
            let height = 1 + random(24) as usize;
            let horizon = random(2 * height as u64) as f32 - 3.0;
            let has_ground = case % 4 != 0;
            let expected: Vec<_> = (0..height)
                .map(|y| Some(1.5 * (y as f32 - horizon)).filter(|px| has_ground && *px > 0.0))
                .collect();
            // Far beyond the ground, and behind infinity, as where the cameras converge.
            let offset = [0.0, 700.0, -100.0][if has_ground { 0 } else { case / 4 % 3 }];
            let mut object = random(30) as f32 + offset;
            let column: Vec<_> = (0..height)
                .map(|y| {
                    if random(6) == 0 {
                        object = random(30) as f32 + offset;
                    }
                    let noise = random(1000) as f32 / 700.0;
                    match (random(5), expected[y]) {
                        (0, _) => f32::INFINITY,
                        (1 | 2, Some(px)) => px + noise,
                        _ => object + noise,
                    }
                })
                .collect();
            let measured = Plane::from_vec(1, height, column.clone()).unwrap();
            let found = Segmentation::new(&measured).column(0, |y| expected[y]);
            let defined = by_definition(&column, &expected);
            assert_eq!(
                found.len(),
                defined.len(),
                "{column:?}: {found:?} {defined:?}"
            );
            for (found, defined) in found.iter().zip(&defined) {
                assert_eq!(
                    (&found.rows, found.measured),
                    (&defined.rows, defined.measured),
                    "{column:?}"
                );
                kinds[usize::from(found.object_px.is_some())] += 1;
                match (found.object_px, defined.object_px) {
                    (Some(a), Some(b)) => assert!((a - b).abs() < 1e-3, "{a} {b}"),
                    (a, b) => assert_eq!(a, b),
                }
            }
        }
        assert!(kinds.iter().all(|n| *n > 100), "{kinds:?}");
    }
}
