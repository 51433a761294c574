//! The bench: sources, the loop over frames and matchers, sinks, reports, drives, tuning, training.
//!
//! `svl` re-exports its modules.

pub mod drive;
pub mod record;
pub mod report;
pub mod run;
pub mod sink;
pub mod source;
pub mod train;
pub mod tune;
