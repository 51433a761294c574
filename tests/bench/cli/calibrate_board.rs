//! `svl calibrate board`, from pictures to a calibration.

use super::fixture::Fixture;
use serde_json::Value;
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
        write(
            fixture,
            &format!("pictures/left{:02}.png", i + 1),
            pair.left(),
        );
        write(
            fixture,
            &format!("pictures/right{:02}.png", i + 1),
            pair.right(),
        );
    }
}

fn write(fixture: &Fixture, name: &str, image: &Gray) {
    let path = fixture.path(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    write_png(
        &path,
        image.width(),
        image.height(),
        image.as_slice().unwrap(),
    )
    .unwrap();
}

/// Pairs in the middle of a pose.
fn still(poses: u64) -> impl Iterator<Item = u64> {
    (0..poses).map(|pose| pose * 8 + 1)
}

#[test]
fn a_simulated_board_gives_the_cameras_that_saw_it() {
    let fixture = Fixture::new();
    let args = [
        "calibrate",
        "board",
        "board",
        "--square-m",
        "0.03",
        "--yes",
        "--json",
        "-o",
        "calib.xml",
    ];
    let answer: Value = serde_json::from_str(&fixture.svl(&args).done()).unwrap();
    let truth = MovingBoard::new(1).unwrap();
    let truth = truth.truth();
    let cameras = [("left", truth.left()), ("right", truth.right())];
    let solution = &answer["solution"];
    for (side, camera) in cameras {
        let ((fx, fy), (cx, cy)) = (camera.focal_px(), camera.center_px());
        for (name, truth) in [("fx", fx), ("fy", fy), ("cx", cx), ("cy", cy)] {
            let value = solution[side][name]["value"].as_f64().unwrap();
            assert!(
                (value - truth).abs() < 1.0,
                "{side} {name}: {value}, truth {truth}"
            );
        }
    }
    let baseline = solution["baseline"]["value"].as_f64().unwrap();
    assert!(
        (baseline / truth.baseline() - 1.0).abs() < 0.003,
        "{baseline} m"
    );
    assert!(
        solution["rms_px"].as_f64().unwrap() < 0.1,
        "{}",
        solution["rms_px"]
    );
    for reason in ["moving", "nothing new"] {
        assert!(
            answer["refused"][reason].as_u64().unwrap() > 10,
            "{}",
            answer["refused"]
        );
    }

    let read = files::read(&fixture.path("calib.xml")).unwrap();
    assert!((read.baseline() - baseline).abs() < 1e-6 && read.rig().is_some());
    let accepted = answer["accepted"].as_array().unwrap().len();
    let last = format!("calib-report/right{accepted:02}.png");
    for name in [
        "calib-report/index.html",
        "calib-report/calibration.json",
        "calib-report/left01.png",
        &last,
    ] {
        assert!(fixture.path(name).is_file(), "{name}");
    }

    // Once more, from what was kept.
    let args = [
        "calibrate",
        "board",
        "calib-report",
        "--square-m",
        "0.03",
        "-y",
        "--json",
        "-o",
        "again.yaml",
    ];
    let again: Value = serde_json::from_str(&fixture.svl(&args).done()).unwrap();
    let twice = again["solution"]["baseline"]["value"].as_f64().unwrap();
    assert!((twice - baseline).abs() < 1e-4, "{twice} {baseline}");
}

#[test]
fn a_recording_of_the_board_says_the_same_as_the_board() {
    let fixture = Fixture::new();
    fixture
        .svl(&["record", "board", "--frames", "70", "-o", "board.mcap"])
        .done();
    let text = fixture
        .svl(&[
            "calibrate",
            "board",
            "board.mcap",
            "--yes",
            "-o",
            "calib.yaml",
        ])
        .done();
    for words in [
        "of 70 pairs accepted",
        "moving",
        "worth more pairs",
        "in squares",
        "calib.yaml: calibration",
    ] {
        assert!(text.contains(words), "'{words}' is not in: {text}");
    }
}

#[test]
fn nothing_is_overwritten_unasked() {
    let fixture = Fixture::new();
    write_pictures(&fixture, still(5));
    let run = |output: &str, more: &[&str]| {
        let args = ["calibrate", "board", "pictures", "--yes", "-o", output];
        fixture.svl(&[&args[..], more].concat())
    };
    run("calib.xml", &[]).done();
    run("calib.xml", &[]).failed(1, &["calib.xml: exists already", "--force"]);
    run("calib.yaml", &[]).failed(1, &["calib-report: exists already", "--force"]);
    run("calib.xml", &["--force"]).done();
    fixture.write("calib-report/mine.txt", "mine");
    run("calib.xml", &["--force"]).failed(1, &["mine.txt", "not part of a calibration's report"]);
    run("c.png", &[]).failed(2, &["must end in .xml"]);
    // The pairs that a calibration is made from are not cleared away for it.
    let args = [
        "calibrate",
        "board",
        "calib-report",
        "--yes",
        "--force",
        "-o",
        "calib.xml",
    ];
    std::fs::remove_file(fixture.path("calib-report/mine.txt")).unwrap();
    fixture.svl(&args).failed(2, &["named twice"]);
    assert!(fixture.path("calib-report/left01.png").is_file());
}

#[test]
fn what_cannot_be_calibrated_says_why_and_what_to_do() {
    let fixture = Fixture::new();
    write_pictures(&fixture, still(3));
    let run = |more: &[&str]| {
        let args = ["calibrate", "board", "pictures", "-o", "calib.xml"];
        fixture.svl(&[&args[..], more].concat())
    };
    run(&[]).failed(1, &["needs a terminal", "--yes"]);
    run(&["--yes", "--squares", "8x5"]).failed(
        1,
        &["a board of 9x6 inner corners, not 8x5; try --squares 9x6"],
    );
    run(&["--yes", "--squares", "12x9"]).failed(1, &["not 12x9; try --squares 9x6"]);
    run(&["--yes", "--squares", "9"]).failed(2, &["inner corners along both sides"]);
    run(&["--yes", "--squares", "2x9"]).failed(2, &["3 to 50"]);
    run(&["--yes", "--square-m", "0"]).failed(2, &["--square-m", "0.0001 to 100"]);
    run(&["--yes", "--rate", "5"]).failed(2, &["--rate is for cameras"]);
    assert!(!fixture.path("calib.xml").exists());

    fixture.write_pair("empty/left1.pgm", "empty/right1.pgm", (320, 240), 8);
    let args = ["calibrate", "board", "empty", "--yes", "-o", "calib.xml"];
    let words = [
        "no whole board of 9x6 inner corners",
        "any of 1 pairs",
        "no board left",
        "one less than the squares",
    ];
    fixture.svl(&args).failed(1, &words);
    assert!(!fixture.path("calib-report").exists());

    fixture.write_pair("pictures/left09.pgm", "pictures/right09.pgm", (320, 240), 8);
    run(&["--yes", "--squares", "7x5"])
        .failed(1, &["pair 09 is 320x240 pixels, those before 640x480"]);
}

#[test]
fn too_few_views_are_kept_for_another_time() {
    let fixture = Fixture::new();
    write_pictures(&fixture, [1, 1, 9]);
    let args = ["calibrate", "board", "pictures", "--yes", "-o", "calib.xml"];
    fixture.svl(&args).failed(
        1,
        &[
            "2 of 3 pairs accepted, at least 3 are needed",
            "1 nothing new",
            "calib-report",
        ],
    );
    assert!(
        fixture.path("calib-report/left02.png").is_file() && !fixture.path("calib.xml").exists()
    );
}

#[test]
fn pictures_that_are_rectified_already_are_warned_of() {
    let fixture = Fixture::new();
    let scenario = fixture.write_short_arena("short.toml", 2);
    let args = [
        "calibrate",
        "board",
        scenario.to_str().unwrap(),
        "--yes",
        "-o",
        "calib.xml",
    ];
    let ran = fixture.svl(&args);
    assert_eq!(ran.code, Some(1));
    assert!(
        ran.stderr.contains("rectified already") && ran.stderr.contains("no whole board"),
        "{}",
        ran.stderr
    );
}

#[test]
fn the_viewer_gets_the_pairs_with_their_corners() {
    let fixture = Fixture::new();
    write_pictures(&fixture, still(5));
    let args = [
        "calibrate",
        "board",
        "pictures",
        "--yes",
        "--rerun",
        "board.rrd",
        "-o",
        "calib.xml",
    ];
    fixture.svl(&args).done();
    assert!(fixture.path("board.rrd").metadata().unwrap().len() > 1_000_000);
}

/// Live, until somebody has enough.
#[cfg(unix)]
#[test]
fn cameras_that_see_the_board_are_calibrated() {
    let fixture = Fixture::new();
    let args = [
        "calibrate",
        "board",
        "sim:scene=board",
        "--yes",
        "--rate",
        "10",
        "-o",
        "calib.xml",
    ];
    let enough = || fixture.path("calib-report/right06.png").exists();
    let (code, stderr) = super::interrupt::interrupted(&fixture, &args, enough);
    assert_eq!(code, Some(0), "{stderr}");
    assert!(fixture.path("calib.xml").is_file());
}
