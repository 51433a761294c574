//! Depth that a recording or files have, as an algorithm: the results of `sgm`, published as a
//! camera or a node would, have the cells of `sgm` itself.

use super::bag::{self, CAMERA, Camera, Message, camera_info_of, cdr_in, ros_image_in};
use super::sensor::{cloud_on, tf};
use crate::cli::fixture::{Fixture, assert_says};
use crate::common::python;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use svl::matcher::Algorithm;
use svl::report::{AccuracyRow, CellRow, Row, read_rows};
use svl::score::Verdict;
use svl::source::{Request, open_recording};
use svl::stereo::{Frame, Plane, RectifiedPair, Rig};

const FRAMES: u64 = 12;
/// A disparity of 0 has no depth, so there is none.
const SGM: &str = "sgm:min_disparity=1";
/// Log time minus stamp of depth, in place of the images' 1.2 ms.
const LATENCY_NS: u64 = 41_000_000;

/// The rectified pairs of the arena, with their exact truth.
fn arena(fixture: &Fixture) -> Vec<Frame> {
    fixture.write_made("made", "pairs of recorded depth", |fixture| {
        fixture.write_short_arena("made/pairs.toml", FRAMES);
        fixture.run("record made/pairs.toml -o made/pairs.mcap");
    });
    let path = fixture.path("made/pairs.mcap");
    let opened = open_recording(&Request::new(path.to_str().unwrap()));
    let mut source = opened.unwrap().source;
    std::iter::from_fn(|| source.next().unwrap()).collect()
}

fn stamp(i: usize) -> u64 {
    1_700_000_000_000_000_000 + i as u64 * 100_000_000
}

fn late(message: Message) -> Message {
    Message {
        log_time: message.log_time - 1_234_567 + LATENCY_NS,
        ..message
    }
}

fn floats(plane: &Plane<f32>) -> Vec<u8> {
    plane.pixels().flat_map(f32::to_le_bytes).collect()
}

/// Depths of disparities, 0 for none.
fn depths(map: &Plane<f32>, rig: &Rig) -> Plane<f32> {
    map.map(|d| {
        if d.is_finite() {
            rig.depth_m(d.into()).unwrap_or(0.0) as f32
        } else {
            0.0
        }
    })
}

fn depth(topic: &'static str, frame: &str, i: usize, depth: &Plane<f32>) -> Message {
    let bytes = floats(depth);
    late(ros_image_in(
        frame,
        topic,
        stamp(i),
        depth.size(),
        ("32FC1", &bytes),
    ))
}

fn camera_info(
    topic: &'static str,
    frame: &str,
    i: usize,
    (rig, scale, tx): (&Rig, f64, f64),
    (width, height): (usize, usize),
) -> Message {
    let (cx, cy) = rig.center_px();
    let [cx, cy] = [cx, cy].map(|c| (c + 0.5) * scale - 0.5);
    let cx = if frame == "cam1" { cx + PAD as f64 } else { cx };
    let k = [rig.focal_px() * scale, cx, cy];
    let camera = Camera {
        frame,
        size: (width as u32, height as u32),
        k,
        d: &[0.0; 5],
        p: k,
        tx,
        ..CAMERA
    };
    camera_info_of(topic, stamp(i), &camera)
}

fn disparity_image(i: usize, map: &Plane<f32>, rig: &Rig) -> Message {
    let data = cdr_in("cam", stamp(i), |cdr| {
        (0..2).for_each(|_| cdr.write_u32(0));
        cdr.write_string("cam");
        cdr.write_u32(map.height() as u32);
        cdr.write_u32(map.width() as u32);
        cdr.write_string("32FC1");
        cdr.write_u8(0);
        cdr.write_u32(4 * map.width() as u32);
        cdr.write_bytes(&floats(&map.map(|d| if d.is_finite() { d } else { -1.0 })));
        cdr.write_f32(rig.focal_px() as f32);
        cdr.write_f32(rig.baseline_m() as f32);
        (0..4).for_each(|_| cdr.write_u32(0));
        cdr.write_bool(false);
        [0.0, 80.0, 0.1].into_iter().for_each(|v| cdr.write_f32(v));
    });
    Message::cdr(
        "/disparity",
        "stereo_msgs/msg/DisparityImage",
        stamp(i),
        data,
    )
}

/// The points of a depth image, in the left camera's frame.
fn cloud(i: usize, depth: &Plane<f32>, rig: &Rig) -> Message {
    let (focal, (cx, cy)) = (rig.focal_px(), rig.center_px());
    let (width, height) = depth.size();
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let points = pixels.map(|(x, y)| {
        let z = f64::from(depth.get(x, y));
        let z = if z > 0.0 { z } else { f64::NAN };
        [(x as f64 - cx) / focal * z, (y as f64 - cy) / focal * z, z].map(|v| v as f32)
    });
    cloud_on("/points", "cam", stamp(i), &points.collect::<Vec<_>>())
}

/// Distance of the camera beside the left one, as that of a RealSense's colour camera. Farther
/// away, more of the scene is hidden from it.
const SHIFT_M: f64 = 0.015;
/// Columns that the other camera sees to the left of the left camera's image.
const PAD: usize = 100;

/// The depth image of a camera `shift_m` to the right of the left one.
fn seen_from(map: &Plane<f32>, rig: &Rig, shift_m: f64) -> Plane<f32> {
    let (width, height) = map.size();
    let mut seen = Plane::filled(width + PAD, height, 0.0_f32).unwrap();
    for (y, row) in map.rows().enumerate() {
        for (x, &d) in row.iter().enumerate() {
            let Some(z) = rig.depth_m(d.into()).filter(|_| d.is_finite()) else {
                continue;
            };
            let at = (x + PAD) as f64 - rig.focal_px() * shift_m / z;
            if at >= 0.0 {
                let place = at.round() as usize;
                let known = seen.get(place, y);
                if known == 0.0 || (z as f32) < known {
                    seen.set(place, y, z as f32);
                }
            }
        }
    }
    seen
}

/// Every second pixel of every second row.
fn halved(map: &Plane<f32>) -> Plane<f32> {
    let (width, height) = map.size();
    Plane::from_fn(width / 2, height / 2, |x, y| map.get(2 * x, 2 * y)).unwrap()
}

/// A bag of rectified pairs and of the results of `sgm` in all forms; `/half_rate` has those of
/// every other pair.
fn write_bag(folder: &Path, frames: &[Frame]) {
    let sgm: Algorithm = SGM.parse().unwrap();
    let mut messages = vec![tf("/tf_static", &[("cam", "cam1", [SHIFT_M, 0.0, 0.0])])];
    for (i, frame) in frames.iter().enumerate() {
        let rig = frame.rig().unwrap();
        let size = frame.pair.size();
        let images =
            [frame.pair.left(), frame.pair.right()].map(|g| g.pixels().collect::<Vec<u8>>());
        let fb = rig.focal_px() * rig.baseline_m();
        messages.extend([
            camera_info("/left/camera_info", "cam", i, (rig, 1.0, 0.0), size),
            camera_info("/right/camera_info", "cam", i, (rig, 1.0, -fb), size),
            ros_image_in(
                "cam",
                "/left/image_rect",
                stamp(i),
                size,
                ("mono8", &images[0]),
            ),
            ros_image_in(
                "cam",
                "/right/image_rect",
                stamp(i),
                size,
                ("mono8", &images[1]),
            ),
        ]);
        let pair = RectifiedPair::assume(&frame.pair);
        let output = sgm.match_pair(pair, Some(*rig)).unwrap();
        let map = output.disparity.disparity();
        let own = depths(map, rig);
        let truth = depths(&frame.truth.as_ref().unwrap().disparity, rig);
        let (small, wide) = ((size.0 / 2, size.1 / 2), (size.0 + PAD, size.1));
        messages.extend([
            depth("/truth", "cam", i, &truth),
            depth("/depth", "cam", i, &own),
            disparity_image(i, map, rig),
            cloud(i, &own, rig),
            camera_info("/moved/camera_info", "cam1", i, (rig, 1.0, 0.0), wide),
            depth("/moved/depth", "cam1", i, &seen_from(map, rig, SHIFT_M)),
            camera_info("/moved_truth/camera_info", "cam1", i, (rig, 1.0, 0.0), wide),
            depth(
                "/moved_truth/depth",
                "cam1",
                i,
                &seen_from(&frame.truth.as_ref().unwrap().disparity, rig, SHIFT_M),
            ),
            camera_info("/half/camera_info", "cam", i, (rig, 0.5, 0.0), small),
            depth("/half/depth", "cam", i, &halved(&truth)),
        ]);
        if i % 2 == 0 {
            messages.push(depth("/half_rate", "cam", i, &own));
        }
    }
    bag::write(folder, &messages);
}

/// The cells of an algorithm in a report, by pair, column and row.
fn cells(report: &Path, algorithm: &str) -> BTreeMap<(u64, u32, u32), CellRow> {
    let rows: Vec<CellRow> = read_rows(&report.join("cells.csv")).unwrap();
    let own = rows.into_iter().filter(|row| row.algorithm == algorithm);
    own.map(|row| ((row.sequence, row.column, row.row), row))
        .collect()
}

/// Fraction of the cells that are known alike, at distances that differ by at most `tolerance`, of
/// those of which the second has at least that fraction of the pixels of the first.
fn equal_share(report: &Path, [a, b]: [&str; 2], (tolerance, seen): (f64, f64)) -> f64 {
    let [a, b] = [a, b].map(|name| cells(report, name));
    assert!(!a.is_empty() && a.len() == b.len());
    let pairs = a.iter().map(|(place, cell)| (cell, &b[place]));
    let pairs = pairs.filter(|(a, b)| b.valid_share >= seen * a.valid_share);
    let is_equal = |(a, b): &(&CellRow, &CellRow)| match (a.distance_m, b.distance_m) {
        (None, None) => true,
        (Some(a), Some(b)) => (a - b).abs() <= tolerance * a,
        _ => false,
    };
    let (all, equal) = (pairs.clone().count(), pairs.filter(is_equal).count());
    assert!(4 * all > 3 * a.len(), "{all}");
    equal as f64 / all as f64
}

fn fixture() -> Fixture {
    let fixture = Fixture::new();
    fixture.write_made("bag", "bag of recorded depth", |fixture| {
        let frames = arena(fixture);
        std::fs::create_dir_all(fixture.path("bag")).unwrap();
        write_bag(&fixture.path("bag"), &frames);
    });
    fixture
}

#[test]
fn published_results_have_the_cells_of_the_matcher() {
    let fixture = fixture();
    fixture.run(
        "score bag/bag.mcap --truth /truth --algo own=sgm:min_disparity=1 \
         --algo depth=topic:/depth --algo disparity=topic:/disparity --algo cloud=topic:/points \
         --algo moved=topic:/moved/depth --algo half=topic:/half/depth \
         --algo truth --algo moved_truth=topic:/moved_truth/depth --rerun none -o rep -q",
    );
    let report = fixture.path("rep");
    // The other camera does not see a part of some cells, and noise hides what is behind it.
    for (pair, limits, least) in [
        (["own", "depth"], (1e-5, 0.0), 0.999),
        (["own", "disparity"], (1e-5, 0.0), 0.999),
        (["own", "cloud"], (1e-5, 0.0), 0.999),
        (["truth", "half"], (0.03, 0.0), 0.97),
        (["truth", "moved_truth"], (0.03, 0.9), 0.99),
        (["own", "moved"], (0.03, 0.9), 0.95),
    ] {
        let share = equal_share(&report, pair, limits);
        println!("{pair:?}: {share}");
        assert!(share >= least, "{pair:?}: {share}");
    }
    // Nothing was matched: no times, in no table.
    let rows: Vec<Row> = read_rows(&report.join("rows.csv")).unwrap();
    for row in rows {
        let is_matched = ["own", "truth"].contains(&row.algorithm.as_str());
        let times = [row.total_us, row.matching_us, row.smoothing_us];
        assert_eq!(
            times.map(|t| t.is_some()),
            [is_matched; 3],
            "{}",
            row.algorithm
        );
    }
    let summary = fixture.json_file("rep/summary.json");
    let delay = &summary["latency"][0];
    assert_eq!(delay["topic"], "/depth");
    assert_eq!(delay["topic_ms"], serde_json::json!([41.0, 41.0]));
    assert_eq!(delay["images_ms"], serde_json::json!([1.234567, 1.234567]));
}

/// Infinity is an answer in the depths of any camera; in disparities and in a truth it is unknown.
#[test]
fn infinity_is_an_answer_of_depths_alone() {
    let fixture = Fixture::new();
    let frames = arena(&fixture);
    let (frame, rig) = (&frames[0], frames[0].rig().unwrap());
    let size = frame.pair.size();
    let fb = rig.focal_px() * rig.baseline_m();
    let images = [frame.pair.left(), frame.pair.right()].map(|g| g.pixels().collect::<Vec<u8>>());
    let wide = (size.0 + PAD, size.1);
    let all = |size: (usize, usize), z| Plane::filled(size.0, size.1, z).unwrap();
    let messages = [
        tf("/tf_static", &[("cam", "cam1", [SHIFT_M, 0.0, 0.0])]),
        camera_info("/left/camera_info", "cam", 0, (rig, 1.0, 0.0), size),
        camera_info("/right/camera_info", "cam", 0, (rig, 1.0, -fb), size),
        camera_info("/moved/camera_info", "cam1", 0, (rig, 1.0, 0.0), wide),
        ros_image_in(
            "cam",
            "/left/image_rect",
            stamp(0),
            size,
            ("mono8", &images[0]),
        ),
        ros_image_in(
            "cam",
            "/right/image_rect",
            stamp(0),
            size,
            ("mono8", &images[1]),
        ),
        depth("/far", "cam", 0, &all(size, f32::INFINITY)),
        depth("/none", "cam", 0, &all(size, f32::NAN)),
        depth("/moved/depth", "cam1", 0, &all(wide, f32::INFINITY)),
    ];
    std::fs::create_dir_all(fixture.path("bag")).unwrap();
    bag::write(&fixture.path("bag"), &messages);
    for (name, value) in [("inf", f32::INFINITY), ("nan", f32::NAN), ("zero", 0.0)] {
        fixture.write(&format!("{name}/0000.pfm"), pfm(value));
    }
    let states = |algo: &str| -> BTreeSet<String> {
        fixture.run(&format!(
            "score bag/bag.mcap --algo a={algo} --rerun none -o rep -q --force"
        ));
        let rows: Vec<CellRow> = read_rows(&fixture.path("rep/cells.csv")).unwrap();
        let state = |row: &CellRow| row.state.map_or("", |state| state.name()).to_owned();
        rows.iter().map(state).collect()
    };
    for (algo, expected) in [
        ("topic:/far", "far"),
        ("topic:/moved/depth", "far"),
        ("topic:/none", "unknown"),
        ("files:inf/*.pfm,unit=1", "far"),
        ("files:nan/*.pfm,unit=1", "unknown"),
        ("files:zero/*.pfm,unit=1", "unknown"),
        ("files:inf/*.pfm", "unknown"),
        ("files:nan/*.pfm", "unknown"),
        ("files:zero/*.pfm", "far"),
    ] {
        assert_eq!(
            states(algo),
            BTreeSet::from([expected.to_owned()]),
            "{algo}"
        );
    }
    let none = "nothing was compared: no cell has enough of the truth /far";
    fixture
        .svl("score bag/bag.mcap --truth /far --algo sgm --rerun none -o truth -q")
        .failed(4, &[none]);
    let rows: Vec<CellRow> = read_rows(&fixture.path("truth/cells.csv")).unwrap();
    assert!(rows.iter().all(|row| row.verdict == Verdict::NoTruth));
}

#[test]
fn each_map_is_the_answer_to_one_pair() {
    let fixture = fixture();
    // Within the limit of a neighbour, too.
    let line = "score bag/bag.mcap --truth /truth --algo slow=topic:/half_rate,skew_ms=150 \
                --rerun none -q -o";
    let ran = fixture.svl(&format!("{line} rep"));
    assert_eq!(ran.code, Some(4), "{}", ran.stderr);
    let rows: Vec<Row> = read_rows(&fixture.path("rep/rows.csv")).unwrap();
    let answered: Vec<_> = rows.iter().map(|row| row.sequence).collect();
    assert_eq!(answered, (0..FRAMES).step_by(2).collect::<Vec<_>>());
    let failures = fixture.text("rep/failures.csv");
    assert_eq!(failures.lines().count() as u64, 1 + FRAMES / 2);
    assert!(failures.contains("no message of /half_rate belongs to this pair"));
    fixture.run(&format!("{line} allowed --allow-loss 50%"));
}

#[test]
fn perturbed_pairs_are_without_recorded_maps() {
    let fixture = fixture();
    let ran = fixture.svl(
        "score bag/bag.mcap --truth /truth --algo bm --algo depth=topic:/depth \
         --stress row_offset=1 --rerun none -o rep",
    );
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    assert!(
        ran.stderr
            .contains("depth: computed before, so perturbed pairs"),
        "{}",
        ran.stderr
    );
    let rows: Vec<Row> = read_rows(&fixture.path("rep/rows.csv")).unwrap();
    let perturbed = rows.iter().filter(|row| row.stress.is_some());
    assert!(perturbed.clone().count() > 0 && perturbed.clone().all(|row| row.algorithm == "bm"));
}

#[test]
fn a_map_that_is_none_is_one_line() {
    let fixture = fixture();
    fixture.fails(
        "
        score bag/bag.mcap --algo topic => 2: name the topic, as topic:/camera/depth
        score bag/bag.mcap --algo z=topic:/dept => 1: no such topic | did you mean '/depth'
        score bag/bag.mcap --algo z=topic:/left/image_rect => 1: 'mono8' | depths are 16UC1
        score bag/bag.mcap --truth /depth --algo z=topic:/depth => 2: is the truth, too
        score bag/bag.mcap --algo z=topic:/depth,skew=3 => 2: skew_ms
        score arena --algo z=topic:/depth => 2: topic:/depth | the arena has not
        score bag/bag.mcap --reference topic:/depth => 2: name it with --truth
        score bag/bag.mcap --algo z=files:'out.pfm' => 2: one * for the pair's name
        score bag/bag.mcap --algo z=files:'no/*.pfm' => 1: files:'no/*.pfm' | no such file
        match a.png b.png --algo z=topic:/depth -o o.pfm => 2: matches no images
        bench --algo z=topic:/depth => 2: matches no images
        ",
    );
}

/// Depth whose stamps are of another clock: the offset is named, and never applied.
#[test]
fn a_clock_that_differs_is_named_with_its_offset() {
    let fixture = Fixture::new();
    let frames = arena(&fixture);
    let rig = frames[0].rig().unwrap();
    let size = frames[0].pair.size();
    let own = Plane::filled(size.0, size.1, 1.0_f32).unwrap();
    let fb = rig.focal_px() * rig.baseline_m();
    let shifted = |i: usize, seconds: i64| {
        let message = depth("/depth", "cam", i, &own);
        let mut data = message.data.clone();
        let own = u32::from_le_bytes(*data[4..].first_chunk().unwrap());
        let other = u32::try_from(i64::from(own) + seconds).unwrap();
        data[4..8].copy_from_slice(&other.to_le_bytes());
        message.with(data)
    };
    for (seconds, words) in [(3600, "3599.960 s ahead"), (-60, "60.040 s behind")] {
        let pairs = (0..3).flat_map(|i| {
            let pixels: Vec<u8> = frames[i].pair.left().pixels().collect();
            let image = |topic| ros_image_in("cam", topic, stamp(i), size, ("mono8", &pixels));
            [
                camera_info("/left/camera_info", "cam", i, (rig, 1.0, 0.0), size),
                camera_info("/right/camera_info", "cam", i, (rig, 1.0, -fb), size),
                image("/left/image_rect"),
                image("/right/image_rect"),
                shifted(i, seconds),
            ]
        });
        bag::write(&fixture.path(""), &pairs.collect::<Vec<_>>());
        let expected = ["topic:/depth", "stamps are from another time", words];
        fixture
            .svl("score bag.mcap --algo z=topic:/depth --rerun none -o rep")
            .failed(1, &expected);
    }
}

/// The lines of the page run in their order, with the limits that it names.
#[test]
fn the_page_of_camera_depth_is_followed() {
    let fixture = fixture();
    let page = crate::common::repository().join("docs/camera-depth.md");
    let page = std::fs::read_to_string(page).unwrap();
    let block = |start: &str| {
        let (_, rest) = page.split_once(start).unwrap();
        rest.split_once("```").unwrap().0
    };
    let lines: Vec<_> = block("```sh\n").lines().collect();
    assert_eq!(lines.len(), 5);
    for line in lines {
        if line.contains("--gate") {
            let text = fixture.text("depth.toml");
            fixture.write("depth.toml", text + block("```toml"));
        }
        let line = line.split(" #").next().unwrap();
        let line = line.replace("drive.mcap", "bag/bag.mcap");
        let line = line.replace("/zed/depth", "/depth");
        let line = line.replace("/lidar/points", "/truth");
        let ran = fixture.svl(line.strip_prefix("svl ").unwrap());
        // The arena's depth by `sgm` is worse than the limits.
        let expected = if line.contains("--gate") { 3 } else { 0 };
        assert_eq!(
            ran.code,
            Some(expected),
            "{line}: {}{}",
            ran.stdout,
            ran.stderr
        );
    }
}

/// The maps of a matcher, written to files by `svl match`, have its cells.
#[test]
fn maps_in_files_have_the_cells_of_the_matcher() {
    let fixture = Fixture::new();
    std::fs::create_dir(fixture.path("out")).unwrap();
    std::fs::create_dir(fixture.path("png")).unwrap();
    for (name, shift) in [("a", 3), ("b", 5), ("c", 8)] {
        let [left, right] = ["left", "right"].map(|side| format!("pairs/{side}/{name}.pgm"));
        fixture.write_pair(&left, &right, (120, 90), shift);
        for out in ["out/{}.pfm", "png/{}.png"] {
            let out = out.replace("{}", name);
            fixture.run(&format!("match {left} {right} --algo sgm -o {out}"));
        }
    }
    fixture.run(
        "score pairs --algo sgm --algo pfm=files:out/*.pfm --algo png=files:'png/*.png' \
         --algo steps=files:png/*.png,disparity=128 --rerun none -o rep -q",
    );
    let medians = |name: &str| -> Vec<_> {
        let cells = cells(&fixture.path("rep"), name).into_values();
        cells.map(|cell| cell.median_px).collect()
    };
    let own = medians("sgm");
    assert!(own.iter().flatten().count() > 30);
    assert_eq!(medians("pfm"), own);
    let close = |(a, b): (&Option<f64>, &Option<f64>), factor: f64| {
        a.zip(*b)
            .map_or(a == b, |(a, b)| (a * factor - b).abs() <= factor / 256.0)
    };
    assert!(own.iter().zip(&medians("png")).all(|pair| close(pair, 1.0)));
    assert!(
        own.iter()
            .zip(&medians("steps"))
            .all(|pair| close(pair, 2.0))
    );
    fixture.write_pair("other/left/a.pgm", "other/right/a.pgm", (120, 90), 3);
    fixture.fails("score pairs other --algo z=files:out/*.pfm => 2: of one run | name one");
    // Other maps in the files are other results.
    fixture.run("match pairs/left/a.pgm pairs/right/a.pgm --algo blind -o out/a.pfm --force");
    fixture.run(
        "score pairs --algo sgm --algo pfm=files:out/*.pfm --algo png=files:'png/*.png' \
         --algo steps=files:png/*.png,disparity=128 --rerun none -o rep -q",
    );
    assert!(medians("pfm").iter().flatten().count() < own.iter().flatten().count());
    assert_eq!(medians("sgm"), own);
}

/// A PFM of 320 x 240 pixels, all of one disparity.
fn pfm(disparity: f32) -> Vec<u8> {
    [
        b"Pf\n320 240\n-1\n",
        &disparity.to_le_bytes().repeat(320 * 240)[..],
    ]
    .concat()
}

#[test]
fn files_belong_to_pairs_without_a_name_by_their_numbers() {
    let fixture = fixture();
    let line = "score bag/bag.mcap --truth /truth --algo n=files:out/*.pfm --rerun none -o rep -q";
    for i in 0..FRAMES {
        fixture.write(&format!("out/{i:04}.pfm"), pfm(20.0 + i as f32));
    }
    fixture.run(line);
    let medians = |report: &str| -> Vec<_> {
        let cells = cells(&fixture.path(report), "n").into_iter();
        cells
            .filter_map(|((i, ..), cell)| Some((i, cell.median_px?)))
            .collect()
    };
    let numbered = medians("rep");
    assert_eq!(numbered.len() as u64, FRAMES * 15);
    assert!(numbered.iter().all(|(i, px)| *px == 20.0 + *i as f64));
    // Numbers from 1 to that of the pairs begin with the first pair, in a range of them, too.
    std::fs::rename(fixture.path("out/0000.pfm"), fixture.path("out/0012.pfm")).unwrap();
    let ran = fixture.svl(&line.replace(" -q", " --every 2 --force"));
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    assert_says(
        &ran.stderr,
        &[
            "files:'out/*.pfm': numbers 1 to 12 for pairs 0 to 11: 1 is pair 0",
            "files:'out/*.pfm': 6 files used by no pair, the first is ./out/0002.pfm",
        ],
    );
    let shifted = medians("rep");
    assert_eq!(shifted.len(), 6 * 15);
    assert!(shifted.iter().all(|(i, px)| *px == 21.0 + *i as f64));
    std::fs::rename(fixture.path("out/0012.pfm"), fixture.path("out/0030.pfm")).unwrap();
    let ran = fixture.svl(&line.replace(" -q", " --force"));
    assert_eq!(ran.code, Some(4));
    assert_says(
        &ran.stderr,
        &[
            "numbers 1 to 30 for pairs 0 to 11 are read as the pairs' own, so that some have none; \
             if 1 is pair 0, number the files from 0",
            "1 file used by no pair, the first is ./out/0030.pfm; 1 pair without one",
        ],
    );
    // The last map is missing, or the first: both are said.
    std::fs::remove_file(fixture.path("out/0030.pfm")).unwrap();
    let ran = fixture.svl(&line.replace(" -q", " --force"));
    let words = "numbers 1 to 11 for pairs 0 to 11 are read as the pairs' own, so that some have";
    assert_says(&ran.stderr, &[words]);
    fixture.write("out/3.pfm", pfm(9.0));
    fixture
        .svl(line)
        .failed(1, &["have one number; leave one of them"]);
}

#[test]
fn files_of_a_part_of_a_recording_have_its_numbers_or_count_its_pairs() {
    let fixture = Fixture::new();
    arena(&fixture);
    fixture.run("record made/pairs.mcap -o part.mcap --from 0.5 -q");
    let opened = open_recording(&Request::new(fixture.path("part.mcap").to_str().unwrap()));
    let mut source = opened.unwrap().source;
    let sequences = std::iter::from_fn(|| source.next().unwrap()).map(|frame| frame.sequence);
    let sequences: Vec<_> = sequences.collect();
    let (start, end) = (sequences[0], sequences[sequences.len() - 1]);
    assert!(start > 1 && end > start + 2, "{sequences:?}");
    for first in [start, 0, 1, start + 1, 100] {
        let folder = format!("m{first}");
        for (i, sequence) in sequences.iter().enumerate() {
            let name = format!("{folder}/{}.pfm", first + i as u64);
            fixture.write(&name, pfm(*sequence as f32));
        }
        let last = first + end - start;
        let ran = fixture.svl(&format!(
            "score part.mcap --algo n=files:{folder}/*.pfm --rerun none -o r{first}"
        ));
        assert_eq!(ran.code, Some(0), "{}", ran.stderr);
        let words = format!("numbers {first} to {last} for pairs {start} to {end}: {first} is");
        let count = usize::from(first != start);
        assert_eq!(ran.stderr.matches(&words).count(), count, "{}", ran.stderr);
        assert!(!ran.stderr.contains("used by no pair"), "{}", ran.stderr);
        let report = fixture.path(&format!("r{first}"));
        for ((i, ..), cell) in cells(&report, "n") {
            assert_eq!(
                cell.median_px,
                Some(i as f64).filter(|px| *px > 0.0),
                "{first}"
            );
        }
    }
}

#[test]
fn errors_by_distance_noise_and_flicker_are_those_of_numpy() {
    let fixture = fixture();
    fixture.run(
        "score bag/bag.mcap --truth /truth --algo sgm --algo bm --near 0.4 --tolerance 5% \
         --cells 8x4 --rerun none -o rep -q",
    );
    let rows: Vec<AccuracyRow> = read_rows(&fixture.path("rep/accuracy.csv")).unwrap();
    assert!(rows.len() > 6 && rows.iter().any(|row| row.noise_m.is_some()));
    let known = rows
        .iter()
        .filter(|row| row.from_m == 0.0 && row.to_m.is_none());
    // Two algorithms, each of obstacles and of all cells: nothing tells floor.
    assert_eq!(known.count(), 4);
    let Some(output) = python("accuracy.py", "numpy", [fixture.path("rep")]) else {
        return;
    };
    let output = String::from_utf8(output).unwrap();
    assert!(
        output.ends_with(&format!("{} rows equal\n", rows.len())),
        "{output}"
    );
}
