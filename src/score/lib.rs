//! Runs (scenario, manifest), and their scores (metrics, cells, checkpoints, losses, intervals).

pub mod bootstrap;
pub mod drive;
pub mod holm;
pub mod judge;
pub mod losses;
pub mod manifest;
pub mod memory;
pub mod notice;
pub mod pixel_errors;
pub mod plausibility;
pub mod resize;
pub mod scenario;
