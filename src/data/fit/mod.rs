//! What training computes on every sample: the table by which the cells of v5, and of any algorithm whose cells are decided as
//! v5's are, become known ([`svl_core::depth::decision`]); the networks of the filters
//! ([`svl_core::filter`]).

mod cells;
pub mod filter;
mod samples;

pub use cells::{CellFit, FOLDS, MOST_STEPS, fit_cells};
pub use samples::{CellSample, CellTarget, cell_samples};
