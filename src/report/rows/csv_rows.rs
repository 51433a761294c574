//! Rows read from the CSV files of a report.

use super::records::{CsvCells, Record};
use std::fs::File;
use std::io::{Cursor, Read};
use std::path::{Path, PathBuf};
use svl_core::{Error, Result};
use svl_files::{ColumnPlaces, ColumnValue, TableText};

/// The rows of a CSV file that [`TableWriter`](crate::TableWriter) wrote, read one after the other.
pub struct RowReader<R> {
    path: PathBuf,
    places: ColumnPlaces,
    reader: csv::Reader<Box<dyn Read + Send>>,
    line: csv::StringRecord,
    /// A column, and the text that all rows have there.
    only: Option<(&'static str, String)>,
    row: std::marker::PhantomData<R>,
}

impl<R: Record> RowReader<R> {
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] for a file that is not a table.
    pub fn open(path: &Path) -> Result<Self> {
        let file = File::open(path).map_err(|e| Error::io(path, e))?;
        let metadata = file.metadata().map_err(|e| Error::io(path, e))?;
        // A device or a pipe might never end.
        if !metadata.is_file() {
            return Err(Error::format(path, "is not a table: expected a CSV file"));
        }
        Self::new(path, Box::new(file))
    }

    /// [`RowReader::open`] on the text that `file` gives.
    ///
    /// # Errors
    /// The errors of [`RowReader::open`].
    pub fn new(path: &Path, file: Box<dyn Read + Send>) -> Result<Self> {
        let mut reader = csv::Reader::from_reader(file);
        let places = ColumnPlaces::new(reader.headers().map_err(|e| csv_error(path, e))?);
        Ok(Self {
            path: path.to_owned(),
            places,
            reader,
            line: csv::StringRecord::new(),
            only: None,
            row: std::marker::PhantomData,
        })
    }

    /// The rows with that text in a column: others are not parsed.
    pub fn only(mut self, column: &'static str, text: &str) -> Self {
        self.only = Some((column, text.to_owned()));
        self
    }

    fn read(&mut self) -> Result<Option<R>> {
        loop {
            let read = self.reader.read_record(&mut self.line);
            if !read.map_err(|e| csv_error(&self.path, e))? {
                return Ok(None);
            }
            let is_other = self.only.as_ref().is_some_and(|(column, text)| {
                let cell = self.places.cell(&self.line, column);
                cell.is_some_and(|cell| cell != text)
            });
            if !is_other {
                break;
            }
        }
        let cells = CsvCells {
            places: &self.places,
            line: &self.line,
        };
        R::parse(cells).map(Some).map_err(|why| {
            let line = self.line.position().map_or(0, csv::Position::line);
            Error::format(&self.path, format!("line {line}: {why}"))
        })
    }
}

impl<R: Record> Iterator for RowReader<R> {
    type Item = Result<R>;

    fn next(&mut self) -> Option<Result<R>> {
        self.read().transpose()
    }
}

/// The rows of a CSV file that [`crate::results::table_writer::TableWriter`] wrote.
///
/// # Errors
/// The errors of [`RowReader::open`]; [`Error::Format`] with the line that is no row.
pub fn read_rows<R: Record>(path: &Path) -> Result<Vec<R>> {
    RowReader::open(path)?.collect()
}

/// A text of rows with the names of their columns.
pub(crate) fn table_text<R: Record>() -> csv::Result<TableText> {
    let mut text = TableText::default();
    let columns = R::columns();
    let names = columns.iter().map(|column| ColumnValue::Text(column.name));
    text.push(&names.collect::<Vec<_>>())?;
    Ok(text)
}

/// Rows as the text of a CSV file.
pub(crate) fn rows_to_text<R: Record>(rows: &[R]) -> csv::Result<String> {
    let mut text = table_text::<R>()?;
    let mut rows = rows.iter();
    rows.try_for_each(|row| text.push(&row.values()))?;
    String::from_utf8(text.take()).map_err(|e| std::io::Error::other(e).into())
}

/// The rows of such a text.
pub(crate) fn rows_from_text<R: Record>(text: &str) -> Result<Vec<R>> {
    let text = Cursor::new(text.to_owned());
    RowReader::new(Path::new("rows"), Box::new(text))?.collect()
}

pub(crate) fn csv_error(path: &Path, error: csv::Error) -> Error {
    let reason = error.to_string();
    match error.into_kind() {
        csv::ErrorKind::Io(source) => Error::io(path, source),
        _ => Error::format(path, reason),
    }
}
