//! The reports of runs: units → CSV and Parquet → summary → terminal, Markdown, HTML.
//!
//! ```text
//! units ──build──▶ rows, cells, checkpoints, … as .csv and .parquet
//!                      │
//!                      └──▶ Results ──▶ Table ──▶ terminal, Markdown, LaTeX; JSON,
//!                                       html::ReportPage, summary and verdicts
//! ```

mod accuracy;
mod agreed;
mod algorithm_parameters;
mod answer;
mod areas;
mod best;
mod build;
pub mod calibration;
mod cases;
mod cautions;
mod checkpoints;
mod choice;
mod columns;
pub mod compare;
mod csv_rows;
mod descriptions;
mod drives;
mod gate;
pub mod html;
mod junit;
mod maps;
mod markdown;
pub mod page;
pub mod plot;
mod prior;
mod prior_test;
mod reliability;
mod results;
mod rows;
mod samples;
pub mod shots;
mod sources;
mod speed;
mod stress;
mod stressed;
mod summary_tables;
mod sweep_choice;
mod sweeps;
pub mod table;
mod table_writer;
mod terminal;
pub mod units;
mod words;

pub use accuracy::AccuracyRow;
pub use algorithm_parameters::write_algorithms;
pub use best::{Best, Certainty, Other, PriorTest, SweepChoice};
pub use build::{BuildOptions, BuiltReport, MANIFEST, REPORT, build, checkpoint_results};
pub use columns::ColumnDescription;
pub use csv_rows::{RowReader, read_rows};
pub use descriptions::{METRIC_NAMES, TABLES, TableDescription};
pub use drives::{CoursePlan, DriveRow, DriveSummary, TrackRow};
pub use gate::{GateResult, GateState, limit_results};
pub use junit::{TestCase, TestResult, junit};
pub use prior::{PRIOR, TruthRow};
pub use reliability::{ReliabilityBin, ReliabilityRow, ReliabilityTally, reliability_chart};
pub use results::{
    AlgorithmSummary, CheckpointSummary, FailedAlgorithm, ReportTables, ResultParts, Results,
    Shown, TopicDelay,
};
pub use rows::{
    CellRow, CheckpointRow, ColumnValue, CsvCells, FailureRow, FrameRow, MetricTotals, Record, Row,
};
pub use sources::Sources;
pub use stress::StressSummary;
pub use table_writer::TableWriter;
pub use words::shell_word;
