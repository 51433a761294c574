//! From disparities to the depth grid and to distances (thesis, section 5.1 and annex B).

mod cells;
mod curve;
#[doc(hidden)]
pub mod decision;
mod grid;
mod pinhole;
mod projection;

pub use grid::{CellDecision, GridSettings, grid};
pub(crate) use grid::{grid_with, largest_cell};
#[doc(hidden)]
pub use {
    cells::cells,
    curve::DistanceCurve,
    grid::MIN_VALID,
    pinhole::PinholeFit,
    projection::{project, render},
};
