//! Training with its figures for people: the table of v5's cells, the network of its gaps, the
//! networks of the filters. Computations on every sample are in [`svl_data::fit`].

//STUB mod cells;
mod filter;
//STUB mod gaps;
//STUB mod kinds;
//STUB mod learned_cells;
//STUB mod reliability;
mod report;
mod scenario_filters;
mod windows;

//STUB pub use cells::{CellTraining, ScenarioCells};
pub use filter::{EpochProgress, REVISION, TrainSettings, train_filter};
//STUB pub use gaps::{GapTraining, LearnedGaps};
//STUB pub use kinds::{ConfidenceCells, KindCells, ReportedCells, TableFigures};
//STUB pub use learned_cells::{LearnedCells, LearnedScenario, samples_csv};
//STUB pub use reliability::ReliabilityBin;
pub use report::{FilterTraining, HiddenTrial};
pub use scenario_filters::{of_scenario, with_filters};
pub use windows::{LabelledRuns, train, windows};
