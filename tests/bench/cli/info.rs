//! `svl info`.

use super::fixture::{Fixture, assert_says};
use crate::recording::bag::{self, ros_image};

#[test]
fn says_what_a_recording_holds() {
    let fixture = Fixture::new();
    fixture.run("record --frames 4 -o a.mcap");
    let text = fixture.run("info a.mcap");
    assert_says(
        &text,
        &[
            "/stereo/left/image",
            "foxglove.RawImage",
            "/truth/depth",
            "arena",
            "geometry        rectified",
        ],
    );
    let json = fixture.json("info a.mcap --json");
    assert!(json["damage"].is_null());
    assert_eq!(json["first_pairs"]["geometry"], "rectified");
    assert_eq!(json["misalignment"], serde_json::json!([]));
}

#[test]
fn says_whether_pairs_are_raw_and_misaligned() {
    let fixture = Fixture::new();
    // Boards of two cameras with distortion are raw.
    fixture.run("record board --frames 1 -o raw.mcap");
    assert_says(&fixture.run("info raw.mcap"), &["geometry        raw\n"]);

    // The arena's right image is 0.25 px low, which v4 rounds to no row; v3 measures none.
    fixture.write_short_arena("arena.toml", 3);
    fixture.run("record arena.toml -o a.mcap");
    fixture.run("replay a.mcap --algo v4 --algo v3 -o result.mcap");
    let text = fixture.run("info result.mcap");
    assert_says(
        &text,
        &[
            "by algorithm    v4, min 0 px, median 0 px, max 0 px, pairs 3\n",
            "\nmisaligned      0.2",
        ],
    );
    let json = fixture.json("info result.mcap --json");
    let v4 = serde_json::json!([
        { "algorithm": "v4", "pairs": 3, "median_px": 0, "min_px": 0, "max_px": 0 }
    ]);
    assert_eq!(json["misalignment"], v4);
    let measured = json["first_pairs"]["vertical_misalignment"]["median_abs_px"].as_f64();
    assert!((measured.unwrap() - 0.25).abs() < 0.05, "{measured:?}");
}

#[test]
fn the_first_pairs_answer_the_first_questions() {
    let fixture = Fixture::new();
    fixture.write_short_arena("arena.toml", 3);
    fixture.run("record arena.toml -o a.mcap");
    fixture.run("record a.mcap --ros2 -o ros.mcap");
    let first = |name: &str| fixture.json(&format!("info {name} --json"))["first_pairs"].take();
    let own = first("a.mcap");
    assert_eq!(
        own["chain"],
        serde_json::json!(["distinct", "check", "floor"])
    );
    assert_eq!(own["size_px"], serde_json::json!([320, 240]));
    let rig = |facts: &serde_json::Value, key: &str| facts["rig"][key].as_f64().unwrap();
    assert!((rig(&own, "baseline_m") - 0.044).abs() < 1e-9);
    let nearest = &own["nearest"];
    let depth = rig(&own, "focal_px") * 0.044 / nearest["max_disparity_px"].as_f64().unwrap();
    assert!((nearest["distance_m"].as_f64().unwrap() - depth).abs() < 1e-9);
    assert_eq!(nearest["algorithm"], "v5");
    let truth = |topic: &str, is_asked_for: bool| {
        serde_json::json!([{
            "topic": topic, "is_asked_for": is_asked_for, "pairs": 3, "scored_pairs": 3,
            "cells": 45, "scored_cells": 45, "impossible_pixels": 0,
            "disparity_px": own["truths"][0]["disparity_px"],
            "distance_m": own["truths"][0]["distance_m"], "error": null
        }])
    };
    let truth_number = |unit: &str, key: &str| own["truths"][0][unit][key].as_f64().unwrap();
    for unit in ["disparity_px", "distance_m"] {
        let [min, median, max] = ["min", "median", "max"].map(|key| truth_number(unit, key));
        assert!(
            0.0 < min && min < median && median < max,
            "{unit}: {min} {median} {max}"
        );
    }
    // The nearest point has the greatest disparity.
    let fb = rig(&own, "focal_px") * 0.044;
    assert!(
        (fb / truth_number("disparity_px", "max") - truth_number("distance_m", "min")).abs() < 1e-6
    );
    assert_eq!(own["truths"], truth("/truth/depth", false));
    let ros = first("ros.mcap");
    assert_eq!(ros["truths"], truth("/truth/depth", true));
    assert!((rig(&ros, "baseline_m") - 0.044).abs() < 1e-9);
    let lines = [
        "pairs           3\npaired topics   /stereo/left/image_rect, /stereo/right/image_rect\n",
        "images          320x240 px\nfocal length    328.05 px, 328.05 px\n\
         baseline        0.0440 m\n",
        "nearest         v5, distance 0.1804 m, max disparity 80 px\n",
        "truth           /truth/depth, cells 45, ",
    ];
    assert_says(&fixture.run("info ros.mcap"), &lines);

    // Raw images of pixels that are not square, in a folder.
    fixture.write_euroc("57.0");
    let facts = first("mav0");
    assert_eq!(facts["geometry"], "raw");
    assert_eq!(
        facts["chain"],
        serde_json::json!(["distinct", "rectify", "check"])
    );
    assert_eq!(facts["focal_px"], serde_json::json!([60.0, 57.0]));
    assert_eq!(facts["truths"], serde_json::json!([]));
    let lines = ["geometry        raw", "focal length    60.00 px, 57.00 px"];
    assert_says(&fixture.run("info mav0"), &lines);
    fixture.write("empty/notes.txt", "");
    fixture.fails("info empty => 1: empty");
}

#[test]
fn the_first_line_says_if_svl_can_use_it() {
    let fixture = Fixture::new();
    fixture.write_short_arena("arena.toml", 3);
    fixture.run("record arena.toml -o own.mcap");
    fixture.run("record own.mcap --ros2 -o ros.mcap");
    fixture.run("record board --frames 1 -o board.mcap");
    fixture.write_euroc("57.0");
    fixture.run("record mav0 --calib none -o raw.mcap");
    fixture.write_pair("plain/left/1.pgm", "plain/right/1.pgm", (64, 48), 3);
    fixture.run("record plain -o plain.mcap");
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
    for name in [
        "raw.mcap",
        "bag.mcap --left /cam0/image --right /cam1/image",
    ] {
        let text = fixture.svl(&format!("info {name} --calib none")).stdout;
        assert!(
            text.starts_with("usable: ") && text.contains("rectified pair"),
            "{text}"
        );
    }
    let usability = fixture.json("info mav0 --json")["usability"].take();
    let expected = serde_json::json!({
        "is_usable": true, "pairs": 2, "geometry": "raw", "distortion_model": "plumb_bob",
        "is_calibrated": true, "truths": [], "missing": [], "doubts": []
    });
    assert_eq!(usability, expected);
    let usability = fixture.json("info bag.mcap --json")["usability"].take();
    assert_eq!(usability["is_usable"], false);
    assert!(
        usability["missing"][0]
            .as_str()
            .unwrap()
            .contains("--left TOPIC")
    );
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
    fixture.run("record --frames 4 -o a.mcap");
    let bytes = fixture.bytes("a.mcap");
    fixture.write("cut.mcap", &bytes[..bytes.len() * 9 / 10]);
    let json = fixture.json("info cut.mcap --json");
    assert!(json["damage"].is_string());
    fixture.write("empty.mcap", "");
    let wrong = "
        info empty.mcap => 1: empty.mcap
        info missing.mcap => 1: missing.mcap
    ";
    fixture.fails(wrong);
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
    fixture.run("record --frames 2 -o a.mcap");
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
    fixture.write_short_arena("arena.toml", 3);
    fixture.run("record arena.toml -o a.mcap");
    let facts = |options: &str| {
        let name = format!("info a.mcap --json{options}");
        fixture.json(&name)["first_pairs"].take()
    };
    let (whole, half) = (facts(""), facts(" --scale 0.5"));
    assert_eq!(half["size_px"], serde_json::json!([160, 120]));
    assert_eq!(half["rig"]["baseline_m"], whole["rig"]["baseline_m"]);
    let focal_px = |facts: &serde_json::Value| facts["rig"]["focal_px"].as_f64().unwrap();
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
