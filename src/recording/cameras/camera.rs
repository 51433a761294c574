//! Camera calibrations in messages of ROS 2 and Foxglove, and the rig of two of them.

use crate::decode::head::head;
use crate::decode::{image, json, realsense};
use crate::message::wire::decode_protobuf;
use crate::message::{MessageError, MessageResult, ros};
use crate::stream::channel::Channel;
use nalgebra::{Matrix3, Matrix3x4, Rotation3, SMatrix, Vector3};
use svl_core::Error;
use svl_core::doubt::{CalibrationCheck, Doubt, check_size};
use svl_core::stereo::{
    Distortion, DistortionModel, Intrinsics, LengthUnit, Rectification, Rig, StereoCalibration,
    check_offsets, rotation,
};

/// Schemas of calibration messages.
pub(crate) const SCHEMAS: [&str; 2] = ["sensor_msgs/msg/CameraInfo", "foxglove.CameraCalibration"];

/// Tolerances of rectified cameras, for rounding in calibration files: relative difference of the
/// focal lengths, difference of the principal points' rows.
const FOCAL_TOLERANCE: f64 = 1e-4;
const ROW_TOLERANCE_PX: f64 = 0.1;

/// Offsets of P that are rounding: a fraction of the focal length.
const ROUNDING: f64 = 1e-6;

/// Greatest relative difference of the baselines in P and in the static transforms, if the sign of
/// the one in P is reversed.
const BASELINE_TOLERANCE: f64 = 0.1;

/// Focal lengths and principal points of K and P that differ by no more are equal, up to rounding:
/// pixels.
const MAX_SAME_PX: f64 = 0.01;

/// A matrix of a calibration; or the count of its numbers, where it is another.
type Matrix<const C: usize> = Result<SMatrix<f64, 3, C>, usize>;

/// The matrix of its numbers, row by row.
fn matrix<const C: usize>(numbers: &[f64]) -> Matrix<C> {
    let matrix = (numbers.len() == 3 * C).then(|| SMatrix::from_row_slice(numbers));
    matrix.ok_or(numbers.len())
}

/// One camera's calibration.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Calibration {
    /// Width and height of its images, pixels.
    size: (u32, u32),
    /// Columns and rows of the sensor that are one pixel of them.
    binning: [u32; 2],
    /// Name of the distortion model.
    model: String,
    /// Intrinsics before rectification.
    k: Matrix<3>,
    /// Distortion coefficients.
    d: Vec<f64>,
    /// Rotation into the rectified frame.
    r: Matrix<3>,
    /// Projection of the rectified camera.
    p: Matrix<4>,
}

/// True if the messages of a channel are calibrations.
pub(crate) fn is_calibration(channel: &Channel) -> bool {
    SCHEMAS.contains(&channel.schema.as_str()) || realsense::is_calibration(channel)
}

/// A calibration and its stamp; one without a stamp has its log time.
///
/// # Errors
/// The reason why it cannot be read.
pub(crate) fn decode(
    channel: &Channel,
    log_time: u64,
    data: &[u8],
) -> MessageResult<(u64, Calibration)> {
    let calibration = decode_calibration(channel, data)?;
    // RealSense's is a text.
    let stamp = if realsense::is_calibration(channel) {
        None
    } else {
        head(channel, data)?.0
    };
    Ok((stamp.unwrap_or(log_time), calibration))
}

fn decode_calibration(channel: &Channel, data: &[u8]) -> MessageResult<Calibration> {
    let unbinned = |size, model, [k, d, r, p]: [Vec<f64>; 4]| Calibration {
        size,
        binning: [1, 1],
        model,
        k: matrix(&k),
        d,
        r: matrix(&r),
        p: matrix(&p),
    };
    match (channel.schema.as_str(), channel.encoding.as_str()) {
        ("sensor_msgs/msg/CameraInfo", "cdr" | "ros1") => Ok(from_camera_info(ros::read(
            channel,
            data,
            ros::camera_info,
        )?)),
        ("foxglove.CameraCalibration", "protobuf") => {
            let m: foxglove::messages::CameraCalibration = decode_protobuf(data)?;
            let size = (m.width, m.height);
            Ok(unbinned(size, m.distortion_model, [m.k, m.d, m.r, m.p]))
        }
        ("foxglove.CameraCalibration", "json") => {
            let m: json::JsonCalibration = json::read(data)?;
            let size = (m.width, m.height);
            Ok(unbinned(size, m.distortion_model, [m.k, m.d, m.r, m.p]))
        }
        ("std_msgs/msg/String", "cdr") => {
            realsense::calibration(ros::read(channel, data, ros::string)?).map(from_stream)
        }
        (schema, _) if SCHEMAS.contains(&schema) => {
            Err(MessageError::encoding(channel, image::ENCODINGS))
        }
        _ => Err(MessageError::schema(channel, &svl_core::joined(SCHEMAS))),
    }
}

/// A RealSense stream's: its images are rectified by the camera, so P is K; the baseline is in the
/// transforms.
fn from_stream(camera: realsense::StreamCamera) -> Calibration {
    let ((fx, fy), (cx, cy)) = (camera.focal_px, camera.center_px);
    let k = Matrix3::new(fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0);
    Calibration {
        size: camera.size,
        binning: [1, 1],
        model: camera.model,
        k: Ok(k),
        d: camera.distortion.to_vec(),
        r: Ok(Matrix3::identity()),
        p: Ok(k.insert_column(3, 0.0)),
    }
}

/// The calibration of the published images, which may be a binned region of the sensor (as
/// image_geometry's PinholeCameraModel).
fn from_camera_info(info: ros::CameraInfo) -> Calibration {
    let ros::CameraInfo {
        width,
        height,
        model,
        distortion: d,
        k,
        r,
        p,
        binning,
        roi,
    } = info;
    // ROS leaves binning at 0 if it was never set.
    let [columns, rows] = binning.map(|pixels| pixels.max(1));
    let side = |roi: u32, whole: u32| if roi == 0 { whole } else { roi };
    let size = (
        side(roi.width, width) / columns,
        side(roi.height, height) / rows,
    );
    Calibration {
        size,
        binning: [columns, rows],
        model,
        k: published(&k, &roi, [columns, rows]),
        d,
        r: matrix(&r),
        p: published(&p, &roi, [columns, rows]),
    }
}

/// A matrix of the sensor's pixels, as that of the published ones.
fn published<const C: usize>(
    numbers: &[f64],
    roi: &ros::RegionOfInterest,
    [columns, rows]: [u32; 2],
) -> Matrix<C> {
    let mut matrix = SMatrix::<f64, 3, C>::from_row_slice(numbers);
    // First the offset, in pixels of the sensor, then the binning: the order of image_geometry.
    matrix[(0, 2)] -= f64::from(roi.x);
    matrix[(1, 2)] -= f64::from(roi.y);
    // The whole row, so that P[0][3] = -f·B scales with f and the baseline stays.
    matrix.row_mut(0).unscale_mut(f64::from(columns));
    matrix.row_mut(1).unscale_mut(f64::from(rows));
    Ok(matrix)
}

/// Differences of a calibration from the previous one.
#[derive(Debug, PartialEq)]
pub(crate) struct CalibrationChange {
    /// `P[0][0]`, before and after.
    focal_px: [f64; 2],
    /// `P[0][3]`, which is minus focal length times baseline.
    offset: [f64; 2],
}

impl std::fmt::Display for CalibrationChange {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self {
            focal_px: [focal, next_focal],
            offset: [offset, next_offset],
        } = self;
        if focal != next_focal {
            write!(f, "focal length {focal:.2}, then {next_focal:.2} px")
        } else if offset != next_offset {
            write!(f, "P[0][3] {offset:.3}, then {next_offset:.3}")
        } else {
            f.write_str("with the same focal length")
        }
    }
}

impl Calibration {
    /// The numbers of K, D, R and P.
    fn numbers(&self) -> impl Iterator<Item = f64> {
        let (k, r, p) = (self.k.iter(), self.r.iter(), self.p.iter());
        let numbers = k.flatten().chain(&self.d).chain(r.flatten());
        numbers.chain(p.flatten()).copied()
    }

    /// Differences of `next`; `None` if all numbers are equal.
    pub(crate) fn change(&self, next: &Self) -> Option<CalibrationChange> {
        // NaN, from an uncalibrated camera, equals itself here.
        let [own, other] = [self, next].map(|calibration| calibration.numbers().map(f64::to_bits));
        let is_same = self.size == next.size && self.model == next.model && own.eq(other);
        let both = |column| [self, next].map(|own| own.p.map_or(0.0, |p| p[(0, column)]));
        (!is_same).then(|| CalibrationChange {
            focal_px: both(0),
            offset: both(3),
        })
    }

    /// Checks that it has the focal lengths of `known`, another calibration of the camera, and no
    /// numbers that are not finite.
    ///
    /// # Errors
    /// The fault. A camera that was never calibrated has it from the start, and no `known` without.
    pub(crate) fn check_damage(&self, known: &Self) -> MessageResult<()> {
        let is_finite = |calibration: &Self| calibration.numbers().all(f64::is_finite);
        if is_finite(known) && !is_finite(self) {
            let why = "it has numbers that are not finite";
            return Err(MessageError::Calibration(why));
        }
        let lost = [true, false]
            .map(|is_raw| known.focal_px(is_raw).is_some() && self.focal_px(is_raw).is_none());
        if lost.contains(&true) {
            let why = "it has no focal length, and the one before it does";
            return Err(MessageError::Calibration(why));
        }
        Ok(())
    }

    #[cfg(test)]
    pub(crate) fn size(&self) -> (u32, u32) {
        self.size
    }

    /// Focal lengths along x and y: from K for a raw camera, else from P. `None` if unknown.
    pub(crate) fn focal_px(&self, is_raw: bool) -> Option<(f64, f64)> {
        let raw = || self.k.map(|k| (k[(0, 0)], k[(1, 1)]));
        let rectified = || self.p.map(|p| (p[(0, 0)], p[(1, 1)]));
        let focal = if is_raw { raw() } else { rectified() }.ok()?;
        (focal.0 > 0.0 && focal.1 > 0.0).then_some(focal)
    }

    /// Name of the distortion model; `None` if all coefficients are 0.
    pub(crate) fn distortion_model(&self) -> Option<&str> {
        let is_distorted = self.d.iter().any(|coefficient| *coefficient != 0.0);
        is_distorted.then_some(&self.model)
    }

    /// True if neither P has an offset, so that the baseline of the two has to come from elsewhere.
    pub(crate) fn lacks_baseline(&self, right: &Self) -> bool {
        // Rounding is no baseline.
        let is_zero = |p: Matrix3x4<f64>| {
            let (focal, offset) = (p[(0, 0)], p[(0, 3)]);
            // A P of zeros is that of a camera without a calibration.
            focal > 0.0 && offset.abs() <= ROUNDING * focal.max(1.0)
        };
        self.p.is_ok_and(is_zero) && right.p.is_ok_and(is_zero)
    }

    /// True if the two P put the right camera to the left of the left one.
    pub(crate) fn has_reversed_baseline(&self, right: &Self) -> bool {
        let (Ok(left), Ok(right)) = (self.p, right.p) else {
            return false;
        };
        right[(0, 3)] - left[(0, 3)] > ROUNDING * left[(0, 0)].max(1.0)
    }

    /// True if the baseline has to come from the static transforms.
    pub(crate) fn needs_baseline(&self, right: &Self) -> bool {
        self.lacks_baseline(right) || self.has_reversed_baseline(right)
    }

    /// Checks that it is for images of that size; a size of 0x0 is unknown and passes.
    ///
    /// # Errors
    /// The size that it is for.
    pub(crate) fn check_size(&self, size: (usize, usize)) -> MessageResult<()> {
        let own = (self.size.0 as usize, self.size.1 as usize);
        if own == (0, 0) {
            return Ok(());
        }
        Ok(check_size(own, size)?)
    }

    /// The check of a binning.
    fn binning_check(&self, size: (usize, usize)) -> Option<CalibrationCheck> {
        let k = self.k.ok().filter(|_| self.binning != [1, 1])?;
        let center_px = (k[(0, 2)], k[(1, 2)]);
        Some(CalibrationCheck::binning(center_px, self.binning, size))
    }

    /// The doubt about the calibration of a depth camera whose principal point is `center_px`, for
    /// images of that size.
    pub(crate) fn depth_doubt(&self, center_px: (f64, f64), size: (usize, usize)) -> Option<Doubt> {
        // A wrong binning is the cause of the other.
        let binning = self.binning_check(size).and_then(|check| check.doubt());
        binning.or_else(|| CalibrationCheck::depth_center(center_px, size).doubt())
    }

    /// True if images of this camera have to be rectified: it has distortion, a rotation, or a P
    /// that projects to other pixels than K.
    pub(crate) fn is_of_raw_camera(&self) -> bool {
        if self.is_rectified_by_depthai() {
            return false;
        }
        // All zeros mean a camera that was never calibrated; else the identity, up to the rounding
        // of a product of rotations.
        let is_turned = |r: Matrix3<f64>| {
            r != Matrix3::zeros() && (r - Matrix3::identity()).iter().any(|v| v.abs() > 1e-9)
        };
        self.r.is_ok_and(is_turned) || self.is_projected_anew() || self.is_distorted()
    }

    /// True if it has a coefficient, or is a fisheye, whose coefficients may be 0.
    fn is_distorted(&self) -> bool {
        let is_fisheye = || matches!(self.model.parse(), Ok(DistortionModel::Equidistant));
        self.d.iter().any(|coefficient| *coefficient != 0.0)
            || self.focal_px(true).is_some() && is_fisheye()
    }

    /// True of the rectified images of depthai-ros: it sets the distortion to 0 and the diagonal of
    /// R to 1, but leaves the rest of R and the raw K. No rotation but the identity has that
    /// diagonal.
    fn is_rectified_by_depthai(&self) -> bool {
        let is_reset =
            |r: Matrix3<f64>| r.diagonal() == Vector3::repeat(1.0) && r != Matrix3::identity();
        self.r.is_ok_and(is_reset) && self.d.iter().all(|coefficient| *coefficient == 0.0)
    }

    /// True if P projects to other pixels than K does.
    fn is_projected_anew(&self) -> bool {
        let (Ok(k), Ok(p)) = (self.k, self.p) else {
            return false;
        };
        // Focal lengths and principal point.
        let same = [(0, 0), (0, 2), (1, 1), (1, 2)];
        let differs = |at: (usize, usize)| (k[at] - p[at]).abs() > MAX_SAME_PX;
        let are_known = self.focal_px(true).is_some() && self.focal_px(false).is_some();
        are_known && same.into_iter().any(differs)
    }

    fn distortion(&self) -> MessageResult<Distortion> {
        // A camera that was never calibrated names no model; one that was has one, as in files.
        let model = if self.model.is_empty() && self.distortion_model().is_none() {
            Ok(DistortionModel::PlumbBob)
        } else {
            self.model.parse::<DistortionModel>()
        };
        Ok(model?.with_coefficients(&self.d)?)
    }

    pub(crate) fn camera(&self) -> MessageResult<Intrinsics> {
        let distortion = self.distortion()?;
        let wrong = |count| MessageError::Matrix('K', count, "9 make a camera");
        let k = self.k.map_err(wrong)?;
        let size = (self.size.0 as usize, self.size.1 as usize);
        let (focal, center) = ((k[(0, 0)], k[(1, 1)]), (k[(0, 2)], k[(1, 2)]));
        Ok(Intrinsics::new(size, focal, center, distortion)?)
    }

    pub(crate) fn projection(&self) -> MessageResult<Matrix3x4<f64>> {
        // Uncalibrated cameras publish a P of zeros; NaN fails too.
        let p = self.p.ok().filter(|p| p[(0, 0)] > 0.0);
        let why = "a camera is not calibrated: its projection matrix is empty";
        p.ok_or(MessageError::Calibration(why))
    }

    pub(crate) fn rotation(&self) -> MessageResult<Rotation3<f64>> {
        let wrong = |count| MessageError::Matrix('R', count, "not 9");
        Ok(rotation(&self.r.map_err(wrong)?)?)
    }
}

/// The rig of two rectified cameras. `baseline_m` is used if their P have none, or that of the
/// other sign, as DepthAI's, whose first camera is the right one.
///
/// # Errors
/// The reason why there is none.
pub(crate) fn rig(
    left: &Calibration,
    right: &Calibration,
    baseline_m: Option<f64>,
) -> MessageResult<Rig> {
    let baseline_m = baseline_m.filter(|_| left.needs_baseline(right));
    let (left, mut right) = (left.projection()?, right.projection()?);
    if let Some(baseline_m) = baseline_m {
        let offset = right[(0, 0)] * baseline_m;
        let reversed = right[(0, 3)] - left[(0, 3)];
        let is_same = (reversed - offset).abs() <= BASELINE_TOLERANCE * offset;
        if is_same {
            right[(0, 3)] = left[(0, 3)] - offset;
        } else if reversed <= ROUNDING * right[(0, 0)] {
            right[(0, 3)] = -offset;
        }
    }
    let rig = check_offsets(&left, &right).and_then(|()| {
        let (focal, row) = (FOCAL_TOLERANCE, ROW_TOLERANCE_PX);
        Rig::from_projections(&left, &right, focal, row, LengthUnit::Metres)
    });
    // Swapped topics are the usual cause of a negative baseline.
    let exchanged = CalibrationCheck::sides(&left, &right).doubt();
    rig.map_err(|e| exchanged.map_or(MessageError::NoRig(e), |doubt| Error::other(doubt).into()))
}

/// The checks of the numbers of two cameras, of which `rig` is that of rectified images.
/// `size`: that of the images, for calibrations that have none. `apart_m`: distance of the cameras
/// by the static transforms.
pub(crate) fn checks(
    ([left, right], size): ([&Calibration; 2], (usize, usize)),
    rig: &Rig,
    calibration: Option<&StereoCalibration>,
    apart_m: Option<f64>,
) -> Vec<CalibrationCheck> {
    let size = match left.size {
        (0, 0) => size,
        (width, height) => (width as usize, height as usize),
    };
    let mut checks = match calibration {
        Some(calibration) => calibration.checks(),
        None => rig.checks(size),
    };
    if let (None, Some((raw_px, _))) = (calibration, left.focal_px(true)) {
        checks.push(CalibrationCheck::focal(rig.focal_px(), raw_px));
    }
    if let (Ok(left), Ok(right)) = (left.projection(), right.projection()) {
        let mut offsets = CalibrationCheck::offsets(&left, &right);
        // Offsets to the middle of the cameras are right, as the transforms say.
        let is_right = |apart_m| {
            CalibrationCheck::baseline(rig.baseline_m(), apart_m, "")
                .cure
                .is_none()
        };
        offsets.cure = offsets.cure.filter(|_| !apart_m.is_some_and(is_right));
        checks.push(offsets);
    }
    if let Some(binning) = left.binning_check(size) {
        // It is the cause of the others.
        if binning.cure.is_some() {
            checks.iter_mut().for_each(|check| check.cure = None);
        }
        checks.push(binning);
    }
    if let Some(apart_m) = apart_m.filter(|_| !left.needs_baseline(right)) {
        let check = CalibrationCheck::baseline(rig.baseline_m(), apart_m, "/tf_static");
        checks.push(check);
    }
    checks
}

/// The calibration of raw images: intrinsics and distortion, R and P of both cameras.
///
/// # Errors
/// The missing part.
pub(crate) fn calibration(
    left: &Calibration,
    right: &Calibration,
    baseline_m: Option<f64>,
) -> MessageResult<StereoCalibration> {
    let rig = rig(left, right, baseline_m)?;
    let cameras = [left.camera()?, right.camera()?];
    let rectification = Rectification {
        size: cameras[0].size(),
        left: left.rotation()?,
        right: right.rotation()?,
        rig,
    };
    let [left, right] = cameras;
    let calibration =
        StereoCalibration::new(left, right, rectification.motion(), LengthUnit::Metres)?;
    Ok(calibration.with_rectification(rectification))
}

#[cfg(test)]
pub(crate) fn calibration_of_size(size: (u32, u32)) -> Calibration {
    Calibration {
        size,
        binning: [1, 1],
        model: String::new(),
        k: Err(0),
        d: vec![],
        r: Err(0),
        p: Err(0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn k(focal: f64, cy: f64) -> Result<Matrix3<f64>, usize> {
        matrix(&[focal, 0.0, 160.0, 0.0, focal, cy, 0.0, 0.0, 1.0])
    }

    fn camera(focal: f64, cy: f64, tx: f64) -> Calibration {
        let rows = [[focal, 0.0, 160.0, tx], [0.0, focal, cy, 0.0]];
        Calibration {
            model: "plumb_bob".into(),
            k: k(focal, cy),
            d: vec![0.0; 5],
            r: Ok(Matrix3::identity()),
            p: matrix(&[rows.concat(), vec![0.0, 0.0, 1.0, 0.0]].concat()),
            ..calibration_of_size((320, 240))
        }
    }

    fn changed(camera: &Calibration, change: impl FnOnce(&mut Calibration)) -> Calibration {
        let mut changed = camera.clone();
        change(&mut changed);
        changed
    }

    /// A camera of that model and those coefficients.
    fn distorted(camera: &Calibration, model: &str, d: &[f64]) -> Calibration {
        changed(camera, |c| (c.model, c.d) = (model.into(), d.to_vec()))
    }

    #[track_caller]
    fn check_refused<T>(result: MessageResult<T>, words: &str) {
        let error = result.err().map(|error| error.to_string());
        let is_it = error.as_ref().is_some_and(|error| error.contains(words));
        assert!(is_it, "{words}: {error:?}");
    }

    #[test]
    fn damage_is_of_a_camera_that_was_calibrated() {
        let with = |focal| changed(&calibration_of_size((4, 3)), |c| c.k = k(focal, 1.0));
        let good = with(300.0);
        assert!(good.check_damage(&good).is_ok() && with(310.0).check_damage(&good).is_ok());
        for (focal, words) in [(f64::NAN, "finite"), (0.0, "focal length")] {
            check_refused(with(focal).check_damage(&good), words);
            assert!(with(focal).check_damage(&with(focal)).is_ok());
            assert!(good.check_damage(&with(focal)).is_ok());
        }
    }

    #[test]
    fn the_baseline_is_between_the_cameras() {
        // The arrangement of KITTI's colour cameras, neither of which is at the origin.
        let (left, right) = (camera(500.0, 120.0, 30.0), camera(500.0, 120.0, -20.0));
        let found = rig(&left, &right, Some(9.0)).unwrap();
        assert!((found.baseline_m() - 0.1).abs() < 1e-12);
        // P of a single camera each.
        let left = camera(500.0, 120.0, 0.0);
        assert_eq!(rig(&left, &left, Some(0.05)).unwrap().baseline_m(), 0.05);
        let rounded = camera(500.0, 120.0, -1e-9);
        let found = rig(&left, &rounded, Some(0.05)).unwrap();
        assert!((found.baseline_m() - 0.05).abs() < 1e-9);
        let offset = "2.000e-4 m: the offset is likely the baseline itself";
        for ((focal, cy, tx), words) in [
            ((500.0, 120.0, 50.0), "--left and --right"),
            ((500.0, 120.0, 0.0), "baseline"),
            // In millimetres, and what rounding leaves.
            ((500.0, 120.0, -60_000.0), "1.200e2 m is not between"),
            ((500.0, 120.0, -0.1), offset),
            ((510.0, 120.0, -50.0), "not rectified to each other"),
            ((500.0, 122.0, -50.0), "not rectified to each other"),
            ((f64::NAN, 120.0, -50.0), "not calibrated"),
        ] {
            check_refused(rig(&left, &camera(focal, cy, tx), None), words);
        }
        for p in [matrix(&[0.0; 12]), Err(0)] {
            let right = changed(&left, |c| c.p = p);
            check_refused(rig(&left, &right, None), "not calibrated");
        }
    }

    #[test]
    fn the_sign_of_the_baseline_is_that_of_the_transforms() {
        let left = camera(500.0, 120.0, 0.0);
        let reversed = camera(500.0, 120.0, 50.0);
        assert!(left.has_reversed_baseline(&reversed) && left.needs_baseline(&reversed));
        let found = rig(&left, &reversed, Some(0.101)).unwrap();
        assert!((found.baseline_m() - 0.101).abs() < 1e-12);
        // Another length: one of the two is wrong in more than its sign.
        for metres in [None, Some(0.2)] {
            let words = "i_reverse_stereo_socket_order";
            check_refused(rig(&left, &reversed, metres), words);
        }
        let sound = camera(500.0, 120.0, -50.0);
        assert!(!left.has_reversed_baseline(&sound) && !left.needs_baseline(&sound));
        assert_eq!(rig(&left, &sound, Some(0.2)).unwrap().baseline_m(), 0.1);
    }

    #[test]
    fn depthai_s_rectified_images_are_no_raw_ones() {
        // The raw K, the rectified P, and a rotation of which the diagonal alone was reset.
        let mut rectified = camera(500.0, 120.0, 0.0);
        rectified.k.as_mut().unwrap()[(0, 0)] = 510.0;
        rectified.r = matrix(&[1.0, 0.01, 0.002, -0.01, 1.0, 0.0, -0.002, 0.0, 1.0]);
        assert!(!rectified.is_of_raw_camera());
        assert!(changed(&rectified, |c| c.d = vec![0.1]).is_of_raw_camera());
        rectified.r.as_mut().unwrap()[(1, 1)] = 0.9999;
        assert!(rectified.is_of_raw_camera());
    }

    #[test]
    fn a_part_of_the_sensor_and_binned_pixels_are_what_the_calibration_is_of() {
        let found = |binning, (x, y, width, height)| {
            let p = [[600.0, 0.0, 322.0, -60.0], [0.0, 600.0, 242.0, 0.0]];
            let p = [p[0], p[1], [0.0, 0.0, 1.0, 0.0]];
            let roi = ros::RegionOfInterest {
                x,
                y,
                height,
                width,
            };
            let found = from_camera_info(ros::CameraInfo {
                width: 640,
                height: 480,
                model: "plumb_bob".into(),
                distortion: vec![],
                k: [600.0, 0.0, 320.0, 0.0, 602.0, 240.0, 0.0, 0.0, 1.0],
                r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
                p: *p.as_flattened().as_array().unwrap(),
                binning,
                roi,
            });
            let k = found.k.unwrap().transpose().as_slice()[..6].to_vec();
            let p = found.p.unwrap().transpose().as_slice()[..8].to_vec();
            (found, k, p)
        };
        let (whole, k, p) = found([0, 1], (0, 0, 0, 0));
        assert_eq!((whole.size, k[0], p[3]), ((640, 480), 600.0, -60.0));
        // The order of image_geometry's PinholeCameraModel: first the offset, then the binning; Tx
        // is scaled too, so the baseline is unchanged.
        let (binned, _, p) = found([2, 2], (0, 0, 0, 0));
        assert_eq!(binned.size, (320, 240));
        assert_eq!(p, [300.0, 0.0, 161.0, -30.0, 0.0, 300.0, 121.0, 0.0]);
        let (part, k, p) = found([2, 1], (100, 40, 320, 240));
        assert_eq!(part.size, (160, 240));
        assert_eq!(k, [300.0, 0.0, 110.0, 0.0, 602.0, 200.0]);
        assert_eq!((&p[..4], p[6]), (&[300.0, 0.0, 111.0, -30.0][..], 202.0));
        assert!(part.check_size((160, 240)).is_ok());
        let words = "of 160x240 pixels, these have 320x240";
        check_refused(part.check_size((320, 240)), words);
        let unknown = changed(&part, |c| c.size = (0, 0));
        assert!(unknown.check_size((320, 240)).is_ok(), "it does not say");
    }

    #[test]
    fn raw_cameras_with_all_their_numbers_can_be_rectified() {
        let d = [-0.28, 0.07, 0.0, 0.0];
        let left = changed(&camera(500.0, 120.0, 0.0), |c| c.d = d.to_vec());
        let right = camera(500.0, 120.0, -50.0);
        let found = calibration(&left, &right, None).unwrap();
        let coefficients = Distortion::PlumbBob([-0.28, 0.07, 0.0, 0.0, 0.0]);
        assert_eq!(*found.left().distortion(), coefficients);
        assert_eq!(found.rig().unwrap().baseline_m(), 0.1);
        let fisheye = [0.1, 0.0, 0.0, 0.0];
        for (model, d) in [
            ("equidistant", &fisheye[..]),
            ("rational_polynomial", &[0.1; 8]),
        ] {
            let right = distorted(&right, model, &vec![0.0; d.len()]);
            let found = calibration(&distorted(&left, model, d), &right, None).unwrap();
            assert_eq!(found.left().distortion().coefficients(), d);
        }
        let mixed = changed(&right, |c| c.d = vec![0.1; 5]);
        for (model, d, right, words) in [
            (
                "equidistant",
                &fisheye[..],
                &mixed,
                "equidistant, the right one's plumb_bob",
            ),
            ("ftheta", &[], &right, "'ftheta' is not supported"),
            ("equidistant", &[0.1; 3], &right, "3 coefficients"),
        ] {
            check_refused(calibration(&distorted(&left, model, d), right, None), words);
        }
        let zeros = distorted(&left, "rational_polynomial", &[0.0; 8]);
        assert!(calibration(&zeros, &right, None).is_ok());
        for (k, r) in [
            (Err(0), left.r),
            (left.k, Err(0)),
            (left.k, Ok(Matrix3::zeros())),
        ] {
            let incomplete = changed(&left, |c| (c.k, c.r) = (k, r));
            assert!(calibration(&incomplete, &right, None).is_err());
        }
    }

    #[test]
    fn a_change_of_any_number_is_one() {
        let first = camera(500.0, 120.0, -50.0);
        assert_eq!(first.change(&first), None);
        let unknown = camera(f64::NAN, 120.0, -50.0);
        assert_eq!(unknown.change(&unknown), None);
        let change = first.change(&camera(250.0, 120.0, -25.0)).unwrap();
        assert_eq!(change.focal_px, [500.0, 250.0]);
        assert!(first.change(&camera(500.0, 121.0, -50.0)).is_some());
        let distorted = changed(&first, |c| c.d = vec![0.1]);
        assert!(first.change(&distorted).is_some());
        assert_eq!(first.focal_px(true), Some((500.0, 500.0)));
        assert_eq!(camera(0.0, 1.0, 0.0).focal_px(false), None);
    }

    #[test]
    fn raw_cameras_are_known() {
        type Change<'a> = &'a dyn Fn(&mut Calibration);
        let turn = matrix(&[0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
        let changes: [(bool, Change); 8] = [
            (false, &|_| {}),
            (false, &|c| c.r = Ok(Matrix3::zeros())),
            (true, &|c| c.d = vec![-0.28]),
            (true, &|c| c.r = turn),
            // Without distortion, but projected anew: by another focal length or principal point.
            (false, &|c| c.k = k(500.0, 120.0)),
            (false, &|c| c.k = k(500.001, 120.0)),
            (true, &|c| c.k = k(510.0, 120.0)),
            (true, &|c| c.k = k(500.0, 126.0)),
        ];
        for (place, (is_raw, change)) in changes.into_iter().enumerate() {
            let camera = changed(&camera(500.0, 120.0, 0.0), change);
            assert_eq!(camera.is_of_raw_camera(), is_raw, "{place}");
        }
    }
}
