//! The pairs that all ranked algorithms answered: a table of them compares no losses.

use crate::rows::records::{FailureRow, Row};
use crate::rows::samples::{RunKey, run_key};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

/// Fraction of the pairs from which on an algorithm is ranked.
const MIN_ANSWERED: f64 = 0.5;
/// Fraction of the pairs from which on the common ones stand for all.
const MIN_COMMON: f64 = 0.8;

/// The numbers of pairs that the results are of.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RankedPairs {
    /// Number of unperturbed pairs that were read.
    pub read: u64,
    /// Number of those that all ranked algorithms answered.
    pub common: u64,
    /// Algorithms that lack pairs, with the number of those that they answered.
    pub partial: BTreeMap<String, u64>,
}

type PairPlace<'a> = (RunKey<'a>, u64);

fn id(row: &Row) -> PairPlace<'_> {
    (run_key(row), row.sequence)
}

impl RankedPairs {
    /// The numbers, and the common pairs where the results are of these and not of all.
    pub(super) fn new<'a>(
        rows: &'a [Row],
        failures: &'a [FailureRow],
    ) -> (Self, Option<BTreeSet<PairPlace<'a>>>) {
        let rows = rows.iter().filter(|row| row.stress.is_none());
        let mut answered: BTreeMap<&str, BTreeSet<PairPlace<'_>>> = BTreeMap::new();
        for row in rows {
            answered.entry(&row.algorithm).or_default().insert(id(row));
        }
        let mut read: BTreeSet<_> = answered.values().flatten().copied().collect();
        for row in failures.iter().filter(|row| row.stress.is_none()) {
            read.insert(((row.seed, row.run.as_deref()), row.sequence));
            answered.entry(&row.algorithm).or_default();
        }
        let is_ranked =
            |pairs: &&BTreeSet<_>| pairs.len() as f64 >= MIN_ANSWERED * read.len() as f64;
        let ranked = answered.values().filter(is_ranked).cloned();
        let common = ranked.reduce(|a, b| &a & &b).unwrap_or_default();
        let partial = answered
            .iter()
            .filter(|(_, pairs)| pairs.len() < read.len());
        let own = Self {
            read: read.len() as u64,
            common: common.len() as u64,
            partial: partial
                .map(|(label, pairs)| ((*label).to_owned(), pairs.len() as u64))
                .collect(),
        };
        let is_shown = own.is_shown() && common.len() < read.len();
        (own, is_shown.then_some(common))
    }

    /// True if the numbers are of the common pairs.
    pub(crate) fn is_shown(&self) -> bool {
        self.common as f64 >= MIN_COMMON * self.read as f64
    }

    /// True for an algorithm that is not ranked.
    pub(crate) fn is_absent(&self, label: &str) -> bool {
        let answered = self.partial.get(label);
        answered.is_some_and(|answered| (*answered as f64) < MIN_ANSWERED * self.read as f64)
    }
}

/// The rows of these pairs.
pub(super) fn only<'a>(rows: &'a [Row], pairs: Option<&BTreeSet<PairPlace<'_>>>) -> Vec<&'a Row> {
    let rows = rows.iter().filter(|row| row.stress.is_none());
    rows.filter(|row| pairs.is_none_or(|pairs| pairs.contains(&id(row))))
        .collect()
}
