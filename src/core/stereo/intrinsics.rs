//! Camera intrinsics: a pinhole and lens distortion.

use super::Distortion;
use crate::error::{Error, Result};
use nalgebra::{Matrix2, Matrix3, Point2, Point3, SMatrix, Vector2};

/// A pinhole camera with a lens: the direction `(X/Z, Y/Z)`, distorted to `(x', y')`, is pixel
/// `(fx x' + cx, fy y' + cy)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intrinsics {
    size: (usize, usize),
    focal_px: (f64, f64),
    center_px: (f64, f64),
    distortion: Distortion,
}

impl Intrinsics {
    /// `size`: width and height in pixels. `focal_px`: fx and fy. `center_px`: the principal point,
    /// pixel centres at integers. `distortion`: a [`Distortion`], or `plumb_bob`'s k1, k2, p1, p2,
    /// k3, all 0 for an ideal lens.
    ///
    /// # Errors
    /// [`Error::Rig`] unless all are finite, the focal lengths positive and the image of at least
    /// one pixel.
    pub fn new(
        size: (usize, usize),
        focal_px: (f64, f64),
        center_px: (f64, f64),
        distortion: impl Into<Distortion>,
    ) -> Result<Self> {
        let distortion = distortion.into();
        let coefficients = distortion.coefficients();
        let numbers = [focal_px.0, focal_px.1, center_px.0, center_px.1];
        let finite = (numbers.iter().chain(coefficients)).all(|number| number.is_finite());
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
                 {center_px:?} px, distortion {coefficients:?} (all must be finite, size and focal \
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

    pub fn distortion(&self) -> &Distortion {
        &self.distortion
    }

    /// The same camera with another lens.
    ///
    /// # Errors
    /// The errors of [`Intrinsics::new`].
    pub fn with_distortion(&self, distortion: impl Into<Distortion>) -> Result<Self> {
        Self::new(self.size, self.focal_px, self.center_px, distortion)
    }

    /// Names of the numbers that a calibration estimates: fx, fy, cx, cy, then
    /// [`DistortionModel::coefficient_names`](super::DistortionModel::coefficient_names).
    pub fn parameter_names(&self) -> impl Iterator<Item = &'static str> {
        let coefficients = self.distortion.model().coefficient_names();
        ["fx", "fy", "cx", "cy"]
            .into_iter()
            .chain(coefficients.iter().copied())
    }

    /// The values of [`Intrinsics::parameter_names`].
    pub fn parameters(&self) -> Vec<f64> {
        let ((fx, fy), (cx, cy)) = (self.focal_px, self.center_px);
        let count = self.distortion.model().coefficient_names().len();
        [&[fx, fy, cx, cy], &self.distortion.coefficients()[..count]].concat()
    }

    /// A camera with an image of the same size, the same model and these
    /// [`Intrinsics::parameters`].
    ///
    /// # Errors
    /// The errors of [`Intrinsics::new`], and [`Error::Rig`] for fewer than four numbers.
    ///
    /// # Panics
    /// For more numbers than the camera has parameters.
    pub fn with_parameters(&self, parameters: &[f64]) -> Result<Self> {
        let [fx, fy, cx, cy, coefficients @ ..] = parameters else {
            let count = parameters.len();
            return Err(Error::Rig(format!(
                "{count} parameters; a camera has more than four"
            )));
        };
        let distortion = self.distortion.with_first(coefficients);
        Self::new(self.size, (*fx, *fy), (*cx, *cy), distortion)
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
        self.pixel_of_distorted(self.distortion.distort(direction))
    }

    fn pixel_of_distorted(&self, distorted: Vector2<f64>) -> Point2<f64> {
        Point2::new(
            self.focal_px.0 * distorted.x + self.center_px.0,
            self.focal_px.1 * distorted.y + self.center_px.1,
        )
    }

    /// The distorted image coordinates of a pixel, in units of the focal lengths.
    fn distorted(&self, pixel: Point2<f64>) -> Vector2<f64> {
        Vector2::new(
            (pixel.x - self.center_px.0) / self.focal_px.0,
            (pixel.y - self.center_px.1) / self.focal_px.1,
        )
    }

    /// [`Intrinsics::pixel`] with its derivatives: by the direction, and by the
    /// [`Intrinsics::parameters`], one a column; the rest of the columns are 0.
    pub fn linearize(
        &self,
        direction: Vector2<f64>,
    ) -> (Point2<f64>, Matrix2<f64>, SMatrix<f64, 2, 12>) {
        let (distorted, mut by_direction, mut by_coefficients) =
            self.distortion.linearize(direction);
        for (row, focal) in [self.focal_px.0, self.focal_px.1].into_iter().enumerate() {
            by_direction.row_mut(row).scale_mut(focal);
            by_coefficients.row_mut(row).scale_mut(focal);
        }
        let mut by_parameters = SMatrix::<f64, 2, 12>::zeros();
        by_parameters[(0, 0)] = distorted.x;
        by_parameters[(1, 1)] = distorted.y;
        by_parameters[(0, 2)] = 1.0;
        by_parameters[(1, 3)] = 1.0;
        let mut columns = by_parameters.fixed_columns_mut::<8>(4);
        columns.copy_from(&by_coefficients);
        let pixel = self.pixel_of_distorted(distorted);
        (pixel, by_direction, by_parameters)
    }

    /// Direction `(X/Z, Y/Z)` that a pixel views; `None` where the distortion model, extrapolated
    /// beyond its fit, folds back and no direction leads to the pixel, and 90° or more off the
    /// axis.
    pub fn direction(&self, pixel: Point2<f64>) -> Option<Vector2<f64>> {
        self.distortion.undistort(self.distorted(pixel))
    }

    /// Horizontal and vertical field of view through the principal point, radians; `None` where the
    /// distortion model ends inside the image.
    pub fn field_of_view(&self) -> Option<(f64, f64)> {
        let angle = |x: f64, y: f64| self.distortion.angle(self.distorted(Point2::new(x, y)));
        let ((width, height), (cx, cy)) = (self.size, self.center_px);
        let (right, bottom) = ((width - 1) as f64, (height - 1) as f64);
        let horizontal = angle(0.0, cy)? + angle(right, cy)?;
        Some((horizontal, angle(cx, 0.0)? + angle(cx, bottom)?))
    }

    /// Distance from the principal point at which the distortion model folds, pixels: beyond it,
    /// two directions share a pixel. `None` if it does not fold within `limit_px`.
    pub fn fold_px(&self, limit_px: f64) -> Option<f64> {
        let focal = (self.focal_px.0 * self.focal_px.1).sqrt();
        self.distortion
            .fold(limit_px / focal)
            .map(|fold| fold * focal)
    }

    /// Distances from the principal point to the nearest and to the farthest side of the image,
    /// pixels.
    pub fn side_distances_px(&self) -> (f64, f64) {
        let ((width, height), (cx, cy)) = (self.size, self.center_px);
        let sides = [cx, cy, width as f64 - 1.0 - cx, height as f64 - 1.0 - cy];
        (
            sides.into_iter().fold(f64::MAX, f64::min),
            sides.into_iter().fold(0.0, f64::max),
        )
    }
}

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
                camera.with_parameters(&parameters).unwrap().pixel(at)
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
