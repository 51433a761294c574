//! The results of a report: numbers, marks and sentences.

pub(crate) mod algorithm_parameters;
pub(crate) mod answer;
pub(crate) mod areas;
pub(crate) mod best;
pub(crate) mod cases;
pub(crate) mod cautions;
pub(crate) mod change;
pub(crate) mod choice;
pub(crate) mod common;
pub(crate) mod descriptions;
pub(crate) mod gate;
pub(crate) mod stressed;
pub(crate) mod summary;
pub(crate) mod sweep;
pub(crate) mod table_writer;
