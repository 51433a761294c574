//! A report that is compared, read from its folder.

use crate::accuracy::{AccuracyTally, PairErrors};
use crate::build::COURSES;
use crate::csv_rows::{RowReader, read_rows};
use crate::drives::{CoursePlan, DriveRow};
use crate::prior::PRIOR;
use crate::rows::{CellRow, CheckpointRow, FailureRow, Row};
use crate::samples::{RunKey, is_scene, run_key};
use crate::shots::LeftImages;
use crate::sources::Sources;
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use svl_core::{Error, Result};
use svl_score::judge::AreaChoice;
use svl_score::manifest::{AlgorithmRecord, Manifest, read_json};
use svl_score::scenario::PairRange;

/// A report of `svl score`, read from its folder.
pub struct ScoredRun {
    /// The folder as the user named it.
    pub folder: PathBuf,
    /// The folder itself.
    report: PathBuf,
    pub manifest: Manifest,
    area: AreaChoice,
    /// Reason why it is incomplete, if it is.
    pub(super) incomplete: Option<String>,
    /// Rows of the unperturbed pairs.
    pub(super) rows: Vec<Row>,
    /// Pairs that algorithms failed on, likewise.
    pub(super) failures: Vec<FailureRow>,
    pub(super) checkpoints: Vec<CheckpointRow>,
    pub(super) drives: Vec<DriveRow>,
    courses: Vec<CoursePlan>,
    /// The report's runs by those that it is compared under, and the numbers of its scenes
    /// likewise.
    own_runs: BTreeMap<OwnedRun, OwnedRun>,
    own_scenes: BTreeMap<u64, u64>,
    /// The table of cells, if it is there.
    cells: Option<PathBuf>,
}

/// Seed and recording of a pair, and its number there.
pub(super) type PairKey<'a> = (RunKey<'a>, u64);

/// Seed and recording of a run.
type OwnedRun = (Option<u64>, Option<String>);

/// The part of `summary.json` that is read.
#[derive(Deserialize)]
struct Whole {
    incomplete: Option<String>,
}

impl ScoredRun {
    /// Reads a report, `FOLDER`, or one algorithm of it, `FOLDER#LABEL`.
    ///
    /// # Errors
    /// The errors of [`ScoredRun::read`]; [`Error::Invalid`] for a label that the report does not
    /// have.
    pub fn named(text: &str) -> Result<Self> {
        let whole = Path::new(text);
        let Some((folder, label)) = text.rsplit_once('#').filter(|_| !whole.exists()) else {
            return Self::read(whole);
        };
        let mut run = Self::read(Path::new(folder))?;
        if label == PRIOR {
            run.become_prior()?;
        }
        if !run.labels().contains(&label) {
            let labels = run.labels().join(", ");
            return Err(Error::Invalid(format!(
                "{text}: the report has no algorithm '{label}'; it has {labels}"
            )));
        }
        run.manifest.algorithms.retain(|a| a.label == label);
        run.folder = text.into();
        Ok(run)
    }

    /// Reads a report.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Format`] with the file that is missing or is not a part of a report.
    pub fn read(folder: &Path) -> Result<Self> {
        // The manifest is written first, so an interrupted report has one too.
        if !folder.join("manifest.json").is_file() {
            return Err(Error::format(
                folder,
                "is not a report of `svl score`: it has no manifest.json",
            ));
        }
        let manifest = Manifest::read(folder)?;
        let sources = Sources::read(folder).unwrap_or_default();
        // The largest table may have been removed.
        let cells = Some(folder.join("cells.csv")).filter(|path| path.is_file());
        if let Some(table) = sources.changed(folder, cells.is_some()) {
            let shown = folder.display();
            return Err(Error::Invalid(format!(
                "{shown}/{table}: was changed after the report was made; `svl report {shown}` \
                 makes it again"
            )));
        }
        let summary = folder.join("summary.json");
        let incomplete = if summary.is_file() {
            read_json::<Whole>(&summary)?.incomplete
        } else {
            Some("it was never finished".to_owned())
        };
        let mut rows: Vec<Row> = read_rows(&folder.join("rows.csv"))?;
        rows.retain(|row| row.stress.is_none());
        let failures = folder.join("failures.csv");
        let mut failures: Vec<FailureRow> = if failures.is_file() {
            read_rows(&failures)?
        } else {
            Vec::new()
        };
        failures.retain(|row| row.stress.is_none());
        let drives = folder.join("drives.csv");
        let (drives, checkpoints) = if drives.is_file() {
            (read_rows(&drives)?, Vec::new())
        } else {
            (Vec::new(), read_rows(&folder.join("checkpoints.csv"))?)
        };
        let courses = folder.join(COURSES);
        let courses = if courses.is_file() {
            read_json(&courses)?
        } else {
            Vec::new()
        };
        let mut checkpoints: Vec<CheckpointRow> = checkpoints;
        checkpoints.retain(|row| row.stress.is_none());
        Ok(Self {
            folder: folder.to_owned(),
            report: folder.to_owned(),
            manifest,
            area: AreaChoice::default(),
            incomplete,
            rows,
            failures,
            checkpoints,
            drives,
            courses,
            own_runs: BTreeMap::new(),
            own_scenes: BTreeMap::new(),
            cells,
        })
    }

    /// Keeps the prior, which looks at nothing, in place of the algorithms.
    fn become_prior(&mut self) -> Result<()> {
        let table = self.report.join(format!("{PRIOR}.csv"));
        if table.is_file() {
            self.rows = read_rows(&table)?;
        }
        // Reports of drives, and of pixels, have none.
        if table.is_file() && !self.rows.is_empty() {
            self.cells = None;
            self.checkpoints.clear();
            self.manifest.algorithms = vec![AlgorithmRecord {
                name: PRIOR.to_owned(),
                label: PRIOR.to_owned(),
                ..AlgorithmRecord::default()
            }];
        }
        Ok(())
    }

    /// Selects the cells that metrics of an area are of.
    pub fn select(&mut self, area: AreaChoice) {
        self.area = area;
        for row in &mut self.rows {
            row.metrics = row.metrics.in_area(area);
        }
    }

    pub(super) fn area(&self) -> AreaChoice {
        self.area
    }

    /// Names runs and numbers scenes as the other report does, where they have the same pairs.
    pub fn align_with(&mut self, base: &Self) {
        self.name_runs_as(base);
        self.number_scenes_as(base);
    }

    /// Names each run as the one with the most pairs in common, of several its own name: a
    /// recording may have another name, or be of a seed of the arena.
    fn name_runs_as(&mut self, base: &Self) {
        let owned = |row: &Row| (row.seed, row.run.clone());
        let in_run = |row: &&Row| !is_scene(row);
        let mut by_pair = BTreeMap::new();
        for row in base.rows.iter().filter(in_run) {
            let pair = (row.sequence, row.stamp_ns, row.pair_hash.as_str());
            by_pair.insert(pair, owned(row));
        }
        let mut common: BTreeMap<OwnedRun, BTreeMap<&OwnedRun, u64>> = BTreeMap::new();
        for row in self.rows.iter().filter(in_run) {
            let pair = (row.sequence, row.stamp_ns, row.pair_hash.as_str());
            if let Some(run) = by_pair.get(&pair) {
                let runs = common.entry(owned(row)).or_default();
                *runs.entry(run).or_default() += 1;
            }
        }
        let mut renamed = BTreeMap::new();
        for (own, runs) in &common {
            let rank = |(run, pairs): &(&&OwnedRun, &u64)| (**pairs, **run == own);
            let best = runs.iter().max_by_key(rank).map(|(run, _)| *run);
            renamed.extend(best.map(|run| (own.clone(), run.clone())));
        }
        // All keep their names if two would have the same.
        let own: BTreeSet<OwnedRun> = self.rows.iter().filter(in_run).map(owned).collect();
        let new = |run: &OwnedRun| renamed.get(run).unwrap_or(run).clone();
        let all: BTreeSet<OwnedRun> = own.iter().map(new).collect();
        if all.len() < own.len() {
            return;
        }
        self.own_runs = own.iter().map(|own| (new(own), own.clone())).collect();
        let rows = self.rows.iter_mut().filter(|row| !is_scene(row));
        let rows = rows.map(|row| (&mut row.seed, &mut row.run));
        let failures = self.failures.iter_mut();
        let failures = failures.map(|row| (&mut row.seed, &mut row.run));
        let checkpoints = self.checkpoints.iter_mut();
        let checkpoints = checkpoints.map(|row| (&mut row.seed, &mut row.run));
        for (seed, run) in rows.chain(failures).chain(checkpoints) {
            if let Some(name) = renamed.get(&(*seed, run.clone())) {
                (*seed, *run) = name.clone();
            }
        }
    }

    /// Numbers scenes as the other report does: a folder that got another scene numbers the later
    /// ones anew.
    fn number_scenes_as(&mut self, base: &Self) {
        let scenes = base.rows.iter().filter(|row| is_scene(row));
        let key = |row: &Row| (row.name.clone(), row.pair_hash.clone());
        let by_scene: HashMap<_, _> = scenes.map(|row| (key(row), row.sequence)).collect();
        let behind = by_scene.values().max().map_or(0, |last| last + 1);
        let scenes = self.rows.iter_mut().filter(|row| is_scene(row));
        for row in scenes {
            let same = by_scene.get(&key(row)).copied();
            let own = row.sequence;
            row.sequence = same.unwrap_or(behind + own);
            self.own_scenes.insert(row.sequence, own);
        }
        let new: HashMap<_, _> = self
            .own_scenes
            .iter()
            .map(|(new, own)| (*own, *new))
            .collect();
        // Failures have no name: scenes are in no recording and of no seed.
        let failures = self.failures.iter_mut();
        for row in failures.filter(|row| row.run.is_none() && row.seed.is_none()) {
            row.sequence = *new.get(&row.sequence).unwrap_or(&row.sequence);
        }
    }

    pub(super) fn labels(&self) -> Vec<&str> {
        self.manifest
            .algorithms
            .iter()
            .map(|a| a.label.as_str())
            .collect()
    }

    pub(super) fn all_rows(&self) -> Vec<&Row> {
        self.rows.iter().collect()
    }

    /// True if it has a table of cells.
    pub(super) fn has_cells(&self) -> bool {
        self.cells.is_some()
    }

    /// The reason why it has no errors of distances, where it has no table of cells.
    pub(super) fn without_cells(&self) -> String {
        if self.labels() == [PRIOR] {
            return format!("{} has none", self.folder.display());
        }
        let folder = self.report.display();
        format!("{folder} has no cells.csv; `svl report {folder}` makes it")
    }

    /// The left images that its folder holds.
    pub(super) fn left_images(&self) -> Result<LeftImages> {
        LeftImages::find(&self.report)
    }

    /// The key of a row's pair in the tables of its folder, where runs have their own names and
    /// scenes their own numbers.
    pub(super) fn own_key<'a>(&'a self, row: &'a Row) -> PairKey<'a> {
        if is_scene(row) {
            let sequence = self.own_scenes.get(&row.sequence);
            return (run_key(row), *sequence.unwrap_or(&row.sequence));
        }
        let own = self.own_runs.get(&(row.seed, row.run.clone()));
        let run = own.map_or_else(|| run_key(row), |(seed, run)| (*seed, run.as_deref()));
        (run, row.sequence)
    }

    /// Hands on the cells of an algorithm pair by pair, in the order of its table.
    pub(super) fn each_pair_of_cells(
        &self,
        label: &str,
        mut take: impl FnMut(PairKey<'_>, &[CellRow]),
    ) -> Result<()> {
        let Some(path) = &self.cells else {
            return Ok(());
        };
        fn key(cell: &CellRow) -> PairKey<'_> {
            ((cell.seed, cell.run.as_deref()), cell.sequence)
        }
        let mut pair: Vec<CellRow> = Vec::new();
        for cell in RowReader::<CellRow>::open(path)?.only("algorithm", label) {
            let cell = cell?;
            if cell.stress.is_some() {
                continue;
            }
            if pair.first().is_some_and(|first| key(first) != key(&cell)) {
                take(key(&pair[0]), &pair);
                pair.clear();
            }
            pair.push(cell);
        }
        if let Some(first) = pair.first() {
            take(key(first), &pair);
        }
        Ok(())
    }

    /// The errors of distances in these pairs, in their order.
    pub(super) fn pair_errors(&self, label: &str, pairs: &[&Row]) -> Result<Vec<PairErrors>> {
        let places = pairs.iter().enumerate();
        let places = places.map(|(i, row)| (self.own_key(row), (i, row.stamp_ns)));
        let places: HashMap<_, _> = places.collect();
        let mut errors = Vec::new();
        errors.resize_with(pairs.len(), PairErrors::default);
        let rule = self.manifest.part("cells")?.unwrap_or_default();
        let (mut tally, mut last_run) = (AccuracyTally::new(rule), None);
        self.each_pair_of_cells(label, |(run, sequence), cells| {
            let Some(&(i, stamp_ns)) = places.get(&(run, sequence)) else {
                return;
            };
            let (own, _) = self.own_key(pairs[i]);
            if last_run.replace(own) != Some(own) {
                tally.begin_pass();
            }
            errors[i] = tally.take_pair(stamp_ns, cells);
        })?;
        Ok(errors)
    }

    /// True if its times are of one machine.
    pub(super) fn has_times(&self) -> bool {
        self.manifest.machines().len() == 1
    }

    /// The number of these pairs that an algorithm failed on.
    pub(super) fn failed_of<'a>(
        &'a self,
        label: &str,
        pairs: impl Iterator<Item = (RunKey<'a>, u64)>,
    ) -> usize {
        let pairs: BTreeSet<_> = pairs.collect();
        let own = self.failures.iter().filter(|row| row.algorithm == label);
        let key = |row: &'a FailureRow| ((row.seed, row.run.as_deref()), row.sequence);
        own.filter(|row| pairs.contains(&key(row))).count()
    }

    fn record(&self, label: &str) -> Option<&AlgorithmRecord> {
        let mut records = self.manifest.algorithms.iter();
        records.find(|record| record.label == label)
    }

    pub(super) fn parameters_hash(&self, label: &str) -> Option<&str> {
        self.record(label)
            .map(|record| record.parameters_hash.as_str())
    }

    /// True if results of an algorithm depend on the earlier pairs of their run.
    pub(super) fn has_run_memory(&self, label: &str) -> bool {
        self.record(label)
            .is_some_and(|record| record.has_run_memory)
    }

    /// The pairs that were selected of its source.
    pub(super) fn selection(&self) -> Result<PairRange> {
        Ok(self.manifest.part("source")?.unwrap_or_default())
    }

    /// The rows of an algorithm by run, sequence and name of their pairs.
    pub(super) fn rows(&self, label: &str) -> BTreeMap<(RunKey<'_>, u64, &str), &Row> {
        let own = self.rows.iter().filter(|row| row.algorithm == label);
        own.map(|row| ((run_key(row), row.sequence, row.name.as_str()), row))
            .collect()
    }

    /// The unperturbed drives of an algorithm by the seeds of their courses.
    pub(super) fn drives(&self, label: &str) -> BTreeMap<u64, &DriveRow> {
        let own = self.drives.iter();
        let own = own.filter(|row| row.algorithm == label && row.stress.is_none());
        own.map(|row| (row.seed, row)).collect()
    }

    /// True if the course of that seed has the same obstacles in both reports.
    pub(super) fn has_course_of(&self, other: &Self, seed: u64) -> bool {
        let [own, other] = [self, other].map(|run| {
            let mut courses = run.courses.iter();
            let course = courses.find(|course| course.seed == seed)?;
            Some((&course.outlines, course.goal_m))
        });
        own == other
    }

    pub(super) fn has_checkpoints(&self, label: &str) -> bool {
        self.checkpoints.iter().any(|row| row.algorithm == label)
    }

    /// Frames and passed frames per checkpoint over those runs, with the checkpoint's name.
    pub(super) fn checkpoints(
        &self,
        label: &str,
        runs: &[RunKey<'_>],
    ) -> BTreeMap<u32, (&str, u64, u64)> {
        let mut sums = BTreeMap::new();
        let own = self
            .checkpoints
            .iter()
            .filter(|row| row.algorithm == label)
            .filter(|row| runs.contains(&(row.seed, row.run.as_deref())));
        for row in own {
            let (_, frames, passed) =
                sums.entry(row.checkpoint)
                    .or_insert((row.name.as_str(), 0, 0));
            *frames += row.frames;
            *passed += row.passed;
        }
        sums
    }
}
