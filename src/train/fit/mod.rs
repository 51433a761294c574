//! Fitting: the model of v5, which is the network of its gaps and the tables that decide on its
//! cells ([`svl_core::depth::decision`]); and the networks of the filters ([`svl_core::filter`]).

mod cells;
pub mod filter;
mod gaps;
mod samples;
mod steps;
mod time;

pub use cells::{CellFit, FOLDS, fit_cells};
pub use gaps::{GapEpoch, GapFit, GapSample, GapSettings, fit_gaps, gap_samples};
pub use samples::{CellSample, CellTarget, PairCell, PairCells, pair_cells};
pub use time::{CellSequence, TimeFigures, TimeFit, fit_time};
