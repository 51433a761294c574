//! OpenCV's FileStorage, YAML or XML.
//!
//! The names are those of its `stereo_calib` sample (M1 D1 M2 D2, R T, R1 R2 P1 P2) and of its
//! documentation (K1 K2). The sample writes neither size nor unit, and writes two files,
//! `intrinsics.yml` and `extrinsics.yml`, which are read together.

use super::document::{Document, Syntax};
use super::format::{CalibrationFormat, Hints, LoadedCalibration, Writing, Written};
use super::geometry::{
    StereoParameters, camera, extrinsics, image_size, read_distortion, rig, stated_model,
};
use super::numbers::{listed, rows};
use super::unit::{self, FileUnit};
use nalgebra::{DMatrix, Vector3};
use std::fmt::Write;
use svl_core::stereo::{
    Distortion, DistortionModel, Intrinsics, LengthUnit, Rectification, Side, StereoCalibration,
};
use svl_core::{Error, Result};

pub(super) const FORMAT: CalibrationFormat = CalibrationFormat {
    name: "opencv",
    title: "OpenCV's FileStorage",
    conventions: "K1 D1 K2 D2 (or M1 D1 M2 D2), D = k1 k2 p1 p2 k3 and up to 14 \
                  coefficients; x_right = R x_left + T; R1 R2 P1 P2 as from stereoRectify; the \
                  unit under length_unit and equidistant under distortion_model, keys of svl's",
    endings: &["yml", "yaml"],
    pairs: &[["intrinsics.yml", "extrinsics.yml"]],
    single: true,
    syntax: Syntax::Markup,
    marks: &["opencv-matrix", "opencv_storage"],
    read,
    write: Some(write),
};

/// A key of svl's for models other than OpenCV's own, and that of OpenCV's sample
/// `camera_calibration`.
const MODEL: &str = "distortion_model";
const FISHEYE: &str = "fisheye_model";

fn read(documents: Vec<Document>, hints: &Hints) -> Result<LoadedCalibration> {
    // There is at least one: paths are never empty.
    let merged = documents
        .into_iter()
        .reduce(Document::completed_by)
        .ok_or_else(|| Error::Invalid("no file".into()))?;
    let document = &merged;
    if document.has("camera_matrix|cameraMatrix") {
        return Err(document.error("contains one camera; svl needs both, K1 D1 K2 D2, and R and T"));
    }
    let stated = if document.has("image_size|imageSize") {
        Some(document.size_of("image_size|imageSize")?)
    } else if document.has("image_width") {
        Some(document.size("image_width", "image_height")?)
    } else {
        None
    };
    let size = image_size(document, stated, hints)?;
    // OpenCV assumes one size; svl writes a second one if they differ.
    let right_size = if document.has("image_size2") {
        document.size_of("image_size2")?
    } else {
        size
    };
    let model = model(document, hints)?;
    let camera = |matrix, distortion, size| {
        let distortion = read_distortion(document, distortion, model)?;
        camera(document, matrix, size, distortion)
    };
    let left = camera("K1|M1|cameraMatrix1", "D1|distCoeffs1", size)?;
    let right = camera("K2|M2|cameraMatrix2", "D2|distCoeffs2", right_size)?;
    let rectification = document
        .has("P1")
        .then(|| rectification(document, size))
        .transpose()?;
    let right_from_left = Some(extrinsics(document, "R", "T")?);
    let unit = FileUnit::stated(document, "length_unit", hints.unit)?;
    let cameras = StereoParameters {
        left,
        right,
        right_from_left,
        rectification,
    };
    let four = document.numbers("D1|distCoeffs1")?.len() == 4;
    let is_stated = hints.model.is_some() || document.has(MODEL) || document.has(FISHEYE);
    let remark = "four coefficients were read as k1 k2 p1 p2; for a file of cv2.fisheye, convert \
                  it with `svl calibrate convert --model equidistant`";
    let remarks = (four && !is_stated).then(|| remark.to_owned());
    let loaded = cameras.loaded(&FORMAT, document, unit, remarks.into_iter().collect());
    loaded.map_err(|e| {
        if four && !is_stated {
            Error::Invalid(format!(
                "{e}; for a file of cv2.fisheye, --model equidistant"
            ))
        } else {
            e
        }
    })
}

/// The distortion model: OpenCV's own, by the number of coefficients, unless the file or the user
/// states another.
fn model(document: &Document, hints: &Hints) -> Result<DistortionModel> {
    if document.has(MODEL) {
        return stated_model(document, MODEL, hints);
    }
    let is_fisheye = document.has(FISHEYE) && document.number(FISHEYE)? != 0.0;
    let stated = is_fisheye.then_some(DistortionModel::Equidistant);
    Ok(hints.model.or(stated).unwrap_or_default())
}

fn rectification(document: &Document, size: (usize, usize)) -> Result<Rectification> {
    let size = if document.has("rectified_size") {
        document.size_of("rectified_size")?
    } else {
        size
    };
    let (p1, p2) = (document.projection("P1")?, document.projection("P2")?);
    // The unit is applied to all lengths of the file later.
    let rig = rig(&p1, &p2, LengthUnit::Squares);
    let rig = document.keyed("P1' and 'P2", rig)?;
    Ok(Rectification {
        size,
        left: document.rotation("R1")?,
        right: document.rotation("R2")?,
        rig,
    })
}

fn write(calibration: &StereoCalibration) -> Writing {
    let (left, right) = (calibration.left(), calibration.right());
    let (width, height) = left.size();
    let mut text = format!("%YAML:1.0\n---\nimage_width: {width}\nimage_height: {height}\n");
    if right.size() != left.size() {
        let (width, height) = right.size();
        text += &format!("image_size2: [ {width}, {height} ]\n");
    }
    text += &format!("length_unit: {}\n", unit::name(calibration.unit()));
    if let Distortion::Equidistant(_) = left.distortion() {
        text += &format!("{MODEL}: {}\n", left.distortion().model());
    }
    let motion = calibration.right_from_left();
    let mut matrices = vec![
        ("K1", fixed(&left.matrix())),
        ("D1", distortion_matrix(left)),
        ("K2", fixed(&right.matrix())),
        ("D2", distortion_matrix(right)),
        ("R", fixed(motion.rotation.to_rotation_matrix().matrix())),
        (
            "T",
            fixed::<3, 1>(&Vector3::from(motion.translation.vector)),
        ),
    ];
    if let Some(rectification) = calibration.rectification() {
        let (width, height) = rectification.size;
        text += &format!("rectified_size: [ {width}, {height} ]\n");
        matrices.extend([
            ("R1", fixed(rectification.left.matrix())),
            ("R2", fixed(rectification.right.matrix())),
            ("P1", fixed(&rectification.rig.projection(Side::Left))),
            ("P2", fixed(&rectification.rig.projection(Side::Right))),
        ]);
    }
    for (name, matrix) in matrices {
        let data: Vec<_> = matrix.row_iter().map(|row| listed(&rows(&row))).collect();
        let (height, width) = matrix.shape();
        // Writing to a String cannot fail.
        let _ = write!(
            text,
            "{name}: !!opencv-matrix\n   rows: {height}\n   cols: {width}\n   dt: d\n   data: [ \
             {} ]\n",
            data.join(",\n       ")
        );
    }
    Ok(Written::complete(text))
}

fn fixed<const R: usize, const C: usize>(matrix: &nalgebra::SMatrix<f64, R, C>) -> DMatrix<f64> {
    DMatrix::from_column_slice(R, C, matrix.as_slice())
}

fn distortion_matrix(camera: &Intrinsics) -> DMatrix<f64> {
    let coefficients = camera.distortion().coefficients();
    DMatrix::from_row_slice(1, coefficients.len(), coefficients)
}
