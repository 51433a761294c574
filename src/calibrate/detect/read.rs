//! From candidates to the board, or to what of it there is.

use super::candidate::Candidate;
use super::grid::{Cell, Grid, NEIGHBOURS};
use super::place::{diagonal, readings};
use super::refine::{Fitted, refine};
use super::{Edge, Seen, Sighting};
use crate::calibrate::Board;
use crate::statistics::upper_median;
use crate::stereo::Gray;
use nalgebra::{Point2, Vector2};
use std::collections::{BTreeMap, BTreeSet};

/// Grids of fewer corners, of a hundred on the board, are no part of it.
const PART_PERCENT: usize = 40;
/// Largest grids that are looked at.
const GRIDS: usize = 4;
/// Corners are as strong as the others, ...
const FAINTEST: f64 = 0.5;
/// ... look like corners, by what the fit leaves of the contrast and of what it leaves at the
/// others, ...
const ROUGHEST: (f64, f64) = (0.35, 2.0);
/// ... and are where the others let expect them, in steps.
const STRAY: f64 = 0.25;

/// See [`super::Detector::find`].
pub(super) fn read(
    image: &Gray,
    candidates: &[Candidate],
    board: &Board,
    towards: Vector2<f64>,
) -> Seen {
    let all = board.columns() * board.rows();
    let grids = Grid::all(candidates).into_iter().take(GRIDS);
    let plausible = grids.filter(|grid| 100 * grid.corners.len() >= PART_PERCENT * all);
    let mut largest = None;
    for grid in plausible {
        let mut fitted = Fit::of(image, &grid);
        let mut read = readings(&fitted.grid, board);
        while read.is_empty() && fitted.fill(image, board) {
            read = readings(&fitted.grid, board);
        }
        let likeness = |corners: &Vec<Point2<f64>>| diagonal(corners).dot(&towards);
        if let Some(corners) = read
            .into_iter()
            .max_by(|a, b| likeness(a).total_cmp(&likeness(b)))
        {
            return Seen::Whole(Sighting {
                corners,
                blur_px: fitted.median(|corner| corner.blur_px),
                contrast: 2.0 * fitted.median(|corner| corner.contrast),
            });
        }
        largest.get_or_insert(fitted.grid);
    }
    largest.map_or(Seen::Nothing, |grid| partly(image, &grid, board))
}

/// A grid whose corners are fitted to the image.
struct Fit {
    grid: Grid,
    corners: BTreeMap<Cell, Fitted>,
    /// Missing corners that are not in the image either.
    absent: BTreeSet<Cell>,
}

impl Fit {
    fn of(image: &Gray, grid: &Grid) -> Self {
        let fit =
            |(&cell, corner)| Some((cell, refine(image, corner, clearance(grid, cell, corner)?)?));
        let corners = grid.corners.iter().filter_map(fit).collect();
        let mut fit = Self {
            grid: Grid::default(),
            corners,
            absent: BTreeSet::new(),
        };
        let good: Vec<_> = fit
            .corners
            .iter()
            .filter(|(_, corner)| fit.is_good(corner))
            .map(|(&cell, _)| cell)
            .collect();
        fit.corners.retain(|cell, _| good.contains(cell));
        fit.grid.corners = fit
            .corners
            .iter()
            .map(|(&cell, fitted)| (cell, fitted.corner))
            .collect();
        fit
    }

    /// Looks for one round of missing corners where their neighbours let expect them; whether any
    /// was found.
    fn fill(&mut self, image: &Gray, board: &Board) -> bool {
        if self.corners.is_empty() {
            return false;
        }
        let ((i0, j0), (i1, j1)) = self.grid.bounds();
        let longer = board.columns().max(board.rows()) as i32;
        // One corner beyond the grid as long as that is no larger than the board.
        let reach = |low: i32, high: i32| {
            if high - low + 1 < longer {
                low - 1..=high + 1
            } else {
                low..=high
            }
        };
        let cells = reach(i0, i1).flat_map(|i| reach(j0, j1).map(move |j| (i, j)));
        let missing: Vec<_> = cells
            .filter(|cell| !self.corners.contains_key(cell) && !self.absent.contains(cell))
            .collect();
        let mut found = false;
        for cell in missing {
            let expected = self.grid.expected(cell).zip(self.grid.expected_axes(cell));
            let Some(start) = expected.map(|(at, axes)| Candidate { at, axes }) else {
                continue;
            };
            let fitted = clearance(&self.grid, cell, &start).and_then(|clearance| {
                let fitted = refine(image, &start, clearance)?;
                let near = (fitted.corner.at - start.at).norm() < STRAY * clearance;
                (near && self.is_good(&fitted)).then_some(fitted)
            });
            match fitted {
                Some(fitted) => {
                    self.corners.insert(cell, fitted);
                    self.grid.corners.insert(cell, fitted.corner);
                    found = true;
                }
                None => {
                    self.absent.insert(cell);
                }
            }
        }
        found
    }

    fn is_good(&self, corner: &Fitted) -> bool {
        let usual = self.median(|corner| corner.residual);
        corner.contrast > FAINTEST * self.median(|corner| corner.contrast)
            && corner.residual < (ROUGHEST.0 * corner.contrast).max(ROUGHEST.1 * usual)
    }

    fn median(&self, value: impl Fn(&Fitted) -> f64) -> f64 {
        upper_median(self.corners.values().map(value)).unwrap_or_default()
    }
}

/// How far the next edges are from a corner; nothing when it has no neighbour.
fn clearance(grid: &Grid, cell: Cell, corner: &Candidate) -> Option<f64> {
    let steps = NEIGHBOURS
        .iter()
        .filter_map(|unit| Some(grid.get((cell.0 + unit.0, cell.1 + unit.1))? - corner.at));
    let across = |step: Vector2<f64>| {
        corner
            .axes
            .iter()
            .map(|axis| axis.perp(&step).abs())
            .fold(0.0, f64::max)
    };
    steps.map(across).reduce(f64::min)
}

/// What a grid says that holds no whole board.
fn partly(image: &Gray, grid: &Grid, board: &Board) -> Seen {
    if 100 * grid.corners.len() < PART_PERCENT * board.columns() * board.rows() {
        return Seen::Nothing;
    }
    let ((i0, j0), (i1, j1)) = grid.bounds();
    let (wide, high) = ((i1 - i0 + 1) as usize, (j1 - j0 + 1) as usize);
    let mut beyond = [0; 4];
    for (&(i, j), corner) in &grid.corners {
        for unit in NEIGHBOURS {
            let (next, before) = ((i + unit.0, j + unit.1), (i - unit.0, j - unit.1));
            let end = !grid.corners.contains_key(&next);
            let expected = grid
                .get(before)
                .filter(|_| end)
                .map(|before| corner.at + (corner.at - before));
            if let Some(edge) = expected.and_then(|at| outside(image, at)) {
                beyond[edge as usize] += 1;
            }
        }
    }
    let edges = [Edge::Left, Edge::Right, Edge::Top, Edge::Bottom];
    let most = edges
        .into_iter()
        .max_by_key(|&edge| beyond[edge as usize])
        .filter(|&edge| beyond[edge as usize] >= 2);
    let full = 10 * grid.corners.len() >= 9 * wide * high;
    let (long, short) = (wide.max(high), wide.min(high));
    let size = (
        board.columns().max(board.rows()),
        board.columns().min(board.rows()),
    );
    match most {
        None if full && short >= 3 && (long, short) != size => Seen::Other {
            corners: (long, short),
        },
        beyond => Seen::Part { beyond },
    }
}

/// The edge of the image that a point is beyond, or so near to that no corner is seen there.
fn outside(image: &Gray, at: Point2<f64>) -> Option<Edge> {
    const MARGIN_PX: f64 = 6.0;
    let (right, bottom) = (
        image.width() as f64 - MARGIN_PX,
        image.height() as f64 - MARGIN_PX,
    );
    let edges = [
        (Edge::Left, at.x < MARGIN_PX),
        (Edge::Right, at.x > right),
        (Edge::Top, at.y < MARGIN_PX),
        (Edge::Bottom, at.y > bottom),
    ];
    edges.into_iter().find(|(_, is)| *is).map(|(edge, _)| edge)
}
