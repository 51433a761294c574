//! The tables of a report and the meanings of their columns.

use super::summary::{AlgorithmSummary, CheckpointSummary};
use crate::rows::columns::ColumnDescription;
use crate::rows::held::Row;
use crate::rows::records::{CellRow, CheckpointRow, FailureRow, Record};
use crate::show::table::model::Table;
use crate::subjects::accuracy::AccuracyRow;
use crate::subjects::drives::{DriveRow, TrackRow};
use crate::subjects::pieces::{PieceRow, SightRow};
use crate::subjects::reliability::ReliabilityRow;
use crate::subjects::witness::EstimateRow;
use svl_score::judge::METRICS;

/// A table of a report's folder, `NAME.csv` and `NAME.parquet`.
pub struct TableDescription {
    pub name: &'static str,
    /// Description of a row.
    pub about: &'static str,
    pub columns: fn() -> Vec<ColumnDescription>,
}

/// All tables with fixed columns.
pub const TABLES: &[TableDescription] = &[
    table::<AlgorithmSummary>("summary", "one algorithm over all unperturbed pairs"),
    table::<CheckpointSummary>(
        "verdicts",
        "one checkpoint through one algorithm over all runs",
    ),
    table::<Row>("rows", "one pair through one algorithm"),
    table::<CellRow>(
        "cells",
        "one cell of the obstacle grid in one pair through one algorithm",
    ),
    table::<CheckpointRow>(
        "checkpoints",
        "one checkpoint of one run through one algorithm",
    ),
    table::<AccuracyRow>(
        "accuracy",
        "the errors of the distances of one algorithm in one range",
    ),
    table::<ReliabilityRow>(
        "reliability",
        "the cells of one algorithm whose probability lies in one range",
    ),
    table::<Row>(
        "references",
        "one pair through a reference, which looks at no image: prior or exact",
    ),
    table::<EstimateRow>(
        "estimates",
        "the errors of one algorithm in one area, estimated without truth",
    ),
    table::<PieceRow>("pieces", "one test piece through one algorithm"),
    table::<SightRow>(
        "sights",
        "one pair of an approach to a test piece through one algorithm",
    ),
    table::<FailureRow>("failures", "one pair that an algorithm failed on"),
    table::<DriveRow>("drives", "one course with one algorithm at the wheel"),
    table::<TrackRow>("tracks", "the robot at one pair of a drive"),
];

const fn table<R: Record>(name: &'static str, about: &'static str) -> TableDescription {
    TableDescription {
        name,
        about,
        columns: R::columns,
    }
}

/// The metrics, which are no table on disk.
pub const METRIC_NAMES: TableDescription = TableDescription {
    name: "metrics",
    about: "one metric, as `--columns`, `--sort`, `--fail-on` and `[[gate]]` name it; a limit of a \
            share is from 0 to 1",
    columns: || METRICS.iter().map(ColumnDescription::from_metric).collect(),
};

impl TableDescription {
    /// Columns of the table with types, units and meanings.
    pub fn table(&self) -> Table {
        let heads = ["type", "heading", "unit", "meaning"];
        let mut table = Table::new(self.name, "column").with_texts(heads);
        for column in (self.columns)() {
            let unit = column.unit.unwrap_or_default().to_owned();
            let heading = column.heading.unwrap_or_default();
            table.push(
                column.name,
                [column.kind.to_owned(), heading, unit, column.about],
            );
        }
        table.remove_empty_columns();
        table
    }
}
