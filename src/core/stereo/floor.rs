//! The floor as a plane below the camera: what of a truth is floor, where no surfaces are known.

use super::{Plane, Rig};
use nalgebra::{Isometry3, UnitQuaternion, UnitVector3, Vector3};

/// Greatest height above the plane of what is floor: a fraction of the camera's height (distances
/// of cells are right to a fifth), and metres.
const MAX_FRACTION: f64 = 0.2;
const MAX_ABOVE_M: f64 = 0.05;

/// Surface that a left pixel shows, with its grey value in `/truth/surface`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Surface {
    Unknown = 0,
    /// The ground that the robot drives on.
    Floor = 64,
    /// The room behind the arena's walls.
    Room = 128,
    /// The arena's walls.
    Wall = 192,
    /// Blocks and balls.
    Object = 255,
}

impl Surface {
    /// From a grey value; `None` for any other value.
    #[inline]
    pub fn from_code(code: u8) -> Self {
        match code {
            64 => Self::Floor,
            128 => Self::Room,
            192 => Self::Wall,
            255 => Self::Object,
            _ => Self::Unknown,
        }
    }
}

/// The floor in the frame of the left camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FloorPlane {
    /// Away from the floor.
    up: UnitVector3<f64>,
    camera_height_m: f64,
}

impl FloorPlane {
    /// Heights of a camera, metres.
    pub const HEIGHTS_M: std::ops::RangeInclusive<f64> = 0.01..=100.0;

    /// The floor below a camera of that height, metres, whose normal points up.
    pub fn new(up: UnitVector3<f64>, camera_height_m: f64) -> Self {
        Self {
            up,
            camera_height_m,
        }
    }

    /// The floor below a level camera of that height, metres.
    pub fn level(camera_height_m: f64) -> Self {
        Self::new(-Vector3::y_axis(), camera_height_m)
    }

    /// The floor through the origin of a frame whose z is up, as `base_footprint` (REP 105, 120),
    /// with the camera's pose in it; `None` if the camera is not above the floor by one of
    /// [`Self::HEIGHTS_M`].
    pub fn from_pose(camera: &Isometry3<f64>) -> Option<Self> {
        let camera_height_m = camera.translation.z;
        Self::HEIGHTS_M.contains(&camera_height_m).then(|| Self {
            up: camera.rotation.inverse() * Vector3::z_axis(),
            camera_height_m,
        })
    }

    /// The same plane in a camera's frame that is rotated: `X_rotated = rotation · X`.
    #[must_use]
    pub fn rotated(self, rotation: &UnitQuaternion<f64>) -> Self {
        Self {
            up: rotation * self.up,
            ..self
        }
    }

    /// The normal, away from the floor.
    pub fn up(&self) -> UnitVector3<f64> {
        self.up
    }

    /// Height of the camera above the floor, metres.
    pub fn camera_height_m(&self) -> f64 {
        self.camera_height_m
    }

    /// Height of a point above the floor, metres.
    pub fn height_m(&self, point: &Vector3<f64>) -> f64 {
        self.camera_height_m + self.up.dot(point)
    }

    /// Height above which a point is no floor, metres.
    pub fn limit_m(&self) -> f64 {
        MAX_ABOVE_M.min(MAX_FRACTION * self.camera_height_m)
    }

    /// Per pixel of true disparities whether it is floor; all else is unknown.
    pub fn surfaces(&self, disparity: &Plane<f32>, rig: &Rig) -> Plane<Surface> {
        let limit_m = self.limit_m();
        let mut surfaces = disparity.map(|_| Surface::Unknown);
        for y in 0..disparity.height() {
            let pixels = surfaces.row_mut(y).iter_mut().zip(disparity.row(y));
            for (x, (surface, &d)) in pixels.enumerate() {
                let depth_m = Some(d).filter(|d| d.is_finite());
                let depth_m = depth_m.and_then(|d| rig.depth_m(d.into()));
                let height_m =
                    depth_m.map(|z| self.height_m(&rig.point_m((x as f64, y as f64), z).into()));
                if height_m.is_some_and(|height_m| height_m < limit_m) {
                    *surface = Surface::Floor;
                }
            }
        }
        surfaces
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Isometry3, Translation3};

    /// 100 px focal length, a baseline of 0.1 m, 64 x 48.
    fn rig() -> Rig {
        Rig::new(100.0, (32.0, 24.0), 0.1, 0.0).unwrap()
    }

    /// The disparities of a horizontal plane at that height below a camera that looks down by an
    /// angle.
    fn plane(below_m: f64, down: f64) -> Plane<f32> {
        let truth = |_, y: usize| {
            let slope = (y as f64 - 24.0) / 100.0;
            // The ray (0, slope, 1), turned down.
            let falls = slope * down.cos() + down.sin();
            if falls > 0.0 {
                rig().disparity_px(below_m / falls) as f32
            } else {
                f32::INFINITY
            }
        };
        Plane::from_fn(64, 48, truth).unwrap()
    }

    fn count(floor: &FloorPlane, disparity: &Plane<f32>) -> (usize, usize) {
        let surfaces = floor.surfaces(disparity, &rig());
        let known = disparity.pixels().filter(|d| d.is_finite()).count();
        (
            surfaces.pixels().filter(|s| *s == Surface::Floor).count(),
            known,
        )
    }

    #[test]
    fn floor_is_lower_than_a_fifth_of_the_height_or_five_centimetres() {
        let is_floor = |height_m: f64, above_m: f64| {
            let (floor, known) = count(
                &FloorPlane::level(height_m),
                &plane(height_m - above_m, 0.0),
            );
            assert!(known > 0 && (floor == 0 || floor == known));
            floor > 0
        };
        assert!(is_floor(0.1, 0.0) && is_floor(0.1, 0.019) && !is_floor(0.1, 0.021));
        assert!(is_floor(3.0, 0.049) && !is_floor(3.0, 0.051));
        // Below the plane there is only noise.
        assert!(is_floor(1.0, -0.3));
    }

    #[test]
    fn a_camera_that_looks_up_or_down_has_its_floor_by_its_pose() {
        for down in [0.6_f64, 0.2, 0.0, -0.1] {
            // A frame on the floor, elsewhere and turned: x forward, y left, z up.
            let yaw = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.7);
            let optical = UnitQuaternion::from_euler_angles(
                -std::f64::consts::FRAC_PI_2,
                0.0,
                -std::f64::consts::FRAC_PI_2,
            );
            let pitch = UnitQuaternion::from_axis_angle(&-Vector3::x_axis(), down);
            let pose =
                Isometry3::from_parts(Translation3::new(0.4, -0.2, 0.5), yaw * optical * pitch);
            let floor = FloorPlane::from_pose(&pose).unwrap();
            let (found, known) = count(&floor, &plane(0.5, down));
            assert!(known > 0 && found == known, "{down}: {found} of {known}");
            // A level camera of that height would see none of a floor that it looks down on.
            if down > 0.5 {
                assert!(count(&FloorPlane::level(0.5), &plane(0.5, down)).0 < known);
            }
        }
    }

    #[test]
    fn a_rectification_turns_the_plane() {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 0.3);
        let floor = FloorPlane::level(0.5).rotated(&turn);
        // Seen by the rotated camera, the floor is that of one that looks up or down.
        let found = [0.3, -0.3].map(|down| {
            let (found, known) = count(&floor, &plane(0.5, down));
            found == known && known > 0
        });
        assert_eq!(found.iter().filter(|is| **is).count(), 1);
    }

    #[test]
    fn a_camera_on_or_below_the_floor_has_none() {
        let at = |z| FloorPlane::from_pose(&Isometry3::translation(0.0, 0.0, z));
        assert!(
            [0.0, -0.5, f64::NAN, 1000.0]
                .iter()
                .all(|z| at(*z).is_none())
        );
        assert!(at(3.0).is_some());
    }
}
