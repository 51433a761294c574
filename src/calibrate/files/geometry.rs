//! Cameras from the matrices of a file, with consistency checks.

use super::document::Document;
use super::format::{CalibrationFormat, Hints, LoadedCalibration};
use super::unit::FileUnit;
use nalgebra::{Isometry3, Matrix3, Matrix3x4, Rotation3, Translation3, Vector3};
use svl_core::Result;
use svl_core::stereo::{
    Distortion, DistortionModel, Intrinsics, LengthUnit, Rectification, Rig, Side,
    StereoCalibration, check_offsets, check_size, motion,
};

/// Rectified cameras count as one pinhole if they differ by at most this fraction of the focal
/// length.
const SAME: f64 = 1e-6;

/// Largest difference between a rectification and the extrinsics in the same file: fraction of the
/// baseline, radians.
const GEOMETRY_TOLERANCE: f64 = 0.02;

/// The cameras of a file, in its unit of length.
pub(super) struct StereoParameters {
    pub left: Intrinsics,
    pub right: Intrinsics,
    /// Extrinsics; if the file has none, they follow from the rectification.
    pub right_from_left: Option<Isometry3<f64>>,
    pub rectification: Option<Rectification>,
}

impl StereoParameters {
    /// The calibration read from `document`, whose lengths are in `unit`.
    ///
    /// # Errors
    /// [`svl_core::Error::Format`] for parameters no stereo camera has, and for a rectification
    /// that contradicts the extrinsics.
    pub(super) fn loaded(
        self,
        format: &'static CalibrationFormat,
        document: &Document,
        unit: FileUnit,
        remarks: Vec<String>,
    ) -> Result<LoadedCalibration> {
        Ok(LoadedCalibration {
            format,
            calibration: self.calibration(document, unit)?,
            remarks,
        })
    }

    fn calibration(self, document: &Document, unit: FileUnit) -> Result<StereoCalibration> {
        let Self {
            left,
            right,
            right_from_left,
            rectification,
        } = self;
        let implied = rectification.as_ref().map(Rectification::motion);
        let Some(stated) = right_from_left.or(implied) else {
            return Err(document.error("has no extrinsics (R and T) and no rectification"));
        };
        let (scale, unit) = unit.in_calibration();
        let error = |e: svl_core::Error| document.error(e);
        let motion = Isometry3::from_parts(
            Translation3::from(stated.translation.vector * scale),
            stated.rotation,
        );
        let calibration = StereoCalibration::new(left, right, motion, unit).map_err(error)?;
        let (Some(rectification), Some(implied)) = (rectification, implied) else {
            return Ok(calibration);
        };
        let baseline = stated.translation.vector.norm();
        // With a rectification, R and T state the extrinsics a second time; both must agree.
        let off = (implied.translation.vector - stated.translation.vector).norm() / baseline;
        if off > GEOMETRY_TOLERANCE
            || implied.rotation.angle_to(&stated.rotation) > GEOMETRY_TOLERANCE
        {
            return Err(document.error(format!(
                "its rectification does not agree with its R and T: a baseline of {} and of \
                 {baseline}; take both from one calibration",
                rectification.rig.baseline_m()
            )));
        }
        let rig = rectification.rig;
        let rig = Rig::in_unit(
            rig.focal_px(),
            rig.center_px(),
            rig.baseline_m() * scale,
            rig.doffs_px(),
            unit,
        )
        .map_err(error)?;
        Ok(calibration.with_rectification(Rectification {
            rig,
            ..rectification
        }))
    }
}

/// The camera of a matrix K under `key` and its distortion.
///
/// # Errors
/// [`svl_core::Error::Format`] with `key`, for a skew and for a matrix that is not a camera's.
pub(super) fn camera(
    document: &Document,
    key: &str,
    size: (usize, usize),
    distortion: impl Into<Distortion>,
) -> Result<Intrinsics> {
    let k = document.matrix(key)?;
    pinhole(size, &k, distortion).map_err(|reason| document.error(format!("'{key}': {reason}")))
}

/// The camera of a matrix K and its distortion.
pub(super) fn pinhole(
    size: (usize, usize),
    k: &Matrix3<f64>,
    distortion: impl Into<Distortion>,
) -> std::result::Result<Intrinsics, String> {
    if k[(0, 1)].abs() > SAME * k[(0, 0)].abs() {
        return Err(format!(
            "a skew of {}, which svl's cameras do not have; calibrate without",
            k[(0, 1)]
        ));
    }
    if [k[(1, 0)], k[(2, 0)], k[(2, 1)]] != [0.0; 3] || k[(2, 2)] != 1.0 {
        return Err("is not a camera matrix: expected fx 0 cx, 0 fy cy, 0 0 1".into());
    }
    let (focal, center) = ((k[(0, 0)], k[(1, 1)]), (k[(0, 2)], k[(1, 2)]));
    Intrinsics::new(size, focal, center, distortion).map_err(|e| e.to_string())
}

/// The image size that a file states, else the one that the user named.
///
/// # Errors
/// [`svl_core::Error::Format`] if neither does, or they differ.
pub(super) fn image_size(
    document: &Document,
    stated: Option<(usize, usize)>,
    hints: &Hints,
) -> Result<(usize, usize)> {
    match (stated, hints.size) {
        (Some(size), Some(named)) => {
            check_size(size, named).map_err(|e| document.error(e))?;
            Ok(size)
        }
        (Some(size), None) | (None, Some(size)) => Ok(size),
        (None, None) => Err(document.error(
            "does not contain the image size; name it with `svl calibrate convert --size WxH`",
        )),
    }
}

/// The distortion model that a file states under `key`.
///
/// # Errors
/// [`svl_core::Error::Format`] for a model that svl does not know, and if the user named another.
pub(super) fn stated_model(
    document: &Document,
    key: &str,
    hints: &Hints,
) -> Result<DistortionModel> {
    let stated = document.text(key)?;
    let model = stated
        .parse::<DistortionModel>()
        .map_err(|e| document.error(format!("'{key}': {e}")))?;
    match hints.model {
        Some(named) if named != model => Err(document.error(format!(
            "states its distortion model itself, '{key}' {stated}; omit --model"
        ))),
        _ => Ok(model),
    }
}

/// The distortion of the coefficients under `key`.
///
/// # Errors
/// [`svl_core::Error::Format`] for another number of coefficients than the model has.
pub(super) fn read_distortion(
    document: &Document,
    key: &str,
    model: DistortionModel,
) -> Result<Distortion> {
    let distortion = model.with_coefficients(&document.numbers(key)?);
    distortion.map_err(|e| document.error(format!("'{}': {e}", key.replace('|', "' or '"))))
}

/// Extrinsics from R and T.
///
/// # Errors
/// [`svl_core::Error::Format`] with the key.
pub(super) fn extrinsics(document: &Document, r: &str, t: &str) -> Result<Isometry3<f64>> {
    let translation = Vector3::from(document.array::<3>(t)?);
    motion(&document.matrix(r)?, translation).map_err(|e| document.error(format!("'{r}': {e}")))
}

/// The rig of two projection matrices, whose baseline is in `unit`. Both are relative to one frame,
/// not necessarily the left camera's: the baseline is `(P1(0,3) − P2(0,3)) / f`.
pub(super) fn rig(
    left: &Matrix3x4<f64>,
    right: &Matrix3x4<f64>,
    unit: LengthUnit,
) -> std::result::Result<Rig, String> {
    let focal = left[(0, 0)];
    let same = |a: f64, b: f64| (a - b).abs() <= SAME * focal.abs();
    let [shift, rise] = [0, 1].map(|row| left[(row, 3)] - right[(row, 3)]);
    // A vertical pair has its baseline in the second row of the fourth column.
    if rise.abs() > shift.abs() {
        return Err(
            "the cameras are mounted one above the other; svl matches those side by side".into(),
        );
    }
    if !same(left[(1, 1)], focal) || !same(right[(1, 1)], focal) {
        return Err("rectified cameras have one focal length, along x and along y".into());
    }
    if unit == LengthUnit::Metres {
        check_offsets(left, right).map_err(|e| e.to_string())?;
    }
    Rig::from_projections(left, right, SAME, SAME * focal.abs(), unit).map_err(|e| e.to_string())
}

/// Two cameras that are already rectified: no distortion, no rotation.
pub(super) fn rectified(
    document: &Document,
    size: (usize, usize),
    rig: Rig,
) -> Result<StereoParameters> {
    let camera =
        |side| pinhole(size, &rig.intrinsics(side), [0.0; 5]).map_err(|e| document.error(e));
    let (left, right) = (camera(Side::Left)?, camera(Side::Right)?);
    let none = Rotation3::identity();
    let rectification = Some(Rectification {
        size,
        left: none,
        right: none,
        rig,
    });
    Ok(StereoParameters {
        left,
        right,
        right_from_left: None,
        rectification,
    })
}

/// The rectification, for formats that contain only rectified cameras, in metres.
pub(super) fn only_rectified(
    calibration: &StereoCalibration,
) -> std::result::Result<&Rectification, String> {
    in_metres(calibration)?;
    calibration.rectification().ok_or_else(|| {
        "contains only rectified cameras, and this calibration has no rectification; compute one \
         with `svl calibrate convert --rectify`"
            .into()
    })
}

/// Rejects lengths in squares, for formats in metres.
pub(super) fn in_metres(calibration: &StereoCalibration) -> std::result::Result<(), String> {
    match calibration.unit() {
        LengthUnit::Metres => Ok(()),
        LengthUnit::Squares => Err(
            "is in metres and this calibration in squares of its board; give their size with \
             --unit squares=SIDE_IN_METRES"
                .into(),
        ),
    }
}

/// Parts that are lost if only the rectified cameras are written.
pub(super) fn beyond_rectified(calibration: &StereoCalibration) -> Vec<&'static str> {
    if calibration.is_rectified() {
        return Vec::new();
    }
    vec!["the cameras before rectification: their distortion, focal lengths and rotations"]
}
