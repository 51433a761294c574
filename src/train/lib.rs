//! Training with its figures for people: the model of v5, the networks of the filters. Computations
//! on every sample are in [`crate::fit`].

mod cells;
mod filter;
pub mod fit;
mod gaps;
mod kinds;
mod learned_cells;
mod report;
mod scenario_filters;
mod v5;
mod windows;

pub use cells::{CellTraining, ScenarioCells};
pub use filter::{EpochProgress, REVISION, TrainSettings, train_filter};
pub use gaps::GapTraining;
pub use kinds::{KindCells, ReportedCells, TableFigures};
pub use learned_cells::{CellAlgorithms, LearnedCells, LearnedScenario, TableRole, TableSamples};
pub use report::{FilterTraining, HiddenTrial};
pub use scenario_filters::{scenario_filters, with_filters};
pub use v5::{NearTraining, TrainedV5, TrainingScenario, V5Training, train_v5};
pub use windows::{LabelledInputs, train, windows};
