//! What a calibration comes to, with how sure it is.

use crate::stereo::{LengthUnit, StereoCalibration};
use serde::Serialize;

/// A number with its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Estimate {
    pub value: f64,
    pub deviation: f64,
}

/// Two calibrated cameras, how sure every number is, and what each view contributed.
///
/// Standard deviations are those of the estimate if the corners' errors are independent and normal:
/// the covariance at the solution, `σ² (JᵀJ)⁻¹`, `σ²` from the residuals (Triggs et al., section
/// 10.2 of their synthesis; Zhang, section 5).
#[derive(Clone, Debug, Serialize)]
pub struct Solution {
    #[serde(skip)]
    pub calibration: StereoCalibration,
    /// Inner corners of the board: columns and rows.
    pub board: (usize, usize),
    /// Width and height of the images, pixels.
    pub size: (usize, usize),
    /// What lengths are in: `metres`, or `squares` of the board.
    pub unit: &'static str,
    pub left: Camera,
    pub right: Camera,
    /// Rotation vector of R in `X_right = R X_left + T` about x, y and z, degrees.
    pub rotation_deg: [Estimate; 3],
    /// T, in [`Solution::unit`].
    pub translation: [Estimate; 3],
    /// Distance of the cameras' centres, in [`Solution::unit`].
    pub baseline: Estimate,
    /// Root of the mean squared distance of the kept corners of both images from where they should
    /// be, as OpenCV's.
    pub rms_px: f64,
    /// Standard deviation of a corner in x or in y that the residuals tell.
    pub corner_deviation_px: f64,
    pub epipolar: Epipolar,
    /// Pairs of parameters that the views hardly tell apart: their correlation is beyond ±0.9, the
    /// strongest first.
    pub correlations: Vec<Correlation>,
    /// Every view that was given, in their order.
    pub views: Vec<ViewFit>,
}

/// The intrinsics of one camera, [`crate::stereo::Intrinsics`]; lengths in pixels.
#[derive(Clone, Debug, Serialize)]
pub struct Camera {
    pub fx: Estimate,
    pub fy: Estimate,
    pub cx: Estimate,
    pub cy: Estimate,
    pub k1: Estimate,
    pub k2: Estimate,
    pub p1: Estimate,
    pub p2: Estimate,
    pub k3: Estimate,
    /// As [`Solution::rms_px`], over this camera's corners.
    pub rms_px: f64,
    /// Share of the image's 8x6 fields in which a kept corner lies.
    pub coverage: f64,
}

/// How far corners of one rectified pair are from one row: the images turned so that the baseline
/// is along x, lenses undone, with the mean of the focal lengths.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Epipolar {
    /// Mean of |Δy|, pixels.
    pub mean_px: f64,
    /// Root of the mean of Δy², pixels.
    pub rms_px: f64,
    pub worst_px: f64,
}

#[derive(Clone, Debug, Serialize)]
pub struct Correlation {
    pub first: String,
    pub second: String,
    pub correlation: f64,
}

/// One view that was given.
#[derive(Clone, Debug, Serialize)]
pub struct ViewFit {
    /// Why it was not used; nothing where it was.
    pub refused: Option<String>,
    /// Nothing where it was refused.
    pub fit: Option<Fit>,
}

/// A view that was used.
#[derive(Clone, Debug, Serialize)]
pub struct Fit {
    pub rms_left_px: f64,
    pub rms_right_px: f64,
    /// Mean |Δy| of its rectified corners, [`Epipolar`].
    pub epipolar_px: f64,
    /// From the left camera to the board's middle, in [`Solution::unit`].
    pub distance: f64,
    /// Between the board's normal and the left optical axis, degrees.
    pub tilt_deg: f64,
    pub left: Vec<Corner>,
    pub right: Vec<Corner>,
}

/// A corner in one image.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Corner {
    /// Where it was seen, pixels.
    pub seen: (f64, f64),
    /// Seen minus where it should be, pixels.
    pub residual: (f64, f64),
    /// Whether it was used; the others are outliers.
    pub used: bool,
}

impl Camera {
    /// Names and estimates, in the order of [`crate::stereo::Intrinsics::parameters`].
    pub fn parameters(&self) -> [(&'static str, Estimate); 9] {
        let Self {
            fx,
            fy,
            cx,
            cy,
            k1,
            k2,
            p1,
            p2,
            k3,
            ..
        } = *self;
        [
            ("fx", fx),
            ("fy", fy),
            ("cx", cx),
            ("cy", cy),
            ("k1", k1),
            ("k2", k2),
            ("p1", p1),
            ("p2", p2),
            ("k3", k3),
        ]
    }
}

impl Solution {
    /// How many views were used.
    pub fn used(&self) -> usize {
        self.views.iter().filter(|view| view.fit.is_some()).count()
    }

    /// The views that were refused: their place among those given, and why.
    pub fn refused(&self) -> impl Iterator<Item = (usize, &str)> {
        self.views
            .iter()
            .enumerate()
            .filter_map(|(i, view)| Some((i, view.refused.as_deref()?)))
    }

    /// The views that were used, with their places.
    pub fn fits(&self) -> impl Iterator<Item = (usize, &Fit)> {
        self.views
            .iter()
            .enumerate()
            .filter_map(|(i, view)| Some((i, view.fit.as_ref()?)))
    }

    /// How many corners of used views were refused as outliers, in both images.
    pub fn outliers(&self) -> usize {
        self.fits()
            .flat_map(|(_, fit)| fit.left.iter().chain(&fit.right))
            .filter(|corner| !corner.used)
            .count()
    }
}

/// The word for a unit.
pub(super) fn unit(unit: LengthUnit) -> &'static str {
    match unit {
        LengthUnit::Metres => "metres",
        LengthUnit::Squares => "squares",
    }
}
