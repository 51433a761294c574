//! Tables on disk: CSV during the run, Parquet at its end.

use super::summary::Results;
use crate::rows::columns::ColumnDescription;
use crate::rows::csv_rows::{csv_error, table_text};
use crate::rows::records::Record;
use parking_lot::Mutex;
use polars::prelude::{
    BatchedWriter, CompatLevel, KeyValueMetadata, ParquetWriter, PolarsError, PolarsResult, Schema,
    SchemaExt,
};
use polars_parquet::write::schema_to_metadata_key;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use svl_core::{Error, Result};
use svl_files::TableText;

/// One table, written as CSV, as Parquet or as both. Files of the same name are replaced.
pub struct TableWriter<R> {
    csv: Option<Csv>,
    parquet: Option<Parquet<R>>,
}

struct Csv {
    path: PathBuf,
    file: File,
    text: TableText,
}

/// Written in groups of rows, so that memory has a limit; without its footer the file cannot be
/// read until the table is complete. A pair with 15 cells takes 5 kB in memory.
struct Parquet<R> {
    path: PathBuf,
    /// Buffered: the encoder writes a few bytes at a time. It flushes at its end.
    writer: BatchedWriter<BufWriter<CheckedFile>>,
    failed: Arc<Mutex<Option<std::io::Error>>>,
    /// Rows of the group that is not written yet.
    rows: Vec<R>,
}

/// Limit on the bytes of CSV that wait in memory, but for a few thousand.
const MAX_TEXT: usize = 1 << 16;

/// Number of rows that are written at once: they and their columns wait in memory.
const ROW_GROUP: usize = 1 << 14;

impl<R: Record> TableWriter<R> {
    /// A table without a file, for rows that are only counted.
    pub fn in_memory() -> Self {
        Self {
            csv: None,
            parquet: None,
        }
    }

    /// A table in a folder that exists, as `name.csv` and `name.parquet`.
    ///
    /// # Errors
    /// [`Error::Io`] with the file that cannot be written.
    pub fn create_both(folder: &Path, name: &str) -> Result<Self> {
        let path = folder.join(name);
        Ok(Self {
            csv: Some(Csv::create::<R>(&path.with_extension("csv"))?),
            parquet: Some(Parquet::create(&path.with_extension("parquet"))?),
        })
    }

    /// A table in one file, `.csv` or `.parquet`.
    ///
    /// # Errors
    /// [`Error::Invalid`] for another extension, [`Error::Io`] when the file cannot be written.
    pub fn create(path: &Path) -> Result<Self> {
        let mut table = Self::in_memory();
        match path.extension().and_then(|e| e.to_str()) {
            Some("csv") => table.csv = Some(Csv::create::<R>(path)?),
            Some("parquet") => table.parquet = Some(Parquet::create(path)?),
            _ => {
                let path = path.display();
                let words = format!("{path}: a table is a .csv or a .parquet file");
                return Err(Error::Invalid(words));
            }
        }
        Ok(table)
    }

    /// Takes rows; the CSV file holds them when this returns.
    ///
    /// # Errors
    /// [`Error::Io`] with the file.
    pub fn push(&mut self, rows: impl IntoIterator<Item = R>) -> Result<()> {
        for row in rows {
            if let Some(csv) = &mut self.csv {
                csv.push(&row)?;
            }
            if let Some(parquet) = &mut self.parquet {
                parquet.push(row)?;
            }
        }
        match &mut self.csv {
            // Flushed per call: a killed run leaves complete rows.
            Some(csv) => csv.flush(),
            None => Ok(()),
        }
    }

    /// Completes the file.
    ///
    /// # Errors
    /// [`Error::Io`] with the file.
    pub fn finish(self) -> Result<()> {
        self.parquet.map_or(Ok(()), Parquet::finish)
    }
}

impl Csv {
    fn create<R: Record>(path: &Path) -> Result<Self> {
        let file = File::create(path).map_err(|e| Error::io(path, e))?;
        let mut csv = Self {
            path: path.to_owned(),
            file,
            text: table_text::<R>().map_err(|e| csv_error(path, e))?,
        };
        csv.flush()?;
        Ok(csv)
    }

    fn push(&mut self, row: &impl Record) -> Result<()> {
        let pushed = self.text.push(&row.values());
        pushed.map_err(|e| csv_error(&self.path, e))?;
        match self.text.bytes() {
            0..MAX_TEXT => Ok(()),
            _ => self.flush(),
        }
    }

    fn flush(&mut self) -> Result<()> {
        let written = self.file.write_all(&self.text.take());
        written.map_err(|e| Error::io(&self.path, e))
    }
}

impl<R: Record> Parquet<R> {
    fn create(path: &Path) -> Result<Self> {
        let file = File::create(path).map_err(|e| Error::io(path, e))?;
        let file = CheckedFile {
            file,
            failed: Arc::default(),
        };
        let failed = Arc::clone(&file.failed);
        let frame = R::frame(&[]).map_err(|e| polars_error(path, e))?;
        let schema = frame.schema().clone();
        let writer = ParquetWriter::new(BufWriter::new(file))
            .with_key_value_metadata(Some(field_metadata(&schema, &R::columns())))
            .batched(&schema);
        Ok(Self {
            path: path.to_owned(),
            writer: writer.map_err(|e| polars_error(path, e))?,
            failed,
            rows: Vec::new(),
        })
    }

    fn push(&mut self, row: R) -> Result<()> {
        self.rows.push(row);
        match self.rows.len() {
            ROW_GROUP => self.write_group(),
            _ => Ok(()),
        }
    }

    fn write_group(&mut self) -> Result<()> {
        let frame = R::frame(&self.rows);
        self.rows.clear();
        let written = frame.and_then(|frame| self.writer.write_batch(&frame));
        self.checked(written)
    }

    fn finish(mut self) -> Result<()> {
        if !self.rows.is_empty() {
            self.write_group()?;
        }
        let finished = self.writer.finish().map(drop);
        self.checked(finished)
    }

    /// Polars reports a full disk as an error of the format: the file knows better.
    fn checked(&self, result: PolarsResult<()>) -> Result<()> {
        let failed = self.failed.lock().take();
        match (result, failed) {
            (_, Some(error)) => Err(Error::io(&self.path, error)),
            (Err(error), None) => Err(polars_error(&self.path, error)),
            (Ok(()), None) => Ok(()),
        }
    }
}

/// The schema of Arrow that Parquet files hold, with units and meanings of the columns. Texts are
/// such that pyarrow can filter, join and sort, as not yet by Arrow's views.
pub(crate) fn field_metadata(schema: &Schema, columns: &[ColumnDescription]) -> KeyValueMetadata {
    let mut schema = schema.to_arrow(CompatLevel::oldest());
    for column in columns {
        let entries = [
            ("unit", column.unit.unwrap_or_default()),
            ("description", &column.about),
        ];
        let entries = entries.into_iter().filter(|(_, text)| !text.is_empty());
        if let Some(field) = schema.get_mut(column.name) {
            let entries = entries.map(|(key, text)| (key.into(), text.into()));
            field.metadata = Some(Arc::new(entries.collect()));
        }
    }
    KeyValueMetadata::Static(vec![schema_to_metadata_key(&schema)])
}

/// A file that remembers what went wrong first.
struct CheckedFile {
    file: File,
    failed: Arc<Mutex<Option<std::io::Error>>>,
}

impl Write for CheckedFile {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let written = self.file.write(bytes);
        written.inspect_err(|error| {
            let copy = match error.raw_os_error() {
                Some(code) => std::io::Error::from_raw_os_error(code),
                None => error.kind().into(),
            };
            let mut failed = self.failed.lock();
            failed.get_or_insert(copy);
        })
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.file.flush()
    }
}

impl Results {
    /// Writes `summary`, a row per algorithm, and `verdicts`, a row per checkpoint and algorithm,
    /// each as `.csv` and `.parquet`, into a folder that exists.
    ///
    /// # Errors
    /// The errors of [`TableWriter::push`].
    pub fn write_tables(&self, folder: &Path) -> Result<()> {
        write_table(folder, "summary", self.algorithms.iter().cloned())?;
        write_table(folder, "verdicts", self.checkpoints.iter().cloned())
    }
}

/// Writes rows as `.csv` and `.parquet`.
pub(crate) fn write_table<R: Record>(
    folder: &Path,
    name: &str,
    rows: impl IntoIterator<Item = R>,
) -> Result<()> {
    let mut table = TableWriter::create_both(folder, name)?;
    table.push(rows)?;
    table.finish()
}

fn polars_error(path: &Path, error: PolarsError) -> Error {
    Error::format(path, error.to_string())
}
