//! Results as a page, as Markdown, on the terminal.

pub mod calibration;
pub mod html;
pub(crate) mod maps;
pub(crate) mod markdown;
pub(crate) mod summary_tables;
pub(crate) mod sweeps;
pub(crate) mod terminal;
