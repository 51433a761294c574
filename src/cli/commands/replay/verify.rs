//! `svl replay --verify`: comparison of a replay with the results of an earlier run.

use crate::cli::shared::usage;
use anyhow::{Context, bail};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use svl::counted;
use svl::filter::without_filters;
use svl::manifest::Manifest;
use svl::matcher::Algorithm;
use svl::recording::{AlgorithmCells, MANIFEST, Recording};
use svl::report::{Row, RowRef, Rows, read_rows};
use svl::source::SourceKind;

/// The results of an earlier run.
#[derive(Default)]
pub(super) struct Earlier {
    path: PathBuf,
    /// Labels in the order of the run.
    labels: Vec<String>,
    /// Hashes of each result and of its pair, by label and number of the pair, or its stamp.
    hashes: BTreeMap<(String, u64), (String, String)>,
    /// The cells by the same keys, if a recording has them.
    cells: BTreeMap<(String, u64), AlgorithmCells>,
    /// Hash of each algorithm's parameters, by label.
    parameters: BTreeMap<String, String>,
    /// True for results of live topics: a pair is known by its stamp, which then takes the place of
    /// its number, as each program numbers the pairs from its own first one.
    by_stamp: bool,
}

/// Comparison of a replay with the earlier run.
#[derive(Default, Serialize)]
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
    /// The first of the differing algorithms that depends on earlier pairs.
    #[serde(skip)]
    with_memory: Option<String>,
    /// The pairs that both have, for live topics.
    #[serde(skip_serializing_if = "Option::is_none")]
    live: Option<CommonPairs>,
}

/// The pairs of two programs that received the same live topics.
#[derive(Serialize)]
struct CommonPairs {
    common: usize,
    /// Stamps in nanoseconds of the pairs that one of both has, while both were running.
    only_now: Vec<u64>,
    only_then: Vec<u64>,
    /// Pairs from before or after one of both was running.
    outside: usize,
}

/// Fraction of common pairs, of all while both were running, above which results are proved.
const MIN_COMMON: f64 = 0.99;

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
            ..Self::default()
        };
        let shown = path.display();
        match path.extension().and_then(|e| e.to_str()) {
            _ if path.is_dir() => earlier.read_rows(&path.join("rows.csv"), name, seed)?,
            Some("csv") => earlier.read_rows(path, name, seed)?,
            Some("mcap") => match replayed.filter(|replayed| replayed.path() == path) {
                Some(replayed) => earlier.read_recording(replayed)?,
                None => earlier.read_recording(&Recording::open(path)?)?,
            },
            _ => bail!("{shown}: expected RESULT.mcap, ROWS.csv or the folder of a report"),
        }
        if earlier.hashes.is_empty() {
            let cure = "`svl replay -o RESULT.mcap`, `svl replay --rows ROWS.csv` and `svl score` \
                        write some";
            bail!("{shown}: holds no results of that recording to compare with; {cure}");
        }
        Ok(earlier)
    }

    fn read_rows(&mut self, path: &Path, name: &str, seed: Option<u64>) -> anyhow::Result<()> {
        let is_of = |row: &Row| match &row.run {
            Some(run) => SourceKind::are_topics(run) || Path::new(name).ends_with(run),
            None => row.seed.is_none() || row.seed == seed,
        };
        let rows: Vec<Row> = read_rows(path)?;
        let mut runs = rows.iter().filter_map(|row| row.run.as_deref());
        self.by_stamp = runs.any(SourceKind::are_topics);
        for row in rows.into_iter().filter(is_of) {
            let key = self.key(row.stamp_ns, row.sequence);
            let hashes = (row.result_hash, row.pair_hash);
            self.add(row.algorithm.clone(), key, hashes);
            self.parameters.insert(row.algorithm, row.parameters_hash);
        }
        Ok(())
    }

    fn read_recording(&mut self, recording: &Recording) -> anyhow::Result<()> {
        for result in recording.results()? {
            let hashes = (result.hash, result.pair_hash);
            self.add(result.algorithm, result.sequence, hashes);
        }
        for cells in recording.cells()? {
            self.cells
                .insert((cells.algorithm.clone(), cells.sequence), cells);
        }
        if let Some(json) = recording.attachment(MANIFEST)? {
            let manifest: Manifest = serde_json::from_slice(&json)
                .with_context(|| format!("{}: {MANIFEST}", self.path.display()))?;
            let algorithms = manifest.algorithms.into_iter();
            self.parameters
                .extend(algorithms.map(|own| (own.label, own.parameters_hash)));
        }
        Ok(())
    }

    /// The number by which a pair is known.
    fn key(&self, stamp_ns: u64, sequence: u64) -> u64 {
        if self.by_stamp { stamp_ns } else { sequence }
    }

    fn add(&mut self, label: String, key: u64, hashes: (String, String)) {
        if !self.labels.contains(&label) {
            self.labels.push(label.clone());
        }
        self.hashes.insert((label, key), hashes);
    }

    /// The stamps of the pairs of live topics: an algorithm that remembers has to see these alone.
    pub(super) fn stamps_ns(&self) -> Option<BTreeSet<u64>> {
        let stamps = self.hashes.keys().map(|(_, stamp)| *stamp);
        self.by_stamp.then(|| stamps.collect())
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
            if algorithm.spec().is_program() {
                let shown = self.path.display();
                bail!(
                    "{shown}: names a program, which is not started unasked; name it yourself \
                     with --algo '{label}'"
                );
            }
            Ok(algorithm)
        };
        // Filters are given again with --filter.
        let labels = self.labels.iter();
        let mut labels: Vec<_> = labels.map(|own| without_filters(own).to_owned()).collect();
        labels.dedup();
        labels.iter().map(parse).collect()
    }

    /// Compares rows and cells of a replay of `algorithms`.
    pub(super) fn compare(
        &self,
        rows: &Rows,
        cells: &[AlgorithmCells],
        algorithms: &[Algorithm],
    ) -> anyhow::Result<Verification> {
        let mut found = Verification {
            against: self.path.clone(),
            ..Verification::default()
        };
        // An algorithm that answers cells itself may differ in them alone.
        let keyed = cells
            .iter()
            .map(|result| ((result.algorithm.clone(), result.sequence), result));
        let cells: BTreeMap<_, _> = keyed.collect();
        let same_cells = |row: RowRef<'_>| {
            let key = (row.algorithm().to_owned(), row.sequence());
            let both = self.cells.get(&key).zip(cells.get(&key));
            both.is_none_or(|(then, now)| then == *now)
        };
        for row in rows.iter() {
            self.check_parameters(row)?;
            let key = self.key(row.stamp_ns(), row.sequence());
            match self.hashes.get(&(row.algorithm().to_owned(), key)) {
                None => found.only_now += 1,
                // Another image was the partner, as one was lost.
                Some((_, pair)) if *pair != row.pair_hash() && self.by_stamp => found.only_now += 1,
                Some((_, pair)) if *pair != row.pair_hash() => {
                    let (shown, pair) = (self.path.display(), row.sequence());
                    bail!("{shown}: is of other pairs than these; pair {pair} differs");
                }
                Some((then, _)) if *then == row.result_hash() && same_cells(row) => {
                    found.equal += 1;
                }
                Some(_) => found
                    .differing
                    .entry(row.algorithm().to_owned())
                    .or_default()
                    .push(row.sequence()),
            }
        }
        found.with_memory = found.first_with_memory(algorithms)?;
        // Earlier algorithms that this replay was not asked for are not missing.
        let ran = |label: &str| algorithms.iter().any(|ran| ran.label() == label);
        let then = self.hashes.keys().filter(|(label, _)| ran(label)).count();
        let compared = found.equal + found.differing.values().map(Vec::len).sum::<usize>();
        found.only_then = then.saturating_sub(compared);
        if self.by_stamp {
            found.live = Some(self.common_pairs(rows, &ran));
        }
        Ok(found)
    }

    /// # Errors
    /// If the row's algorithm had other parameters.
    fn check_parameters(&self, row: RowRef<'_>) -> anyhow::Result<()> {
        let then = self.parameters.get(row.algorithm());
        if then.is_some_and(|then| *then != row.parameters_hash()) {
            let (label, shown) = (row.algorithm(), self.path.display());
            bail!(
                "{label}: its parameters are not those of {shown}; name the algorithm with --algo \
                 as it did, or replay it again"
            );
        }
        Ok(())
    }

    /// The pairs of the rows and of the earlier results, of the algorithms that `ran`.
    fn common_pairs(&self, rows: &Rows, ran: &dyn Fn(&str) -> bool) -> CommonPairs {
        let now = rows.iter().map(|row| (row.stamp_ns(), row.pair_hash()));
        let then = self.hashes.iter().filter(|((label, _), _)| ran(label));
        let then = then.map(|((_, stamp), (_, pair))| (*stamp, pair.as_str()));
        CommonPairs::new(now.collect(), then.collect())
    }
}

impl CommonPairs {
    /// Compares pairs, each with its stamp and its hash.
    fn new(now: BTreeSet<(u64, &str)>, then: BTreeSet<(u64, &str)>) -> Self {
        let ends = |pairs: &BTreeSet<(u64, &str)>| Some((pairs.first()?.0, pairs.last()?.0));
        // While both were running.
        let both = ends(&now).zip(ends(&then));
        let both = both.map(|((a, b), (c, d))| a.max(c)..=b.min(d));
        let is_inside = |stamp: &u64| both.as_ref().is_some_and(|both| both.contains(stamp));
        let only = |own: &BTreeSet<(u64, &str)>, other: &BTreeSet<(u64, &str)>| -> Vec<u64> {
            own.difference(other).map(|(stamp, _)| *stamp).collect()
        };
        let (mut only_now, mut only_then) = (only(&now, &then), only(&then, &now));
        let alone = only_now.len() + only_then.len();
        only_now.retain(is_inside);
        only_then.retain(is_inside);
        Self {
            common: now.intersection(&then).count(),
            outside: alone - only_now.len() - only_then.len(),
            only_now,
            only_then,
        }
    }

    fn are_enough(&self) -> bool {
        let alone = self.only_now.len() + self.only_then.len();
        let share = self.common as f64 / (self.common + alone) as f64;
        // Not a number without any pair.
        share >= MIN_COMMON
    }

    fn words(&self, against: &str) -> String {
        let pairs = counted(self.common as u64, "common pair");
        let named = |stamps: &[u64]| match stamps {
            [] => String::new(),
            [first, ..] => format!(", the first at {:.3} s", *first as f64 / 1e9),
        };
        format!(
            "{pairs}; while both were running {} only here{} and {} only in {against}{}; {} before \
             or after that",
            self.only_now.len(),
            named(&self.only_now),
            self.only_then.len(),
            named(&self.only_then),
            self.outside
        )
    }
}

impl Verification {
    /// The first of the differing algorithms that depends on earlier pairs.
    fn first_with_memory(&self, algorithms: &[Algorithm]) -> anyhow::Result<Option<String>> {
        for algorithm in algorithms {
            let label = algorithm.label();
            if self.differing.contains_key(label) && algorithm.build()?.has_run_memory() {
                return Ok(Some(label.to_owned()));
            }
        }
        Ok(None)
    }

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
            // Another past is no error of the algorithm.
            let part = match &self.with_memory {
                Some(label) if self.only_then > 0 => {
                    format!("; {label} depends on earlier pairs: verify the whole run")
                }
                _ => String::new(),
            };
            bail!(
                "{label}{more}: {} results differ from those of {against}, the first on pair \
                 {}{part}",
                pairs.len(),
                pairs[0]
            );
        }
        if let Some(pairs) = &self.live {
            let words = pairs.words(&against.to_string());
            if pairs.are_enough() {
                let equal = counted(self.equal as u64, "result");
                return Ok(format!("verified: {equal} equal; {words}\n"));
            }
            let share = 100.0 * MIN_COMMON;
            let why = format!("fewer than {share} % of the pairs are common: {words}");
            return Err(usage::incomplete(why));
        }
        if self.only_now + self.only_then > 0 {
            let (now, then, equal) = (self.only_now, self.only_then, self.equal);
            bail!(
                "{now} results have no counterpart in {against}, {then} of its results none here; \
                 {equal} are equal"
            );
        }
        let equal = self.equal;
        Ok(format!(
            "verified: {equal} results equal those of {against}\n"
        ))
    }
}
