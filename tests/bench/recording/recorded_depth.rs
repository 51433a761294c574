//! Depth that a recording or files have, as an algorithm: the results of `sgm`, published as a
//! camera or a node would, have the cells of `sgm` itself.

use super::bag::{self, Bag, CAMERA, Camera, Message, Stereo, camera_info_of, float_image};
use super::frames::intact;
use super::says::Says;
use crate::cli::fixture::Fixture;
use crate::common::python;
use std::collections::{BTreeMap, BTreeSet};
use svl::matcher::Algorithm;
use svl::report::{AccuracyRow, CellRow, Record, Row, read_rows};
use svl::score::{AreaChoice, Verdict};
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
    intact(&fixture.path("made/pairs.mcap"))
}

fn stamp(i: usize) -> u64 {
    1_700_000_000_000_000_000 + i as u64 * 100_000_000
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
    float_image(frame, topic, stamp(i), depth).logged(stamp(i) + LATENCY_NS)
}

/// The left camera with a rig's pixels, `scale` times as many.
fn camera(rig: &Rig, scale: f64, (width, height): (usize, usize)) -> Camera<'static> {
    let (cx, cy) = rig.center_px();
    let [cx, cy] = [cx, cy].map(|c| (c + 0.5) * scale - 0.5);
    let k = [rig.focal_px() * scale, cx, cy];
    Camera {
        size: (width as u32, height as u32),
        k,
        d: &[0.0; 5],
        p: k,
        ..CAMERA
    }
}

/// The camera beside the left one, which sees more columns.
fn moved_camera(rig: &Rig, (width, height): (usize, usize)) -> Camera<'static> {
    let mut camera = camera(rig, 1.0, (width + PAD, height));
    camera.frame = "cam1";
    [camera.k[1], camera.p[1]] = [camera.k[1] + PAD as f64; 2];
    camera
}

/// The cameras of a frame.
fn stereo(frame: &Frame) -> Stereo<'static> {
    let (rig, size) = (frame.rig().unwrap(), frame.pair.size());
    let cameras = [camera(rig, 1.0, size); 2];
    let stereo = Stereo {
        images: ["/left/image_rect", "/right/image_rect"],
        infos: ["/left/camera_info", "/right/camera_info"],
        size,
        cameras,
    };
    stereo.offsets([0.0, -rig.focal_px() * rig.baseline_m()])
}

/// Calibrations and images of frame `i`.
fn pair(i: usize, frame: &Frame) -> Vec<Message> {
    stereo(frame).record(std::slice::from_ref(frame), |_| stamp(i))
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
    bag::cloud("cam", stamp(i), &points.collect::<Vec<_>>())
}

/// Distance of the camera beside the left one, as that of a RealSense's colour camera. Farther
/// away, more of the scene is hidden from it.
const SHIFT_M: f64 = 0.015;
const MOVED: [(&str, &str, [f64; 3]); 1] = [("cam", "cam1", [SHIFT_M, 0.0, 0.0])];
/// Columns that the other camera sees to the left of the left camera's image.
const PAD: usize = 100;

/// The depth image of a camera `shift_m` to the right of the left one.
fn seen_from(map: &Plane<f32>, rig: &Rig, shift_m: f64) -> Plane<f32> {
    let (width, height) = map.size();
    let mut seen = Plane::filled(width + PAD, height, 0.0_f32).unwrap();
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        let d = map.get(x, y);
        let Some(z) = rig.depth_m(d.into()).filter(|_| d.is_finite()) else {
            continue;
        };
        let at = (x + PAD) as f64 - rig.focal_px() * shift_m / z;
        let (place, z) = (at.round() as usize, z as f32);
        if at >= 0.0 && (seen.get(place, y) == 0.0 || z < seen.get(place, y)) {
            seen.set(place, y, z);
        }
    }
    seen
}

/// A bag of rectified pairs and of the results of `sgm` in all forms; `/half_rate` has those of
/// every other pair.
fn bag_of(frames: &[Frame]) -> Bag {
    let sgm: Algorithm = SGM.parse().unwrap();
    let mut bag = Bag::default().tf(&MOVED);
    for (i, frame) in frames.iter().enumerate() {
        let (rig, size) = (frame.rig().unwrap(), frame.pair.size());
        let info = |topic, camera| camera_info_of(topic, stamp(i), &camera);
        let assumed = RectifiedPair::assume(&frame.pair);
        let output = sgm.match_pair(assumed, Some(*rig)).unwrap();
        let map = output.disparity.disparity();
        let exact = &frame.truth.as_ref().unwrap().disparity;
        let (own, truth) = (depths(map, rig), depths(exact, rig));
        let known = map.map(|d| if d.is_finite() { d } else { -1.0 });
        let [focal, baseline] = [rig.focal_px(), rig.baseline_m()].map(|v| v as f32);
        let seen = |map| seen_from(map, rig, SHIFT_M);
        // Every second pixel of every second row.
        let half = (size.0 / 2, size.1 / 2);
        let halved = Plane::from_fn(half.0, half.1, |x, y| truth.get(2 * x, 2 * y)).unwrap();
        bag = bag.and(pair(i, frame)).and([
            depth("/truth", "cam", i, &truth),
            depth("/depth", "cam", i, &own),
            bag::disparity_image(stamp(i), &known, [focal, baseline, 0.0, 80.0]),
            cloud(i, &own, rig),
            info("/moved/camera_info", moved_camera(rig, size)),
            depth("/moved/depth", "cam1", i, &seen(map)),
            info("/moved_truth/camera_info", moved_camera(rig, size)),
            depth("/moved_truth/depth", "cam1", i, &seen(exact)),
            info("/half/camera_info", camera(rig, 0.5, half)),
            depth("/half/depth", "cam", i, &halved),
        ]);
        bag = bag.and((i % 2 == 0).then(|| depth("/half_rate", "cam", i, &own)));
    }
    bag
}

/// The rows of a table of a report.
fn rows<R: Record>(fixture: &Fixture, table: &str) -> Vec<R> {
    read_rows(&fixture.path(table)).unwrap()
}

/// The cells of an algorithm in a report, by pair, column and row.
fn cells(fixture: &Fixture, report: &str, algorithm: &str) -> BTreeMap<(u64, u32, u32), CellRow> {
    let rows: Vec<CellRow> = rows(fixture, &format!("{report}/cells.csv"));
    let own = rows.into_iter().filter(|row| row.algorithm == algorithm);
    own.map(|row| ((row.sequence, row.column, row.row), row))
        .collect()
}

/// Fraction of the cells that are known alike, at distances that differ by at most `tolerance`, of
/// those of which the second has at least that fraction of the pixels of the first.
fn equal_share(fixture: &Fixture, [a, b]: [&str; 2], (tolerance, seen): (f64, f64)) -> f64 {
    let [a, b] = [a, b].map(|name| cells(fixture, "rep", name));
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

/// A fixture with `bag.mcap`.
fn fixture() -> Fixture {
    let fixture = Fixture::new();
    fixture.write_made("bag", "bag of recorded depth", |fixture| {
        let frames = arena(fixture);
        std::fs::create_dir_all(fixture.path("bag")).unwrap();
        bag::write(&fixture.path("bag"), &bag_of(&frames).0);
    });
    std::fs::rename(fixture.path("bag/bag.mcap"), fixture.path("bag.mcap")).unwrap();
    fixture
}

#[test]
fn published_results_have_the_cells_of_the_matcher() {
    let fixture = fixture();
    fixture.run(
        "score bag.mcap --truth /truth --algo own=sgm:min_disparity=1 \
         --algo depth=topic:/depth --algo disparity=topic:/disparity --algo cloud=topic:/points \
         --algo moved=topic:/moved/depth --algo half=topic:/half/depth \
         --algo truth --algo moved_truth=topic:/moved_truth/depth --rerun none -o rep -q",
    );
    // The other camera does not see a part of some cells, and noise hides what is behind it.
    for (pair, limits, least) in [
        (["own", "depth"], (1e-5, 0.0), 0.999),
        (["own", "disparity"], (1e-5, 0.0), 0.999),
        (["own", "cloud"], (1e-5, 0.0), 0.999),
        (["truth", "half"], (0.03, 0.0), 0.97),
        (["truth", "moved_truth"], (0.03, 0.9), 0.99),
        (["own", "moved"], (0.03, 0.9), 0.95),
    ] {
        let share = equal_share(&fixture, pair, limits);
        println!("{pair:?}: {share}");
        assert!(share >= least, "{pair:?}: {share}");
    }
    // Nothing was matched: no times, in no table.
    for row in rows::<Row>(&fixture, "rep/rows.csv") {
        let is_matched = ["own", "truth"].contains(&row.algorithm.as_str());
        let times = [row.total_us, row.matching_us, row.smoothing_us];
        let known = times.map(|t| t.is_some());
        assert_eq!(known, [is_matched; 3], "{}", row.algorithm);
    }
    let delay = fixture.json_file("rep/summary.json")["latency"][0].take();
    assert_eq!(delay["topic"], "/depth");
    assert_eq!(delay["topic_ms"], serde_json::json!([41.0, 41.0]));
    assert_eq!(delay["images_ms"], serde_json::json!([1.234567, 1.234567]));
}

/// Infinity is an answer in the depths of any camera; in disparities and in a truth it is unknown.
#[test]
fn infinity_is_an_answer_of_depths_alone() {
    let fixture = Fixture::new();
    let frame = &arena(&fixture)[0];
    let (rig, size) = (frame.rig().unwrap(), frame.pair.size());
    let all = |width, z| Plane::filled(width, size.1, z).unwrap();
    let bag = Bag::default().tf(&MOVED).and(pair(0, frame)).and([
        camera_info_of("/moved/camera_info", stamp(0), &moved_camera(rig, size)),
        depth("/far", "cam", 0, &all(size.0, f32::INFINITY)),
        depth("/none", "cam", 0, &all(size.0, f32::NAN)),
        depth("/moved/depth", "cam1", 0, &all(size.0 + PAD, f32::INFINITY)),
    ]);
    bag.write(&fixture);
    for (name, value) in [("inf", f32::INFINITY), ("nan", f32::NAN), ("zero", 0.0)] {
        fixture.write(&format!("{name}/0000.pfm"), pfm(value));
    }
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
        let line = "score bag.mcap --rerun none -o rep -q --force --algo";
        fixture.run(&format!("{line} a={algo}"));
        let rows = rows::<CellRow>(&fixture, "rep/cells.csv");
        let state = |row: &CellRow| row.state.map_or("", |state| state.name());
        let states: BTreeSet<_> = rows.iter().map(state).collect();
        assert_eq!(states, BTreeSet::from([expected]), "{algo}");
    }
    let none = "nothing was compared: no cell has enough of the truth /far";
    let ran = fixture.svl("score bag.mcap --truth /far --algo sgm --rerun none -o truth -q");
    ran.failed(4, &[none]);
    let rows = rows::<CellRow>(&fixture, "truth/cells.csv");
    assert!(rows.iter().all(|row| row.verdict == Verdict::NoTruth));
}

#[test]
fn each_map_is_the_answer_to_one_pair() {
    let fixture = fixture();
    // Within the limit of a neighbour, too.
    let line = "score bag.mcap --truth /truth --algo slow=topic:/half_rate,skew_ms=150 \
                --rerun none -q -o";
    fixture.svl(&format!("{line} rep")).exits(4);
    let rows = rows::<Row>(&fixture, "rep/rows.csv");
    let answered = rows.iter().map(|row| row.sequence);
    assert!(answered.eq((0..FRAMES).step_by(2)));
    let failures = fixture.text("rep/failures.csv");
    assert_eq!(failures.lines().count() as u64, 1 + FRAMES / 2);
    failures.says("no message of /half_rate belongs to this pair");
    fixture.run(&format!("{line} allowed --allow-loss 50%"));
}

#[test]
fn perturbed_pairs_are_without_recorded_maps() {
    let fixture = fixture();
    let ran = fixture.svl(
        "score bag.mcap --truth /truth --algo bm --algo depth=topic:/depth \
         --stress row_offset=1 --rerun none -o rep",
    );
    ran.exits(0)
        .says("depth: computed before, so perturbed pairs");
    let rows = rows::<Row>(&fixture, "rep/rows.csv").into_iter();
    let perturbed: Vec<_> = rows.filter(|row| row.stress.is_some()).collect();
    let is_matched = |row: &Row| row.algorithm == "bm";
    assert!(!perturbed.is_empty() && perturbed.iter().all(is_matched));
}

#[test]
fn a_map_that_is_none_is_one_line() {
    let fixture = fixture();
    fixture.fails(
        "
        score bag.mcap --algo topic => 2: name the topic, as topic:/camera/depth
        score bag.mcap --algo z=topic:/dept => 1: no such topic | did you mean '/depth'
        score bag.mcap --algo z=topic:/left/image_rect => 1: 'mono8' | depths are 16UC1
        score bag.mcap --truth /depth --algo z=topic:/depth => 2: is the truth, too
        score bag.mcap --algo z=topic:/depth,skew=3 => 2: skew_ms
        score arena --algo z=topic:/depth => 2: topic:/depth | the arena has not
        score bag.mcap --algo z=files:'out.pfm' => 2: one * for the pair's name
        score bag.mcap --algo z=files:'no/*.pfm' => 1: files:'no/*.pfm' | no such file
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
    let (width, height) = frames[0].pair.size();
    let own = Plane::filled(width, height, 1.0_f32).unwrap();
    for (seconds, words) in [(3600, "3599.960 s ahead"), (-60, "60.040 s behind")] {
        let messages = (0..3).flat_map(|i| {
            let message = depth("/depth", "cam", i, &own);
            let shifted = stamp(i).saturating_add_signed(seconds * 1_000_000_000);
            let shifted = message.at(shifted, message.log_time);
            pair(i, &frames[i]).into_iter().chain([shifted])
        });
        Bag::new(messages).write(&fixture);
        let expected = ["topic:/depth", "stamps are from another time", words];
        let ran = fixture.svl("score bag.mcap --algo z=topic:/depth --rerun none -o rep");
        ran.failed(1, &expected);
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
        let names = ["drive.mcap", "/zed/depth", "/lidar/points"];
        let own = names.into_iter().zip(["bag.mcap", "/depth", "/truth"]);
        let line = own.fold(line.to_owned(), |line, (from, to)| line.replace(from, to));
        // The arena's depth by `sgm` is worse than the limits.
        let expected = if line.contains("--gate") { 3 } else { 0 };
        let ran = fixture.svl(line.strip_prefix("svl ").unwrap());
        ran.exits(expected);
    }
}

/// The maps of a matcher, written to files by `svl match`, have its cells.
#[test]
fn maps_in_files_have_the_cells_of_the_matcher() {
    let fixture = Fixture::new();
    for folder in ["out", "png"] {
        std::fs::create_dir(fixture.path(folder)).unwrap();
    }
    for (name, shift) in [("a", 3), ("b", 5), ("c", 8)] {
        let [left, right] = ["left", "right"].map(|side| format!("pairs/{side}/{name}.pgm"));
        fixture.write_pair(&left, &right, (120, 90), shift);
        for out in ["out/{}.pfm", "png/{}.png"] {
            let out = out.replace("{}", name);
            fixture.run(&format!("match {left} {right} --algo sgm -o {out}"));
        }
    }
    let line = "score pairs --algo sgm --algo pfm=files:out/*.pfm --algo png=files:'png/*.png' \
                --algo steps=files:png/*.png,disparity=128 --rerun none -o rep -q";
    fixture.run(line);
    let medians = |name: &str| -> Vec<_> {
        let cells = cells(&fixture, "rep", name).into_values();
        cells.map(|cell| cell.median_px).collect()
    };
    let own = medians("sgm");
    assert!(own.iter().flatten().count() > 30);
    assert_eq!(medians("pfm"), own);
    for (name, factor) in [("png", 1.0), ("steps", 2.0)] {
        let is_close = |(a, b): (&Option<f64>, &Option<f64>)| {
            let off = a.zip(*b).map(|(a, b)| (a * factor - b).abs());
            off.map_or(a == b, |off| off <= factor / 256.0)
        };
        assert!(own.iter().zip(&medians(name)).all(is_close), "{name}");
    }
    fixture.write_pair("other/left/a.pgm", "other/right/a.pgm", (120, 90), 3);
    fixture.fails("score pairs other --algo z=files:out/*.pfm => 2: of one run | name one");
    // Other maps in the files are other results.
    fixture.run("match pairs/left/a.pgm pairs/right/a.pgm --algo blind -o out/a.pfm --force");
    fixture.run(line);
    assert!(medians("pfm").iter().flatten().count() < own.iter().flatten().count());
    assert_eq!(medians("sgm"), own);
}

/// A PFM of 320 x 240 pixels, all of one disparity.
fn pfm(disparity: f32) -> Vec<u8> {
    let pixels = disparity.to_le_bytes().repeat(320 * 240);
    [b"Pf\n320 240\n-1\n", &pixels[..]].concat()
}

#[test]
fn files_belong_to_pairs_without_a_name_by_their_numbers() {
    let fixture = fixture();
    let line = "score bag.mcap --truth /truth --algo n=files:out/*.pfm --rerun none -o rep";
    for i in 0..FRAMES {
        fixture.write(&format!("out/{i:04}.pfm"), pfm(20.0 + i as f32));
    }
    let renamed = |from: &str, to: &str| {
        let [from, to] = [from, to].map(|name| fixture.path(&format!("out/{name}.pfm")));
        std::fs::rename(from, to).unwrap();
    };
    fixture.run(&format!("{line} -q"));
    let medians = || -> Vec<_> {
        let cells = cells(&fixture, "rep", "n").into_iter();
        let medians = cells.map(|((i, ..), cell)| Some((i, cell.median_px?)));
        medians.flatten().collect()
    };
    let numbered = medians();
    assert_eq!(numbered.len() as u64, FRAMES * 15);
    assert!(numbered.iter().all(|(i, px)| *px == 20.0 + *i as f64));
    // Numbers from 1 to that of the pairs begin with the first pair, in a range of them, too.
    renamed("0000", "0012");
    let ran = fixture.svl(&format!("{line} --every 2 --force")).exits(0);
    // Files of the pairs between are not asked for.
    ran.says("files:'out/*.pfm': numbers 1 to 12 for pairs 0 to 11: 1 is pair 0")
        .lacks("used by no pair");
    let shifted = medians();
    assert_eq!(shifted.len(), 6 * 15);
    assert!(shifted.iter().all(|(i, px)| *px == 21.0 + *i as f64));
    renamed("0012", "0030");
    let words = "numbers 1 to 30 for pairs 0 to 11 are read as the pairs' own, so that some have \
                 none; if 1 is pair 0, number the files from 0";
    let ran = fixture.svl(&format!("{line} --force")).exits(4).says(words);
    ran.says("1 file used by no pair, the first is ./out/0030.pfm; 1 pair without one");
    // The last map is missing, or the first: both are said.
    std::fs::remove_file(fixture.path("out/0030.pfm")).unwrap();
    let words = "numbers 1 to 11 for pairs 0 to 11 are read as the pairs' own, so that some have";
    fixture.svl(&format!("{line} --force")).says(words);
    fixture.write("out/3.pfm", pfm(9.0));
    let ran = fixture.svl(&format!("{line} -q"));
    ran.failed(1, &["have one number; leave one of them"]);
}

#[test]
fn files_of_a_part_of_a_recording_have_its_numbers_or_count_its_pairs() {
    let fixture = Fixture::new();
    arena(&fixture);
    fixture.run("record made/pairs.mcap -o part.mcap --from 0.5 -q");
    let frames = intact(&fixture.path("part.mcap")).into_iter();
    let sequences: Vec<_> = frames.map(|frame| frame.sequence).collect();
    let (start, end) = (sequences[0], sequences[sequences.len() - 1]);
    assert!(start > 1 && end > start + 2, "{sequences:?}");
    for first in [start, 0, 1, start + 1, 100] {
        for (i, sequence) in sequences.iter().enumerate() {
            let name = format!("m{first}/{}.pfm", first + i as u64);
            fixture.write(&name, pfm(*sequence as f32));
        }
        let last = first + end - start;
        let algo = format!("--algo n=files:m{first}/*.pfm");
        let words = format!("numbers {first} to {last} for pairs {start} to {end}: {first} is");
        let ran = fixture.svl(&format!("score part.mcap {algo} --rerun none -o r{first}"));
        let ran = ran.exits(0).counts(usize::from(first != start), &words);
        ran.lacks("used by no pair");
        for ((i, ..), cell) in cells(&fixture, &format!("r{first}"), "n") {
            let expected = Some(i as f64).filter(|px| *px > 0.0);
            assert_eq!(cell.median_px, expected, "{first}");
        }
    }
}

#[test]
fn errors_by_distance_noise_and_flicker_are_those_of_numpy() {
    let fixture = fixture();
    fixture.run(
        "score bag.mcap --truth /truth --algo sgm --algo bm --near 0.4 --tolerance 5% \
         --cells 8x4 --rerun none -o rep -q",
    );
    let rows = rows::<AccuracyRow>(&fixture, "rep/accuracy.csv");
    assert!(rows.len() > 6 && rows.iter().any(|row| row.noise_m.is_some()));
    let is_whole = |row: &&AccuracyRow| row.from_m == 0.0 && row.to_m.is_none();
    let known = rows.iter().filter(is_whole);
    // Two algorithms, each of obstacles, all cells and pixels: nothing tells floor.
    assert_eq!(known.count(), 6);
    let of_pixels = rows.iter().filter(|row| row.is_of_pixels).count();
    // The pairs of both are the same, so that a comparison has the same errors of each.
    let compared = fixture.json("compare rep#sgm rep#bm --json");
    for (side, label) in ["sgm", "bm"].into_iter().enumerate() {
        let own = rows.iter().filter(|row| row.algorithm == label);
        let own = own.filter(|row| row.is_of_pixels || row.area == AreaChoice::default());
        let own = serde_json::to_string(&own.collect::<Vec<_>>()).unwrap();
        assert!(own.contains(r#""is_of_pixels":true"#));
        let compared = &compared[0]["algorithms"][0]["by_distance"][side];
        let own: serde_json::Value = serde_json::from_str(&own).unwrap();
        assert_eq!(*compared, own, "{label}");
    }
    let Some(output) = python("accuracy.py", "numpy", [fixture.path("rep")]) else {
        return;
    };
    let output = String::from_utf8(output).unwrap();
    let end = format!("{} rows equal\n", rows.len() - of_pixels);
    assert!(output.ends_with(&end), "{output}");
}
