//! `svl score --stress`.

use super::fixture::{Fixture, assert_says};
use svl::report::{CellRow, Row, read_rows};

#[test]
fn levels_are_scored_tabled_and_drawn() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 6);
    let line = "score short.toml --seeds 1 --algo bm -q -o r --rerun none \
                --stress row_offset=0.5/8 --stress skew=1";
    let text = fixture.run(line);
    assert_says(
        &text,
        &[
            "Stress: row_offset, px",
            "breaks at",
            "missed near, %",
            "found near, %",
            "too few pairs to tell",
            "skew, scored pairs",
        ],
    );
    let summary = fixture.json_file("r/summary.json");
    // The main table covers the original pairs.
    assert_eq!(summary["algorithms"][0]["pairs"], 6);
    let stress = summary["stress"].as_array().unwrap();
    let levels = |kind: &str| {
        stress
            .iter()
            .filter(|s| s["kind"] == kind)
            .collect::<Vec<_>>()
    };
    let right = |i: usize| levels("row_offset")[i]["right"].as_f64().unwrap();
    assert_eq!(levels("row_offset").len(), 3);
    assert!(right(2) < 0.5 * right(0), "{stress:?}");
    // Six pairs tell nothing, however large the difference.
    let severe = levels("row_offset")[2];
    assert_eq!(severe["untold"], "too few pairs to tell");
    assert!(severe["broken"].is_null(), "{severe}");
    // The first pair has none before it.
    assert_eq!(levels("skew")[1]["pairs"], 5);
    let rows = fixture.text("r/rows.csv");
    assert_eq!(rows.matches(",row_offset=8,").count(), 6);
    assert!(fixture.text("r/index.html").contains("id=\"stress\""));

    // Reports are compared by the original pairs.
    fixture.run("score short.toml --seeds 1 --algo bm -q -o plain --rerun none");
    let text = fixture.run("compare plain r");
    assert_says(&text, &["6 pairs, 6 with equal results"]);

    // From the scenario.
    let mut scenario = fixture.text("short.toml");
    scenario.push_str("\n[[stress]]\nkind = \"noise\"\nlevels = [20]\n");
    fixture.write("short.toml", scenario);
    fixture.run("score short.toml --seeds 1 --algo bm -q -o n --rerun none");
    let whole = fixture.text("n/rows.csv");
    // Again it is the same, though the perturbed results are missing.
    let units = std::fs::read_dir(fixture.path("n/units"))
        .unwrap()
        .flatten();
    let noisy = units.map(|entry| entry.path());
    let noisy = noisy.filter(|path| path.to_str().unwrap().contains("noise"));
    noisy.for_each(|path| std::fs::remove_dir_all(path).unwrap());
    fixture.run("score short.toml --seeds 1 --algo bm -q -o n --rerun none");
    let hashes = |text: &str| {
        let mut lines = csv::Reader::from_reader(text.as_bytes());
        let heads = lines.headers().unwrap().clone();
        let column = heads.iter().position(|head| head == "result_hash").unwrap();
        lines
            .records()
            .map(|line| line.unwrap()[column].to_owned())
            .collect::<Vec<_>>()
    };
    assert_eq!(hashes(&fixture.text("n/rows.csv")), hashes(&whole));
}

#[test]
fn a_skew_needs_earlier_pairs() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 2);
    let skew = "score short.toml --algo bm -q --rerun none --stress skew=5";
    fixture.fails(&format!("{skew} => 2: only 2 pairs"));
}

#[test]
fn without_truth_the_cells_that_stay_are_counted() {
    let fixture = Fixture::new();
    fixture.run("record arena --frames 60 --seed 7 --ros2 -o bag.mcap -q");
    let line = "score bag.mcap --algo bm --algo v5 -q -o r --rerun none --stress jpeg=30/99 \
                --stress skew=1";
    let text = fixture.run(line);
    assert_says(&text, &["Stress: jpeg", "same, %", "changed, %", "gone, %"]);
    let summary = fixture.json_file("r/summary.json");
    let stress = summary["stress"].as_array().unwrap();
    let at = |algorithm: &str, level: f64| {
        let mut own = stress.iter().filter(|s| s["algorithm"] == algorithm);
        own.find(|s| s["level"] == level).unwrap().clone()
    };
    let severe = at("bm", 99.0);
    assert!(
        severe["broken"].as_str().unwrap().starts_with("same 100 →"),
        "{severe}"
    );
    assert!(severe.get("right").is_none() && at("bm", 0.0).get("same").is_none());
    // The shares are of the cells that are known unperturbed, in each pair that both have.
    let cells: Vec<CellRow> = read_rows(&fixture.path("r/cells.csv")).unwrap();
    let rows: Vec<Row> = read_rows(&fixture.path("r/rows.csv")).unwrap();
    let perturbed = rows.iter().filter(|row| row.stress.is_some());
    assert_eq!(perturbed.clone().count(), 2 * (60 + 60 + 59));
    for row in perturbed {
        let is_plain = |cell: &&CellRow| {
            let is_own = cell.sequence == row.sequence && cell.algorithm == row.algorithm;
            is_own && cell.stress.is_none() && cell.median_px.is_some()
        };
        let known = cells.iter().filter(is_plain).count() as f64;
        let kept = ["same", "changed", "gone"].map(|name| row.metrics.get(name).unwrap());
        assert_eq!(kept.iter().sum::<f64>(), known, "{row:?}");
    }
    // Tables that are there are read alike.
    let json = |text: String| serde_json::from_str::<serde_json::Value>(&text).unwrap();
    let again = json(fixture.run("report r --json"));
    assert_eq!(again["stress"], summary["stress"]);
    // Nothing else measures them.
    let gate = "name = \"n\"\nalgorithms = [\"bm\"]\n[source]\nkind = \"recording\"\n\
                path = \"bag.mcap\"\n[[gate]]\nmetric = \"same\"\nalgorithm = \"bm\"\nmin = 0.8\n";
    fixture.write("gate.toml", gate);
    fixture.fails(
        "score gate.toml -o n => 1: same is measured at each level of a perturbation
         score bag.mcap --sort same -o n => 2: same is measured at each level of a perturbation
         compare r r --fail-on worse:gone => 2: gone is measured at each level of a perturbation",
    );
}
