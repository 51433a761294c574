//! `--calib` of `svl record` and `svl replay`, and `svl calibrate check`.

use super::fixture::{Fixture, assert_says, datasets, pgm};
use nalgebra::Isometry3;
use svl::calibrate::files;
use svl::recording::{CALIBRATION, Recording};
use svl::source::{RecordingSource, Source};
use svl::stereo::{Intrinsics, LengthUnit, StereoCalibration};

const SIZE: (usize, usize) = (320, 240);
/// Vertical misalignment: the right camera points higher, and sees things this much lower.
const LOWER: f64 = 6.0;

/// A folder `raw` of pairs of a wall at disparity 12, and its calibration in `rig.yml`.
fn raw_pairs(fixture: &Fixture, pairs: usize) {
    let wall = |x: f64, y: f64| {
        let wave = |a: f64, b: f64, c: f64| (a * x + b * y + c).sin();
        let fine = 30.0 * wave(0.61, 0.13, 0.3) * wave(-0.11, 0.57, 1.7);
        128.0
            + 50.0 * wave(0.31, 0.07, 0.0) * wave(-0.05, 0.27, 1.0)
            + 40.0 * wave(0.171, -0.133, 3.0)
            + fine
    };
    let image = |dx: f64, dy: f64| {
        let pixels = (0..SIZE.0 * SIZE.1)
            .map(|i| wall((i % SIZE.0) as f64 + dx, (i / SIZE.0) as f64 + dy) as u8);
        pgm(SIZE.0, SIZE.1, &pixels.collect::<Vec<_>>())
    };
    for i in 0..pairs {
        let moved = 5.0 * i as f64;
        fixture.write(&format!("raw/left/{i}.pgm"), image(moved, 0.0));
        fixture.write(&format!("raw/right/{i}.pgm"), image(moved + 12.0, -LOWER));
    }
    let camera = |cy| Intrinsics::new(SIZE, (300.0, 300.0), (159.5, cy), [0.0; 5]).unwrap();
    let apart = Isometry3::translation(-0.1, 0.0, 0.0);
    let rig = StereoCalibration::new(
        camera(119.5),
        camera(119.5 + LOWER),
        apart,
        LengthUnit::Metres,
    )
    .unwrap();
    files::write(&fixture.path("rig.yml"), &rig).unwrap();
}

#[test]
fn raw_pairs_are_rectified_when_recorded_and_when_replayed() {
    let fixture = Fixture::new();
    raw_pairs(&fixture, 3);
    fixture.run("record raw -o raw.mcap");
    fixture.run("record raw.mcap --calib rig.yml -o rectified.mcap");
    let frame = RecordingSource::open(fixture.path("rectified.mcap"))
        .unwrap()
        .next()
        .unwrap()
        .unwrap();
    let rig = frame.rig().unwrap();
    assert_eq!((rig.baseline_m(), rig.doffs_px()), (0.1, 0.0));
    // Half of 6 rows is lost at the top and the bottom: the focal length grows accordingly.
    assert!(
        (rig.focal_px() - 300.0 * 239.0 / 233.0).abs() < 0.1,
        "{rig:?}"
    );

    let open = |file: &str| Recording::open(fixture.path(file)).unwrap();
    let header = open("rectified.mcap").header().unwrap();
    assert_eq!(header.calibration.as_deref(), Some("rig.yml"));
    let attached = |file: &str| {
        let name = format!("{CALIBRATION}rig.yml");
        open(file).attachment(&name).unwrap().unwrap()
    };
    assert_eq!(attached("rectified.mcap"), fixture.bytes("rig.yml"));
    let info = fixture.run("info rectified.mcap");
    assert_says(
        &info,
        &["geometry        rectified\n", "calibration     rig.yml\n"],
    );

    let rows = |args: &[&str], rows: &str| {
        let common = ["--algo", "v3", "--algo", "bm", "--rows", rows];
        let ran = fixture.svl(&[&["replay"], args, &common].concat());
        let warned = ran.stderr.clone();
        ran.done();
        let table = fixture.text(rows);
        let hashes = |name: &str| {
            let at = table
                .lines()
                .next()
                .unwrap()
                .split(',')
                .position(|column| column == name)
                .unwrap();
            table
                .lines()
                .skip(1)
                .map(|row| row.split(',').nth(at).unwrap().to_owned())
                .collect::<Vec<_>>()
        };
        ((hashes("pair_hash"), hashes("result_hash")), warned)
    };
    let (recorded, warned) = rows(&["rectified.mcap", "-o", "result.mcap"], "recorded.csv");
    assert_eq!(warned, "");
    assert_eq!(
        attached("result.mcap"),
        attached("rectified.mcap"),
        "the calibration travels on"
    );
    let (replayed, warned) = rows(&["raw.mcap", "--calib", "rig.yml"], "replayed.csv");
    assert_eq!(warned, "");
    assert_eq!((recorded.0.len(), &recorded), (6, &replayed));
    let (raw, warned) = rows(&["raw.mcap"], "raw.csv");
    assert_ne!(raw, replayed);
    assert_says(&warned, &["vertical misalignment of 6.0 px", "--calib"]);
}

#[test]
fn the_row_offset_is_measured() {
    let fixture = Fixture::new();
    raw_pairs(&fixture, 2);
    let ran = fixture.svl("calibrate check raw");
    assert_eq!(ran.code, Some(1));
    assert_says(&ran.stdout, &["right is lower  6.00 px", "shift"]);
    assert!(
        ran.stderr
            .starts_with("error: raw: vertical misalignment of 6.0 px"),
        "{}",
        ran.stderr
    );
    let good = fixture.json("calibrate check raw --calib rig.yml --json");
    assert!(
        good["median_abs_px"].as_f64().unwrap() < 0.1 && good["pairs"] == 2,
        "{good}"
    );
    assert_eq!(good["parts_px"].as_array().unwrap().len(), 3);
    let flat = pgm(SIZE.0, SIZE.1, &[90; SIZE.0 * SIZE.1]);
    fixture.write("flat/left/1.pgm", &flat);
    fixture.write("flat/right/1.pgm", &flat);
    fixture.fails("calibrate check flat => 1: too few points | (0)");
}

#[test]
fn images_that_cannot_be_rectified_are_refused_with_the_cure() {
    let fixture = Fixture::new();
    raw_pairs(&fixture, 1);
    fixture.run("record raw --calib rig.yml --alpha 0.5 -o once.mcap");
    let twice = fixture.svl("record once.mcap --calib rig.yml -o twice.mcap");
    twice.failed(1, &["once.mcap", "omit --calib"]);
    assert!(!fixture.path("twice.mcap").exists());
    fixture.fails("replay once.mcap --calib no.yml => 1: no.yml | no such file");
    fixture.write("small/left/1.pgm", pgm(20, 10, &[0; 200]));
    fixture.write("small/right/1.pgm", pgm(20, 10, &[0; 200]));
    let small = fixture.svl("record small --calib rig.yml -o a.mcap");
    small.failed(1, &["20x10", "320x240"]);
}

#[test]
fn bags_of_raw_images_are_rectified_by_what_they_say() {
    let Some(folder) = datasets().map(|folder| folder.join("euroc-v1_01_easy")) else {
        return;
    };
    let fixture = Fixture::new();
    for bag in ["euroc_4frames_ros2.mcap", "euroc_4frames_foxglove_png.mcap"] {
        let bag = folder.join(bag).display().to_string();
        let ran = fixture.svl(&["record", &bag, "--force", "-o", "rectified.mcap"]);
        assert_says(&ran.stderr, &["rectified by its own calibration"]);
        ran.done();
        let good = fixture.json("calibrate check rectified.mcap --json");
        assert!(good["median_abs_px"].as_f64().unwrap() < 0.15, "{good}");
        let frame = RecordingSource::open(fixture.path("rectified.mcap"))
            .unwrap()
            .next()
            .unwrap()
            .unwrap();
        assert!((frame.rig().unwrap().baseline_m() - 0.11008).abs() < 1e-4);
        let raw = fixture.svl(&["replay", &bag, "--calib", "none"]);
        assert_says(&raw.stderr, &["not rectified", "vertical misalignment"]);
        raw.done();

        // A raw recording keeps its calibration for rectification, and so does a copy.
        fixture.run(&[
            "record", &bag, "--force", "--calib", "raw", "-o", "raw.mcap",
        ]);
        fixture.run("record raw.mcap --force -o copy.mcap");
        let info = fixture.run("info copy.mcap");
        assert!(
            info.contains("calibration/left.yaml,") && info.contains("geometry        raw\n"),
            "{info}"
        );
        let by_itself = "record copy.mcap --calib copy.mcap --force -o later.mcap";
        fixture.run(by_itself);
        let pair = |name: &str| {
            RecordingSource::open(fixture.path(name))
                .unwrap()
                .next()
                .unwrap()
                .unwrap()
        };
        assert!(
            pair("later.mcap").pair == pair("rectified.mcap").pair,
            "to the bit"
        );
        assert_eq!(pair("later.mcap").geometry, pair("rectified.mcap").geometry);
        let without = fixture.svl("record copy.mcap --calib rectified.mcap --force -o later.mcap");
        without.failed(1, &["rectified.mcap: keeps no calibration"]);
    }
}
