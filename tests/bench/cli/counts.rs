//! Counts that say of how many pairs, cells and settings a number is.

use super::drive::driven;
use super::fixture::{Fixture, assert_says};
use crate::common::python;
use svl::report::{DriveRow, read_rows};

/// Four pairs of noise in the folder `p`, the third of them with a true disparity of 5 pixels.
fn one_of_four_with_truth() -> Fixture {
    let fixture = Fixture::new();
    for i in 0..4 {
        let [left, right] = ["left", "right"].map(|side| format!("p/{side}/{i}.pgm"));
        fixture.write_pair(&left, &right, (64, 32), i);
    }
    let mut truth = b"Pf\n64 32\n-1.0\n".to_vec();
    truth.extend([5.0_f32; 64 * 32].map(f32::to_le_bytes).as_flattened());
    fixture.write("p/truth/2.pfm", truth);
    fixture
}

#[test]
fn tables_count_the_scored_pairs_of_folders_and_recordings() {
    let fixture = one_of_four_with_truth();
    let truth = "--truth truth/*.pfm:disparity=1";
    let score = "--algo v3:max_disparity=8 --rerun none -q";
    let words = "4 pairs of 64 x 32, 1 scored with 15 cells";
    let counts = "/algorithms/0/scored_pairs = 1 | /algorithms/0/scored_cells = 15";
    fixture.transcript(&format!(
        "record p {truth} -q -o p.mcap
        score p {truth} {score} -o folder => {words}
        cat folder/summary.json => {counts}
        score p.mcap {score} -o recording => {words}
        cat recording/summary.json => {counts}"
    ));
}

#[test]
fn info_and_score_count_the_same_cells() {
    let fixture = Fixture::new();
    for i in 0..2 {
        let [left, right] = ["left", "right"].map(|side| format!("p/{side}/{i}.pgm"));
        fixture.write_pair(&left, &right, (64, 32), i);
        // The right half is without a truth.
        let mut truth = b"Pf\n64 32\n-1.0\n".to_vec();
        let pixels = (0..64 * 32).map(|i| if i % 64 < 32 { 5.0 } else { f32::INFINITY });
        truth.extend(pixels.flat_map(f32::to_le_bytes));
        fixture.write(&format!("p/truth/{i}.pfm"), truth);
    }
    fixture.run("record p --truth truth/*.pfm:disparity=1 -q -o p.mcap");
    let info = fixture.json("info p.mcap --json");
    let truth = &info["first_pairs"]["truths"][0];
    let (scored, cells) = (&truth["scored_cells"], &truth["cells"]);
    assert!(scored.as_u64() < Some(30) && *cells == 30, "{truth}");
    fixture.transcript(&format!(
        "info p.mcap => cells {cells}
        score p.mcap --algo v3:max_disparity=8 --rerun none -q -o r => \
        {scored} of {cells} cells scored
        cat r/summary.json => /algorithms/0/scored_cells = {scored}"
    ));
}

#[test]
fn without_truth_no_count_passes_a_gate() {
    let fixture = one_of_four_with_truth();
    for metric in "blind close missed false found wrong right".split(' ') {
        let text = format!(
            "name = \"own\"\nalgorithms = [\"v3:max_disparity=8\"]\n[source]\nkind = \
             \"recording\"\nfiles = [\"p\"]\n[[gate]]\nalgorithm = \"v3\"\nmetric = \
             \"{metric}\"\nmax = 0\n"
        );
        fixture.write("gate.toml", text);
        fixture.fails(
            "score gate.toml --gate --rerun none -q -o gate => 3: is not measured in this run",
        );
    }
}

#[test]
fn the_pairs_of_drives_are_those_of_their_rows() {
    let fixture = driven();
    let rows: Vec<DriveRow> = read_rows(&fixture.path("r/drives.csv")).unwrap();
    let pairs: u64 = rows.iter().map(|row| row.frames).sum();
    fixture.transcript(&format!("report r => {pairs} pairs"));
}

#[test]
fn headings_of_the_table_name_its_metrics() {
    let fixture = Fixture::new();
    fixture.write_recorded_arena("short.toml", 8);
    let score = "score short.toml --seeds 1 --algo v3 --algo bm --rerun none -q -o r";
    let text = fixture.run(score);
    let heads = text.lines().find(|line| line.contains("p50")).unwrap();
    let heads = heads.replace("found %", "found").replace("1 2 3 4 5 6", "");
    for head in heads.split_whitespace() {
        let text = fixture.run(&format!("report r --columns {head} --sort {head}"));
        let shown = text
            .lines()
            .any(|line| line.trim_start().starts_with(head) || line.contains(&format!(" {head}")));
        assert!(shown, "{head}: {text}");
    }
}

#[test]
fn the_table_is_sorted_by_a_metric() {
    let fixture = Fixture::new();
    fixture.write_recorded_arena("short.toml", 12);
    let algorithms = "--algo v3 --algo bm --algo sgm --algo v5";
    let score = format!("score short.toml --seeds 1 {algorithms} --rerun none -q -o r");
    fixture.run(&score);
    for (metric, column, sign) in [
        ("right", "cells_right", -1.0),
        ("wrong", "cells_wrong", 1.0),
        ("known", "known_share", -1.0),
    ] {
        fixture.run(&format!("{score} --sort {metric}"));
        let summary = fixture.json_file("r/summary.json");
        let algorithms = summary["algorithms"].as_array().unwrap().iter();
        let values: Vec<_> = algorithms
            .map(|algorithm| sign * algorithm[column].as_f64().unwrap())
            .collect();
        assert!(
            values.is_sorted() && values.len() == 4,
            "{metric}: {values:?}"
        );
    }
}

#[test]
fn shares_cases_and_gates_of_random_bags_are_those_of_their_cells() {
    let fixture = Fixture::new();
    let svl = env!("CARGO_BIN_EXE_svl").into();
    let Some(output) = python("recompute.py", "csv", [svl, fixture.path("")]) else {
        return;
    };
    let output = String::from_utf8(output).unwrap();
    let states = ["'fail': ", "'not-measured': ", "'pass': "];
    assert_says(&output, &[&["60 gates equal: "][..], &states].concat());
}
