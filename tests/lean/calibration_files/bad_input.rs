//! Broken calibration files: errors name the file, the key and the remedy.

use super::*;
use crate::common::assert_says;

/// Reads `format`'s file with `from` replaced by `to` in it, or in the first of two.
fn broken(format: &str, from: &str, to: &str) -> String {
    let folder = Folder::new();
    folder.write_sample(format);
    let name = file_of(format).split(',').next_back().unwrap();
    let text = std::fs::read_to_string(folder.path(name)).unwrap();
    assert!(text.contains(from), "{format}: no {from} in\n{text}");
    std::fs::write(folder.path(name), text.replacen(from, to, 1)).unwrap();
    let hints = Hints {
        size: Some((752, 480)).filter(|_| format == "kitti"),
        ..Hints::default()
    };
    let error = folder.read(format, &hints).unwrap_err().to_string();
    assert!(
        !error.contains('\n') && error.contains(name),
        "{format}, {to}: {error}"
    );
    error
}

/// A format, the replacement in its file, and the words of the error.
const WRONG: &str = r#"
    xml: intr0="458.7" -> intr0="nan" => Camera.0.Intrinsic.intr0 | 'nan'
    xml: intr0="458.7" -> => no 'Camera.0.Intrinsic.intr0'
    xml: intr1="0.0" -> intr1="2.0" => Camera.0.Intrinsic | skew of 2
    xml: intr0="458.7" -> intr0="-458.7" => Camera.0.Intrinsic | -458.7
    xml: x="752" -> x="0" => Camera.0.ImageSize.x | 0, expected whole pixels
    xml: x="752" -> x="1e300" => Camera.0.ImageSize.x | expected whole pixels
    xml: rot0="1.0" -> rot0="2.0" => Camera.0.Rotation | not a rotation
    xml: rot0="1.0" -> rot0="1e308" => Camera.0.Rotation | not a rotation
    xml: unit="m" -> => --unit
    xml: unit="m" -> unit="foot" => 'foot' | m, cm, mm
    xml: coeff_0_2_2="1.0" -> coeff_0_2_2="x" => Stereo.Coeffs | 'x'
    xml: </Camera> -> => not XML
    opencv: 458.7 -> .Nan => K1 | '.Nan' | finite
    opencv: 458.7 -> 0.0 => K1 | 0.0
    opencv: K1: -> K9: => no 'K1' or 'M1'
    opencv: 458.7, 0.0, -> 458.7, => K1 | 8 numbers, expected 9
    opencv: image_width: 752 -> image_width: 0 => image_width | whole pixels
    opencv: image_width: 752 -> image_width: many => image_width | 'many'
    opencv: T: !! -> X: !! => no 'T'
    opencv: R: !! -> X: !! => no 'R'
    opencv: R2: !! -> X: !! => no 'R2'
    opencv: 430.0 -> 43.0 => P1 | one focal length
    opencv: length_unit: m -> length_unit: furlong => 'furlong'
    opencv: data: [ -> data: [[ => : line
    ros: plumb_bob -> equidistant => distortion_coefficients | 5 coefficients | equidistant has 4
    ros: plumb_bob -> ftheta => 'distortion_model' | 'ftheta' is not supported
    kalibr: pinhole -> omni => 'cam0.camera_model' is omni | pinhole-equi
    kalibr: radtan -> fov => 'cam0.distortion_model' | 'fov' is not supported
    kalibr: radtan -> equidistant => the left camera's distortion is equidistant | one model
    ros: image_height: 480 -> image_height: 480.5 => image_height | 480.5
    ros: camera_matrix -> camera_matrlx => no 'camera_matrix'
    ros: 457.6, 0.0 -> 457.6, 0.5 => camera_matrix | skew
    middlebury: baseline= -> basel1ne= => no 'baseline'
    middlebury: baseline=110.0 -> baseline=0 => baseline 0 m
    middlebury: width=752 -> width=99999999 => width | whole pixels
    middlebury: 430.0 -> inf => cam0 | 'inf'
    kitti: P1: 430.0 -> P1: 4e1 => P0 | P1 | one focal length
    kitti: P1: -> Q1: => no 'P1'
    kitti-raw: S_00: 752.0 -> S_00: 752.0 3 => S_00 | 3 numbers, expected 2
    kitti-raw: T_01: -0.1 -> T_01: -0.5 => does not agree with its R and T
    kitti-raw: R_rect_00 -> R_rect_99 => no 'R_rect_00'
"#;

#[test]
fn errors_name_the_key() {
    for row in WRONG.lines().map(str::trim).filter(|row| !row.is_empty()) {
        let (replaced, words) = row.split_once(" => ").unwrap();
        let (format, replaced) = replaced.split_once(": ").unwrap();
        let (from, to) = replaced.split_once(" ->").unwrap();
        let error = broken(format, from, to.trim_start());
        println!("{row}");
        assert_says(&error, &words.split(" | ").collect::<Vec<_>>());
    }
}

#[test]
fn a_truncated_file_is_an_error_or_complete() {
    let folder = Folder::new();
    for (format, file) in FILES.into_iter().chain([KITTI_RAW]) {
        folder.write_sample(format);
        let hints = Hints {
            size: Some((752, 480)),
            ..Hints::default()
        };
        let path = folder.path(file.split(',').next_back().unwrap());
        let whole = std::fs::read(&path).unwrap();
        for end in (0..whole.len()).step_by(17) {
            std::fs::write(&path, &whole[..end]).unwrap();
            match folder.read(format, &hints) {
                // A cut in the middle of the last number may leave a valid one.
                Ok(found) => assert!(found.calibration.baseline() > 0.0),
                Err(error) => {
                    let error = error.to_string();
                    assert!(
                        !error.contains('\n')
                            && error.contains(path.parent().unwrap().to_str().unwrap()),
                        "{error}"
                    );
                }
            }
        }
    }
}

#[test]
fn errors_of_folders_pairs_and_unknown_files_say_what_to_do() {
    let folder = Folder::new();
    let reads = |name: &str, words: &[&str]| {
        let error = files::read(&folder.path(name)).unwrap_err().to_string();
        words
            .iter()
            .for_each(|word| assert!(error.contains(word), "{name}: '{word}' is not in: {error}"));
    };
    reads("nothing.xml", &["nothing.xml", "no such file"]);
    reads("a.yaml,b.yaml", &["a.yaml", "no such file"]);
    reads(
        "",
        &[
            "is a folder",
            "left.yaml and right.yaml",
            "cam0/sensor.yaml",
        ],
    );
    std::fs::write(folder.path("strange.yaml"), "a: 1\n").unwrap();
    reads(
        "strange.yaml",
        &["not a calibration that svl knows", "opencv", "kitti-raw"],
    );
    std::fs::write(folder.path("large.xml"), vec![b' '; (1 << 20) + 1]).unwrap();
    reads("large.xml", &["larger"]);
    folder.write("ros", &raw()).unwrap();
    reads("left.yaml", &["one camera of two", "left.yaml,right.yaml"]);
    reads("right.yaml,left.yaml", &["baseline"]);
    folder.write_sample("kalibr");
    reads("camchain.yaml,right.yaml", &["single file contains both"]);
    let to_one = files::write_as(
        &folder.path("one.yaml"),
        files::format("ros").unwrap(),
        &raw(),
        Path::to_owned,
    );
    assert_says(&to_one.unwrap_err().to_string(), &["two files"]);
    assert_says(
        &files::format("opncv").unwrap_err().to_string(),
        &["did you mean 'opencv'"],
    );
}

#[test]
fn a_unit_that_contradicts_the_file_is_refused() {
    let folder = Folder::new();
    let millimetres = Hints {
        unit: Some("mm".parse().unwrap()),
        ..Hints::default()
    };
    for format in ["xml", "opencv", "ros", "kitti-raw"] {
        folder.write_sample(format);
        let error = folder.read(format, &millimetres).unwrap_err().to_string();
        assert!(error.contains("--unit"), "{format}: {error}");
    }
}

#[test]
fn boards_numbered_in_different_directions_need_the_homographies() {
    let folder = Folder::new();
    let text = include_str!("annex_e.xml");
    let poses = format!(
        "{}</VSCalibrationData>",
        &text[..text.find("<Stereo>").unwrap()]
    );
    std::fs::write(folder.path("c.xml"), poses).unwrap();
    let error = folder
        .read("xml", &Hints::default())
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("numbered in different directions"),
        "{error}"
    );
}
