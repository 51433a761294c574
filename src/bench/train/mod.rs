//! Training: the table by which the cells of v5, and of any algorithm whose cells are decided as
//! v5's are, become known ([`svl_core::depth::decision`]); the networks of the filters
//! ([`svl_core::filter`]).

pub mod filter;
mod fit;
mod report;
mod samples;

pub use fit::{CellFit, FOLDS, MOST_STEPS, fit_cells};
pub use report::{CellTraining, ReliabilityBin, ReportedCells, ScenarioCells};
pub use samples::{CellSample, CellTarget, cell_samples};
