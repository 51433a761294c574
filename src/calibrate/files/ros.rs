//! ROS `camera_info` files, one per camera, as written by `camera_info_manager` and
//! `camera_calibration`.

use super::document::{Document, Syntax};
use super::format::{
    CalibrationFormat, GeometryFault, Hints, LoadedCalibration, Writing, Written, both,
};
use super::geometry::{StereoParameters, camera, in_metres, read_distortion, rig, stated_model};
use super::numbers::{listed, rows};
use super::unit::FileUnit;
use nalgebra::{Matrix3x4, Rotation3};
use svl_core::Result;
use svl_core::doubt::CalibrationCheck;
use svl_core::stereo::{Intrinsics, LengthUnit, Rectification, Side, StereoCalibration};

pub(super) const FORMAT: CalibrationFormat = CalibrationFormat {
    name: "ros",
    title: "ROS's camera_info",
    conventions: "camera_matrix K, distortion_model plumb_bob, rational_polynomial or \
                  equidistant, rectification_matrix R, projection_matrix P, metres; the \
                  extrinsics are only in R and P",
    endings: &["yaml"],
    pairs: &[["left.yaml", "right.yaml"]],
    single: false,
    syntax: Syntax::Markup,
    marks: &["rectification_matrix"],
    read,
    write: Some(write),
};

fn read(documents: Vec<Document>, hints: &Hints) -> Result<LoadedCalibration> {
    let [left, right] = both(documents)?;
    let unit = FileUnit::METRE.fixed(&left, hints.unit)?;
    let projections = (
        left.projection("projection_matrix")?,
        right.projection("projection_matrix")?,
    );
    let rig = rig(&projections.0, &projections.1, LengthUnit::Metres).map_err(|reason| {
        right.error(format!(
            "'projection_matrix': {reason}; calibrate both cameras together, left one first"
        ))
    })?;
    let rotation = |document: &Document| document.rotation("rectification_matrix");
    let intrinsics = (one(&left, hints)?, one(&right, hints)?);
    let size = intrinsics.0.size();
    let rectification = Rectification {
        size,
        left: rotation(&left)?,
        right: rotation(&right)?,
        rig,
    };
    let cameras = StereoParameters {
        left: intrinsics.0,
        right: intrinsics.1,
        right_from_left: None,
        rectification: Some(rectification),
    };
    let offsets = CalibrationCheck::offsets(&projections.0, &projections.1);
    Ok(LoadedCalibration {
        offsets: offsets.doubt(),
        ..cameras.loaded(&FORMAT, &left, unit, Vec::new())?
    })
}

fn one(document: &Document, hints: &Hints) -> Result<Intrinsics> {
    let model = stated_model(document, "distortion_model", hints)?;
    let size = document.size("image_width", "image_height")?;
    let distortion = read_distortion(document, "distortion_coefficients", model)?;
    camera(document, "camera_matrix", size, distortion)
}

fn write(calibration: &StereoCalibration) -> Writing {
    in_metres(calibration)?;
    let Some(rectification) = calibration.rectification() else {
        return Err(GeometryFault::NoExtrinsics);
    };
    if [calibration.left().size(), calibration.right().size()] != [rectification.size; 2] {
        return Err(GeometryFault::Sizes);
    }
    let rig = rectification.rig;
    let [p1, p2] = Side::BOTH.map(|side| rig.projection(side));
    let texts = vec![
        camera_info("left", calibration.left(), &rectification.left, &p1),
        camera_info("right", calibration.right(), &rectification.right, &p2),
    ];
    Ok(Written {
        texts,
        left_out: Vec::new(),
    })
}

fn camera_info(name: &str, camera: &Intrinsics, r: &Rotation3<f64>, p: &Matrix3x4<f64>) -> String {
    let (width, height) = camera.size();
    let coefficients = camera.distortion().coefficients();
    let matrix = |name: &str, rows: usize, columns: usize, values: &[f64]| {
        format!(
            "{name}:\n  rows: {rows}\n  cols: {columns}\n  data: [{}]\n",
            listed(values)
        )
    };
    [
        format!("image_width: {width}\nimage_height: {height}\ncamera_name: {name}\n"),
        matrix("camera_matrix", 3, 3, &rows(&camera.matrix())),
        format!("distortion_model: {}\n", camera.distortion().model()),
        matrix(
            "distortion_coefficients",
            1,
            coefficients.len(),
            coefficients,
        ),
        matrix("rectification_matrix", 3, 3, &rows(r.matrix())),
        matrix("projection_matrix", 3, 4, &rows(p)),
    ]
    .concat()
}
