//! The reports of runs: units → CSV and Parquet → summary → terminal, Markdown, HTML.
//!
//! ```text
//! units ──build──▶ rows, cells, checkpoints, … as .csv and .parquet
//!                      │
//!                      └──▶ Results ──▶ Table ──▶ terminal, Markdown, LaTeX; JSON,
//!                                       html::ReportPage, summary and verdicts
//! ```

mod build;
pub mod compare;
mod pages;
mod results;
mod rows;
mod show;
mod subjects;
pub mod units;

pub use build::{BuildOptions, BuiltReport, MANIFEST, REPORT, build, checkpoint_results};
pub use pages::{calibration, html};
pub use results::algorithm_parameters::write_algorithms;
pub use results::best::{Best, Certainty, Other, PriorTest, SweepChoice};
pub use results::descriptions::{METRIC_NAMES, TABLES, TableDescription};
pub use results::gate::{GateResult, GateState, limit_results};
pub use results::summary::{
    AlgorithmSummary, CheckpointSummary, FailedAlgorithm, ReportTables, ResultParts, Results,
    Shown, TopicDelay,
};
pub use results::table_writer::TableWriter;
pub use rows::columns::ColumnDescription;
pub use rows::csv_rows::{RowReader, read_rows};
pub use rows::records::{
    CellRow, CheckpointRow, ColumnValue, CsvCells, FailureRow, FrameRow, MetricTotals, Record, Row,
    RowError,
};
pub use show::junit::{TestCase, TestResult, junit};
pub use show::words::shell_word;
pub use show::{page, plot, table};
pub use subjects::accuracy::AccuracyRow;
pub use subjects::drives::{CoursePlan, DriveRow, DriveSummary, TrackRow};
pub use subjects::prior::{PRIOR, TruthRow};
pub use subjects::reliability::{
    ReliabilityBin, ReliabilityRow, ReliabilityTally, reliability_chart,
};
pub use subjects::sources::Sources;
pub use subjects::stress::StressSummary;
pub use units::shots;
