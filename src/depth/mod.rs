//! Disparities to the depth grid and to distances (thesis, section 5.1 and annex B).

mod curve;
pub mod decision;
mod grid;
mod pinhole;
mod projection;

pub use curve::DistanceCurve;
pub use grid::{GridSettings, MIN_VALID, grid};
pub use pinhole::PinholeFit;
pub use projection::project;
