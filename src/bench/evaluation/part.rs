//! A part of a report: the results of a shard, and what `svl merge` has to know about the whole.

use crate::outputs::write_json;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;
use std::str::FromStr;
use svl_core::Result;
use svl_core::stereo::CellRule;
use svl_data::manifest::{hash_file, read_json};
use svl_data::scenario::{Scenario, ScenarioSource};

/// The tables that grow with a run, and that are merged.
const TABLES: [&str; 6] = [
    "rows",
    "cells",
    "failures",
    "checkpoints",
    "drives",
    "tracks",
];

/// The file that a part has besides those of a report.
pub const PART: &str = "part.json";

/// A part of a report: its shard, and the whole that it belongs to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReportPart {
    pub shard: Shard,
    pub description: String,
    pub rule: CellRule,
    /// True if the runs are drives; the times of others are of matching alone.
    pub driven: bool,
    /// All runs of the whole, in their order.
    pub runs: Vec<ReportRun>,
    /// Its tables as CSV, each with the hash of its bytes; none before the part is complete.
    pub tables: BTreeMap<String, String>,
    /// The runs that it read with the digests of their pairs, geometry and truth, before any
    /// perturbation; likewise.
    #[serde(default)]
    pub inputs: Vec<(String, String)>,
}

impl ReportPart {
    /// Marks a report's folder as a part.
    pub fn write(
        folder: &Path,
        scenario: &Scenario,
        shard: Shard,
        runs: Vec<ReportRun>,
    ) -> Result<()> {
        let part = Self {
            shard,
            description: scenario.description.clone(),
            rule: scenario.cells,
            driven: matches!(scenario.source, ScenarioSource::Drive { .. }),
            runs,
            tables: BTreeMap::new(),
            inputs: Vec::new(),
        };
        write_json(&folder.join(PART), &part)
    }

    pub fn read(folder: &Path) -> Result<Self> {
        read_json(&folder.join(PART))
    }

    /// Records in a part's folder that its tables are complete, and the inputs that they were made
    /// of.
    pub fn complete(folder: &Path, inputs: Vec<(String, String)>) -> Result<()> {
        let mut part = Self::read(folder)?;
        part.inputs = inputs;
        for name in TABLES {
            let file = format!("{name}.csv");
            let path = folder.join(&file);
            if path.exists() {
                part.tables.insert(file, hash_file(&path)?);
            }
        }
        write_json(&folder.join(PART), &part)
    }

    /// The first of its tables that was changed after its completion.
    pub fn damaged(&self, folder: &Path) -> Option<&str> {
        let is_other = |(file, hash): &(&String, &String)| {
            !hash_file(&folder.join(file)).is_ok_and(|found| found == **hash)
        };
        let mut tables = self.tables.iter();
        tables.find(is_other).map(|(file, _)| file.as_str())
    }
}

/// The key of a run in the rows.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct ReportRun {
    pub run: Option<String>,
    pub seed: Option<u64>,
    pub stress: Option<String>,
}

impl ReportRun {
    /// The drives through a course.
    pub fn course(seed: u64, stress: Option<&str>) -> Self {
        Self {
            run: None,
            seed: Some(seed),
            stress: stress.map(str::to_owned),
        }
    }
}

/// One of several parts of a run, written `3/16`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Shard {
    /// From 1.
    pub number: usize,
    pub of: usize,
}

impl Shard {
    const MAX: usize = 10_000;

    /// True if the unit at that index is in this shard: units are dealt out in turn.
    pub fn takes(self, unit: usize) -> bool {
        unit % self.of == self.number - 1
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let numbers = text.split_once('/');
        let numbers = numbers.and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        match numbers {
            Some((number, of)) if (1..=Self::MAX).contains(&of) && (1..=of).contains(&number) => {
                Ok(Self { number, of })
            }
            _ => Err(format!(
                "expected I/N, I from 1 to N, as 3/16; N at most {}",
                Self::MAX
            )),
        }
    }
}

impl TryFrom<String> for Shard {
    type Error = String;

    fn try_from(text: String) -> std::result::Result<Self, String> {
        text.parse()
    }
}

impl From<Shard> for String {
    fn from(shard: Shard) -> Self {
        shard.to_string()
    }
}

impl std::fmt::Display for Shard {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}/{}", self.number, self.of)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_unit_is_in_one_share() {
        for of in [1, 3, 16] {
            for unit in 0..100 {
                let shards = (1..=of).map(|number| Shard { number, of });
                assert_eq!(shards.filter(|shard| shard.takes(unit)).count(), 1);
            }
        }
    }

    #[test]
    fn shards_are_written_from_one() {
        assert_eq!("3/16".parse(), Ok(Shard { number: 3, of: 16 }));
        for wrong in ["0/4", "5/4", "1/0", "1", "a/b", "1/99999", "-1/4"] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
    }
}
