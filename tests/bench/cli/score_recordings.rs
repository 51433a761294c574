//! `svl score` of recordings, bags and folders.

use super::fixture::Fixture;
use serde_json::Value;
use std::collections::BTreeMap;
use svl::recording::Recording;
use svl::report::{AccuracyRow, CellRow, CheckpointRow, Row, read_rows};
use svl::score::Verdict;

/// The arena's two short runs: `run1.mcap` and `run2.mcap` with truth, and as ROS 2 bags, which svl
/// reads without it, `bag2.mcap` (of run 1) and `bag10.mcap`.
fn arena() -> Fixture {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 12);
    for (seed, bag) in [("1", "bag2.mcap"), ("2", "bag10.mcap")] {
        let run = format!("run{seed}.mcap");
        let record = ["record", "short.toml", "--seed", seed, "-q", "-o", &run];
        fixture.svl(&record).done();
        fixture
            .svl(&["record", &run, "--ros2", "-q", "-o", bag])
            .done();
    }
    fixture
}

fn scenario(name: &str, source: &str, rest: &str) -> String {
    format!(
        "name = \"{name}\"\ndescription = \"\"\nalgorithms = [\"v3\", \"sgm\"]\n[cells]\njudge = \
         \"distance\"\n[source]\nkind = \"recording\"\n{source}\n{rest}"
    )
}

#[test]
fn measured_distances_judge_a_bag_as_the_truth_judges_the_recording() {
    let fixture = arena();
    let with_truth = ["score", "run1.mcap", "--algo", "v3", "--algo", "sgm", "-q"];
    fixture.svl(&with_truth).done();
    let cells: Vec<CellRow> = read_rows(&fixture.path("reports/run1/cells.csv")).unwrap();
    let frame: Vec<_> = cells.iter().filter(|cell| cell.sequence == 5).collect();
    assert_eq!(frame.len(), 30);

    // A person's notes from a tape measure: every cell is a checkpoint of its own.
    let mut checkpoints = String::new();
    for cell in frame.iter().filter(|cell| cell.algorithm == "v3") {
        let (column, row) = (cell.column, cell.row);
        let number = 10 * column + row;
        let true_m = cell.true_distance_m.unwrap();
        checkpoints += &format!(
            "[[checkpoint]]\nnumber = {number}\nname = \"cell {column} {row}\"\nframes = [5, 5]\n\
             [[checkpoint.cell]]\nat = [{column}, {row}]\ndistance_m = {true_m}\n"
        );
    }
    fixture.write(
        "tape.toml",
        scenario("tape", "files = [\"bag2.mcap\"]", &checkpoints),
    );
    let text = fixture.svl(&["score", "tape.toml", "-q"]).done();
    assert!(text.contains("no ground truth"), "{text}");
    assert!(text.contains("known") && !text.contains("missed"), "{text}");
    let verdicts: Vec<CheckpointRow> =
        read_rows(&fixture.path("reports/tape/checkpoints.csv")).unwrap();
    let by_tape: BTreeMap<_, _> = verdicts
        .iter()
        .map(|row| ((row.algorithm.as_str(), row.checkpoint), row.passed == 1))
        .collect();
    assert_eq!(by_tape.len(), 30);
    let mut right = 0;
    for cell in frame {
        let key = (cell.algorithm.as_str(), 10 * cell.column + cell.row);
        assert_eq!(by_tape[&key], cell.verdict == Verdict::Right, "{key:?}");
        right += usize::from(by_tape[&key]);
    }
    assert!(
        (1..30).contains(&right),
        "some pass and some do not: {right}"
    );

    // The same pixels, distinguished only by name.
    let manifest = fixture.json_file("reports/tape/manifest.json");
    let other = fixture.json_file("reports/run1/manifest.json");
    assert_eq!(manifest["runs"][0]["name"], "bag2.mcap");
    assert!(manifest["runs"][0]["bytes"].as_u64().unwrap() > 100_000);
    assert_eq!(
        manifest["runs"][0]["pairs_hash"],
        other["runs"][0]["pairs_hash"]
    );
    assert_eq!(manifest["pairs_hash"], other["pairs_hash"]);
    let summary = fixture.json_file("reports/tape/summary.json");
    assert!(summary["algorithms"][0]["cells_right"].is_null());
    assert!(summary["algorithms"][0]["known_share"].as_f64().unwrap() > 0.1);
    let page = std::fs::read_to_string(fixture.path("reports/tape/index.html")).unwrap();
    assert!(
        page.contains("no truth") && page.contains("expected "),
        "the page says both"
    );
}

#[test]
fn patterns_are_runs_that_can_be_compared_and_verified() {
    let fixture = arena();
    let checkpoint = concat!(
        "[[checkpoint]]\nnumber = 1\nname = \"first\"\nseconds = [0.0, 0.5]\n",
        "file = \"bag10.mcap\"\norder = [[[1, 1], [2, 1]]]\n",
        "[[checkpoint.cell]]\nat = [0, 0]\nfree = true\n",
        "[[gate]]\nalgorithm = \"v3\"\nmetric = \"known\"\nmin = 0.99\n",
    );
    fixture.write(
        "both.toml",
        scenario("both", "files = [\"bag*.mcap\"]", checkpoint),
    );
    fixture.svl(&["score", "both.toml", "-q", "-o", "a"]).done();
    let rows: Vec<Row> = read_rows(&fixture.path("a/rows.csv")).unwrap();
    let mut runs: Vec<_> = rows.iter().map(|row| row.run.as_deref().unwrap()).collect();
    runs.dedup();
    assert_eq!(runs, ["bag2.mcap", "bag10.mcap"]);
    let tallies: Vec<CheckpointRow> = read_rows(&fixture.path("a/checkpoints.csv")).unwrap();
    let frames = |run: &str| {
        let own = tallies.iter().filter(|row| row.run.as_deref() == Some(run));
        own.map(|row| row.frames).max().unwrap()
    };
    assert!(frames("bag2.mcap") == 0 && frames("bag10.mcap") > 0);

    // A limit fails, and CI sees it.
    let broken = ["score", "both.toml", "-q", "--gate", "-o", "b"];
    fixture
        .svl(&broken)
        .failed(3, &["gate: v3: known cells", "at least 99.0 %"]);
    let compared = fixture.svl(&["compare", "a", "b"]).done();
    assert!(
        compared.contains("known") && !compared.contains("Scored differently"),
        "{compared}"
    );
    let verified = fixture
        .svl(&["replay", "bag10.mcap", "-q", "--verify=a"])
        .done();
    assert!(verified.contains("verified: 24 results"), "{verified}");

    for (from, to, words) in [
        ("bag*.mcap", "bug*.mcap", "'bug*.mcap' matches nothing"),
        (
            "\"bag10.mcap\"",
            "\"bag3.mcap\"",
            "file = 'bag3.mcap' is none of the files",
        ),
        ("file = \"bag10.mcap\"\n", "", "name its file"),
        (
            "seconds = [0.0, 0.5]",
            "seconds = [0.5, 0.0]",
            "seconds = [0.5, 0]",
        ),
        ("files =", "every = 0\nfiles =", "every = 0"),
        (
            "files =",
            "seeds = [1]\nfiles =",
            "source.seeds belongs to kind = \"arena\" or \"drive\"",
        ),
        ("files =", "left = \"/a\"\nfiles =", "belong together"),
        ("files =", "fps = 0\nfiles =", "fps: 0.001 to 100000"),
        (
            "files =",
            "truth_skew_ms = 5\nfiles =",
            "truth_skew_ms is for source.truth",
        ),
        (
            "files =",
            "truth = \"/x\"\nfiles =",
            "--truth /x: no such topic",
        ),
        ("free = true", "free = true\nnearer_m = 1", "exactly one of"),
        (
            "order =",
            "cells = [[0, 0]]\norder =",
            "[[checkpoint.cell]]",
        ),
        (
            "files =",
            "crop = [300, 0, 40, 40]\nfiles =",
            "crop = [300, 0, 40, 40] is not inside",
        ),
    ] {
        let text = scenario("both", "files = [\"bag*.mcap\"]", checkpoint);
        assert!(text.contains(from), "{from}");
        fixture.write("bad.toml", text.replacen(from, to, 1));
        fixture
            .svl(&["score", "bad.toml", "-q", "-o", "c"])
            .failed(1, &[words]);
    }
}

#[test]
fn a_range_keeps_numbers_and_stamps_and_a_smaller_image_its_distances() {
    let fixture = arena();
    let rows = |name: &str, more: &[&str]| -> Vec<Row> {
        let mut args = vec!["replay", "run1.mcap", "-q", "--rows", name];
        args.extend(more);
        fixture.svl(&args).done();
        read_rows(&fixture.path(name)).unwrap()
    };
    let all = rows("all.csv", &[]);
    let third = rows("third.csv", &["--every", "3"]);
    let numbers: Vec<_> = third.iter().map(|row| row.sequence).collect();
    assert_eq!(numbers, [0, 3, 6, 9]);
    for row in &third {
        let same = all
            .iter()
            .find(|other| other.sequence == row.sequence)
            .unwrap();
        assert_eq!(
            (&row.pair_hash, row.stamp_ns),
            (&same.pair_hash, same.stamp_ns)
        );
    }
    let (from_s, to_s) = (all[4].stamp_ns as f64 / 1e9, all[9].stamp_ns as f64 / 1e9);
    let some = rows(
        "some.csv",
        &["--from", &from_s.to_string(), "--to", &to_s.to_string()],
    );
    assert_eq!(
        some.iter().map(|row| row.sequence).collect::<Vec<_>>(),
        [4, 5, 6, 7, 8]
    );
    fixture
        .svl(&["replay", "run1.mcap", "--from", "5", "--to", "2"])
        .failed(2, &["the range is empty"]);
    fixture
        .svl(&["replay", "run1.mcap", "--every", "0"])
        .failed(2, &["--every"]);
    fixture
        .svl(&["score", "run1.mcap", "--from", "900", "-q"])
        .failed(1, &["run1.mcap: has no pair after 900 s"]);

    // Half the size: the same truth, at the same distances.
    let source = "files = [\"run1.mcap\"]\nscale = 0.5\nevery = 4";
    fixture.write("half.toml", scenario("half", source, ""));
    fixture.svl(&["score", "half.toml", "-q"]).done();
    fixture
        .svl(&["score", "run1.mcap", "--every", "4", "-q"])
        .done();
    let cells = |report: &str| -> Vec<CellRow> {
        let cells = read_rows(&fixture.path(&format!("reports/{report}/cells.csv"))).unwrap();
        cells
            .into_iter()
            .filter(|cell: &CellRow| ["v3", "v5"].contains(&cell.algorithm.as_str()))
            .collect()
    };
    let (half, whole) = (cells("half"), cells("run1"));
    assert_eq!((half.len(), half.len()), (45, whole.len()));
    for (half, whole) in half.iter().zip(&whole) {
        let [half, whole] = [half, whole].map(|cell| cell.true_distance_m.unwrap());
        assert!((half - whole).abs() < 0.05 * whole, "{half} m, {whole} m");
    }
    let manifest = fixture.json_file("reports/half/manifest.json");
    let changes = manifest["runs"][0]["changes"].as_str().unwrap();
    assert_eq!(changes, "one pair of 4, scaled by 0.5 (area average)");
}

#[test]
fn a_source_without_truth_or_frames_is_reported_with_the_cure() {
    let fixture = Fixture::new();
    fixture.write_pair("pairs/left/1.pgm", "pairs/right/1.pgm", (64, 48), 4);
    fixture.write_pair("pairs/left/2.pgm", "pairs/right/2.pgm", (64, 48), 4);
    let text = fixture
        .svl(&["score", "pairs", "--algo", "v3", "-q"])
        .done();
    assert!(
        text.contains("no truth") && text.contains("reports/pairs/index.html"),
        "{text}"
    );
    let cell = "[[checkpoint]]\nnumber = 1\nname = \"box\"\nframes = [0, 1]\n[[checkpoint.cell]]\n\
                at = [0, 0]\nnearer_m = 1.0\n";
    fixture.write("own.toml", scenario("own", "files = [\"pairs\"]", cell));
    fixture.svl(&["score", "own.toml", "-q"]).failed(
        1,
        &["checkpoint 1 (box)", "pairs has no calibration", "--calib"],
    );
    fixture
        .svl(&["score", "nothing.mcap"])
        .failed(1, &["nothing.mcap: no such file"]);
    fixture
        .svl(&["score", "scenarios/drive.toml"])
        .failed(1, &["scenarios/drive.toml: no such file", "checkout"]);
    let text = fixture.run("score pairs --algo v3 --columns right -q");
    assert!(text.contains("right") && text.contains("--truth"), "{text}");
    fixture
        .svl(&["score", "own.toml", "pairs"])
        .failed(2, &["own.toml: is a scenario"]);
    fixture
        .svl(&["score", "arena", "--calib", "none"])
        .failed(2, &["--calib is for recordings"]);
}

#[test]
fn a_checkpoint_that_ends_after_the_recording_is_named() {
    let fixture = arena();
    let warned = |frames: &str, options: &str| {
        let checkpoint = format!(
            "[[checkpoint]]\nnumber = 1\nname = \"box\"\nframes = {frames}\n\
             [[checkpoint.cell]]\nat = [0, 0]\nfree = true\n"
        );
        let text = scenario("ends", "files = [\"bag2.mcap\"]", &checkpoint);
        fixture.write("ends.toml", text);
        let ran = fixture.svl(&format!("score ends.toml --algo v3 --rerun none{options}"));
        assert_eq!(ran.code, Some(0), "{}", ran.stderr);
        ran.stderr.contains("checkpoint 1 (box)")
    };
    assert!(warned("[0, 300]", ""));
    assert!(!warned("[0, 11]", ""));
    assert!(!warned("[0, 300]", " --every 2"), "the range is the user's");
}

#[test]
fn cells_are_data_in_results_tables_and_json() {
    let fixture = arena();
    let args = [
        "replay",
        "bag2.mcap",
        "-q",
        "-o",
        "result.mcap",
        "--cells",
        "cells.csv",
    ];
    fixture.svl(&args).done();
    let table: Vec<CellRow> = read_rows(&fixture.path("cells.csv")).unwrap();
    let kept = Recording::open(fixture.path("result.mcap"))
        .unwrap()
        .cells()
        .unwrap();
    assert_eq!((kept.len(), table.len()), (12, 12 * 15));
    let flat = kept
        .iter()
        .flat_map(|result| result.cells.iter().map(|cell| (result.sequence, cell)));
    for ((sequence, cell), row) in flat.zip(&table) {
        assert_eq!(
            (sequence, cell.column, cell.row, Some(cell.state)),
            (
                row.sequence,
                row.column as usize,
                row.row as usize,
                row.state
            )
        );
        assert_eq!(cell.distance_m.is_some(), row.distance_m.is_some());
        let off = cell.distance_m.unwrap_or(0.0) - row.distance_m.unwrap_or(0.0);
        assert!(off.abs() < 1e-6);
    }
    let info = fixture.svl(&["info", "result.mcap"]).done();
    assert!(info.contains("/algo/v5/cells"), "{info}");
    let verified = fixture
        .svl(&["replay", "result.mcap", "-q", "--verify"])
        .done();
    assert!(verified.contains("verified: 12 results"), "{verified}");

    fixture.write_pair("l.pgm", "r.pgm", (64, 48), 4);
    let text = fixture
        .svl(&[
            "match", "l.pgm", "r.pgm", "--algo", "v3", "-o", "d.pfm", "--json",
        ])
        .done();
    let cells = serde_json::from_str::<Value>(&text).unwrap()["cells"].clone();
    assert_eq!(cells.as_array().unwrap().len(), 15);
    let known = cells
        .as_array()
        .unwrap()
        .iter()
        .find(|cell| cell["state"] == "known");
    assert_eq!(known.unwrap()["disparity_px"], 4.0);
}

#[test]
fn scenes_that_change_from_pair_to_pair_have_no_noise() {
    let fixture = Fixture::new();
    for random in ["shapes", "boards"] {
        let file = format!(
            "name = \"a\"\ndescription = \"\"\nalgorithms = [\"bm\"]\n[cells]\njudge = \
             \"distance\"\n[source]\nkind = \"arena\"\nseeds = \"1..1\"\n[arena]\nrandom = \
             \"{random}\"\nframes = 40\nrate_hz = 10.0\n[arena.rig]\nwidth_px = \
             160\nheight_px = 120\n"
        );
        fixture.write("a.toml", file);
        let record = ["record", "a.toml", "-q", "--force", "-o", "a.mcap"];
        fixture.svl(&record).done();
        for scored in ["a.toml", "a.mcap"] {
            let score = [
                "score", scored, "--rerun", "none", "-q", "--force", "-o", "a",
            ];
            fixture.svl(&score).done();
            let rows: Vec<AccuracyRow> = read_rows(&fixture.path("a/accuracy.csv")).unwrap();
            let (known, resting) = (rows[0].cells, rows[0].resting_cells);
            assert!(known > 0 && resting == 0, "{random}, {scored}: {resting}");
        }
    }
}
