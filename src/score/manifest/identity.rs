//! Identity of runs: the single place that decides which may be reused, merged, compared and
//! joined.
//!
//! Two runs are compared field by field of their manifests, descriptions included. The input of a
//! row has its own hash ([`svl_core::stereo::Frame::input_hash`]).

use super::{Manifest, hash};
use serde_json::Value;
use std::collections::BTreeSet;
use svl_core::matcher::ProgramRecord;
use svl_core::{Error, Result};

/// Purpose for which two runs are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Results of an earlier session are kept.
    Keep,
    /// The units of several folders become one report.
    Merge,
    /// Changes from one report to another are called better or worse.
    Compare,
    /// The same of drives.
    CompareDrives,
}

use Purpose::{Compare, CompareDrives, Keep, Merge};

const ALL: &[Purpose] = &[Keep, Merge, Compare, CompareDrives];
/// Other courses, or robots.
const OF_COURSES: &[Purpose] = &[Keep, Merge, CompareDrives];
/// Other pairs, or pairs scored differently; pairs are compared one by one.
const OF_PAIRS: &[Purpose] = &[Keep, Merge];
const OF_ONE_RUN: &[Purpose] = &[Merge];
/// No purpose: another field decides, or nothing depends on it.
const NONE: &[Purpose] = &[];

/// The fields of a manifest, and the purposes for which they have to be equal; the first entry that
/// matches a field or its table applies. A field that is not listed separates runs for every
/// purpose.
const FIELDS: &[(&str, &[Purpose])] = &[
    ("schema", ALL),
    ("run_id", NONE),
    ("began", NONE),
    ("warnings", NONE),
    ("sessions", NONE),
    ("pairs_hash", NONE),
    // Recorded per row, in its input hash.
    ("truth", NONE),
    // The digest of the sources decides.
    ("svl", NONE),
    ("git_revision", NONE),
    ("sources", &[Keep, Merge]),
    // Results are the same for any build; times are not.
    ("profile", OF_ONE_RUN),
    ("scenario", OF_ONE_RUN),
    // The description and `runs` decide.
    ("chain", NONE),
    ("bits", OF_PAIRS),
    ("times", OF_ONE_RUN),
    ("shard", NONE),
    ("machine", NONE),
    // Each has an identity of its own.
    ("algorithms", OF_ONE_RUN),
    ("runs", OF_ONE_RUN),
    ("description.name", NONE),
    ("description.description", NONE),
    // By their parameters, in `algorithms`, which contain the weights of filters.
    ("description.algorithms", NONE),
    ("description.columns", NONE),
    ("description.ranges", OF_ONE_RUN),
    ("description.filter", NONE),
    // Limits are checked against the numbers afterwards; parts of a run have the same.
    ("description.gate", OF_ONE_RUN),
    ("description.grid", ALL),
    ("description.cells.judge", ALL),
    ("description.cells.tolerance_m", ALL),
    ("description.cells.tolerance_percent", ALL),
    ("description.cells.obstacle_m", ALL),
    ("description.cells.clear_m", ALL),
    ("description.cells.beyond_m", ALL),
    ("description.cells.tolerance_px", ALL),
    // Only numbers of the report depend on it.
    ("description.cells.latency_ms", OF_ONE_RUN),
    ("description.robot", OF_ONE_RUN),
    ("description.checkpoint", ALL),
    ("description.arena", OF_COURSES),
    ("description.drive", OF_COURSES),
    // Each run has its own.
    ("description.stress", OF_ONE_RUN),
    ("description.source.kind", OF_PAIRS),
    // Recordings and calibrations are in `runs`, regardless of their path on this machine.
    ("description.source.files", NONE),
    ("description.source.calib", NONE),
    ("description.source.data", NONE),
    ("description.source.scenes", OF_PAIRS),
    ("description.source.seeds", OF_ONE_RUN),
    ("description.source.left", OF_PAIRS),
    ("description.source.right", OF_PAIRS),
    ("description.source.left_info", OF_PAIRS),
    ("description.source.right_info", OF_PAIRS),
    ("description.source.side_by_side", OF_PAIRS),
    ("description.source.fps", OF_PAIRS),
    ("description.source.bits", OF_PAIRS),
    ("description.source.max_skew_ms", OF_PAIRS),
    ("description.source.stamps", OF_PAIRS),
    ("description.source.right_offset_ms", OF_PAIRS),
    ("description.source.truth", OF_PAIRS),
    ("description.source.truth_skew_ms", OF_PAIRS),
    // The truth as used is in the input hashes of rows.
    ("description.source.camera_height_m", OF_PAIRS),
    ("description.source.alpha", OF_PAIRS),
    ("description.source.crop", OF_PAIRS),
    ("description.source.scale", OF_PAIRS),
    ("description.source.every", OF_PAIRS),
    ("description.source.from_s", OF_PAIRS),
    ("description.source.to_s", OF_PAIRS),
    // Like limits.
    ("description.source.allow_loss", NONE),
];

impl Manifest {
    /// Differences that separate two runs for a purpose: each field that differs, with both values,
    /// in words such as `source.max_skew_ms: 5 and 20`. If empty, they may be combined.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a manifest that cannot be serialized.
    #[inline]
    pub fn differences(&self, other: &Self, purpose: Purpose) -> Result<Vec<String>> {
        let (ours, theirs) = (self.identity()?, other.identity()?);
        let mut differing = Vec::new();
        let mut keep = |path: &str, ours: Option<&Value>, theirs: Option<&Value>| {
            if ours != theirs && has_to_be_equal(path, purpose) {
                let name = path.strip_prefix("description.").unwrap_or(path);
                describe(name, ours, theirs, &mut differing);
            }
        };
        each_field(Some(&ours), Some(&theirs), "", &mut keep);
        if purpose == Merge {
            let both = self.algorithms.iter().zip(&other.algorithms);
            differing.extend(both.filter_map(|(ours, theirs)| {
                let [own, other] = [&ours.program, &theirs.program].map(Option::as_ref);
                let [own, other] = [own?, other?].map(ProgramRecord::identity);
                (own != other).then(|| format!("{}: {own} and {other}", ours.label))
            }));
        }
        Ok(differing)
    }

    /// Hash of all fields that have to be equal for a purpose.
    ///
    /// # Errors
    /// The errors of [`Self::differences`].
    #[inline]
    pub fn identity_hash(&self, purpose: Purpose) -> Result<String> {
        let (identity, mut fields) = (self.identity()?, Vec::new());
        let mut add = |path: &str, value: Option<&Value>, _: Option<&Value>| {
            let value = value.filter(|_| has_to_be_equal(path, purpose));
            fields.extend(value.map(|value| format!("{path}: {value}")));
        };
        each_field(Some(&identity), None, "", &mut add);
        Ok(hash(&fields.join("\n")))
    }

    /// The manifest without entries that only describe this machine or the end of the run.
    #[inline]
    fn identity(&self) -> Result<Value> {
        let mut manifest = self.clone();
        for algorithm in &mut manifest.algorithms {
            algorithm.results_hash = None;
            algorithm.has_run_memory = false;
            algorithm.memory_bytes = None;
            (algorithm.failed_pairs, algorithm.failure) = (0, None);
            algorithm.program = None;
            // The label contains the parameters as the user wrote them; their hash covers all of
            // them.
            algorithm.parameters.clear();
            algorithm.filters.clear();
            algorithm.values.clear();
        }
        for run in &mut manifest.runs {
            run.pairs_hash = None;
            run.path.clear();
        }
        // `None` if the profile is not slow.
        manifest.profile = svl_files::slow_profile(manifest.profile.as_deref());
        serde_json::to_value(manifest).map_err(|e| Error::Invalid(format!("manifest: {e}")))
    }
}

/// Receives a field's path and its two values.
type OnField<'a> = &'a mut dyn FnMut(&str, Option<&Value>, Option<&Value>);

/// Calls `field` with each pair of values: tables are traversed down to the fields of [`FIELDS`].
fn each_field(ours: Option<&Value>, theirs: Option<&Value>, path: &str, field: OnField<'_>) {
    let tables = [ours, theirs].map(|value| value.and_then(Value::as_object));
    if tables == [None, None] || !path.is_empty() && FIELDS.iter().any(|(name, _)| *name == path) {
        return field(path, ours, theirs);
    }
    let keys = tables.iter().flatten().flat_map(|table| table.keys());
    for key in keys.collect::<BTreeSet<_>>() {
        let inner = match path {
            "" => key.clone(),
            path => format!("{path}.{key}"),
        };
        let [ours, theirs] = tables.map(|table| table.and_then(|table| table.get(key)));
        each_field(ours, theirs, &inner, field);
    }
}

fn has_to_be_equal(path: &str, purpose: Purpose) -> bool {
    let field = FIELDS.iter().find(|(name, _)| *name == path);
    field.is_none_or(|(_, purposes)| purposes.contains(&purpose))
}

/// Adds a line for each difference between two values of a field.
fn describe(name: &str, ours: Option<&Value>, theirs: Option<&Value>, lines: &mut Vec<String>) {
    if let (Some(Value::Object(own)), Some(Value::Object(other))) = (ours, theirs) {
        let others = other.keys().filter(|key| !own.contains_key(*key));
        for key in own.keys().chain(others) {
            let (ours, theirs) = (own.get(key), other.get(key));
            if ours != theirs {
                describe(&format!("{name}.{key}"), ours, theirs, lines);
            }
        }
        return;
    }
    if let (Some(Value::Array(own)), Some(Value::Array(other))) = (ours, theirs)
        && own.len() == other.len()
        && own.iter().chain(other).all(Value::is_object)
    {
        for (i, (ours, theirs)) in own.iter().zip(other).enumerate() {
            if ours != theirs {
                let entry = self::name(ours).filter(|own| self::name(theirs).as_ref() == Some(own));
                let entry = entry.unwrap_or_else(|| i.to_string());
                describe(&format!("{name}.{entry}"), Some(ours), Some(theirs), lines);
            }
        }
        return;
    }
    let (ours, theirs) = (words(ours), words(theirs));
    // The part that differs is shown in both, however long they are.
    let common = ours.chars().zip(theirs.chars());
    let common = common.take_while(|(own, other)| own == other).count();
    let [ours, theirs] = [ours, theirs].map(|text| shown(&text, common));
    lines.push(format!("{name}: {ours} and {theirs}"));
}

/// The longest value shown in full, in characters.
const WHOLE: usize = 60;

/// A text; if long, the part around the position `differs`.
fn shown(text: &str, differs: usize) -> String {
    let length = text.chars().count();
    if length <= WHOLE {
        return text.to_owned();
    }
    let from = differs.saturating_sub(WHOLE / 2).min(length - WHOLE / 2);
    let part: String = text.chars().skip(from).take(WHOLE).collect();
    let before = if from > 0 { "…" } else { "" };
    let behind = if from + WHOLE < length { "…" } else { "" };
    format!("{before}{part}{behind}")
}

/// Name of a table of a manifest.
fn name(value: &Value) -> Option<String> {
    let named = ["label", "name", "kind"].map(|key| value.get(key).and_then(Value::as_str));
    named.into_iter().flatten().next().map(str::to_owned)
}

/// A value in a sentence: for tables, their names.
fn words(value: Option<&Value>) -> String {
    let names = |value: &Value| {
        let names = value.as_array()?.iter().map(name);
        names.collect::<Option<Vec<_>>>()
    };
    let named = value.and_then(|value| name(value).or_else(|| Some(names(value)?.join(", "))));
    match named.unwrap_or_else(|| text(value)) {
        text if text.is_empty() => "nothing".to_owned(),
        text => text,
    }
}

fn text(value: Option<&Value>) -> String {
    match value {
        None | Some(Value::Null) => "not set".to_owned(),
        Some(Value::String(text)) => text.clone(),
        Some(value) => value.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::Scenario;
    use std::path::Path;

    /// A manifest whose description sets every key.
    fn whole(kind: &str) -> Manifest {
        let source = match kind {
            "arena" => "seeds = \"1\"",
            "drive" => "seeds = \"1\"",
            "dataset" => "scenes = [\"a\"]\ndata = \"d\"",
            _ => {
                "files = [\"a.mcap\"]\nleft = \"l\"\nright = \"r\"\nleft_info = \"i\"\n\
                 right_info = \"j\"\nside_by_side = \"left-right\"\nfps = 1.0\nbits = 8\n\
                 max_skew_ms = 1.0\nstamps = \"us\"\nright_offset_ms = 1.0\ntruth = \"t\"\n\
                 truth_skew_ms = 1.0\ncamera_height_m = 1.0\ncalib = \"c\"\n\
                 alpha = 0.5\ncrop = [0, 0, 9, 9]\nscale = 0.5"
            }
        };
        let of_pairs = match kind {
            "drive" => "allow_loss = 3\n",
            _ => "every = 2\nfrom_s = 1.0\nto_s = 9.0\nallow_loss = \"1%\"\n",
        };
        let checkpoint = match kind {
            "drive" => "",
            _ => "[[checkpoint]]\nnumber = 1\nname = \"a\"\nframes = [0, 1]\nmust = [[0, 0]]\n",
        };
        let text = format!(
            "name = \"s\"\ndescription = \"d\"\nalgorithms = [\"v3\"]\n[source]\n\
             kind = \"{kind}\"\n{source}\n{of_pairs}{checkpoint}[[filter]]\n\
             detects = \"floor\"\nfile = \"f\"\n\
             [[stress]]\nkind = \"gain\"\n[[gate]]\nalgorithm = \"v3\"\nmetric = \"wrong\"\n\
             max = 0.1\n"
        );
        let scenario = Scenario::parse(&text, Path::new("s.toml")).unwrap();
        let mut manifest = Manifest::new("s", &scenario.algorithms).unwrap();
        manifest.description = Some(scenario.to_json().unwrap());
        manifest.bits = Some(12);
        manifest.times = Some("alone".into());
        manifest.shard = Some("1/2".into());
        manifest.profile = Some("work".into());
        manifest
    }

    #[test]
    fn every_field_has_an_entry() {
        for kind in ["arena", "drive", "dataset", "recording"] {
            let manifest = serde_json::to_value(whole(kind)).unwrap();
            let mut seen = Vec::new();
            each_field(Some(&manifest), None, "", &mut |path, _, _| {
                seen.push(path.to_owned())
            });
            for path in seen {
                let is_there = FIELDS.iter().any(|(name, _)| *name == path);
                assert!(is_there, "{path}: say in FIELDS what it keeps apart");
            }
        }
    }

    #[test]
    fn each_field_in_turn_keeps_apart_what_it_should() {
        let changed = |value: &Value| match value {
            Value::Number(_) => Value::from(7),
            Value::Bool(is) => Value::from(!is),
            Value::Array(values) if !values.is_empty() => Value::Array(Vec::new()),
            _ => Value::from("other"),
        };
        for kind in ["arena", "drive", "dataset", "recording"] {
            let manifest = whole(kind);
            assert!(manifest.differences(&manifest, Merge).unwrap().is_empty());
            let description = manifest.description.clone().unwrap();
            let mut paths = Vec::new();
            each_field(
                Some(&description),
                None,
                "description",
                &mut |path, value, _| {
                    paths.push((path.to_owned(), value.cloned()));
                },
            );
            for (path, value) in paths {
                let mut other = manifest.clone();
                let key = path.strip_prefix("description.").unwrap();
                let pointer = format!("/{}", key.replace('.', "/"));
                let description = other.description.as_mut().unwrap();
                *description.pointer_mut(&pointer).unwrap() = changed(&value.unwrap());
                for purpose in ALL {
                    let field = FIELDS.iter().find(|(name, _)| *name == path);
                    let differences = manifest.differences(&other, *purpose).unwrap();
                    let apart = field.unwrap().1.contains(purpose);
                    assert_eq!(!differences.is_empty(), apart, "{path}, {purpose:?}");
                    let hashes = [&manifest, &other]
                        .map(|manifest| manifest.identity_hash(*purpose).unwrap());
                    assert_eq!(hashes[0] != hashes[1], apart, "{path}, {purpose:?}");
                }
            }
        }
    }

    #[test]
    fn a_difference_is_seen_in_long_values_and_in_entries_of_one_name() {
        let mut manifest = whole("recording");
        let text = "0123456789".repeat(30);
        manifest.scenario = text.clone() + "a" + &text;
        let mut other = manifest.clone();
        other.scenario = text.clone() + "b" + &text;
        other.algorithms[0].parameters_hash = "another".into();
        let hash = &manifest.algorithms[0].parameters_hash;
        let differences = manifest.differences(&other, Merge).unwrap();
        assert_eq!(
            differences[0],
            format!("algorithms.v3.parameters_hash: {hash} and another")
        );
        assert_eq!(
            differences[1],
            "scenario: …012345678901234567890123456789a01234567890123456789012345678… \
             and …012345678901234567890123456789b01234567890123456789012345678…"
        );
        // The end of one is where they differ.
        other.scenario = manifest.scenario.clone() + "c";
        let differences = manifest.differences(&other, Merge).unwrap();
        assert!(differences[1].ends_with("c"), "{differences:?}");
    }

    #[test]
    fn parts_of_another_program_are_kept_apart() {
        let mut manifest = whole("recording");
        let program = |version: &str| ProgramRecord {
            name: Some("net".into()),
            version: Some(version.into()),
            ..ProgramRecord::default()
        };
        manifest.algorithms[0].program = Some(program("1"));
        let mut other = manifest.clone();
        other.algorithms[0].program.as_mut().unwrap().reported_us = 7;
        assert!(manifest.differences(&other, Merge).unwrap().is_empty());
        other.algorithms[0].program = Some(program("2"));
        assert_eq!(
            manifest.differences(&other, Merge).unwrap(),
            ["v3: net 1 and net 2"]
        );
        assert!(manifest.differences(&other, Compare).unwrap().is_empty());
        // A part in which it never ran has no information on it.
        other.algorithms[0].program = None;
        assert!(manifest.differences(&other, Merge).unwrap().is_empty());
    }

    #[test]
    fn a_field_that_nobody_knows_keeps_all_apart() {
        let manifest = whole("arena");
        let mut other = manifest.clone();
        other.description.as_mut().unwrap()["source"]["new"] = 1.into();
        for purpose in ALL {
            let differences = manifest.differences(&other, *purpose).unwrap();
            assert_eq!(differences, ["source.new: not set and 1"]);
        }
    }
}
