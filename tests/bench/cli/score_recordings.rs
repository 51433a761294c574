//! `svl score` of recordings, bags and folders.

use super::fixture::Fixture;
use std::collections::BTreeMap;
use svl::recording::Recording;
use svl::report::{AccuracyRow, CellRow, CheckpointRow, Row, read_rows};
use svl::score::Verdict;

/// The arena's first short run: `run1.mcap` with truth, and `bag2.mcap`, a ROS 2 bag, which svl
/// reads without it.
fn arena() -> Fixture {
    let fixture = Fixture::new();
    fixture.write_made("made", "bags of the short arena", |fixture| {
        for (seed, bag) in [(1, "bag2.mcap"), (2, "bag10.mcap")] {
            fixture.record_short_arena(&format!("run{seed}.mcap"), 12, seed);
            fixture.transcript(&format!(
                "mkdir made
                record run{seed}.mcap --ros2 -q -o made/{bag}"
            ));
        }
    });
    fixture.record_short_arena("run1.mcap", 12, 1);
    for bag in ["bag2.mcap", "bag10.mcap"] {
        fixture.transcript(&format!("mv made/{bag} {bag}"));
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
    fixture.run("score run1.mcap --algo v3 --algo sgm -q");
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
    let text = scenario("tape", "files = [\"bag2.mcap\"]", &checkpoints);
    fixture.write("tape.toml", text);
    fixture.transcript(
        "score tape.toml -q => no ground truth | known | !missed
        cat reports/tape/manifest.json => /runs/0/name = bag2.mcap | /runs/0/bytes > 100000
        cat reports/tape/summary.json => /algorithms/0/cells_right = null \
        | /algorithms/0/known_share > 0.1
        cat reports/tape/index.html => no ground truth | expected ",
    );
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
    let [manifest, other] = ["tape", "run1"]
        .map(|report| fixture.json_file(&format!("reports/{report}/manifest.json")));
    let own = &manifest["runs"][0];
    assert_eq!(own["pairs_hash"], other["runs"][0]["pairs_hash"]);
    assert_eq!(manifest["pairs_hash"], other["pairs_hash"]);
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
    let text = scenario("both", "files = [\"bag*.mcap\"]", checkpoint);
    fixture.write("both.toml", text);
    // A limit fails, and CI sees it.
    fixture.transcript(
        "score both.toml -q -o a
        score both.toml -q --gate -o b => 3: gate: v3: known cells | at least 99.0 %
        compare a b => known | !Scored differently
        replay bag10.mcap -q --verify=a => verified: 24 results",
    );
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

    let is_refused = |from: &str, to: &str, words: &str| {
        fixture.edit("both.toml", "bad.toml", &[[from, to]]);
        fixture.fails(&format!("score bad.toml -q -o c => 1: {words}"));
    };
    let name = "file = \"bag10.mcap\"\n";
    is_refused("bag*.mcap", "bug*.mcap", "'bug*.mcap' matches nothing");
    let words = "file = 'bag3.mcap' is none of the files";
    is_refused("\"bag10.mcap\"", "\"bag3.mcap\"", words);
    is_refused(name, "", "name its file");
    is_refused("[0.0, 0.5]", "[0.5, 0.0]", "seconds = [0.5, 0]");
    is_refused("free = true", "free = true\nnearer_m = 1", "exactly one of");
    is_refused(
        "order =",
        "cells = [[0, 0]]\norder =",
        "[[checkpoint.cell]]",
    );
    for (key, words) in [
        ("every = 0", "every = 0"),
        (
            "seeds = [1]",
            "source.seeds belongs to kind = \"arena\" or \"drive\"",
        ),
        ("left = \"/a\"", "belong together"),
        ("fps = 0", "fps: 0.001 to 100000"),
        ("truth_skew_ms = 5", "truth_skew_ms is for source.truth"),
        ("truth = \"/x\"", "--truth /x: no such topic"),
        (
            "crop = [300, 0, 40, 40]",
            "crop = [300, 0, 40, 40] is not inside",
        ),
    ] {
        is_refused("files =", &format!("{key}\nfiles ="), words);
    }
}

#[test]
fn a_range_keeps_numbers_and_stamps_and_a_smaller_image_its_distances() {
    let fixture = arena();
    let rows = |more: &str| -> Vec<Row> {
        fixture.run(&format!(
            "replay run1.mcap -q --rows rows.csv --force {more}"
        ));
        read_rows(&fixture.path("rows.csv")).unwrap()
    };
    let numbers = |rows: &[Row]| rows.iter().map(|row| row.sequence).collect::<Vec<_>>();
    let all = rows("");
    let third = rows("--every 3");
    assert_eq!(numbers(&third), [0, 3, 6, 9]);
    for row in &third {
        let mut all = all.iter();
        let same = all.find(|other| other.sequence == row.sequence).unwrap();
        assert_eq!(row.pair_hash, same.pair_hash);
        assert_eq!(row.stamp_ns, same.stamp_ns);
    }
    let (from_s, to_s) = (all[4].stamp_ns as f64 / 1e9, all[9].stamp_ns as f64 / 1e9);
    let some = rows(&format!("--from {from_s} --to {to_s}"));
    assert_eq!(numbers(&some), [4, 5, 6, 7, 8]);

    // Half the size: the same truth, at the same distances.
    let source = "files = [\"run1.mcap\"]\nscale = 0.5\nevery = 4";
    fixture.write("half.toml", scenario("half", source, ""));
    fixture.transcript(
        "replay run1.mcap --from 5 --to 2 => 2: the range is empty
        replay run1.mcap --every 0 => 2: --every
        score run1.mcap --from 900 -q => 1: run1.mcap: has no pair after 900 s
        score half.toml -q
        score run1.mcap --every 4 -q
        cat reports/half/manifest.json \
        => /runs/0/changes = one pair of 4, scaled by 0.5 (area average)",
    );
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
}

#[test]
fn a_source_without_truth_or_frames_is_reported_with_the_cure() {
    let fixture = Fixture::new();
    fixture.write_pair("pairs/left/1.pgm", "pairs/right/1.pgm", (64, 48), 4);
    fixture.write_pair("pairs/left/2.pgm", "pairs/right/2.pgm", (64, 48), 4);
    let cell = "[[checkpoint]]\nnumber = 1\nname = \"box\"\nframes = [0, 1]\n[[checkpoint.cell]]\n\
                at = [0, 0]\nnearer_m = 1.0\n";
    fixture.write("own.toml", scenario("own", "files = [\"pairs\"]", cell));
    fixture.transcript(
        "score pairs --algo v3 -q => no ground truth | reports/pairs/index.html
        score own.toml -q => 1: checkpoint 1 (box) | pairs has no calibration | --calib
        score nothing.mcap => 1: nothing.mcap: no such file
        score scenarios/drive.toml => 1: scenarios/drive.toml: no such file | checkout
        score pairs --algo v3 --columns right -q => right | --truth
        score own.toml pairs => 2: own.toml: is a scenario
        score arena --calib none => 2: --calib is for recordings",
    );
}

#[test]
fn a_checkpoint_that_ends_after_the_recording_is_named() {
    let fixture = arena();
    // With a range, the end is the user's.
    for (frames, options, no) in [
        ("[0, 300]", "", ""),
        ("[0, 11]", "", "!"),
        ("[0, 300]", " --every 2", "!"),
    ] {
        let checkpoint = format!(
            "[[checkpoint]]\nnumber = 1\nname = \"box\"\nframes = {frames}\n\
             [[checkpoint.cell]]\nat = [0, 0]\nfree = true\n"
        );
        let text = scenario("ends", "files = [\"bag2.mcap\"]", &checkpoint);
        fixture.write("ends.toml", text);
        fixture.transcript(&format!(
            "score ends.toml --algo v3 --rerun none{options} => 0~ {no}checkpoint 1 (box)"
        ));
    }
}

#[test]
fn cells_are_data_in_results_tables_and_json() {
    let fixture = arena();
    fixture.write_pair("l.pgm", "r.pgm", (64, 48), 4);
    fixture.transcript(
        "replay bag2.mcap -q -o result.mcap --cells cells.csv
        info result.mcap => /algo/v5/cells
        replay result.mcap -q --verify => verified: 12 results
        match l.pgm r.pgm --algo v3 -o d.pfm --json => /cells/# = 15 \
        | /cells/known/disparity_px = 4.0",
    );
    let table: Vec<CellRow> = read_rows(&fixture.path("cells.csv")).unwrap();
    let kept = Recording::open(fixture.path("result.mcap")).unwrap();
    let kept = kept.cells().unwrap();
    assert_eq!((kept.len(), table.len()), (12, 12 * 15));
    let flat = kept
        .iter()
        .flat_map(|result| result.cells.iter().map(|cell| (result.sequence, cell)));
    for ((sequence, cell), row) in flat.zip(&table) {
        let place = (row.sequence, row.column as usize, row.row as usize);
        assert_eq!((sequence, cell.column, cell.row), place);
        assert_eq!(Some(cell.state), row.state);
        assert_eq!(cell.distance_m.is_some(), row.distance_m.is_some());
        let off = cell.distance_m.unwrap_or(0.0) - row.distance_m.unwrap_or(0.0);
        assert!(off.abs() < 1e-6);
    }
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
        fixture.run("record a.toml -q --force -o a.mcap");
        for scored in ["a.toml", "a.mcap"] {
            fixture.run(&format!("score {scored} --rerun none -q --force -o a"));
            let rows: Vec<AccuracyRow> = read_rows(&fixture.path("a/accuracy.csv")).unwrap();
            let (known, resting) = (rows[0].cells, rows[0].resting_cells);
            assert!(known > 0 && resting == 0, "{random}, {scored}: {resting}");
        }
    }
}
