//! `svl replay --verify`: comparison of a replay with the results of an earlier run.

use anyhow::{Context, bail};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use svl::filter::without_filters;
use svl::manifest::Manifest;
use svl::matcher::Algorithm;
use svl::recording::{AlgorithmCells, MANIFEST, Recording};
use svl::report::Row;

/// The results of an earlier run.
pub(super) struct Earlier {
    path: PathBuf,
    /// Labels in the order of the run.
    labels: Vec<String>,
    /// Hashes of each result and of its pair, by label and number of the pair.
    hashes: BTreeMap<(String, u64), (String, String)>,
    /// Likewise the cells, if a recording has them.
    cells: BTreeMap<(String, u64), AlgorithmCells>,
    /// Hash of each algorithm's parameters, by label.
    parameters: BTreeMap<String, String>,
}

/// Comparison of a replay with the earlier run.
#[derive(Serialize)]
pub(super) struct Verification {
    against: PathBuf,
    /// Results that are equal.
    equal: usize,
    /// Algorithms whose results are not, each with the pairs' numbers.
    differing: BTreeMap<String, Vec<u64>>,
    /// Results of the replay without an earlier one, and earlier ones of the same algorithms
    /// without one of the replay.
    only_now: usize,
    only_then: usize,
}

impl Earlier {
    /// Reads the results in a result recording, a table of rows (CSV) or the folder of a report; of
    /// a report only the run with that seed, or of the recording `name`. `replayed` is the
    /// recording that is replayed, which is not opened again.
    pub(super) fn read(
        path: &Path,
        name: &str,
        replayed: Option<&Recording>,
        seed: Option<u64>,
    ) -> anyhow::Result<Self> {
        let mut earlier = Self {
            path: path.to_owned(),
            labels: Vec::new(),
            hashes: BTreeMap::new(),
            cells: BTreeMap::new(),
            parameters: BTreeMap::new(),
        };
        match path.extension().and_then(|e| e.to_str()) {
            _ if path.is_dir() => earlier.read_rows(&path.join("rows.csv"), name, seed)?,
            Some("csv") => earlier.read_rows(path, name, seed)?,
            Some("mcap") => match replayed.filter(|replayed| replayed.path() == path) {
                Some(replayed) => earlier.read_recording(replayed)?,
                None => earlier.read_recording(&Recording::open(path)?)?,
            },
            _ => bail!(
                "{}: expected RESULT.mcap, ROWS.csv or the folder of a report",
                path.display()
            ),
        }
        if earlier.hashes.is_empty() {
            let cure = "`svl replay -o RESULT.mcap`, `svl replay --rows ROWS.csv` and `svl score` \
                        write some";
            bail!(
                "{}: holds no results of that recording to compare with; {cure}",
                path.display()
            );
        }
        Ok(earlier)
    }

    fn read_rows(&mut self, path: &Path, name: &str, seed: Option<u64>) -> anyhow::Result<()> {
        let is_of = |row: &Row| match &row.run {
            Some(run) => Path::new(name).ends_with(run),
            None => row.seed.is_none() || row.seed == seed,
        };
        for row in svl::report::read_rows::<Row>(path)?
            .into_iter()
            .filter(is_of)
        {
            self.add(
                row.algorithm.clone(),
                row.sequence,
                (row.result_hash, row.pair_hash),
            );
            self.parameters.insert(row.algorithm, row.parameters_hash);
        }
        Ok(())
    }

    fn read_recording(&mut self, recording: &Recording) -> anyhow::Result<()> {
        for result in recording.results()? {
            self.add(
                result.algorithm,
                result.sequence,
                (result.hash, result.pair_hash),
            );
        }
        for cells in recording.cells()? {
            self.cells
                .insert((cells.algorithm.clone(), cells.sequence), cells);
        }
        if let Some(json) = recording.attachment(MANIFEST)? {
            let manifest: Manifest = serde_json::from_slice(&json)
                .with_context(|| format!("{}: {MANIFEST}", self.path.display()))?;
            self.parameters.extend(
                manifest
                    .algorithms
                    .into_iter()
                    .map(|a| (a.label, a.parameters_hash)),
            );
        }
        Ok(())
    }

    fn add(&mut self, label: String, sequence: u64, hashes: (String, String)) {
        if !self.labels.contains(&label) {
            self.labels.push(label.clone());
        }
        self.hashes.insert((label, sequence), hashes);
    }

    pub(super) fn has_cells(&self) -> bool {
        !self.cells.is_empty()
    }

    /// The algorithms of the earlier run.
    pub(super) fn algorithms(&self) -> anyhow::Result<Vec<Algorithm>> {
        let parse = |label: &String| {
            // The file is wrong, not the command line.
            let algorithm: Algorithm = label
                .parse()
                .map_err(|e: svl::Error| svl::Error::format(&self.path, e.to_string()))?;
            if algorithm.spec().name == "exec" {
                let shown = self.path.display();
                bail!(
                    "{shown}: names a program, which is not started unasked; name it yourself \
                     with --algo '{label}'"
                );
            }
            Ok(algorithm)
        };
        // Those behind filters come again with --filter.
        let mut labels: Vec<_> = self
            .labels
            .iter()
            .map(|l| without_filters(l).to_owned())
            .collect();
        labels.dedup();
        labels.iter().map(parse).collect()
    }

    /// Compares rows and cells of a replay of `algorithms`.
    pub(super) fn compare(
        &self,
        rows: &[Row],
        cells: &[AlgorithmCells],
        algorithms: &[Algorithm],
    ) -> anyhow::Result<Verification> {
        let mut found = Verification {
            against: self.path.clone(),
            equal: 0,
            differing: BTreeMap::new(),
            only_now: 0,
            only_then: 0,
        };
        // An algorithm that answers cells itself may differ in them alone.
        let keyed = cells
            .iter()
            .map(|of| ((of.algorithm.clone(), of.sequence), of));
        let cells: BTreeMap<_, _> = keyed.collect();
        let same_cells = |row: &Row| {
            let key = (row.algorithm.clone(), row.sequence);
            let both = self.cells.get(&key).zip(cells.get(&key));
            both.is_none_or(|(then, now)| then == *now)
        };
        for row in rows {
            if self
                .parameters
                .get(&row.algorithm)
                .is_some_and(|then| *then != row.parameters_hash)
            {
                let label = &row.algorithm;
                bail!(
                    "{label}: its parameters are not those of {}; name the algorithm with --algo \
                     as it did, or replay it again",
                    self.path.display()
                );
            }
            match self.hashes.get(&(row.algorithm.clone(), row.sequence)) {
                None => found.only_now += 1,
                Some((_, pair)) if *pair != row.pair_hash => {
                    bail!(
                        "{}: is of other pairs than these; pair {} differs",
                        self.path.display(),
                        row.sequence
                    );
                }
                Some((then, _)) if *then == row.result_hash && same_cells(row) => {
                    found.equal += 1;
                }
                Some(_) => found
                    .differing
                    .entry(row.algorithm.clone())
                    .or_default()
                    .push(row.sequence),
            }
        }
        // Earlier algorithms that this replay was not asked for are not missing.
        let ran = |label: &str| {
            algorithms
                .iter()
                .any(|algorithm| algorithm.label() == label)
        };
        let then = self.hashes.keys().filter(|(label, _)| ran(label)).count();
        let compared = found.equal + found.differing.values().map(Vec::len).sum::<usize>();
        found.only_then = then.saturating_sub(compared);
        Ok(found)
    }
}

impl Verification {
    /// The result, in a line.
    ///
    /// # Errors
    /// Results that are not proved: they differ, or the earlier run does not have them, or this one
    /// does not have.
    pub(super) fn proved(&self) -> anyhow::Result<String> {
        let against = self.against.display();
        if let Some((label, pairs)) = self.differing.first_key_value() {
            let more = match self.differing.len() {
                1 => String::new(),
                n => format!(" (and {} more algorithms)", n - 1),
            };
            bail!(
                "{label}{more}: {} results differ from those of {against}, the first on pair {}",
                pairs.len(),
                pairs[0]
            );
        }
        if self.only_now + self.only_then > 0 {
            let (now, then, equal) = (self.only_now, self.only_then, self.equal);
            bail!(
                "{now} results have no counterpart in {against}, {then} of its results none here; \
                 {equal} are equal"
            );
        }
        Ok(format!(
            "verified: {} results equal those of {against}\n",
            self.equal
        ))
    }
}
