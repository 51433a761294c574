//! What a report was made of: its units and its tables.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;
use svl_core::Result;
use svl_score::manifest::{hash_file, read_json};

/// The summary, written last.
pub(crate) const SUMMARY: &str = "summary.json";

/// The files of a report that a summary was made of.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Sources {
    /// Digest of the units.
    pub units: String,
    /// Hashes of the tables by their files.
    pub tables: BTreeMap<String, String>,
    /// Doubts of the ways that robots drove, which no table has.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub doubts: Vec<String>,
}

/// The part of `summary.json` that is read.
#[derive(Deserialize)]
struct SummaryFile {
    made_of: Sources,
}

impl Sources {
    /// The files of the report in a folder; none of an incomplete one.
    pub fn read(folder: &Path) -> Option<Self> {
        let summary: SummaryFile = read_json(&folder.join(SUMMARY)).ok()?;
        Some(summary.made_of)
    }

    /// The files of a folder whose tables are written, of the units with that digest. `names`:
    /// those of all tables.
    ///
    /// # Errors
    /// [`svl_core::Error::Io`].
    pub(crate) fn for_folder(folder: &Path, units: String, names: &[&str]) -> Result<Self> {
        let mut tables = BTreeMap::new();
        // A summary is not made of itself.
        let is_made_of = |name: &&&str| !["summary", "verdicts"].contains(name);
        for name in names.iter().filter(is_made_of) {
            let file = format!("{name}.csv");
            let path = folder.join(&file);
            if path.is_file() {
                tables.insert(file, hash_file(&path)?);
            }
        }
        Ok(Self {
            units,
            tables,
            doubts: Vec::new(),
        })
    }

    /// The first table that is not what the summary was made of; `has_cells`: false for all but
    /// that of the cells.
    pub fn changed(&self, folder: &Path, has_cells: bool) -> Option<&str> {
        let is_other = |(file, hash): &(&String, &String)| {
            !hash_file(&folder.join(file)).is_ok_and(|found| found == **hash)
        };
        let tables = self.tables.iter();
        let mut tables = tables.filter(|(file, _)| has_cells || *file != "cells.csv");
        tables.find(is_other).map(|(file, _)| file.as_str())
    }
}
