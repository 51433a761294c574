//! The robot's trajectory: a smooth curve through the waypoints, the gait around it, and the pose
//! of the stereo head at any time.

use super::config::{ArenaConfig, RobotConfig, Waypoint};
use super::noise::{Dice, NoiseStream};
use nalgebra::{Point2, Rotation3, Translation3, UnitQuaternion, Vector2, Vector3};
use std::f64::consts::TAU;
use svl_core::stereo::Pose;
use svl_core::{Error, Result};

type Vec2 = Vector2<f64>;

/// One run along the path.
pub(super) struct Walk {
    spline: Spline,
    gait: Gait,
    deviation_m: f64,
    speed_m_per_s: f64,
    /// Phases of two waves of deviation, radians.
    phases: [f64; 2],
}

/// Sway of the stereo head about the position and heading of the robot.
#[derive(Clone)]
pub struct Gait {
    robot: RobotConfig,
    above_floor_m: f64,
    baseline_m: f64,
    /// Phases of yaw, roll and pitch, radians.
    phases: [f64; 3],
}

/// Velocity of the head in camera axes.
#[derive(Clone, Copy, Debug)]
pub struct Twist {
    pub linear_m_per_s: Vector3<f64>,
    pub angular_rad_per_s: Vector3<f64>,
}

impl Twist {
    pub(super) const STILL: Self = Self {
        linear_m_per_s: Vector3::new(0.0, 0.0, 0.0),
        angular_rad_per_s: Vector3::new(0.0, 0.0, 0.0),
    };
}

/// Wavelengths of the deviation.
const DEVIATION_M: [f64; 2] = [1.6, 2.5];
/// Half the time over which velocities are measured.
const INSTANT_S: f64 = 1.0e-3;

impl Gait {
    /// The gait of the run with that seed.
    pub fn new(config: &ArenaConfig, seed: u64) -> Self {
        Self::drawn(config, &mut Dice::new(seed, NoiseStream::Gait))
    }

    fn drawn(config: &ArenaConfig, dice: &mut Dice) -> Self {
        Self {
            robot: config.robot.clone(),
            above_floor_m: config.rig.above_floor_m,
            baseline_m: config.rig.baseline_m,
            phases: phases(dice),
        }
    }

    /// Pose of the left camera, `time_s` after the start, for a head centred at `middle`, metres,
    /// and a robot heading of `atan2(y, x)`, radians.
    pub fn pose(&self, middle: Vec2, heading: f64, time_s: f64) -> Pose {
        let swing = |degrees: f64, times: f64, phase: f64| {
            degrees.to_radians() * (TAU * self.robot.sway_hz * times * time_s + phase).sin()
        };
        let yaw = swing(self.robot.yaw_sway_deg, 1.0, self.phases[0]);
        let roll = swing(self.robot.roll_sway_deg, 1.0, self.phases[1]);
        let pitch = swing(self.robot.pitch_sway_deg, 2.0, self.phases[2]);
        let (sin, cos) = (heading + yaw).sin_cos();
        // Columns: the camera's right, down and forward in the world, with the horizon level.
        let level = nalgebra::Matrix3::new(sin, 0.0, cos, -cos, 0.0, sin, 0.0, -1.0, 0.0);
        let gait = Rotation3::from_axis_angle(&Vector3::x_axis(), pitch)
            * Rotation3::from_axis_angle(&Vector3::z_axis(), roll);
        let rotation = Rotation3::from_matrix_unchecked(level) * gait;
        let head = Vector3::new(middle.x, middle.y, self.above_floor_m);
        // The path is that of the head's centre, a pose that of the left camera.
        let left = head - rotation * Vector3::x() * (0.5 * self.baseline_m);
        Pose::from_parts(
            Translation3::from(left),
            UnitQuaternion::from_rotation_matrix(&rotation),
        )
    }
}

impl Twist {
    /// The velocity at `time_s` of a body with the pose `pose(t)` at time `t`.
    pub fn new(pose: impl Fn(f64) -> Pose, time_s: f64) -> Self {
        let (before, after) = (pose(time_s - INSTANT_S), pose(time_s + INSTANT_S));
        let motion = before.inv_mul(&after);
        let per_second = 0.5 / INSTANT_S;
        Self {
            linear_m_per_s: motion.translation.vector * per_second,
            angular_rad_per_s: motion.rotation.scaled_axis() * per_second,
        }
    }
}

impl Walk {
    pub(super) fn new(config: &ArenaConfig, seed: u64) -> Result<Self> {
        let spline = Spline::new(&config.robot.path)?;
        let mut dice = Dice::new(seed, NoiseStream::Gait);
        let duration_s = config.frames as f64 / config.rate_hz;
        Ok(Self {
            speed_m_per_s: spline.length_m() / duration_s,
            spline,
            gait: Gait::drawn(config, &mut dice),
            deviation_m: config.robot.deviation_m,
            phases: phases(&mut dice),
        })
    }

    pub(super) fn length_m(&self) -> f64 {
        self.spline.length_m()
    }

    /// The centre of the head on the floor, `along_m` metres after the start.
    pub(super) fn middle(&self, along_m: f64) -> Vec2 {
        let (point, direction) = self.spline.at(along_m);
        let wave = |i: usize| (TAU * along_m / DEVIATION_M[i] + self.phases[i]).sin();
        point + left_of(direction) * (0.5 * self.deviation_m * (wave(0) + wave(1)))
    }

    /// Pose of the left camera, `time_s` after the start.
    pub(super) fn pose(&self, time_s: f64) -> Pose {
        let along_m = time_s * self.speed_m_per_s;
        let near = 0.005;
        // The direction of the path with its deviation, by a difference over a centimetre.
        let travel = self.middle(along_m + near) - self.middle(along_m - near);
        let heading = travel.y.atan2(travel.x);
        self.gait.pose(self.middle(along_m), heading, time_s)
    }

    /// Velocity of the left camera at `time_s`.
    pub(super) fn twist(&self, time_s: f64) -> Twist {
        Twist::new(|time_s| self.pose(time_s), time_s)
    }
}

fn phases<const N: usize>(dice: &mut Dice) -> [f64; N] {
    std::array::from_fn(|_| f64::from(dice.between(0.0, 1.0)) * TAU)
}

fn left_of(direction: Vec2) -> Vec2 {
    Vec2::new(-direction.y, direction.x)
}

/// Cubic Hermite curves between waypoints, by arc length; straight beyond both ends.
struct Spline {
    /// Points of the curve with the length up to them and their direction.
    knots: Vec<Knot>,
}

struct Knot {
    along_m: f64,
    at: Vec2,
    direction: Vec2,
}

impl Spline {
    /// Knots between two waypoints: millimetres apart.
    const STEPS: usize = 128;

    fn new(path: &[Waypoint]) -> Result<Self> {
        if path.len() < 2 {
            return Err(Error::Invalid(format!(
                "arena: robot.path has {} points, a path needs 2",
                path.len()
            )));
        }
        let mut knots: Vec<Knot> = Vec::with_capacity((path.len() - 1) * Self::STEPS + 1);
        for (i, pair) in path.windows(2).enumerate() {
            let [from, to] = [pair[0], pair[1]].map(|p| Point2::from(p.at_m).coords);
            let chord_m = (to - from).norm();
            if chord_m < 1.0e-3 {
                return Err(Error::Invalid(format!(
                    "arena: robot.path[{i}] and the next point are the same place"
                )));
            }
            let [start, end] = [pair[0], pair[1]].map(|p| {
                let (sin, cos) = p.heading_deg.to_radians().sin_cos();
                Vec2::new(cos, sin) * chord_m
            });
            // A waypoint between two curves is a knot once.
            for step in usize::from(i > 0)..=Self::STEPS {
                let t = step as f64 / Self::STEPS as f64;
                let (t2, t3) = (t * t, t * t * t);
                let at = from * (2.0 * t3 - 3.0 * t2 + 1.0)
                    + start * (t3 - 2.0 * t2 + t)
                    + to * (3.0 * t2 - 2.0 * t3)
                    + end * (t3 - t2);
                let slope = (from - to) * (6.0 * (t2 - t))
                    + start * (3.0 * t2 - 4.0 * t + 1.0)
                    + end * (3.0 * t2 - 2.0 * t);
                let direction = slope.try_normalize(1.0e-9).unwrap_or((to - from) / chord_m);
                // Arc length by chords: at steps of millimetres the error is far below one.
                let along_m = knots
                    .last()
                    .map_or(0.0, |last| last.along_m + (at - last.at).norm());
                knots.push(Knot {
                    along_m,
                    at,
                    direction,
                });
            }
        }
        Ok(Self { knots })
    }

    fn length_m(&self) -> f64 {
        self.knots[self.knots.len() - 1].along_m
    }

    /// Point and direction `along_m` metres after the start.
    fn at(&self, along_m: f64) -> (Vec2, Vec2) {
        let next = self
            .knots
            .partition_point(|k| k.along_m <= along_m)
            .clamp(1, self.knots.len() - 1);
        let (a, b) = (&self.knots[next - 1], &self.knots[next]);
        let t = (along_m - a.along_m) / (b.along_m - a.along_m);
        let direction = a
            .direction
            .lerp(&b.direction, t.clamp(0.0, 1.0))
            .normalize();
        let inside = (0.0..=1.0).contains(&t);
        let at = if inside {
            a.at.lerp(&b.at, t)
        } else {
            a.at + a.direction * (along_m - a.along_m)
        };
        (at, direction)
    }
}
