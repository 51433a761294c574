//! Kalibr's `camchain.yaml`: a chain of cameras, of which two are the pair.

use super::document::{Document, Syntax};
use super::format::{
    CalibrationFormat, GeometryFault, Hints, LoadedCalibration, Writing, Written, one,
};
use super::geometry::{StereoParameters, in_metres, read_distortion, stated_model};
use super::numbers::{listed, rows};
use super::unit::FileUnit;
use nalgebra::{Isometry3, Matrix3, Vector3};
use svl_core::Result;
use svl_core::stereo::{Distortion, Intrinsics, StereoCalibration, motion};

pub(super) const FORMAT: CalibrationFormat = CalibrationFormat {
    name: "kalibr",
    title: "Kalibr's camchain",
    conventions: "pinhole fu fv pu pv with radtan k1 k2 p1 p2, equidistant k1 k2 k3 k4 or none; \
                  T_cn_cnm1: x_cam1 = T x_cam0, metres, or T_cam_imu or T_imu_cam of both; no \
                  rectification; cam0 is the left camera of two; of more, FILE:cam2,cam3 names the \
                  left and the right one",
    endings: &["yaml"],
    pairs: &[],
    single: true,
    syntax: Syntax::Markup,
    marks: &["T_cn_cnm1", "cam0:"],
    read,
    write: Some(write),
};

fn read(documents: Vec<Document>, hints: &Hints) -> Result<LoadedCalibration> {
    let document = &one(documents)?;
    let unit = FileUnit::METRE.fixed(document, hints.unit)?;
    let chosen = chosen(document, hints)?;
    let [left, right] = chosen.unwrap_or([0, 1]);
    let cameras = StereoParameters {
        left: camera(document, left, hints)?,
        right: camera(document, right, hints)?,
        right_from_left: Some(right_from_left(document, [left, right])?),
        rectification: None,
    };
    let loaded = cameras.loaded(&FORMAT, document, unit, Vec::new())?;
    Ok(LoadedCalibration {
        cameras: chosen,
        ..loaded
    })
}

/// The left and the right camera, by their numbers or their topics. `None` for a chain of two, of
/// which the first is the left one.
fn chosen(document: &Document, hints: &Hints) -> Result<Option<[usize; 2]>> {
    let has = |camera: &usize| document.has(&format!("cam{camera}"));
    let count = (0..).take_while(has).count();
    // A topic of compressed images is below that of the images.
    let fits = |camera: usize, image: &str| {
        let topic = document.text(&format!("cam{camera}.rostopic")).ok()?;
        let topic = topic.trim_start_matches('/');
        let rest = image.trim_start_matches('/').strip_prefix(topic)?;
        (rest.is_empty() || rest.starts_with('/')).then_some((topic.len(), camera))
    };
    let [left, right] = hints.topics.map(|image| {
        let all = (0..count).filter_map(|camera| fits(camera, image));
        all.max().map(|(_, camera)| camera)
    });
    let chosen = hints.cameras.or(left.zip(right).map(<[_; 2]>::from));
    let is_pair = |[left, right]: &[usize; 2]| left != right && *left.max(right) < count;
    match chosen.filter(is_pair) {
        _ if count <= 2 && hints.cameras.is_none() => Ok(None),
        None => Err(document.error(format_args!(
            "has {count} cameras, from cam0 on, and neither rostopics nor numbers tell which two \
             are the pair: name the left and the right one behind the file, as FILE:cam0,cam1"
        ))),
        chosen => Ok(chosen),
    }
}

fn camera(document: &Document, camera: usize, hints: &Hints) -> Result<Intrinsics> {
    let key = |part: &str| format!("cam{camera}.{part}");
    let model = document.text(&key("camera_model"))?;
    if model != "pinhole" {
        return Err(document.error(format!(
            "'cam{camera}.camera_model' is {model}, which svl does not support; calibrate with \
             pinhole-radtan or pinhole-equi"
        )));
    }
    let model_key = key("distortion_model");
    let distortion = if document.text(&model_key)? == "none" {
        Distortion::NONE
    } else {
        let model = stated_model(document, &model_key, hints)?;
        // Both of Kalibr's models have four.
        document.array::<4>(&key("distortion_coeffs"))?;
        read_distortion(document, &key("distortion_coeffs"), model)?
    };
    let [fx, fy, cx, cy] = document.array(&key("intrinsics"))?;
    let size = document.size_of(&key("resolution"))?;
    let camera = Intrinsics::new(size, (fx, fy), (cx, cy), distortion);
    document.keyed(&key("intrinsics"), camera)
}

/// The motion between the cameras, along the chain; without it by those to the IMU, as in
/// OpenVINS's files.
fn right_from_left(document: &Document, cameras: [usize; 2]) -> Result<Isometry3<f64>> {
    let [first, last] = [cameras[0].min(cameras[1]), cameras[0].max(cameras[1])];
    let own = |camera: usize| format!("cam{camera}.T_cn_cnm1");
    let is_chain = (first + 1..=last).all(|camera| document.has(&own(camera)));
    let both = |key: &str| {
        let keys = cameras.map(|camera| format!("cam{camera}.{key}"));
        (!is_chain && keys.iter().all(|key| document.has(key))).then_some(keys)
    };
    if let Some([left, right]) = both("T_cam_imu") {
        Ok(pose(document, &right)? * pose(document, &left)?.inverse())
    } else if let Some([left, right]) = both("T_imu_cam") {
        Ok(pose(document, &right)?.inverse() * pose(document, &left)?)
    } else {
        let mut motion = Isometry3::identity();
        for camera in first + 1..=last {
            motion = pose(document, &own(camera))? * motion;
        }
        let is_forward = cameras[0] == first;
        Ok(if is_forward { motion } else { motion.inverse() })
    }
}

/// A transform of four rows of four numbers.
fn pose(document: &Document, key: &str) -> Result<Isometry3<f64>> {
    let [x, y, z] = [0, 1, 2].map(|row| document.array::<4>(&format!("{key}.{row}")));
    let rows = [x?, y?, z?];
    let rotation = Matrix3::from_fn(|row, column| rows[row][column]);
    let translation = Vector3::from(rows.map(|[.., shift]| shift));
    document.keyed(key, motion(&rotation, translation))
}

fn write(calibration: &StereoCalibration) -> Writing {
    in_metres(calibration)?;
    let mut text = one_camera("cam0", 1, calibration.left())?;
    text += &one_camera("cam1", 0, calibration.right())?;
    text += "  T_cn_cnm1:\n";
    for row in calibration.right_from_left().to_homogeneous().row_iter() {
        text += &format!("  - [{}]\n", listed(&rows(&row)));
    }
    let left_out = calibration.rectification().map(|_| "the rectification");
    Ok(Written {
        texts: vec![text],
        left_out: left_out.into_iter().collect(),
    })
}

fn one_camera(name: &str, other: usize, camera: &Intrinsics) -> Result<String, GeometryFault> {
    let (model, coefficients) = match camera.distortion() {
        Distortion::PlumbBob([first @ .., 0.0]) => ("radtan", first),
        Distortion::Equidistant(all) => ("equidistant", all),
        other => {
            let (model, count) = (other.model(), other.coefficients().len());
            return Err(GeometryFault::Distortion(name.to_owned(), model, count));
        }
    };
    let ((fx, fy), (cx, cy)) = (camera.focal_px(), camera.center_px());
    let (width, height) = camera.size();
    Ok(format!(
        "{name}:\n  cam_overlaps: [{other}]\n  camera_model: pinhole\n  distortion_coeffs: \
         [{}]\n  distortion_model: {model}\n  intrinsics: [{}]\n  resolution: [{width}, \
         {height}]\n",
        listed(coefficients),
        listed(&[fx, fy, cx, cy])
    ))
}
