//! The reports of runs: units → CSV and Parquet → summary → terminal, Markdown, HTML.
//!
//! ```text
//! units ──build──▶ rows, cells, checkpoints, … as .csv and .parquet
//!                      │
//!                      └──▶ Results ──▶ Table ──▶ terminal, Markdown; JSON,
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

pub use crate::build::{
    BuildOptions, BuiltReport, MANIFEST, REPORT, ResultsSoFar, build, results_so_far,
};
pub use crate::pages::{calibration, html};
pub use crate::results::algorithm_parameters::write_algorithms;
pub use crate::results::best::{Best, BestSetting, Certainty, Other, SweepChoice, Unfit};
pub use crate::results::descriptions::{METRIC_NAMES, TABLES, TableDescription};
pub use crate::results::gate::{GateResult, GateState, limit_results};
pub use crate::results::summary::{
    AlgorithmSummary, CheckpointSummary, FailedAlgorithm, ReportTables, ResultParts, Results,
    Shown, TopicDelay,
};
pub use crate::results::table_writer::TableWriter;
pub use crate::rows::columns::ColumnDescription;
pub use crate::rows::csv_rows::{RowReader, read_rows};
pub use crate::rows::held::{Row, RowRef, Rows};
pub use crate::rows::records::{
    CellRow, CheckpointRow, CsvCells, FailureRow, FrameRow, MetricTotals, Record, RowError,
};
pub use crate::show::junit::{TestCase, TestResult, junit};
pub use crate::show::words::shell_word;
pub use crate::show::{page, plot, table};
pub use crate::subjects::accuracy::AccuracyRow;
pub use crate::subjects::drives::{CoursePlan, DriveRow, DriveSummary, TrackRow};
pub use crate::subjects::pieces::{PieceRow, SightRow};
pub use crate::subjects::references::{EXACT, PRIOR, TruthRow};
pub use crate::subjects::reliability::{
    ReliabilityBin, ReliabilityRow, ReliabilityTally, reliability_chart,
};
pub use crate::subjects::sources::Sources;
pub use crate::subjects::stress::StressSummary;
pub use crate::subjects::witness::{ComparedPair, EstimateRow, FloorRays, WitnessTally, wrong};
pub use crate::units::shots;
