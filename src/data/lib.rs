//! Frames as data: images and recordings on disk, cameras, the simulated arena, perturbations,
//! scores, scenarios, and the manifest of a run.
//!
//! Code that touches each pixel or byte of a run is here, compiled for speed. `svl` re-exports its
//! modules; the bench opens sources and runs matchers over them.

pub mod agreement;
pub mod arena;
pub mod bootstrap;
mod build_info;
pub mod drive;
pub mod fetch;
pub mod files;
pub mod fit;
pub mod grab;
pub mod losses;
pub mod manifest;
pub mod memory;
pub mod overlay;
pub mod pairing;
pub mod plausibility;
pub mod recording;
pub mod resize;
pub mod scenario;
pub mod score;
pub mod stress;

pub use build_info::{BuildInfo, slow_profile};
