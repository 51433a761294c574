//! `svl calibrate convert`.

use super::fixture::{Fixture, assert_says, datasets};
use crate::common::python;

pub(super) const PAIR: &str = "%YAML:1.0
image_size: [ 640, 480 ]
K1: [ 530., 0., 340., 0., 531., 240., 0., 0., 1. ]
D1: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -2.8e-01, 2.5e-02, 1.2e-03, 0., 1.6e-01 ]
K2: [ 535., 0., 330., 0., 536., 245., 0., 0., 1. ]
D2: [ -3.0e-01, 1.5e-01, 0., 0. ]
R: [ 1., 0., 0., 0., 1., 0., 0., 0., 1. ]
T: [ -4., 0.03, 0.01 ]
";

#[test]
fn it_says_what_it_read_and_what_it_left_out() {
    let fixture = Fixture::new();
    fixture.write("cv.yml", PAIR);
    let text = fixture.run("calibrate convert cv.yml c.xml --unit squares=0.025");
    insta::assert_snapshot!(text);
    insta::assert_snapshot!("the_thesis_s_xml", fixture.text("c.xml"));
    let back = fixture.run("calibrate convert c.xml b.yaml");
    assert_says(&back, &["baseline 0.100003 m"]);
}

#[test]
fn help_lists_the_formats() {
    let text = Fixture::new().run("calibrate convert --help");
    for format in svl::calibrate::files::FORMATS {
        assert!(
            text.contains(&format!("  {} ", format.name)),
            "{}",
            format.name
        );
    }
}

/// OpenCV reads what svl writes, number for number.
#[test]
fn opencv_reads_the_same_numbers() {
    let Some(datasets) = datasets() else { return };
    let fixture = Fixture::new();
    let theirs = datasets.join("calibration-chessboard/reference_opencv.yml");
    let theirs = theirs.display().to_string();
    fixture.run(&[
        "calibrate",
        "convert",
        &theirs,
        "ours.yml",
        "--unit",
        "squares",
    ]);
    let files = [
        theirs.into(),
        fixture.path("ours.yml"),
        fixture.path("theirs.xml"),
    ];
    if python("calibration_files.py", "cv2, numpy", files).is_none() {
        return;
    }
    // And svl reads the XML that OpenCV wrote from it.
    let text = fixture.run("calibrate convert theirs.xml again.yml --unit squares");
    assert_says(&text, &["baseline 3.328221 squares"]);
}
