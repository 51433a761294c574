//! From disparities to the depth grid and to distances (thesis, section 5.1 and annex B).

mod cells;
mod curve;
pub mod decision;
mod grid;
mod pinhole;
mod projection;

pub use cells::cells;
pub use curve::DistanceCurve;
pub use grid::{CellDecision, GridSettings, MIN_VALID, grid};
pub(crate) use grid::{grid_with, largest_cell};
pub use pinhole::PinholeFit;
pub use projection::{project, render};
