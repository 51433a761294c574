//! The depth grid of an algorithm for one pair, as data.

use crate::bags::opened::Recording;
use crate::message::wire::Encoded;
use crate::message::{MessageError, MessageResult};
use serde::{Deserialize, Serialize};
use std::ops::Range;
use svl_core::Result;
use svl_core::stereo::{Cell, CellState, DepthGrid, Estimate, GridShape};

pub(crate) const SCHEMA: &str = "svl.Cells";
const DEFINITION: &str = include_str!("cells.schema.json");

/// The message of `/algo/<name>/cells`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AlgorithmCells {
    /// Number of the pair in its source, from 0.
    pub sequence: u64,
    /// The algorithm as the user wrote it.
    pub algorithm: String,
    pub columns: usize,
    pub rows: usize,
    /// In raster order.
    pub cells: Vec<CellReport>,
}

/// Report of an algorithm on a cell. Distance and probability are rounded to a millionth, so that
/// they read back exactly.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CellReport {
    pub column: usize,
    /// 0 is the top row.
    pub row: usize,
    pub state: CellState,
    /// Distance of the median disparity, metres; absent if unknown, far, or without a rig.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distance_m: Option<f64>,
    /// Median disparity, pixels; absent if unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub disparity_px: Option<f32>,
    /// Probability that it is right, 0..=1; absent if the algorithm does not report it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub probability: Option<f64>,
    /// Probability that something is nearer than the cell rule's `obstacle_m`, in state `near`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub near_probability: Option<f64>,
    /// Size of the image at which it was decided, 0 for that of the pair, as [`Cell::level`].
    #[serde(default, skip_serializing_if = "is_zero")]
    pub level: u8,
    /// Distance of the nearer of two surfaces, or of what is seen in an unknown cell, metres; of
    /// small cells of v5.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub near_distance_m: Option<f64>,
    /// Disparity of that surface, pixels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub near_px: Option<f32>,
    /// Probability that the cell has a surface there, 0..=1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surface_probability: Option<f64>,
}

fn is_zero(level: &u8) -> bool {
    *level == 0
}

impl CellReport {
    /// The cells of a grid in raster order.
    pub fn from_grid(grid: &DepthGrid) -> Vec<Self> {
        let rounded = |value: f64| (value * 1e6).round() / 1e6;
        let report = |((column, row), cell): ((usize, usize), &Cell)| Self {
            column,
            row,
            state: cell.state(),
            distance_m: cell.depth.and_then(|depth| depth.distance_m).map(rounded),
            disparity_px: cell.depth.map(|depth| depth.median_px),
            probability: cell.probability.map(rounded),
            near_probability: cell.near.map(rounded),
            level: cell.level,
            near_distance_m: cell.surface.map(|surface| rounded(surface.distance_m)),
            near_px: cell.surface.map(|surface| surface.px),
            surface_probability: cell.surface.map(|surface| rounded(surface.probability)),
        };
        grid.iter().map(report).collect()
    }
}

impl AlgorithmCells {
    /// The cells of pair `sequence`.
    pub fn new(sequence: u64, estimate: &Estimate) -> Self {
        let shape = estimate.grid.shape();
        Self {
            sequence,
            algorithm: estimate.algorithm.clone(),
            columns: shape.columns,
            rows: shape.rows,
            cells: CellReport::from_grid(&estimate.grid),
        }
    }

    pub(crate) fn shape(&self) -> GridShape {
        GridShape {
            columns: self.columns,
            rows: self.rows,
        }
    }

    /// The centre of a cell in an image of `size`, pixels.
    pub(crate) fn center_px(&self, cell: &CellReport, size: (usize, usize)) -> (f64, f64) {
        let (columns, rows) = self.shape().pixels((cell.column, cell.row), size);
        let middle = |range: Range<usize>| (range.start + range.end) as f64 / 2.0 - 0.5;
        (middle(columns), middle(rows))
    }

    /// The cells in a message.
    pub(crate) fn decode(data: &[u8]) -> MessageResult<Self> {
        let cells: Self = serde_json::from_slice(data)?;
        let is_inside = |cell: &CellReport| cell.column < cells.columns && cell.row < cells.rows;
        let expected = cells.columns.checked_mul(cells.rows);
        let is_complete = expected == Some(cells.cells.len()) && expected > Some(0);
        if !is_complete || !cells.cells.iter().all(is_inside) {
            return Err(MessageError::Grid(cells.columns, cells.rows));
        }
        Ok(cells)
    }

    pub(crate) fn encode(&self) -> Encoded {
        Encoded::json(SCHEMA, DEFINITION, self)
    }
}

impl Recording {
    /// The cells of all algorithms, in the order of the recording; empty if no replay wrote it, or
    /// an earlier version did.
    ///
    /// # Errors
    /// The errors of [`Recording::results`].
    pub fn cells(&self) -> Result<Vec<AlgorithmCells>> {
        self.json_messages(SCHEMA)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::stereo::{CellDepth, Rig};

    #[test]
    fn cells_are_rounded_and_say_only_what_is_known() {
        let rig = Rig::new(36.9, (0.0, 0.0), 1.0 / 9.0, 0.0).unwrap();
        let depth = CellDepth::at(12.3, Some(&rig));
        let cell = |depth, probability| Cell {
            valid_share: 1.0,
            depth,
            probability,
            ..Cell::UNKNOWN
        };
        let shape = GridShape {
            columns: 3,
            rows: 1,
        };
        let far = CellDepth::at(0.0, Some(&rig));
        let cells = [Some(depth), None, Some(far)];
        let cells = cells.map(|depth| cell(depth, depth.map(|_| 0.25))).to_vec();
        let grid = DepthGrid::new(shape, cells).unwrap();
        let json = serde_json::to_string(&CellReport::from_grid(&grid)).unwrap();
        assert_eq!(
            json,
            concat!(
                r#"[{"column":0,"row":0,"state":"known","distance_m":0.333333,"#,
                r#""disparity_px":12.3,"probability":0.25},"#,
                r#"{"column":1,"row":0,"state":"unknown"},"#,
                r#"{"column":2,"row":0,"state":"far","disparity_px":0.0,"probability":0.25}]"#
            )
        );
        let back: Vec<CellReport> = serde_json::from_str(&json).unwrap();
        assert_eq!(back, CellReport::from_grid(&grid));
    }
}
