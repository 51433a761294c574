//! svl: the record/replay bench for stereo vision that keeps robots from hitting things.
//!
//! One idea: **every run is source → matchers → judge → sinks; a subcommand only chooses them.**
//!
//! ```text
//! source ──Frame──▶ matchers ──Estimate──▶ judge ──Judged──▶ sinks
//! arena               v3                                      recording (MCAP)
//! recording           ...                                     Rerun
//! data set                                                    tables ──▶ report
//! ```
//!
//! Without default features this is what a robot links: [`stereo`], [`kernel`], [`matcher`],
//! [`filter`], [`depth`], [`rectify`].
//!
//! ```
//! use svl::depth::{self, GridSettings};
//! use svl::matcher::Algorithm;
//! use svl::stereo::{Gray, RectifiedPair, StereoPair};
//!
//! let left = Gray::filled(320, 240, 90)?;
//! let pair = StereoPair::new(left.clone(), left)?;
//! let v3: Algorithm = "v3:max_disparity=64".parse()?;
//! let output = v3.match_pair(RectifiedPair::assume(&pair), None)?;
//! let grid = depth::grid(output.disparity.disparity(), GridSettings::default(), None);
//! assert!(grid.cell(2, 1).depth.is_none(), "a grey wall has no texture to match");
//! # Ok::<(), svl::Error>(())
//! ```

#[cfg(feature = "bench")]
pub mod arena;
#[cfg(feature = "calibrate")]
mod bounded;
#[cfg(feature = "calibrate")]
pub mod calibrate;
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

#[cfg(feature = "bench")]
pub mod drive;
#[cfg(feature = "bench")]
pub mod fetch;
#[cfg(feature = "bench")]
pub mod files;
#[cfg(feature = "bench")]
pub mod grab;
#[cfg(feature = "bench")]
pub mod manifest;
#[cfg(feature = "bench")]
pub mod overlay;
#[cfg(feature = "bench")]
mod pairing;
#[cfg(feature = "bench")]
pub mod record;
#[cfg(feature = "bench")]
pub mod recording;
#[cfg(feature = "bench")]
pub mod report;
#[cfg(feature = "bench")]
pub mod reproduce;
#[cfg(feature = "bench")]
pub mod run;
#[cfg(feature = "bench")]
pub mod scenario;
#[cfg(feature = "bench")]
pub mod score;
#[cfg(feature = "bench")]
pub mod sink;
#[cfg(feature = "bench")]
pub mod source;
#[cfg(feature = "bench")]
pub mod stress;
#[cfg(feature = "bench")]
pub mod train;
#[cfg(feature = "bench")]
pub mod tune;
#[cfg(feature = "calibrate")]
mod words;
#[cfg(feature = "calibrate")]
mod yaml;

/// The Rust examples of README and docs, as doctests.
#[cfg(all(doctest, feature = "bench"))]
#[doc = include_str!("../README.md")]
#[doc = include_str!("../CONTRIBUTING.md")]
#[doc = include_str!("../docs/architecture.md")]
#[doc = include_str!("../docs/library.md")]
mod documents {}

pub use error::{Error, Result};
#[cfg(feature = "calibrate")]
pub use words::counted;
