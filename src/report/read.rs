//! Tables read back.

use super::rows::{CsvCells, Record};
use super::tables::csv_error;
use crate::error::{Error, Result};
use std::path::Path;

/// Largest table that is read, bytes: a hundred times a run of 1000 pairs and seven algorithms with
/// all cells.
const MAX_BYTES: u64 = 1 << 31;

/// The rows of a CSV file that [`super::Tables`] or [`super::Table`] wrote.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] with the line for what is no such table.
pub fn read_rows<R: Record>(path: &Path) -> Result<Vec<R>> {
    let file = std::fs::File::open(path).map_err(|e| Error::io(path, e))?;
    let metadata = file.metadata().map_err(|e| Error::io(path, e))?;
    if !metadata.is_file() || metadata.len() > MAX_BYTES {
        return Err(Error::format(
            path,
            format!("is not a table: expected a CSV file of at most {MAX_BYTES} bytes"),
        ));
    }
    let mut reader = csv::Reader::from_reader(file);
    let heads = reader.headers().map_err(|e| csv_error(path, e))?.clone();
    let row = |line: csv::Result<csv::StringRecord>| {
        let line = line.map_err(|e| csv_error(path, e))?;
        let cells = CsvCells {
            heads: &heads,
            line: &line,
        };
        R::parse(cells).map_err(|why| match line.position() {
            Some(place) => Error::format(path, format!("line {}: {why}", place.line())),
            None => Error::format(path, why),
        })
    };
    reader.records().map(row).collect()
}
