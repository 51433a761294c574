//! The rows of the tables and their columns, in CSV, JSON and polars.

pub(crate) mod columns;
pub(crate) mod csv_rows;
pub(crate) mod held;
pub(crate) mod records;
pub(crate) mod samples;
