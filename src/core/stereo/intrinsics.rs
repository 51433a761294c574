//! Camera intrinsics: pinhole and lens distortion (Brown 1971; OpenCV `plumb_bob`).

use crate::error::{Error, Result};
use nalgebra::{Matrix2, Matrix3, Point2, Point3, SMatrix, Vector2};

/// A pinhole camera with Brown's distortion model (Close-range camera calibration, 1971), as in
/// OpenCV's `plumb_bob`.
///
/// With `(x, y) = (X/Z, Y/Z)` and `r² = x² + y²`, the lens maps the point to `x' = x (1 + k1 r² +
/// k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2 x²)`, `y' = y (1 + k1 r² + k2 r⁴ + k3 r⁶) + p1 (r² + 2
/// y²) + 2 p2 x y`, which is pixel `(fx x' + cx, fy y' + cy)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intrinsics {
    size: (usize, usize),
    focal_px: (f64, f64),
    center_px: (f64, f64),
    distortion: [f64; 5],
}

impl Intrinsics {
    /// `size`: width and height in pixels. `focal_px`: fx and fy. `center_px`: the principal point,
    /// pixel centres at integers. `distortion`: k1, k2, p1, p2, k3, all 0 for an ideal lens.
    ///
    /// # Errors
    /// [`Error::Rig`] unless all are finite, the focal lengths positive and the image of at least
    /// one pixel.
    pub fn new(
        size: (usize, usize),
        focal_px: (f64, f64),
        center_px: (f64, f64),
        distortion: [f64; 5],
    ) -> Result<Self> {
        let numbers = [focal_px.0, focal_px.1, center_px.0, center_px.1]
            .into_iter()
            .chain(distortion);
        let finite = numbers.into_iter().all(f64::is_finite);
        if finite && focal_px.0 > 0.0 && focal_px.1 > 0.0 && size.0 > 0 && size.1 > 0 {
            Ok(Self {
                size,
                focal_px,
                center_px,
                distortion,
            })
        } else {
            Err(Error::Rig(format!(
                "image of {}x{} pixels, focal lengths {focal_px:?} px, principal point \
                 {center_px:?} px, distortion {distortion:?} (all must be finite, size and focal \
                 lengths positive)",
                size.0, size.1
            )))
        }
    }

    /// Width and height of the image, pixels.
    pub fn size(&self) -> (usize, usize) {
        self.size
    }

    /// fx and fy in pixels.
    pub fn focal_px(&self) -> (f64, f64) {
        self.focal_px
    }

    /// Principal point in pixels.
    pub fn center_px(&self) -> (f64, f64) {
        self.center_px
    }

    /// k1, k2, p1, p2, k3.
    pub fn distortion(&self) -> [f64; 5] {
        self.distortion
    }

    /// fx, fy, cx, cy, k1, k2, p1, p2, k3.
    pub fn parameters(&self) -> [f64; 9] {
        let ((fx, fy), (cx, cy), [k1, k2, p1, p2, k3]) =
            (self.focal_px, self.center_px, self.distortion);
        [fx, fy, cx, cy, k1, k2, p1, p2, k3]
    }

    /// A camera with an image of the same size and these [`Intrinsics::parameters`].
    ///
    /// # Errors
    /// Those of [`Intrinsics::new`].
    pub fn with_parameters(&self, [fx, fy, cx, cy, k1, k2, p1, p2, k3]: [f64; 9]) -> Result<Self> {
        Self::new(self.size, (fx, fy), (cx, cy), [k1, k2, p1, p2, k3])
    }

    /// K.
    pub fn matrix(&self) -> Matrix3<f64> {
        let ((fx, fy), (cx, cy)) = (self.focal_px, self.center_px);
        Matrix3::new(fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0)
    }

    /// Pixel of a point in the camera frame; `None` for points that are not in front of it.
    pub fn project(&self, point: &Point3<f64>) -> Option<Point2<f64>> {
        (point.z > 0.0).then(|| self.pixel(Vector2::new(point.x / point.z, point.y / point.z)))
    }

    /// Pixel that views the direction `(X/Z, Y/Z)`.
    pub fn pixel(&self, direction: Vector2<f64>) -> Point2<f64> {
        let distorted = self.distort(direction);
        Point2::new(
            self.focal_px.0 * distorted.x + self.center_px.0,
            self.focal_px.1 * distorted.y + self.center_px.1,
        )
    }

    /// [`Intrinsics::pixel`] with its derivatives: by the direction, and by the
    /// [`Intrinsics::parameters`].
    pub fn linearize(
        &self,
        direction: Vector2<f64>,
    ) -> (Point2<f64>, Matrix2<f64>, SMatrix<f64, 2, 9>) {
        let (fx, fy) = self.focal_px;
        let (x, y) = (direction.x, direction.y);
        let (r2, xy) = (x * x + y * y, 2.0 * x * y);
        let (r4, r6) = (r2 * r2, r2 * r2 * r2);
        let distorted = self.distort(direction);
        let mut by_direction = self.jacobian(direction);
        by_direction.row_mut(0).scale_mut(fx);
        by_direction.row_mut(1).scale_mut(fy);
        #[rustfmt::skip]
        let by_parameters = SMatrix::from_row_slice(&[
            distorted.x, 0.0, 1.0, 0.0,
            fx * x * r2, fx * x * r4, fx * xy, fx * (r2 + 2.0 * x * x), fx * x * r6,
            0.0, distorted.y, 0.0, 1.0,
            fy * y * r2, fy * y * r4, fy * (r2 + 2.0 * y * y), fy * xy, fy * y * r6,
        ]);
        let pixel = Point2::new(
            fx * distorted.x + self.center_px.0,
            fy * distorted.y + self.center_px.1,
        );
        (pixel, by_direction, by_parameters)
    }

    /// Direction `(X/Z, Y/Z)` that a pixel views; `None` where the distortion model, extrapolated
    /// beyond its fit, folds back and no direction leads to the pixel.
    pub fn direction(&self, pixel: Point2<f64>) -> Option<Vector2<f64>> {
        let target = Vector2::new(
            (pixel.x - self.center_px.0) / self.focal_px.0,
            (pixel.y - self.center_px.1) / self.focal_px.1,
        );
        let mut direction = target;
        for _ in 0..MAX_STEPS {
            let off = self.distort(direction) - target;
            if off.norm() < CLOSE {
                return Some(direction);
            }
            direction -= self.jacobian(direction).try_inverse()? * off;
        }
        None
    }

    /// The distorted image of a direction, both in units of the focal length.
    fn distort(&self, Vector2 { data, .. }: Vector2<f64>) -> Vector2<f64> {
        let [[x, y]] = data.0;
        let [k1, k2, p1, p2, k3] = self.distortion;
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        Vector2::new(
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        )
    }

    /// Derivative of [`Intrinsics::distort`].
    fn jacobian(&self, at: Vector2<f64>) -> Matrix2<f64> {
        let (x, y) = (at.x, at.y);
        let [k1, k2, p1, p2, k3] = self.distortion;
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        // Twice the derivative of `radial` by r².
        let slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3));
        let mixed = x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y;
        Matrix2::new(
            radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x,
            mixed,
            mixed,
            radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x,
        )
    }
}

/// Convergence threshold in units of the focal length: far below a thousandth of a pixel.
const CLOSE: f64 = 1e-10;
const MAX_STEPS: usize = 50;

#[cfg(test)]
mod tests {
    use super::*;

    fn wide() -> Intrinsics {
        let distortion = [-0.283, 0.074, 0.0002, 0.00002, 0.001];
        Intrinsics::new((752, 480), (458.7, 457.3), (367.2, 248.4), distortion).unwrap()
    }

    #[test]
    fn pixel_and_direction_are_inverse() {
        let camera = wide();
        for (x, y) in [(0.0, 0.0), (751.0, 479.0), (367.2, 248.4), (100.5, 400.25)] {
            let pixel = Point2::new(x, y);
            let back = camera.pixel(camera.direction(pixel).unwrap());
            assert!((back - pixel).norm() < 1e-6, "{pixel} {back}");
        }
    }

    #[test]
    fn the_derivative_is_that_of_the_lens() {
        let (camera, at, step) = (wide(), Vector2::new(0.3, -0.2), 1e-6);
        for (axis, unit) in [Vector2::x(), Vector2::y()].into_iter().enumerate() {
            let difference = (camera.distort(at + unit * step) - camera.distort(at - unit * step))
                / (2.0 * step);
            assert!((camera.jacobian(at).column(axis) - difference).norm() < 1e-8);
        }
    }

    #[test]
    fn the_derivatives_are_those_of_the_pixel() {
        let (camera, at, step) = (wide(), Vector2::new(0.3, -0.2), 1e-6);
        let (pixel, by_direction, by_parameters) = camera.linearize(at);
        assert!((pixel - camera.pixel(at)).norm() < 1e-12);
        for (axis, unit) in [Vector2::x(), Vector2::y()].into_iter().enumerate() {
            let difference =
                (camera.pixel(at + unit * step) - camera.pixel(at - unit * step)) / (2.0 * step);
            assert!(
                (by_direction.column(axis) - difference).norm() < 1e-5,
                "axis {axis}"
            );
        }
        for i in 0..9 {
            let moved = |step: f64| {
                let mut parameters = camera.parameters();
                parameters[i] += step;
                camera.with_parameters(parameters).unwrap().pixel(at)
            };
            let difference = (moved(step) - moved(-step)) / (2.0 * step);
            assert!(
                (by_parameters.column(i) - difference).norm() < 1e-5,
                "parameter {i}"
            );
        }
    }

    #[test]
    fn points_behind_are_not_seen() {
        assert_eq!(wide().project(&Point3::new(0.1, 0.1, -1.0)), None);
        let centre = wide().project(&Point3::new(0.0, 0.0, 2.0)).unwrap();
        assert_eq!((centre.x, centre.y), (367.2, 248.4));
    }

    #[test]
    fn nonsense_is_refused() {
        assert!(Intrinsics::new((0, 480), (1.0, 1.0), (0.0, 0.0), [0.0; 5]).is_err());
        assert!(Intrinsics::new((640, 480), (1.0, -1.0), (0.0, 0.0), [0.0; 5]).is_err());
        assert!(Intrinsics::new((640, 480), (1.0, 1.0), (0.0, 0.0), [f64::NAN; 5]).is_err());
    }
}
