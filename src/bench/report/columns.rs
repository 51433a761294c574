//! The tables of a report and the meanings of their columns.

use super::drives::{DriveRow, TrackRow};
use super::rows::{CellRow, CheckpointRow, FailureRow, Record, Row};
use super::summary::{AlgorithmSummary, CheckpointSummary};
use super::table::{Table, TableCell, TableColumn};
use serde::Serialize;

/// The version of the files of a report: `schema` in `manifest.json` and `summary.json`.
///
/// Under the same number columns and keys keep their names, units and meanings; new ones may be
/// added, in tables behind the others. What is renamed, removed or measured otherwise raises it.
pub use svl_data::manifest::SCHEMA;

/// A column of a table on disk.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ColumnDescription {
    pub name: &'static str,
    /// `text`, `integer`, `number` or `boolean`; with `?` where it may be empty.
    pub kind: &'static str,
    /// Unit of its numbers; counts, names and shares from 0 to 1 have none.
    pub unit: Option<&'static str>,
    pub about: String,
}

/// A table of a report's folder, `NAME.csv` and `NAME.parquet`.
pub struct TableDescription {
    pub name: &'static str,
    /// What a row of it is.
    pub about: &'static str,
    pub columns: fn() -> Vec<ColumnDescription>,
}

/// All tables with fixed columns.
pub const TABLES: &[TableDescription] = &[
    TableDescription {
        name: "summary",
        about: "one algorithm over all unperturbed pairs",
        columns: AlgorithmSummary::columns,
    },
    TableDescription {
        name: "verdicts",
        about: "one checkpoint through one algorithm over all runs",
        columns: CheckpointSummary::columns,
    },
    TableDescription {
        name: "rows",
        about: "one pair through one algorithm",
        columns: Row::columns,
    },
    TableDescription {
        name: "cells",
        about: "one cell of the obstacle grid in one pair through one algorithm",
        columns: CellRow::columns,
    },
    TableDescription {
        name: "checkpoints",
        about: "one checkpoint of one run through one algorithm",
        columns: CheckpointRow::columns,
    },
    TableDescription {
        name: "failures",
        about: "one pair that an algorithm failed on",
        columns: FailureRow::columns,
    },
    TableDescription {
        name: "drives",
        about: "one course with one algorithm at the wheel",
        columns: DriveRow::columns,
    },
    TableDescription {
        name: "tracks",
        about: "the robot at one pair of a drive",
        columns: TrackRow::columns,
    },
];

impl ColumnDescription {
    /// A column whose unit its name ends with.
    pub(super) fn new(name: &'static str, kind: &'static str, about: &str) -> Self {
        Self {
            name,
            kind,
            unit: unit(name),
            about: about.trim().to_owned(),
        }
    }
}

/// Units by the endings of names.
const UNITS: [(&str, &str); 11] = [
    ("_per_m_per_s", "1/(m s)"),
    ("_m_per_s", "m/s"),
    ("_per_mp_s", "s per million pixels"),
    ("_per_gd_s", "s per 10⁹ pixels times disparities"),
    ("mde_per_s", "million pixels times disparities per s"),
    ("_ns", "ns"),
    ("_us", "µs"),
    ("_ms", "ms"),
    ("_px", "px"),
    ("_mb", "10⁶ bytes"),
    ("heading", "rad"),
];

fn unit(name: &str) -> Option<&'static str> {
    let found = UNITS.iter().find(|(ending, _)| name.ends_with(ending));
    let short = || match name.rsplit_once('_')?.1 {
        "m" => Some("m"),
        "s" => Some("s"),
        _ => None,
    };
    found.map(|(_, unit)| *unit).or_else(short)
}

impl TableDescription {
    /// The table of that name.
    pub fn find(name: &str) -> Option<&'static Self> {
        TABLES.iter().find(|table| table.name == name)
    }

    /// Its columns with types, units and meanings.
    pub fn table(&self) -> Table {
        let mut table = Table::new(self.name, "column");
        let text = |head: &str| TableColumn {
            is_text: true,
            ..TableColumn::new("", head)
        };
        table.columns.extend(["type", "unit", "meaning"].map(text));
        for column in (self.columns)() {
            let unit = column.unit.unwrap_or_default();
            let cells = [column.name, column.kind, unit, &column.about];
            table
                .rows
                .push(cells.map(|cell| TableCell::Text(cell.to_owned())).to_vec());
        }
        table
    }
}
