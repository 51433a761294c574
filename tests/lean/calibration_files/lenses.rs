//! Distortion models in the files of other programs.

use super::*;
use crate::common::assert_says;

/// Kalibr's chain of two fisheyes, as its `kalibr_calibrate_cameras` writes it.
const CAMCHAIN: &str = "\
cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.0034, 0.0008, -0.0021, 0.0005]
  distortion_model: equidistant
  intrinsics: [190.97, 190.95, 254.93, 256.89]
  resolution: [512, 512]
  rostopic: /cam0/image_raw
cam1:
  T_cn_cnm1:
  - [0.99999, 0.00231, 0.00037, -0.10092]
  - [-0.0023153, 0.9999, 0.0139, 0.00199]
  - [-0.00033785, -0.01390, 0.9999, -0.00101]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: [0, 2]
  camera_model: pinhole
  distortion_coeffs: [-0.0017, -0.0011, 0.0009, -0.0003]
  distortion_model: equidistant
  intrinsics: [190.44, 190.43, 252.59, 254.91]
  resolution: [512, 512]
  rostopic: /cam1/image_raw
";

/// The same with another such pair, 0.3 m beside the first.
fn chain_of_four() -> String {
    let [first, second] = CAMCHAIN.split_once("cam1:\n").map(<[_; 2]>::from).unwrap();
    let motion = second.split("  cam_overlaps").next().unwrap();
    let third = format!(
        "cam2:\n{}{}",
        motion.replace("-0.10092", "-0.3"),
        &first[6..]
    );
    let fourth = format!("cam3:\n{}", second.replace("-0.10092", "-0.25"));
    let more = (third + &fourth).replace("190.9", "290.9");
    CAMCHAIN.to_owned() + &more.replace("/cam1/", "/cam3/").replace("/cam0/", "/cam2/")
}

/// OpenCV's file of two cameras with these coefficients.
fn opencv(coefficients: &str, more: &str) -> String {
    let count = coefficients.split(',').count();
    let matrix = |name: &str, rows: usize, columns: usize, data: &str| {
        format!(
            "{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: [ \
             {data} ]\n"
        )
    };
    let k = "300., 0., 320., 0., 300., 240., 0., 0., 1.";
    let cameras = ["1", "2"].map(|side| {
        matrix(&format!("K{side}"), 3, 3, k) + &matrix(&format!("D{side}"), 1, count, coefficients)
    });
    [
        "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\nlength_unit: m\n",
        more,
        &cameras.concat(),
        &matrix("R", 3, 3, "1., 0., 0., 0., 1., 0., 0., 0., 1."),
        &matrix("T", 3, 1, "-0.1, 0., 0."),
    ]
    .concat()
}

fn read(text: &str, hints: &Hints) -> Result<LoadedCalibration, String> {
    let folder = Folder::new();
    std::fs::write(folder.path("c.yaml"), text).unwrap();
    let read = files::read_with(&folder.path("c.yaml"), hints);
    read.map_err(|e| e.to_string())
}

#[test]
fn kalibr_s_chain_is_read() {
    let found = read(CAMCHAIN, &Hints::default()).unwrap();
    assert_eq!(found.format.name, "kalibr");
    assert_eq!(found.cameras, None);
    let c = found.calibration;
    assert_eq!(
        *c.right().distortion(),
        Distortion::Equidistant([-0.0017, -0.0011, 0.0009, -0.0003])
    );
    assert_eq!(c.left().size(), (512, 512));
    assert!((c.baseline() - 0.10094).abs() < 1e-4, "{}", c.baseline());
    // One fisheye beside an ideal lens is no pair; a chain has extrinsics.
    let none = CAMCHAIN.replacen("distortion_model: equidistant", "distortion_model: none", 1);
    assert_says(
        &read(&none, &Hints::default()).unwrap_err(),
        &["with one model"],
    );
    let alone = CAMCHAIN.replace("T_cn_cnm1", "T_cam_imu");
    assert_says(
        &read(&alone, &Hints::default()).unwrap_err(),
        &["no 'cam1.T_cn_cnm1.0'"],
    );
    // The IMU beside the right camera, turned and moved by a known motion from the left one.
    let imu = "[0.0, -1.0, 0.0, 0.1], [1.0, 0.0, 0.0, 0.2], [0.0, 0.0, 1.0, 0.3]";
    let back = "[0.0, 1.0, 0.0, -0.2], [-1.0, 0.0, 0.0, 0.1], [0.0, 0.0, 1.0, -0.3]";
    let at = "[0.0, -1.0, 0.0, -0.02], [1.0, 0.0, 0.0, 0.2], [0.0, 0.0, 1.0, 0.3]";
    let at_back = "[0.0, 1.0, 0.0, -0.2], [-1.0, 0.0, 0.0, -0.02], [0.0, 0.0, 1.0, -0.3]";
    for (key, left, right) in [("T_cam_imu", imu, at), ("T_imu_cam", back, at_back)] {
        let last = "[0.0, 0.0, 0.0, 1.0]";
        let chain = CAMCHAIN.replace("T_cn_cnm1:", "T_other:");
        let chain = chain.replacen("cam0:\n", &format!("cam0:\n  {key}: [{left}, {last}]\n"), 1);
        let chain = chain.replacen(
            "cam1:\n",
            &format!("cam1:\n  {key}: [{right}, {last}]\n"),
            1,
        );
        let motion = read(&chain, &Hints::default()).unwrap().calibration;
        let motion = motion.right_from_left();
        let apart = motion.translation.vector - Vector3::new(-0.12, 0.0, 0.0);
        assert!(
            apart.norm() < 1e-12 && motion.rotation.angle() < 1e-12,
            "{key}: {motion}"
        );
    }
    let five = CAMCHAIN.replace("-0.0021, 0.0005]", "-0.0021, 0.0005, 0.0]");
    assert_says(
        &read(&five, &Hints::default()).unwrap_err(),
        &["5 numbers, expected 4"],
    );
    let above = CAMCHAIN
        .replace("-0.10092]", "0.0]")
        .replace("0.00199]", "-0.1]");
    assert_says(
        &read(&above, &Hints::default()).unwrap_err(),
        &["one above the other"],
    );
    let swapped = CAMCHAIN.replace("-0.10092", "0.10092");
    assert_says(
        &read(&swapped, &Hints::default()).unwrap_err(),
        &["swap left and right"],
    );
}

#[test]
fn cameras_of_a_chain_are_chosen_by_their_topics_or_numbers() {
    let chain = chain_of_four();
    let by = |topics, cameras| {
        let hints = Hints {
            topics,
            cameras,
            ..Hints::default()
        };
        read(&chain, &hints)
    };
    let last = by(["/cam2/image_raw", "cam3/image_raw/compressed"], None).unwrap();
    assert_eq!(last.cameras, Some([2, 3]));
    assert_eq!(last.calibration.left().focal_px().0, 290.97);
    let baseline = last.calibration.baseline();
    assert!((baseline - 0.25).abs() < 1e-4, "{baseline}");
    assert_eq!(
        by([""; 2], Some([2, 3])).unwrap().calibration,
        last.calibration
    );
    // Along the chain: from the first to the third camera, about 0.1 + 0.3 m.
    let far = by(["/cam2/image_raw"; 2], Some([0, 2]))
        .unwrap()
        .calibration;
    assert!((far.baseline() - 0.4).abs() < 0.01, "{}", far.baseline());
    let back = by([""; 2], Some([2, 0])).unwrap_err();
    assert_says(&back, &["swap left and right"]);
    for topics in [
        [""; 2],
        ["/cam0/image_raw", "/other"],
        ["/cam0/image_raw_color", "/cam1/image_raw"],
        ["/cam0/image_raw"; 2],
    ] {
        let error = by(topics, None).unwrap_err();
        assert_says(&error, &["has 4 cameras", "FILE:cam0,cam1"]);
    }
    for cameras in [[0, 4], [1, 1]] {
        assert_says(
            &by([""; 2], Some(cameras)).unwrap_err(),
            &["FILE:cam0,cam1"],
        );
    }
    // The numbers stand behind the file, and a kept file has them in its name.
    let folder = Folder::new();
    let path = |name: &str| folder.0.path().join(name);
    let (file, kept) = (path("c.yaml"), path("kept.yaml:cam2,cam3"));
    for path in [&file, &kept] {
        std::fs::write(path, &chain).unwrap();
    }
    let named = path("c.yaml:cam2,cam3");
    for path in [&named, &kept] {
        assert_eq!(files::read(path).unwrap(), last.calibration, "{path:?}");
    }
    assert_eq!(files::inputs(&named).unwrap(), [file]);
    std::fs::write(folder.path("o.yaml"), opencv("0.1, 0., 0., 0., 0.", "")).unwrap();
    let other = files::read(&path("o.yaml:cam0,cam1")).unwrap_err();
    assert_says(&other.to_string(), &["no chain of cameras"]);
}

#[test]
fn a_baseline_in_another_unit_is_refused_with_the_likely_one() {
    let baseline = |t: &str, unit: &str| {
        let text = opencv("0.1, 0., 0., 0., 0.", "").replace("-0.1, 0., 0.", t);
        read(
            &text.replace("length_unit: m", &format!("length_unit: {unit}")),
            &Hints::default(),
        )
    };
    assert!(baseline("-100., 0., 0.", "mm").is_ok());
    // Squares of 10 cm of a board are no metres.
    assert!(baseline("-100., 0., 0.", "squares").is_ok());
    let error = baseline("-100., 0., 0.", "m").unwrap_err();
    assert_says(
        &error,
        &[
            "c.yaml",
            "1.000e2 m",
            "likely 0.1000 m, written in millimetres",
        ],
    );
    let error = baseline("-0.1, 0., 0.", "mm").unwrap_err();
    assert_says(
        &error,
        &["1.000e-4 m", "likely 0.1000 m, written in metres"],
    );
}

#[test]
fn opencv_s_models_are_known_by_their_number_of_coefficients() {
    for (coefficients, model) in [
        ("0.1, 0.01, 0.001, 0.", "plumb_bob"),
        ("0.1, 0.01, 0.001, 0., 0.01", "plumb_bob"),
        (
            "0.1, 0.01, 0., 0., 0., 0.1, 0.01, 0.",
            "rational_polynomial",
        ),
        (
            "0.1, 0., 0., 0., 0., 0., 0., 0., 1e-3, 0., 0., 0.",
            "rational_polynomial",
        ),
        (
            "0.1, 0., 0., 0., 0., 0., 0., 0., 0., 0., 0., 0., 0.01, 0.",
            "rational_polynomial",
        ),
    ] {
        let found = read(&opencv(coefficients, ""), &Hints::default()).unwrap();
        assert_eq!(found.calibration.left().distortion().model().name(), model);
        assert_eq!(
            found.remarks.len(),
            usize::from(coefficients.split(',').count() == 4)
        );
    }
    let error = read(&opencv("0.1, 0., 0., 0., 0., 0.1", ""), &Hints::default()).unwrap_err();
    assert_says(&error, &["'D1' or 'distCoeffs1'", "6 coefficients"]);
}

#[test]
fn four_coefficients_may_be_a_fisheye_s() {
    let text = opencv("0.05, 0.01, 0.001, 0.", "");
    let remarks = read(&text, &Hints::default()).unwrap().remarks;
    assert_says(&remarks[0], &["k1 k2 p1 p2", "--model equidistant"]);
    let fisheye = |model| Hints {
        model: Some(model),
        ..Hints::default()
    };
    let equidistant = fisheye(DistortionModel::Equidistant);
    let stated = opencv("0.05, 0.01, 0.001, 0.", "fisheye_model: 1\n");
    for (text, hints) in [(&text, &equidistant), (&stated, &Hints::default())] {
        let found = read(text, hints).unwrap();
        let lens = Distortion::Equidistant([0.05, 0.01, 0.001, 0.0]);
        assert_eq!(*found.calibration.left().distortion(), lens);
        assert!(found.remarks.is_empty(), "{:?}", found.remarks);
    }
    // Files that state their model.
    let other = fisheye(DistortionModel::PlumbBob);
    assert_says(
        &read(CAMCHAIN, &other).unwrap_err(),
        &["equidistant", "omit --model"],
    );
    let folder = Folder::new();
    folder.write("xml", &raw()).unwrap();
    let error = folder.read("xml", &equidistant).unwrap_err().to_string();
    assert_says(&error, &["plumb_bob, not equidistant", "omit --model"]);
}

#[test]
fn a_lens_that_folds_inside_the_image_is_refused() {
    // It folds at 90 px; the nearest side is at 239.
    let error = read(&opencv("-2., 0., 0., 0.", ""), &Hints::default()).unwrap_err();
    assert_says(
        &error,
        &[
            "the left camera's plumb_bob",
            "folds 82 px",
            "640x480",
            "--model equidistant",
        ],
    );
    assert!(!error.contains('\n'), "{error}");
    // At 300 px, between the nearest side and the farthest.
    let found = read(&opencv("-0.15, 0., 0., 0., 0.", ""), &Hints::default()).unwrap();
    let notes: Vec<_> = found.notes().collect();
    assert_says(&notes[0], &["left image", "no directions beyond 298 px"]);
    assert_eq!(notes.len(), 2);
    // No model of five coefficients is a fisheye's.
    let error = read(&opencv("-2., 0., 0., 0., 0.", ""), &Hints::default()).unwrap_err();
    assert!(!error.contains("equidistant"), "{error}");
    let nan = opencv("-0.15, .Nan, 0., 0., 0.", "");
    assert_says(
        &read(&nan, &Hints::default()).unwrap_err(),
        &["D1", "finite number"],
    );
}

#[test]
fn a_stated_size_is_not_replaced() {
    let hints = Hints {
        size: Some((1280, 960)),
        ..Hints::default()
    };
    let error = read(&opencv("0.1, 0., 0., 0., 0.", ""), &hints).unwrap_err();
    assert_says(
        &error,
        &["is for images of 640x480 pixels, these have 1280x960"],
    );
}
