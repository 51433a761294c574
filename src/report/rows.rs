//! The rows of the tables: plain structs, filled by whoever scores a run.
//!
//! Shares are 0..=1, cells and sequences count from 0, distances are along the optical axis. A
//! number that needs truth is absent where there is none.

use crate::score::Verdict;
use polars::prelude::{DataFrame, PolarsResult};
use serde::{Serialize, de::DeserializeOwned};

/// A row that can also stand as the columns of a data frame.
pub trait Record: Serialize + DeserializeOwned {
    /// Names of the columns, in the order of the fields.
    const COLUMNS: &'static [&'static str];

    /// The rows as a data frame, typed also when there are none.
    ///
    /// # Errors
    /// What polars says.
    fn frame(rows: &[Self]) -> PolarsResult<DataFrame>;
}

/// Declares a row and its columns from one list of fields.
macro_rules! record {
    ($(#[$about:meta])* $name:ident { $($(#[$doc:meta])* $field:ident: $kind:ty,)* }) => {
        $(#[$about])*
        #[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
        pub struct $name { $($(#[$doc])* pub $field: $kind,)* }

        impl $crate::report::rows::Record for $name {
            const COLUMNS: &'static [&'static str] = &[$(stringify!($field),)*];

            fn frame(rows: &[Self]) -> polars::prelude::PolarsResult<polars::prelude::DataFrame> {
                use $crate::report::rows::Stored as _;
                polars::prelude::DataFrame::new(rows.len(), vec![$({
                    let values: Vec<_> = rows.iter().map(|row| row.$field.stored()).collect();
                    polars::prelude::Column::new(stringify!($field).into(), values)
                },)*])
            }
        }
    };
}
pub(super) use record;

record! {
    /// One pair through one algorithm.
    Row {
        run_id: String,
        scenario: String,
        sequence: u64,
        stamp_ns: u64,
        /// The scene's name, empty where frames have none.
        name: String,
        /// What the arena was drawn from.
        seed: Option<u64>,
        /// Hash of the pair's pixels, hexadecimal.
        pair_hash: String,
        /// As it was asked for, e.g. `v3:max_disparity=64`.
        algorithm: String,
        parameters_hash: String,
        width: u32,
        height: u32,
        /// How many disparities the algorithm tries for a pixel, where its parameters tell.
        disparities: Option<u32>,
        smoothing_us: u64,
        texture_us: u64,
        matching_us: u64,
        checks_us: u64,
        total_us: u64,
        /// Share of all pixels with a disparity.
        coverage: f64,
        /// Share of the estimated visible pixels that are off by more than 1 px.
        bad1: Option<f64>,
        /// As `bad1`, by more than 2 px.
        bad2: Option<f64>,
        /// Share of the visible pixels with truth that have no estimate.
        invalid: Option<f64>,
        cells_right: Option<u64>,
        cells_wrong: Option<u64>,
        cells_unknown: Option<u64>,
        missed_obstacles: Option<u64>,
        false_obstacles: Option<u64>,
        /// Hash of the disparity map, hexadecimal.
        result_hash: String,
    }
}

record! {
    /// One cell of the obstacle grid in one pair through one algorithm.
    CellRow {
        run_id: String,
        scenario: String,
        sequence: u64,
        /// What the arena was drawn from.
        seed: Option<u64>,
        algorithm: String,
        column: u32,
        row: u32,
        /// Share of the cell's pixels with a disparity.
        valid_share: f64,
        median_px: Option<f64>,
        p20_px: Option<f64>,
        p80_px: Option<f64>,
        distance_m: Option<f64>,
        /// Median true disparity.
        true_median_px: Option<f64>,
        true_distance_m: Option<f64>,
        verdict: Verdict,
        /// Truly nearer than 0.5 m, reported farther than 0.75 m.
        missed_obstacle: bool,
        /// Reported nearer than 0.5 m, truly farther than 0.75 m.
        false_obstacle: bool,
    }
}

record! {
    /// One checkpoint of one run through one algorithm.
    CheckpointRow {
        run_id: String,
        scenario: String,
        seed: Option<u64>,
        /// The checkpoint's number in the scenario.
        checkpoint: u32,
        name: String,
        algorithm: String,
        /// Frames that show the checkpoint.
        frames: u64,
        /// Frames of these in which it passes.
        passed: u64,
        /// `passed / frames`; absent when no frame shows it.
        share: Option<f64>,
        best_sequence: Option<u64>,
        best_passed: Option<bool>,
        worst_sequence: Option<u64>,
        worst_passed: Option<bool>,
    }
}

/// A field as polars stores it.
pub(super) trait Stored {
    type As;
    fn stored(&self) -> Self::As;
}

macro_rules! stored_as_itself {
    ($($kind:ty),*) => {
        $(impl Stored for $kind {
            type As = Self;
            fn stored(&self) -> Self {
                self.clone()
            }
        })*
    };
}

stored_as_itself!(
    String,
    u32,
    u64,
    f64,
    bool,
    Option<u32>,
    Option<u64>,
    Option<f64>,
    Option<bool>
);

impl Stored for Verdict {
    type As = &'static str;
    fn stored(&self) -> &'static str {
        self.name()
    }
}
