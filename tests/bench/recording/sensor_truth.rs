//! Numbers from other sensors equal those from exact truth, up to the effect of sampling.
//!
//! The arena is recorded twice: its pairs, and the depths of a camera 5 cm beside and 3 cm above
//! the left one. `tests/python/sensor_bag.py` makes a ROS 2 bag of both. Each sensor's truth is
//! compared with the exact one, and with the exact one of only the pixels that the sensor measured:
//! the first difference is due to sampling, the second to errors of svl.

use crate::cli::fixture::Fixture;
use crate::common::python;
use std::path::{Path, PathBuf};
use svl::depth::{GridSettings, grid};
use svl::matcher::Algorithm;
use svl::scenario::SourceOptions;
use svl::score::{CellJudgement, CellTally, TrueCells, Verdict};
use svl::source::{Request, open_recording};
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
    for name in ["pairs", "sensor"] {
        let (from, to) = (format!("{name}.toml"), format!("{name}.mcap"));
        fixture.svl(&["record", &from, "-o", &to]).done();
    }
    let bag = fixture.path("bag");
    let recordings = ["pairs.mcap", "sensor.mcap"].map(|name| fixture.path(name));
    let [pairs, sensor] = &recordings;
    python(
        "sensor_bag.py",
        "mcap, mcap_protobuf, numpy, rosbags",
        [pairs, sensor, &bag],
    )?;
    Some((fixture.path("pairs.mcap"), bag))
}

fn frames(path: &Path, topic: Option<&str>) -> Vec<Frame> {
    let mut source = open_recording(&Request {
        options: SourceOptions {
            truth: topic.map(str::to_owned),
            ..SourceOptions::default()
        },
        ..Request::new(path.to_str().unwrap())
    })
    .unwrap()
    .source;
    let frames: Vec<_> = std::iter::from_fn(|| source.next().unwrap()).collect();
    assert_eq!(
        (frames.len() as u64, source.finish(FRAMES).without_truth),
        (FRAMES, 0)
    );
    frames
}

/// The exact truth of the pixels that the sensor measured.
fn sampled(exact: &Frame, sensor: &Frame) -> Frame {
    let (exact_truth, measured) = (
        exact.truth.as_ref().unwrap(),
        sensor.truth.as_ref().unwrap(),
    );
    let mut disparity = exact_truth.disparity.clone();
    for y in 0..disparity.height() {
        let pixels = disparity
            .row_mut(y)
            .iter_mut()
            .zip(measured.disparity.row(y));
        pixels
            .filter(|(_, m)| m.is_infinite())
            .for_each(|(d, _)| *d = f32::INFINITY);
    }
    Frame {
        truth: Some(Truth {
            kind: measured.kind.clone(),
            ..Truth::exact(disparity, None)
        }),
        ..sensor.clone()
    }
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
    (
        all,
        counts.map(|n| 100.0 * n as f64 / all as f64),
        tally.missed,
    )
}

/// The fraction of cells with truth in both that are scored equally.
fn alike(a: &[CellJudgement], b: &[CellJudgement]) -> f64 {
    let known = |j: &CellJudgement| j.verdict != Verdict::NoTruth;
    let both: Vec<_> = a
        .iter()
        .zip(b)
        .filter(|(a, b)| known(a) && known(b))
        .collect();
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
        let mut known: Vec<_> = known
            .filter(|&(x, y)| truth.get(x, y).is_finite())
            .collect();
        random.shuffle(&mut known);
        for (x, y) in known.into_iter().take(points) {
            disparity.set(x, y, truth.get(x, y));
        }
    }
    let kind = TruthKind {
        density: MapDensity::Sparse,
        ..TruthKind::default()
    };
    Frame {
        truth: Some(Truth {
            kind,
            ..Truth::exact(disparity, None)
        }),
        ..frame.clone()
    }
}

#[test]
fn some_points_of_a_cell_judge_it_nearly_as_all_do() {
    let fixture = Fixture::new();
    fixture.write_short_arena("pairs.toml", FRAMES);
    fixture
        .svl(&["record", "pairs.toml", "-o", "pairs.mcap"])
        .done();
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
        let samples: Vec<_> = exact
            .iter()
            .zip(&sensor)
            .map(|(e, s)| sampled(e, s))
            .collect();
        let (mut pixels, mut off) = (0usize, 0usize);
        for (sample, measured) in samples.iter().zip(&sensor) {
            let [a, b] = [sample, measured].map(|f| &f.truth.as_ref().unwrap().disparity);
            for (a, b) in a.pixels().zip(b.pixels()).filter(|(_, b)| b.is_finite()) {
                pixels += 1;
                off += usize::from((a - b).abs() > 1.0);
            }
        }
        let off = 100.0 * off as f64 / pixels as f64;
        println!(
            "{topic}: {} pixels a pair, {off:.2} % off by more than 1 px",
            pixels / 40
        );
        for (algorithm, grids) in ALGORITHMS.iter().zip(&grids) {
            let (all, some, measured) = (
                judged(&exact, grids),
                judged(&samples, grids),
                judged(&sensor, grids),
            );
            line(&format!("exact at the pixels of {topic}"), algorithm, &some);
            line(topic, algorithm, &measured);
            let same = alike(&some, &measured);
            if topic == "/scan" {
                // The scan's points are in one of the eight rows of a cell's parts.
                assert_eq!((shares(&some).0, shares(&measured).0), (0, 0));
                continue;
            }
            println!(
                "{topic} {algorithm}: alike {same:.4}, with exact {:.4}",
                alike(&all, &measured)
            );
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
