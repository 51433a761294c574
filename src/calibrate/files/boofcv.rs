//! BoofCV's stereo YAML.
//!
//! It states no unit: svl writes one under its own key, which BoofCV ignores.

use super::document::{Document, Syntax};
use super::format::{CalibrationFormat, Hints, LoadedCalibration, Writing, Written, one};
use super::geometry::{StereoParameters, plumb_bob};
use super::numbers::{number, rows};
use super::unit::{self, FileUnit};
use nalgebra::Vector3;
use svl_core::Result;
use svl_core::stereo::{Intrinsics, StereoCalibration, motion};

pub(super) const FORMAT: CalibrationFormat = CalibrationFormat {
    name: "boofcv",
    title: "BoofCV's stereo YAML",
    conventions: "pinhole_radial_tangential, radial = k1 k2 k3, t1 t2 = p1 p2; rightToLeft: \
                  x_left = R x_right + T; the unit under length_unit, a key of svl's; no \
                  rectification",
    endings: &["yaml"],
    pairs: &[],
    single: true,
    syntax: Syntax::Markup,
    marks: &["rightToLeft"],
    read,
    write: Some(write),
};

fn read(documents: Vec<Document>, hints: &Hints) -> Result<LoadedCalibration> {
    let document = one(documents)?;
    let translation =
        ["rightToLeft.x", "rightToLeft.y", "rightToLeft.z"].map(|key| document.number(key));
    let [x, y, z] = translation;
    let rotation = document.matrix("rightToLeft.rotation")?;
    let left_from_right = motion(&rotation, Vector3::new(x?, y?, z?))
        .map_err(|e| document.error(format!("'rightToLeft.rotation': {e}")))?;
    let cameras = StereoParameters {
        left: camera(&document, "left")?,
        right: camera(&document, "right")?,
        right_from_left: Some(left_from_right.inverse()),
        rectification: None,
    };
    let unit = FileUnit::stated(&document, "length_unit", hints.unit)?;
    cameras.loaded(&FORMAT, &document, unit, Vec::new())
}

fn camera(document: &Document, side: &str) -> Result<Intrinsics> {
    let key = |name: &str| format!("{side}.{name}");
    let distortion = match document.text(&key("model"))? {
        "pinhole" => [0.0; 5],
        "pinhole_radial_tangential" => {
            let radial = document.numbers(&key("radial_tangential.radial"))?;
            let term = |i: usize| radial.get(i).copied().unwrap_or(0.0);
            if radial.iter().skip(3).any(|v| *v != 0.0) {
                let what = key("radial_tangential.radial");
                return Err(document.error(format!(
                    "'{what}' has {} terms; svl's distortion has three",
                    radial.len()
                )));
            }
            let tangential = |name: &str| {
                let key = key(&format!("radial_tangential.{name}"));
                if document.has(&key) {
                    document.number(&key)
                } else {
                    Ok(0.0)
                }
            };
            [
                term(0),
                term(1),
                tangential("t1")?,
                tangential("t2")?,
                term(2),
            ]
        }
        model => {
            let key = key("model");
            return Err(document.error(format!(
                "'{key}' is {model}; svl reads pinhole_radial_tangential"
            )));
        }
    };
    let at = |name: &str| document.number(&key(&format!("pinhole.{name}")));
    let skew = at("skew")?;
    if skew != 0.0 {
        let key = key("pinhole.skew");
        return Err(document.error(format!(
            "'{key}' is {skew}; svl's cameras have none, calibrate without"
        )));
    }
    let size = document.size(&key("pinhole.width"), &key("pinhole.height"))?;
    Intrinsics::new(
        size,
        (at("fx")?, at("fy")?),
        (at("cx")?, at("cy")?),
        distortion,
    )
    .map_err(|e| document.error(format!("'{side}': {e}")))
}

fn write(calibration: &StereoCalibration) -> Writing {
    let left_from_right = calibration.right_from_left().inverse();
    let rotation = rows(left_from_right.rotation.to_rotation_matrix().matrix());
    let [x, y, z] = left_from_right.translation.vector.into();
    let text = [
        "# Intrinsic and extrinsic parameters for a stereo camera pair\nmodel: \
         stereo_camera\nversion: 0\n"
            .to_owned(),
        format!("length_unit: {}\n", unit::name(calibration.unit())),
        one_side("left", calibration.left())?,
        one_side("right", calibration.right())?,
        format!("rightToLeft:\n  rotation:\n{}", items("  ", &rotation)),
        format!(
            "  x: {}\n  y: {}\n  z: {}\n",
            number(x),
            number(y),
            number(z)
        ),
    ];
    let left_out = calibration
        .rectification()
        .map(|_| "the rectification")
        .into_iter()
        .collect();
    Ok(Written {
        texts: vec![text.concat()],
        left_out,
    })
}

fn one_side(side: &str, camera: &Intrinsics) -> std::result::Result<String, String> {
    let ((fx, fy), (cx, cy)) = (camera.focal_px(), camera.center_px());
    let (width, height) = camera.size();
    let [k1, k2, p1, p2, k3] = plumb_bob(camera)?;
    // Most BoofCV files have two terms, and not every reader expects more.
    let radial = if k3 == 0.0 {
        vec![k1, k2]
    } else {
        vec![k1, k2, k3]
    };
    let [fx, fy, cx, cy, p1, p2] = [fx, fy, cx, cy, p1, p2].map(number);
    Ok(format!(
        "{side}:\n  model: pinhole_radial_tangential\n  version: 0\n  pinhole:\n    fx: {fx}\n    \
         fy: {fy}\n    cx: {cx}\n    cy: {cy}\n    width: {width}\n    height: {height}\n    \
         skew: 0.0\n  radial_tangential:\n    radial:\n{}    t1: {p1}\n    t2: {p2}\n",
        items("    ", &radial)
    ))
}

fn items(indent: &str, values: &[f64]) -> String {
    values
        .iter()
        .map(|&v| format!("{indent}- {}\n", number(v)))
        .collect()
}
