//! Simulated stereo pairs with exact ground truth: the arena of the thesis, random worlds and
//! shapes; and perturbations of pairs.

pub mod arena;
pub mod stress;
