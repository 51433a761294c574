//! Numbers from other sensors equal those from exact truth, up to the effect of sampling.
//!
//! The arena is recorded twice: its pairs, and the depths of a camera 5 cm beside and 3 cm above
//! the left one. `tests/python/sensor_bag.py` makes a ROS 2 bag of both. Each sensor's truth is
//! compared with the exact one, and with the exact one of only the pixels that the sensor measured:
//! the first difference is due to sampling, the second to errors of svl.

use super::bag::{all_frames, open_with};
use crate::cli::fixture::Fixture;
use crate::common::python;
use std::path::{Path, PathBuf};
use svl::depth::{GridSettings, grid};
use svl::matcher::Algorithm;
use svl::scenario::SourceOptions;
use svl::score::{CellJudgement, CellTally, TrueCells, Verdict};
use svl::stereo::{CellRule, DepthGrid, Frame, MapDensity, Plane, RectifiedPair, Truth, TruthKind};

const FRAMES: u64 = 40;
const ALGORITHMS: [&str; 3] = ["v3", "bm", "sgm"];

/// The arena's pairs as recorded by svl, and the bag; `None` without Python.
fn recorded(fixture: &Fixture) -> Option<(PathBuf, PathBuf)> {
    let pairs = fixture.write_short_arena("pairs.toml", FRAMES);
    let text = std::fs::read_to_string(&pairs).unwrap();
    let other = [
        ("width_px = 320", "width_px = 480"),
        // An odd number: the optical axis is in the middle of a row, that of the laser scan.
        ("height_px = 240", "height_px = 359"),
        // Half of it is the distance of the left camera from the head.
        ("baseline_m = 0.044", "baseline_m = 0.144"),
        ("above_floor_m = 0.07", "above_floor_m = 0.10"),
    ];
    let text = other.iter().fold(text, |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replacen(from, to, 1)
    });
    fixture.write("sensor.toml", text);
    let [pairs, sensor] = ["pairs", "sensor"].map(|name| {
        fixture.run(&format!("record {name}.toml -o {name}.mcap"));
        fixture.path(&format!("{name}.mcap"))
    });
    let bag = fixture.path("bag");
    let modules = "mcap, mcap_protobuf, numpy, rosbags";
    python("sensor_bag.py", modules, [&pairs, &sensor, &bag])?;
    Some((pairs, bag))
}

fn frames(path: &Path, topic: Option<&str>) -> Vec<Frame> {
    let options = SourceOptions {
        truth: topic.map(str::to_owned),
        ..SourceOptions::default()
    };
    let (frames, without) = open_with(path, options).and_then(all_frames).unwrap();
    assert_eq!((frames.len() as u64, without), (FRAMES, 0));
    frames
}

/// The frame with another truth.
fn with_truth(mut frame: Frame, truth: Plane<f32>, kind: TruthKind) -> Frame {
    let mut truth = Truth::exact(truth, None);
    truth.kind = kind;
    frame.truth = Some(truth);
    frame
}

/// The exact truth of the pixels that the sensor measured.
fn sampled(exact: &Frame, sensor: &Frame) -> Frame {
    let [exact, measured] = [exact, sensor].map(|frame| frame.truth.as_ref().unwrap());
    let (width, height) = exact.disparity.size();
    let known = |x, y| match measured.disparity.get(x, y) {
        f32::INFINITY => f32::INFINITY,
        _ => exact.disparity.get(x, y),
    };
    let disparity = Plane::from_fn(width, height, known).unwrap();
    with_truth(sensor.clone(), disparity, measured.kind.clone())
}

/// The scores of all frames' cells against the truths of `frames`.
fn judged(frames: &[Frame], matched: &[DepthGrid]) -> Vec<CellJudgement> {
    let pairs = frames.iter().zip(matched);
    let judged = pairs.map(|(frame, grid)| {
        let truth = TrueCells::new(frame, grid.shape(), CellRule::default()).unwrap();
        truth.judge(frame, grid)
    });
    judged.flatten().collect()
}

/// Cells with truth, and the right, wrong and unknown ones among them, %; missed obstacles.
fn shares(judged: &[CellJudgement]) -> (usize, [f64; 3], usize) {
    let tally = CellTally::from_judgements(judged);
    let counts = [tally.right, tally.wrong, tally.unknown];
    let all: usize = counts.iter().sum();
    let shares = counts.map(|n| 100.0 * n as f64 / all as f64);
    (all, shares, tally.missed)
}

/// The fraction of cells with truth in both that are scored equally.
fn alike(a: &[CellJudgement], b: &[CellJudgement]) -> f64 {
    let known = |j: &CellJudgement| j.verdict != Verdict::NoTruth;
    let both = a.iter().zip(b).filter(|(a, b)| known(a) && known(b));
    let both: Vec<_> = both.collect();
    let equal = both.iter().filter(|(a, b)| a.verdict == b.verdict).count();
    equal as f64 / both.len() as f64
}

/// Each algorithm's grids of the frames.
fn matched(frames: &[Frame]) -> [Vec<DepthGrid>; 3] {
    ALGORITHMS.map(|name| {
        let algorithm: Algorithm = name.parse().unwrap();
        let cells = |frame: &Frame| {
            let pair = RectifiedPair::assume(&frame.pair);
            let output = algorithm.match_pair(pair, frame.rig().copied()).unwrap();
            let map = output.disparity.disparity();
            grid(map, GridSettings::default(), frame.rig())
        };
        frames.iter().map(cells).collect()
    })
}

/// The frame with `points` true pixels in every cell, drawn differently for every seed.
fn thinned(frame: &Frame, points: usize, seed: u64) -> Frame {
    let mut random = fastrand::Rng::with_seed(seed);
    let truth = &frame.truth.as_ref().unwrap().disparity;
    let (width, height) = truth.size();
    let mut disparity = Plane::filled(width, height, f32::INFINITY).unwrap();
    let shape = GridSettings::default().shape();
    for place in shape.iter() {
        let (columns, rows) = shape.pixels(place, truth.size());
        let known = rows.flat_map(|y| columns.clone().map(move |x| (x, y)));
        let known = known.filter(|&(x, y)| truth.get(x, y).is_finite());
        let mut known: Vec<_> = known.collect();
        random.shuffle(&mut known);
        for (x, y) in known.into_iter().take(points) {
            disparity.set(x, y, truth.get(x, y));
        }
    }
    let kind = TruthKind {
        density: MapDensity::Sparse,
        ..TruthKind::default()
    };
    with_truth(frame.clone(), disparity, kind)
}

#[test]
fn some_points_of_a_cell_judge_it_nearly_as_all_do() {
    let fixture = Fixture::new();
    fixture.write_short_arena("pairs.toml", FRAMES);
    fixture.run("record pairs.toml -o pairs.mcap");
    let exact = frames(&fixture.path("pairs.mcap"), None);
    let grids = matched(&exact);
    println!("| points a cell | algorithm | cells | as by all, % | right | wrong | unknown |");
    // Half of the 64 parts of a cell need points.
    for points in [50, 100, 200] {
        let thin = |(i, frame): (usize, &Frame)| thinned(frame, points, i as u64);
        let some: Vec<_> = exact.iter().enumerate().map(thin).collect();
        for (algorithm, grids) in ALGORITHMS.iter().zip(&grids) {
            let (all, some) = (judged(&exact, grids), judged(&some, grids));
            let same = alike(&all, &some);
            let (cells, [right, wrong, unknown], _) = shares(&some);
            let shares = format!("{right:.1} | {wrong:.1} | {unknown:.1}");
            let percent = 100.0 * same;
            println!("| {points} | {algorithm} | {cells} | {percent:.1} | {shares} |");
            assert!(same > 0.93, "{algorithm}: {same} with {points} points");
        }
    }
}

#[test]
fn numbers_from_sensors_equal_those_from_exact_truth() {
    let fixture = Fixture::new();
    let Some((pairs, bag)) = recorded(&fixture) else {
        return;
    };
    let exact = frames(&pairs, None);
    let grids = matched(&exact);
    println!("| truth | algorithm | cells | right | wrong | unknown | missed |");
    println!("|---|---|---:|---:|---:|---:|---:|");
    let line = |name: &str, algorithm: &str, judged: &[CellJudgement]| {
        let (cells, [right, wrong, unknown], missed) = shares(judged);
        println!(
            "| {name} | {algorithm} | {cells} | {right:.1} | {wrong:.1} | {unknown:.1} | {missed} |"
        );
    };
    for (algorithm, grids) in ALGORITHMS.iter().zip(&grids) {
        line("exact", algorithm, &judged(&exact, grids));
    }
    for (topic, density) in [
        ("/cam0/depth32", MapDensity::Dense),
        ("/cam0/depth16", MapDensity::Dense),
        ("/tof/image", MapDensity::Sparse),
        ("/lidar/points", MapDensity::Sparse),
        ("/scan", MapDensity::Sparse),
    ] {
        let sensor = frames(&bag, Some(topic));
        let kind: &TruthKind = &sensor[0].truth.as_ref().unwrap().kind;
        assert_eq!(kind.density, density, "{topic}");
        let samples = exact.iter().zip(&sensor);
        let samples: Vec<_> = samples.map(|(e, s)| sampled(e, s)).collect();
        let (mut pixels, mut off) = (0usize, 0usize);
        for (sample, measured) in samples.iter().zip(&sensor) {
            let [a, b] = [sample, measured].map(|f| &f.truth.as_ref().unwrap().disparity);
            for (a, b) in a.pixels().zip(b.pixels()).filter(|(_, b)| b.is_finite()) {
                pixels += 1;
                off += usize::from((a - b).abs() > 1.0);
            }
        }
        let off = 100.0 * off as f64 / pixels as f64;
        let each = pixels / 40;
        println!("{topic}: {each} pixels a pair, {off:.2} % off by more than 1 px");
        for (algorithm, grids) in ALGORITHMS.iter().zip(&grids) {
            let [all, some, measured] =
                [&exact, &samples, &sensor].map(|frames| judged(frames, grids));
            line(&format!("exact at the pixels of {topic}"), algorithm, &some);
            line(topic, algorithm, &measured);
            let same = alike(&some, &measured);
            if topic == "/scan" {
                // The scan's points are in one of the eight rows of a cell's parts.
                assert_eq!((shares(&some).0, shares(&measured).0), (0, 0));
                continue;
            }
            let exactly = alike(&all, &measured);
            println!("{topic} {algorithm}: alike {same:.4}, with exact {exactly:.4}");
            // If the sensor sees behind the camera's surface, none of its points shows it. With
            // the lidar's few lines fewer cells are scored, so each such cell has more weight.
            let least = match topic {
                "/cam0/depth32" => 1.0,
                "/lidar/points" => 0.95,
                _ => 0.97,
            };
            assert!(same >= least, "{topic} {algorithm}: {same}");
        }
        assert!(off < 4.0, "{topic}: {off} %");
    }
}
