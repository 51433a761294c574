//! A camera of a pair with its rectifying rotation.

use crate::stereo::{Distortion, Intrinsics, MAX_RADIUS};
use nalgebra::{Point2, Rotation3, Vector2, Vector3};

/// A camera whose directions are in the rectified frame, as `(X/Z, Y/Z)`.
#[derive(Clone, Debug)]
pub(super) struct RotatedCamera {
    camera: Intrinsics,
    /// `X_rectified = rotation · X_camera`.
    rotation: Rotation3<f64>,
    /// Square of the radius at which the distortion model stops being monotonic.
    fold_r2: f64,
}

impl RotatedCamera {
    pub(super) fn new(camera: Intrinsics, rotation: Rotation3<f64>) -> Self {
        Self {
            camera,
            rotation,
            fold_r2: camera.distortion().max_radius().powi(2),
        }
    }

    /// The direction of a pixel; `None` if it is beside or behind the rectified camera, or if the
    /// distortion cannot be inverted there.
    pub(super) fn direction(&self, pixel: Point2<f64>) -> Option<Vector2<f64>> {
        let seen = self
            .camera
            .direction(pixel)
            .filter(|seen| seen.norm_squared() < self.fold_r2)?;
        onto_plane(self.rotation * seen.push(1.0))
    }

    /// The pixel of a direction; `None` behind the camera, or if the distortion is undefined.
    pub(super) fn pixel(&self, direction: Vector2<f64>) -> Option<Point2<f64>> {
        let seen = onto_plane(self.rotation.inverse() * direction.push(1.0))?;
        (seen.norm_squared() < self.fold_r2).then(|| self.camera.pixel(seen))
    }

    /// True if pixels may be 90° or more off the axis, where no direction is on a plane.
    pub(super) fn sees_beyond_the_plane(&self) -> bool {
        matches!(self.camera.distortion(), Distortion::Equidistant(_))
    }

    /// [`Intrinsics::fold_px`], wherever it is.
    pub(super) fn fold_px(&self) -> Option<f64> {
        self.camera.fold_px(f64::MAX)
    }

    /// Width and height of the camera's image.
    pub(super) fn size(&self) -> (usize, usize) {
        self.camera.size()
    }
}

fn onto_plane(v: Vector3<f64>) -> Option<Vector2<f64>> {
    let on_plane = v.xy() / v.z;
    (v.z > 0.0 && on_plane.norm_squared() < MAX_RADIUS * MAX_RADIUS).then_some(on_plane)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_beyond_the_fold_are_undefined() {
        let camera = Intrinsics::new(
            (640, 480),
            (500.0, 500.0),
            (319.5, 239.5),
            [-0.3, 0.0, 0.0, 0.0, 0.0],
        )
        .unwrap();
        let view = RotatedCamera::new(camera, Rotation3::identity());
        // 1 − 0.9 r² is 0 at r = 1.054.
        assert!(view.pixel(Vector2::new(1.05, 0.0)).is_some());
        assert_eq!(view.pixel(Vector2::new(1.06, 0.0)), None);
        assert_eq!(
            view.pixel(Vector2::new(1.8, 0.0)),
            None,
            "the model would put it into the picture"
        );
    }

    #[test]
    fn directions_are_those_of_the_rotated_camera() {
        let camera = Intrinsics::new(
            (640, 480),
            (500.0, 510.0),
            (319.5, 239.5),
            [-0.3, 0.1, 1e-3, 2e-4, 0.0],
        )
        .unwrap();
        let view = RotatedCamera::new(camera, Rotation3::from_euler_angles(0.02, -0.03, 0.01));
        for pixel in [Point2::new(0.0, 0.0), Point2::new(600.0, 100.0)] {
            let back = view.pixel(view.direction(pixel).unwrap()).unwrap();
            assert!((back - pixel).norm() < 1e-6);
        }
    }
}
