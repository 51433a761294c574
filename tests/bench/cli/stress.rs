//! `svl score --stress`.

use super::fixture::Fixture;
use svl::report::{CellRow, Row, read_rows};
use svl::score::MetricSource as _;

#[test]
fn levels_are_scored_tabled_and_drawn() {
    let fixture = Fixture::new();
    fixture.write_recorded_arena("short.toml", 6);
    let score = "score short.toml --seeds 1 --algo bm -q --rerun none";
    // The main table covers the original pairs. Six pairs tell nothing, however large the
    // difference. The first pair has none before it. Reports are compared by the original pairs.
    fixture.transcript(&format!(
        "{score} -o r --stress row_offset=0.5/8 --stress skew=1 => Stress: row_offset, px \
        | breaks at | missed near, % | found near, % | too few pairs to tell | skew, scored pairs
        cat r/summary.json => /algorithms/0/pairs = 6 | /stress/# = 5 \
        | /stress/2/untold = too few pairs to tell | /stress/2/broken = null
        cat r/rows.csv => 6x ,row_offset=8,
        cat r/index.html => id=\"stress\"
        {score} -o plain
        compare plain r => 6 pairs, 6 with equal results"
    ));
    let summary = fixture.json_file("r/summary.json");
    let stress = summary["stress"].as_array().unwrap();
    let levels = |kind: &str| {
        let own = stress.iter().filter(|s| s["kind"] == kind);
        own.collect::<Vec<_>>()
    };
    let right = |i: usize| levels("row_offset")[i]["right"].as_f64().unwrap();
    assert_eq!(levels("row_offset").len(), 3);
    assert!(right(2) < 0.5 * right(0), "{stress:?}");
    assert_eq!(levels("skew")[1]["pairs"], 5);

    // From the scenario.
    let scenario = fixture.text("short.toml") + "\n[[stress]]\nkind = \"noise\"\nlevels = [20]\n";
    fixture.write("short.toml", scenario);
    let hashes = || {
        fixture.run(&format!("{score} -o n"));
        fixture.column("n/rows.csv", "result_hash")
    };
    let whole = hashes();
    // Again it is the same, though the perturbed results are missing.
    let units = std::fs::read_dir(fixture.path("n/units")).unwrap();
    let units = units.map(|entry| entry.unwrap().path());
    let noisy = units.filter(|path| path.to_str().unwrap().contains("noise"));
    noisy.for_each(|path| std::fs::remove_dir_all(path).unwrap());
    assert_eq!(hashes(), whole);
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
    fixture.record("bag.mcap", "arena --frames 60 --seed 7 --ros2");
    // Nothing else measures the shares.
    let gate = "name = \"n\"\nalgorithms = [\"bm\"]\n[source]\nkind = \"recording\"\n\
                path = \"bag.mcap\"\n[[gate]]\nmetric = \"same\"\nalgorithm = \"bm\"\nmin = 0.8\n";
    fixture.write("gate.toml", gate);
    fixture.transcript(
        "score bag.mcap --algo bm --algo v5 -q -o r --rerun none --stress jpeg=30/99 \
         --stress skew=1 => Stress: jpeg | same, % | changed, % | gone, %
         score gate.toml -o n => 1: same is measured at each level of a perturbation
         score bag.mcap --sort same -o n => 2: same is measured at each level of a perturbation
         compare r r --fail-on worse:gone => 2: gone is measured at each level of a perturbation",
    );
    let summary = fixture.json_file("r/summary.json");
    let stress = summary["stress"].as_array().unwrap();
    let at = |algorithm: &str, level: f64| {
        let mut own = stress.iter().filter(|s| s["algorithm"] == algorithm);
        own.find(|s| s["level"] == level).unwrap().clone()
    };
    let severe = at("bm", 99.0);
    let broken = severe["broken"].as_str().unwrap();
    assert!(broken.starts_with("same 100 →"), "{severe}");
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
    assert_eq!(fixture.json("report r --json")["stress"], summary["stress"]);
}
