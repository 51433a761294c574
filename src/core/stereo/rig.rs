//! The geometry of a rectified stereo camera.

use super::Side;
use super::limits::{LengthUnit, check_baseline};
use crate::error::{Error, Result};
use nalgebra::{Matrix3, Matrix3x4};

/// Greatest difference of the focal lengths along rows and columns, as a fraction.
const SQUARE: f64 = 0.01;

/// A rectified stereo rig: two pinhole cameras with one focal length, displaced along x by the
/// baseline.
///
/// Depth is `focal_px * baseline_m / (disparity + doffs_px)`.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(try_from = "RigNumbers")]
pub struct Rig {
    focal_px: f64,
    cx_px: f64,
    cy_px: f64,
    baseline_m: f64,
    doffs_px: f64,
}

impl Rig {
    /// Disparities this close to that of infinity are at infinity: files round them.
    #[doc(hidden)]
    pub const INFINITE_PX: f64 = 1e-4;

    /// `cx_px`, `cy_px`: principal point of the left image. `doffs_px`: the right image's principal
    /// point minus the left's, along x (Middlebury's `doffs`), 0 if they are equal.
    ///
    /// # Errors
    /// [`Error::Rig`] unless all are finite, the focal length positive, and the baseline between
    /// 0.5 mm and 30 m.
    pub fn new(
        focal_px: f64,
        center_px: (f64, f64),
        baseline_m: f64,
        doffs_px: f64,
    ) -> Result<Self> {
        Self::in_unit(
            focal_px,
            center_px,
            baseline_m,
            doffs_px,
            LengthUnit::Metres,
        )
    }

    /// The same with a baseline in another unit, of which only metres are checked.
    #[doc(hidden)]
    pub fn in_unit(
        focal_px: f64,
        (cx_px, cy_px): (f64, f64),
        baseline_m: f64,
        doffs_px: f64,
        unit: LengthUnit,
    ) -> Result<Self> {
        let finite = [focal_px, cx_px, cy_px, baseline_m, doffs_px]
            .iter()
            .all(|v| v.is_finite());
        if finite && focal_px > 0.0 && baseline_m > 0.0 {
            check_baseline(baseline_m, unit)?;
            Ok(Self {
                focal_px,
                cx_px,
                cy_px,
                baseline_m,
                doffs_px,
            })
        } else {
            Err(Error::Rig(format!(
                "focal length {focal_px} px, principal point ({cx_px}, {cy_px}) px, baseline \
                 {baseline_m} m, doffs {doffs_px} px (all must be finite, the first and the \
                 baseline positive)"
            )))
        }
    }

    /// The rig of two rectified cameras by their projection matrices, `[f 0 cx tx; 0 f cy 0; 0 0 1
    /// 0]` with `tx = -f·x` of a camera at `x` (OpenCV's P1 and P2, ROS's CameraInfo). Both use one
    /// frame, not necessarily the left camera's: the baseline is `(tx_left - tx_right) / f`.
    ///
    /// # Errors
    /// [`Error::Rig`] if pixels are not square within 1 %, if the focal lengths differ by more than
    /// the fraction `focal_tolerance`, the principal rows by more than `row_tolerance_px`, the
    /// right camera is to the left of the left one, or a baseline in metres is not between 0.5 mm
    /// and 30 m.
    pub fn from_projections(
        left: &Matrix3x4<f64>,
        right: &Matrix3x4<f64>,
        focal_tolerance: f64,
        row_tolerance_px: f64,
        unit: LengthUnit,
    ) -> Result<Self> {
        let [(f, cx, cy), (right_f, right_cx, right_cy)] =
            [left, right].map(|p| (p[(0, 0)], p[(0, 2)], p[(1, 2)]));
        let close = |a: f64, b: f64, tolerance: f64| (a - b).abs() <= tolerance;
        for (fx, fy) in [left, right].map(|p| (p[(0, 0)], p[(1, 1)])) {
            if !close(fx, fy, SQUARE * fx) {
                return Err(Error::Rig(format!(
                    "focal lengths of {fx:.3} px along rows and {fy:.3} px along columns: \
                     rectified pixels are square; rectify both cameras with one focal length"
                )));
            }
        }
        if !close(f, right_f, focal_tolerance * f) || !close(cy, right_cy, row_tolerance_px) {
            return Err(Error::Rig(format!(
                "the cameras are not rectified to each other, with one focal length and one row \
                 of the principal point: {f:.3} and {right_f:.3} px, rows {cy:.3} and {right_cy:.3}"
            )));
        }
        let baseline_m = (left[(0, 3)] - right[(0, 3)]) / f;
        if baseline_m < 0.0 {
            return Err(Error::Rig(format!(
                "a baseline of {baseline_m} m: the right camera is to the left of the left one; \
                 swap the two"
            )));
        }
        Self::in_unit(f, (cx, cy), baseline_m, right_cx - cx, unit)
    }

    /// Focal length in pixels.
    pub fn focal_px(&self) -> f64 {
        self.focal_px
    }

    /// Principal point of the left image.
    pub fn center_px(&self) -> (f64, f64) {
        (self.cx_px, self.cy_px)
    }

    pub fn baseline_m(&self) -> f64 {
        self.baseline_m
    }

    pub fn doffs_px(&self) -> f64 {
        self.doffs_px
    }

    /// The rig of images of half the size: pixels are twice as large.
    #[must_use]
    pub(crate) fn halved(self) -> Self {
        Self {
            focal_px: self.focal_px / 2.0,
            cx_px: self.cx_px / 2.0,
            cy_px: self.cy_px / 2.0,
            doffs_px: self.doffs_px / 2.0,
            ..self
        }
    }

    /// True if a point can have that disparity: not beyond infinity by more than a pixel.
    pub fn is_possible(&self, disparity_px: f64) -> bool {
        disparity_px + self.doffs_px >= -1.0
    }

    /// Depth along the optical axis of a point with that disparity; `None` at or beyond infinity.
    pub fn depth_m(&self, disparity_px: f64) -> Option<f64> {
        let shift = disparity_px + self.doffs_px;
        (shift > Self::INFINITE_PX).then(|| self.focal_px * self.baseline_m / shift)
    }

    /// Disparity in pixels of a point at `depth_m` metres.
    pub fn disparity_px(&self, depth_m: f64) -> f64 {
        self.focal_px * self.baseline_m / depth_m - self.doffs_px
    }

    /// Disparity of what is at infinity, pixels.
    pub fn infinity_px(&self) -> f32 {
        // Not -0.
        -self.doffs_px as f32 + 0.0
    }

    /// The point at a pixel of the left image with that depth, metres in the left camera's optical
    /// frame: x to the right, y down, z forward.
    pub fn point_m(&self, (x_px, y_px): (f64, f64), depth_m: f64) -> [f64; 3] {
        let along = |from_center: f64| from_center / self.focal_px * depth_m;
        [along(x_px - self.cx_px), along(y_px - self.cy_px), depth_m]
    }

    /// K of a camera.
    pub fn intrinsics(&self, side: Side) -> Matrix3<f64> {
        let cx = match side {
            Side::Left => self.cx_px,
            Side::Right => self.cx_px + self.doffs_px,
        };
        Matrix3::new(
            self.focal_px,
            0.0,
            cx,
            0.0,
            self.focal_px,
            self.cy_px,
            0.0,
            0.0,
            1.0,
        )
    }

    /// Projection matrix P of a camera; for the right one, `P[0][3] = -f·B`.
    pub fn projection(&self, side: Side) -> Matrix3x4<f64> {
        let mut p = self.intrinsics(side).fixed_resize::<3, 4>(0.0);
        if side == Side::Right {
            p[(0, 3)] = -self.focal_px * self.baseline_m;
        }
        p
    }
}

/// The numbers of a rig as read from a file, not yet checked.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct RigNumbers {
    focal_px: f64,
    cx_px: f64,
    cy_px: f64,
    baseline_m: f64,
    #[serde(default)]
    doffs_px: f64,
}

impl TryFrom<RigNumbers> for Rig {
    type Error = Error;
    fn try_from(n: RigNumbers) -> Result<Self> {
        Self::new(n.focal_px, (n.cx_px, n.cy_px), n.baseline_m, n.doffs_px)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_and_disparity_are_inverse() {
        let rig = Rig::new(328.0, (159.5, 119.5), 0.044, 3.5).unwrap();
        for depth in [0.1, 0.5, 3.0] {
            let back = rig.depth_m(rig.disparity_px(depth)).unwrap();
            assert!((back - depth).abs() < 1e-12);
        }
        assert_eq!(rig.depth_m(-3.5), None);
    }

    #[test]
    fn infinity_in_a_map_has_no_depth() {
        // In 32 bits, offsets that end are kept, and others rounded to either side.
        for doffs_px in [0.0, -5.0, 3.5, 31.123456789, -31.123456789, 5.1, 0.1, -0.1] {
            let rig = Rig::new(328.0, (159.5, 119.5), 0.044, doffs_px).unwrap();
            let px = rig.infinity_px();
            assert_eq!(rig.depth_m(px.into()), None, "{doffs_px}");
            assert!(rig.depth_m((px + 0.001).into()).is_some(), "{doffs_px}");
            assert_eq!(rig.disparity_px(f64::INFINITY) as f32, px, "{doffs_px}");
        }
    }

    #[test]
    fn nonsense_is_refused() {
        assert!(Rig::new(f64::NAN, (0.0, 0.0), 0.1, 0.0).is_err());
        assert!(Rig::new(300.0, (0.0, 0.0), 0.0, 0.0).is_err());
        let camera = |fy: f64, tx: f64| {
            Matrix3x4::new(
                300.0, 0.0, 160.0, tx, 0.0, fy, 120.0, 0.0, 0.0, 0.0, 1.0, 0.0,
            )
        };
        let metres = LengthUnit::Metres;
        let rig =
            |fy: f64| Rig::from_projections(&camera(fy, 0.0), &camera(fy, -30.0), 0.0, 0.0, metres);
        assert_eq!(rig(301.0).unwrap().baseline_m(), 0.1);
        for fy in [150.0, -300.0, f64::NAN] {
            assert!(rig(fy).unwrap_err().to_string().contains("square"));
        }
    }
}
