//! Grids of corner candidates, grown from neighbour to neighbour as in Geiger, Moosmann, Car and
//! Schuster (Automatic camera and range sensor calibration using a single shot, ICRA 2012).
//!
//! Departure: growth follows the directions of the edges at each corner, which point to its
//! neighbours.

use super::candidate::CornerCandidate;
use nalgebra::{Point2, Vector2};
use std::collections::{BTreeMap, VecDeque};

/// Column and row of a corner, relative to the seed of its grid.
pub(super) type GridIndex = (i32, i32);

/// Corners by column and row.
#[derive(Clone, Debug, Default)]
pub(super) struct Grid {
    pub corners: BTreeMap<GridIndex, CornerCandidate>,
}

/// Largest distance of a corner from its predicted position, in steps: perspective and distortion
/// change the step.
const MAX_OFFSET: f64 = 0.35;
/// Cosine of the largest angle (25°) between the edges of neighbours.
const PARALLEL: f64 = 0.906;
/// Cosine of the largest angle (12°) between an edge and the step to the first neighbour.
const MIN_COSINE_AHEAD: f64 = 0.978;
/// Least step, pixels.
const SHORTEST: f64 = 3.0;

pub(super) const NEIGHBOURS: [GridIndex; 4] = [(1, 0), (-1, 0), (0, 1), (0, -1)];

impl Grid {
    /// All grids of at least 2x2 corners, the largest first. Each candidate is in at most one.
    pub(super) fn all(candidates: &[CornerCandidate]) -> Vec<Self> {
        let mut free = vec![true; candidates.len()];
        let mut grids = Vec::new();
        for seed in 0..candidates.len() {
            if free[seed]
                && let Some(members) = grow(candidates, &free, seed)
            {
                let corner = |(cell, member): (_, Member)| {
                    free[member.index] = false;
                    (cell, candidates[member.index])
                };
                let corners = members.into_iter().map(corner).collect();
                grids.push(Self { corners });
            }
        }
        grids.sort_by_key(|grid| std::cmp::Reverse(grid.corners.len()));
        grids
    }

    pub(super) fn get(&self, cell: GridIndex) -> Option<Point2<f64>> {
        self.corners.get(&cell).map(|corner| corner.at)
    }

    /// Smallest and largest column and row.
    pub(super) fn bounds(&self) -> (GridIndex, GridIndex) {
        let first = (i32::MAX, i32::MAX);
        let last = (i32::MIN, i32::MIN);
        self.corners
            .keys()
            .fold((first, last), |(low, high), &(i, j)| {
                ((low.0.min(i), low.1.min(j)), (high.0.max(i), high.1.max(j)))
            })
    }

    /// The position of a missing corner, predicted from its neighbours: between two of them, or one
    /// step beyond two. `None` without such neighbours.
    pub(super) fn expected(&self, cell: GridIndex) -> Option<Point2<f64>> {
        let at = |(i, j): GridIndex, times: i32| self.get((cell.0 + times * i, cell.1 + times * j));
        let between = |unit| Some(nalgebra::center(&at(unit, 1)?, &at(unit, -1)?));
        let beyond = |unit| {
            let (near, far) = (at(unit, 1)?, at(unit, 2)?);
            Some(near + (near - far))
        };
        let mean = |points: Vec<Point2<f64>>| {
            let sum = points.iter().map(|p| p.coords).sum::<Vector2<f64>>();
            (!points.is_empty()).then(|| Point2::from(sum / points.len() as f64))
        };
        // Interpolation is safer than extrapolation, so it is tried first.
        let inner = mean([(1, 0), (0, 1)].into_iter().filter_map(between).collect());
        inner.or_else(|| mean(NEIGHBOURS.into_iter().filter_map(beyond).collect()))
    }

    /// The directions of the edges at a missing corner: those of a neighbour, exchanged.
    pub(super) fn expected_axes(&self, cell: GridIndex) -> Option<[Vector2<f64>; 2]> {
        let beside = NEIGHBOURS
            .iter()
            .find_map(|unit| self.corners.get(&(cell.0 + unit.0, cell.1 + unit.1)))?;
        let [first, second] = beside.axes;
        // Rotated by 90°, so that the sector from the first to the second stays dark.
        Some([second, -first])
    }
}

/// A member of a growing grid.
struct Member {
    index: usize,
    /// Steps to the next corners along both directions.
    steps: [Vector2<f64>; 2],
}

/// Grows the grid around one candidate; `None` if it has no 2x2 corners.
fn grow(
    candidates: &[CornerCandidate],
    free: &[bool],
    seed: usize,
) -> Option<BTreeMap<GridIndex, Member>> {
    let steps = first_steps(candidates, free, seed)?;
    let mut members = BTreeMap::from([((0, 0), Member { index: seed, steps })]);
    let mut taken = free.iter().map(|free| !free).collect::<Vec<_>>();
    taken[seed] = true;
    let mut queue = VecDeque::from([(0, 0)]);
    while let Some(cell) = queue.pop_front() {
        for unit in NEIGHBOURS {
            let next = (cell.0 + unit.0, cell.1 + unit.1);
            let (along, forward) = (usize::from(unit.0 == 0), f64::from(unit.0 + unit.1));
            if members.contains_key(&next) {
                continue;
            }
            let Member { index, steps } = &members[&cell];
            let from = &candidates[*index];
            let Some(found) = nearest(candidates, &taken, from, steps[along] * forward) else {
                continue;
            };
            // Perspective changes the step gradually: each member predicts from its own last step.
            let mut steps = *steps;
            steps[along] = (candidates[found].at - from.at) * forward;
            taken[found] = true;
            members.insert(
                next,
                Member {
                    index: found,
                    steps,
                },
            );
            queue.push_back(next);
        }
    }
    // A single row of corners is more often texture than a board.
    let square = |&(i, j): &GridIndex| {
        [(1, 0), (0, 1), (1, 1)]
            .iter()
            .all(|d| members.contains_key(&(i + d.0, j + d.1)))
    };
    let solid = members.keys().any(square);
    solid.then_some(members)
}

/// The steps from a candidate to its neighbours along its two edges.
fn first_steps(
    candidates: &[CornerCandidate],
    free: &[bool],
    seed: usize,
) -> Option<[Vector2<f64>; 2]> {
    let from = &candidates[seed];
    let step = |axis: Vector2<f64>| {
        let ahead = candidates
            .iter()
            .zip(free)
            .filter(|(to, free)| **free && exchanged(from, to));
        let steps = ahead.map(|(to, _)| to.at - from.at);
        let steps = steps.filter(|step| {
            step.dot(&axis).abs() > MIN_COSINE_AHEAD * step.norm() && step.norm() > SHORTEST
        });
        let nearest = steps.min_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()))?;
        // Axes have no sign: a neighbour on either side gives the step.
        Some(nearest * nearest.dot(&axis).signum())
    };
    Some([step(from.axes[0])?, step(from.axes[1])?])
}

/// The candidate nearest to one `step` away.
fn nearest(
    candidates: &[CornerCandidate],
    taken: &[bool],
    from: &CornerCandidate,
    step: Vector2<f64>,
) -> Option<usize> {
    let (target, reach) = (from.at + step, MAX_OFFSET * step.norm());
    let near =
        (0..candidates.len()).filter(|&i| !taken[i] && (candidates[i].at - target).norm() < reach);
    near.filter(|&i| exchanged(from, &candidates[i]))
        .min_by(|&a, &b| {
            let far = |i: usize| (candidates[i].at - target).norm_squared();
            far(a).total_cmp(&far(b))
        })
}

/// True if two corners may be neighbours: their edges are parallel, with dark and bright exchanged.
fn exchanged(a: &CornerCandidate, b: &CornerCandidate) -> bool {
    (0..2).all(|i| a.axes[i].dot(&b.axes[1 - i]).abs() > PARALLEL)
}
