//! Texts, tables, plots and pages, whatever they show.

pub(crate) mod junit;
pub mod page;
pub mod plot;
pub mod table;
pub(crate) mod words;
