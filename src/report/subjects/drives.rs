//! Drives in numbers: a row per course and algorithm, a row per place on the way, and per algorithm
//! the sums with intervals over the courses.

use crate::rows::records::record;
use crate::rows::samples::grouped;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use svl_score::bootstrap::{Interval, RunLengths, Sample};
use svl_score::judge::{Cases, DriveNumber, Measured, Metric, MetricOrigin, MetricUnit};

/// Outlines and routes of the courses.
pub(crate) const COURSES: &str = "courses.json";

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
        /// Length of the route that the robot drove itself; what it drove twice counts once.
        route_m: f64,
        /// Length of the route, that of the driver with perfect sight.
        course_m: f64,
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
        /// Number of pairs that arrived while the algorithm was busy, and that it skipped.
        skipped: u64,
        /// Latency of the scenario, from a pair's stamp until its command takes effect; without one
        /// it is the time from pair to pair.
        latency_ms: Option<f64>,
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
        /// True if the algorithm was busy with an earlier pair and skipped this one.
        skipped: bool,
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
    /// Courses whose goal was not reached before the pairs ended.
    pub late: u64,
    pub collisions: u64,
    /// Per 100 m driven; absent, as all that is per distance, of a robot that drove less than 1 m.
    pub collisions_per_100m: Option<f64>,
    pub collisions_interval: Option<Interval>,
    pub near_misses_per_100m: Option<f64>,
    pub near_misses_interval: Option<Interval>,
    pub stuck: u64,
    /// Length of the route that the robot drove itself, and of the whole route: means over the
    /// courses.
    pub route_m: f64,
    pub course_m: f64,
    /// False for too little of it: nothing is said of the robot.
    pub has_driven: bool,
    /// Mean distance driven until the first collision; a drive without one counts with all of its
    /// distance, so that it is a lower bound.
    pub first_collision_m: f64,
    pub first_collision_interval: Option<Interval>,
    /// Distance over time, standing included.
    pub speed_m_per_s: f64,
    /// Fraction of the time in which the robot did not move.
    pub stood_share: f64,
    /// Fraction of the pairs that arrived while the algorithm was busy.
    pub skipped_share: f64,
    /// Latency of the scenario; absent without one.
    pub latency_ms: Option<f64>,
    /// Time from pair to pair; absent where no drive has two.
    pub period_ms: Option<f64>,
}

impl DriveSummary {
    /// Fraction of the courses that were finished; an algorithm has one drive or more.
    pub fn finished_share(&self) -> f64 {
        self.finished as f64 / self.courses as f64
    }
}

/// Fraction of the routes below which nothing is said of a robot: one that stands hits nothing.
pub(crate) const MIN_DRIVEN: f64 = 0.1;

/// True if a robot drove that much of the routes, in all of these drives together.
pub(crate) fn has_driven<'a>(rows: impl Iterator<Item = &'a DriveRow>) -> bool {
    let (route_m, course_m) = rows.fold((0.0, 0.0), |(route_m, course_m), row| {
        (route_m + row.route_m, course_m + row.course_m)
    });
    route_m >= MIN_DRIVEN * course_m
}

/// Sums over an algorithm's drives with pairs of that `stress`; in the order in which the
/// algorithms first appear.
pub(crate) fn summarize(rows: &[DriveRow], stress: Option<&str>) -> Vec<DriveSummary> {
    let own = rows.iter().filter(|row| row.stress.as_deref() == stress);
    grouped(&own.collect::<Vec<_>>(), |row| &row.algorithm, summary)
}

fn summary(rows: &[&DriveRow]) -> DriveSummary {
    let runs = RunLengths::new(&[rows.len()], true);
    let ratio = |part: fn(&DriveRow) -> f64, by: fn(&DriveRow) -> f64| {
        let ratio = Sample::Ratio(rows.iter().map(|row| [part(row), by(row)]).collect());
        (ratio.total(), ratio.interval(&runs))
    };
    let metric = |name| {
        let metric = Metric::find(name)?;
        let own = || rows.iter().copied();
        let value = metric.value_of(measured(metric, own())?)?;
        Some((value, drive_sample(metric, own())?.interval(&runs)))
    };
    let mean = |part, by| ratio(part, by).0.unwrap_or_default();
    let one = |_: &DriveRow| 1.0;
    let [finished, collisions, near_misses] = ["finished", "collisions", "near_misses"].map(metric);
    let interval = |own: Option<(f64, Option<Interval>)>| own.and_then(|(_, interval)| interval);
    let (first_collision_m, first_collision_interval) =
        ratio(|row| row.first_collision_m.unwrap_or(row.driven_m), one);
    let frames = |row: &DriveRow| row.frames as f64;
    let periods = |row: &DriveRow| row.frames.saturating_sub(1) as f64;
    DriveSummary {
        algorithm: rows[0].algorithm.clone(),
        courses: rows.len() as u64,
        finished: rows.iter().filter(|row| row.finished).count() as u64,
        finished_interval: interval(finished),
        late: rows.iter().filter(|row| !row.arrived).count() as u64,
        collisions: rows.iter().map(|row| row.collisions).sum(),
        collisions_per_100m: collisions.map(|(value, _)| value),
        collisions_interval: interval(collisions),
        near_misses_per_100m: near_misses.map(|(value, _)| value),
        near_misses_interval: interval(near_misses),
        stuck: rows.iter().map(|row| row.stuck).sum(),
        route_m: mean(|row| row.route_m, one),
        course_m: mean(|row| row.course_m, one),
        has_driven: has_driven(rows.iter().copied()),
        first_collision_m: first_collision_m.unwrap_or_default(),
        first_collision_interval,
        speed_m_per_s: mean(|row| row.driven_m, |row| row.duration_s),
        stood_share: mean(|row| row.stood_s, |row| row.duration_s),
        skipped_share: mean(|row| row.skipped as f64, frames),
        latency_ms: rows[0].latency_ms,
        period_ms: ratio(|row| row.duration_s, periods).0.map(|s| 1.0e3 * s),
    }
}

/// A metric of an algorithm's unperturbed drives, by the seeds of their courses.
pub(crate) fn sample(metric: &Metric, label: &str, rows: &[DriveRow]) -> Option<Sample> {
    let own = rows.iter();
    let own = own.filter(|row| row.algorithm == label && row.stress.is_none());
    let own: BTreeMap<u64, &DriveRow> = own.map(|row| (row.seed, row)).collect();
    drive_sample(metric, own.into_values())
}

/// A metric of these drives, however few: a rate rests on the metres driven, others on courses.
pub(crate) fn measured<'a>(
    metric: &Metric,
    rows: impl Iterator<Item = &'a DriveRow> + Clone,
) -> Option<Measured> {
    let cases = match metric.unit {
        MetricUnit::Per100M => rows.clone().map(|row| row.driven_m).sum::<f64>() as u64,
        _ => rows.clone().count() as u64,
    };
    let (value, cases) = (drive_sample(metric, rows)?.total()?, Cases::items(cases));
    Some(Measured { value, cases })
}

/// The values of a metric of these drives; `None` for a metric of something else.
fn drive_sample<'a>(metric: &Metric, rows: impl Iterator<Item = &'a DriveRow>) -> Option<Sample> {
    let MetricOrigin::Drives(number) = metric.origin else {
        return None;
    };
    let parts = rows.map(|row| drive_parts(number, row));
    Some(Sample::Ratio(parts.collect()))
}

/// The number of a drive, and what it is divided by.
pub(crate) fn drive_parts(number: DriveNumber, row: &DriveRow) -> [f64; 2] {
    match number {
        DriveNumber::Finished => [f64::from(u8::from(row.finished)), 1.0],
        DriveNumber::Collisions => [row.collisions as f64, row.driven_m / 100.0],
        DriveNumber::NearMisses => [row.near_misses as f64, row.driven_m / 100.0],
        DriveNumber::Driven => [row.route_m, 1.0],
        DriveNumber::Late => [f64::from(u8::from(!row.arrived)), 1.0],
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::super::speed::tests::row;
    use super::*;
    use crate::results::summary::{ReportTables, ResultParts, Results, Shown};
    use crate::rows::held::Row;

    /// A course of 6 m that was finished, six pairs a second.
    pub(crate) fn drive(seed: u64, algorithm: &str) -> DriveRow {
        DriveRow {
            scenario: "d".into(),
            seed,
            algorithm: algorithm.into(),
            finished: true,
            arrived: true,
            collisions: 0,
            near_misses: 0,
            stuck: 0,
            driven_m: 6.0,
            route_m: 6.0,
            course_m: 6.0,
            first_collision_m: None,
            duration_s: 40.0,
            stood_s: 0.0,
            frames: 241,
            failures: 0,
            skipped: 0,
            latency_ms: None,
            track_hash: format!("{seed} {algorithm}"),
            recording: None,
            stress: None,
        }
    }

    /// The summary of drives whose algorithms take `ms` per pair.
    fn summary(drives: &[DriveRow], ms: u64) -> Results {
        let row = |drive: &DriveRow| Row {
            algorithm: drive.algorithm.clone(),
            ..row(1000 * ms, (64, 48), None)
        };
        let tables = ReportTables {
            rows: drives.iter().map(row).collect(),
            drives: drives.to_vec(),
            ..ReportTables::default()
        };
        Results::new(&tables, ResultParts::default(), Shown::default()).unwrap()
    }

    /// The drives of as many courses; on each, `a` finishes without a collision.
    fn courses(courses: u64, b: fn(&mut DriveRow)) -> Vec<DriveRow> {
        let both = |seed| {
            let mut other = drive(seed, "b");
            b(&mut other);
            [drive(seed, "a"), other]
        };
        (0..courses).flat_map(both).collect()
    }

    fn hits(row: &mut DriveRow) {
        (row.finished, row.collisions) = (false, 2);
    }

    #[test]
    fn the_best_of_drives_differs_over_eight_courses() {
        let best = |drives: &[DriveRow]| {
            let best = summary(drives, 1).best.into_iter();
            let words = best.map(|own| format!("{} by {}", own.algorithm, own.metric.name));
            words.collect::<Vec<_>>()
        };
        let both = ["a by finished", "a by collisions"];
        assert_eq!(best(&courses(8, hits)), both);
        // One of eight is no difference.
        let once = |row: &mut DriveRow| {
            if row.seed == 0 {
                hits(row);
            }
        };
        let alone = (0..8).map(|seed| drive(seed, "a")).collect();
        let [equal, once] = [|_: &mut DriveRow| (), once].map(|b| courses(8, b));
        for drives in [courses(7, hits), equal, once, alone] {
            assert!(best(&drives).is_empty(), "{drives:?}");
        }
        // The one that finishes nothing hits nothing here, and is not best; nor is one that hits
        // more.
        let late = |row: &mut DriveRow| (row.finished, row.arrived) = (false, false);
        let mut drives = courses(8, late);
        let is_own = |row: &&mut DriveRow| row.algorithm == "a" && row.seed < 7;
        drives.iter_mut().filter(is_own).for_each(hits);
        assert!(best(&drives).is_empty());
        let apart = "no algorithm that finishes is told apart from all others";
        let few = "3 of at least 8 courses; courses finished: a 100.0 %, b";
        for (drives, why) in [(drives, apart), (courses(3, hits), few)] {
            let words = summary(&drives, 1).answer().join(" ");
            let expected = format!("None is called best: {why}");
            assert!(words.starts_with(&expected), "{words}");
        }
    }

    #[test]
    fn a_robot_that_hardly_drives_is_not_compared() {
        let stands = |row: &mut DriveRow| (row.finished, row.route_m) = (false, 0.5);
        let stands = summary(&courses(8, stands), 1);
        assert_eq!(stands.best, []);
        assert_eq!(stands.headline().rows.len(), 2);
        let drives = |row: &mut DriveRow| (row.finished, row.route_m) = (false, 0.61);
        assert_eq!(summary(&courses(8, drives), 1).best.len(), 1);
    }

    #[test]
    fn a_rate_over_less_than_a_metre_is_not_measured() {
        let rates = |driven_m| {
            let row = DriveRow {
                driven_m,
                ..drive(1, "v3")
            };
            let own = summarize(&[row], None).remove(0);
            [own.collisions_per_100m, own.near_misses_per_100m]
        };
        assert_eq!([0.0, 0.99].map(rates), [[None; 2]; 2]);
        assert_eq!(rates(1.0), [Some(0.0); 2]);
        let metric = Metric::find("collisions").unwrap();
        let cases = measured(metric, [drive(1, "v3"), drive(2, "v3")].iter());
        let cases = cases.unwrap().cases;
        assert_eq!(metric.cases_words(&cases), "12 m driven");
    }

    #[test]
    fn pairs_that_were_skipped_are_a_fraction_of_all() {
        let busy = DriveRow {
            skipped: 80,
            frames: 160,
            latency_ms: Some(250.0),
            duration_s: 159.0 / 6.0,
            ..drive(2, "v3")
        };
        let idle = DriveRow {
            frames: 160,
            duration_s: 159.0 / 6.0,
            ..busy.clone()
        };
        let own = &summarize(&[busy, DriveRow { skipped: 0, ..idle }], None)[0];
        assert_eq!((own.skipped_share, own.latency_ms), (0.25, Some(250.0)));
        assert!((own.period_ms.unwrap() - 1000.0 / 6.0).abs() < 1e-9);
    }

    #[test]
    fn slow_algorithms_without_a_latency_are_named() {
        let with = |latency_ms| DriveRow {
            latency_ms,
            ..drive(1, "v3")
        };
        let cautions = |latency_ms, ms| summary(&[with(latency_ms)], ms).cautions();
        let words = "v3 takes 200 ms per pair and steers as if it took 167, the time from pair to \
                     pair; [drive] latency_ms sets what it takes on the robot";
        assert_eq!(cautions(None, 200), [words]);
        assert!(cautions(None, 166).is_empty());
        assert!(cautions(Some(200.0), 200).is_empty());
    }
}
