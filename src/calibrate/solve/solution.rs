//! The result of a calibration, with standard deviations.

use serde::{Serialize, Serializer};
use std::fmt::{Display, Formatter};
use svl_core::stereo::{LengthUnit, StereoCalibration};

/// An estimated value with its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Estimated {
    pub value: f64,
    pub deviation: f64,
}

/// Two calibrated cameras, the standard deviation of every number, and the contribution of each
/// view.
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
    /// Unit of length: `metres`, or `squares` of the board.
    pub unit: &'static str,
    pub left: CameraEstimate,
    pub right: CameraEstimate,
    /// Rotation vector of R in `X_right = R X_left + T` about x, y and z, degrees.
    pub rotation_deg: [Estimated; 3],
    /// T, in [`Solution::unit`].
    pub translation: [Estimated; 3],
    /// Distance between the camera centres, in [`Solution::unit`].
    pub baseline: Estimated,
    /// RMS reprojection error of the used corners of both images, pixels: the root of the mean
    /// squared distance, as in OpenCV.
    pub rms_px: f64,
    /// Standard deviation of a corner in x or in y, estimated from the residuals, pixels.
    pub corner_deviation_px: f64,
    pub epipolar: EpipolarError,
    /// Pairs of parameters that the views hardly distinguish: those with a correlation beyond ±0.9,
    /// the strongest first.
    pub correlations: Vec<Correlation>,
    /// Every given view, in order.
    pub views: Vec<ViewFit>,
}

/// The intrinsics of one camera, [`svl_core::stereo::Intrinsics`]; lengths in pixels.
#[derive(Clone, Debug, Serialize)]
pub struct CameraEstimate {
    /// Name of the distortion model.
    pub model: &'static str,
    #[serde(flatten)]
    pub parameters: CameraParameters,
    /// Same as [`Solution::rms_px`], over this camera's corners.
    pub rms_px: f64,
    /// Fraction of the image's 8x6 fields that contain a used corner, 0..=1.
    pub coverage: f64,
}

/// Vertical misalignment of the corners in ideally rectified images: undistorted, rotated so that
/// the baseline is along x, with the mean of the focal lengths.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct EpipolarError {
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

/// One of the given views.
#[derive(Clone, Debug, Serialize)]
pub struct ViewFit {
    /// Reason why it was not used.
    pub refused: Option<String>,
    /// `None` if it was refused.
    pub fit: Option<Fit>,
}

/// A used view.
#[derive(Clone, Debug, Serialize)]
pub struct Fit {
    pub rms_left_px: f64,
    pub rms_right_px: f64,
    /// Mean |Δy| of its rectified corners, [`EpipolarError`].
    pub epipolar_px: f64,
    /// From the left camera to the board's centre, in [`Solution::unit`].
    pub distance: f64,
    /// Angle between the board's normal and the left optical axis, degrees.
    pub tilt_deg: f64,
    pub left: Vec<Corner>,
    pub right: Vec<Corner>,
}

/// A corner in one image.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Corner {
    /// Observed pixel.
    pub seen: (f64, f64),
    /// Observed minus predicted, pixels.
    pub residual: (f64, f64),
    /// True if it was used; the others are outliers.
    pub used: bool,
}

/// Names and estimates, in the order of [`svl_core::stereo::Intrinsics::parameters`]. Serialized as
/// a map.
#[derive(Clone, Debug)]
pub struct CameraParameters(pub Vec<(&'static str, Estimated)>);

impl CameraParameters {
    /// The estimate of that name.
    pub fn get(&self, name: &str) -> Option<Estimated> {
        let mut parameters = self.0.iter();
        parameters.find_map(|(other, estimated)| (*other == name).then_some(*estimated))
    }
}

impl Serialize for CameraParameters {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(name, estimated)| (name, estimated)))
    }
}

impl Solution {
    /// Number of used views.
    pub fn used(&self) -> usize {
        self.views.iter().filter(|view| view.fit.is_some()).count()
    }

    /// The refused views: index among the given ones, and the reason.
    pub fn refused(&self) -> impl Iterator<Item = (usize, &str)> {
        self.views
            .iter()
            .enumerate()
            .filter_map(|(i, view)| Some((i, view.refused.as_deref()?)))
    }

    /// The used views, with their indices.
    pub fn fits(&self) -> impl Iterator<Item = (usize, &Fit)> {
        self.views
            .iter()
            .enumerate()
            .filter_map(|(i, view)| Some((i, view.fit.as_ref()?)))
    }

    /// Number of corners of used views that were refused as outliers, in both images.
    pub fn outliers(&self) -> usize {
        self.fits()
            .flat_map(|(_, fit)| fit.left.iter().chain(&fit.right))
            .filter(|corner| !corner.used)
            .count()
    }
}

/// The name of a unit.
pub(super) fn unit(unit: LengthUnit) -> &'static str {
    match unit {
        LengthUnit::Metres => "metres",
        LengthUnit::Squares => "squares",
    }
}

impl Display for Estimated {
    /// Formatted as `533.42 ± 0.34`: two significant digits of the standard deviation, and as many
    /// decimals of the value.
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let Self { value, deviation } = self;
        // The cast saturates at 0.
        let digits = if *deviation > 0.0 {
            (1.0 - deviation.log10().floor()).min(9.0) as usize
        } else {
            9
        };
        f.pad(&format!("{value:.digits$} ± {deviation:.digits$}"))
    }
}

impl Solution {
    /// The symbol of [`Solution::unit`].
    pub fn unit_sign(&self) -> &'static str {
        if self.unit == "metres" {
            "m"
        } else {
            "squares"
        }
    }
}
