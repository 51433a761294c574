//! A report that is compared, read from its folder.

use crate::rows::csv_rows::{RowReader, read_rows};
use crate::rows::held::{Row, RowRef, Rows, RunKey};
use crate::rows::records::{CellRow, CheckpointRow, FailureRow, Record};
use crate::subjects::accuracy::{AccuracyRow, AccuracyTally, AskedRange, PairErrors, RunRanges};
use crate::subjects::drives::{COURSES, CoursePlan, DriveRow};
use crate::subjects::kept::cell_rule;
use crate::subjects::pieces::{PieceRow, narrowest};
use crate::subjects::references::{EXACT, PRIOR};
use crate::subjects::sources::Sources;
use crate::subjects::witness::EstimateRow;
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};
use svl_core::{Error, Result};
use svl_score::judge::{AreaChoice, Measured, Metric, MetricOrigin};
use svl_score::losses::{EndState, Ending};
use svl_score::manifest::{AlgorithmRecord, Manifest, read_json};

/// A report of `svl score`, or one algorithm of it: the rows of its unperturbed pairs.
pub struct ScoredRun {
    /// The report as the user named it.
    pub name: PathBuf,
    pub manifest: Manifest,
    pub(super) folder: PathBuf,
    pub(super) area: AreaChoice,
    /// The end of the report; `None` if it was never finished.
    ending: Option<Ending>,
    pub(super) rows: Rows,
    /// The rows of the references.
    references: Rows,
    /// Errors by distance; those of pixels are of all pairs.
    accuracy: Vec<AccuracyRow>,
    estimates: Vec<EstimateRow>,
    pieces: Vec<PieceRow>,
    pub(super) failures: Vec<FailureRow>,
    checkpoints: Vec<CheckpointRow>,
    pub(super) drives: Vec<DriveRow>,
    courses: Vec<CoursePlan>,
    /// The table of cells, if it is there.
    cells: Option<PathBuf>,
}

impl ScoredRun {
    /// True if matching was measured.
    pub(super) fn has_times(&self) -> bool {
        self.rows.iter().any(|row| row.total_us().is_some())
    }

    /// Reads a report, `FOLDER`, or one algorithm of it, `FOLDER#LABEL`. `area`: the cells that
    /// metrics of an area are of.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Format`] with the file that is missing or is not a part of a report;
    /// [`Error::Invalid`] for a table that was changed, and for a label that the report does not
    /// have.
    pub fn read(name: &str, area: AreaChoice) -> Result<Self> {
        let one = name.rsplit_once('#').filter(|_| !Path::new(name).exists());
        let mut run = Self::open(Path::new(one.map_or(name, |(folder, _)| folder)))?;
        if let Some((_, label)) = one {
            if [PRIOR, EXACT].contains(&label) {
                run.become_reference(label);
            }
            let labels = run.labels().join(", ");
            run.manifest.algorithms.retain(|own| own.label == label);
            if run.manifest.algorithms.is_empty() {
                return Err(Error::Invalid(format!(
                    "{name}: the report has no algorithm '{label}'; it has {labels}"
                )));
            }
            run.name = name.into();
        }
        run.area = area;
        run.rows.select(area);
        run.references.select(area);
        Ok(run)
    }

    fn open(folder: &Path) -> Result<Self> {
        // The manifest is written first, so an interrupted report has one too.
        if !folder.join("manifest.json").is_file() {
            return Err(Error::format(
                folder,
                "is not a report of `svl score`: it has no manifest.json",
            ));
        }
        // The largest table may have been removed.
        let cells = Some(folder.join("cells.csv")).filter(|path| path.is_file());
        let sources = Sources::read(folder).unwrap_or_default();
        if let Some(table) = sources.changed(folder, cells.is_some()) {
            let shown = folder.display();
            let what = if folder.join(table).exists() {
                "was changed after the report was made"
            } else {
                "is not there"
            };
            return Err(Error::Invalid(format!(
                "{shown}/{table}: {what}; `svl report {shown}` makes it again"
            )));
        }
        let summary = folder.join("summary.json");
        let courses = folder.join(COURSES);
        let ending = summary.is_file().then(|| read_json(&summary));
        let courses = courses.is_file().then(|| read_json(&courses));
        let mut run = Self {
            name: folder.to_owned(),
            folder: folder.to_owned(),
            manifest: Manifest::read(folder)?,
            area: AreaChoice::default(),
            ending: ending.transpose()?,
            rows: unperturbed(&folder.join("rows.csv"))?,
            references: match folder.join("references.csv") {
                path if path.is_file() => unperturbed(&path)?,
                _ => Rows::default(),
            },
            accuracy: optional(folder, "accuracy.csv")?,
            estimates: optional(folder, "estimates.csv")?,
            pieces: optional(folder, "pieces.csv")?,
            failures: optional(folder, "failures.csv")?,
            checkpoints: optional(folder, "checkpoints.csv")?,
            drives: optional(folder, "drives.csv")?,
            courses: courses.transpose()?.unwrap_or_default(),
            cells,
        };
        run.failures.retain(|row| row.stress.is_none());
        run.checkpoints.retain(|row| row.stress.is_none());
        if !run.drives.is_empty() {
            run.checkpoints.clear();
        }
        Ok(run)
    }

    /// The reason why its results of these algorithms are incomplete: losses of others are not.
    pub(super) fn incomplete(&self, labels: &[&str]) -> Result<Option<String>> {
        let Some(ending) = &self.ending else {
            return Ok(Some("it was never finished".to_owned()));
        };
        if ending.state != EndState::Lossy {
            return Ok(ending.incomplete.clone());
        }
        let mut missing = ending.missing.clone();
        missing
            .algorithms
            .retain(|label, _| labels.contains(&label.as_str()));
        Ok(Ending::new(missing, self.manifest.allow_loss()?).incomplete)
    }

    /// Keeps a reference in place of the algorithms. Reports of drives, and of pixels, have none.
    fn become_reference(&mut self, name: &str) {
        let rows = self.reference(name);
        if !rows.is_empty() {
            self.rows = rows.into_iter().map(RowRef::to_row).collect();
            self.cells = None;
            self.checkpoints.clear();
            self.manifest.algorithms = vec![AlgorithmRecord {
                name: name.to_owned(),
                label: name.to_owned(),
                ..AlgorithmRecord::default()
            }];
        }
    }

    /// The rows of a reference.
    pub(super) fn reference(&self, name: &str) -> Vec<RowRef<'_>> {
        let rows = self.references.iter();
        rows.filter(|row| row.algorithm() == name).collect()
    }

    /// A metric of an algorithm that is known of all pairs together alone.
    pub(super) fn whole(&self, metric: &Metric, label: &str) -> Option<Measured> {
        let Some(number) = metric.estimated() else {
            let is_reach = matches!(metric.origin, MetricOrigin::Pieces { .. });
            let mut rows = narrowest(&self.pieces).filter(|row| row.algorithm == label);
            return rows.next().filter(|_| is_reach)?.measured();
        };
        let mut rows = self.estimates.iter();
        let own = rows.find(|row| row.algorithm == label && row.area == self.area);
        own?.about(number)
    }

    pub(super) fn labels(&self) -> Vec<&str> {
        self.manifest.labels().collect()
    }

    pub(super) fn record(&self, label: &str) -> Option<&AlgorithmRecord> {
        let mut records = self.manifest.algorithms.iter();
        records.find(|record| record.label == label)
    }

    pub(super) fn has_cells(&self) -> bool {
        self.cells.is_some()
    }

    /// The reason why it has no errors of distances, where it has no table of cells.
    pub(super) fn without_cells(&self) -> String {
        if matches!(self.labels()[..], [PRIOR | EXACT]) {
            return format!("{} has none", self.name.display());
        }
        let folder = self.folder.display();
        format!("{folder} has no cells.csv; `svl report {folder}` makes it")
    }

    /// Hands on the cells of an algorithm in these pairs, pair by pair, in the order of the table,
    /// with the place of the pair.
    pub(super) fn each_pair_of_cells(
        &self,
        label: &str,
        pairs: &[RowRef<'_>],
        mut take: impl FnMut(usize, &[CellRow]),
    ) -> Result<()> {
        let Some(path) = self.cells.as_ref().filter(|_| !pairs.is_empty()) else {
            return Ok(());
        };
        let places = pairs.iter().enumerate();
        let places = places.map(|(i, row)| ((row.origin().run_key(), row.sequence()), i));
        let places: HashMap<(RunKey<'_>, u64), usize> = places.collect();
        let mut cells: Vec<CellRow> = Vec::new();
        let mut hand_on = |cells: &[CellRow]| {
            let key = |cell: &CellRow| places.get(&(cell_run(cell), cell.sequence)).copied();
            if let Some(i) = cells.first().and_then(key) {
                take(i, cells);
            }
        };
        for cell in RowReader::<CellRow>::open(path)?.only("algorithm", label) {
            let cell = cell?;
            let is_other = |first: &CellRow| {
                (cell_run(first), first.sequence) != (cell_run(&cell), cell.sequence)
            };
            if cell.stress.is_some() {
                continue;
            }
            if cells.first().is_some_and(is_other) {
                hand_on(&cells);
                cells.clear();
            }
            cells.push(cell);
        }
        hand_on(&cells);
        Ok(())
    }

    /// The errors of distances in these pairs, in their order, and all of them by distance.
    /// `ranges`: those that may be asked for.
    pub(super) fn pair_errors(
        &self,
        label: &str,
        pairs: &[RowRef<'_>],
        ranges: &RunRanges,
    ) -> Result<(Vec<PairErrors>, AccuracyTally)> {
        let mut errors = Vec::new();
        errors.resize_with(pairs.len(), PairErrors::default);
        let rule = cell_rule(&self.manifest)?;
        let [mut tally, mut all] = [(); 2].map(|()| AccuracyTally::new(rule, ranges));
        let mut last_run = None;
        self.each_pair_of_cells(label, pairs, |i, cells| {
            let run = pairs[i].origin().run_key();
            if last_run.replace(run) != Some(run) {
                for own in [&mut tally, &mut all] {
                    own.begin_pass(self.manifest.has_separate_pairs(run.1));
                }
            }
            all.add(pairs[i].origin().time_ns(), cells);
            errors[i] = tally.take_pair(pairs[i].origin().time_ns(), cells);
        })?;
        Ok((errors, all))
    }

    /// The errors of an algorithm's pixels in these ranges, of all its pairs.
    pub(super) fn pixel_errors(&self, label: &str, ranges: &[AskedRange]) -> Vec<AccuracyRow> {
        let own = self.accuracy.iter();
        let own = own.filter(|row| row.is_of_pixels && row.algorithm == label);
        let own = own.filter(|row| ranges.iter().any(|(range, _)| *range == row.range()));
        own.cloned().collect()
    }

    /// True if the course of that seed has the same obstacles in both reports.
    pub(super) fn has_course_of(&self, other: &Self, seed: u64) -> bool {
        let [own, other] = [self, other].map(|run| {
            let course = run.courses.iter().find(|course| course.seed == seed)?;
            Some((&course.outlines, course.goal_m))
        });
        own == other
    }

    pub(super) fn has_checkpoints(&self, label: &str) -> bool {
        let mut seen = self.checkpoints.iter().filter(|row| row.frames > 0);
        seen.any(|row| row.algorithm == label)
    }

    /// Frames and passed frames per checkpoint over those runs, with the checkpoint's name.
    pub(super) fn checkpoints(
        &self,
        label: &str,
        runs: &[RunKey<'_>],
    ) -> BTreeMap<u32, (&str, [u64; 2])> {
        let mut sums = BTreeMap::new();
        let own = self.checkpoints.iter().filter(|row| row.algorithm == label);
        for row in own.filter(|row| runs.contains(&(row.seed, row.run.as_deref()))) {
            let sum = sums.entry(row.checkpoint);
            let (_, [frames, passed]) = sum.or_insert((row.name.as_str(), [0; 2]));
            *frames += row.frames;
            *passed += row.passed;
        }
        sums
    }
}

fn cell_run(cell: &CellRow) -> RunKey<'_> {
    (cell.seed, cell.run.as_deref())
}

/// The unperturbed rows of a table.
fn unperturbed(path: &Path) -> Result<Rows> {
    let mut rows = Rows::default();
    for row in RowReader::<Row>::open(path)? {
        let row = row?;
        if row.stress.is_none() {
            rows.push(&row);
        }
    }
    Ok(rows)
}

/// The rows of a table; none if the folder does not have it.
fn optional<R: Record>(folder: &Path, table: &str) -> Result<Vec<R>> {
    let path = folder.join(table);
    if path.is_file() {
        read_rows(&path)
    } else {
        Ok(Vec::new())
    }
}
