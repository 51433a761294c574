//! `--calib` of `svl record` and `svl replay`, and `svl calibrate check`.

use super::fixture::{Fixture, datasets, pgm};
use super::transcript::assert_words;
use nalgebra::Isometry3;
use svl::calibrate::files;
use svl::recording::{CALIBRATION, Recording};
use svl::source::{RecordingSource, Source};
use svl::stereo::{Frame, Intrinsics, LengthUnit, StereoCalibration};

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
    fixture.transcript(
        "record raw -o raw.mcap
        record raw.mcap --calib rig.yml -o rectified.mcap
        info rectified.mcap => geometry        rectified\\n | calibration     rig.yml\\n",
    );
    let frame = first(&fixture, "rectified.mcap");
    let rig = frame.rig().unwrap();
    assert_eq!((rig.baseline_m(), rig.doffs_px()), (0.1, 0.0));
    // Half of 6 rows is lost at the top and the bottom: the focal length grows accordingly.
    let off = rig.focal_px() - 300.0 * 239.0 / 233.0;
    assert!(off.abs() < 0.1, "{rig:?}");

    let open = |file: &str| Recording::open(fixture.path(file)).unwrap();
    let header = open("rectified.mcap").header().unwrap();
    assert_eq!(header.calibration.as_deref(), Some("rig.yml"));
    let attached = |file: &str| {
        let name = format!("{CALIBRATION}rig.yml");
        open(file).attachment(&name).unwrap().unwrap()
    };
    assert_eq!(attached("rectified.mcap"), fixture.bytes("rig.yml"));

    let rows = |args: &str, warnings: &str| {
        let ran = fixture.svl(&format!(
            "replay {args} --algo v3 --algo bm --rows rows.csv --force"
        ));
        match warnings {
            "" => assert_eq!(ran.stderr, ""),
            words => assert_words(&ran.stderr, words),
        }
        ran.done();
        ["pair_hash", "result_hash"].map(|name| fixture.column("rows.csv", name))
    };
    let recorded = rows("rectified.mcap -o result.mcap", "");
    let travelled = attached("result.mcap");
    assert_eq!(
        travelled,
        attached("rectified.mcap"),
        "the calibration travels on"
    );
    let replayed = rows("raw.mcap --calib rig.yml", "");
    assert_eq!((recorded[0].len(), &recorded), (6, &replayed));
    let raw = rows("raw.mcap", "vertical misalignment of 6.0 px | --calib");
    assert_ne!(raw, replayed);
}

/// The first pair of a recording.
fn first(fixture: &Fixture, name: &str) -> Frame {
    let mut source = RecordingSource::open(fixture.path(name)).unwrap();
    source.next().unwrap().unwrap()
}

#[test]
fn the_row_offset_is_measured() {
    let fixture = Fixture::new();
    raw_pairs(&fixture, 2);
    let flat = pgm(SIZE.0, SIZE.1, &[90; SIZE.0 * SIZE.1]);
    fixture.write("flat/left/1.pgm", &flat);
    fixture.write("flat/right/1.pgm", &flat);
    fixture.transcript(
        "calibrate check raw => right is lower  6.00 px | shift \
        => 1~ ^error: raw: vertical misalignment of 6.0 px
        calibrate check raw --calib rig.yml --json => /median_abs_px < 0.1 | /pairs = 2 \
        | /parts_px/# = 3
        calibrate check flat => 1: too few points | (0)",
    );
}

#[test]
fn images_that_cannot_be_rectified_are_refused_with_the_cure() {
    let fixture = Fixture::new();
    raw_pairs(&fixture, 1);
    fixture.write("small/left/1.pgm", pgm(20, 10, &[0; 200]));
    fixture.write("small/right/1.pgm", pgm(20, 10, &[0; 200]));
    fixture.transcript(
        "record raw --calib rig.yml --alpha 0.5 -o once.mcap
        record once.mcap --calib rig.yml -o twice.mcap => 1: once.mcap | omit --calib
        test ! -e twice.mcap
        replay once.mcap --calib no.yml => 1: no.yml | no such file
        record small --calib rig.yml -o a.mcap => 1: 20x10 | 320x240",
    );
}

#[test]
fn bags_of_raw_images_are_rectified_by_what_they_say() {
    let Some(folder) = datasets().map(|folder| folder.join("euroc-v1_01_easy")) else {
        return;
    };
    let fixture = Fixture::new();
    for bag in ["euroc_4frames_ros2.mcap", "euroc_4frames_foxglove_png.mcap"] {
        let bag = folder.join(bag).display().to_string();
        // A raw recording keeps its calibration for rectification, and so does a copy.
        fixture.transcript(&format!(
            "record {bag} --force -o rectified.mcap => 0~ rectified by its own calibration
            calibrate check rectified.mcap --json => /median_abs_px < 0.15
            replay {bag} --calib none => 0~ not rectified | vertical misalignment
            record {bag} --force --calib raw -o raw.mcap
            record raw.mcap --force -o copy.mcap
            info copy.mcap => calibration/left.yaml, | geometry        raw\\n
            record copy.mcap --calib copy.mcap --force -o later.mcap"
        ));
        let [rectified, later] =
            ["rectified", "later"].map(|name| first(&fixture, &format!("{name}.mcap")));
        assert!((rectified.rig().unwrap().baseline_m() - 0.11008).abs() < 1e-4);
        assert!(later.pair == rectified.pair, "to the bit");
        assert_eq!(later.geometry, rectified.geometry);
        fixture.fails(
            "record copy.mcap --calib rectified.mcap --force -o later.mcap \
            => 1: rectified.mcap: keeps no calibration",
        );
    }
}
