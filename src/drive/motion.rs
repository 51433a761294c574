//! The robot's motion, and what happens on the way.

use crate::arena::ArenaWorld;
use crate::scenario::DriveConfig;

pub(super) type GroundPoint = nalgebra::Vector2<f64>;

/// What the robot is told to do.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct DriveCommand {
    pub(super) speed_m_per_s: f64,
    /// Counterclockwise, seen from above.
    pub(super) turn_rad_per_s: f64,
}

/// Where the robot is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RobotState {
    pub(super) time_s: f64,
    /// Middle of the stereo head, which is that of the body.
    pub(super) at: GroundPoint,
    /// `atan2(y, x)` of the direction of travel.
    pub(super) heading: f64,
}

impl RobotState {
    /// A place `ahead` and to the left of the robot, in the world.
    pub(super) fn to_world(self, ahead_m: f64, left_m: f64) -> GroundPoint {
        let (sin, cos) = self.heading.sin_cos();
        self.at + GroundPoint::new(ahead_m * cos - left_m * sin, ahead_m * sin + left_m * cos)
    }

    /// How far ahead and to the left a place of the world is.
    pub(super) fn to_robot(self, at: GroundPoint) -> (f64, f64) {
        let (sin, cos) = self.heading.sin_cos();
        let d = at - self.at;
        (cos * d.x + sin * d.y, cos * d.y - sin * d.x)
    }

    /// The same place after a turn on the spot.
    pub(super) fn turned(self, by: f64) -> Self {
        Self {
            heading: self.heading + by,
            ..self
        }
    }

    /// At the end of an arc of that length that turns by `turn` in all.
    pub(super) fn moved(self, length_m: f64, turn: f64) -> Self {
        // The chord of an arc: as long as the arc times the sine of half the turn over it.
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

    /// After some time, negative for before, under a command.
    pub(super) fn after(self, command: DriveCommand, seconds: f64) -> Self {
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

/// What the robot did between two frames, or at one.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum DriveEvent {
    /// It touched something.
    Collision { with: String, at_m: [f64; 2] },
    /// Its clearance fell below the limit.
    NearMiss { to: String, at_m: [f64; 2] },
    /// It came no farther, and was set back on the route.
    Stuck { at_m: [f64; 2] },
}

impl DriveEvent {
    /// Whether a course is thrown away where the driver with perfect sight meets this.
    pub(super) fn ends_proof(&self) -> bool {
        !matches!(self, Self::NearMiss { .. })
    }
}

/// The robot at a frame, and what happened since the last one.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct TrackPoint {
    pub sequence: u64,
    pub at_m: [f64; 2],
    pub heading: f64,
    /// Over the time since the last frame.
    pub speed_m_per_s: f64,
    /// Least distance of the body from everything since the last frame.
    pub clearance_m: f64,
    /// Whether it was set there by hand, after a collision or where it was stuck.
    pub is_placed: bool,
    pub events: Vec<DriveEvent>,
}

/// What became of a drive.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct DriveLog {
    pub track: Vec<TrackPoint>,
    /// Whether the goal was reached in time, helped or not.
    pub arrived: bool,
    /// Pairs per second.
    pub rate_hz: f64,
}

impl DriveLog {
    pub fn events(&self) -> impl Iterator<Item = (&TrackPoint, &DriveEvent)> {
        let points = self.track.iter();
        points.flat_map(|point| point.events.iter().map(move |event| (point, event)))
    }

    /// Number of collisions, near misses, and times that it was stuck.
    pub fn counts(&self) -> [u64; 3] {
        let mut counts = [0; 3];
        for (_, event) in self.events() {
            counts[match event {
                DriveEvent::Collision { .. } => 0,
                DriveEvent::NearMiss { .. } => 1,
                DriveEvent::Stuck { .. } => 2,
            }] += 1;
        }
        counts
    }

    /// Whether the goal was reached without a collision and without help.
    pub fn finished(&self) -> bool {
        let [collisions, _, stuck] = self.counts();
        self.arrived && collisions == 0 && stuck == 0
    }

    /// Distance driven, without what it was carried.
    pub fn driven_m(&self) -> f64 {
        self.track
            .iter()
            .map(|p| p.speed_m_per_s / self.rate_hz)
            .sum()
    }

    /// Distance driven until the first collision, where there was one.
    pub fn first_collision_m(&self) -> Option<f64> {
        let mut driven_m = 0.0;
        for point in &self.track {
            driven_m += point.speed_m_per_s / self.rate_hz;
            let is_collision = |e: &DriveEvent| matches!(e, DriveEvent::Collision { .. });
            if point.events.iter().any(is_collision) {
                return Some(driven_m);
            }
        }
        None
    }

    /// Time of the drive.
    pub fn duration_s(&self) -> f64 {
        self.track.len().saturating_sub(1) as f64 / self.rate_hz
    }

    /// Time in which it did not move, as when it turned on the spot.
    pub fn stood_s(&self) -> f64 {
        let moved = self.track.iter().skip(1);
        moved.filter(|p| p.speed_m_per_s < 0.01).count() as f64 / self.rate_hz
    }
}

/// Longest way between two looks at the clearance.
const STEP_M: f64 = 0.001;

/// Moves the robot under a command through the world. It stops where it touches something. Returns
/// the state at the end, the way driven, and the least clearance with what was nearest.
pub(super) fn advance<'w>(
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
