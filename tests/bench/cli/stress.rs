//! `svl score --stress`.

use super::fixture::{Fixture, assert_says};

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
            "unperturbed",
            "breaks at",
            "skew, frames",
        ],
    );
    let summary: serde_json::Value =
        serde_json::from_slice(&fixture.bytes("r/summary.json")).unwrap();
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
    assert!(levels("row_offset")[2]["broken"].is_string());
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
