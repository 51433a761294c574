//! The bench: sources, the loop over frames and matchers, sinks, reports, drives, tuning, training.
//!
//! `svl` re-exports its modules.

#[cfg(feature = "ros2")]
pub mod bridge;
pub mod console;
#[cfg(feature = "ros2")]
pub mod dds;
pub mod drive;
pub mod evaluation;
pub mod outputs;
pub mod record;
pub mod report;
pub mod run;
pub mod runs;
pub mod sink;
pub mod source;
pub mod train;
pub mod tune;
