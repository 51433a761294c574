//! Comparison of two reports: of each metric its change, the interval of that, and the verdict.

pub(crate) mod cases;
pub(crate) mod comparison;
pub(crate) mod courses;
pub(crate) mod frames;
pub(crate) mod join;
pub(crate) mod page;
pub(crate) mod scored_run;
pub(crate) mod text;
pub(crate) mod trend;

pub use crate::results::change::{
    Change, CheckpointName, Judgement, NotMeasured, changes, untested_changes,
};
pub use comparison::{AlgorithmChange, Comparison, Conclusion};
pub use frames::{FindLeft, FrameCounts};
pub use join::Join;
pub use page::page;
pub use scored_run::ScoredRun;
pub use text::unitless;
pub use trend::{Trend, TrendLine, TrendOrigin, TrendPoint};
