//! Tables as CSV and Parquet.

use super::fixture::{blind, cell, checkpoint, example, parquet, row};
use polars::prelude::{ParquetReader, SerReader};
use svl::Error;
use svl::report::table::TerminalStyle;
use svl::report::{
    AlgorithmSummary, CellRow, CheckpointRow, CheckpointSummary, ColumnDescription, Record,
    Results, Row, Rows, TABLES, TableWriter, read_rows,
};
use svl::score::Verdict;

#[test]
fn csv_and_parquet_hold_what_was_pushed() {
    let folder = tempfile::tempdir().unwrap();
    let rows = vec![row("v3", 0, 5_000), blind("bm", 1)];
    let cells = vec![
        cell("v3", 0, Verdict::Right),
        cell("v3", 1, Verdict::Unknown),
        cell("v3", 2, Verdict::NoTruth),
    ];
    let checkpoints = vec![
        checkpoint(1, "opening", "v3", (3, 4)),
        checkpoint(2, "corner", "v3", (0, 0)),
    ];
    fn write<R: Record + Clone>(folder: &std::path::Path, name: &str, rows: &[R]) {
        let mut table = TableWriter::create_both(folder, name).unwrap();
        table.push(rows.iter().cloned()).unwrap();
        table.finish().unwrap();
    }
    write(folder.path(), "rows", &rows);
    write(folder.path(), "cells", &cells);
    write(folder.path(), "checkpoints", &checkpoints);

    let file = |name: &str| folder.path().join(name);
    assert_eq!(read_rows::<Row>(&file("rows.csv")).unwrap(), rows);
    assert_eq!(read_rows::<CellRow>(&file("cells.csv")).unwrap(), cells);
    assert_eq!(
        read_rows::<CheckpointRow>(&file("checkpoints.csv")).unwrap(),
        checkpoints
    );
    assert!(parquet(&file("rows.parquet")).equals_missing(&Row::frame(&rows).unwrap()));
    assert!(parquet(&file("cells.parquet")).equals_missing(&CellRow::frame(&cells).unwrap()));
    assert!(
        parquet(&file("checkpoints.parquet"))
            .equals_missing(&CheckpointRow::frame(&checkpoints).unwrap())
    );
}

#[test]
fn the_summary_is_two_tables() {
    let folder = tempfile::tempdir().unwrap();
    let summary = example();
    summary.write_tables(folder.path()).unwrap();
    let file = |name: &str| folder.path().join(name);
    // The cases of metrics have no columns.
    let read: Vec<AlgorithmSummary> = read_rows(&file("summary.csv")).unwrap();
    let [read, own] = [&read, &summary.algorithms].map(|rows| AlgorithmSummary::frame(rows));
    assert!(read.unwrap().equals_missing(&own.unwrap()));
    assert_eq!(
        read_rows::<CheckpointSummary>(&file("verdicts.csv")).unwrap(),
        summary.checkpoints
    );
    let frames = [
        AlgorithmSummary::frame(&summary.algorithms),
        CheckpointSummary::frame(&summary.checkpoints),
    ];
    for (name, frame) in ["summary.parquet", "verdicts.parquet"].iter().zip(frames) {
        assert!(
            parquet(&file(name)).equals_missing(&frame.unwrap()),
            "{name}"
        );
    }
}

#[test]
fn the_heads_of_the_tables_are_fixed() {
    let tables = [
        Row::columns(),
        CellRow::columns(),
        CheckpointRow::columns(),
        AlgorithmSummary::columns(),
        CheckpointSummary::columns(),
    ];
    let names = |columns: Vec<ColumnDescription>| {
        let names: Vec<_> = columns.iter().map(|column| column.name).collect();
        names.join("\n")
    };
    let heads = tables.map(names);
    insta::assert_snapshot!("columns", heads.join("\n\n"));
}

#[test]
fn a_single_table_goes_by_its_extension() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rows.csv");
    let mut table = TableWriter::create(&path).unwrap();
    table.push([row("v3", 0, 5_000)]).unwrap();
    table.finish().unwrap();
    assert_eq!(read_rows::<Row>(&path).unwrap(), [row("v3", 0, 5_000)]);
    let error = TableWriter::<Row>::create(&folder.path().join("rows.xlsx"))
        .err()
        .unwrap();
    assert!(
        error
            .to_string()
            .ends_with("rows.xlsx: a table is a .csv or a .parquet file"),
        "{error}"
    );
}

#[test]
fn a_crash_keeps_the_rows() {
    let folder = tempfile::tempdir().unwrap();
    let mut rows = TableWriter::create_both(folder.path(), "rows").unwrap();
    let mut cells = TableWriter::create_both(folder.path(), "cells").unwrap();
    rows.push([row("v3", 0, 5_000)]).unwrap();
    cells.push([cell("v3", 0, Verdict::Wrong)]).unwrap();
    // Not even dropped: the state on disk is all that remains after a kill.
    std::mem::forget((rows, cells));
    assert_eq!(
        read_rows::<Row>(&folder.path().join("rows.csv")).unwrap(),
        [row("v3", 0, 5_000)]
    );
    assert_eq!(
        read_rows::<CellRow>(&folder.path().join("cells.csv")).unwrap(),
        [cell("v3", 0, Verdict::Wrong)]
    );
}

#[test]
fn a_folder_that_cannot_be_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "").unwrap();
    let error = TableWriter::<Row>::create_both(&file.join("report"), "rows")
        .err()
        .unwrap();
    assert!(
        matches!(&error, Error::Io { path, .. } if path.starts_with(file.join("report"))),
        "{error}"
    );
    assert!(!error.to_string().contains('\n'));
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_an_error_with_the_file() {
    for name in ["rows.csv", "rows.parquet"] {
        let folder = tempfile::tempdir().unwrap();
        let full = folder.path().join(name);
        std::os::unix::fs::symlink("/dev/full", &full).unwrap();
        let error = TableWriter::create(&full)
            .and_then(|mut table| {
                table
                    .push([row("v3", 0, 5_000)])
                    .and_then(|()| table.finish())
            })
            .unwrap_err();
        let Error::Io { path, cause } = &error else {
            panic!("{error:?}")
        };
        assert_eq!(
            (path, cause.kind()),
            (&full, std::io::ErrorKind::StorageFull)
        );
        assert!(!error.to_string().contains('\n'));
    }
}

#[test]
fn an_empty_run_has_tables_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let table = TableWriter::<Row>::create_both(folder.path(), "rows").unwrap();
    table.finish().unwrap();
    let table = TableWriter::<CellRow>::create_both(folder.path(), "cells").unwrap();
    table.finish().unwrap();
    let summary = Results::from_rows(&Rows::default(), &[], None);
    assert!(summary.algorithms.is_empty() && summary.checkpoints.is_empty());
    assert_eq!(summary.pairs_hash, None);
    let text = summary.terminal("none", TerminalStyle::plain(80), false);
    assert!(text.ends_with("\nno pairs\n"), "{text}");
    assert_eq!(
        parquet(&folder.path().join("cells.parquet")).shape(),
        (0, CellRow::columns().len())
    );
    assert!(
        read_rows::<Row>(&folder.path().join("rows.csv"))
            .unwrap()
            .is_empty()
    );
}

#[test]
fn every_column_has_a_meaning_also_in_its_file() {
    for table in TABLES {
        for column in (table.columns)() {
            let (table, name) = (table.name, column.name);
            assert!(
                column.about.ends_with('.'),
                "{table}.{name}: {}",
                column.about
            );
            let has_time = name.ends_with("_ms") || name.ends_with("_us");
            assert!(column.unit.is_some() || !has_time, "{table}.{name}");
        }
    }
}

#[test]
fn parquet_fields_have_units_and_descriptions() {
    let folder = tempfile::tempdir().unwrap();
    let mut table = TableWriter::create_both(folder.path(), "rows").unwrap();
    table.push([row("v3", 0, 5_000)]).unwrap();
    table.finish().unwrap();
    let file = std::fs::File::open(folder.path().join("rows.parquet")).unwrap();
    let schema = ParquetReader::new(file).schema().unwrap();
    for column in Row::columns() {
        let metadata = schema.get(column.name).unwrap().metadata.clone().unwrap();
        let text = |key: &str| metadata.get(key).map(|text| text.to_string());
        assert_eq!(text("description"), Some(column.about), "{}", column.name);
        assert_eq!(
            text("unit"),
            column.unit.map(str::to_owned),
            "{}",
            column.name
        );
    }
}

#[test]
fn a_sweep_has_a_column_per_parameter() {
    let folder = tempfile::tempdir().unwrap();
    let labels = ["v3:texture_sigma=0.8", "wide=bm:uniqueness=15"];
    let algorithms = labels.map(|label| label.parse().unwrap());
    let manifest = svl::manifest::Manifest::new("s", &algorithms).unwrap();
    svl::report::write_algorithms(folder.path(), &manifest.algorithms).unwrap();
    let text = std::fs::read_to_string(folder.path().join("algorithms.csv")).unwrap();
    let lines: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    let cell = |row: usize, name: &str| {
        let place = lines[0].iter().position(|head| *head == name).unwrap();
        lines[row][place]
    };
    assert_eq!(
        (
            cell(1, "name"),
            cell(1, "texture_sigma"),
            cell(1, "uniqueness")
        ),
        ("v3", "0.8", "")
    );
    assert_eq!(
        (cell(2, "algorithm"), cell(2, "uniqueness")),
        ("wide", "15")
    );
    let file = std::fs::File::open(folder.path().join("algorithms.parquet")).unwrap();
    let frame = ParquetReader::new(file).finish().unwrap();
    let sigma = frame.column("texture_sigma").unwrap().f64().unwrap();
    assert_eq!(sigma.iter().collect::<Vec<_>>(), [Some(0.8), None]);
}
