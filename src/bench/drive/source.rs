//! A drive as a source that listens: every frame depends on the results of the last one.

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
    pub fn new(course: &Arc<Course>) -> Self {
        Self {
            drive: Drive::new(course),
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
        format!("course {}", self.course.seed())
    }

    fn next(&mut self) -> Result<Option<Frame>> {
        let world = self.course.world();
        if !self.drive.step(&self.course) {
            return Ok(None);
        }
        let mut log = self.log.lock();
        log.rate_hz = self.drive.log.rate_hz;
        log.arrived = self.drive.log.arrived;
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
        // An algorithm that failed on the frame gives no command: the last one holds.
        if let Some(scored) = judged.estimates.first() {
            self.drive.decide(&self.course, &scored.estimate.grid);
        }
    }
}

/// The robot under way. It knows neither images nor algorithms.
pub(super) struct Drive {
    robot: RobotState,
    /// The command in force, and the one that follows.
    commands: [DriveCommand; 2],
    steering: Steering,
    /// Number of frames so far.
    sequence: u64,
    /// A near miss under way: the least clearance, the obstacle, and the place.
    near: Option<(f64, DriveEvent)>,
    /// The robot's position when it last made progress.
    anchor: RobotState,
    /// True after a collision or when stuck: the robot is set back before the next frame.
    is_to_be_placed: bool,
    pub(super) log: DriveLog,
}

/// A robot that stays within this distance is stuck.
const STUCK_M: f64 = 0.1;
/// Distance along the route that it is set back after a collision.
const PLACED_M: f64 = 0.3;

impl Drive {
    pub(super) fn new(course: &Course) -> Self {
        let robot = course.start();
        Self {
            robot,
            commands: [DriveCommand::default(); 2],
            steering: Steering::new(course.drive()),
            sequence: 0,
            near: None,
            anchor: robot,
            is_to_be_placed: false,
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
        self.log.arrived = course.is_goal(self.robot.at);
        self.sequence += 1;
        if self.is_over(course) && point.event.is_none() {
            point.event = self.near_miss();
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
        self.commands = [DriveCommand::default(); 2];
        self.steering = Steering::new(course.drive());
        let event = self.near_miss();
        self.point(course.clearance_m(self.robot.at), 0.0, true, event)
    }

    fn moved(&mut self, course: &Course) -> TrackPoint {
        let (command, frame_s) = (self.commands[0], course.frame_s());
        self.commands[0] = self.commands[1];
        let config = course.drive();
        let (state, driven_m, (clearance_m, name)) =
            advance(course.world(), config, self.robot, command, frame_s);
        self.robot = state;
        let at_m: [f64; 2] = state.at.into();
        let mut event = None;
        if clearance_m <= 0.0 {
            let with = name.to_owned();
            event = Some(DriveEvent::Collision { with, at_m });
            self.near = None;
            self.is_to_be_placed = true;
            // The robot is where it touched something.
            self.commands = [DriveCommand::default(); 2];
        } else if clearance_m >= config.near_miss_m {
            // The near miss is over, and nothing was touched.
            event = self.near_miss();
        } else if self
            .near
            .as_ref()
            .is_none_or(|(least_m, _)| clearance_m < *least_m)
        {
            let to = name.to_owned();
            self.near = Some((clearance_m, DriveEvent::NearMiss { to, at_m }));
        }
        if (state.at - self.anchor.at).norm() > STUCK_M {
            self.anchor = state;
        } else if state.time_s - self.anchor.time_s >= config.stuck_s && event.is_none() {
            event = Some(DriveEvent::Stuck { at_m });
            self.is_to_be_placed = true;
        }
        self.point(clearance_m, driven_m / frame_s, false, event)
    }

    /// Takes the grid of the frame given out last.
    pub(super) fn decide(&mut self, course: &Course, grid: &DepthGrid) {
        let then = self.robot.after(self.commands[0], course.frame_s());
        let world = course.world();
        let width_px = world.config().rig.width_px;
        // The goal is at the end of the arena's length.
        let goal = FRAC_PI_2;
        let eye = (&world.rig(), width_px);
        self.commands[1] = self.steering.decide(grid, eye, [&self.robot, &then], goal);
    }

    /// Pose and velocity of the left camera.
    pub(super) fn view(&self, gait: &Gait) -> (Pose, Twist) {
        let (robot, command) = (self.robot, self.commands[0]);
        let pose = |time_s: f64| {
            let state = robot.after(command, time_s - robot.time_s);
            gait.pose(state.at, state.heading, time_s)
        };
        (pose(robot.time_s), Twist::new(pose, robot.time_s))
    }

    pub(super) fn robot(&self) -> RobotState {
        self.robot
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::depth::{GridSettings, grid};
    use svl_score::scenario::DriveConfig;
    use svl_sim::arena::ArenaConfig;

    #[test]
    fn a_command_is_delayed_by_one_frame() {
        let mut arena = ArenaConfig::default();
        (arena.rig.width_px, arena.rig.height_px) = (80, 60);
        let settings = GridSettings::default();
        let course = Course::new(&arena, &DriveConfig::default(), settings, 3).unwrap();
        let (gait, rig) = (course.gait(), course.world().rig());
        let mut drive = Drive::new(&course);
        for _ in 0..3 {
            assert!(drive.step(&course));
            let (pose, _) = drive.view(&gait);
            let disparity = course.world().disparity(&pose).unwrap();
            drive.decide(&course, &grid(&disparity, settings, Some(&rig)));
        }
        // The decision on the first frame moves it from the second to the third.
        let speeds: Vec<_> = drive.log.track.iter().map(|p| p.speed_m_per_s).collect();
        assert!(speeds[..2] == [0.0, 0.0] && speeds[2] > 0.0, "{speeds:?}");
    }
}
