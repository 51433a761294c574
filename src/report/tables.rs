//! Tables on disk: CSV while the run goes, Parquet when it is over.

use super::rows::{CellRow, CheckpointRow, Record, Row};
use super::summary::Summary;
use crate::error::{Error, Result};
use polars::prelude::{DataFrame, ParquetWriter, PolarsError};
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
/// its footer is none. A pair with 15 cells takes 5 kB.
struct Parquet<R> {
    path: PathBuf,
    file: File,
    rows: Vec<R>,
}

impl<R: Record> Table<R> {
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
                    .serialize(&row)
                    .map_err(|e| csv_error(&csv.path, e))?;
            }
            if let Some(parquet) = &mut self.parquet {
                parquet.rows.push(row);
            }
        }
        match &mut self.csv {
            Some(csv) => csv.writer.flush().map_err(|e| Error::io(&csv.path, e)),
            None => Ok(()),
        }
    }

    /// Completes the file.
    ///
    /// # Errors
    /// [`Error::Io`] with the file.
    pub fn finish(self) -> Result<()> {
        self.into_frame().map(drop)
    }

    /// The complete table, empty where it is CSV alone.
    fn into_frame(self) -> Result<DataFrame> {
        self.parquet
            .map_or_else(|| Ok(DataFrame::default()), Parquet::finish)
    }
}

impl Csv {
    fn create<R: Record>(path: &Path) -> Result<Self> {
        let file = File::create(path).map_err(|e| Error::io(path, e))?;
        let mut writer = csv::WriterBuilder::new()
            .has_headers(false)
            .from_writer(file);
        writer
            .write_record(R::COLUMNS)
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

    fn finish(mut self) -> Result<DataFrame> {
        let mut frame = R::frame(&self.rows).map_err(|e| polars_error(&self.path, e))?;
        // Encoded in memory: polars tells a full disk as a fault of the format.
        let mut bytes = Vec::new();
        ParquetWriter::new(&mut bytes)
            .finish(&mut frame)
            .map_err(|e| polars_error(&self.path, e))?;
        self.file
            .write_all(&bytes)
            .map_err(|e| Error::io(&self.path, e))?;
        Ok(frame)
    }
}

/// The three tables of a scored run in one folder.
pub struct Tables {
    folder: PathBuf,
    rows: Table<Row>,
    cells: Table<CellRow>,
    checkpoints: Table<CheckpointRow>,
}

impl Tables {
    /// Makes the folder where there is none and begins `rows`, `cells` and `checkpoints`, each as
    /// `.csv` and `.parquet`.
    ///
    /// # Errors
    /// [`Error::Io`] with the folder or file that cannot be written.
    pub fn create(folder: &Path) -> Result<Self> {
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
        Ok(Self {
            folder: folder.to_owned(),
            rows: both(folder, "rows")?,
            cells: both(folder, "cells")?,
            checkpoints: both(folder, "checkpoints")?,
        })
    }

    /// Takes one pair through one algorithm. The CSV files hold it when this returns, the cells
    /// before their row.
    ///
    /// # Errors
    /// [`Error::Io`] with the file.
    pub fn push(&mut self, row: Row, cells: impl IntoIterator<Item = CellRow>) -> Result<()> {
        self.cells.push(cells)?;
        self.rows.push([row])
    }

    /// Takes a checkpoint of a run.
    ///
    /// # Errors
    /// As [`Tables::push`].
    pub fn push_checkpoint(&mut self, row: CheckpointRow) -> Result<()> {
        self.checkpoints.push([row])
    }

    /// Writes the Parquet files and sums the run up.
    ///
    /// # Errors
    /// As [`Tables::push`].
    pub fn finish(self) -> Result<Summary> {
        let rows = self.rows.into_frame()?;
        self.cells.finish()?;
        let checkpoints = self.checkpoints.into_frame()?;
        Summary::of(&rows, &checkpoints).map_err(|e| polars_error(&self.folder, e))
    }
}

impl Summary {
    /// Writes `summary`, a row per algorithm, and `verdicts`, a row per checkpoint and algorithm,
    /// each as `.csv` and `.parquet`, into a folder that exists.
    ///
    /// # Errors
    /// As [`Tables::push`].
    pub fn write_tables(&self, folder: &Path) -> Result<()> {
        let mut algorithms = both(folder, "summary")?;
        algorithms.push(self.algorithms.iter().cloned())?;
        algorithms.finish()?;
        let mut checkpoints = both(folder, "verdicts")?;
        checkpoints.push(self.checkpoints.iter().cloned())?;
        checkpoints.finish()
    }
}

fn both<R: Record>(folder: &Path, name: &str) -> Result<Table<R>> {
    let csv = Csv::create::<R>(&folder.join(name).with_extension("csv"))?;
    let parquet = Parquet::create(&folder.join(name).with_extension("parquet"))?;
    Ok(Table {
        csv: Some(csv),
        parquet: Some(parquet),
    })
}

pub(super) fn csv_error(path: &Path, error: csv::Error) -> Error {
    let reason = error.to_string();
    match error.into_kind() {
        csv::ErrorKind::Io(source) => Error::io(path, source),
        _ => Error::format(path, reason),
    }
}

fn polars_error(path: &Path, error: PolarsError) -> Error {
    Error::format(path, error.to_string())
}
