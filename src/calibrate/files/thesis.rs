//! The thesis's XML (annex E).
//!
//! `ImageSize`: x is the width. `Rotation` and `Transaction` (sic) are the pose of the board in the
//! camera, `X_camera = R X_board + T`. `Coeffs` are the homographies that warp each image to its
//! rectified one, `Quad` contains the images of the corners (0, 0), (w, 0), (w, h), (0, h).
//!
//! Departures. The annex's `x(0,0)` and `coeff(0,0,0)` are not valid XML names, and XML libraries
//! reject them: both forms are read, and `x_0_0` and `coeff_0_0_0` written. k3 is `dist4`, other
//! distortion models are named by an attribute `model`, the unit of length is an attribute `unit`
//! of the root, the rectified size attributes of `Stereo`; a reader of annex E ignores them. In
//! files svl writes, the board's frame is the left camera's.
//!
//! **The annex's example contradicts itself.** By its poses the cameras are rotated by 90° about
//! their axes: the corners of the two boards were numbered in different directions. Rotated back,
//! the poses agree with the homographies to 4°; but the distance between the two origins, and with
//! it the baseline, is not in the file. Hence, if poses and homographies differ by more than 10°,
//! the homographies are used: they give the rotation and the direction of the baseline, and its
//! length is 1, in squares of unknown size. The homographies of the example are warps of four
//! corners rather than pure rotations of a camera, so its rectification is dropped.

use super::document::{Document, Syntax};
use super::format::{
    CalibrationFormat, GeometryFault, Hints, LoadedCalibration, Writing, Written, one,
};
use super::geometry::{StereoParameters, pinhole, stated_model};
use super::numbers::number;
use super::unit::{self, FileUnit};
use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use std::fmt::Write;
use svl_core::Result;
use svl_core::stereo::{
    Distortion, DistortionModel, Intrinsics, LengthUnit, Rectification, Rig, Side,
    StereoCalibration, motion,
};

pub(super) const FORMAT: CalibrationFormat = CalibrationFormat {
    name: "xml",
    title: "the thesis's XML",
    conventions: "annex E: dist0 ... dist4 = k1 k2 p1 p2 k3, or of the attribute model; each \
                  camera's pose of the board, x_camera = R x_board + T; homographies from raw to \
                  rectified pixels; the unit as an attribute of the root",
    endings: &["xml"],
    pairs: &[],
    single: true,
    syntax: Syntax::Markup,
    marks: &["<VSCalibrationData"],
    read,
    write: Some(write),
};

/// Largest difference between poses and homographies, radians.
const MAX_CONTRADICTION: f64 = 0.17;

/// Homographies belong to one pinhole if they agree to this fraction of its focal length.
const SAME: f64 = 1e-6;

fn read(documents: Vec<Document>, hints: &Hints) -> Result<LoadedCalibration> {
    let document = &one(documents)?;
    let (left, right) = (camera(document, 0, hints)?, camera(document, 1, hints)?);
    // Both poses belong to one board: X_right = P_right P_left⁻¹ X_left.
    let by_poses = pose(document, 1)? * pose(document, 0)?.inverse();
    let mut remarks = Vec::new();
    let Some(warps) = warps(document, [&left, &right])? else {
        if by_poses.rotation.angle() > std::f64::consts::FRAC_PI_4 {
            return Err(document.error(format!(
                "the cameras are rotated by {:.0}° to each other: their boards were numbered in \
                 different directions; calibrate again",
                by_poses.rotation.angle().to_degrees()
            )));
        }
        let cameras = StereoParameters {
            left,
            right,
            right_from_left: Some(by_poses),
            rectification: None,
        };
        let unit = FileUnit::stated(document, "unit", hints.unit)?;
        return cameras.loaded(&FORMAT, document, unit, remarks);
    };
    let by_warps = warps.motion();
    let apart = by_warps.rotation.angle_to(&by_poses.rotation);
    let (right_from_left, unit) = if apart > MAX_CONTRADICTION {
        remarks.push(format!(
            "its two boards were numbered in different directions: its poses and its Coeffs are \
             {:.0}° apart. Rotation and direction of the baseline are those of the Coeffs; its \
             length is not in the file, 1 is used instead",
            apart.to_degrees()
        ));
        (by_warps, FileUnit::Squares)
    } else {
        (by_poses, FileUnit::stated(document, "unit", hints.unit)?)
    };
    let size = if document.has("Stereo.width") {
        document.size("Stereo.width", "Stereo.height")?
    } else {
        left.size()
    };
    let rectification = warps.rectification(size, right_from_left.translation.vector.norm());
    if rectification.is_none() {
        remarks.push(
            "its Coeffs are not pure rotations of a camera: its rectification is dropped".into(),
        );
    }
    let cameras = StereoParameters {
        left,
        right,
        right_from_left: Some(right_from_left),
        rectification,
    };
    cameras.loaded(&FORMAT, document, unit, remarks)
}

fn camera(document: &Document, i: usize, hints: &Hints) -> Result<Intrinsics> {
    let at = |key: &str| format!("Camera.{i}.{key}");
    let model = at("Distortion.model");
    let model = if document.has(&model) {
        stated_model(document, &model, hints)?
    } else {
        DistortionModel::PlumbBob
    };
    let coefficients = (0..)
        .map(|i| at(&format!("Distortion.dist{i}")))
        .take_while(|key| document.has(key))
        .map(|key| document.number(&key))
        .collect::<Result<Vec<_>>>()?;
    let key = at("Distortion");
    if coefficients.is_empty() {
        return Err(document.error(format!("no '{key}.dist0', which the thesis's XML has")));
    }
    let distortion = model.with_coefficients(&coefficients);
    let distortion = document.keyed(&key, distortion)?;
    let k = Matrix3::from_row_slice(&document.counted::<9>(&at("Intrinsic.intr"))?);
    let size = document.size(&at("ImageSize.x"), &at("ImageSize.y"))?;
    document.keyed(&at("Intrinsic"), pinhole(size, &k, distortion))
}

/// The board's pose in camera `i`.
fn pose(document: &Document, i: usize) -> Result<Isometry3<f64>> {
    let at = |key: &str| format!("Camera.{i}.{key}");
    let rotation = Matrix3::from_row_slice(&document.counted::<9>(&at("Rotation.rot"))?);
    let [x, y, z] =
        ["x", "y", "z"].map(|axis| document.number(&at(&format!("Transaction.{axis}"))));
    let motion = motion(&rotation, Vector3::new(x?, y?, z?));
    document.keyed(&at("Rotation"), motion)
}

/// A rectifying homography, decomposed: K of the rectified image, and the rotation to it.
struct Warp {
    k: Matrix3<f64>,
    rotation: Rotation3<f64>,
}

struct Warps([Warp; 2]);

fn warps(document: &Document, cameras: [&Intrinsics; 2]) -> Result<Option<Warps>> {
    if !document.has("Stereo.Coeffs") {
        return Ok(None);
    }
    let warp = |i: usize| {
        let mut homography = Matrix3::zeros();
        for (row, column) in (0..9).map(|k| (k / 3, k % 3)) {
            let key = |name: String| format!("Stereo.Coeffs.{name}");
            let names = [
                key(format!("coeff({i},{row},{column})")),
                key(format!("coeff_{i}_{row}_{column}")),
            ];
            homography[(row, column)] = document.number(&names.join("|"))?;
        }
        let warp = Warp::decompose(&(homography * cameras[i].matrix()));
        warp.ok_or_else(|| {
            document.error(format!(
                "'Stereo.Coeffs': those of camera {i} are not a homography"
            ))
        })
    };
    Ok(Some(Warps([warp(0)?, warp(1)?])))
}

impl Warp {
    /// RQ decomposition: splits a matrix, up to a factor, into K (upper triangular) and a rotation;
    /// `None` for a singular matrix.
    fn decompose(matrix: &Matrix3<f64>) -> Option<Self> {
        // A homography's scale and sign are arbitrary; a rotation has rows of norm 1 and
        // determinant 1.
        let scale = matrix.determinant().signum() / matrix.row(2).norm();
        let matrix = matrix * scale;
        let [m1, m2, z] = [0, 1, 2].map(|i| matrix.row(i).transpose());
        let cy = m2.dot(&z);
        let fy = (m2 - z * cy).norm();
        let y = (m2 - z * cy) / fy;
        let (cx, skew) = (m1.dot(&z), m1.dot(&y));
        let x = y.cross(&z);
        let k = Matrix3::new(m1.dot(&x), skew, cx, 0.0, fy, cy, 0.0, 0.0, 1.0);
        let rotation =
            Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, z]).transpose());
        let mut all = k.iter().chain(rotation.matrix().iter());
        let sound = all.all(|v| v.is_finite()) && k[(0, 0)] > 0.0;
        sound.then_some(Self { k, rotation })
    }
}

impl Warps {
    /// The extrinsics under which equal rows of both rectified images lie in one epipolar plane;
    /// `T` has length 1.
    ///
    /// The normal of row `y`'s plane is the second row of the warp minus `y` times its third; the
    /// baseline lies in all those planes.
    fn motion(&self) -> Isometry3<f64> {
        let middle = self.0[0].k[(1, 2)];
        let [left, right] = self.0.each_ref().map(|Warp { k, rotation }| {
            let x = rotation.matrix().row(0).transpose();
            let z = rotation.matrix().row(2).transpose();
            let y = rotation.matrix().row(1).transpose();
            let normal = (y * k[(1, 1)] + z * (k[(1, 2)] - middle)).normalize();
            Matrix3::from_columns(&[x, normal, x.cross(&normal)])
        });
        let rotation = Rotation3::from_matrix_unchecked(right * left.transpose());
        let translation = Translation3::from(-right.column(0).into_owned());
        Isometry3::from_parts(translation, UnitQuaternion::from_rotation_matrix(&rotation))
    }

    /// The rectification; `None` unless both images have the K of one pinhole.
    fn rectification(&self, size: (usize, usize), baseline: f64) -> Option<Rectification> {
        let [left, right] = &self.0;
        let focal = left.k[(0, 0)];
        let doffs = right.k[(0, 2)] - left.k[(0, 2)];
        let center = (left.k[(0, 2)], left.k[(1, 2)]);
        // The unit is applied to all lengths of the file later.
        let rig = Rig::in_unit(focal, center, baseline, doffs, LengthUnit::Squares).ok()?;
        let fits = |warp: &Warp, side| (warp.k - rig.intrinsics(side)).amax() <= SAME * focal;
        let fits = fits(left, Side::Left) && fits(right, Side::Right);
        fits.then_some(Rectification {
            size,
            left: left.rotation,
            right: right.rotation,
            rig,
        })
    }
}

fn write(calibration: &StereoCalibration) -> Writing {
    let unit = unit::name(calibration.unit());
    let mut text = format!(
        "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<VSCalibrationData unit=\"{unit}\">\n"
    );
    // The board's frame is the left camera's, so the right pose is the extrinsics.
    let poses = [Isometry3::identity(), *calibration.right_from_left()];
    let cameras = [calibration.left(), calibration.right()];
    for (camera, pose) in cameras.into_iter().zip(&poses) {
        text += "  <Camera>\n";
        text += &lens(camera.distortion());
        let (width, height) = camera.size();
        text += &format!("    <ImageSize x=\"{width}\" y=\"{height}\"/>\n");
        text += &element("Intrinsic", "intr", camera.matrix().transpose().as_slice());
        let rotation = pose.rotation.to_rotation_matrix();
        text += &element("Rotation", "rot", rotation.matrix().transpose().as_slice());
        let [x, y, z] = <[f64; 3]>::from(pose.translation.vector).map(number);
        text += &format!("    <Transaction x=\"{x}\" y=\"{y}\" z=\"{z}\"/>\n  </Camera>\n");
    }
    if let Some(rectification) = calibration.rectification() {
        text += &stereo(cameras, rectification)?;
    }
    text += "</VSCalibrationData>\n";
    Ok(Written::complete(text))
}

/// The distortion; annex E has k1 k2 p1 p2 without the name of a model.
fn lens(distortion: &Distortion) -> String {
    let element = element("Distortion", "dist", distortion.coefficients());
    match distortion.model() {
        DistortionModel::PlumbBob => element,
        model => element.replace("/>", &format!(" model=\"{model}\"/>")),
    }
}

fn element(name: &str, prefix: &str, values: &[f64]) -> String {
    let attributes = values
        .iter()
        .enumerate()
        .map(|(i, &v)| format!(" {prefix}{i}=\"{}\"", number(v)));
    format!("    <{name}{}/>\n", attributes.collect::<String>())
}

fn stereo(
    cameras: [&Intrinsics; 2],
    rectification: &Rectification,
) -> Result<String, GeometryFault> {
    let (mut quad, mut coeffs) = (String::new(), String::new());
    let rotations = [rectification.left, rectification.right];
    for (i, (camera, side)) in cameras.into_iter().zip(Side::BOTH).enumerate() {
        let raw = camera.matrix().try_inverse();
        let raw = raw.ok_or(GeometryFault::Singular)?;
        let homography = rectification.rig.intrinsics(side) * rotations[i].matrix() * raw;
        // The annex normalizes the last coefficient to 1.
        let homography = homography / homography[(2, 2)];
        let (width, height) = (camera.size().0 as f64, camera.size().1 as f64);
        let corners = [(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)];
        // Writing to a String cannot fail.
        for (j, (x, y)) in corners.into_iter().enumerate() {
            let warped = homography * Vector3::new(x, y, 1.0);
            let [x, y] = [0, 1].map(|axis| number(warped[axis] / warped.z));
            let _ = write!(quad, " x_{i}_{j}=\"{x}\" y_{i}_{j}=\"{y}\"");
        }
        for (row, column) in (0..9).map(|k| (k / 3, k % 3)) {
            let _ = write!(
                coeffs,
                " coeff_{i}_{row}_{column}=\"{}\"",
                number(homography[(row, column)])
            );
        }
    }
    let (width, height) = rectification.size;
    Ok(format!(
        "  <Stereo width=\"{width}\" height=\"{height}\">\n    <Quad{quad}/>\n    \
         <Coeffs{coeffs}/>\n  </Stereo>\n"
    ))
}
