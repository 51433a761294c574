//! Tables, summaries and pages, from hand-made rows.

mod degenerate;
mod fixture;
mod page;
mod summary;
mod tables;
