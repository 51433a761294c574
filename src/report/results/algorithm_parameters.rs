//! The table of the algorithms with a column per parameter, for sweeps.

use super::table_writer::field_metadata;
use polars::prelude::{Column, DataFrame, ParquetWriter};
use std::collections::BTreeSet;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use std::str::FromStr;
use svl_core::{Error, Result};
use svl_score::manifest::AlgorithmRecord;

/// Writes `algorithms.csv` and `algorithms.parquet` into a folder that exists: a row per algorithm
/// with label, name, filters, and a column per parameter that any of them has, by name. Numbers
/// and truth values are such where all values of the column are.
///
/// # Errors
/// [`Error::Io`] with the file, [`Error::Format`] with the error of polars.
pub fn write_algorithms(folder: &Path, algorithms: &[AlgorithmRecord]) -> Result<()> {
    let names = algorithms.iter().flat_map(|algorithm| &algorithm.values);
    let names: BTreeSet<&str> = names.map(|(name, _)| name.as_str()).collect();
    let column = |name: &str| -> Vec<Option<String>> {
        let find = |algorithm: &AlgorithmRecord| {
            let mut values = algorithm.values.iter();
            let values = values.find(|(own, _)| own == name);
            values.map(|(_, value)| value.clone())
        };
        algorithms.iter().map(find).collect()
    };
    let texts =
        |text: fn(&AlgorithmRecord) -> String| algorithms.iter().map(|a| Some(text(a))).collect();
    let mut columns: Vec<(&str, Vec<Option<String>>)> = vec![
        ("algorithm", texts(|a| a.label.clone())),
        ("name", texts(|a| a.name.clone())),
    ];
    columns.extend(names.into_iter().map(|name| (name, column(name))));
    let path = folder.join("algorithms.csv");
    let failed = |e: csv::Error| Error::format(&path, e.to_string());
    let mut writer = csv::Writer::from_path(&path).map_err(failed)?;
    let heads = columns.iter().map(|(name, _)| *name);
    writer.write_record(heads).map_err(failed)?;
    for i in 0..algorithms.len() {
        let line = columns.iter();
        let line = line.map(|(_, cells)| cells[i].as_deref().unwrap_or_default());
        writer.write_record(line).map_err(failed)?;
    }
    writer.flush().map_err(|e| Error::io(&path, e))?;
    let path = folder.join("algorithms.parquet");
    let failed = |e: polars::prelude::PolarsError| Error::format(&path, e.to_string());
    let columns = columns.into_iter().map(|(name, cells)| stored(name, cells));
    let mut frame = DataFrame::new(algorithms.len(), columns.collect()).map_err(failed)?;
    let file = File::create(&path).map_err(|e| Error::io(&path, e))?;
    ParquetWriter::new(BufWriter::new(file))
        .with_key_value_metadata(Some(field_metadata(frame.schema(), &[])))
        .finish(&mut frame)
        .map_err(failed)?;
    Ok(())
}

/// The column as numbers or truth values, if all of its texts are.
fn stored(name: &str, cells: Vec<Option<String>>) -> Column {
    fn all<T: FromStr>(cells: &[Option<String>]) -> Option<Vec<Option<T>>> {
        let read = |cell: &Option<String>| cell.as_ref().map(|text| text.parse().ok());
        let values = cells
            .iter()
            .map(|cell| read(cell).map_or(Some(None), |v| v.map(Some)));
        values.collect()
    }
    match (all::<f64>(&cells), all::<bool>(&cells)) {
        (Some(numbers), _) => Column::new(name.into(), numbers),
        (None, Some(flags)) => Column::new(name.into(), flags),
        (None, None) => Column::new(name.into(), cells),
    }
}
