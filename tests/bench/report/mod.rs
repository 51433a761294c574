//! Tables, summaries and pages, from hand-made rows.

mod fixture;
mod page;
mod summary;
mod tables;
