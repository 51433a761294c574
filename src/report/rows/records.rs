//! The rows of the tables and their columns, in CSV, JSON and polars.
//!
//! Fractions are 0..=1, cells and sequences count from 0, distances are along the optical axis. A
//! metric that needs ground truth is absent without it.

use super::columns::ColumnDescription;
use polars::prelude::{Column, DataFrame, PolarsResult};
use serde::Serializer;
use serde::ser::SerializeMap as _;
use std::collections::BTreeMap;
use std::str::FromStr;
use std::sync::LazyLock;
use svl_core::statistics::nearest_rank;
use svl_core::stereo::{CellDepth, CellRule, CellState};
use svl_files::{ColumnPlaces, ColumnValue};
use svl_score::judge::{
    AreaChoice, Cases, CellArea, METRICS, Measured, Metric, MetricOrigin, MetricSource,
    MetricTotal, MetricUnit, MetricValues, Verdict,
};

/// A row of a table: named columns, each of one type.
pub trait Record: Sized {
    /// The columns, in their order.
    fn columns() -> Vec<ColumnDescription>;

    /// A value per column.
    fn values(&self) -> Vec<ColumnValue<'_>>;

    /// The row from the texts of its columns, in `cells`.
    ///
    /// # Errors
    /// The column that is missing or has no value of its type.
    fn parse(cells: CsvCells<'_>) -> Result<Self, RowError>;

    /// The rows as a data frame, typed also without rows.
    ///
    /// # Errors
    /// The error of polars.
    fn frame(rows: &[Self]) -> PolarsResult<DataFrame>;
}

/// Why a line of a table is no row.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RowError {
    #[error("has no column '{0}'")]
    NoColumn(String),
    /// The text, and its column.
    #[error("'{0}' in column '{1}' cannot be read")]
    Value(String, String),
}

/// A line of a CSV file.
#[derive(Clone, Copy)]
pub struct CsvCells<'a> {
    pub(crate) places: &'a ColumnPlaces,
    pub(crate) line: &'a csv::StringRecord,
}

impl<'a> CsvCells<'a> {
    fn get(self, column: &str) -> Result<&'a str, RowError> {
        // By name: users may reorder them.
        let cell = self.places.cell(self.line, column);
        cell.ok_or_else(|| RowError::NoColumn(column.to_owned()))
    }
}

/// The name of a field's column: that of the field, also where it is a keyword.
pub(crate) fn column_name(field: &'static str) -> &'static str {
    field.strip_prefix("r#").unwrap_or(field)
}

/// Declares a row of one list of fields, each a column or several.
macro_rules! record {
    ($(#[$about:meta])* $name:ident { $($(#[doc = $doc:literal])* $field:ident: $kind:ty,)* }) => {
        $(#[$about])*
        #[derive(Clone, Debug, PartialEq)]
        pub struct $name { $($(#[doc = $doc])* pub $field: $kind,)* }

        impl $crate::rows::records::Record for $name {
            fn columns() -> Vec<$crate::rows::columns::ColumnDescription> {
                let mut columns = Vec::new();
                $(<$kind as $crate::rows::records::RowField>::columns(
                    $crate::rows::records::column_name(stringify!($field)),
                    concat!($($doc),*),
                    &mut columns,
                );)*
                columns
            }

            fn values(&self) -> Vec<svl_files::ColumnValue<'_>> {
                let mut values = Vec::new();
                $($crate::rows::records::RowField::values(&self.$field, &mut values);)*
                values
            }

            fn parse(
                cells: $crate::rows::records::CsvCells<'_>,
            ) -> std::result::Result<Self, $crate::rows::records::RowError> {
                Ok(Self {$(
                    $field: $crate::rows::records::RowField::parse(
                        $crate::rows::records::column_name(stringify!($field)),
                        cells,
                    )?,
                )*})
            }

            fn frame(rows: &[Self]) -> polars::prelude::PolarsResult<polars::prelude::DataFrame> {
                let mut columns = Vec::new();
                $(
                    let fields: Vec<_> = rows.iter().map(|row| &row.$field).collect();
                    columns.extend($crate::rows::records::RowField::stored(
                        $crate::rows::records::column_name(stringify!($field)),
                        &fields,
                    ));
                )*
                polars::prelude::DataFrame::new(rows.len(), columns)
            }
        }

        impl serde::Serialize for $name {
            fn serialize<S: serde::Serializer>(
                &self,
                serializer: S,
            ) -> std::result::Result<S::Ok, S::Error> {
                use $crate::rows::records::Record as _;
                let mut keys = $crate::rows::records::MetricKeys::default();
                $($crate::rows::records::RowField::add_keys(&self.$field, &mut keys);)*
                let (columns, values) = (Self::columns(), self.values());
                $crate::rows::records::serialize_record(&columns, values, keys, serializer)
            }
        }
    };
}
pub(crate) use record;

/// Keys of a row in JSON besides its columns: the metrics by their names, and their cases.
#[derive(Default)]
pub(crate) struct MetricKeys {
    values: Vec<(&'static str, AreaChoice, f64)>,
    cases: BTreeMap<&'static str, Cases>,
}

/// Writes a row as JSON: a number per column and per metric, those of other areas than the
/// headline's in `areas`, by the name of the area, which is absent where nothing is of it.
pub(crate) fn serialize_record<S: Serializer>(
    columns: &[ColumnDescription],
    values: Vec<ColumnValue<'_>>,
    keys: MetricKeys,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let mut map = serializer.serialize_map(None)?;
    let mut areas: BTreeMap<&str, BTreeMap<&str, ColumnValue<'_>>> = BTreeMap::new();
    for (column, value) in columns.iter().zip(values) {
        let Some(area) = column.area.map(AreaChoice::name) else {
            // Stamps are beyond what numbers of JSON are exact for.
            match value {
                ColumnValue::Whole(Some(ns)) if column.unit == Some("ns") => {
                    map.serialize_entry(column.name, &ns.to_string())?;
                }
                value => map.serialize_entry(column.name, &value)?,
            }
            continue;
        };
        let name = column.name.strip_prefix(area).unwrap_or(column.name);
        if !matches!(value, ColumnValue::Whole(None) | ColumnValue::Real(None)) {
            let own = areas.entry(area).or_default();
            own.insert(name.trim_start_matches('_'), value);
        }
    }
    for (name, area, value) in keys.values {
        let has_column = columns.iter().any(|column| column.name == name);
        if area != AreaChoice::default() {
            let own = areas.entry(area.name()).or_default();
            own.insert(name, ColumnValue::Real(Some(value)));
        } else if !has_column {
            map.serialize_entry(name, &value)?;
        }
    }
    if !areas.is_empty() {
        map.serialize_entry("areas", &areas)?;
    }
    if !keys.cases.is_empty() {
        map.serialize_entry("cases", &keys.cases)?;
    }
    map.end()
}

record! {
    /// A pair that an algorithm failed on.
    FailureRow {
        /// Name of the scenario.
        scenario: String,
        /// Name of the recording, if the scenario has recordings.
        run: Option<String>,
        /// Seed of the arena or of the course; absent for recordings.
        seed: Option<u64>,
        /// Number of the pair in its run.
        sequence: u64,
        /// Label of the algorithm, as `v3:max_disparity=64`.
        algorithm: String,
        /// Reason of the failure.
        reason: String,
        /// The perturbation of the pair.
        stress: Option<String>,
    }
}

record! {
    #[derive(Default)]
    /// One cell of the obstacle grid in one pair through one algorithm.
    CellRow {
        /// Name of the scenario.
        scenario: String,
        /// Number of the pair in its run.
        sequence: u64,
        /// Seed of the arena.
        seed: Option<u64>,
        /// Label of the algorithm, as `v3:max_disparity=64`.
        algorithm: String,
        /// Column of the cell, from 0 at the left.
        column: u32,
        /// Row of the cell, from 0 at the top.
        row: u32,
        /// Fraction of the cell's pixels with a disparity.
        valid_share: f64,
        /// Median of the reported disparities.
        median_px: Option<f64>,
        /// 20th percentile of the reported disparities: the farther part.
        p20_px: Option<f64>,
        /// 80th percentile of the reported disparities: the nearer part.
        p80_px: Option<f64>,
        /// Reported distance along the optical axis.
        distance_m: Option<f64>,
        /// Median true disparity.
        true_median_px: Option<f64>,
        /// True distance of the median.
        true_distance_m: Option<f64>,
        /// Result of the cell: right, wrong, unknown or no-truth.
        verdict: Verdict,
        /// Area of the cell by its truth: obstacle, floor (half or more of it), beyond (its median
        /// is beyond `beyond_m`), or pixels where disparities are scored.
        area: Option<CellArea>,
        /// A quarter of the cell is truly nearer than the scenario's `obstacle_m` and not floor,
        /// and the cell is known to be farther than its `clear_m`.
        missed: bool,
        /// The cell is reported at most at `clear_m`, as near or as too close, and less than 5 % of
        /// it is nearer than the farthest truth of which a report at `clear_m` is right.
        r#false: bool,
        /// Name of the recording, if the scenario has recordings.
        run: Option<String>,
        /// State of the cell, as the algorithm reports it.
        state: Option<CellState>,
        /// Probability that the cell is right, if the algorithm gives one.
        probability: Option<f64>,
        /// Probability that something is nearer than `obstacle_m`, of an unknown cell in state
        /// `near`.
        near_probability: Option<f64>,
        /// Perturbation of the pair, if any.
        stress: Option<String>,
        /// Number of points of a sparse truth; with `no-truth` they do not determine the median.
        /// Absent if the truth is dense or missing.
        true_points: Option<u64>,
        /// Size of the image at which the cell was decided: 0 is that of the pair, each further
        /// level half of the one before; 0 of an algorithm without levels.
        level: u32,
        /// Distance of the nearer of two surfaces, or of what is seen in an unknown cell, of small
        /// cells of v5.
        near_distance_m: Option<f64>,
        /// Disparity of that surface.
        near_px: Option<f64>,
        /// Distance of the test piece, of a cell that shows it and nothing else that is as near.
        piece_m: Option<f64>,
        /// Probability that the cell has a surface there.
        surface_probability: Option<f64>,
        /// Distance up to which the robot's body drove through half of the cell, at least.
        free_m: Option<f64>,
    }
}

impl CellRow {
    /// The reported disparities and distance, where infinity has that disparity.
    pub(crate) fn depth(&self, infinity_px: Option<f32>) -> Option<CellDepth> {
        let px = [self.p20_px?, self.median_px?, self.p80_px?];
        Some(CellDepth {
            infinity_px,
            distance_m: self.distance_m,
            ..CellDepth::new(px.map(|px| px as f32), None)
        })
    }
}

record! {
    /// One checkpoint of one run through one algorithm.
    CheckpointRow {
        /// Name of the scenario.
        scenario: String,
        /// Seed of the arena or of the course; absent for recordings.
        seed: Option<u64>,
        /// The checkpoint's number in the scenario.
        checkpoint: u32,
        /// Name of the checkpoint.
        name: String,
        /// Label of the algorithm, as `v3:max_disparity=64`.
        algorithm: String,
        /// Number of frames that show the checkpoint.
        frames: u64,
        /// Number of these frames in which the checkpoint passes.
        passed: u64,
        /// `passed / frames`; absent if no frame shows the checkpoint.
        share: Option<f64>,
        /// Sequence number of the best frame.
        best_sequence: Option<u64>,
        /// The checkpoint passes in the best frame.
        best_passed: Option<bool>,
        /// Sequence number of the worst frame.
        worst_sequence: Option<u64>,
        /// The checkpoint passes in the worst frame.
        worst_passed: Option<bool>,
        /// Name of the recording, if the scenario has recordings.
        run: Option<String>,
        /// Perturbation of the pairs, if any.
        stress: Option<String>,
    }
}

record! {
    /// A frame that shows a checkpoint, through one algorithm.
    FrameRow {
        /// Number of the pair in its run.
        sequence: u64,
        /// Label of the algorithm, as `v3:max_disparity=64`.
        algorithm: String,
        /// The checkpoint's number in the scenario.
        checkpoint: u32,
        /// The checkpoint passes.
        passed: bool,
        /// Cells that must be right and are not.
        missing: u64,
        /// Cells that are wrong.
        wrong: u64,
        /// The reported distances are in the required order.
        order_holds: bool,
        /// The largest relative error of distance; infinite if one is not reported.
        error: f64,
    }
}

/// A field of a row: one column of its name, or several.
pub(crate) trait RowField: Sized {
    /// Type of its column, as [`ColumnDescription::kind`].
    const KIND: &'static str;

    fn columns(name: &'static str, about: &str, columns: &mut Vec<ColumnDescription>) {
        columns.push(ColumnDescription::new(name, Self::KIND, about));
    }

    fn values<'a>(&'a self, values: &mut Vec<ColumnValue<'a>>);

    fn parse(name: &str, cells: CsvCells<'_>) -> Result<Self, RowError>;

    fn stored(name: &'static str, fields: &[&Self]) -> Vec<Column>;

    fn add_keys(&self, _: &mut MetricKeys) {}
}

/// Types that are one column: their kind, their value, the value of a text, and that in polars.
macro_rules! columns {
    ($($kind:ty: $name:literal, |$field:ident| $value:expr, $read:expr, $stored:expr;)*) => {$(
        impl RowField for $kind {
            const KIND: &'static str = $name;

            fn values<'a>(&'a self, values: &mut Vec<ColumnValue<'a>>) {
                let $field = self;
                values.push($value);
            }

            fn parse(name: &str, cells: CsvCells<'_>) -> Result<Self, RowError> {
                let read: fn(&str) -> Option<Self> = $read;
                let text = cells.get(name)?;
                read(text).ok_or_else(|| RowError::Value(text.to_owned(), name.to_owned()))
            }

            fn stored(name: &'static str, fields: &[&Self]) -> Vec<Column> {
                let values: Vec<_> = fields.iter().copied().map($stored).collect();
                vec![Column::new(name.into(), values)]
            }
        }
    )*};
}

columns! {
    String: "text", |v| ColumnValue::Text(v), |text| Some(text.to_owned()), String::clone;
    Option<String>: "text?", |v| ColumnValue::Text(v.as_deref().unwrap_or_default()), optional,
        Option::clone;
    Verdict: "text", |v| ColumnValue::Text(v.name()), Verdict::from_name, |v| v.name();
    Option<CellState>: "text?", |v| ColumnValue::Text(v.map_or("", |v| v.name())),
        |text| optional_by(text, CellState::from_name), |v| v.map(|v| v.name());
    Option<CellArea>: "text?", |v| ColumnValue::Text(v.map_or("", CellArea::name)),
        |text| optional_by(text, CellArea::from_name), |v| v.map(CellArea::name);
    AreaChoice: "text", |v| ColumnValue::Text(v.name()), AreaChoice::from_name, |v| v.name();
    u32: "integer", |n| ColumnValue::Whole(Some((*n).into())), read, |n| signed((*n).into());
    u64: "integer", |n| ColumnValue::Whole(Some(*n)), read, |n| signed(*n);
    f64: "number", |v| ColumnValue::Real(Some(*v)), read, f64::clone;
    bool: "boolean", |flag| ColumnValue::Flag(Some(*flag)), read, bool::clone;
    Option<u32>: "integer?", |n| ColumnValue::Whole(n.map(u64::from)), optional,
        |n| n.map(|n| signed(n.into()));
    Option<u64>: "integer?", |n| ColumnValue::Whole(*n), optional, |n| n.map(signed);
    Option<f64>: "number?", |v| ColumnValue::Real(*v), optional, Option::clone;
    Option<bool>: "boolean?", |flag| ColumnValue::Flag(*flag), optional, Option::clone;
}

/// A count as Parquet has it: differences of unsigned ones would wrap in its readers.
fn signed(n: u64) -> i64 {
    i64::try_from(n).unwrap_or(i64::MAX)
}

fn read<T: FromStr>(text: &str) -> Option<T> {
    text.parse().ok()
}

fn optional<T: FromStr>(text: &str) -> Option<Option<T>> {
    optional_by(text, read)
}

fn optional_by<T>(text: &str, read: fn(&str) -> Option<T>) -> Option<Option<T>> {
    match text {
        "" => Some(None),
        _ => read(text).map(Some),
    }
}

/// A metric's column in a table, of the cells of an area.
struct MetricColumn {
    metric: &'static Metric,
    area: AreaChoice,
    name: String,
}

static METRICS_IN_ROWS: LazyLock<Vec<MetricColumn>> = LazyLock::new(|| {
    let of_frames = METRICS.iter().filter(|metric| metric.column().is_some());
    metric_columns(&of_frames.collect::<Vec<_>>(), &AreaChoice::PARTS)
});

static METRICS_IN_SUMMARIES: LazyLock<Vec<MetricColumn>> = LazyLock::new(|| {
    let metrics = METRICS.iter();
    let metrics: Vec<_> = metrics.filter(|m| m.summary_column().is_some()).collect();
    metric_columns(&metrics, &AreaChoice::ALL)
});

/// The columns of metrics that have one: those of the headline, then those of the other areas.
fn metric_columns(metrics: &[&'static Metric], areas: &[AreaChoice]) -> Vec<MetricColumn> {
    let column = |area: AreaChoice| {
        let metrics = metrics.iter().filter(move |metric| metric.has_area(area));
        metrics.filter_map(move |metric| {
            let name = metric.summary_column()?;
            Some(MetricColumn {
                metric,
                area,
                name: if area == AreaChoice::default() {
                    name.to_owned()
                } else {
                    format!("{}_{name}", area.name())
                },
            })
        })
    };
    areas.iter().copied().flat_map(column).collect()
}

impl MetricColumn {
    fn value(&self, metrics: &impl MetricSource) -> Option<f64> {
        metrics.get_in(self.metric.name, self.area)
    }

    fn description(&'static self) -> ColumnDescription {
        let other = Some(self.area).filter(|area| *area != AreaChoice::default());
        let headline = metric_column(self.metric);
        let words = capitalized(self.metric.words);
        let about = match other {
            None => headline.about,
            Some(AreaChoice::All) => format!("{words}, of all areas."),
            Some(area) => format!("{words}, of the area {}.", area.name()),
        };
        ColumnDescription {
            name: &self.name,
            area: other,
            about,
            ..headline
        }
    }
}

/// The metrics of all frames of an algorithm: their columns, and what they rest on.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MetricTotals {
    /// The columns; absent where the metric is not measured.
    values: MetricValues,
    measured: BTreeMap<(&'static str, AreaChoice), Measured>,
}

impl std::ops::Deref for MetricTotals {
    type Target = MetricValues;

    fn deref(&self) -> &MetricValues {
        &self.values
    }
}

impl MetricTotals {
    /// The totals of the columns of rows with these metrics, added in their order, with the area
    /// that these select, and with these times.
    pub(crate) fn new(rows: &[impl MetricSource], mut times_us: Vec<u64>) -> Self {
        let mut values = MetricValues::default();
        for column in &*METRICS_IN_ROWS {
            let MetricOrigin::Frame { total, .. } = column.metric.origin else {
                continue;
            };
            let own = rows.iter().filter_map(|row| column.value(row));
            let (sum, count) = own.fold((0.0, 0), |(sum, count), value| (sum + value, count + 1));
            let value = match total {
                MetricTotal::Mean => sum / f64::from(count),
                MetricTotal::Sum | MetricTotal::Share => sum,
            };
            let value = (count > 0).then_some(value);
            values.set_in(column.metric.name, column.area, value);
        }
        values.add_up();
        let area = rows.first().map(MetricSource::area);
        values.select(area.unwrap_or_default());
        let mut totals = Self {
            values: values.clone(),
            measured: BTreeMap::new(),
        };
        for metric in METRICS.iter().filter(|metric| metric.column().is_some()) {
            for area in metric.areas() {
                let Some(value) = values.value_in(metric, area) else {
                    totals.values.set_in(metric.name, area, None);
                    continue;
                };
                let values_of_rows = rows.iter().filter_map(|row| row.get_in(metric.name, area));
                let cases = Cases {
                    items: values_of_rows.count() as u64,
                    cells: values.whole_in(metric, area).map(|cells| cells as u64),
                    possible: None,
                };
                totals.set(metric, area, Measured { value, cases });
            }
        }
        times_us.sort_unstable();
        if let Some((time, us)) = Metric::find("time").zip(nearest_rank(&times_us, 0.5)) {
            let (value, cases) = (us as f64 / 1000.0, Cases::items(times_us.len() as u64));
            totals.set(time, AreaChoice::default(), Measured { value, cases });
        }
        totals
    }

    /// Sets the value of a metric, and of its column unless it has too few cases.
    pub(crate) fn set(&mut self, metric: &'static Metric, area: AreaChoice, own: Measured) {
        let is_share = matches!(metric.column(), Some((_, MetricTotal::Share)));
        match metric.value_of(own) {
            // The column of a share is its numerator.
            Some(_) if is_share => {}
            value => self.values.set_in(metric.name, area, value),
        }
        self.measured.insert((metric.name, area), own);
    }

    fn add_keys(&self, keys: &mut MetricKeys) {
        for metric in METRICS {
            for area in metric.areas() {
                let Some(own) = self.measured(metric, area) else {
                    continue;
                };
                let value = metric.value_of(own);
                keys.values
                    .extend(value.map(|value| (metric.name, area, value)));
                if area == AreaChoice::default() {
                    keys.cases.insert(metric.name, own.cases);
                }
            }
        }
    }

    /// The value of a metric in an area with its cases, however few; that of a metric of no area in
    /// all of them.
    pub fn measured(&self, metric: &Metric, area: AreaChoice) -> Option<Measured> {
        let area = if metric.by_area {
            area
        } else {
            AreaChoice::default()
        };
        self.measured.get(&(metric.name, area)).copied()
    }
}

/// Fields of several columns: those of metrics.
macro_rules! metric_fields {
    ($($kind:ty: $columns:ident, |$field:ident| $metrics:expr, $parsed:expr, $keys:expr;)*) => {$(
        impl RowField for $kind {
            const KIND: &'static str = "number?";

            fn columns(_: &'static str, _: &str, columns: &mut Vec<ColumnDescription>) {
                columns.extend($columns.iter().map(MetricColumn::description));
            }

            fn values<'a>(&'a self, values: &mut Vec<ColumnValue<'a>>) {
                let $field = self;
                values.extend(metric_values(&$columns, $metrics));
            }

            fn parse(_: &str, cells: CsvCells<'_>) -> Result<Self, RowError> {
                parse_metrics(&$columns, cells).map($parsed)
            }

            fn stored(_: &'static str, fields: &[&Self]) -> Vec<Column> {
                let metrics = fields.iter().copied().map(|$field| $metrics);
                let metrics: Vec<&MetricValues> = metrics.collect();
                stored_metrics(&$columns, &metrics)
            }

            fn add_keys(&self, keys: &mut MetricKeys) {
                let add: fn(&Self, &mut MetricKeys) = $keys;
                add(self, keys);
            }
        }
    )*};
}

metric_fields! {
    MetricValues: METRICS_IN_ROWS, |metrics| metrics, |metrics| metrics, |_, _| {};
    MetricTotals: METRICS_IN_SUMMARIES, |totals| &totals.values, |values| Self {
        values,
        measured: BTreeMap::new(),
    }, Self::add_keys;
}

/// A value per column, whole where the metric counts.
fn metric_values<'a>(
    columns: &'static [MetricColumn],
    metrics: &'a MetricValues,
) -> impl Iterator<Item = ColumnValue<'a>> {
    let values = columns.iter().map(|own| (own.value(metrics), own.metric));
    values.map(|(value, metric)| {
        if metric.counts() {
            ColumnValue::Whole(value.map(|n| n as u64))
        } else {
            ColumnValue::Real(value)
        }
    })
}

fn parse_metrics(columns: &[MetricColumn], cells: CsvCells<'_>) -> Result<MetricValues, RowError> {
    let mut metrics = MetricValues::default();
    for column in columns {
        let value = RowField::parse(&column.name, cells)?;
        metrics.set_in(column.metric.name, column.area, value);
    }
    metrics.add_up();
    Ok(metrics)
}

fn stored_metrics(columns: &'static [MetricColumn], fields: &[&MetricValues]) -> Vec<Column> {
    let column = |column: &'static MetricColumn| {
        let values = fields.iter().map(|field| column.value(*field));
        let name = column.name.as_str().into();
        if column.metric.counts() {
            let counts = values.map(|v| v.map(|n| n as i64));
            Column::new(name, counts.collect::<Vec<_>>())
        } else {
            Column::new(name, values.collect::<Vec<_>>())
        }
    };
    columns.iter().map(column).collect()
}

/// The column of a metric of frames.
fn metric_column(metric: &Metric) -> ColumnDescription {
    let name = metric.summary_column().expect("a metric with a column");
    let kind = ["number?", "integer?"][usize::from(metric.counts())];
    let total = match metric.column() {
        None => "Of the cells of all pairs.",
        Some((_, MetricTotal::Mean)) if metric.unit == MetricUnit::Share => {
            "A fraction; totals are means over pairs."
        }
        Some((_, MetricTotal::Mean)) => "Totals are means over pairs.",
        Some((_, MetricTotal::Sum | MetricTotal::Share)) => "Totals are sums over pairs.",
    };
    let note = metric.note.map(|note| note.text(CellRule::default()));
    let meaning = note.map(|(term, words)| format!("{}: {words}.", capitalized(term)));
    // The column of a share is its numerator.
    let words = if metric.counts() {
        format!("Number of {}.", metric.words)
    } else {
        format!("{}.", capitalized(metric.words))
    };
    let parts = [Some(words), meaning, Some(total.to_owned())];
    let unit = match metric.unit {
        MetricUnit::Px => Some("px"),
        MetricUnit::M => Some("m"),
        _ => None,
    };
    ColumnDescription {
        name,
        kind,
        unit,
        heading: None,
        area: None,
        about: parts.into_iter().flatten().collect::<Vec<_>>().join(" "),
    }
}

fn capitalized(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().map(|first| first.to_uppercase().to_string());
    first.unwrap_or_default() + letters.as_str()
}
