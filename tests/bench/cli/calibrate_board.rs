//! `svl calibrate board`, from pictures to a calibration.

use super::fixture::Fixture;
use super::transcript::assert_words;
use std::sync::LazyLock;
use svl::calibrate::files;
use svl::calibrate::simulated::MovingBoard;
use svl::files::write_png;
use svl::stereo::Gray;

/// Pairs in which the simulated board is held still, as `pictures/left01.png`, ...
fn write_pictures(fixture: &Fixture, pairs: impl IntoIterator<Item = u64>) {
    static BOARD: LazyLock<MovingBoard> = LazyLock::new(|| MovingBoard::new(1).unwrap());
    for (i, index) in pairs.into_iter().enumerate() {
        let pair = BOARD.pair(index).unwrap();
        for (side, image) in [("left", pair.left()), ("right", pair.right())] {
            write(fixture, &format!("pictures/{side}{:02}.png", i + 1), image);
        }
    }
}

/// The same, of a right camera whose pixels are elsewhere.
fn write_turned(fixture: &Fixture, place: fn((usize, usize)) -> (usize, usize)) {
    write_pictures(fixture, still(12));
    for i in 1..=12 {
        let name = format!("pictures/right{i:02}.png");
        let image = svl::files::read_gray(&fixture.path(&name)).unwrap();
        let turned = |x, y| {
            let (x, y) = place((x, y));
            image.get(x, y)
        };
        let turned = Gray::from_fn(image.width(), image.height(), turned).unwrap();
        write(fixture, &name, &turned);
    }
}

/// Each camera fits the board alone; the cure is not another view of it.
#[test]
fn a_camera_that_is_turned_is_named_with_its_cure() {
    let fixture = Fixture::new();
    write_turned(&fixture, |(x, y)| (639 - x, y));
    fixture.transcript(
        "calibrate board pictures --yes -o calib.xml \
        => 1~ each camera fits the board alone | -vf hflip OUT | !tilted",
    );
    write_turned(&fixture, |(x, y)| (639 - x, 479 - y));
    let ran = fixture.svl("calibrate board pictures --yes -o calib.xml --force");
    assert_words(
        &ran.stderr,
        "upside down | -vf hflip,vflip OUT | !90 degrees",
    );
}

fn write(fixture: &Fixture, name: &str, image: &Gray) {
    let path = fixture.write(name, "");
    let pixels = image.as_slice().unwrap();
    write_png(&path, image.width(), image.height(), pixels).unwrap();
}

/// Pairs in the middle of a pose.
fn still(poses: u64) -> impl Iterator<Item = u64> {
    (0..poses).map(|pose| pose * 8 + 1)
}

#[test]
fn a_simulated_board_gives_the_cameras_that_saw_it() {
    let fixture = Fixture::new();
    let (source, reasons): (_, &[_]) = if crate::common::is_nightly() {
        ("board", &["moving", "nothing new"])
    } else {
        // Half of the poses twice.
        let twice = still(12).flat_map(|pair| [pair; 2]);
        write_pictures(&fixture, twice.chain(still(24).skip(12)));
        ("pictures", &["nothing new"])
    };
    let args = format!("calibrate board {source} --square-m 0.03 --yes --json -o calib.xml");
    let answer = fixture.json(&args);
    let truth = MovingBoard::new(1).unwrap();
    let truth = &truth.truth;
    let solution = &answer["solution"];
    for (side, camera) in [("left", truth.left()), ("right", truth.right())] {
        let ((fx, fy), (cx, cy)) = (camera.focal_px(), camera.center_px());
        for (name, truth) in [("fx", fx), ("fy", fy), ("cx", cx), ("cy", cy)] {
            let value = solution[side][name]["value"].as_f64().unwrap();
            let off = (value - truth).abs();
            assert!(off < 1.0, "{side} {name}: {value}, truth {truth}");
        }
    }
    let baseline = solution["baseline"]["value"].as_f64().unwrap();
    let off = baseline / truth.baseline() - 1.0;
    assert!(off.abs() < 0.003, "{baseline} m");
    assert!(solution["rms_px"].as_f64().unwrap() < 0.1, "{solution}");
    for reason in reasons {
        let refused = &answer["refused"];
        assert!(refused[*reason].as_u64() > Some(10), "{refused}");
    }

    let read = files::read(&fixture.path("calib.xml")).unwrap();
    assert!((read.baseline() - baseline).abs() < 1e-6 && read.rig().is_some());
    let accepted = answer["accepted"].as_array().unwrap().len();
    fixture.transcript(&format!(
        "test -e calib-report/index.html
        test -e calib-report/calibration.json
        test -e calib-report/left01.png
        test -e calib-report/right{accepted:02}.png"
    ));
    // Again, from the pairs kept.
    let args = "calibrate board calib-report --square-m 0.03 -y --json -o again.yaml";
    let again = fixture.json(args);
    let twice = again["solution"]["baseline"]["value"].as_f64().unwrap();
    assert!((twice - baseline).abs() < 1e-4, "{twice} {baseline}");
}

#[test]
fn a_recording_of_the_board_says_the_same_as_the_board() {
    Fixture::new().transcript(
        "record board --frames 46 -o board.mcap
        calibrate board board.mcap --yes -o calib.yaml => of 46 pairs accepted | moving \
        | worth more pairs | in squares | calib.yaml: calibration",
    );
}

#[test]
fn nothing_is_overwritten_unasked() {
    let fixture = Fixture::new();
    write_pictures(&fixture, still(5));
    let run = "calibrate board pictures --yes -o calib.xml";
    fixture.transcript(&format!(
        "{run}
        {run} => 1: calib.xml: exists already | --force
        calibrate board pictures --yes -o calib.yaml => 1: calib-report: exists already | --force
        {run} --force"
    ));
    // The pairs that a calibration reads are not deleted by it.
    fixture.write("calib-report/mine.txt", "mine");
    fixture.transcript(&format!(
        "{run} --force => 1: mine.txt | not part of a calibration's report
        calibrate board pictures --yes -o c.png => 2: must end in .xml
        rm calib-report/mine.txt
        calibrate board calib-report --yes --force -o calib.xml => 2: named twice
        test -e calib-report/left01.png"
    ));
}

#[test]
fn calibrations_that_fail_are_reported_with_cause_and_cure() {
    let fixture = Fixture::new();
    write_pictures(&fixture, still(3));
    fixture.write_pair("empty/left1.pgm", "empty/right1.pgm", (320, 240), 8);
    fixture.transcript(
        "
        calibrate board pictures -o calib.xml => 1: needs a terminal | --yes
        calibrate board pictures -o calib.xml --yes --squares 8x5 => \
            1: a board of 9x6 inner corners, not 8x5; try --squares 9x6
        calibrate board pictures -o calib.xml --yes --squares 12x9 => 1: not 12x9; try --squares 9x6
        calibrate board pictures -o calib.xml --yes --squares 9 => 2: inner corners along both sides
        calibrate board pictures -o calib.xml --yes --squares 2x9 => 2: 3 to 50
        calibrate board pictures -o calib.xml --yes --square-m 0 => 2: --square-m | 0.0001 to 100
        calibrate board pictures -o calib.xml --yes --rate 5 => 2: --rate is for cameras
        test ! -e calib.xml
        calibrate board empty --yes -o calib.xml => 1: no complete board of 9x6 inner corners \
            | any of 1 pairs | no board left | one less than the squares
        test ! -e calib-report
        ",
    );
    fixture.write_pair("pictures/left09.pgm", "pictures/right09.pgm", (320, 240), 8);
    fixture.transcript(
        "calibrate board pictures -o calib.xml --yes --squares 7x5 => 1~ pair 09 is 320x240 \
        pixels, those before 640x480 | a camera's are all of one size",
    );
}

#[test]
fn too_few_views_are_kept_for_another_time() {
    let fixture = Fixture::new();
    write_pictures(&fixture, [1, 1, 9]);
    fixture.transcript(
        "
        calibrate board pictures --yes -o calib.xml => \
            1: 2 of 3 pairs accepted, at least 3 are needed | 1 nothing new | calib-report
        test -e calib-report/left02.png
        test ! -e calib.xml
        ",
    );
}

#[test]
fn pictures_that_are_rectified_already_are_warned_of() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 2);
    fixture.transcript(
        "calibrate board short.toml --yes -o calib.xml \
        => 1~ rectified already | no complete board",
    );
}

#[test]
fn the_viewer_gets_the_pairs_with_their_corners() {
    let fixture = Fixture::new();
    write_pictures(&fixture, still(5));
    fixture.run("calibrate board pictures --yes --rerun board.rrd -o calib.xml");
    assert!(fixture.path("board.rrd").metadata().unwrap().len() > 1_000_000);
}

/// Live, until the user has enough.
#[cfg(unix)]
#[test]
fn cameras_that_see_the_board_are_calibrated() {
    let fixture = Fixture::new();
    let args = "calibrate board sim:scene=board --yes --rate 10 -o calib.xml";
    let enough = || fixture.path("calib-report/right04.png").exists();
    let (code, stderr) = super::interrupt::interrupted(&fixture, args, enough);
    assert_eq!(code, Some(0), "{stderr}");
    assert!(fixture.path("calib.xml").is_file());
}
