//! The pairs before each pair, on which the results of an algorithm with a history depend.

use super::Comparison;
use crate::rows::Row;
use crate::samples::{is_scene, run_key};
use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hash, Hasher};
use svl_core::joined;
use svl_score::scenario::PairRange;

/// The number of common pairs before which the two runs have different pairs.
pub(super) fn other_past<K: Ord>(ours: &BTreeMap<K, &Row>, theirs: &BTreeMap<K, &Row>) -> usize {
    let theirs = pasts(theirs);
    let own = pasts(ours);
    let differs = |(key, (pair, past)): &(&&K, &(&str, u64))| {
        let other = theirs.get(*key);
        other.is_some_and(|(other, other_past)| other == pair && other_past != past)
    };
    own.iter().filter(differs).count()
}

/// Per pair its hash, and that of all earlier pairs of its run.
fn pasts<'a, K: Ord>(rows: &'a BTreeMap<K, &Row>) -> BTreeMap<&'a K, (&'a str, u64)> {
    let (mut run, mut past) = (None, DefaultHasher::new());
    let pasts = rows.iter().map(|(key, row)| {
        // Scenes of a data set are independent of each other.
        if run.replace(run_key(row)) != Some(run_key(row)) || is_scene(row) {
            past = DefaultHasher::new();
        }
        let before = past.finish();
        row.pair_hash.hash(&mut past);
        (key, (row.pair_hash.as_str(), before))
    });
    pasts.collect()
}

/// The options by which two runs selected different pairs, with both values.
pub(super) fn selections(base: &PairRange, other: &PairRange) -> Vec<String> {
    let shown = |value: Option<f64>, default: &str| {
        value.map_or_else(|| default.to_owned(), |value| value.to_string())
    };
    let every = |range: &PairRange| range.every.unwrap_or(1).to_string();
    let options = [
        ("--every", [base, other].map(every)),
        (
            "--from",
            [base, other].map(|range| shown(range.from_s, "0")),
        ),
        (
            "--to",
            [base, other].map(|range| shown(range.to_s, "the end")),
        ),
    ];
    let differing = options.iter().filter(|(_, [base, other])| base != other);
    let words = differing.map(|(option, [base, other])| format!("{option} {base} and {other}"));
    words.collect()
}

impl Comparison {
    /// The algorithms that differ as their runs had different pairs before each pair, in words.
    pub(super) fn past_words(&self) -> Option<String> {
        let with_past = self.algorithms.iter().filter(|own| own.other_past > 0);
        let labels: Vec<_> = with_past.map(|own| own.labels()).collect();
        let options = match &self.selections[..] {
            [] => String::new(),
            options => format!(" ({})", options.join(", ")),
        };
        let has = match &labels[..] {
            [] => return None,
            [one] => format!("{one}, which has a history, differs"),
            several => format!("{}, which have a history, differ", joined(several)),
        };
        Some(format!(
            "the pairs before each pair differ{options}, so {has} for that reason, too"
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn selections_are_named_as_options() {
        let range = |every, from_s| PairRange {
            every,
            from_s,
            to_s: None,
        };
        let words = selections(&range(None, None), &range(Some(5), Some(2.5)));
        assert_eq!(words, ["--every 1 and 5", "--from 0 and 2.5"]);
        assert!(selections(&range(None, None), &range(Some(1), Some(0.0))).is_empty());
    }
}
