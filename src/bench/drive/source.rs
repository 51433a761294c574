//! A drive as a source that listens: every frame depends on the results of earlier ones.

use super::course::Course;
use crate::source::Source;
use parking_lot::Mutex;
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;
use svl_core::Result;
use svl_core::stereo::{DepthGrid, Frame, Pose};
use svl_score::drive::Steering;
use svl_score::drive::{DriveCommand, DriveEvent, DriveLog, RobotState, TrackPoint, advance};
use svl_score::judge::Judged;
use svl_sim::arena::{Gait, Twist};

/// Renders what the robot sees on its way through a course, steered by the algorithm of the run.
pub struct DriveSource {
    course: Arc<Course>,
    drive: Drive,
    gait: Gait,
    log: Arc<Mutex<DriveLog>>,
}

impl DriveSource {
    /// `latency_s`: time from the stamp of a pair until the command that was decided on it takes
    /// effect.
    pub fn new(course: &Arc<Course>, latency_s: f64) -> Self {
        Self {
            drive: Drive::new(course, latency_s),
            gait: course.gait(),
            course: Arc::clone(course),
            log: Arc::default(),
        }
    }

    /// Result of the drive, up to the frame given out last.
    pub fn log(&self) -> Arc<Mutex<DriveLog>> {
        Arc::clone(&self.log)
    }
}

impl Source for DriveSource {
    fn name(&self) -> String {
        format!("course {}", self.course.seed)
    }

    fn next(&mut self) -> Result<Option<Frame>> {
        let world = &self.course.world;
        if !self.drive.step(&self.course) {
            return Ok(None);
        }
        let mut log = self.log.lock();
        log.rate_hz = self.drive.log.rate_hz;
        log.arrived = self.drive.log.arrived;
        log.route_m = self.drive.log.route_m;
        log.track.extend(self.drive.log.track.last().cloned());
        let (pose, twist) = self.drive.view(&self.gait);
        world.frame(self.drive.sequence - 1, pose, &twist).map(Some)
    }

    /// Unknown: the drive ends at the goal.
    fn pairs(&self) -> Option<u64> {
        None
    }

    fn listens(&self) -> bool {
        true
    }

    fn hear(&mut self, judged: &Judged) {
        // An algorithm that skipped the frame or failed on it gives no command: the last one holds.
        if let Some(scored) = judged.estimates.first() {
            self.drive.decide(&self.course, &scored.estimate.grid);
        }
    }
}

/// The robot under way. It knows neither images nor algorithms.
pub(super) struct Drive {
    pub(super) robot: RobotState,
    /// The command in force, and the one that follows when the algorithm is ready.
    command: DriveCommand,
    decided: Option<DriveCommand>,
    /// Time from the stamp of a pair until its command takes effect, and the part of it that is
    /// left: as long the algorithm is busy.
    latency_s: f64,
    busy_s: f64,
    steering: Steering,
    /// Number of frames so far.
    sequence: u64,
    /// A near miss under way: the least clearance, the obstacle, and the place.
    near: Option<(f64, DriveEvent)>,
    /// The robot's position when it last made progress.
    anchor: RobotState,
    /// True after a collision or when stuck: the robot is set back before the next frame.
    is_to_be_placed: bool,
    /// The farthest place on the route so far, metres from its start.
    farthest_m: f64,
    pub(super) log: DriveLog,
}

/// A robot that stays within this distance is stuck.
const STUCK_M: f64 = 0.1;
/// Distance along the route that it is set back after a collision.
const PLACED_M: f64 = 0.3;
/// Shorter times are errors of rounding.
const INSTANT_S: f64 = 1.0e-9;

impl Drive {
    pub(super) fn new(course: &Course, latency_s: f64) -> Self {
        let robot = course.start();
        Self {
            robot,
            command: DriveCommand::default(),
            decided: None,
            latency_s,
            busy_s: 0.0,
            steering: Steering::new(&course.drive),
            sequence: 0,
            near: None,
            anchor: robot,
            is_to_be_placed: false,
            farthest_m: 0.0,
            log: DriveLog {
                rate_hz: course.rate_hz(),
                ..DriveLog::default()
            },
        }
    }

    /// Moves on to the next frame; false at the end of the drive.
    pub(super) fn step(&mut self, course: &Course) -> bool {
        if self.is_over(course) {
            return false;
        }
        let mut point = match self.sequence {
            0 => self.point(course.clearance_m(self.robot.at), 0.0, false, None),
            _ if std::mem::take(&mut self.is_to_be_placed) => self.placed(course),
            _ => self.moved(course),
        };
        self.log.arrived = self.robot.at.y >= course.goal_m();
        self.sequence += 1;
        if self.is_over(course) && point.event.is_none() {
            point.event = self.near_miss();
        }
        let along_m = course.along_m(self.robot.at);
        if !point.is_placed {
            self.log.route_m += (along_m - self.farthest_m).max(0.0);
        }
        self.farthest_m = self.farthest_m.max(along_m);
        if !point.is_skipped {
            self.busy_s = self.latency_s;
        }
        self.log.track.push(point);
        true
    }

    fn is_over(&self, course: &Course) -> bool {
        self.log.arrived || self.sequence >= course.frames()
    }

    /// The near miss under way, which is over now.
    fn near_miss(&mut self) -> Option<DriveEvent> {
        self.near.take().map(|(_, event)| event)
    }

    fn point(
        &self,
        clearance_m: f64,
        speed_m_per_s: f64,
        is_placed: bool,
        event: Option<DriveEvent>,
    ) -> TrackPoint {
        TrackPoint {
            sequence: self.sequence,
            at_m: self.robot.at.into(),
            heading: self.robot.heading,
            speed_m_per_s,
            clearance_m,
            is_placed,
            is_skipped: self.busy_s > 0.0,
            event,
        }
    }

    /// Sets the robot back on the route, beyond the obstacle.
    fn placed(&mut self, course: &Course) -> TrackPoint {
        let time_s = self.robot.time_s + course.frame_s();
        self.robot = RobotState {
            time_s,
            ..course.route_after(self.robot.at, PLACED_M)
        };
        self.anchor = self.robot;
        self.stop();
        self.wait(course.frame_s());
        self.steering = Steering::new(&course.drive);
        let event = self.near_miss();
        self.point(course.clearance_m(self.robot.at), 0.0, true, event)
    }

    /// No command is in force, and none follows.
    fn stop(&mut self) {
        (self.command, self.decided) = (DriveCommand::default(), None);
    }

    /// Lets time pass for the algorithm; when it is ready, its command is in force.
    fn wait(&mut self, seconds: f64) {
        self.busy_s -= seconds;
        if self.busy_s < INSTANT_S {
            self.busy_s = 0.0;
            self.command = self.decided.take().unwrap_or(self.command);
        }
    }

    /// Moves to the time of the next frame, until something is touched. Returns the distance driven
    /// and the least clearance with the nearest object.
    fn travel<'c>(&mut self, course: &'c Course) -> (f64, (f64, &'c str)) {
        let (config, frame_s) = (&course.drive, course.frame_s());
        let until_ready_s = self.busy_s.min(frame_s);
        let (mut driven_m, mut least) = (0.0, (f64::INFINITY, ""));
        let mut state = self.robot;
        for seconds in [until_ready_s, frame_s - until_ready_s] {
            // Not after a collision.
            if seconds >= INSTANT_S && least.0 > 0.0 {
                let (next, by_m, nearest) =
                    advance(&course.world, config, state, self.command, seconds);
                (state, driven_m) = (next, driven_m + by_m);
                least = if nearest.0 < least.0 { nearest } else { least };
            }
            self.wait(seconds);
        }
        self.robot = RobotState {
            time_s: self.robot.time_s + frame_s,
            ..state
        };
        (driven_m, least)
    }

    fn moved(&mut self, course: &Course) -> TrackPoint {
        let (driven_m, (clearance_m, name)) = self.travel(course);
        let (config, state) = (&course.drive, self.robot);
        let at_m: [f64; 2] = state.at.into();
        let mut event = None;
        if clearance_m <= 0.0 {
            let with = name.to_owned();
            event = Some(DriveEvent::Collision { with, at_m });
            self.near = None;
            self.is_to_be_placed = true;
            // The robot is where it touched something.
            self.stop();
        } else if clearance_m >= config.near_miss_m {
            // The near miss is over, and nothing was touched.
            event = self.near_miss();
        } else if self.near.as_ref().is_none_or(|near| clearance_m < near.0) {
            let to = name.to_owned();
            self.near = Some((clearance_m, DriveEvent::NearMiss { to, at_m }));
        }
        if (state.at - self.anchor.at).norm() > STUCK_M {
            self.anchor = state;
        } else if state.time_s - self.anchor.time_s >= config.stuck_s && event.is_none() {
            event = Some(DriveEvent::Stuck { at_m });
            self.is_to_be_placed = true;
        }
        self.point(clearance_m, driven_m / course.frame_s(), false, event)
    }

    /// Takes the grid of the frame given out last.
    pub(super) fn decide(&mut self, course: &Course, grid: &DepthGrid) {
        let then = self.robot.after(self.command, self.latency_s);
        let world = &course.world;
        let width_px = world.config().rig.width_px;
        // The goal is at the end of the arena's length.
        let goal = FRAC_PI_2;
        let eye = (&world.rig(), width_px);
        let command = self.steering.decide(grid, eye, [&self.robot, &then], goal);
        self.decided = Some(command);
    }

    /// Pose and velocity of the left camera.
    pub(super) fn view(&self, gait: &Gait) -> (Pose, Twist) {
        let (robot, command) = (self.robot, self.command);
        let pose = |time_s: f64| {
            let state = robot.after(command, time_s - robot.time_s);
            gait.pose(state.at, state.heading, time_s)
        };
        (pose(robot.time_s), Twist::new(pose, robot.time_s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::depth::{GridSettings, grid};
    use svl_score::scenario::DriveConfig;
    use svl_sim::arena::ArenaConfig;

    fn course() -> Course {
        let mut arena = ArenaConfig {
            rate_hz: 8.0,
            ..ArenaConfig::default()
        };
        (arena.rig.width_px, arena.rig.height_px) = (80, 60);
        let settings = GridSettings::default();
        Course::new(&arena, &DriveConfig::default(), settings, 3).unwrap()
    }

    /// The first frames with exact grids, and a latency in periods.
    fn driven(course: &Course, frames: usize, periods: f64) -> DriveLog {
        let settings = GridSettings::default();
        let (gait, rig) = (course.gait(), course.world.rig());
        let mut drive = Drive::new(course, periods * course.frame_s());
        for _ in 0..frames {
            assert!(drive.step(course));
            if !drive.log.track.last().unwrap().is_skipped {
                let (pose, _) = drive.view(&gait);
                let disparity = course.world.disparity(&pose).unwrap();
                drive.decide(course, &grid(&disparity, settings, Some(&rig)));
            }
        }
        drive.log
    }

    #[test]
    fn a_command_takes_effect_after_the_latency_and_other_pairs_are_skipped() {
        let course = course();
        let full = 0.3;
        // The speed until each frame: the decision on the first one is to drive on.
        for (periods, speeds, skipped) in [
            (0.0, [0.0, full, full, full, full], [false; 5]),
            (0.25, [0.0, 0.75 * full, full, full, full], [false; 5]),
            (1.0, [0.0, 0.0, full, full, full], [false; 5]),
            (
                1.5,
                [0.0, 0.0, 0.5 * full, full, full],
                [false, true, false, true, false],
            ),
            (
                3.0,
                [0.0, 0.0, 0.0, 0.0, full],
                [false, true, true, false, true],
            ),
        ] {
            let log = driven(&course, 5, periods);
            let near =
                |(point, speed): (&TrackPoint, f64)| (point.speed_m_per_s - speed).abs() < 1.0e-9;
            assert!(log.track.iter().zip(speeds).all(near), "{periods}: {log:?}");
            let are: Vec<_> = log.track.iter().map(|point| point.is_skipped).collect();
            assert_eq!(are, skipped, "{periods}");
            assert_eq!(
                log.skipped(),
                skipped.iter().filter(|is| **is).count() as u64
            );
            // The route advances by the distance that was driven.
            assert!((log.route_m - log.driven_m()).abs() < 0.05, "{periods}");
        }
    }

    #[test]
    fn the_way_back_is_not_driven_twice() {
        let course = course();
        let mut drive = Drive::new(&course, course.frame_s());
        for speed_m_per_s in [0.3, 0.3, 0.3, 0.3, -0.3, -0.3, 0.3, 0.3] {
            drive.command = DriveCommand {
                speed_m_per_s,
                ..DriveCommand::default()
            };
            assert!(drive.step(&course));
        }
        // Three steps ahead, two back, and two to where it was; none before the first frame.
        let step_m = 0.3 * course.frame_s();
        let log = &drive.log;
        assert!(
            (log.route_m - 3.0 * step_m).abs() < step_m,
            "{}",
            log.route_m
        );
    }
}
