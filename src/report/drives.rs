//! Drives in numbers: a row per course and algorithm, a row per place on the way, and per algorithm
//! the sums with intervals over the courses.

use super::rows::record;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use svl_score::bootstrap::{Interval, Resamples, Sample};
use svl_score::judge::{DriveNumber, Metric, MetricOrigin};

record! {
    /// One drive: a course with an algorithm at the wheel.
    DriveRow {
        /// Name of the scenario.
        scenario: String,
        /// Seed of the course.
        seed: u64,
        /// Label of the algorithm, as `v3:max_disparity=64`.
        algorithm: String,
        /// The goal was reached without a collision and without help.
        finished: bool,
        /// The goal was reached in time, with help or without.
        arrived: bool,
        /// Collisions on the course.
        collisions: u64,
        /// Near misses on the course.
        near_misses: u64,
        /// Number of times that the robot came no farther and was set back on the route.
        stuck: u64,
        /// Distance that the robot drove itself.
        driven_m: f64,
        /// Distance driven until the first collision, if there was one.
        first_collision_m: Option<f64>,
        /// Duration of the drive.
        duration_s: f64,
        /// Time in which the robot did not move, for instance while it turned on the spot.
        stood_s: f64,
        /// Number of pairs of the drive.
        frames: u64,
        /// Number of frames on which the algorithm failed, so that the last command held.
        failures: u64,
        /// Digest of the track, equal for equal drives.
        track_hash: String,
        /// File of its recording in the report's folder, if it was kept.
        recording: Option<String>,
        /// Perturbation of its pairs, as `row_offset=2`; absent for unperturbed ones.
        stress: Option<String>,
    }
}

record! {
    /// The robot at a frame of a drive.
    TrackRow {
        /// Name of the scenario.
        scenario: String,
        /// Seed of the arena or of the course; absent for recordings.
        seed: u64,
        /// Label of the algorithm, as `v3:max_disparity=64`.
        algorithm: String,
        /// Number of the pair in its run.
        sequence: u64,
        /// Position to the right of the middle of the start.
        x_m: f64,
        /// Position ahead of the start.
        y_m: f64,
        /// Direction of travel, atan2(y, x), radians.
        heading: f64,
        /// Mean speed since the last frame.
        speed_m_per_s: f64,
        /// Least distance between the body and any obstacle since the last frame.
        clearance_m: f64,
        /// True if the robot was set back to this place, after a collision or when it was stuck.
        placed: bool,
        /// Event: `collision`, `near_miss`, `stuck`, or absent.
        event: Option<String>,
        /// Obstacles that the robot touched or nearly touched.
        with: Option<String>,
        /// Perturbation of the pairs of the drive.
        stress: Option<String>,
    }
}

/// A course as a map shows it. Points are metres, x to the right, y ahead.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CoursePlan {
    pub seed: u64,
    pub width_m: f64,
    pub length_m: f64,
    /// `y` of the goal line.
    pub goal_m: f64,
    /// Horizontal field of view of the robot's camera.
    pub field_of_view_deg: f64,
    /// Closed outlines of the obstacles.
    pub outlines: Vec<Vec<[f64; 2]>>,
    /// The way of the driver with perfect sight.
    pub route: Vec<[f64; 2]>,
    /// Number of layouts rejected before this one.
    pub rejected: u32,
}

/// The drives of an algorithm. An interval is the middle 95 % of resamples of the courses; absent
/// for fewer than eight.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DriveSummary {
    pub algorithm: String,
    pub courses: u64,
    pub finished: u64,
    pub finished_interval: Option<Interval>,
    pub collisions: u64,
    /// Per 100 m driven.
    pub collisions_per_100m: f64,
    pub collisions_interval: Option<Interval>,
    pub near_misses_per_100m: f64,
    pub near_misses_interval: Option<Interval>,
    pub stuck: u64,
    /// Mean distance driven until the first collision; a drive without one counts with all of its
    /// distance, so that it is a lower bound.
    pub first_collision_m: f64,
    pub first_collision_interval: Option<Interval>,
    /// Distance over time, standing included.
    pub speed_m_per_s: f64,
    /// Fraction of the time in which the robot did not move.
    pub stood_share: f64,
}

impl DriveSummary {
    /// Fraction of the courses that were finished; an algorithm has one drive or more.
    pub fn finished_share(&self) -> f64 {
        self.finished as f64 / self.courses as f64
    }
}

/// Sums over an algorithm's drives with pairs of that `stress`; in the order in which the
/// algorithms first appear.
pub(super) fn summarize(rows: &[DriveRow], stress: Option<&str>) -> Vec<DriveSummary> {
    let mut by_algorithm: BTreeMap<usize, Vec<&DriveRow>> = BTreeMap::new();
    let mut names: Vec<&str> = Vec::new();
    for row in rows.iter().filter(|row| row.stress.as_deref() == stress) {
        let place = names.iter().position(|name| *name == row.algorithm);
        let place = place.unwrap_or_else(|| {
            names.push(&row.algorithm);
            names.len() - 1
        });
        by_algorithm.entry(place).or_default().push(row);
    }
    by_algorithm
        .into_values()
        .map(|rows| summary(&rows))
        .collect()
}

fn summary(rows: &[&DriveRow]) -> DriveSummary {
    let resamples = Resamples::draw(&[rows.len()], true);
    // A robot that never moved has no rate.
    let both = |part: fn(&DriveRow) -> f64, by: fn(&DriveRow) -> f64, scale: f64| {
        let ratio = Sample::Ratio(rows.iter().map(|row| [part(row), by(row)]).collect());
        let value = ratio.total().unwrap_or_default() * scale;
        let interval = ratio.interval(&resamples);
        (
            value,
            interval.map(|(low, high)| (low * scale, high * scale)),
        )
    };
    let one = |_: &DriveRow| 1.0;
    let (_, finished_interval) = both(|row| f64::from(u8::from(row.finished)), one, 1.0);
    let (collisions_per_100m, collisions_interval) =
        both(|row| row.collisions as f64, |row| row.driven_m, 100.0);
    let (near_misses_per_100m, near_misses_interval) =
        both(|row| row.near_misses as f64, |row| row.driven_m, 100.0);
    let (first_collision_m, first_collision_interval) = both(
        |row| row.first_collision_m.unwrap_or(row.driven_m),
        one,
        1.0,
    );
    DriveSummary {
        algorithm: rows[0].algorithm.clone(),
        courses: rows.len() as u64,
        finished: rows.iter().filter(|row| row.finished).count() as u64,
        finished_interval,
        collisions: rows.iter().map(|row| row.collisions).sum(),
        collisions_per_100m,
        collisions_interval,
        near_misses_per_100m,
        near_misses_interval,
        stuck: rows.iter().map(|row| row.stuck).sum(),
        first_collision_m,
        first_collision_interval,
        speed_m_per_s: both(|row| row.driven_m, |row| row.duration_s, 1.0).0,
        stood_share: both(|row| row.stood_s, |row| row.duration_s, 1.0).0,
    }
}

/// A metric of an algorithm's unperturbed drives, by the seeds of their courses.
pub(super) fn sample(metric: &Metric, label: &str, rows: &[DriveRow]) -> Option<Sample> {
    let MetricOrigin::Drives(number) = metric.origin else {
        return None;
    };
    let own = rows
        .iter()
        .filter(|row| row.algorithm == label && row.stress.is_none());
    let own: BTreeMap<u64, &DriveRow> = own.map(|row| (row.seed, row)).collect();
    Some(drive_sample(number, own.into_values()))
}

/// A metric of these drives.
pub(super) fn drive_sample<'a>(
    number: DriveNumber,
    rows: impl Iterator<Item = &'a DriveRow>,
) -> Sample {
    Sample::Ratio(rows.map(|row| drive_parts(number, row)).collect())
}

/// The number of a drive, and what it is divided by.
pub(super) fn drive_parts(number: DriveNumber, row: &DriveRow) -> [f64; 2] {
    match number {
        DriveNumber::Finished => [f64::from(u8::from(row.finished)), 1.0],
        DriveNumber::Collisions => [row.collisions as f64, row.driven_m / 100.0],
        DriveNumber::NearMisses => [row.near_misses as f64, row.driven_m / 100.0],
    }
}
