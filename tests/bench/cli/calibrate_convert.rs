//! `svl calibrate convert`.

use super::fixture::{Fixture, datasets};
use std::process::Command;

const PAIR: &str = "%YAML:1.0
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
    let text = fixture
        .svl(&[
            "calibrate",
            "convert",
            "cv.yml",
            "c.xml",
            "--unit",
            "squares=0.025",
        ])
        .done();
    insta::assert_snapshot!(text);
    insta::assert_snapshot!(
        "the_thesis_s_xml",
        std::fs::read_to_string(fixture.path("c.xml")).unwrap()
    );
    let back = fixture
        .svl(&["calibrate", "convert", "c.xml", "b.yaml", "--to", "boofcv"])
        .done();
    assert!(back.contains("baseline 0.100003 m"), "{back}");
}

#[test]
fn what_is_missing_or_in_the_way_has_a_cure() {
    let fixture = Fixture::new();
    fixture.write("cv.yml", PAIR);
    fixture.write("other.yaml", "a: 1\n");
    let convert = |args: &[&str]| fixture.svl(&[&["calibrate", "convert"], args].concat());
    convert(&["cv.yml", "c.xml"]).failed(1, &["cv.yml", "--unit", "squares"]);
    convert(&["cv.yml", "c.txt", "--unit", "m"]).failed(2, &["c.txt", "--to", "middlebury, kitti"]);
    convert(&["cv.yml", "c.pdf", "--unit", "m"]).failed(2, &["c.pdf", ".xml"]);
    convert(&["cv.yml", "cv.yml", "--force", "--unit", "m"]).failed(2, &["cv.yml", "named twice"]);
    convert(&["cv.yml", "c.xml", "--unit", "foot"]).failed(2, &["'foot'", "mm"]);
    convert(&["cv.yml", "c.xml", "--from", "opencw"]).failed(2, &["did you mean 'opencv'"]);
    convert(&["cv.yml", "c.xml", "--from", "boofcv"])
        .failed(1, &["cv.yml", "no 'rightToLeft.rotation'", "BoofCV"]);
    convert(&["cv.yml", "l.yaml,r.yaml", "--unit", "m"])
        .failed(1, &["l.yaml,r.yaml", "has none", "--rectify"]);
    convert(&["cv.yml", "l.yaml,r.yaml", "--unit", "squares"])
        .failed(1, &["in squares", "squares=SIDE_IN_METRES"]);
    convert(&["cv.yml", "c.txt", "--to", "kitti", "--unit", "m"])
        .failed(1, &["rectified cameras only"]);
    convert(&["other.yaml", "c.xml"])
        .failed(1, &["other.yaml", "not a calibration that svl knows"]);
    convert(&["nothing.xml", "c.xml"]).failed(1, &["nothing.xml", "no such file"]);
    assert!(!fixture.path("c.xml").exists() && !fixture.path("l.yaml").exists());
    convert(&["cv.yml", "l.yaml,r.yaml", "--unit", "m", "--rectify"]).done();
    convert(&["cv.yml", "other.yaml", "--unit", "m"]).failed(1, &["other.yaml", "--force"]);
    convert(&["cv.yml", "other.yaml", "--unit", "m", "--force"]).done();
}

#[test]
fn help_lists_the_formats() {
    let text = Fixture::new()
        .svl(&["calibrate", "convert", "--help"])
        .done();
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
    let python = std::env::var("SVL_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let asked = Command::new(&python)
        .args(["-c", "import cv2, numpy"])
        .output();
    if !asked.is_ok_and(|output| output.status.success()) {
        println!(
            "skipped: `{python}` has no cv2 or numpy; set SVL_PYTHON to a Python with \
             opencv-python-headless"
        );
        return;
    }
    let fixture = Fixture::new();
    let theirs = datasets
        .join("calibration-chessboard/reference_opencv.yml")
        .display()
        .to_string();
    fixture
        .svl(&[
            "calibrate",
            "convert",
            &theirs,
            "ours.yml",
            "--unit",
            "squares",
        ])
        .done();
    let script = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/tests/python/calibration_files.py"
    );
    let files = [
        theirs.into(),
        fixture.path("ours.yml"),
        fixture.path("theirs.xml"),
    ];
    let run = Command::new(&python)
        .arg(script)
        .args(files)
        .output()
        .unwrap();
    assert!(
        run.status.success(),
        "{}",
        String::from_utf8_lossy(&run.stderr)
    );
    // And svl reads the XML that OpenCV wrote of it.
    let text = fixture
        .svl(&[
            "calibrate",
            "convert",
            "theirs.xml",
            "again.yml",
            "--unit",
            "squares",
        ])
        .done();
    assert!(text.contains("baseline 3.328221 squares"), "{text}");
}
