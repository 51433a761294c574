//! `--reference` and `--truth`: what stands beside numbers that are not of exact truth.

use super::fixture::Fixture;
use std::fs;

const CAUTION: &str = "against sgm, not truth";

#[test]
fn numbers_against_a_reference_say_so_everywhere() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 4);
    let score = |out: &str, more: &[&str]| {
        let args = ["score", "short.toml", "--algo", "v3", "--out", out];
        fixture.svl(&[&args, more].concat())
    };
    let exact = score("exact", &[]).done();
    assert!(!exact.contains("against"), "{exact}");
    let ran = score("other", &["--reference", "sgm"]);
    assert!(
        ran.stderr.contains("judged against sgm, not its own truth"),
        "{}",
        ran.stderr
    );
    let text = ran.done();
    let tables = text.matches(CAUTION).count();
    assert!(tables >= 2, "above the cells and the checkpoints:\n{text}");
    for file in ["summary.md", "index.html"] {
        let report = fs::read_to_string(fixture.path("other").join(file)).unwrap();
        assert!(report.matches(CAUTION).count() >= 2, "{file}");
    }
    for file in ["manifest.json", "summary.json"] {
        let text = fs::read_to_string(fixture.path("other").join(file)).unwrap();
        let json: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(
            json["truth"],
            serde_json::json!(["reference sgm"]),
            "{file}"
        );
    }
    let compared = fixture.svl(&["compare", "exact", "other"]).done();
    assert!(
        compared.contains(&format!("other  other: {CAUTION}")),
        "{compared}"
    );
    assert!(compared.contains("The truths differ"), "{compared}");
    assert!(
        !compared.contains("WORSE") && !compared.contains("better\n"),
        "{compared}"
    );
}

#[test]
fn a_replay_has_references_too_and_warns_of_itself() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 3);
    fixture
        .svl(&["record", "short.toml", "-o", "run.mcap"])
        .done();
    let args = [
        "replay",
        "run.mcap",
        "--reference",
        "sgm",
        "--rows",
        "rows.csv",
    ];
    let ran = fixture.svl(&[&args[..], &["--algo", "bm"]].concat());
    assert!(!ran.stderr.contains("itself"), "{}", ran.stderr);
    assert!(ran.done().contains(CAUTION));
    let rows = fs::read_to_string(fixture.path("rows.csv")).unwrap();
    let lines: Vec<_> = rows.lines().collect();
    assert!(lines[0].ends_with(",truth") && lines.len() == 4);
    assert!(
        lines[1..]
            .iter()
            .all(|line| line.ends_with(",reference sgm")),
        "{rows}"
    );
    let ran = fixture.svl(&[
        "replay",
        "run.mcap",
        "--reference",
        "sgm",
        "--algo",
        "sgm:p1=10",
    ]);
    assert!(
        ran.stderr.contains("sgm:p1=10: is judged against itself"),
        "{}",
        ran.stderr
    );
    // Its own truth, of a topic: the same numbers, but for where they are said to be from.
    let table = |args: &[&str]| {
        let ran = fixture
            .svl(&[&["replay", "run.mcap", "--json"], args].concat())
            .done();
        let json: serde_json::Value = serde_json::from_str(&ran).unwrap();
        let cells = ["cells_right", "cells_wrong", "cells_unknown"];
        (
            cells.map(|c| json["algorithms"][0][c].clone()),
            json["truth"].clone(),
        )
    };
    let (exact, topic) = (table(&[]), table(&["--truth", "/truth/depth"]));
    assert_eq!(exact.0, topic.0);
    assert_eq!(exact.1, serde_json::json!(["exact"]));
    assert_eq!(topic.1, serde_json::json!(["sensor /truth/depth"]));
}

#[test]
fn a_source_without_topics_has_no_truth_of_a_sensor() {
    let fixture = Fixture::new();
    let refused = fixture.svl(&["record", "arena", "--truth", "/points", "-o", "a.mcap"]);
    refused.failed(2, &["--truth is for a recording"]);
    fixture.write_short_arena("short.toml", 2);
    fixture
        .svl(&["record", "short.toml", "-o", "run.mcap"])
        .done();
    let refused = fixture.svl(&["replay", "run.mcap", "--truth", "/points"]);
    refused.failed(
        1,
        &[
            "--truth /points: no such topic",
            "/truth/depth (sensor_msgs/msg/Image)",
        ],
    );
}
