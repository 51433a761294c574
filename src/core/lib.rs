//! svl's matchers, filters and depth grid: the library for a robot.
//!
//! [`ranger::Ranger`] is the interface of a robot: two images in, the cells of a grid out, each
//! with a distance, a probability and a state. Below it, a [`matcher`] turns a rectified pair into
//! disparities, and these become a [`depth`] grid. [`rectify`] rectifies a raw pair by a
//! calibration, which the package `svl-calibrate` reads. The package `svl` is the bench around it.

pub mod bounded;
pub mod depth;
mod error;
pub mod filter;
pub mod inputs;
pub mod interrupt;
pub mod kernel;
pub mod matcher;
pub mod ranger;
pub mod rectify;
pub mod statistics;
pub mod stereo;
pub mod timing;
mod words;

/// The Rust example of the README, as a doctest.
#[cfg(doctest)]
#[doc = include_str!("README.md")]
mod readme {}

pub use error::{Error, Result};

// Words for the messages of svl's own packages: no part of the interface.
#[doc(hidden)]
pub use error::{alternatives, did_you_mean, nearest};
#[doc(hidden)]
pub use words::{counted, joined};
