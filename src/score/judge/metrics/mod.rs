//! The metrics of a run: one table for everything that shows or compares a number.
//!
//! Rows, CSV, Parquet, summaries, pages, Rerun's plots, `svl compare` and a scenario's `[[gate]]`
//! read their columns, headings and words from [`METRICS`]. A new metric is computed in the file of
//! its kind (pixels: `disparity.rs`, cells: `cells.rs`) and listed in `table.rs`.

mod kinds;
mod named;
mod table;
mod values;

pub use kinds::{
    Better, CellNumber, DriveNumber, EstimatedNumber, FrameFacts, Metric, MetricLevel,
    MetricOrigin, MetricTotal, MetricUnit, TruthLevel,
};
pub use named::MetricFault;
pub use table::METRICS;
pub use values::{MetricSource, MetricValues, PLACES};
