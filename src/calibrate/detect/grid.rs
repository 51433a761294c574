//! Which candidates are the corners of one board: grown from neighbour to neighbour, as in Geiger,
//! Moosmann, Car and Schuster (Automatic camera and range sensor calibration using a single shot,
//! ICRA 2012), but led by the edges' own directions, which say for every corner where its
//! neighbours are.

use super::candidate::Candidate;
use nalgebra::{Point2, Vector2};
use std::collections::{BTreeMap, VecDeque};

/// Place of a corner among the others, from some first one.
pub(super) type Cell = (i32, i32);

/// Corners by their place.
#[derive(Clone, Debug, Default)]
pub(super) struct Grid {
    pub corners: BTreeMap<Cell, Candidate>,
}

/// How far a corner may be from where its neighbours let expect it, in steps: perspective and lens
/// change the step.
const STRAY: f64 = 0.35;
/// Neighbours' edges differ in direction by less: cosine of 25°.
const PARALLEL: f64 = 0.906;
/// The first neighbour lies in the direction of the edge: cosine of 12°.
const AHEAD: f64 = 0.978;
/// Steps are longer, pixels.
const SHORTEST: f64 = 3.0;

pub(super) const NEIGHBOURS: [Cell; 4] = [(1, 0), (-1, 0), (0, 1), (0, -1)];

impl Grid {
    /// All grids of at least 2x2 corners, the largest first. Each candidate is in one of them at
    /// most.
    pub(super) fn all(candidates: &[Candidate]) -> Vec<Self> {
        let mut free = vec![true; candidates.len()];
        let mut grids = Vec::new();
        for seed in 0..candidates.len() {
            if free[seed]
                && let Some(members) = grow(candidates, &free, seed)
            {
                members.values().for_each(|&i| free[i] = false);
                grids.push(Self {
                    corners: members
                        .into_iter()
                        .map(|(cell, i)| (cell, candidates[i]))
                        .collect(),
                });
            }
        }
        grids.sort_by_key(|grid| std::cmp::Reverse(grid.corners.len()));
        grids
    }

    pub(super) fn get(&self, cell: Cell) -> Option<Point2<f64>> {
        self.corners.get(&cell).map(|corner| corner.at)
    }

    /// Smallest and largest place along both directions.
    pub(super) fn bounds(&self) -> (Cell, Cell) {
        let first = (i32::MAX, i32::MAX);
        let last = (i32::MIN, i32::MIN);
        self.corners
            .keys()
            .fold((first, last), |(low, high), &(i, j)| {
                ((low.0.min(i), low.1.min(j)), (high.0.max(i), high.1.max(j)))
            })
    }

    /// Where a corner that is missing must be, by its neighbours: between two of them, or one step
    /// beyond two.
    pub(super) fn expected(&self, cell: Cell) -> Option<Point2<f64>> {
        let at = |(i, j): Cell, times: i32| self.get((cell.0 + times * i, cell.1 + times * j));
        let between = |unit| Some(nalgebra::center(&at(unit, 1)?, &at(unit, -1)?));
        let beyond = |unit| {
            let (near, far) = (at(unit, 1)?, at(unit, 2)?);
            Some(near + (near - far))
        };
        let mean = |points: Vec<Point2<f64>>| {
            let sum = points.iter().map(|p| p.coords).sum::<Vector2<f64>>();
            (!points.is_empty()).then(|| Point2::from(sum / points.len() as f64))
        };
        let inner = mean([(1, 0), (0, 1)].into_iter().filter_map(between).collect());
        inner.or_else(|| mean(NEIGHBOURS.into_iter().filter_map(beyond).collect()))
    }

    /// The edges' directions at a missing corner: those of a neighbour, exchanged.
    pub(super) fn expected_axes(&self, cell: Cell) -> Option<[Vector2<f64>; 2]> {
        let beside = NEIGHBOURS
            .iter()
            .find_map(|unit| self.corners.get(&(cell.0 + unit.0, cell.1 + unit.1)))?;
        let [first, second] = beside.axes;
        Some([second, -first])
    }
}

/// A member of a growing grid.
struct Member {
    index: usize,
    /// Steps to the next corners along both directions.
    steps: [Vector2<f64>; 2],
}

/// The grid around one candidate; nothing when it has no 2x2 corners.
fn grow(candidates: &[Candidate], free: &[bool], seed: usize) -> Option<BTreeMap<Cell, usize>> {
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
    let square = |&(i, j): &Cell| {
        [(1, 0), (0, 1), (1, 1)]
            .iter()
            .all(|d| members.contains_key(&(i + d.0, j + d.1)))
    };
    let solid = members.keys().any(square);
    solid.then(|| {
        members
            .into_iter()
            .map(|(cell, member)| (cell, member.index))
            .collect()
    })
}

/// From one candidate to its neighbours along its two edges.
fn first_steps(candidates: &[Candidate], free: &[bool], seed: usize) -> Option<[Vector2<f64>; 2]> {
    let from = &candidates[seed];
    let step = |axis: Vector2<f64>| {
        let ahead = candidates
            .iter()
            .zip(free)
            .filter(|(to, free)| **free && exchanged(from, to));
        let steps = ahead.map(|(to, _)| to.at - from.at);
        let steps = steps
            .filter(|step| step.dot(&axis).abs() > AHEAD * step.norm() && step.norm() > SHORTEST);
        let nearest = steps.min_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()))?;
        Some(if nearest.dot(&axis) < 0.0 {
            -nearest
        } else {
            nearest
        })
    };
    Some([step(from.axes[0])?, step(from.axes[1])?])
}

/// The candidate one `step` away.
fn nearest(
    candidates: &[Candidate],
    taken: &[bool],
    from: &Candidate,
    step: Vector2<f64>,
) -> Option<usize> {
    let (target, reach) = (from.at + step, STRAY * step.norm());
    let near =
        (0..candidates.len()).filter(|&i| !taken[i] && (candidates[i].at - target).norm() < reach);
    near.filter(|&i| exchanged(from, &candidates[i]))
        .min_by(|&a, &b| {
            let far = |i: usize| (candidates[i].at - target).norm_squared();
            far(a).total_cmp(&far(b))
        })
}

/// Whether two corners may be neighbours: the edges are parallel, dark is where it was bright.
fn exchanged(a: &Candidate, b: &Candidate) -> bool {
    (0..2).all(|i| a.axes[i].dot(&b.axes[1 - i]).abs() > PARALLEL)
}
