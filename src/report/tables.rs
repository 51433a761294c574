//! Tables on disk: CSV while the run goes, Parquet when it is over.

use super::rows::{CsvCells, Record};
use super::summary::Summary;
use crate::error::{Error, Result};
use polars::prelude::{ParquetWriter, PolarsError};
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

/// One table, written as CSV, as Parquet or as both. Files of the same name are replaced.
pub struct Table<R> {
    csv: Option<Csv>,
    parquet: Option<Parquet<R>>,
}

struct Csv {
    path: PathBuf,
    writer: csv::Writer<File>,
}

/// The file stays empty and the rows in memory until the table is complete: a Parquet file without
/// its footer cannot be read. A pair with 15 cells takes 5 kB.
struct Parquet<R> {
    path: PathBuf,
    file: File,
    rows: Vec<R>,
}

impl<R: Record> Table<R> {
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
        match path.extension().and_then(|e| e.to_str()) {
            Some("csv") => Ok(Self {
                csv: Some(Csv::create::<R>(path)?),
                parquet: None,
            }),
            Some("parquet") => Ok(Self {
                csv: None,
                parquet: Some(Parquet::create(path)?),
            }),
            _ => Err(Error::Invalid(format!(
                "{}: a table is a .csv or a .parquet file",
                path.display()
            ))),
        }
    }

    /// Takes rows; the CSV file holds them when this returns.
    ///
    /// # Errors
    /// [`Error::Io`] with the file.
    pub fn push(&mut self, rows: impl IntoIterator<Item = R>) -> Result<()> {
        for row in rows {
            if let Some(csv) = &mut self.csv {
                csv.writer
                    .serialize(row.values())
                    .map_err(|e| csv_error(&csv.path, e))?;
            }
            if let Some(parquet) = &mut self.parquet {
                parquet.rows.push(row);
            }
        }
        match &mut self.csv {
            // Flushed per call: a killed run leaves complete rows.
            Some(csv) => csv.writer.flush().map_err(|e| Error::io(&csv.path, e)),
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
        let mut writer = csv::WriterBuilder::new()
            // The header is written from the columns, also when no row ever comes.
            .has_headers(false)
            .from_writer(file);
        writer
            .write_record(R::columns())
            .map_err(|e| csv_error(path, e))?;
        writer.flush().map_err(|e| Error::io(path, e))?;
        Ok(Self {
            path: path.to_owned(),
            writer,
        })
    }
}

impl<R: Record> Parquet<R> {
    fn create(path: &Path) -> Result<Self> {
        let file = File::create(path).map_err(|e| Error::io(path, e))?;
        Ok(Self {
            path: path.to_owned(),
            file,
            rows: Vec::new(),
        })
    }

    fn finish(mut self) -> Result<()> {
        let mut frame = R::frame(&self.rows).map_err(|e| polars_error(&self.path, e))?;
        // Encoded in memory: polars reports a full disk as an error of the format.
        let mut bytes = Vec::new();
        ParquetWriter::new(&mut bytes)
            .finish(&mut frame)
            .map_err(|e| polars_error(&self.path, e))?;
        self.file
            .write_all(&bytes)
            .map_err(|e| Error::io(&self.path, e))
    }
}

impl Summary {
    /// Writes `summary`, a row per algorithm, and `verdicts`, a row per checkpoint and algorithm,
    /// each as `.csv` and `.parquet`, into a folder that exists.
    ///
    /// # Errors
    /// As [`Table::push`].
    pub fn write_tables(&self, folder: &Path) -> Result<()> {
        let mut algorithms = Table::create_both(folder, "summary")?;
        algorithms.push(self.algorithms.iter().cloned())?;
        algorithms.finish()?;
        let mut checkpoints = Table::create_both(folder, "verdicts")?;
        checkpoints.push(self.checkpoints.iter().cloned())?;
        checkpoints.finish()
    }
}

/// Largest table that is read, bytes: a hundred times a run of 1000 pairs and seven algorithms with
/// all cells.
const MAX_BYTES: u64 = 1 << 31;

/// The rows of a CSV file that [`super::Table`] wrote.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] with the line for a file that is no such table.
pub fn read_rows<R: Record>(path: &Path) -> Result<Vec<R>> {
    let file = File::open(path).map_err(|e| Error::io(path, e))?;
    let metadata = file.metadata().map_err(|e| Error::io(path, e))?;
    // A device or a pipe might never end.
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

fn csv_error(path: &Path, error: csv::Error) -> Error {
    let reason = error.to_string();
    match error.into_kind() {
        csv::ErrorKind::Io(source) => Error::io(path, source),
        _ => Error::format(path, reason),
    }
}

fn polars_error(path: &Path, error: PolarsError) -> Error {
    Error::format(path, error.to_string())
}
