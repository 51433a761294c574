//! The drives of a scenario: each course with each algorithm at the wheel, several at once.

use super::folder::{COURSES, MANIFEST, ReportContent};
use super::maps::maps;
use super::part::{ReportPart, ReportRun};
use super::plan::{EndedRun, EvaluationPlan};
use crate::console::{Bar, Console, Unit};
use crate::drive::{Course, DrivePlan, DriveResult};
use crate::outputs::{Outputs, write_json};
use crate::report::html::CheckpointFigure;
use crate::report::{
    CellRow, CoursePlan, DriveRow, EarlierRun, FailureRow, GateResult, Row, Summary, TableWriter,
    TrackRow, whole_rows,
};
use crate::run::{Monitor, Pace, ending};
use crate::sink::ReportPictures;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::channel;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use svl_core::{Error, Result, interrupt};
use svl_data::losses::{FailedPairs, Missing, RunEnding};
use svl_data::manifest::Manifest;
use svl_data::scenario::{Scenario, ScenarioSource};
use svl_data::stress::Stress;

/// A drive of the scenario, by the places of course and algorithm in it.
#[derive(Clone, Copy)]
struct DriveUnit {
    course: usize,
    stress: Option<Stress>,
    algorithm: usize,
}

impl DriveUnit {
    fn stress_text(&self) -> Option<String> {
        self.stress.map(|stress| stress.to_string())
    }
}

/// The name of a drive's recording in its report.
fn recording_name(scenario: &Scenario, seed: u64, unit: DriveUnit) -> String {
    let label = scenario.algorithms[unit.algorithm].label();
    // No label in a name contains an equals sign.
    let stress = unit
        .stress
        .map(|stress| format!("-{stress}"))
        .unwrap_or_default();
    let is_safe = |c: char| c.is_ascii_alphanumeric() || "_-.+".contains(c);
    if label.chars().all(is_safe) {
        format!("course-{seed}-{label}{stress}.mcap")
    } else {
        // Two labels may differ only in characters that no file name may contain.
        let safe = |c: char| if is_safe(c) { c } else { '-' };
        let label: String = label.chars().take(40).map(safe).collect();
        format!("course-{seed}-{}-{label}{stress}.mcap", unit.algorithm + 1)
    }
}

/// Runs all drives and writes their report.
pub(super) fn evaluate(
    plan: &EvaluationPlan<'_>,
    outputs: &mut Outputs,
    console: &dyn Console,
) -> Result<EndedRun> {
    let (scenario, folder) = (plan.scenario, plan.folder);
    let ScenarioSource::Drive { seeds, .. } = &scenario.source else {
        return Err(Error::Invalid(format!(
            "scenario '{}' has no drives",
            scenario.name
        )));
    };
    let mut manifest = plan.manifest(Pace::Asap)?;
    manifest.times = Some("matching while other drives run".to_owned());
    let earlier = if plan.resume {
        EarlierDrives::read(folder, &mut manifest)?
    } else {
        EarlierDrives::default()
    };
    outputs.set_aside()?;
    let kept = earlier.drives.values().flat_map(|result| &result.drives);
    for name in kept.filter_map(|row| row.recording.as_ref()) {
        outputs.bring_back(name)?;
    }
    let mut report = DriveReport::begin(folder, manifest, scenario)?;
    if let Some(shard) = plan.shard {
        let texts = plan
            .stresses()
            .map(|level| level.map(|stress| stress.to_string()));
        let texts: Vec<_> = texts.collect();
        let runs = seeds.iter().flat_map(|seed| {
            let of_course = texts.iter();
            of_course.map(|stress| ReportRun::course(*seed, stress.as_deref()))
        });
        ReportPart::write(folder, scenario, shard, runs.collect())?;
    }
    let ran = report.drive_all(plan, seeds, earlier, console);
    let mut missing = Missing::default();
    for row in &report.collected.drives {
        let (pairs, failed) = (row.frames, row.failures);
        missing.pairs += pairs;
        missing.add_failures(row.algorithm.clone(), FailedPairs { pairs, failed });
    }
    let pairs = missing.pairs;
    let ending = ending(&ran, missing, scenario.options.allow_loss);
    let finished = report.finish(plan, ending, console);
    Ok(EndedRun {
        ran,
        finished,
        pairs,
        others: Vec::new(),
        holds_earlier: plan.resume,
        inputs: Vec::new(),
    })
}

/// Seed, algorithm and stress of a drive.
type DriveKey = (u64, String, Option<String>);

/// The complete drives of an interrupted run.
#[derive(Default)]
struct EarlierDrives {
    drives: HashMap<DriveKey, DriveResult>,
    plans: Vec<CoursePlan>,
}

impl EarlierDrives {
    /// Reads those of a folder, and notes in `manifest` that the run is resumed.
    fn read(folder: &Path, manifest: &mut Manifest) -> Result<Self> {
        if EarlierRun::open(folder, manifest)?.is_none() {
            return Ok(Self::default());
        }
        let key = |seed: u64, algorithm: &str, stress: &Option<String>| {
            (seed, algorithm.to_owned(), stress.clone())
        };
        let mut drives: HashMap<_, DriveResult> = HashMap::new();
        // A drive's own row is written last: with it the drive is complete.
        for row in whole_rows::<DriveRow>(&folder.join("drives.csv"))? {
            let result = drives
                .entry(key(row.seed, &row.algorithm, &row.stress))
                .or_default();
            result.drives.push(row);
        }
        for row in whole_rows::<TrackRow>(&folder.join("tracks.csv"))? {
            if let Some(result) = drives.get_mut(&key(row.seed, &row.algorithm, &row.stress)) {
                result.track.push(row);
            }
        }
        for row in whole_rows::<Row>(&folder.join("rows.csv"))? {
            let seed = row.seed.unwrap_or_default();
            if let Some(result) = drives.get_mut(&key(seed, &row.algorithm, &row.stress)) {
                result.rows.push(row);
            }
        }
        for row in whole_rows::<CellRow>(&folder.join("cells.csv"))? {
            let seed = row.seed.unwrap_or_default();
            if let Some(result) = drives.get_mut(&key(seed, &row.algorithm, &row.stress)) {
                result.cells.push(row);
            }
        }
        for row in whole_rows::<FailureRow>(&folder.join("failures.csv"))? {
            let seed = row.seed.unwrap_or_default();
            if let Some(result) = drives.get_mut(&key(seed, &row.algorithm, &row.stress)) {
                result.failures.push(row);
            }
        }
        // A killed run has none.
        let plans = std::fs::read_to_string(folder.join(COURSES)).ok();
        let plans = plans.and_then(|text| serde_json::from_str(&text).ok());
        Ok(Self {
            drives,
            plans: plans.unwrap_or_default(),
        })
    }
}

/// A report of drives under way.
struct DriveReport {
    folder: PathBuf,
    manifest: Manifest,
    rows: TableWriter<Row>,
    cells: TableWriter<CellRow>,
    drives: TableWriter<DriveRow>,
    tracks: TableWriter<TrackRow>,
    failures: TableWriter<FailureRow>,
    collected: ReportContent,
    track: Vec<TrackRow>,
    plans: Vec<CoursePlan>,
    /// Per algorithm the speed of its fastest collision; a drive of an earlier part of the run has
    /// no figure of it.
    worst: Vec<(Option<f64>, Option<CheckpointFigure>)>,
}

impl DriveReport {
    fn begin(folder: &Path, manifest: Manifest, scenario: &Scenario) -> Result<Self> {
        write_json(&folder.join(MANIFEST), &manifest)?;
        Ok(Self {
            folder: folder.to_owned(),
            manifest,
            rows: TableWriter::create_both(folder, "rows")?,
            cells: TableWriter::create_both(folder, "cells")?,
            drives: TableWriter::create_both(folder, "drives")?,
            tracks: TableWriter::create_both(folder, "tracks")?,
            failures: TableWriter::create_both(folder, "failures")?,
            collected: ReportContent::default(),
            track: Vec::new(),
            plans: Vec::new(),
            worst: scenario.algorithms.iter().map(|_| (None, None)).collect(),
        })
    }

    /// Runs all drives, several at once; the sinks get them in order.
    fn drive_all(
        &mut self,
        plan: &EvaluationPlan<'_>,
        seeds: &[u64],
        mut earlier: EarlierDrives,
        console: &dyn Console,
    ) -> Result<()> {
        let (scenario, shard) = (plan.scenario, plan.shard);
        let algorithms = 0..scenario.algorithms.len();
        let courses = 0..seeds.len();
        let levels: Vec<_> = plan.stresses().collect();
        let units = courses.flat_map(|course| {
            let algorithms = algorithms.clone();
            levels.iter().flat_map(move |&stress| {
                algorithms.clone().map(move |algorithm| DriveUnit {
                    course,
                    stress,
                    algorithm,
                })
            })
        });
        let units = units.enumerate();
        let units = units.filter(|(i, _)| shard.is_none_or(|shard| shard.takes(*i)));
        let units: Vec<_> = units.map(|(_, unit)| unit).collect();
        let key = |unit: &DriveUnit| {
            let label = scenario.algorithms[unit.algorithm].label();
            (seeds[unit.course], label.to_owned(), unit.stress_text())
        };
        let known = units.iter().map(|unit| earlier.drives.remove(&key(unit)));
        let mut known: Vec<_> = known.collect();
        let todo: Vec<_> = (0..units.len()).filter(|&i| known[i].is_none()).collect();
        let work = DriveWork {
            scenario,
            seeds,
            courses: Courses::new(scenario, seeds, todo.iter().map(|&i| units[i].course)),
            manifest: self.manifest.clone(),
            folder: self.folder.clone(),
            keep: plan.keep_drives,
            bar: console.bar(
                &format!("score {}", scenario.name),
                Unit::Drives,
                Some(todo.len() as u64),
            ),
            frames: AtomicU64::new(0),
            is_over: AtomicBool::new(false),
        };
        let next = AtomicUsize::new(0);
        let ran = std::thread::scope(|scope| {
            let (send, received) = channel();
            let cores = std::thread::available_parallelism().map_or(1, usize::from);
            for _ in 0..cores.min(todo.len()) {
                let send = send.clone();
                let (next, todo, units, work) = (&next, &todo, &units, &work);
                scope.spawn(move || {
                    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
                    let pool = pool.expect("a thread can be started");
                    while let Some(&i) = todo.get(next.fetch_add(1, Ordering::Relaxed)) {
                        let driven = pool.install(|| work.drive(units[i]));
                        // Not received any more once one has failed.
                        if work.is_over() || send.send((i, driven)).is_err() {
                            break;
                        }
                    }
                });
            }
            drop(send);
            let ran = units.iter().enumerate().try_for_each(|(i, unit)| {
                while known[i].is_none() {
                    // The threads ended early.
                    let Ok((j, driven)) = received.recv() else {
                        return Err(Error::Invalid(
                            "interrupted; --resume continues after the complete drives".to_owned(),
                        ));
                    };
                    known[j] = Some(driven?);
                }
                let result = known[i].take().unwrap_or_default();
                self.take(*unit, result)
            });
            work.is_over.store(true, Ordering::Relaxed);
            // Complete drives after a missing one are kept, too.
            for (i, driven) in received.try_iter() {
                known[i] = driven.ok();
            }
            let mut rest = units.iter().zip(&mut known);
            let kept = rest.try_for_each(|(unit, known)| {
                known
                    .take()
                    .map_or(Ok(()), |result| self.take(*unit, result))
            });
            ran.and(kept)
        });
        let built = work.courses.into_plans();
        let is_new = |plan: &CoursePlan| built.iter().all(|built| built.seed != plan.seed);
        let mut plans: Vec<_> = earlier.plans.into_iter().filter(is_new).collect();
        plans.extend(built);
        for row in &self.collected.drives {
            if plans.iter().all(|plan| plan.seed != row.seed) {
                plans.push(Course::of_scenario(scenario, row.seed)?.plan());
            }
        }
        let place = |plan: &CoursePlan| seeds.iter().position(|seed| *seed == plan.seed);
        plans.sort_by_key(place);
        self.plans = plans;
        ran
    }

    /// Takes a drive; its own row is written last, so that its presence proves that the others are
    /// complete.
    fn take(&mut self, unit: DriveUnit, result: DriveResult) -> Result<()> {
        let DriveResult {
            drives,
            track,
            rows,
            cells,
            worst,
            failures,
            ..
        } = result;
        let fastest = &mut self.worst[unit.algorithm];
        let hits = track.iter();
        let hits = hits.filter(|row| row.event.as_deref() == Some("collision"));
        let speed = hits.map(|row| row.speed_m_per_s).reduce(f64::max);
        if unit.stress.is_none() && speed > fastest.0 {
            *fastest = (speed, worst.map(|(_, figure)| figure));
        }
        if let Some(last) = failures.last() {
            let record = &mut self.manifest.algorithms[unit.algorithm];
            record.failed_pairs += failures.len() as u64;
            record.failure = Some(last.reason.clone());
        }
        self.cells.push(cells)?;
        self.rows.push(rows.iter().cloned())?;
        self.failures.push(failures)?;
        self.tracks.push(track.iter().cloned())?;
        self.drives.push(drives.iter().cloned())?;
        self.collected.rows.extend(rows);
        self.collected.drives.extend(drives);
        self.track.extend(track);
        Ok(())
    }

    fn finish(
        mut self,
        plan: &EvaluationPlan<'_>,
        ending: RunEnding,
        console: &dyn Console,
    ) -> Result<(Summary, Vec<GateResult>)> {
        self.cells.finish()?;
        self.rows.finish()?;
        self.tracks.finish()?;
        self.failures.finish()?;
        self.drives.finish()?;
        write_json(&self.folder.join(COURSES), &self.plans)?;
        self.collected.maps = maps(&self.plans, &self.collected.drives, &self.track);
        let worst = self.worst.into_iter();
        self.collected.pictures = ReportPictures {
            figures: worst.filter_map(|(_, figure)| figure).collect(),
            scenes: Vec::new(),
        };
        let (head, content) = (plan.head(false), self.collected);
        content.write(&self.folder, head, self.manifest, ending, console)
    }
}

/// State that the threads share.
struct DriveWork<'a> {
    scenario: &'a Scenario,
    seeds: &'a [u64],
    courses: Courses<'a>,
    manifest: Manifest,
    folder: PathBuf,
    keep: bool,
    bar: Box<dyn Bar>,
    frames: AtomicU64,
    is_over: AtomicBool,
}

impl DriveWork<'_> {
    fn is_over(&self) -> bool {
        self.is_over.load(Ordering::Relaxed) || interrupt::requested()
    }

    fn drive(&self, unit: DriveUnit) -> Result<DriveResult> {
        let course = self.courses.get(unit.course)?;
        let seed = self.seeds[unit.course];
        let name = recording_name(self.scenario, seed, unit);
        let recording = self.keep.then(|| self.folder.join(name));
        let plan = DrivePlan {
            scenario: self.scenario,
            manifest: &self.manifest,
            course: &course,
            algorithm: &self.scenario.algorithms[unit.algorithm],
            stress: unit.stress,
            recording: recording.as_deref(),
        };
        let driven = plan.drive(&mut DriveMonitor(self));
        drop(course);
        self.courses.done(unit.course);
        self.bar.step();
        let is_whole = matches!(&driven, Ok(result) if !result.interrupted);
        if let Some(path) = recording.filter(|_| !is_whole) {
            // A part of a drive is useless.
            let _ = std::fs::remove_file(path);
        }
        driven
    }
}

/// Watches one of the drives.
struct DriveMonitor<'a>(&'a DriveWork<'a>);

impl Monitor for DriveMonitor<'_> {
    fn go_on(&mut self, _: u64) -> bool {
        let frames = self.0.frames.fetch_add(1, Ordering::Relaxed) + 1;
        if frames.is_multiple_of(16) {
            self.0.bar.show(frames.to_string());
        }
        !self.0.is_over()
    }
}

/// The courses of the drives at hand: built when the first of their drives begins, and dropped
/// after the last, as each holds its pictures.
struct Courses<'a> {
    scenario: &'a Scenario,
    seeds: &'a [u64],
    slots: Vec<Mutex<CourseSlot>>,
}

#[derive(Default)]
struct CourseSlot {
    course: Option<Arc<Course>>,
    plan: Option<CoursePlan>,
    drives_left: usize,
}

impl<'a> Courses<'a> {
    /// `drives`: the place of the course of each drive.
    fn new(scenario: &'a Scenario, seeds: &'a [u64], drives: impl Iterator<Item = usize>) -> Self {
        let mut slots: Vec<_> = seeds.iter().map(|_| CourseSlot::default()).collect();
        drives.for_each(|course| slots[course].drives_left += 1);
        Self {
            scenario,
            seeds,
            slots: slots.into_iter().map(Mutex::new).collect(),
        }
    }

    fn slot(&self, place: usize) -> MutexGuard<'_, CourseSlot> {
        self.slots[place]
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }

    fn get(&self, place: usize) -> Result<Arc<Course>> {
        let mut slot = self.slot(place);
        if let Some(course) = &slot.course {
            return Ok(Arc::clone(course));
        }
        let course = Arc::new(Course::of_scenario(self.scenario, self.seeds[place])?);
        slot.plan = Some(course.plan());
        slot.course = Some(Arc::clone(&course));
        Ok(course)
    }

    fn done(&self, place: usize) {
        let mut slot = self.slot(place);
        slot.drives_left -= 1;
        if slot.drives_left == 0 {
            slot.course = None;
        }
    }

    fn into_plans(self) -> Vec<CoursePlan> {
        let slots = self.slots.into_iter();
        let slots = slots.map(|slot| slot.into_inner().unwrap_or_else(PoisonError::into_inner));
        slots.filter_map(|slot| slot.plan).collect()
    }
}
