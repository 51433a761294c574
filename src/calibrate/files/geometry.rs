//! Cameras from the matrices of a file, with consistency checks.

use super::document::Document;
use super::format::{CalibrationFormat, GeometryFault, Hints, LoadedCalibration};
use super::unit::FileUnit;
use nalgebra::{Isometry3, Matrix3, Matrix3x4, Rotation3, Translation3, Vector3};
use svl_core::Result;
use svl_core::doubt::check_size;
use svl_core::stereo::{
    Distortion, DistortionModel, Intrinsics, LengthUnit, Rectification, Rig, Side,
    StereoCalibration, check_offsets, motion,
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
            offsets: None,
            cameras: None,
        })
    }

    fn calibration(self, document: &Document, unit: FileUnit) -> Result<StereoCalibration> {
        let implied = self.rectification.as_ref().map(Rectification::motion);
        let Some(stated) = self.right_from_left.or(implied) else {
            return Err(document.error("has no extrinsics (R and T) and no rectification"));
        };
        let (scale, unit) = unit.in_calibration();
        let error = |e: svl_core::Error| document.error(e);
        let motion = Isometry3::from_parts(
            Translation3::from(stated.translation.vector * scale),
            stated.rotation,
        );
        let calibration = StereoCalibration::new(self.left, self.right, motion, unit);
        let calibration = calibration.map_err(error)?;
        let (Some(rectification), Some(implied)) = (self.rectification, implied) else {
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
        let (focal, center, doffs) = (rig.focal_px(), rig.center_px(), rig.doffs_px());
        let rig = Rig::in_unit(focal, center, rig.baseline_m() * scale, doffs, unit);
        let rig = rig.map_err(error)?;
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
    document.keyed(key, pinhole(size, &document.matrix(key)?, distortion))
}

/// The camera of a matrix K and its distortion.
pub(super) fn pinhole(
    size: (usize, usize),
    k: &Matrix3<f64>,
    distortion: impl Into<Distortion>,
) -> Result<Intrinsics, GeometryFault> {
    if k[(0, 1)].abs() > SAME * k[(0, 0)].abs() {
        return Err(GeometryFault::Skew(k[(0, 1)]));
    }
    if [k[(1, 0)], k[(2, 0)], k[(2, 1)]] != [0.0; 3] || k[(2, 2)] != 1.0 {
        return Err(GeometryFault::NoMatrix);
    }
    let (focal, center) = ((k[(0, 0)], k[(1, 1)]), (k[(0, 2)], k[(1, 2)]));
    Ok(Intrinsics::new(size, focal, center, distortion)?)
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
    let model = document.keyed(key, stated.parse::<DistortionModel>())?;
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
    document.keyed(&key.replace('|', "' or '"), distortion)
}

/// Extrinsics from R and T.
///
/// # Errors
/// [`svl_core::Error::Format`] with the key.
pub(super) fn extrinsics(document: &Document, r: &str, t: &str) -> Result<Isometry3<f64>> {
    let translation = Vector3::from(document.array::<3>(t)?);
    document.keyed(r, motion(&document.matrix(r)?, translation))
}

/// The rig of two projection matrices, whose baseline is in `unit`. Both are relative to one frame,
/// not necessarily the left camera's: the baseline is `(P1(0,3) − P2(0,3)) / f`.
pub(super) fn rig(
    left: &Matrix3x4<f64>,
    right: &Matrix3x4<f64>,
    unit: LengthUnit,
) -> Result<Rig, GeometryFault> {
    let focal = left[(0, 0)];
    let same = |a: f64, b: f64| (a - b).abs() <= SAME * focal.abs();
    let [shift, rise] = [0, 1].map(|row| left[(row, 3)] - right[(row, 3)]);
    // A vertical pair has its baseline in the second row of the fourth column.
    if rise.abs() > shift.abs() {
        return Err(GeometryFault::Vertical);
    }
    if !same(left[(1, 1)], focal) || !same(right[(1, 1)], focal) {
        return Err(GeometryFault::Focals);
    }
    if unit == LengthUnit::Metres {
        check_offsets(left, right)?;
    }
    Ok(Rig::from_projections(
        left,
        right,
        SAME,
        SAME * focal.abs(),
        unit,
    )?)
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
) -> Result<&Rectification, GeometryFault> {
    in_metres(calibration)?;
    let rectification = calibration.rectification();
    rectification.ok_or(GeometryFault::NotRectified)
}

/// Rejects lengths in squares, for formats in metres.
pub(super) fn in_metres(calibration: &StereoCalibration) -> Result<(), GeometryFault> {
    match calibration.unit() {
        LengthUnit::Metres => Ok(()),
        LengthUnit::Squares => Err(GeometryFault::Squares),
    }
}

/// Parts that are lost if only the rectified cameras are written.
pub(super) fn beyond_rectified(calibration: &StereoCalibration) -> Vec<&'static str> {
    if calibration.is_rectified() {
        return Vec::new();
    }
    vec!["the cameras before rectification: their distortion, focal lengths and rotations"]
}
