//! The references, which look at no image: rows below the table, by which the best is tested.

use super::fixture::Fixture;
use std::collections::BTreeMap;
use svl::arena::Arena;
use svl::scenario::{Scenario, ScenarioSource};
use svl::score::{AreaChoice, CellTallies, CellTally, TrueCells};
use svl::stereo::{Cell, CellDepth, DepthGrid, Frame};

/// Pairs of each of the two runs of a short arena.
const FRAMES: u64 = 12;

/// Right, wrong and unknown cells by area, and near, found and missed ones.
type Counts = [[usize; 3]; 4];

/// The frames of both runs.
fn frames(scenario: &Scenario) -> [Vec<Frame>; 2] {
    let ScenarioSource::Arena { config, .. } = &scenario.source else {
        panic!("the arena");
    };
    [1, 2].map(|seed| {
        let arena = Arena::new(config, seed).unwrap();
        (0..FRAMES).map(|i| arena.frame(i).unwrap()).collect()
    })
}

/// The counts of the prior by its definition, scored as any algorithm on all pixels.
fn counted(scenario: &Scenario) -> Counts {
    let (shape, rule) = (scenario.grid.shape(), scenario.cells);
    let runs = frames(scenario);
    let truth = |frame: &Frame| TrueCells::new(frame, shape, rule).unwrap();
    let mut cells = Vec::new();
    for (run, other) in [(0, 1), (1, 0)] {
        let mut values: BTreeMap<usize, Vec<f32>> = BTreeMap::new();
        for frame in &runs[other] {
            for (i, (_, cell)) in truth(frame).grid().iter().enumerate() {
                let own = values.entry(i).or_default();
                own.extend(cell.depth.map(|depth| depth.median_px));
            }
        }
        let median = |values: &Vec<f32>| {
            let mut values = values.clone();
            values.sort_by(f32::total_cmp);
            values[(values.len() - 1) / 2]
        };
        let medians: Vec<_> = values.values().map(median).collect();
        for frame in &runs[run] {
            let known = |px: &f32| Cell {
                valid_share: 1.0,
                depth: Some(CellDepth::at(*px, frame.rig())),
                ..Cell::UNKNOWN
            };
            let reported = DepthGrid::new(shape, medians.iter().map(known).collect()).unwrap();
            cells.extend(truth(frame).judge(frame, &reported));
        }
    }
    let tallies = CellTallies::new(&cells);
    let of_area = |area| {
        let own: &CellTally = tallies.get(area);
        [own.right, own.wrong, own.unknown]
    };
    let all = tallies.get(AreaChoice::All);
    let [obstacle, floor, beyond] = AreaChoice::PARTS.map(of_area);
    [obstacle, floor, beyond, [all.near, all.found, all.missed]]
}

fn reference<'a>(summary: &'a serde_json::Value, name: &str) -> &'a serde_json::Value {
    let mut own = summary["references"].as_array().unwrap().iter();
    own.find(|own| own["algorithm"] == name).unwrap()
}

/// The counts of a row of a summary.
fn stored(row: &serde_json::Value) -> Counts {
    let counts = |row: &serde_json::Value, names: [&str; 3]| {
        names.map(|name| row[name].as_u64().unwrap_or_default() as usize)
    };
    let cells = ["cells_right", "cells_wrong", "cells_unknown"];
    [
        counts(row, cells),
        counts(&row["areas"]["floor"], cells),
        counts(&row["areas"]["beyond"], cells),
        counts(row, ["near", "found_obstacles", "missed"]),
    ]
}

#[test]
fn the_prior_is_the_median_of_the_other_runs_also_of_shards() {
    let fixture = Fixture::new();
    let path = fixture.write_recorded_arena("short.toml", FRAMES);
    let scenario = Scenario::read(&path).unwrap();
    // It can be compared with, and limits can be relative to it. Two runs of twelve pairs are too
    // few to tell an algorithm from the prior.
    let line = "score short.toml --algo v3 --algo v5 --rerun none";
    fixture.transcript(&format!(
        "{line} -o whole => prior | obstacle cells, % | too few pairs
        cat whole/summary.json => /best absent
        {line} -q --shard 1/2 -o part-1
        {line} -q --shard 2/2 -o part-2
        report part-2 part-1 -o merged -q
        compare whole#prior whole#v3 => right cells | prior → v3 \
        | errors of distances: whole#prior has none"
    ));
    let [summary, merged] =
        ["whole", "merged"].map(|report| fixture.json_file(&format!("{report}/summary.json")));
    let counted = counted(&scenario);
    assert_eq!(stored(reference(&summary, "prior")), counted);
    // All scored cells of the exact distances are right.
    let [obstacle, floor, beyond, near] = stored(reference(&summary, "exact"));
    let sums = counted.map(|own| own.iter().sum::<usize>());
    for (own, sum) in [obstacle, floor, beyond].iter().zip(sums) {
        assert_eq!(*own, [sum, 0, 0]);
    }
    assert!(near[1] + near[2] == near[0]);
    let lines = fixture.text("whole/references.csv").lines().count() as u64;
    assert_eq!(lines, 4 * FRAMES + 1);
    assert_eq!(merged["references"], summary["references"]);
    let text = fixture.text("short.toml");
    let text = text.split("[[gate]]").next().unwrap();
    for (min, code) in [("-0.5", ""), ("0.99", "3: ")] {
        let gate = format!(
            "\n[[gate]]\nalgorithm = \"v3\"\nmetric = \"right\"\nrelative_to = \"prior\"\n\
             min = {min}\n"
        );
        fixture.write("gate.toml", format!("{text}{gate}"));
        let line = "score gate.toml --algo v3 --rerun none --gate -o whole-gate";
        fixture.transcript(&format!(
            "{line} => {code}v3: right cells minus the prior's"
        ));
    }
}

#[test]
fn one_pair_has_no_others() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", FRAMES);
    let line = "score short.toml --seeds 1 --every 400 --algo v3 --rerun none -o one -q";
    fixture.run(line);
    let summary = fixture.json_file("one/summary.json");
    let [right, wrong, unknown] = stored(reference(&summary, "prior"))[0];
    assert_eq!((right, wrong), (0, 0));
    assert!(unknown > 0);
}
