//! The results per recording, of several.

use crate::rows::held::{RowRef, Rows};
use crate::rows::samples::{grouped, total};
use serde::Serialize;
use std::collections::BTreeMap;
use svl_score::judge::METRICS;

/// The results of an algorithm on a recording of several.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RecordingSummary {
    pub run: String,
    pub algorithm: String,
    pub pairs: u64,
    /// All metrics that are measured, by their names.
    #[serde(flatten)]
    pub metrics: BTreeMap<&'static str, f64>,
}

/// The results per recording, if there are several.
pub(crate) fn recordings(rows: &Rows) -> Vec<RecordingSummary> {
    let own = rows.iter();
    let own = own.filter(|row| row.stress().is_none() && row.run().is_some());
    let own: Vec<RowRef<'_>> = own.collect();
    let summary = |own: &[RowRef<'_>]| RecordingSummary {
        run: own[0].run().unwrap_or_default().to_owned(),
        algorithm: own[0].algorithm().to_owned(),
        pairs: own.len() as u64,
        metrics: (METRICS.iter())
            .filter_map(|metric| Some((metric.name, total(metric, own)?)))
            .collect(),
    };
    let all = grouped(&own, |row| (row.run(), row.algorithm()), summary);
    if all.windows(2).all(|two| two[0].run == two[1].run) {
        return Vec::new();
    }
    all
}
