//! Stereo calibration from images of a chessboard, and measurements for the distance curve (thesis,
//! sections 2.3, 4.1 and 6.1, annexes B and E).

pub mod choose;
pub mod detect;
pub mod distance;
pub mod files;
mod pattern;
pub mod simulated;
mod solve;
pub mod yaml;

pub use pattern::{Board, StereoView};
pub use solve::{
    CameraEstimate, CameraParameters, Corner, Correlation, EpipolarError, Estimated, Fit,
    MIN_VIEWS, Solution, ViewFit, solve,
};
