//! The bench: sources, the loop over frames and matchers, sinks, drives, tuning, evaluation.
//!
//! `svl` re-exports its modules.

pub mod console;
pub mod drive;
pub mod evaluation;
pub mod pass;
pub mod record;
pub mod runs;
pub mod sink;
pub mod source;
pub mod tune;
