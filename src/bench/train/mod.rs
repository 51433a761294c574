//! Training with its figures for people: the table of v5's cells, the network of its gaps, the
//! networks of the filters. Computations on every sample are in [`svl_data::fit`].

mod cells;
mod filter;
mod gaps;
mod kinds;
mod learned_cells;
mod reliability;
mod report;
mod scenario_filters;
mod windows;

pub use cells::{CellTraining, ScenarioCells};
pub use filter::{EpochProgress, REVISION, TrainSettings, train_filter};
pub use gaps::{GapTraining, LearnedGaps};
pub use kinds::{ConfidenceCells, KindCells, ReportedCells, TableFigures};
pub use learned_cells::{LearnedCells, LearnedScenario, samples_csv};
pub use reliability::ReliabilityBin;
pub use report::{FilterTraining, HiddenTrial};
pub use scenario_filters::{of_scenario, with_filters};
pub use windows::{LabelledRuns, train, windows};
