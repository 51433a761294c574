//! `--reference` and `--truth`: the caution next to numbers that are not from exact truth.

use super::fixture::{Fixture, assert_says};
use serde_json::{Value, json};
use std::fs;

const CAUTION: &str = "against sgm, not truth";

#[test]
fn numbers_against_a_reference_say_so_everywhere() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 4);
    let exact = fixture.run("score short.toml --algo v3 -o exact");
    assert!(!exact.contains("against"), "{exact}");
    let ran = fixture.svl("score short.toml --algo v3 -o other --reference sgm");
    assert_says(&ran.stderr, &["scored against sgm, not its own truth"]);
    let text = ran.done();
    assert_eq!(text.matches(CAUTION).count(), 1, "{text}");
    for file in ["summary.md", "index.html"] {
        let report = fs::read_to_string(fixture.path("other").join(file)).unwrap();
        assert!(report.contains(CAUTION), "{file}");
    }
    for file in ["manifest.json", "summary.json"] {
        let text = fs::read_to_string(fixture.path("other").join(file)).unwrap();
        let value: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(value["truth"], json!(["reference sgm"]), "{file}");
    }
    let compared = fixture.run("compare exact other");
    assert_says(
        &compared,
        &[
            &format!("after  other: {CAUTION}"),
            "not comparable: scored differently (truth or calibration of 8 pairs)",
        ],
    );
    assert!(
        !compared.contains("WORSE") && !compared.contains("better\n"),
        "{compared}"
    );
}

#[test]
fn a_replay_has_references_too_and_warns_of_itself() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 3);
    fixture.run("record short.toml -o run.mcap");
    let replay = "replay run.mcap --reference sgm";
    let ran = fixture.svl(&format!("{replay} --algo bm --rows rows.csv"));
    assert!(!ran.stderr.contains("itself"), "{}", ran.stderr);
    assert_says(&ran.done(), &[CAUTION]);
    let rows = fs::read_to_string(fixture.path("rows.csv")).unwrap();
    let lines: Vec<_> = rows.lines().collect();
    assert!(lines[0].contains(",truth,") && lines.len() == 4);
    let mut frames = lines[1..].iter();
    assert!(
        frames.all(|line| line.contains(",reference sgm,")),
        "{rows}"
    );
    let ran = fixture.svl(&format!("{replay} --algo sgm:p1=10"));
    assert_says(&ran.stderr, &["sgm:p1=10: is scored against itself"]);
    // The recording's own truth, as a topic: the same numbers, except for the stated origin.
    let table = |more: &str| {
        let json = fixture.json(&format!("replay run.mcap --json {more}"));
        let cells = ["cells_right", "cells_wrong", "cells_unknown"];
        let cells = cells.map(|column| json["algorithms"][0][column].clone());
        (cells, json["truth"].clone())
    };
    let (exact, topic) = (table(""), table("--truth /truth/depth"));
    assert_eq!(exact.0, topic.0);
    assert_eq!(exact.1, json!(["exact"]));
    assert_eq!(topic.1, json!(["sensor /truth/depth"]));
}

#[test]
fn a_source_without_topics_has_no_truth_of_a_sensor() {
    let fixture = Fixture::new();
    fixture.fails("record arena --truth /points -o a.mcap => 2: --truth is for a recording");
}

#[test]
fn a_scenario_and_an_option_name_the_same_truth_and_the_gate_says_so() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 3);
    fixture.run("record short.toml -o run.mcap");
    fixture.run("record run.mcap --ros2 -o bag.mcap");
    fixture.write(
        "own.toml",
        "name = \"own\"\n[source]\nkind = \"recording\"\nfiles = [\"bag.mcap\"]\n\
         truth = \"/truth/depth\"\ntruth_skew_ms = 1\n\
         [[gate]]\nalgorithm = \"v5\"\nmetric = \"wrong\"\nmax = 0.9\n",
    );
    let right = |json: Value| json["algorithms"][0]["cells_right"].clone();
    let option = right(fixture.json("score bag.mcap --truth /truth/depth --json"));
    assert_eq!(option, right(fixture.json("score own.toml --json")));
    assert!(option.as_u64() > Some(0), "{option}");
    let gate = fixture.run("score own.toml --gate");
    assert_says(
        &gate,
        &["at most 90.0 %, against the sensor /truth/depth (line"],
    );
}

#[test]
fn without_a_calibration_cells_are_judged_in_pixels() {
    let fixture = Fixture::new();
    fixture.write_pair("scene/im0.pgm", "scene/im1.pgm", (64, 48), 4);
    let truth = svl::stereo::Plane::filled(64, 48, 4.0).unwrap();
    svl::files::write_pfm(&fixture.path("scene/disp0.pfm"), &truth).unwrap();
    let table = fixture.run("score scene --algo bm:max_disparity=16 --columns right --explain");
    assert_says(&table, &["right", "within 2 px"]);
}
