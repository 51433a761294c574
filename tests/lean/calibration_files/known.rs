//! Calibration files written by other programs.

use super::*;
use crate::common::assert_says;

fn dataset(name: &str) -> Option<PathBuf> {
    let path = crate::common::repository()
        .join("../shared/datasets")
        .join(name);
    if path.exists() {
        return Some(path);
    }
    crate::common::skip(&format!("no data set {name}"));
    None
}

fn unit(name: &str) -> Hints<'static> {
    Hints {
        unit: Some(name.parse().unwrap()),
        ..Hints::default()
    }
}

/// The calibration that the thesis prints, and the remarks on it.
fn annex_e() -> (StereoCalibration, Vec<String>) {
    let folder = Folder::new();
    std::fs::write(folder.path("c.xml"), include_str!("annex_e.xml")).unwrap();
    let loaded = folder.read("xml", &Hints::default()).unwrap();
    (loaded.calibration, loaded.remarks)
}

#[test]
fn annex_e_is_read_as_it_is_printed() {
    let (c, remarks) = annex_e();
    assert_eq!(c.left().size(), (240, 320));
    assert_eq!(c.left().focal_px(), (566.065_612_793_0, 566.676_574_707_0));
    assert_eq!(
        c.right().distortion().coefficients(),
        [
            -0.238_349_586_7,
            0.588_825_583_5,
            0.000_249_059_8,
            -0.002_409_616_3,
            0.0
        ]
    );
    assert!(c.unit() == LengthUnit::Squares && (c.baseline() - 1.0).abs() < 1e-12);
    assert!(
        remarks[0].contains("numbered in different directions") && remarks[0].contains("91°"),
        "{remarks:?}"
    );
    assert!(
        c.rectification().is_none() && remarks[1].contains("dropped"),
        "{remarks:?}"
    );
}

#[test]
fn the_poses_of_annex_e_nearly_agree() {
    let (c, _) = annex_e();
    // The right board is rotated by 90°.
    let quarter = Rotation3::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2);
    let left = nalgebra::Matrix3::new(
        0.0123223495,
        0.9976426363,
        -0.0675079376,
        0.9882473350,
        -0.0018631991,
        0.1528519839,
        0.1523658782,
        -0.0685980394,
        -0.9859406352,
    );
    let right = nalgebra::Matrix3::new(
        -0.9984018803,
        0.0098599484,
        -0.0556461513,
        0.0011273620,
        0.9879410863,
        0.1548262835,
        0.0565016977,
        0.1545161158,
        -0.9863733053,
    );
    let turned =
        svl_core::stereo::rotation(&(right * quarter.matrix() * left.transpose())).unwrap();
    let apart = c
        .right_from_left()
        .rotation
        .angle_to(&UnitQuaternion::from_rotation_matrix(&turned));
    assert!(apart.to_degrees() < 4.0, "{}", apart.to_degrees());
    println!("apart {}", apart.to_degrees());
}

#[test]
fn the_geometry_of_annex_e_is_that_of_its_homographies() {
    let (c, _) = annex_e();
    // The homographies map corresponding points to one row, so the rotation and the direction of
    // the baseline derived from them must do so too.
    let essential = c.right_from_left().translation.vector.cross_matrix()
        * c.right_from_left().rotation.to_rotation_matrix();
    let homography =
        |m: [f64; 9], k: &Intrinsics| nalgebra::Matrix3::from_row_slice(&m) * k.matrix();
    let h0 = homography(
        [
            1.0448307652,
            -0.0130454206,
            -13.1325979233,
            -0.0041175033,
            0.9614407391,
            11.2207002639,
            -0.0001177116,
            0.0000042663,
            1.0,
        ],
        c.left(),
    );
    let h1 = homography(
        [
            1.0262211635,
            -0.0148082858,
            0.0034242452,
            0.0009573988,
            0.9421653755,
            -0.2178648710,
            -0.0001005995,
            -0.0000053938,
            1.0,
        ],
        c.right(),
    );
    for (x, y) in [(-0.1, -0.2), (0.1, 0.2), (0.0, 0.0), (0.15, -0.25)] {
        let direction = Vector3::new(x, y, 1.0);
        // The pixel of the epipolar line in the right image, at column x.
        let line = essential * direction;
        let seen = Vector3::new(x, -(line.x * x + line.z) / line.y, 1.0);
        let row = |h: &nalgebra::Matrix3<f64>, d: Vector3<f64>| (h * d).y / (h * d).z;
        let off = row(&h0, direction) - row(&h1, seen);
        assert!(off.abs() < 8.0, "{off}");
        println!("row {off}");
    }
}

#[test]
fn opencv_s_reference_of_the_chessboard() {
    let Some(path) = dataset("calibration-chessboard/reference_opencv.yml") else {
        return;
    };
    let c = files::read_with(&path, &unit("squares"))
        .unwrap()
        .calibration;
    assert_eq!(c.left().distortion().coefficients()[4], 0.16343305509208755);
    assert!((c.baseline() - 3.32822).abs() < 1e-5);
    assert_eq!(
        c.rectification().unwrap().rig.focal_px(),
        515.941_966_785_482_7
    );
    let metres = files::read_with(&path, &unit("squares=0.025"))
        .unwrap()
        .calibration;
    assert!((metres.rig().unwrap().baseline_m() - 3.32822 * 0.025).abs() < 1e-6);
    assert_says(&files::read(&path).unwrap_err().to_string(), &["--unit"]);
}

#[test]
fn euroc_agrees_with_opencv_s_reading_of_it() {
    let Some(path) = dataset("euroc-v1_01_easy") else {
        return;
    };
    let c = files::read(&path).unwrap();
    let reference = files::read_with(&path.join("reference_rectification_opencv.yml"), &unit("m"))
        .unwrap()
        .calibration;
    assert_eq!((c.left(), c.right()), (reference.left(), reference.right()));
    let off =
        c.right_from_left().translation.vector - reference.right_from_left().translation.vector;
    assert!(
        off.norm() < 1e-9
            && c.right_from_left()
                .rotation
                .angle_to(&reference.right_from_left().rotation)
                < 1e-8
    );
}

#[test]
fn kitti_s_raw_data_has_both_cameras_and_their_rectification() {
    let folder = Folder::new();
    folder.write_sample("kitti-raw");
    let found = folder.read("kitti-raw", &Hints::default()).unwrap();
    assert_same(&found.calibration, &raw());
    assert!(found.remarks.is_empty(), "{:?}", found.remarks);
}

#[test]
fn xml_of_opencv_is_its_yaml() {
    let folder = Folder::new();
    folder.write("opencv", &raw()).unwrap();
    let yaml = std::fs::read_to_string(folder.path("c.yml")).unwrap();
    let mut xml = String::from("<?xml version=\"1.0\"?>\n<opencv_storage>\n");
    for block in yaml
        .split("---\n")
        .nth(1)
        .unwrap()
        .replace("\n   ", "\u{1}")
        .lines()
    {
        let (name, value) = block.split_once(": ").unwrap();
        let value = match value.split_once("data: [") {
            Some((_, data)) => {
                let data = data.replace(['\u{1}', ',', ']'], " ");
                format!("<rows>1</rows><cols>9</cols><dt>d</dt><data>\n{data}</data>")
            }
            None => value.replace(['[', ']', ','], " "),
        };
        xml += &format!("<{name} type_id=\"opencv-matrix\">{value}</{name}>\n").replace(
            if block.contains("opencv-matrix") {
                "\u{2}"
            } else {
                " type_id=\"opencv-matrix\""
            },
            "",
        );
    }
    std::fs::write(folder.path("c.xml"), xml + "</opencv_storage>\n").unwrap();
    let found = folder.read("xml", &Hints::default()).unwrap();
    assert_eq!(found.format.name, "opencv");
    assert_same(&found.calibration, &raw());
}

#[test]
fn opencv_s_sample_writes_two_files() {
    let folder = Folder::new();
    folder.write("opencv", &raw()).unwrap();
    let yaml = std::fs::read_to_string(folder.path("c.yml")).unwrap();
    let (intrinsics, extrinsics) = yaml.split_at(yaml.find("R: ").unwrap());
    let intrinsics: String = intrinsics
        .lines()
        .filter(|l| !l.contains("image_") && !l.contains("unit"))
        .map(|l| l.replace('K', "M") + "\n")
        .collect();
    std::fs::write(folder.path("intrinsics.yml"), intrinsics).unwrap();
    std::fs::write(
        folder.path("extrinsics.yml"),
        format!("%YAML:1.0\n{extrinsics}"),
    )
    .unwrap();
    let error = files::read(folder.0.path()).unwrap_err().to_string();
    assert!(error.contains("--size"), "{error}");
    let hints = Hints {
        size: Some((752, 480)),
        ..unit("m")
    };
    assert_same(
        &files::read_with(folder.0.path(), &hints)
            .unwrap()
            .calibration,
        &raw(),
    );
}
