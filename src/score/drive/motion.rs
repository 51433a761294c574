//! The robot's motion, and events on the way.

use crate::scenario::DriveConfig;
use svl_sim::arena::ArenaWorld;

pub type GroundPoint = nalgebra::Vector2<f64>;

/// Command to the robot.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DriveCommand {
    pub speed_m_per_s: f64,
    /// Counterclockwise, seen from above.
    pub turn_rad_per_s: f64,
}

/// Pose of the robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RobotState {
    pub time_s: f64,
    /// Centre of the stereo head, and of the body.
    pub at: GroundPoint,
    /// `atan2(y, x)` of the direction of travel.
    pub heading: f64,
}

impl RobotState {
    /// The world position of a point `ahead` and to the left of the robot.
    pub fn to_world(self, ahead_m: f64, left_m: f64) -> GroundPoint {
        let (sin, cos) = self.heading.sin_cos();
        self.at + GroundPoint::new(ahead_m * cos - left_m * sin, ahead_m * sin + left_m * cos)
    }

    /// Distance of a world position ahead and to the left.
    pub fn to_robot(self, at: GroundPoint) -> (f64, f64) {
        let (sin, cos) = self.heading.sin_cos();
        let d = at - self.at;
        (cos * d.x + sin * d.y, cos * d.y - sin * d.x)
    }

    /// The same position after a rotation on the spot.
    pub fn turned(self, by: f64) -> Self {
        Self {
            heading: self.heading + by,
            ..self
        }
    }

    /// The state at the end of an arc of that length with a total rotation of `turn`.
    pub fn moved(self, length_m: f64, turn: f64) -> Self {
        // The chord of an arc: the arc's length times the sine of half the rotation over that half.
        let half = 0.5 * turn;
        let shrink = if half.abs() < 1.0e-9 {
            1.0
        } else {
            half.sin() / half
        };
        let (sin, cos) = (self.heading + half).sin_cos();
        Self {
            at: self.at + GroundPoint::new(cos, sin) * (length_m * shrink),
            heading: self.heading + turn,
            ..self
        }
    }

    /// The state after some time, negative for before, under a command.
    pub fn after(self, command: DriveCommand, seconds: f64) -> Self {
        let moved = self.moved(
            command.speed_m_per_s * seconds,
            command.turn_rad_per_s * seconds,
        );
        Self {
            time_s: self.time_s + seconds,
            ..moved
        }
    }
}

/// Event between two frames, or at one.
#[derive(Clone, Debug, PartialEq)]
pub enum DriveEvent {
    /// It touched something.
    Collision { with: String, at_m: [f64; 2] },
    /// The clearance fell below the limit.
    NearMiss { to: String, at_m: [f64; 2] },
    /// It made no progress, and was put back on the route.
    Stuck { at_m: [f64; 2] },
}

impl DriveEvent {
    /// True if a course is rejected when the driver with perfect vision meets this.
    pub fn ends_proof(&self) -> bool {
        !matches!(self, Self::NearMiss { .. })
    }
}

/// The robot at a frame, and events since the last one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrackPoint {
    pub sequence: u64,
    pub at_m: [f64; 2],
    pub heading: f64,
    /// Over the time since the last frame.
    pub speed_m_per_s: f64,
    /// Least distance of the body from everything since the last frame.
    pub clearance_m: f64,
    /// True if it was put there by hand, after a collision or when stuck.
    pub is_placed: bool,
    /// True if the algorithm was busy with an earlier pair and skipped this one.
    pub is_skipped: bool,
    pub event: Option<DriveEvent>,
}

/// Record of a drive.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DriveLog {
    pub track: Vec<TrackPoint>,
    /// True if the goal was reached in time, with or without help.
    pub arrived: bool,
    /// Pairs per second.
    pub rate_hz: f64,
    /// Length of the route that the robot drove itself, metres; what it drove twice counts once.
    pub route_m: f64,
}

impl DriveLog {
    pub fn events(&self) -> impl Iterator<Item = &DriveEvent> {
        self.track.iter().filter_map(|point| point.event.as_ref())
    }

    /// Number of collisions, near misses, and times it was stuck.
    pub fn counts(&self) -> [u64; 3] {
        let mut counts = [0; 3];
        for event in self.events() {
            counts[match event {
                DriveEvent::Collision { .. } => 0,
                DriveEvent::NearMiss { .. } => 1,
                DriveEvent::Stuck { .. } => 2,
            }] += 1;
        }
        counts
    }

    /// True if the goal was reached without a collision and without help.
    pub fn finished(&self) -> bool {
        let [collisions, _, stuck] = self.counts();
        self.arrived && collisions == 0 && stuck == 0
    }

    /// Distance driven, excluding the distance it was carried.
    pub fn driven_m(&self) -> f64 {
        let steps = self.track.iter();
        steps.map(|p| p.speed_m_per_s / self.rate_hz).sum()
    }

    /// Distance driven until the first collision, if there was one.
    pub fn first_collision_m(&self) -> Option<f64> {
        let mut driven_m = 0.0;
        for point in &self.track {
            driven_m += point.speed_m_per_s / self.rate_hz;
            if matches!(point.event, Some(DriveEvent::Collision { .. })) {
                return Some(driven_m);
            }
        }
        None
    }

    /// Number of pairs that arrived while the algorithm was busy.
    pub fn skipped(&self) -> u64 {
        self.track.iter().filter(|p| p.is_skipped).count() as u64
    }

    /// Duration of the drive.
    pub fn duration_s(&self) -> f64 {
        self.track.len().saturating_sub(1) as f64 / self.rate_hz
    }

    /// Time without forward motion, for example while turning on the spot.
    pub fn stood_s(&self) -> f64 {
        let moved = self.track.iter().skip(1);
        moved.filter(|p| p.speed_m_per_s < 0.01).count() as f64 / self.rate_hz
    }
}

/// Longest step between two clearance checks.
const STEP_M: f64 = 0.001;

/// Moves the robot under a command through the world. It stops where it touches something. Returns
/// the state at the end, the distance driven, and the least clearance with the nearest object.
pub fn advance<'w>(
    world: &'w ArenaWorld,
    config: &DriveConfig,
    from: RobotState,
    command: DriveCommand,
    seconds: f64,
) -> (RobotState, f64, (f64, &'w str)) {
    let length_m = command.speed_m_per_s * seconds;
    let steps = (length_m / STEP_M).ceil().max(1.0) as u32;
    let mut least = (f64::INFINITY, "");
    let mut state = from;
    for step in 1..=steps {
        let next = from.after(command, seconds * f64::from(step) / f64::from(steps));
        let (axis_m, name) = world.clearance(next.at.into(), config.height_m);
        let clearance_m = axis_m - config.radius_m;
        if clearance_m < least.0 {
            least = (clearance_m, name);
        }
        if clearance_m <= 0.0 {
            let driven_m = length_m * f64::from(step - 1) / f64::from(steps);
            return (
                RobotState {
                    time_s: from.time_s + seconds,
                    ..state
                },
                driven_m,
                least,
            );
        }
        state = next;
    }
    (state, length_m, least)
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_sim::arena::{ArenaConfig, Ball, Block};

    fn robot() -> RobotState {
        RobotState {
            time_s: 0.0,
            at: GroundPoint::new(1.0, 1.0),
            heading: 0.0,
        }
    }

    /// A room with a block to the right, a ball ahead and a beam that hangs on the left.
    fn world() -> ArenaWorld {
        let mut config = ArenaConfig::default();
        let block = |name: &str, at_m, above_floor_m| Block {
            name: name.into(),
            at_m,
            size_m: [0.2, 0.2, 0.2],
            above_floor_m,
            heading_deg: 0.0,
        };
        config.world.blocks = vec![
            block("block", [1.5, 1.0], 0.0),
            block("beam", [0.5, 1.0], 0.13),
        ];
        config.world.balls = vec![Ball {
            name: "ball".into(),
            at_m: [1.0, 2.0],
            radius_m: 0.1,
            height_m: 0.1,
        }];
        ArenaWorld::unpainted(&config, 1).unwrap()
    }

    #[test]
    fn arcs_are_those_of_circles() {
        // A quarter of a circle of radius 1, to the left.
        let quarter = std::f64::consts::FRAC_PI_2;
        let end = robot().moved(quarter, quarter);
        assert!(
            (end.at - GroundPoint::new(2.0, 2.0)).norm() < 1.0e-12,
            "{end:?}"
        );
        assert!((end.heading - quarter).abs() < 1.0e-12);
        let (ahead, left) = end.to_robot(end.to_world(0.3, -0.2));
        assert!((ahead - 0.3).abs() < 1.0e-12 && (left + 0.2).abs() < 1.0e-12);
    }

    #[test]
    fn clearance_is_exact_and_what_hangs_high_is_passed_below() {
        let world = world();
        let near = |at, height_m| {
            let (distance_m, name) = world.clearance(at, height_m);
            ((1.0e4 * distance_m).round() / 1.0e4, name.to_owned())
        };
        assert_eq!(near([1.3, 1.0], 0.12), (0.1, "block".into()));
        // Distance to a corner.
        assert_eq!(near([1.37, 1.14], 0.12), (0.05, "block".into()));
        assert_eq!(near([1.5, 1.04], 0.12), (-0.06, "block".into()));
        assert_eq!(near([1.0, 1.75], 0.12), (0.15, "ball".into()));
        // A body as high as the ball's lower quarter meets a smaller circle.
        let radius_m = (0.1_f64.powi(2) - 0.05_f64.powi(2)).sqrt();
        let (distance_m, _) = world.clearance([1.0, 1.75], 0.05);
        assert!((distance_m - (0.25 - radius_m)).abs() < 1.0e-6);
        assert_eq!(near([0.5, 1.0], 0.12).1, "wall x=0");
        assert_eq!(near([0.5, 1.05], 0.14), (-0.05, "beam".into()));
    }

    #[test]
    fn a_drive_with_help_is_not_finished() {
        let at_m = [1.0, 1.0];
        let (with, to) = ("ball".to_owned(), "ball".to_owned());
        for (event, is_finished) in [
            (DriveEvent::NearMiss { to, at_m }, true),
            (DriveEvent::Collision { with, at_m }, false),
            (DriveEvent::Stuck { at_m }, false),
        ] {
            let mut log = DriveLog::default();
            log.track.push(TrackPoint {
                event: Some(event),
                ..TrackPoint::default()
            });
            assert!(!log.finished());
            log.arrived = true;
            assert_eq!(log.finished(), is_finished);
        }
    }

    #[test]
    fn a_robot_stops_where_it_touches_something() {
        let (world, config) = (world(), DriveConfig::default());
        let ahead = DriveCommand {
            speed_m_per_s: 1.0,
            turn_rad_per_s: 0.0,
        };
        // The block's side is at 1.4, the robot's radius 0.08.
        let (state, driven_m, (clearance_m, name)) = advance(&world, &config, robot(), ahead, 1.0);
        assert!((state.at.x - 1.32).abs() < 1.1 * STEP_M, "{state:?}");
        assert!((driven_m - 0.32).abs() < 1.1 * STEP_M && clearance_m <= 0.0 && name == "block");
        let (state, driven_m, (clearance_m, _)) = advance(&world, &config, robot(), ahead, 0.2);
        assert!((driven_m - 0.2).abs() < 1.0e-12 && (clearance_m - 0.12).abs() < 1.0e-6);
        assert_eq!(state.time_s, 0.2);
    }
}
