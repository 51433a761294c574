//! `svl info`.

use super::fixture::Fixture;
use crate::recording::bag::{self, ros_image};
use serde_json::{Value, json};

#[test]
fn says_what_a_recording_holds() {
    let fixture = Fixture::new();
    fixture.record("a.mcap", "--frames 4");
    fixture.transcript(
        "info a.mcap => /stereo/left/image | foxglove.RawImage | /truth/depth | arena \
        | geometry        rectified
        info a.mcap --json => /damage = null | /first_pairs/geometry = rectified \
        | /misalignment = []",
    );
}

#[test]
fn says_whether_pairs_are_raw_and_misaligned() {
    let fixture = Fixture::new();
    fixture.record("raw.mcap", "board --frames 1");
    fixture.record_short_arena("a.mcap", 3, 1);
    // Boards of two cameras with distortion are raw. The arena's right image is 0.25 px low, which
    // v4 rounds to no row; v3 measures none.
    let measured = "/first_pairs/vertical_misalignment/median_abs_px";
    fixture.transcript(&format!(
        "info raw.mcap => geometry        raw\\n
        replay a.mcap --algo v4 --algo v3 -o result.mcap
        info result.mcap => by algorithm    v4, min 0 px, median 0 px, max 0 px, pairs 3\\n \
        | \\nmisaligned      0.2
        info result.mcap --json => /misalignment/# = 1 | /misalignment/0/algorithm = v4 \
        | /misalignment/0/pairs = 3 | /misalignment/0/median_px = 0 | /misalignment/0/min_px = 0 \
        | /misalignment/0/max_px = 0 | {measured} > 0.2 | {measured} < 0.3"
    ));
}

#[test]
fn the_first_pairs_answer_the_first_questions() {
    let fixture = Fixture::new();
    fixture.record_short_arena("a.mcap", 3, 1);
    fixture.write_euroc("57.0");
    fixture.write("empty/notes.txt", "");
    // Raw images of pixels that are not square, in a folder.
    fixture.transcript(
        "record a.mcap --ros2 -o ros.mcap
        info ros.mcap => pairs           3\\npaired topics   /stereo/left/image_rect, \
        /stereo/right/image_rect\\n | images          320x240 px\\nfocal length    328.05 px, \
        328.05 px\\nbaseline        0.0440 m\\n \
        | nearest         v5, distance 0.1804 m, max disparity 80 px\\n \
        | truth at start  /truth/depth, cells 45,
        info mav0 --json => /first_pairs/geometry = raw | /first_pairs/truths = [] \
        | /first_pairs/chain = [\"distinct\", \"rectify\", \"check\"] \
        | /first_pairs/focal_px = [60.0, 57.0]
        info mav0 => geometry        raw | focal length    60.00 px, 57.00 px
        info empty => 1: empty",
    );
    let first = |name: &str| fixture.json(&format!("info {name} --json"))["first_pairs"].take();
    let (own, ros) = (first("a.mcap"), first("ros.mcap"));
    let expected = json!(["distinct", "check", "floor"]);
    assert_eq!(
        (&own["chain"], &own["size_px"]),
        (&expected, &json!([320, 240]))
    );
    let rig = |facts: &Value, key: &str| facts["rig"][key].as_f64().unwrap();
    for facts in [&own, &ros] {
        assert!((rig(facts, "baseline_m") - 0.044).abs() < 1e-9);
    }
    let nearest = &own["nearest"];
    let fb = rig(&own, "focal_px") * 0.044;
    let depth = fb / nearest["max_disparity_px"].as_f64().unwrap();
    assert!((nearest["distance_m"].as_f64().unwrap() - depth).abs() < 1e-9);
    assert_eq!(nearest["algorithm"], "v5");
    let range = |unit: &str| {
        let number = |key| own["truths"][0][unit][key].as_f64().unwrap();
        let [min, median, max] = ["min", "median", "max"].map(number);
        assert!(0.0 < min && min < median && median < max, "{own}");
        [min, max]
    };
    // The nearest point has the greatest disparity.
    let ([_, max_px], [min_m, _]) = (range("disparity_px"), range("distance_m"));
    assert!((fb / max_px - min_m).abs() < 1e-6);
    for (facts, is_asked_for) in [(&own, false), (&ros, true)] {
        let truth = json!([{
            "topic": "/truth/depth", "is_asked_for": is_asked_for, "pairs": 3, "scored_pairs": 3,
            "cells": 45, "scored_cells": 45, "impossible_pixels": 0,
            "disparity_px": own["truths"][0]["disparity_px"],
            "distance_m": own["truths"][0]["distance_m"], "error": null
        }]);
        assert_eq!(facts["truths"], truth);
    }
}

#[test]
fn the_first_line_says_if_svl_can_use_it() {
    let fixture = Fixture::new();
    fixture.record_short_arena("own.mcap", 3, 1);
    fixture.record("board.mcap", "board --frames 1");
    fixture.write_euroc("57.0");
    fixture.write_pair("plain/left/1.pgm", "plain/right/1.pgm", (64, 48), 3);
    fixture.transcript(
        "record own.mcap --ros2 -o ros.mcap
        record mav0 --calib none -o raw.mcap
        record plain -o plain.mcap",
    );
    let bytes = fixture.bytes("own.mcap");
    fixture.write("cut.mcap", &bytes[..bytes.len() * 9 / 10]);
    let pixels = [7; 64];
    let cameras = ["/cam0/image", "/cam1/image", "/cam2/image"];
    let images = cameras.map(|topic| ros_image(topic, 1_000_000_000, (8, 8), "mono8", &pixels));
    bag::write(&fixture.path(""), &images);

    let names = "own.mcap ros.mcap board.mcap mav0 raw.mcap plain plain.mcap cut.mcap bag.mcap";
    let first = |name: &str| {
        let text = fixture.run(&format!("info {name}"));
        let lines = text.lines().take_while(|line| !line.starts_with(name));
        let line: Vec<_> = lines.map(str::trim).collect();
        format!("{name}: {}", line.join(" "))
    };
    let lines: Vec<_> = names.split(' ').map(first).collect();
    insta::assert_snapshot!(lines.join("\n"));

    // The user's word that they are rectified.
    fixture.transcript(
        "info raw.mcap --calib none => ^usable:  | rectified pair
        info bag.mcap --left /cam0/image --right /cam1/image --calib none => ^usable:  \
        | rectified pair
        info bag.mcap --json => /usability/is_usable = false \
        | /usability/missing/0 has --left TOPIC",
    );
    let usability = fixture.json("info mav0 --json")["usability"].take();
    let expected = json!({
        "is_usable": true, "pairs": 2, "geometry": "raw", "distortion_model": "plumb_bob",
        "is_calibrated": true, "truths": [], "missing": [], "doubts": []
    });
    assert_eq!(usability, expected);
}

#[test]
#[cfg(unix)]
fn a_pipe_is_no_recording() {
    let fixture = Fixture::new();
    let pipe = fixture.path("pipe.mcap");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status();
    assert!(made.unwrap().success());
    // The pipe has no writer: opening it would wait forever.
    fixture.fails(
        "
        info pipe.mcap => 1: pipe.mcap | pipe or a device | copy it
        replay pipe.mcap => 1: pipe.mcap | pipe or a device | copy it
        record pipe.mcap => 1: pipe.mcap | pipe or a device | copy it
    ",
    );
}

#[test]
fn a_cut_recording_is_called_so() {
    let fixture = Fixture::new();
    fixture.record("a.mcap", "--frames 4");
    let bytes = fixture.bytes("a.mcap");
    fixture.write("cut.mcap", &bytes[..bytes.len() * 9 / 10]);
    fixture.write("empty.mcap", "");
    fixture.transcript(
        "info cut.mcap --json => /damage != null
        info empty.mcap => 1: empty.mcap
        info missing.mcap => 1: missing.mcap",
    );
}

#[test]
fn the_spread_of_the_skew_is_listed() {
    let fixture = Fixture::new();
    let sim = "sim:right.drift_ppm=2000,size=64x48,pictures=2";
    fixture.run(&format!(
        "record {sim} --trigger free --frames 40 --allow-loss 100% -o a.mcap"
    ));
    let text = fixture.run("info a.mcap");
    let bins = text.lines().filter_map(|line| line.split_once("from "));
    let pairs = bins.filter_map(|(_, bin)| bin.split_once("pairs "));
    let pairs: Vec<u64> = pairs.map(|(_, pairs)| pairs.parse().unwrap()).collect();
    assert!((2..=12).contains(&pairs.len()), "{text}");
    assert_eq!(pairs.iter().sum::<u64>(), 40, "{text}");
}

/// The root package reads them at build time; a package below it would have none.
#[test]
fn version_revision_and_profile_are_in_manifest_and_recording() {
    let built = svl::BUILD;
    let profile = built.profile.expect("cargo names the folder of a profile");
    let program = assert_cmd::cargo::cargo_bin!("svl");
    // target/PROFILE/svl; the folder of `dev` is `debug`.
    assert_eq!(program.parent().unwrap().file_name().unwrap(), profile);
    // A package of the source has no revision.
    let in_git = crate::common::repository().join(".git").exists();
    assert_eq!(built.git_revision.is_some(), in_git);
    let fixture = Fixture::new();
    fixture.record("a.mcap", "--frames 2");
    let text = fixture.run("score a.mcap --algo v3 -o report --rerun none");
    let times_are_slow = text.contains("built with the profile");
    assert_eq!(times_are_slow, svl::slow_profile(Some(profile)).is_some());

    let header = svl::recording::Recording::open(fixture.path("a.mcap"))
        .and_then(|recording| recording.header())
        .unwrap();
    let manifest = svl::manifest::Manifest::read(&fixture.path("report")).unwrap();
    let revision = built.git_revision.map(str::to_owned);
    let known = (built.version.to_owned(), revision, Some(profile.to_owned()));
    assert_eq!((header.version, header.git_revision, header.profile), known);
    assert_eq!(
        (manifest.svl, manifest.git_revision, manifest.profile),
        known
    );
}

#[test]
fn the_facts_of_scaled_pairs_are_theirs() {
    let fixture = Fixture::new();
    fixture.record_short_arena("a.mcap", 3, 1);
    let facts = |options: &str| {
        let name = format!("info a.mcap --json{options}");
        fixture.json(&name)["first_pairs"].take()
    };
    let (whole, half) = (facts(""), facts(" --scale 0.5"));
    assert_eq!(half["size_px"], json!([160, 120]));
    assert_eq!(half["rig"]["baseline_m"], whole["rig"]["baseline_m"]);
    let focal_px = |facts: &Value| facts["rig"]["focal_px"].as_f64().unwrap();
    assert_eq!(2.0 * focal_px(&half), focal_px(&whole));
    assert_eq!(half["focal_px"][0], focal_px(&half));
}

#[test]
fn images_of_different_moments_are_not_usable() {
    let fixture = Fixture::new();
    fixture.write_euroc("60.0");
    for (late_ms, is_usable) in [(0, true), (20, true), (30, false), (433, false)] {
        let stamps = [50, 100].map(|ms| (ms + late_ms) * 1_000_000);
        let csv = format!("{},a.pgm\n{},b.pgm\n", stamps[0], stamps[1]);
        fixture.write("mav0/cam1/data.csv", csv);
        let usability = fixture.json("info mav0 --json")["usability"].take();
        assert_eq!(usability["is_usable"], is_usable, "{usability}");
        let words = format!("a median skew of {late_ms}.0 ms is above 25.0 ms");
        let doubts = usability["doubts"].to_string();
        assert_eq!(doubts.contains(&words), !is_usable, "{doubts}");
    }
}
