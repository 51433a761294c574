//! The tables of the parts, row by row, in the order of the whole.

use super::super::part::{ReportPart, ReportRun};
use crate::console::Bar;
use crate::report::{
    CellRow, CheckpointRow, DriveRow, FailureRow, Record, Row, TableWriter, TrackRow, merge_rows,
};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use svl_core::{Error, Result};
use svl_data::losses::Missing;
use svl_data::manifest::Manifest;

/// A part with its folder.
pub(super) struct FoundPart {
    pub(super) folder: PathBuf,
    pub(super) part: ReportPart,
    pub(super) manifest: Manifest,
    pub(super) missing: Missing,
}

/// Places of runs and algorithms in the whole.
pub(super) struct MergeOrder {
    runs: HashMap<ReportRun, usize>,
    algorithms: HashMap<String, usize>,
    /// True if an algorithm's rows of a run stay together.
    driven: bool,
}

impl MergeOrder {
    pub(super) fn new(part: &ReportPart, manifest: &Manifest) -> Self {
        let runs = part.runs.iter().cloned().zip(0..);
        let labels = manifest.labels().map(str::to_owned).zip(0..);
        Self {
            runs: runs.collect(),
            algorithms: labels.collect(),
            driven: part.driven,
        }
    }

    /// The place of a run, if it is one of the whole.
    pub(super) fn run(&self, run: &ReportRun) -> Option<usize> {
        self.runs.get(run).copied()
    }

    /// The place of a row: run, then algorithm or pair, whichever comes first.
    fn place(&self, row: &impl PlacedRow) -> Result<(usize, u64, u64)> {
        let (run, algorithm, sequence) = row.key();
        let known = self.run(&run).zip(self.algorithms.get(algorithm));
        let (run, algorithm) = known.ok_or_else(|| {
            Error::Invalid(format!(
                "a part has a row of another run: {run:?}, {algorithm}"
            ))
        })?;
        let algorithm = *algorithm as u64;
        Ok(if self.driven {
            (run, algorithm, sequence)
        } else {
            (run, sequence, algorithm)
        })
    }
}

/// A row that has a place in the whole.
pub(super) trait PlacedRow: Record + Clone {
    /// Its run, its algorithm, and its place among theirs.
    fn key(&self) -> (ReportRun, &str, u64);

    fn set_run_id(&mut self, id: &str);
}

macro_rules! placed {
    ($($kind:ty: |$row:ident| $run:expr, $place:expr;)*) => {$(
        impl PlacedRow for $kind {
            fn key(&self) -> (ReportRun, &str, u64) {
                let $row = self;
                ($run, &self.algorithm, $place)
            }

            fn set_run_id(&mut self, id: &str) {
                id.clone_into(&mut self.run_id);
            }
        }
    )*};
}

placed! {
    Row: |row| run_of(&row.run, row.seed, &row.stress), row.sequence;
    CellRow: |row| run_of(&row.run, row.seed, &row.stress), row.sequence;
    FailureRow: |row| run_of(&row.run, row.seed, &row.stress), row.sequence;
    CheckpointRow: |row| run_of(&row.run, row.seed, &row.stress), u64::from(row.checkpoint);
    DriveRow: |row| ReportRun::course(row.seed, row.stress.as_deref()), 0;
    TrackRow: |row| ReportRun::course(row.seed, row.stress.as_deref()), row.sequence;
}

fn run_of(run: &Option<String>, seed: Option<u64>, stress: &Option<String>) -> ReportRun {
    ReportRun {
        run: run.clone(),
        seed,
        stress: stress.clone(),
    }
}

/// The merge of tables under way.
pub(super) struct TableMerge<'a> {
    pub(super) parts: &'a [FoundPart],
    pub(super) out: &'a Path,
    pub(super) order: MergeOrder,
    /// Run id of the whole.
    pub(super) id: String,
    pub(super) bar: Box<dyn Bar>,
}

impl TableMerge<'_> {
    /// Merges the tables of that name, whose rows are in their order in every part. `keep` gets the
    /// rows of the whole in turn.
    pub(super) fn merge<R: PlacedRow>(&self, name: &str, mut keep: impl FnMut(&[R])) -> Result<()> {
        let file = format!("{name}.csv");
        let paths = self.parts.iter().map(|found| found.folder.join(&file));
        let paths: Vec<PathBuf> = paths.filter(|path| path.exists()).collect();
        let mut table = TableWriter::create_both(self.out, name)?;
        let place = |row: &R| self.order.place(row);
        merge_rows(&paths, place, |rows| {
            table.push(self.taken(rows, &mut keep)?)
        })?;
        table.finish()
    }

    /// As [`TableMerge::merge`], of rows that are all held and in any order.
    pub(super) fn sort<R: PlacedRow>(&self, name: &str, mut rows: Vec<R>) -> Result<Vec<R>> {
        rows.sort_by_cached_key(|row| self.order.place(row).unwrap_or_default());
        let rows = self.taken(rows, &mut |_| ())?;
        let mut table = TableWriter::create_both(self.out, name)?;
        table.push(rows.iter().cloned())?;
        table.finish()?;
        Ok(rows)
    }

    fn taken<R: PlacedRow>(&self, mut rows: Vec<R>, keep: &mut impl FnMut(&[R])) -> Result<Vec<R>> {
        rows.iter().for_each(|_| self.bar.step());
        if svl_core::interrupt::requested() {
            return Err(Error::Invalid("interrupted".into()));
        }
        rows.iter_mut().for_each(|row| row.set_run_id(&self.id));
        keep(&rows);
        Ok(rows)
    }
}
