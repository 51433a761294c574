//! Which algorithms of two reports are compared with each other.

use crate::words::shell_word;
use svl_core::{Error, Result};
use svl_score::manifest::Manifest;

/// The algorithms of two reports.
pub(super) struct MatchedLabels<'a> {
    manifests: [&'a Manifest; 2],
    /// Labels in the first and in the second report.
    pub both: Vec<(&'a str, &'a str)>,
    pub only_in_base: Vec<String>,
    pub only_in_other: Vec<String>,
    /// Labels of both reports that in one of them are not compared, as `map` names the namesake.
    pub left_out: Vec<String>,
}

impl<'a> MatchedLabels<'a> {
    /// The algorithms that `map` names, as `BASE=OTHER`, then those of equal labels; without a map,
    /// where each report has just one, these two.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a map of algorithms that they do not have.
    pub fn new(base: &'a Manifest, other: &'a Manifest, map: &[String]) -> Result<Self> {
        let (ours, theirs): (Vec<_>, Vec<_>) = (base.labels().collect(), other.labels().collect());
        let mapped = map.iter().map(|text| pair(text, &ours, &theirs));
        let mut both = mapped.collect::<Result<Vec<_>>>()?;
        match (&ours[..], &theirs[..]) {
            // With one algorithm each, two different algorithms can be compared: v1 with v3.
            ([one], [another]) if both.is_empty() => both.push((one, another)),
            // Labels are compared as written, so `v3` and `v3:max_disparity=80` differ even where
            // their parameters are equal.
            _ => {
                let is_free = |label: &&&str| both.iter().all(|(a, b)| a != *label && b != *label);
                let equal = ours.iter().filter(|label| theirs.contains(label));
                let equal: Vec<_> = equal
                    .filter(is_free)
                    .map(|label| (*label, *label))
                    .collect();
                both.extend(equal);
            }
        }
        let is_taken = |label: &str| {
            both.iter().any(|(a, _)| *a == label) && both.iter().any(|(_, b)| *b == label)
        };
        let only = |labels: &[&str], others: &[&str], side: fn(&(&'a str, &'a str)) -> &'a str| {
            let is_left = |label: &&&str| {
                !others.contains(*label) && both.iter().all(|pair| side(pair) != **label)
            };
            labels
                .iter()
                .filter(is_left)
                .map(|label| (*label).to_owned())
                .collect()
        };
        let left_out = ours
            .iter()
            .filter(|label| theirs.contains(label) && !is_taken(label));
        Ok(Self {
            manifests: [base, other],
            only_in_base: only(&ours, &theirs, |pair| pair.0),
            only_in_other: only(&theirs, &ours, |pair| pair.1),
            left_out: left_out.map(|label| (*label).to_owned()).collect(),
            both,
        })
    }

    /// Algorithms that only one report has, but the other with other parameters, as `BASE=OTHER`:
    /// where each has just one such algorithm of a name.
    pub fn proposed_maps(&self) -> Vec<String> {
        let [ours, theirs] = [
            named(self.manifests[0], &self.only_in_base),
            named(self.manifests[1], &self.only_in_other),
        ];
        let proposed = ours.iter().filter_map(|(name, label)| {
            let is_one =
                |all: &[(&str, &str)]| all.iter().filter(|own| own.0 == *name).count() == 1;
            let (_, other) = theirs.iter().find(|own| own.0 == *name)?;
            (is_one(&ours) && is_one(&theirs)).then(|| format!("{label}={other}"))
        });
        proposed.collect()
    }

    /// Why nothing is compared.
    pub fn none_words(&self) -> String {
        let [ours, theirs] = self.manifests.map(|manifest| {
            let labels: Vec<_> = manifest.labels().collect();
            labels.join(", ")
        });
        let words = format!("no algorithm in common ({ours}; {theirs})");
        match map_options(&self.proposed_maps()) {
            options if options.is_empty() => words,
            options => format!("{words}; add `{options}` to compare other parameters"),
        }
    }
}

/// Names and labels of these algorithms.
fn named<'a>(manifest: &'a Manifest, labels: &[String]) -> Vec<(&'a str, &'a str)> {
    let own = manifest.algorithms.iter();
    let own = own.filter(|record| labels.contains(&record.label));
    own.map(|record| (record.name.as_str(), record.label.as_str()))
        .collect()
}

/// The options that map these, for a shell.
pub(super) fn map_options(maps: &[String]) -> String {
    let option = |map: &String| format!("--map {}", shell_word(map));
    maps.iter().map(option).collect::<Vec<_>>().join(" ")
}

/// The labels of `BASE=OTHER`, either of which may hold `=`.
fn pair<'a>(text: &str, ours: &[&'a str], theirs: &[&'a str]) -> Result<(&'a str, &'a str)> {
    let splits = text
        .match_indices('=')
        .map(|(i, _)| (&text[..i], &text[i + 1..]));
    let find = |labels: &[&'a str], label| labels.iter().find(|l| **l == label).copied();
    let mut found = splits.filter_map(|(a, b)| Some((find(ours, a)?, find(theirs, b)?)));
    found.next().ok_or_else(|| {
        let (ours, theirs) = (ours.join(", "), theirs.join(", "));
        Error::Invalid(format!(
            "--map {text}: expected BASE=OTHER, an algorithm of the first report ({ours}) and one \
             of the other ({theirs})"
        ))
    })
}
