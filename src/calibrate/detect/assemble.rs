//! Assembles corner candidates into the board, or into its visible part.

use super::candidate::CornerCandidate;
use super::grid::{Grid, GridIndex, NEIGHBOURS};
use super::labelling::{diagonal, labellings};
use super::refine::{Fitted, refine};
use super::{Detection, Edge, Sighting};
use crate::Board;
use nalgebra::{Point2, Vector2};
use std::collections::{BTreeMap, BTreeSet};
use svl_core::statistics::upper_median;
use svl_core::stereo::Gray;

/// Grids with fewer corners than this percentage of the board's are not part of it.
const PART_PERCENT: usize = 40;
/// At most this many grids are tried, the largest first.
const GRIDS: usize = 4;
/// Least contrast of a corner, as a fraction of the median.
const MIN_CONTRAST: f64 = 0.5;
/// Largest residual of a corner's fit: as a fraction of its contrast, and as a multiple of the
/// median residual.
const MAX_RESIDUAL: (f64, f64) = (0.35, 2.0);
/// Largest distance of a corner from the prediction by its neighbours, in grid steps.
const MAX_OFFSET: f64 = 0.25;

/// See [`super::Detector::find`].
pub(super) fn assemble(
    image: &Gray,
    candidates: &[CornerCandidate],
    board: &Board,
    towards: Vector2<f64>,
) -> Detection {
    let all = board.columns() * board.rows();
    let grids = Grid::all(candidates).into_iter().take(GRIDS);
    let plausible = grids.filter(|grid| 100 * grid.corners.len() >= PART_PERCENT * all);
    let mut largest = None;
    for grid in plausible {
        let mut fitted = FittedGrid::new(image, &grid);
        let mut read = labellings(&fitted.grid, board);
        // Each round of filling extends the grid by at most one row or column on each side.
        while read.is_empty() && fitted.fill(image, board) {
            read = labellings(&fitted.grid, board);
        }
        // Several labellings of one board differ only in the choice of the first corner.
        let likeness = |corners: &Vec<Point2<f64>>| diagonal(corners).dot(&towards);
        if let Some(corners) = read
            .into_iter()
            .max_by(|a, b| likeness(a).total_cmp(&likeness(b)))
        {
            return Detection::Whole(Sighting {
                corners,
                blur_px: fitted.median(|corner| corner.blur_px),
                contrast: 2.0 * fitted.median(|corner| corner.contrast),
            });
        }
        largest.get_or_insert(fitted.grid);
    }
    largest.map_or(Detection::Nothing, |grid| partial(image, &grid, board))
}

/// A grid whose corners are fitted to the image.
struct FittedGrid {
    grid: Grid,
    corners: BTreeMap<GridIndex, Fitted>,
    /// Missing corners that were searched for but are not in the image.
    absent: BTreeSet<GridIndex>,
}

impl FittedGrid {
    fn new(image: &Gray, grid: &Grid) -> Self {
        let fit =
            |(&cell, corner)| Some((cell, refine(image, corner, clearance(grid, cell, corner)?)?));
        let corners = grid.corners.iter().filter_map(fit).collect();
        let mut fit = Self {
            grid: Grid::default(),
            corners,
            absent: BTreeSet::new(),
        };
        // Compared with the medians of all corners, including the bad ones.
        let good = fit.corners.iter().filter(|(_, corner)| fit.is_good(corner));
        fit.corners = good.map(|(&cell, &corner)| (cell, corner)).collect();
        fit.grid.corners = fit
            .corners
            .iter()
            .map(|(&cell, fitted)| (cell, fitted.corner))
            .collect();
        fit
    }

    /// Searches for missing corners at the positions predicted by their neighbours, one round.
    /// Returns true if any was found.
    fn fill(&mut self, image: &Gray, board: &Board) -> bool {
        if self.corners.is_empty() {
            return false;
        }
        let ((i0, j0), (i1, j1)) = self.grid.bounds();
        let longer = board.columns().max(board.rows()) as i32;
        // One corner beyond the grid, as long as the grid is smaller than the board.
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
            let Some(start) = expected.map(|(at, axes)| CornerCandidate { at, axes }) else {
                continue;
            };
            let fitted = clearance(&self.grid, cell, &start).and_then(|clearance| {
                let fitted = refine(image, &start, clearance)?;
                let near = (fitted.corner.at - start.at).norm() < MAX_OFFSET * clearance;
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
        let typical = self.median(|corner| corner.residual);
        corner.contrast > MIN_CONTRAST * self.median(|corner| corner.contrast)
            && corner.residual < (MAX_RESIDUAL.0 * corner.contrast).max(MAX_RESIDUAL.1 * typical)
    }

    fn median(&self, value: impl Fn(&Fitted) -> f64) -> f64 {
        upper_median(self.corners.values().map(value)).unwrap_or_default()
    }
}

/// Distance of a corner from the next edges, pixels; `None` without a neighbour.
fn clearance(grid: &Grid, cell: GridIndex, corner: &CornerCandidate) -> Option<f64> {
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

/// Detection for a grid that does not contain a complete board.
fn partial(image: &Gray, grid: &Grid, board: &Board) -> Detection {
    if 100 * grid.corners.len() < PART_PERCENT * board.columns() * board.rows() {
        return Detection::Nothing;
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
        // A single corner near an edge may be a false one.
        .filter(|&edge| beyond[edge as usize] >= 2);
    // A board of another size is a nearly full rectangle that does not touch an edge of the image.
    let full = 10 * grid.corners.len() >= 9 * wide * high;
    let (long, short) = (wide.max(high), wide.min(high));
    let size = (
        board.columns().max(board.rows()),
        board.columns().min(board.rows()),
    );
    match most {
        None if full && short >= 3 && (long, short) != size => Detection::Other {
            corners: (long, short),
        },
        beyond => Detection::Part { beyond },
    }
}

/// The edge of the image beyond which a point lies, or which is too close for a corner to be found.
fn outside(image: &Gray, at: Point2<f64>) -> Option<Edge> {
    const MARGIN_PX: f64 = 6.0;
    let right = image.width() as f64 - MARGIN_PX;
    let bottom = image.height() as f64 - MARGIN_PX;
    let edges = [
        (Edge::Left, at.x < MARGIN_PX),
        (Edge::Right, at.x > right),
        (Edge::Top, at.y < MARGIN_PX),
        (Edge::Bottom, at.y > bottom),
    ];
    edges.into_iter().find(|(_, is)| *is).map(|(edge, _)| edge)
}
