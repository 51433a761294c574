//! The answer of a ranger: a distance, a probability and a state for each cell.

use crate::stereo::{Cell, CellState, GridShape, NearSurface, Reason};

/// The answer for a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct RangedCell {
    /// Along the optical axis, metres; infinite at infinity. `None` if unknown, of
    /// [`CellState::Near`], and without a rig.
    pub distance_m: Option<f64>,
    /// The median, or v5's choice, in pixels; `None` if unknown.
    pub disparity_px: Option<f32>,
    /// Probability that the distance is right, 0..=1, or of [`CellState::Near`] that something is
    /// near; `None` from an algorithm that reports none.
    pub probability: Option<f64>,
    /// Fraction of the cell's pixels that have a disparity, 0..=1.
    pub valid_share: f64,
    pub state: CellState,
    /// Why the cell is unknown: [`Reason::Disagreement`], or the most frequent reason of its
    /// pixels. [`Reason::Valid`] of a known one.
    pub reason: Reason,
    /// Size of the image at which the cell was decided, as [`Cell::level`].
    pub level: u8,
    /// The surface in front of the distance, or in an unknown cell; of small cells of v5.
    pub surface: Option<NearSurface>,
}

impl RangedCell {
    pub(super) fn new(cell: &Cell, reason: Reason, has_rig: bool) -> Self {
        let infinity = has_rig.then_some(f64::INFINITY);
        Self {
            distance_m: cell.depth.and_then(|depth| depth.distance_m.or(infinity)),
            disparity_px: cell.depth.map(|depth| depth.median_px),
            probability: cell.near.or(cell.probability),
            valid_share: cell.valid_share,
            state: cell.state(),
            reason,
            level: cell.level,
            surface: cell.surface,
        }
    }
}

/// The cells of a pair, row by row from the top left.
#[derive(Clone, Debug, PartialEq)]
pub struct Cells {
    shape: GridShape,
    cells: Vec<RangedCell>,
}

impl Cells {
    pub(super) fn new(shape: GridShape) -> Self {
        let cells = Vec::with_capacity(shape.cells());
        Self { shape, cells }
    }

    pub(super) fn clear(&mut self) {
        self.cells.clear();
    }

    pub(super) fn push(&mut self, cell: RangedCell) {
        self.cells.push(cell);
    }

    /// Columns and rows.
    pub fn shape(&self) -> GridShape {
        self.shape
    }

    /// The cell of a column from the left and a row from the top.
    ///
    /// # Panics
    /// If it is outside the grid.
    pub fn at(&self, column: usize, row: usize) -> &RangedCell {
        let is_inside = column < self.shape.columns && row < self.shape.rows;
        assert!(is_inside, "no cell {column}, {row} in {:?}", self.shape);
        &self.cells[row * self.shape.columns + column]
    }

    /// All cells, row by row.
    pub fn as_slice(&self) -> &[RangedCell] {
        &self.cells
    }

    pub fn iter(&self) -> std::slice::Iter<'_, RangedCell> {
        self.cells.iter()
    }
}

impl<'a> IntoIterator for &'a Cells {
    type Item = &'a RangedCell;
    type IntoIter = std::slice::Iter<'a, RangedCell>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}
