//! Approximate pose of a board before the camera is calibrated.

use crate::Board;
use nalgebra::{Point2, Unit, Vector2, Vector3};

/// Assumed focal length, in widths of the image: that of a field of view of 60°.
const FOCAL: f64 = 0.85;

/// Approximate position, orientation and distance of a board.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RoughPose {
    /// The board's centre relative to the centre of the image, in widths of the image.
    middle: Vector2<f64>,
    /// The board's normal, pointing away from the camera.
    normal: Unit<Vector3<f64>>,
    /// In squares.
    distance: f64,
}

/// Differences that justify another view; the largest of the three counts. Position, in widths of
/// the image,
const MIN_POSITION_CHANGE: f64 = 0.08;
/// orientation, radians,
const MIN_ROTATION: f64 = 0.17;
/// and natural logarithm of the ratio of the distances.
const MIN_DISTANCE_CHANGE: f64 = 0.18;

impl RoughPose {
    /// From a board's corners, in the order of [`Board::corners`]; `None` if they are degenerate.
    pub(super) fn new(
        board: &Board,
        (width, height): (usize, usize),
        corners: &[Point2<f64>],
    ) -> Option<Self> {
        let (columns, rows) = (board.columns(), board.rows());
        let (width, height) = (width as f64, height as f64);
        let at =
            |i: usize| Some((corners.get(i)? - Point2::new(0.5 * width, 0.5 * height)) / width);
        let quad = [
            at(0)?,
            at(columns - 1)?,
            at(columns * rows - 1)?,
            at(columns * (rows - 1))?,
        ];
        let [along, down, first] =
            homography(quad)?.map(|v| Vector3::new(v.x / FOCAL, v.y / FOCAL, v.z));
        // H = K [r1 r2 t] up to scale: with an assumed K its columns are two board axes and the
        // first corner; dividing by the number of squares gives lengths in squares.
        let (along, down) = (along / (columns - 1) as f64, down / (rows - 1) as f64);
        let normal = Unit::try_new(along.cross(&down), f64::MIN_POSITIVE)?;
        let distance = first.norm() / (along.norm() * down.norm()).sqrt();
        let middle = quad.iter().sum::<Vector2<f64>>() / 4.0;
        distance.is_finite().then_some(Self {
            middle,
            normal,
            distance,
        })
    }

    /// Difference of two poses; 1 justifies another view.
    pub(super) fn difference(&self, other: &Self) -> f64 {
        let apart = (self.middle - other.middle).norm() / MIN_POSITION_CHANGE;
        let rotated = self.normal.angle(&other.normal) / MIN_ROTATION;
        // The logarithm treats nearer and farther equally.
        let nearer = (self.distance / other.distance).ln().abs() / MIN_DISTANCE_CHANGE;
        apart.max(rotated).max(nearer)
    }

    /// Tilt relative to facing the camera, about the vertical and the horizontal axis, radians.
    pub(super) fn tilt(&self) -> Vector2<f64> {
        Vector2::new(self.normal.x.asin(), self.normal.y.asin())
    }
}

/// The corners of a board's outline, in turn, that many squares beyond its outer inner corners;
/// `None` if they are degenerate.
pub fn outline(board: &Board, corners: &[Point2<f64>], beyond: f64) -> Option<[Point2<f64>; 4]> {
    let (columns, rows) = (board.columns(), board.rows());
    let at = |i: usize| corners.get(i).map(|corner| corner.coords);
    let quad = [
        at(0)?,
        at(columns - 1)?,
        at(columns * rows - 1)?,
        at(columns * (rows - 1))?,
    ];
    let [along, down, first] = homography(quad)?;
    let [right, below] = [columns, rows].map(|side| beyond / (side - 1) as f64);
    let ends = [
        (-right, -below),
        (1.0 + right, -below),
        (1.0 + right, 1.0 + below),
        (-right, 1.0 + below),
    ];
    Some(ends.map(|(x, y)| {
        let point = x * along + y * down + first;
        Point2::from(point.xy() / point.z)
    }))
}

/// Columns of the homography from the unit square to four points, in its order (Heckbert,
/// Fundamentals of texture mapping and image warping, 1989, section 2.2.3).
fn homography([p0, p1, p2, p3]: [Vector2<f64>; 4]) -> Option<[Vector3<f64>; 3]> {
    let (d1, d2, sum) = (p1 - p2, p3 - p2, p0 - p1 + p2 - p3);
    let determinant = d1.perp(&d2);
    let (g, h) = (sum.perp(&d2) / determinant, d1.perp(&sum) / determinant);
    let column = |v: Vector2<f64>, w: f64| Vector3::new(v.x, v.y, w);
    let columns = [
        column(p1 - p0 + g * p1, g),
        column(p3 - p0 + h * p3, h),
        column(p0, 1.0),
    ];
    columns
        .iter()
        .flatten()
        .all(|v| v.is_finite())
        .then_some(columns)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Isometry3, Translation3, UnitQuaternion};
    use svl_core::stereo::Intrinsics;

    #[test]
    fn tilt_and_distance_are_those_of_the_board() {
        let board = Board::new((9, 6), None).unwrap();
        let camera = Intrinsics::new((640, 480), (544.0, 544.0), (320.0, 240.0), [0.0; 5]).unwrap();
        let seen = |x: f64, z: f64, about_y: f64| {
            let turn = UnitQuaternion::from_euler_angles(0.0, about_y, 0.0);
            let pose = Isometry3::from_parts(Translation3::new(x, -2.5, z), turn);
            let corners: Vec<_> = board
                .corners()
                .map(|corner| camera.project(&(pose * corner)).unwrap())
                .collect();
            RoughPose::new(&board, (640, 480), &corners).unwrap()
        };
        let pose = seen(-4.0, 20.0, 0.4);
        assert!(
            (pose.tilt() - Vector2::new(0.4, 0.0)).norm() < 1e-6,
            "{:?}",
            pose.tilt()
        );
        assert!(
            (pose.distance - 20.0f64.hypot(4.0).hypot(2.5)).abs() < 1e-6,
            "{}",
            pose.distance
        );
        assert!(pose.difference(&seen(-4.1, 20.2, 0.42)) < 0.5);
        assert!(pose.difference(&seen(-4.0, 20.0, 0.7)) > 1.0);
        assert!(pose.difference(&seen(-4.0, 26.0, 0.4)) > 1.0);
        assert!(pose.difference(&seen(-0.0, 20.0, 0.4)) > 1.0);
    }

    #[test]
    fn degenerate_corners_have_no_pose() {
        let board = Board::new((3, 3), None).unwrap();
        assert_eq!(RoughPose::new(&board, (640, 480), &[]), None);
        assert_eq!(
            RoughPose::new(&board, (640, 480), &[Point2::new(1.0, 1.0); 9]),
            None
        );
    }
}
