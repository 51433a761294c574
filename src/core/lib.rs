//! svl's matchers, filters and depth grid: the library for a robot.
//!
//! A [`matcher`] turns a rectified pair into disparities, and these become a [`depth`] grid of a
//! few cells with a distance each. [`rectify`] rectifies a raw pair by a calibration, which the
//! package `svl-calibrate` reads. The package `svl` is the bench around it.
//!
//! ```
//! use svl_core::depth::{self, GridSettings};
//! use svl_core::matcher::Algorithm;
//! use svl_core::stereo::{Gray, RectifiedPair, StereoPair};
//!
//! let left = Gray::filled(320, 240, 90)?;
//! let pair = StereoPair::new(left.clone(), left)?;
//! let v3: Algorithm = "v3:max_disparity=64".parse()?;
//! let output = v3.match_pair(RectifiedPair::assume(&pair), None)?;
//! let grid = depth::grid(output.disparity.disparity(), GridSettings::default(), None);
//! assert!(grid.cell(2, 1).depth.is_none(), "a grey wall has no texture to match");
//! # Ok::<(), svl_core::Error>(())
//! ```

pub mod bounded;
pub mod depth;
mod error;
pub mod filter;
pub mod interrupt;
pub mod kernel;
pub mod matcher;
pub mod rectify;
pub mod statistics;
pub mod stereo;
pub mod timing;
mod words;

/// The Rust example of the README, as a doctest.
#[cfg(doctest)]
#[doc = include_str!("README.md")]
mod readme {}

pub use error::{Error, Result, alternatives, did_you_mean, nearest};
pub use words::{counted, joined};
