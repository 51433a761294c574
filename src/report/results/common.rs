//! The pairs that all ranked algorithms answered: a table of them compares no losses.

use crate::rows::held::{RowRef, Rows, RunKey};
use crate::rows::records::FailureRow;
use serde::Serialize;
use std::collections::BTreeMap;

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

/// The pairs of rows, each once, in ascending order.
pub(super) type PairPlaces<'a> = Vec<(RunKey<'a>, u64)>;

fn id(row: RowRef<'_>) -> (RunKey<'_>, u64) {
    (row.origin().run_key(), row.sequence())
}

impl RankedPairs {
    /// The numbers, and the common pairs where the results are of these and not of all.
    pub(super) fn new<'a>(
        rows: &'a Rows,
        failures: &'a [FailureRow],
    ) -> (Self, Option<PairPlaces<'a>>) {
        let rows = || rows.iter().filter(|row| row.stress().is_none());
        let failures = || failures.iter().filter(|row| row.stress.is_none());
        let failed = |row: &'a FailureRow| ((row.seed, row.run.as_deref()), row.sequence);
        // The rows of a pair are neighbours.
        let mut read: PairPlaces<'a> = Vec::new();
        for pair in rows().map(id).chain(failures().map(failed)) {
            if read.last() != Some(&pair) {
                read.push(pair);
            }
        }
        read.sort_unstable();
        read.dedup();
        // Per algorithm the places of its pairs.
        let mut answered: BTreeMap<&str, Vec<bool>> = BTreeMap::new();
        for row in failures() {
            let none = || vec![false; read.len()];
            answered.entry(&row.algorithm).or_insert_with(none);
        }
        for row in rows() {
            let own = answered.entry(row.algorithm());
            let own = own.or_insert_with(|| vec![false; read.len()]);
            if let Ok(place) = read.binary_search(&id(row)) {
                own[place] = true;
            }
        }
        let count = |own: &[bool]| own.iter().filter(|is_there| **is_there).count();
        let ranked = answered.values();
        let ranked = ranked.filter(|own| count(own) as f64 >= MIN_ANSWERED * read.len() as f64);
        let ranked: Vec<_> = ranked.collect();
        let is_common = |place: &usize| ranked.iter().all(|own| own[*place]);
        let places = (0..read.len()).filter(|_| !ranked.is_empty());
        let common: PairPlaces<'a> = places.filter(is_common).map(|place| read[place]).collect();
        let counts = answered.iter().map(|(label, own)| (*label, count(own)));
        let partial = counts.filter(|(_, pairs)| *pairs < read.len());
        let own = Self {
            read: read.len() as u64,
            common: common.len() as u64,
            partial: partial
                .map(|(label, pairs)| (label.to_owned(), pairs as u64))
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

/// The unperturbed rows of these pairs, or of all.
pub(super) fn only<'a>(rows: &'a Rows, pairs: Option<&PairPlaces<'_>>) -> Vec<RowRef<'a>> {
    let rows = rows.iter().filter(|row| row.stress().is_none());
    rows.filter(|row| pairs.is_none_or(|pairs| pairs.binary_search(&id(*row)).is_ok()))
        .collect()
}
