//! `--reference` and `--truth`: the caution next to numbers that are not from exact truth.

use super::fixture::Fixture;

const CAUTION: &str = "against sgm, not truth";

#[test]
fn numbers_against_a_reference_say_so_everywhere() {
    let fixture = Fixture::new();
    fixture.write_recorded_arena("short.toml", 4);
    fixture.transcript(&format!(
        "score short.toml --algo v3 -o exact => !against
        score short.toml --algo v3 -o other --reference sgm => 1x {CAUTION} \
        => 0~ scored against sgm, not its own truth
        cat other/summary.md => {CAUTION}
        cat other/index.html => {CAUTION}
        cat other/manifest.json => /truth = [\"reference sgm\"]
        cat other/summary.json => /truth = [\"reference sgm\"]
        compare exact other => after  other: {CAUTION} \
        | not comparable: scored differently (truth or calibration of 8 pairs) \
        | !WORSE | !better\\n"
    ));
}

#[test]
fn a_replay_has_references_too_and_warns_of_itself() {
    let fixture = Fixture::new();
    fixture.record_short_arena("run.mcap", 3, 1);
    let replay = "replay run.mcap --reference sgm";
    fixture.transcript(&format!(
        "{replay} --algo bm --rows rows.csv => 0~ !itself => {CAUTION}
        {replay} --algo sgm:p1=10 => 0~ sgm:p1=10: is scored against itself
        replay run.mcap --json => /truth = [\"exact\"]
        replay run.mcap --json --truth /truth/depth => /truth = [\"sensor /truth/depth\"]"
    ));
    assert_eq!(fixture.column("rows.csv", "truth"), ["reference sgm"; 3]);
    // The recording's own truth, as a topic: the same numbers, except for the stated origin.
    let cells = |more: &str| {
        let json = fixture.json(&format!("replay run.mcap --json {more}"));
        let cells = ["cells_right", "cells_wrong", "cells_unknown"];
        cells.map(|column| json["algorithms"][0][column].clone())
    };
    assert_eq!(cells(""), cells("--truth /truth/depth"));
}

#[test]
fn a_source_without_topics_has_no_truth_of_a_sensor() {
    let fixture = Fixture::new();
    fixture.fails("record arena --truth /points -o a.mcap => 2: --truth is for a recording");
}

#[test]
fn a_scenario_and_an_option_name_the_same_truth_and_the_gate_says_so() {
    let fixture = Fixture::new();
    fixture.record_short_arena("run.mcap", 3, 1);
    fixture.write(
        "own.toml",
        "name = \"own\"\n[source]\nkind = \"recording\"\nfiles = [\"bag.mcap\"]\n\
         truth = \"/truth/depth\"\ntruth_skew_ms = 1\n\
         [[gate]]\nalgorithm = \"v5\"\nmetric = \"wrong\"\nmax = 0.9\n",
    );
    fixture.run("record run.mcap --ros2 -o bag.mcap");
    let right = |line: &str| fixture.json(line)["algorithms"][0]["cells_right"].take();
    let option = right("score bag.mcap --truth /truth/depth --json");
    assert_eq!(option, right("score own.toml --json"));
    assert!(option.as_u64() > Some(0), "{option}");
    fixture.transcript(
        "score own.toml --gate => at most 90.0 %, against the sensor /truth/depth (line",
    );
}

#[test]
fn without_a_calibration_cells_are_judged_in_pixels() {
    let fixture = Fixture::new();
    fixture.write_pair("scene/im0.pgm", "scene/im1.pgm", (64, 48), 4);
    let truth = svl::stereo::Plane::filled(64, 48, 4.0).unwrap();
    svl::files::write_pfm(&fixture.path("scene/disp0.pfm"), &truth).unwrap();
    fixture.transcript(
        "score scene --algo bm:max_disparity=16 --columns right --explain => right | within 2 px",
    );
}
