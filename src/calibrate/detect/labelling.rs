//! Board labelling: assigns the corners of a grid to the board, and chooses the first.

use super::candidate::CornerCandidate;
use super::grid::{Grid, GridIndex};
use crate::Board;
use nalgebra::{Point2, Vector2};

/// A labelling of a grid: the first corner, the step along a row and the step along a column.
#[derive(Clone, Copy, Debug)]
struct Labelling {
    first: GridIndex,
    along: GridIndex,
    down: GridIndex,
}

impl Labelling {
    fn cell(&self, column: usize, row: usize) -> GridIndex {
        let (column, row) = (column as i32, row as i32);
        (
            self.first.0 + column * self.along.0 + row * self.down.0,
            self.first.1 + column * self.along.1 + row * self.down.1,
        )
    }
}

/// False corners beyond the board that are tolerated, in per cent of its corners.
const CHANCE_PERCENT: usize = 8;

/// The corners in the order of [`Board::corners`], for every possible labelling of the board; empty
/// unless the grid contains exactly one complete board.
///
/// No labelling is mirrored. A board that is not symmetric under a rotation of 180°, because its
/// corner squares differ in colour, starts at a dark one.
pub(super) fn labellings(grid: &Grid, board: &Board) -> Vec<Vec<Point2<f64>>> {
    let (columns, rows) = (board.columns(), board.rows());
    let Some((low, (wide, high))) = window(grid, (columns, rows)) else {
        return Vec::new();
    };
    let last = (low.0 + wide - 1, low.1 + high - 1);
    let corners = [low, (last.0, low.1), last, (low.0, last.1)];
    let both = corners.into_iter().flat_map(|first| {
        // Inward along both directions of the grid; either may be the board's row.
        let i = (if first.0 == low.0 { 1 } else { -1 }, 0);
        let j = (0, if first.1 == low.1 { 1 } else { -1 });
        [(i, j), (j, i)].map(|(along, down)| Labelling { first, along, down })
    });
    let fits = |labelling: &Labelling| {
        let long = if labelling.along.0 == 0 { high } else { wide };
        long as usize == columns && turns_right(grid, labelling)
    };
    let fitting: Vec<_> = both.filter(fits).collect();
    let dark: Vec<_> = fitting
        .iter()
        .copied()
        .filter(|labelling| begins_dark(grid, labelling))
        .collect();
    // On a symmetric board all labellings start with the same colour, so it decides nothing.
    let chosen = if dark.is_empty() { fitting } else { dark };
    let read = |labelling: &Labelling| {
        let places = (0..columns * rows).map(|n| labelling.cell(n % columns, n / columns));
        places.filter_map(|cell| grid.get(cell)).collect()
    };
    chosen.iter().map(read).collect()
}

/// First index and size of the only full window of the board's size.
fn window(grid: &Grid, (columns, rows): (usize, usize)) -> Option<(GridIndex, GridIndex)> {
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
    // Two full windows mean a board larger than the one sought; so do many further corners.
    let extra = grid.corners.len().checked_sub(columns * rows)?;
    (full.len() == 1 && 100 * extra <= CHANCE_PERCENT * columns * rows).then(|| full[0])
}

/// The first corner, and the steps from it along its row and its column.
fn edges(
    grid: &Grid,
    labelling: &Labelling,
) -> Option<(CornerCandidate, Vector2<f64>, Vector2<f64>)> {
    let first = *grid.corners.get(&labelling.cell(0, 0))?;
    Some((
        first,
        grid.get(labelling.cell(1, 0))? - first.at,
        grid.get(labelling.cell(0, 1))? - first.at,
    ))
}

/// True if rows and columns have the orientation of image axes; otherwise the labelling is
/// mirrored.
fn turns_right(grid: &Grid, labelling: &Labelling) -> bool {
    edges(grid, labelling).is_some_and(|(_, along, down)| along.perp(&down) > 0.0)
}

/// True if the square outside the first corner is dark.
fn begins_dark(grid: &Grid, labelling: &Labelling) -> bool {
    edges(grid, labelling).is_some_and(|(first, along, down)| {
        // The sector from axis 0 to axis 1 is dark; outward lies in a dark sector when it is on
        // opposite sides of the two axes.
        let outward = -(along.normalize() + down.normalize());
        first.axes[0].perp(&outward) * first.axes[1].perp(&outward) < 0.0
    })
}

/// The vector from the first corner to the last.
pub(super) fn diagonal(corners: &[Point2<f64>]) -> Vector2<f64> {
    match (corners.first(), corners.last()) {
        (Some(first), Some(last)) => last - first,
        _ => Vector2::zeros(),
    }
}
