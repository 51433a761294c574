//! Where in a grid of corners the board is, and which of its corners is the first.

use super::candidate::Candidate;
use super::grid::{Cell, Grid};
use crate::calibrate::Board;
use nalgebra::{Point2, Vector2};

/// A reading of a grid: from the first corner, along a row, along a column.
#[derive(Clone, Copy, Debug)]
struct Reading {
    first: Cell,
    along: Cell,
    down: Cell,
}

impl Reading {
    fn cell(&self, column: usize, row: usize) -> Cell {
        let (column, row) = (column as i32, row as i32);
        (
            self.first.0 + column * self.along.0 + row * self.down.0,
            self.first.1 + column * self.along.1 + row * self.down.1,
        )
    }
}

/// Corners beyond the board, of a hundred on it, that may be there by chance.
const CHANCE_PERCENT: usize = 8;

/// The corners in the order of [`Board::corners`], in all ways in which the picture allows to read
/// the board; none when the grid holds not exactly one whole board.
///
/// They turn as the board's own axes do, so no mirrored reading is among them. A board that looks
/// another way round when it is turned, because the corners of its outer squares differ in colour,
/// is read from a dark one.
pub(super) fn readings(grid: &Grid, board: &Board) -> Vec<Vec<Point2<f64>>> {
    let (columns, rows) = (board.columns(), board.rows());
    let Some((low, (wide, high))) = window(grid, (columns, rows)) else {
        return Vec::new();
    };
    let last = (low.0 + wide - 1, low.1 + high - 1);
    let corners = [
        (low.0, low.1),
        (last.0, low.1),
        (last.0, last.1),
        (low.0, last.1),
    ];
    let inward = |first: Cell| {
        [
            (if first.0 == low.0 { 1 } else { -1 }, 0),
            (0, if first.1 == low.1 { 1 } else { -1 }),
        ]
    };
    let both = corners.into_iter().flat_map(|first| {
        let [i, j] = inward(first);
        [
            Reading {
                first,
                along: i,
                down: j,
            },
            Reading {
                first,
                along: j,
                down: i,
            },
        ]
    });
    let fits = |reading: &Reading| {
        let long = if reading.along.0 == 0 { high } else { wide };
        long as usize == columns && turns_right(grid, reading)
    };
    let fitting: Vec<_> = both.filter(fits).collect();
    let dark: Vec<_> = fitting
        .iter()
        .copied()
        .filter(|reading| begins_dark(grid, reading))
        .collect();
    let chosen = if dark.is_empty() { fitting } else { dark };
    let read = |reading: &Reading| {
        let places = (0..columns * rows).map(|n| reading.cell(n % columns, n / columns));
        places.filter_map(|cell| grid.get(cell)).collect()
    };
    chosen.iter().map(read).collect()
}

/// First place and size of the only full window of the board's size.
fn window(grid: &Grid, (columns, rows): (usize, usize)) -> Option<(Cell, Cell)> {
    let (low, high) = grid.bounds();
    let size = (columns as i32, rows as i32);
    let mut shapes = vec![size, (size.1, size.0)];
    shapes.dedup();
    let mut full = Vec::new();
    for shape in shapes {
        for i in low.0..=high.0 - shape.0 + 1 {
            for j in low.1..=high.1 - shape.1 + 1 {
                let mut cells =
                    (i..i + shape.0).flat_map(|i| (j..j + shape.1).map(move |j| (i, j)));
                if cells.all(|cell| grid.corners.contains_key(&cell)) {
                    full.push(((i, j), shape));
                }
            }
        }
    }
    let extra = grid.corners.len().checked_sub(columns * rows)?;
    (full.len() == 1 && 100 * extra <= CHANCE_PERCENT * columns * rows).then(|| full[0])
}

/// Edges of the window at the first corner.
fn edges(grid: &Grid, reading: &Reading) -> Option<(Candidate, Vector2<f64>, Vector2<f64>)> {
    let first = *grid.corners.get(&reading.cell(0, 0))?;
    Some((
        first,
        grid.get(reading.cell(1, 0))? - first.at,
        grid.get(reading.cell(0, 1))? - first.at,
    ))
}

/// Whether down is to the right hand of along, as in an image.
fn turns_right(grid: &Grid, reading: &Reading) -> bool {
    edges(grid, reading).is_some_and(|(_, along, down)| along.perp(&down) > 0.0)
}

/// Whether the square outside the first corner is dark.
fn begins_dark(grid: &Grid, reading: &Reading) -> bool {
    edges(grid, reading).is_some_and(|(first, along, down)| {
        let outward = -(along.normalize() + down.normalize());
        first.axes[0].perp(&outward) * first.axes[1].perp(&outward) < 0.0
    })
}

/// From the first corner to the last.
pub(super) fn diagonal(corners: &[Point2<f64>]) -> Vector2<f64> {
    match (corners.first(), corners.last()) {
        (Some(first), Some(last)) => last - first,
        _ => Vector2::zeros(),
    }
}
