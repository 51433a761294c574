//! The way that a robot drove: what its body passed through was free, so nothing nearer in a cell
//! was real.
//!
//! The body is a *blade*: an upright rectangle at the origin of its base, across its heading. A
//! point is free if it passes from before the blade to behind it, or back, well inside its edges.

use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};
use std::ops::RangeInclusive;
use std::str::FromStr;
use svl_core::stereo::{Frame, GridShape, Pose};
use svl_core::{Error, Result};

/// Widths and heights of a body, metres.
const SIZES_M: RangeInclusive<f64> = 0.02..=20.0;
/// The way ahead of a pair that frees something: its length and time, and the turn on it.
const MAX_WAY_M: f64 = 3.0;
const MAX_WAY_NS: u64 = 10_000_000_000;
const MAX_TURN: f64 = std::f64::consts::FRAC_PI_2;
/// Shortest way ahead of a pair that is looked at.
const MIN_WAY_M: f64 = 0.05;
/// Longest time between two poses next to each other, and highest speed, as a multiple of the 95th
/// percentile: beyond, poses jump. A shorter step frees nothing.
const MAX_GAP_NS: u64 = 500_000_000;
const MAX_SPEEDS: f64 = 2.0;
const MIN_STEP_M: f64 = 0.001;
/// Distance from an edge at which a point is inside: a part of the width, of the way since the pair
/// (the drift of poses), and, at the lower edge, of the way again: a tilt of 3°.
const MARGIN: f64 = 0.025;
const DRIFT: f64 = 0.02;
const TILT: f64 = 0.05;
/// Depths along a ray: the first, and the step.
const FIRST_M: f64 = 0.06;
const DEPTH_STEP_M: f64 = 0.01;
/// Rays along a side of a cell, and of one of many.
const RAYS: usize = 6;
const RAYS_OF_MANY_CELLS: usize = 4;
const MANY_CELLS: usize = 100;

/// Width and height of a robot's body: `[robot]` of a scenario, `0.50x0.40` on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotSize {
    pub width_m: f64,
    pub height_m: f64,
}

impl RobotSize {
    /// # Errors
    /// [`Error::Invalid`] for a size that no robot has.
    pub fn validate(&self) -> Result<()> {
        let sizes = [("width_m", self.width_m), ("height_m", self.height_m)];
        let wrong = sizes.into_iter().find(|(_, m)| !SIZES_M.contains(m));
        wrong.map_or(Ok(()), |(key, m)| {
            let (least, most) = (SIZES_M.start(), SIZES_M.end());
            Err(Error::Invalid(format!(
                "robot.{key} = {m} is outside {least} ..= {most}"
            )))
        })
    }
}

impl FromStr for RobotSize {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let sides = text.split_once('x').and_then(|(width, height)| {
            let (width_m, height_m) = (width.parse().ok()?, height.parse().ok()?);
            Some(Self { width_m, height_m })
        });
        sides.filter(|own| own.validate().is_ok()).ok_or_else(|| {
            let (least, most) = (SIZES_M.start(), SIZES_M.end());
            format!("expected WIDTHxHEIGHT in metres, as 0.50x0.40, each {least} to {most}")
        })
    }
}

/// The robot at a pair, and what its left camera sees.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BodyPose {
    stamp_ns: u64,
    camera: Pose,
    /// The origin of the base, in the world, and the direction ahead in its plane, radians.
    base_m: Point3<f64>,
    heading: f64,
    /// Slopes of the rays through the left, upper, right and lower edge of the image.
    edges: [f64; 4],
}

impl BodyPose {
    /// `None` without a pose, a calibration, or a base: that of the transforms, or the floor below
    /// the camera.
    pub fn new(frame: &Frame) -> Option<Self> {
        let (camera, rig) = (frame.pose?, frame.rig()?);
        let centre = camera.translation.vector;
        let (base_m, ahead) = match &frame.base {
            Some(base) => (base.translation.vector, base.rotation * Vector3::x()),
            None => {
                let down = Vector3::z() * frame.floor?.camera_height_m();
                (centre - down, camera.rotation * Vector3::z())
            }
        };
        let (width, height) = frame.pair.size();
        let [left, upper] = [0.0; 2].map(|px| rig.point_m((px, px), 1.0));
        let right = rig.point_m((width as f64, height as f64), 1.0);
        Some(Self {
            stamp_ns: frame.stamp_ns,
            camera,
            base_m: base_m.into(),
            heading: ahead.y.atan2(ahead.x),
            edges: [left[0], upper[1], right[0], right[1]],
        })
    }

    /// A point of the world: how far ahead of the blade, left of its middle and above its lower
    /// edge.
    fn see(&self, point: &Point3<f64>) -> [f64; 3] {
        let apart = point - self.base_m;
        let (sin, cos) = self.heading.sin_cos();
        [
            cos * apart.x + sin * apart.y,
            cos * apart.y - sin * apart.x,
            apart.z,
        ]
    }
}

/// A step between two poses next to each other: the way and the turn from the pair to it.
struct WayStep<'a> {
    ends: [&'a BodyPose; 2],
    way_m: f64,
    length_m: f64,
    turn: f64,
}

/// The poses of a run, and the body that drove.
pub struct DrivenWay {
    robot: RobotSize,
    poses: Vec<Option<BodyPose>>,
    /// Highest speed of poses that do not jump, m/s.
    max_speed: f64,
}

/// The cells of a pair by the way ahead of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WayBounds {
    /// The way to the next pair, metres.
    pub way_m: f64,
    /// Per cell, in raster order, the distance up to which half of it was free.
    pub free_m: Vec<Option<f64>>,
}

impl DrivenWay {
    /// The way of a run, with the pose of each pair.
    pub fn new(robot: RobotSize, poses: Vec<Option<BodyPose>>) -> Self {
        let mut own = Self {
            robot,
            poses,
            max_speed: f64::INFINITY,
        };
        let pairs = 1..own.poses.len();
        let mut speeds: Vec<_> = pairs.filter_map(|to| own.speed(to)).collect();
        speeds.sort_by(f64::total_cmp);
        let usual = svl_core::statistics::nearest_rank(&speeds, 0.95);
        own.max_speed = usual.map_or(0.0, |usual| MAX_SPEEDS * usual);
        own
    }

    /// The speed to a pose from the one before; `None` over a gap.
    fn speed(&self, to: usize) -> Option<f64> {
        let [before, own] = [to.checked_sub(1)?, to].map(|i| self.poses.get(i)?.as_ref());
        let (before, own) = before.zip(own)?;
        let ns = own.stamp_ns.checked_sub(before.stamp_ns)?;
        let seconds = (1..=MAX_GAP_NS).contains(&ns).then_some(ns as f64 / 1e9)?;
        Some((own.base_m - before.base_m).norm() / seconds)
    }

    /// Why the way says nothing.
    pub fn refusal(&self) -> Option<String> {
        let poses = || self.poses.iter().flatten();
        let Some(first) = poses().next() else {
            return Some(
                "no phantoms are told: no pair has a pose with a calibration and a base: \
                 base_footprint or base_link in tf, or --camera-height M"
                    .to_owned(),
            );
        };
        let RobotSize { width_m, height_m } = self.robot;
        let [_, left_m, above_m] = first.see(&first.camera.translation.vector.into());
        if left_m.abs() > width_m / 2.0 || !(0.0..=height_m).contains(&above_m) {
            return Some(format!(
                "no phantoms are told: the camera is {above_m:.2} m above the base and {:.2} m \
                 beside its middle, outside a body of {width_m}x{height_m} m: --robot WIDTHxHEIGHT",
                left_m.abs()
            ));
        }
        let is_still = (0..self.poses.len()).all(|pair| self.steps(pair).1 < MIN_WAY_M);
        is_still.then(|| {
            "no phantoms are told: its poses go nowhere: less than 0.05 m without a jump or a gap \
             of 0.5 s, which a large --every and pairs without times have"
                .to_owned()
        })
    }

    /// The steps ahead of a pair, and the length of the way.
    fn steps(&self, pair: usize) -> (Vec<WayStep<'_>>, f64) {
        let (mut steps, mut way_m, mut turn) = (Vec::new(), 0.0, 0.0);
        let Some(first) = self.poses.get(pair).and_then(Option::as_ref) else {
            return (steps, way_m);
        };
        let turned = |from: &BodyPose, to: &BodyPose| {
            let (sin, cos) = (to.heading - from.heading).sin_cos();
            sin.atan2(cos).abs()
        };
        for to in pair + 1.. {
            let is_sound = self.speed(to).is_some_and(|speed| speed <= self.max_speed);
            let (Some(from), Some(own)) = (
                self.poses[to - 1].as_ref(),
                self.poses.get(to).and_then(Option::as_ref),
            ) else {
                break;
            };
            let length_m = (own.base_m - from.base_m).norm();
            if !is_sound
                || own.stamp_ns - first.stamp_ns > MAX_WAY_NS
                || way_m + length_m > MAX_WAY_M
                || turned(first, own) > MAX_TURN
            {
                break;
            }
            turn += turned(from, own);
            if length_m >= MIN_STEP_M {
                let ends = [from, own];
                steps.push(WayStep {
                    ends,
                    way_m,
                    length_m,
                    turn,
                });
            }
            way_m += length_m;
        }
        (steps, way_m)
    }

    /// The distance from an edge that a point needs there, if it passes the blade in a step, that
    /// far inside.
    fn freed(&self, step: &WayStep<'_>, point: &Point3<f64>) -> Option<f64> {
        let [from, to] = step.ends.map(|pose| pose.see(point));
        if (from[0] > 0.0) == (to[0] > 0.0) {
            return None;
        }
        let part = from[0] / (from[0] - to[0]);
        let [left_m, above_m] = [1, 2].map(|i| from[i] + part * (to[i] - from[i]));
        let way_m = step.way_m + part * step.length_m;
        let margin_m = MARGIN * self.robot.width_m + DRIFT * way_m * (1.0 + step.turn);
        let is_inside = left_m.abs() <= self.robot.width_m / 2.0 - margin_m
            && above_m <= self.robot.height_m - margin_m
            && above_m >= margin_m + TILT * way_m;
        is_inside.then_some(margin_m)
    }

    /// The distances up to which half of each cell was free; `None` without a way ahead.
    pub fn bounds(&self, pair: usize, shape: GridShape) -> Option<WayBounds> {
        let (steps, way_m) = self.steps(pair);
        let pose = self
            .poses
            .get(pair)?
            .as_ref()
            .filter(|_| way_m >= MIN_WAY_M)?;
        let side = if shape.cells() > MANY_CELLS {
            RAYS_OF_MANY_CELLS
        } else {
            RAYS
        };
        let [left, upper, right, lower] = pose.edges;
        let ray = |column: f64, row: f64| {
            let x = left + (right - left) * column / shape.columns as f64;
            let y = upper + (lower - upper) * row / shape.rows as f64;
            pose.camera.rotation * Vector3::new(x, y, 1.0)
        };
        let centre = Point3::from(pose.camera.translation.vector);
        // The last depth that is free along a ray, less the margin there.
        let depth_m = |ray: Vector3<f64>| {
            let (mut at, mut free_m) = (0, 0.0);
            for i in 0.. {
                let depth_m = FIRST_M + DEPTH_STEP_M * f64::from(i);
                let point = centre + ray * depth_m;
                let mut order = (at..steps.len()).chain(0..at);
                let found = order.find_map(|j| Some((j, self.freed(&steps[j], &point)?)));
                let Some((step, margin_m)) = found else {
                    break;
                };
                (at, free_m) = (step, depth_m - margin_m);
            }
            free_m
        };
        let free_m = shape.iter().map(|(column, row)| {
            let place = |i: usize, cell: usize| cell as f64 + (i as f64 + 0.5) / side as f64;
            let rays = (0..side * side).map(|i| ray(place(i % side, column), place(i / side, row)));
            let median_m = svl_core::statistics::lower_median(rays.map(depth_m));
            median_m.filter(|m| *m > 0.0)
        });
        let first = steps.first().filter(|step| step.way_m == 0.0);
        Some(WayBounds {
            free_m: free_m.collect(),
            way_m: first.map_or(0.0, |step| step.length_m),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Isometry3, Translation3, UnitQuaternion};

    const BODY: RobotSize = RobotSize {
        width_m: 0.4,
        height_m: 0.3,
    };
    const ONE: GridShape = GridShape {
        columns: 1,
        rows: 1,
    };

    /// A robot at a place, 0.1 s after the one before, with a camera 0.1 m above it that sees what
    /// is straight ahead.
    fn pose(number: u64, x: f64, heading: f64) -> Option<BodyPose> {
        let yaw = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading);
        let right_angle = std::f64::consts::FRAC_PI_2;
        let optical = UnitQuaternion::from_euler_angles(-right_angle, 0.0, -right_angle);
        Some(BodyPose {
            stamp_ns: number * 100_000_000,
            camera: Isometry3::from_parts(Translation3::new(x, 0.0, 0.1), yaw * optical),
            base_m: Point3::new(x, 0.0, 0.0),
            heading,
            edges: [-1e-6, -1e-6, 1e-6, 1e-6],
        })
    }

    fn bound(poses: Vec<Option<BodyPose>>) -> Option<f64> {
        DrivenWay::new(BODY, poses).bounds(0, ONE)?.free_m[0]
    }

    fn straight(steps: u64) -> Vec<Option<BodyPose>> {
        (0..=steps).map(|i| pose(i, 0.05 * i as f64, 0.0)).collect()
    }

    #[test]
    fn a_ray_is_free_as_far_as_the_body_came_with_a_margin() {
        // 0.1 m above the floor is inside until 0.1 = 0.01 + 0.07 z: the last depth is 1.28 m.
        let far_m = bound(straight(60)).unwrap();
        assert!(
            (far_m - (1.28 - 0.01 - 0.02 * 1.28)).abs() < 1e-4,
            "{far_m}"
        );
        // The body came to 1 m: a point there is still before it.
        let near_m = bound(straight(20)).unwrap();
        assert!(
            (near_m - (0.99 - 0.01 - 0.02 * 0.99)).abs() < 0.011,
            "{near_m}"
        );
    }

    #[test]
    fn a_way_ends_at_gaps_jumps_and_turns_and_none_frees_nothing() {
        let until = |change: &dyn Fn(u64, Option<BodyPose>) -> Option<BodyPose>| {
            let poses = straight(60).into_iter().zip(0..);
            bound(poses.map(|(pose, number)| change(number, pose)).collect())
        };
        let whole = until(&|_, own| own).unwrap();
        let missing = until(&|number, own| own.filter(|_| number != 10)).unwrap();
        let jump = until(&|number, own| {
            let mut own = own?;
            own.base_m.x += if number > 10 { 0.5 } else { 0.0 };
            Some(own)
        });
        let turn = until(&|number, own| {
            if number > 10 {
                pose(number, 0.5, 2.0)
            } else {
                own
            }
        });
        for end_m in [Some(missing), jump, turn] {
            let end_m = end_m.unwrap();
            assert!((0.4..0.51).contains(&end_m) && end_m < whole, "{end_m}");
        }
        let turning = (0..30).map(|i| pose(i, 0.0, 0.1 * i as f64)).collect();
        assert_eq!(bound(turning), None);
        assert_eq!(bound(vec![None; 9]), None);
        assert_eq!(bound(Vec::new()), None);
    }

    #[test]
    fn a_way_that_says_nothing_has_a_reason() {
        let refusal = |size: &str, poses| {
            let own = DrivenWay::new(size.parse().unwrap(), poses);
            own.refusal().unwrap_or_default()
        };
        assert!(refusal("0.4x0.3", vec![None; 3]).contains("no pair has a pose"));
        assert!(refusal("0.4x0.09", straight(9)).contains("outside a body of 0.4x0.09 m"));
        let still = (0..30).map(|i| pose(i, 0.0, 0.0)).collect();
        assert!(refusal("0.4x0.3", still).contains("go nowhere"));
        assert_eq!(refusal("0.4x0.3", straight(9)), "");
        for text in [
            "",
            "0.5",
            "0.5x",
            "0x0.4",
            "nanx0.4",
            "0.5x-1",
            "0.5x0.4x3",
            "21x1",
        ] {
            let why = text.parse::<RobotSize>().unwrap_err();
            assert!(
                why.contains("as 0.50x0.40, each 0.02 to 20"),
                "{text}: {why}"
            );
        }
    }
}
