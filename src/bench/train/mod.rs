//! Training with its figures for people: the table of v5's cells, the networks of the filters.
//! What is computed on every sample is [`svl_data::fit`].

mod cells;
mod filter;
mod report;

pub use cells::{CellTraining, ReliabilityBin, ReportedCells, ScenarioCells};
pub use filter::{EpochProgress, REVISION, TrainSettings, train_filter};
pub use report::{FilterTraining, HiddenTrial};
