//! Errors that are estimated without truth, and a printed board in view as truth.

use super::fixture::Fixture;
use std::collections::BTreeMap;
use svl::calibrate::files;
use svl::calibrate::simulated::MovingBoard;

/// A bag of the arena whose truth is named only on demand.
fn bag() -> Fixture {
    let fixture = Fixture::new();
    fixture.record("run.mcap", "arena --frames 40 --seed 7");
    fixture.run("record run.mcap --ros2 -q -o bag.mcap");
    fixture
}

/// The estimates of a report, by algorithm and area.
fn estimates(fixture: &Fixture, report: &str) -> Vec<String> {
    let text = fixture.text(&format!("{report}/estimates.csv"));
    let mut lines: Vec<_> = text.lines().map(str::to_owned).collect();
    lines.sort();
    lines
}

#[test]
fn errors_without_truth_are_told_everywhere_and_are_those_of_parts() {
    let fixture = bag();
    let score = "score bag.mcap --algo sgm --algo v5 --rerun none";
    fixture.transcript(&format!(
        "{score} -o whole => sgm estimated: about | at most | where v5 is sure ( \
        | v5 estimated: nothing: v5 is the witness | --truth board:9x6
        cat whole/summary.md => sgm estimated: about
        cat whole/index.html => sgm estimated: about
        cat whole/summary.json => /algorithms/0/algorithm = sgm | /estimates/0/algorithm = sgm
        {score} -o part-1 -q --shard 1/2
        {score} -o part-2 -q --shard 2/2
        report part-2 part-1 -o merged -q
        score bag.mcap --algo v5 --rerun none -o grown -q
        {score} -o grown -q
        score bag.mcap --algo bm --rerun none -o grown -q
        {score} -o whole => matched  nothing"
    ));
    let whole = estimates(&fixture, "whole");
    assert_eq!(whole, estimates(&fixture, "merged"));
    let grown = estimates(&fixture, "grown");
    assert!(whole.iter().all(|line| grown.contains(line)), "{grown:?}");
    let summary = fixture.json_file("whole/summary.json");
    let own = &summary["estimates"][0];
    let [low, about, high] = [
        "estimated_wrong_low",
        "estimated_wrong",
        "estimated_wrong_high",
    ]
    .map(|key| own[key].as_f64().unwrap());
    assert!(
        0.0 <= low && low <= about && about < high && high < 0.5,
        "{own}"
    );
    // The witness is in no table.
    for table in ["rows.csv", "cells.csv", "algorithms.csv", "summary.csv"] {
        assert!(
            !fixture.text(&format!("whole/{table}")).contains("witness"),
            "{table}"
        );
    }
    fixture.transcript(
        "compare whole whole => estimated, points
        compare whole whole --fail-on worse:estimated_wrong => 2: is an estimate | [[gate]]
        score bag.mcap --algo witness=sgm -o n => 2: 'witness' | give 'sgm' another label",
    );
}

#[test]
fn a_limit_of_an_estimate_is_on_its_promised_end() {
    let fixture = bag();
    let gate = |metric: &str, bound: &str| {
        let text = format!(
            "name = \"e\"\nalgorithms = [\"sgm\"]\n[source]\nkind = \"recording\"\n\
             files = [\"bag.mcap\"]\n[[gate]]\nalgorithm = \"sgm\"\n\
             metric = \"{metric}\"\n{bound}\n"
        );
        fixture.write("e.toml", text);
    };
    let score = "score e.toml --gate --rerun none";
    gate("estimated_wrong", "max = 0.5");
    fixture.transcript(&format!(
        "{score} => pass | wrong cells, high end | in common with v5"
    ));
    gate("estimated_wrong", "max = 0.001");
    fixture.transcript(&format!(
        "{score} => 3: wrong cells, high end | at most 0.1 %"
    ));
    gate("estimated_wrong", "min = 0.1");
    fixture.transcript(&format!("{score} => 1: at their high end alone: give max"));
    gate("estimated_right", "max = 0.9");
    fixture.transcript(&format!("{score} => 1: at its low end alone: give min"));
    // Too few pairs: nothing is measured, and the limit is not kept.
    gate("estimated_wrong", "max = 0.5");
    fixture.transcript(&format!(
        "{score} --every 10 -o few => 3: is not measured in this run, at most | of 100 (line"
    ));
}

#[test]
fn an_estimate_stands_beside_the_truth_where_it_is_asked_for() {
    let fixture = bag();
    let score = "score bag.mcap --truth /truth/depth --algo sgm --rerun none";
    fixture.transcript(&format!(
        "{score} -o t => right | !estimated
        {score} -o t --columns wrong,estimated_wrong => estimated, obstacles, % \
        | sgm estimated: about"
    ));
    let summary = fixture.json_file("t/summary.json");
    let (own, estimate) = (&summary["algorithms"][0], &summary["estimates"][3]);
    assert_eq!(estimate["area"], "all");
    let count = |key: &str| {
        let areas = own["areas"].as_object().unwrap();
        areas["all"][key].as_f64().unwrap()
    };
    let wrong = count("cells_wrong") / (count("cells_wrong") + count("cells_right"));
    let high = estimate["estimated_wrong_high"].as_f64().unwrap();
    assert!(wrong <= high, "{wrong} {high}");
}

/// The pairs of a simulated board in a folder, with the calibration of its cameras.
fn board() -> Fixture {
    let fixture = Fixture::new();
    fixture.run("record board --frames 30 -q -o board.mcap");
    let calibration = MovingBoard::new(1).unwrap().truth;
    files::write(&fixture.path("calib.yml"), &calibration).unwrap();
    fixture
}

#[test]
fn a_board_in_view_is_the_truth() {
    let fixture = board();
    let score = "score board.mcap --calib calib.yml --algo sgm --algo v5 --rerun none";
    fixture.transcript(&format!(
        "{score} --truth board:9x6 -o b => against a board of 9x6 corners, on it alone
        {score} --truth board:8x6 -o c => 1~ board of 8x6 in | of 30 pairs | a board of 9x6 \
        | seen whole, flat and still
        {score} --truth board:9x -o c => 2: --truth board:9x | expected inner corners as 9x6
        {score} --truth board:2x6 -o c => 2: each side needs 3 to 50
        score board.mcap --truth board:9x6 --calib raw --algo sgm -o c => 1~ svl calibrate board"
    ));
    let summary = fixture.json_file("b/summary.json");
    assert_eq!(summary["truth"][0], "board 9x6");
    let scored = summary["algorithms"][1]["scored_cells"].as_u64();
    assert!(scored > Some(30), "{summary}");
    fixture.transcript(
        "calibrate check board.mcap --calib calib.yml --squares 9x6 --square-m 0.03 \
        => distances are => 0~ board of 9x6 in
        calibrate check board.mcap --calib calib.yml --squares 9x6 --square-m 0.0291 => 1~ \
        too long | baseline, focal length or the print
        calibrate check board.mcap --calib calib.yml --squares 9x6 => 2: --square-m
        calibrate check board.mcap --calib calib.yml --squares 9 --square-m 0.03 => 2: as 9x6",
    );
}

/// The table behind the estimates, made again: how often algorithms are wrong where the witness is
/// so sure, and they are so far from it.
#[test]
fn the_table_of_wrong_reports_is_that_of_other_seeds() {
    let fixture = Fixture::new();
    let worlds = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios/worlds.toml");
    fixture.run(&format!(
        "score {} --seeds 211..222 --every 4 --rerun none -q -o r --algo sgm --algo bm --algo v3 \
         --algo v4 --algo dp --algo sgm:speckle_size=0 --algo bm:uniqueness=0 \
         --algo seen=v5:confidence=0.001",
        worlds.display()
    ));
    let cells = fixture.text("r/cells.csv");
    let mut cells = csv::Reader::from_reader(cells.as_bytes());
    let heads = cells.headers().unwrap().clone();
    let place = |name: &str| heads.iter().position(|head| head == name).unwrap();
    let places = ["seed", "sequence", "column", "row"].map(place);
    let [label, state, verdict] = ["algorithm", "state", "verdict"].map(place);
    let [px, m, probability] = ["median_px", "distance_m", "probability"].map(place);
    let cells: Vec<_> = cells.records().map(Result::unwrap).collect();
    let number = |cell: &csv::StringRecord, column: usize| cell[column].parse::<f64>().ok();
    let key = |cell: &csv::StringRecord| places.map(|column| cell[column].to_owned());
    let seen = cells.iter().filter(|cell| &cell[label] == "seen");
    let seen: BTreeMap<_, _> = seen.map(|cell| (key(cell), cell)).collect();
    let mut bins: BTreeMap<(usize, usize), [f64; 3]> = BTreeMap::new();
    let [sure, far]: [&[f64]; 2] = [
        &[0.5, 0.8, 0.9, 0.97, 0.99],
        &[0.3, 0.6, 0.8, 1.0, 1.25, 1.6],
    ];
    for cell in cells.iter().filter(|cell| &cell[label] != "seen") {
        let witness = seen[&key(cell)];
        let (Some(own_px), Some(seen_px), Some(p)) = (
            number(cell, px),
            number(witness, px),
            number(witness, probability),
        ) else {
            continue;
        };
        let r = match (&cell[state], &witness[state]) {
            ("far", "far") => 0.0,
            ("far", _) => seen_px,
            (_, "far") => own_px,
            _ => {
                let [own_m, seen_m] = [cell, witness].map(|cell| number(cell, m).unwrap());
                (own_m - seen_m).abs() / f64::max(0.1, 0.2 * seen_m)
            }
        };
        if ["right", "wrong"].contains(&&cell[verdict]) {
            let row = sure.partition_point(|end| *end <= p);
            let bin = bins
                .entry((row, far.partition_point(|end| *end <= r)))
                .or_default();
            bin[0] += 1.0;
            bin[1] += f64::from(&cell[verdict] == "wrong");
            bin[2] += svl::report::wrong(p, r);
        }
    }
    let mut compared = 0;
    for (bin, [cells, wrong, expected]) in bins.into_iter().filter(|(_, own)| own[0] >= 100.0) {
        let (found, expected) = (wrong / cells, expected / cells);
        println!("{bin:?}: {found:.2} of {cells}, {expected:.2}");
        assert!(
            (found - expected).abs() < 0.1,
            "{bin:?}: {found} of {cells}, not {expected}"
        );
        compared += 1;
    }
    assert!(compared >= 8, "{compared}");
}
