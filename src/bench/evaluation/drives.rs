//! The drives of a scenario: each course with each algorithm at the wheel, several at once.

use super::plan::EvaluationPlan;
use super::session::{EvaluationSession, MeasuredUnits};
use crate::console::{Bar, Console, Unit};
use crate::drive::{Course, DrivePlan, DriveResult};
use crate::pass::{Matchers, Monitor, Pace, in_own_pool, joined};
use crate::runs::refuse_recorded;
use parking_lot::{Mutex, MutexGuard};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use svl_core::{Error, Result, interrupt};
use svl_files::outputs::remove_file;
use svl_files::safe_name;
use svl_report::units::{BlockPictures, DriveFacts, ReportRun, UnitHeader, UnitRows, UnitWriter};
use svl_report::{CoursePlan, Row};
use svl_score::scenario::{Latency, Scenario, ScenarioSource};
use svl_sim::stress::Stress;

/// A drive of the scenario, by the places of course and algorithm in it.
#[derive(Clone, Copy)]
struct DriveUnit {
    /// Place of course and perturbation among all.
    run: usize,
    course: usize,
    stress: Option<Stress>,
    algorithm: usize,
}

/// The drives of the shard that the session does not have. `runs`: course and perturbation of each.
fn missing_units(
    plan: &EvaluationPlan<'_>,
    session: &EvaluationSession,
    runs: &[(usize, Option<Stress>)],
) -> Vec<DriveUnit> {
    let algorithms = &plan.scenario.algorithms;
    let is_missing = |unit: &DriveUnit| {
        let label = algorithms[unit.algorithm].label();
        session.runs[unit.run].unit(label, 0).is_none()
    };
    let units = runs.iter().enumerate().flat_map(|(run, (course, stress))| {
        (0..algorithms.len()).map(move |algorithm| DriveUnit {
            run,
            course: *course,
            stress: *stress,
            algorithm,
        })
    });
    let units = units.enumerate();
    let units = units.filter(|(i, _)| plan.shard.is_none_or(|shard| shard.takes(*i)));
    units.map(|(_, unit)| unit).filter(is_missing).collect()
}

/// Ends a drive after its first pair.
struct FirstPair;

impl Monitor for FirstPair {
    fn go_on(&mut self, _: u64) -> bool {
        false
    }
}

/// Matches the first pair of each drive again by each program that results are kept of, and
/// forgets them if an answer is another, or if it failed on a pair.
fn check_programs(
    plan: &EvaluationPlan<'_>,
    session: &mut EvaluationSession,
    runs: &[(usize, Option<Stress>)],
    seeds: &[u64],
) -> Result<()> {
    let algorithms = plan.scenario.algorithms.iter();
    for algorithm in algorithms.filter(|own| own.spec().is_program()) {
        let label = algorithm.label();
        for run in &mut session.runs {
            run.retain(|own, _, unit| own != label || !unit.has_failures());
        }
        for (i, (course, stress)) in runs.iter().enumerate() {
            let first = session.runs[i].unit(label, 0).map(|unit| unit.row(0));
            let Some(row) = first.transpose()?.flatten() else {
                continue;
            };
            let drive = DrivePlan {
                scenario: plan.scenario,
                manifest: &session.list.manifest,
                course: &Arc::new(Course::for_scenario(plan.scenario, seeds[*course])?),
                algorithm,
                latency_ms: None,
                stress: *stress,
                recording: None,
            };
            if interrupt::requested() {
                return Err(Error::Interrupted);
            }
            let driven = drive.drive(&mut FirstPair)?;
            let hash = driven.rows.first().map(|row| &row.result_hash);
            if hash != Some(&row.result_hash) {
                session.forget_algorithm(label, row.sequence);
                break;
            }
        }
    }
    Ok(())
}

/// The name of a drive's recording in its report.
fn recording_name(scenario: &Scenario, seed: u64, unit: DriveUnit) -> String {
    let label = scenario.algorithms[unit.algorithm].label();
    // No label in a name contains an equals sign.
    let stress = unit.stress.map(|stress| format!("-{stress}"));
    let stress = stress.unwrap_or_default();
    let safe = safe_name(label, 40);
    if safe == label {
        format!("course-{seed}-{label}{stress}.mcap")
    } else {
        // Two labels may differ only in characters that no file name may contain.
        format!("course-{seed}-{}-{safe}{stress}.mcap", unit.algorithm + 1)
    }
}

/// Drives what is missing of a scenario, several drives at once.
pub(super) fn measure(plan: &EvaluationPlan<'_>, console: &dyn Console) -> Result<MeasuredUnits> {
    let scenario = plan.scenario;
    let ScenarioSource::Drive {
        seeds,
        drive,
        config,
    } = &scenario.source
    else {
        let name = &scenario.name;
        return Err(Error::Invalid(format!("scenario '{name}' has no drives")));
    };
    refuse_recorded(&scenario.algorithms)?;
    let size = (config.rig.width_px, config.rig.height_px);
    let rig = config.rig.rectified()?;
    Matchers::new(&scenario.algorithms)?.warn_of_ranges(size, &rig, &scenario.judge());
    let mut manifest = plan.manifest(Pace::Asap)?;
    let jobs = plan.jobs(console);
    let while_others = || "matching while other drives run".to_owned();
    manifest.times = Some(jobs.map_or_else(while_others, |jobs| Pace::Jobs(jobs).times()));
    let levels: Vec<_> = plan.stresses().collect();
    let courses = 0..seeds.len();
    let runs = courses.flat_map(|course| levels.iter().map(move |stress| (course, *stress)));
    let runs: Vec<_> = runs.collect();
    let key = |(course, stress): &(usize, Option<Stress>)| ReportRun {
        run: None,
        seed: Some(seeds[*course]),
        stress: stress.map(|stress| stress.to_string()),
        ..ReportRun::default()
    };
    let keys = runs.iter().map(key).collect();
    let mut session = EvaluationSession::open(plan, manifest, keys)?;
    check_programs(plan, &mut session, &runs, seeds)?;
    session.begin()?;
    let todo = missing_units(plan, &session, &runs);
    if todo.is_empty() {
        return Ok(MeasuredUnits {
            ran: Ok(()),
            session,
            has_matched: false,
        });
    }
    session.write(&session.manifest())?;
    let title = format!("score {}", scenario.name);
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let work = DriveWork {
        scenario,
        seeds,
        latency: drive.latency_ms.as_ref(),
        courses: Courses::new(scenario, seeds, todo.iter().map(|unit| unit.course)),
        session: &session,
        folder: plan.folder,
        keep: plan.keep_drives,
        is_timed: jobs.is_none(),
        bar: console.bar(&title, Unit::Drives, Some(todo.len() as u64)),
        frames: AtomicU64::new(0),
        is_over: AtomicBool::new(false),
    };
    let ran = work.drive_all(&todo, jobs.unwrap_or(cores));
    drop(work);
    (0..runs.len()).try_for_each(|i| session.reload(i))?;
    Ok(MeasuredUnits {
        ran,
        session,
        has_matched: true,
    })
}

/// State that the threads share.
struct DriveWork<'a> {
    scenario: &'a Scenario,
    seeds: &'a [u64],
    latency: Option<&'a Latency>,
    courses: Courses<'a>,
    session: &'a EvaluationSession,
    folder: &'a Path,
    keep: bool,
    is_timed: bool,
    bar: Box<dyn Bar>,
    frames: AtomicU64,
    is_over: AtomicBool,
}

impl DriveWork<'_> {
    fn is_over(&self) -> bool {
        self.is_over.load(Ordering::Relaxed) || interrupt::requested()
    }

    /// Drives that many at once, up to the first error.
    fn drive_all(&self, todo: &[DriveUnit], jobs: usize) -> Result<()> {
        let next = AtomicUsize::new(0);
        let drive_on = || {
            while let Some(unit) = todo.get(next.fetch_add(1, Ordering::Relaxed)) {
                let driven = in_own_pool(|| self.drive(*unit));
                if driven.is_err() {
                    self.is_over.store(true, Ordering::Relaxed);
                }
                driven?;
                if self.is_over() {
                    break;
                }
            }
            Ok(())
        };
        let ended: Vec<Result<()>> = std::thread::scope(|scope| {
            let threads = (0..jobs.min(todo.len())).map(|_| scope.spawn(drive_on));
            let threads: Vec<_> = threads.collect();
            threads.into_iter().map(joined).collect()
        });
        ended.into_iter().fold(Ok(()), Result::and)?;
        if interrupt::requested() {
            return Err(Error::Invalid(
                "interrupted; the same command continues after the complete drives".to_owned(),
            ));
        }
        Ok(())
    }

    /// Drives, and writes the unit if the drive is whole.
    fn drive(&self, unit: DriveUnit) -> Result<()> {
        let course = self.courses.get(unit.course)?;
        let seed = self.seeds[unit.course];
        let name = recording_name(self.scenario, seed, unit);
        let path = self.folder.join(name);
        let recording = self.keep.then_some(&path);
        // An earlier recording of this drive.
        remove_file(&path)?;
        let algorithm = &self.scenario.algorithms[unit.algorithm];
        let plan = DrivePlan {
            scenario: self.scenario,
            manifest: &self.session.list.manifest,
            course: &course,
            algorithm,
            latency_ms: self.latency.and_then(|latency| latency.ms_for(algorithm)),
            stress: unit.stress,
            recording: recording.map(PathBuf::as_path),
        };
        let driven = plan.drive(&mut DriveMonitor(self));
        let course_plan = course.plan();
        drop(course);
        self.courses.done(unit.course);
        self.bar.step();
        match driven {
            Ok(result) if !result.interrupted => self.write(unit, result, course_plan),
            driven => {
                if let Some(path) = recording {
                    // A part of a drive is useless.
                    let _ = std::fs::remove_file(path);
                }
                driven.map(drop)
            }
        }
    }

    fn write(&self, unit: DriveUnit, mut result: DriveResult, course: CoursePlan) -> Result<()> {
        let label = self.scenario.algorithms[unit.algorithm].label();
        let (session, run) = (self.session, &self.session.runs[unit.run].run);
        let mut algorithms = session.list.algorithms_of(run).into_iter();
        let Some(algorithm) = algorithms.find(|own| own.label == label) else {
            return Ok(());
        };
        let name = algorithm.unit_name(0, &[]);
        session.units.run_folder(run)?;
        let path = session.units.unit_path(run, &name);
        let mut writer = UnitWriter::default();
        writer.header = UnitHeader {
            run: run.digest.clone(),
            name,
            label: label.to_owned(),
            session: session.id().to_owned(),
            has_pictures: true,
            drive: Some(DriveFacts { course }),
            ..UnitHeader::default()
        };
        if !self.is_timed {
            let pictured = result.worst.iter_mut();
            let pictured = pictured.flat_map(|(_, figure)| &mut figure.shots);
            let pictured = pictured.map(|(_, shot)| &mut shot.row);
            result
                .rows
                .iter_mut()
                .chain(pictured)
                .for_each(remove_times);
        }
        writer.push(&UnitRows {
            rows: result.rows,
            cells: result.cells,
            failures: result.failures,
            drives: result.drives,
            tracks: result.track,
            ..UnitRows::default()
        })?;
        let pictures = result.worst.map(|(_, figure)| BlockPictures {
            samples: vec![(0, figure)],
            ..BlockPictures::default()
        });
        writer.write(&path, pictures.as_ref())
    }
}

fn remove_times(row: &mut Row) {
    row.smoothing_us = None;
    row.texture_us = None;
    row.matching_us = None;
    row.checks_us = None;
    row.filters_us = None;
    row.total_us = None;
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
        self.slots[place].lock()
    }

    fn get(&self, place: usize) -> Result<Arc<Course>> {
        let mut slot = self.slot(place);
        if let Some(course) = &slot.course {
            return Ok(Arc::clone(course));
        }
        let course = Arc::new(Course::for_scenario(self.scenario, self.seeds[place])?);
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
}
