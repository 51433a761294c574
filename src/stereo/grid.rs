//! The coarse grid of depths that an obstacle avoider reads (thesis, section 5.1).

use crate::error::{Error, Result};

/// Columns and rows of a grid. Row `j` covers image rows `j·H/rows .. (j+1)·H/rows`, columns
/// likewise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GridShape {
    pub columns: usize,
    pub rows: usize,
}

impl Default for GridShape {
    /// The thesis's 5 x 3.
    fn default() -> Self {
        Self {
            columns: 5,
            rows: 3,
        }
    }
}

impl GridShape {
    /// Number of cells.
    pub fn cells(&self) -> usize {
        self.columns * self.rows
    }

    /// Pixels of cell (`column`, `row`) in an image of `width` x `height`: x range, y range.
    pub fn pixels(
        &self,
        (column, row): (usize, usize),
        (width, height): (usize, usize),
    ) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
        let x = column * width / self.columns..(column + 1) * width / self.columns;
        let y = row * height / self.rows..(row + 1) * height / self.rows;
        (x, y)
    }

    /// Cells in raster order.
    pub fn iter(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        let Self { columns, rows } = *self;
        (0..rows).flat_map(move |row| (0..columns).map(move |column| (column, row)))
    }
}

/// What a grid says of one cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Share of the cell's pixels that have a disparity, 0..=1.
    pub valid_share: f64,
    /// Nothing where `valid_share` was too small to tell.
    pub depth: Option<CellDepth>,
}

/// The depth of a known cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellDepth {
    /// Median disparity, pixels.
    pub median_px: f32,
    /// 20th percentile of the disparities: a farther part of the cell.
    pub p20_px: f32,
    /// 80th percentile of the disparities: a nearer part of the cell.
    pub p80_px: f32,
    /// Distance of the median; nothing without a rig, or at infinity.
    pub distance_m: Option<f64>,
}

/// Depths of a grid of cells, in raster order.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthGrid {
    shape: GridShape,
    cells: Vec<Cell>,
}

impl DepthGrid {
    /// # Errors
    /// [`Error::Invalid`] unless there is one cell per place of `shape`.
    pub fn new(shape: GridShape, cells: Vec<Cell>) -> Result<Self> {
        if shape.cells() != 0 && shape.cells() == cells.len() {
            Ok(Self { shape, cells })
        } else {
            Err(Error::Invalid(format!(
                "a grid of {}x{} needs that many cells, got {}",
                shape.columns,
                shape.rows,
                cells.len()
            )))
        }
    }

    pub fn shape(&self) -> GridShape {
        self.shape
    }

    /// The cell at (`column`, `row`).
    pub fn cell(&self, column: usize, row: usize) -> &Cell {
        &self.cells[row * self.shape.columns + column]
    }

    /// Cells in raster order with their (column, row).
    pub fn iter(&self) -> impl Iterator<Item = ((usize, usize), &Cell)> {
        self.shape.iter().zip(&self.cells)
    }
}

/// When a reported cell counts as right.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Deserialize, serde::Serialize)]
#[serde(tag = "judge", rename_all = "lowercase", deny_unknown_fields)]
pub enum CellRule {
    /// `|Z - Z_true| <= max(0.10 m, 20 % of Z_true)`; needs a rig.
    #[default]
    Distance,
    /// `|d - d_true| <= tolerance_px`; for scenes without calibration.
    Disparity { tolerance_px: f64 },
}

impl CellRule {
    /// # Errors
    /// [`Error::Invalid`] for a tolerance that is not a positive number.
    pub fn validate(&self) -> Result<()> {
        match *self {
            Self::Disparity { tolerance_px }
                if !(tolerance_px > 0.0 && tolerance_px.is_finite()) =>
            {
                Err(Error::Invalid(format!(
                    "cells.tolerance_px = {tolerance_px} is not a positive number"
                )))
            }
            _ => Ok(()),
        }
    }
}
