//! The reports of a run: rows → CSV and Parquet → summary → terminal, Markdown, HTML.
//!
//! ```text
//! Row, CellRow, CheckpointRow ──▶ TableWriter ──▶ .csv during the run, .parquet at its end
//!      │
//!      └──▶ Summary ──▶ Table ──▶ terminal, Markdown, LaTeX; JSON, html::ReportPage,
//!                       summary and verdicts as .csv and .parquet
//! ```

mod algorithm_parameters;
mod answer;
pub mod calibration;
mod cases;
mod cautions;
mod choice;
mod columns;
pub mod compare;
mod csv_rows;
mod descriptions;
mod drives;
pub mod evidence;
mod gate;
pub mod html;
mod junit;
mod lead;
mod log;
mod markdown;
mod merge;
pub mod page;
pub mod plot;
mod rows;
mod samples;
mod speed;
mod stress;
mod summary;
mod summary_tables;
pub mod table;
mod table_writer;
mod terminal;
mod totals;
mod words;

pub use algorithm_parameters::write_algorithms;
pub use choice::{OBJECTIVES, better_first, pareto_front};
pub use columns::ColumnDescription;
pub use csv_rows::{RowReader, read_rows};
pub use descriptions::{TABLES, TableDescription};
pub use drives::{CoursePlan, DriveRow, DriveSummary, TrackRow};
pub use gate::{GateResult, GateState, limit_results};
pub use junit::{TestCase, TestResult, junit};
pub use lead::{Certainty, Lead, RunnerUp};
pub(crate) use log::whole_lines;
pub use log::{EarlierRun, LoggedPair, LoggedResult, ResultLog, whole_rows};
pub use merge::merge_rows;
pub use rows::{
    CellRow, CheckpointRow, ColumnValue, CsvCells, FailureRow, MetricTotals, Record, Row,
    hash_words,
};
pub use stress::StressSummary;
pub use summary::{AlgorithmSummary, CheckpointSummary, FailedAlgorithm, Summary};
pub use table_writer::TableWriter;
