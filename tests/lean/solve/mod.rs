//! Calibrations of simulated cameras, whose truth is known.

mod coverage;
mod refused;
mod simulated;
