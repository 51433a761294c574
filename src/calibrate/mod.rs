//! From pictures of a board to two calibrated cameras, and from measured distances to a curve
//! (thesis, sections 2.3, 4.1 and 6.1, annexes B and E).

pub mod choose;
pub mod detect;
pub mod distance;
pub mod files;
mod pattern;
pub mod simulated;
mod solve;

pub use pattern::{Board, View};
pub use solve::{
    Camera, Corner, Correlation, Epipolar, Estimate, Fit, LEAST_VIEWS, Solution, ViewFit, solve,
};
