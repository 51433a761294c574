//! svl: the record/replay bench for stereo vision that keeps robots from hitting things.
//!
//! One idea: **every run is source → matchers → sinks, and a subcommand only chooses the three.**
//!
//! ```text
//! source ──Frame──▶ matchers ──Estimate──▶ sinks
//! arena               v3                    recording (MCAP)
//! recording           ...                   Rerun
//! data set                                  tables ──▶ report
//! ```
//!
//! Without default features this is what a robot links: [`stereo`], [`kernel`], [`matcher`], [`depth`], [`arena`].

pub mod arena;
pub mod depth;
mod error;
pub mod kernel;
pub mod matcher;
pub mod stereo;
pub mod timing;

#[cfg(feature = "bench")]
pub mod overlay;
#[cfg(feature = "bench")]
pub mod report;
#[cfg(feature = "bench")]
pub mod sink;
#[cfg(feature = "bench")]
pub mod source;

pub use error::{Error, Result};
