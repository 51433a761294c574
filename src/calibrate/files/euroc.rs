//! EuRoC's and ASL's `sensor.yaml`, one per camera; read only.

use super::document::{Document, Syntax};
use super::format::{CalibrationFormat, Hints, LoadedCalibration, both};
use super::geometry::{StereoParameters, read_distortion, stated_model};
use super::unit::FileUnit;
use nalgebra::{Isometry3, Matrix4};
use svl_core::Result;
use svl_core::stereo::{Intrinsics, motion};

pub(super) const FORMAT: CalibrationFormat = CalibrationFormat {
    name: "euroc",
    title: "EuRoC's sensor.yaml",
    conventions: "intrinsics fu fv cu cv, radial-tangential k1 k2 p1 p2 or equidistant k1 k2 k3 \
                  k4; T_BS: x_body = T_BS x_camera, metres; no rectification; cam0 is the left \
                  camera",
    endings: &["yaml"],
    pairs: &[
        ["cam0/sensor.yaml", "cam1/sensor.yaml"],
        ["mav0/cam0/sensor.yaml", "mav0/cam1/sensor.yaml"],
    ],
    single: false,
    syntax: Syntax::Markup,
    marks: &["T_BS"],
    read,
    write: None,
};

fn read(documents: Vec<Document>, hints: &Hints) -> Result<LoadedCalibration> {
    let [left, right] = both(documents)?;
    let unit = FileUnit::METRE.fixed(&left, hints.unit)?;
    let cameras = StereoParameters {
        left: camera(&left, hints)?,
        right: camera(&right, hints)?,
        // Both poses are relative to the body: X_right = T_BS(right)⁻¹ T_BS(left) X_left.
        right_from_left: Some(body_from_camera(&right)?.inverse() * body_from_camera(&left)?),
        rectification: None,
    };
    cameras.loaded(&FORMAT, &right, unit, Vec::new())
}

fn camera(document: &Document, hints: &Hints) -> Result<Intrinsics> {
    let model = document.text("camera_model")?;
    if model != "pinhole" {
        return Err(document.error(format!("'camera_model' is {model}; svl reads pinhole")));
    }
    let model = stated_model(document, "distortion_model", hints)?;
    let [fx, fy, cx, cy] = document.array("intrinsics")?;
    let distortion = read_distortion(document, "distortion_coefficients", model)?;
    let size = document.size_of("resolution")?;
    let camera = Intrinsics::new(size, (fx, fy), (cx, cy), distortion);
    document.keyed("intrinsics", camera)
}

fn body_from_camera(document: &Document) -> Result<Isometry3<f64>> {
    let pose = Matrix4::from_row_slice(&document.array::<16>("T_BS")?);
    let rotation = pose.fixed_view::<3, 3>(0, 0).into();
    let translation = pose.fixed_view::<3, 1>(0, 3).into();
    document.keyed("T_BS", motion(&rotation, translation))
}
