//! Programs that look at nothing, or only at what no robot hits: none is called best beside
//! matchers, and none passes the limits that the docs propose.

use super::fixture;
use crate::common::repository;
use std::collections::BTreeMap;
use svl::arena::Arena;
use svl::depth;
use svl::manifest::{AlgorithmRecord, Manifest};
use svl::matcher::{Algorithm, MatchContext, MatchOutput};
use svl::report::{
    AccuracyRow, GateState, ReportTables, ResultParts, Results, Row, Shown, limit_results,
};
use svl::scenario::{Limit, Scenario, ScenarioSource};
use svl::score::{CellArea, Judge, TrueCells};
use svl::stereo::{Cell, CellDepth, DepthGrid, DisparityMap, Estimate, Frame, Rig};

const MATCHERS: [&str; 3] = ["v5", "sgm", "v3"];
const PROGRAMS: [&str; 6] = ["floor", "constant", "near", "flags", "unknown", "peeks"];
const SEEDS: [u64; 3] = [1, 2, 3];
/// Every n-th pair of a run.
const EVERY: usize = 20;

/// The frames of each seed.
fn runs(scenario: &Scenario) -> BTreeMap<u64, Vec<Frame>> {
    let ScenarioSource::Arena { config, .. } = &scenario.source else {
        panic!("the arena");
    };
    let run = |seed| {
        let arena = Arena::new(config, seed).unwrap();
        let numbers = (0..arena.frames()).step_by(EVERY);
        (seed, numbers.map(|i| arena.frame(i).unwrap()).collect())
    };
    SEEDS.into_iter().map(run).collect()
}

/// Per cell the median of the true disparities in frames.
fn medians<'a>(judge: &Judge, frames: impl Iterator<Item = &'a Frame>) -> Vec<f32> {
    let mut cells = vec![Vec::new(); judge.grid.shape().cells()];
    for frame in frames {
        let truth = TrueCells::new(frame, judge.grid.shape(), judge.cells).unwrap();
        for (values, (_, cell)) in cells.iter_mut().zip(truth.grid().iter()) {
            values.extend(cell.depth.map(|depth| depth.median_px));
        }
    }
    let median = |values: &mut Vec<f32>| {
        values.sort_by(f32::total_cmp);
        values[values.len() / 2]
    };
    cells.iter_mut().map(median).collect()
}

fn known(px: f32, rig: &Rig) -> Cell {
    Cell {
        valid_share: 1.0,
        depth: Some(CellDepth::at(px, Some(rig))),
        ..Cell::UNKNOWN
    }
}

/// The answer of a program to a frame. `medians`: what the truth of the other runs says.
fn answer(program: &str, frame: &Frame, judge: &Judge, medians: &[f32]) -> DepthGrid {
    let (shape, rig) = (judge.grid.shape(), frame.rig().unwrap());
    let truth = TrueCells::new(frame, shape, judge.cells).unwrap();
    let cells = truth.truths().zip(medians);
    let cell = |(((_, row), truth), median): (((usize, usize), _), &f32)| {
        let truth: svl::score::CellTruth = truth;
        match program {
            "floor" if row + 1 == shape.rows => known(*median, rig),
            "constant" => known(*median, rig),
            "near" => known(rig.disparity_px(0.3) as f32, rig),
            "flags" => Cell {
                near: Some(0.9),
                ..Cell::UNKNOWN
            },
            "peeks" if truth.area != Some(CellArea::Obstacle) => truth
                .median
                .map_or(Cell::UNKNOWN, |depth| known(depth.median_px, rig)),
            _ => Cell::UNKNOWN,
        }
    };
    DepthGrid::new(shape, cells.map(cell).collect()).unwrap()
}

fn estimate(label: &str, disparity: DisparityMap, grid: DepthGrid) -> Estimate {
    Estimate {
        algorithm: label.to_owned(),
        disparity,
        grid,
        own_grid: true,
        unfiltered: None,
        range_px: None,
        times: None,
    }
}

/// Squared errors of distances of obstacles, and their number, by label.
type Errors = BTreeMap<String, (f64, f64)>;

/// The rows of matchers and programs, and their errors.
fn rows(scenario: &Scenario) -> (Vec<Row>, Errors) {
    let judge = Judge {
        grid: scenario.grid,
        cells: scenario.cells,
        ..Judge::default()
    };
    let runs = runs(scenario);
    let (mut rows, mut errors) = (Vec::new(), Errors::new());
    for (seed, frames) in &runs {
        let others = runs.iter().filter(|(other, _)| *other != seed);
        let medians = medians(&judge, others.flat_map(|(_, frames)| frames));
        let mut matchers: Vec<_> = MATCHERS
            .iter()
            .map(|name| name.parse::<Algorithm>().unwrap().build().unwrap())
            .collect();
        for frame in frames {
            let matched = MATCHERS.iter().zip(&mut matchers).map(|(label, matcher)| {
                let context = MatchContext::for_frame(frame, judge.grid, judge.cells);
                let mut output = MatchOutput::new().unwrap();
                let pair = frame.rectified().unwrap();
                matcher.compute(pair, &context, &mut output).unwrap();
                let own = output.grid.take();
                let map = output.disparity.disparity();
                let grid = own.unwrap_or_else(|| depth::grid(map, judge.grid, frame.rig()));
                estimate(label, output.disparity, grid)
            });
            let (width, height) = frame.pair.size();
            let programs = PROGRAMS.iter().map(|program| {
                let grid = answer(program, frame, &judge, &medians);
                estimate(program, DisparityMap::new(width, height).unwrap(), grid)
            });
            let estimates = matched.chain(programs).collect();
            for scored in &judge.judge(frame.clone(), estimates).estimates {
                let label = &scored.estimate.algorithm;
                let (sum, count) = errors.entry(label.clone()).or_default();
                let cells = scored
                    .cells
                    .iter()
                    .flatten()
                    .zip(scored.estimate.grid.iter());
                for (truth, (_, cell)) in cells.filter(|c| c.0.area == Some(CellArea::Obstacle)) {
                    let reported_m = cell.depth.and_then(|depth| depth.distance_m);
                    if let Some((z, true_m)) = reported_m.zip(truth.true_m) {
                        *sum += (z - true_m).powi(2);
                        *count += 1.0;
                    }
                }
                // Programs that look at nothing are fast.
                let is_matcher = MATCHERS.contains(&label.as_str());
                let us = if is_matcher { 5000 } else { 10 };
                rows.push(Row {
                    seed: Some(*seed),
                    stamp_ns: frame.stamp_ns,
                    metrics: scored.metrics.clone(),
                    ..fixture::row(label, frame.sequence, us)
                });
            }
        }
    }
    (rows, errors)
}

/// The limits of a scenario or of a page's blocks of TOML, of any algorithm.
fn limits(text: &str) -> Vec<Limit> {
    let tables = text.split("[[gate]]").skip(1).map(|table| {
        let lines = table
            .lines()
            .skip(1)
            .take_while(|line| line.contains(" = "));
        lines.collect::<Vec<_>>().join("\n")
    });
    tables
        .map(|table| toml::from_str(&table).unwrap())
        .collect()
}

#[test]
fn programs_that_look_at_nothing_win_nothing() {
    let scenario = Scenario::arena().unwrap();
    let (rows, errors) = rows(&scenario);
    let accuracy = errors.iter().map(|(label, (sum, count))| AccuracyRow {
        algorithm: label.clone(),
        cells: *count as u64,
        known: *count as u64,
        rmse_m: (*count > 0.0).then(|| (sum / count).sqrt()),
        ..AccuracyRow::default()
    });
    let tables = ReportTables {
        rows: rows.into_iter().collect(),
        accuracy: accuracy.collect(),
        ..ReportTables::default()
    };
    let shown = Shown {
        rule: scenario.cells,
        ..Shown::default()
    };
    let summary = Results::new(&tables, ResultParts::default(), shown).unwrap();
    let sentences = summary.answer();
    println!("{}\n{sentences:#?}", summary.markdown("arena"));
    let is_matcher = |label: &str| MATCHERS.contains(&label);
    assert!(!summary.best.is_empty());
    for best in &summary.best {
        assert!(is_matcher(&best.algorithm), "{best:?}");
    }
    assert!(
        sentences[0].starts_with("Best: sgm by right "),
        "{sentences:?}"
    );
    let read = |file: &str| std::fs::read_to_string(repository().join(file)).unwrap();
    let manifest = |label: &str| Manifest {
        algorithms: vec![AlgorithmRecord {
            label: label.to_owned(),
            ..AlgorithmRecord::default()
        }],
        ..Manifest::new("arena", &[]).unwrap()
    };
    for file in ["scenarios/arena.toml", "docs/camera-depth.md"] {
        // Without those of checkpoints, times, and cells at rest.
        let is_known = |limit: &Limit| {
            let is_of_cells = limit.metric.column().is_some() || limit.metric.name == "rmse";
            is_of_cells && ["v5", "zed"].contains(&limit.algorithm.as_str())
        };
        let limits: Vec<_> = limits(&read(file)).into_iter().filter(is_known).collect();
        assert!(limits.len() > 2, "{file}");
        let fails = |label: &str| {
            let results = limits.iter().flat_map(|limit| {
                let limit = Limit {
                    algorithm: label.to_owned(),
                    // The errors above are of all distances.
                    range: None,
                    ..limit.clone()
                };
                limit_results(&limit, &summary, &manifest(label))
            });
            results.map(|result| result.state).any(GateState::fails)
        };
        assert!(!fails("v5"), "{file}");
        for program in PROGRAMS {
            assert!(fails(program), "{program} passes {file}");
        }
    }
}
