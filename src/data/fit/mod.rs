//! Fitting: the table that decides the cells of v5, and of algorithms whose cells are decided in
//! the same way ([`svl_core::depth::decision`]), and the networks of the filters
//! ([`svl_core::filter`]).

mod cells;
pub mod filter;
mod samples;

pub use cells::{CellFit, FOLDS, MOST_STEPS, fit_cells};
pub use samples::{CellSample, CellTarget, cell_samples};
