//! Fitting: the network of v5's gaps; the table that decides the cells of v5, and of algorithms
//! whose cells are decided in the same way ([`svl_core::depth::decision`]); and the networks of the
//! filters ([`svl_core::filter`]).

//STUB mod cells;
pub mod filter;
//STUB mod gaps;
//STUB mod samples;

//STUB pub use cells::{CellFit, FOLDS, MOST_STEPS, fit_cells};
//STUB pub use gaps::{GapEpoch, GapFit, GapSample, GapSettings, fit_gaps, gap_samples};
//STUB pub use samples::{CellSample, CellTarget, cell_samples};
