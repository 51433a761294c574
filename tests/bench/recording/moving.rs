//! Cameras that move: faults of their clocks, copies, order and truth, as pixels and log times tell
//! them together.

use super::bag::{Bag, Stereo};
use super::calibration_checks::{ARENA, messages};
use super::depth_units::depth_messages;
use super::frames::intact;
use super::says::{Says, joined};
use crate::cli::fixture::Fixture;
use svl::stereo::{Frame, Gray, Plane, StereoPair};

const PAIRS: u64 = 60;
const MS: u64 = 1_000_000;
const PERIOD_NS: u64 = 100 * MS;
const BEGIN_NS: u64 = 1_700_000_000_000_000_000;
const LATENCY_NS: u64 = 5 * MS;
const REPLAY: &str = "replay bag.mcap --algo blind --rerun none";
const SCORE: &str = "score bag.mcap --algo v5 --truth /depth --rerun none -o r";

/// Removes the report of [`SCORE`].
fn forget(fixture: &Fixture) {
    std::fs::remove_dir_all(fixture.path("r")).unwrap();
}

/// A robot that drives through the arena, and its frames.
fn drive() -> (Fixture, Vec<Frame>) {
    let fixture = Fixture::new();
    fixture.write_made("drive", "drive of 60 pairs", |fixture| {
        std::fs::create_dir(fixture.path("drive")).unwrap();
        let line = format!("record arena --frames {PAIRS} -q -o drive/arena.mcap");
        fixture.run(&line);
    });
    let frames = intact(&fixture.path("drive/arena.mcap"));
    (fixture, frames)
}

/// The messages of both cameras and a depth image of each pair, logged as they come; `times` has
/// the stamp and the log time of a topic's message by number, and leaves it out without.
fn bag_of(
    frames: &[Frame],
    stereo: Stereo<'_>,
    times: impl Fn(&str, u64) -> Option<(u64, u64)>,
) -> Bag {
    let bag = Bag(messages(frames, stereo)).and(depth_messages(frames, "/depth", &|z| z));
    bag.clock(|topic, stamp| times(topic, stamp / PERIOD_NS - 1))
}

/// The messages of frames that come in time.
fn in_time(frames: &[Frame], stereo: Stereo<'_>) -> Bag {
    bag_of(frames, stereo, |_, i| Some(usual(i)))
}

/// The frames with other images, those of a function of their number and themselves.
fn shown<'a>(
    frames: &'a [Frame],
    images: impl Fn(usize, &'a StereoPair) -> [&'a Gray; 2],
) -> Vec<Frame> {
    let changed = frames.iter().enumerate().map(|(i, frame)| {
        let [left, right] = images(i, &frame.pair).map(Clone::clone);
        let mut frame = frame.clone();
        frame.pair = StereoPair::new(left, right).unwrap();
        frame
    });
    changed.collect()
}

fn at(number: u64) -> u64 {
    BEGIN_NS + number * PERIOD_NS
}

/// Stamp and log time of a message that comes in time.
fn usual(number: u64) -> (u64, u64) {
    (at(number), at(number) + LATENCY_NS)
}

#[test]
fn right_images_that_come_late_are_told_from_a_clock_that_is_off() {
    let (fixture, frames) = drive();
    let write = |times: &dyn Fn(u64) -> Option<(u64, u64)>| {
        let times = |topic: &str, i| {
            let is_right = topic.starts_with("/cam1");
            if is_right { times(i) } else { Some(usual(i)) }
        };
        bag_of(&frames, ARENA, times).write(&fixture);
        fixture.answer("")
    };
    let later = |i, ms: u64| Some((at(i), at(i) + ms * MS));
    // Late from the second image on, from the first one on, and from some time on.
    for late in [
        write(&|i| later(i, 300).filter(|_| i > 0)),
        write(&|i| later(i, 250).filter(|_| i > 2)),
        write(&|i| later(i, 300)),
        write(&|i| later(i, if i < 30 { 5 } else { 205 })),
        write(&|i| later(i, if i < 30 { 5 } else { 255 })),
    ] {
        assert!(late.starts_with("usable: "), "{late}");
        fixture.svl(REPLAY).lacks("clock");
    }
    // A clock that is behind by whole periods, also if the first stamps are equal; one that steps.
    let behind = |i, ms: u64| Some((at(i) - ms * MS, at(i) + LATENCY_NS));
    let equal = write(&|i| behind(i, 300).filter(|_| i > 2));
    let steps = write(&|i| behind(i, if i < 30 { 0 } else { 300 }));
    for (answer, words) in [
        (write(&|i| behind(i, 300)), "clock is 0.300 s behind"),
        (equal, "clock is 0.300 s behind"),
        (steps, "from none to 0.300 s behind"),
    ] {
        let answer = answer.says(words);
        let is_named = answer.starts_with("not usable yet: /cam1/image_raw: ");
        assert!(is_named, "{answer}");
    }
}

#[test]
fn a_left_clock_and_a_truth_s_that_step_are_named_as_theirs() {
    let (fixture, frames) = drive();
    let steps = |whose: &'static str, ms: u64| {
        let times = |topic: &str, i| {
            let is_off = topic.starts_with(whose) && i >= 30;
            Some((at(i) - u64::from(is_off) * ms * MS, at(i) + LATENCY_NS))
        };
        bag_of(&frames, ARENA, times).write(&fixture);
    };
    let step = |topic: &str, other: &str, by: &str| {
        format!(
            "{topic}: by the log times its clock steps or drifts against that of the {other} \
             images, from none to {by} s behind, 3 s after"
        )
    };
    steps("/cam0", 270);
    let words = step("/cam0/image_raw", "right", "0.270");
    fixture.answer("").says(&words);
    steps("/depth", 1000);
    for door in ["info bag.mcap", REPLAY, SCORE] {
        fixture.svl(door).says(&step("/depth", "left", "1.000"));
    }
}

#[test]
fn a_stuck_part_is_named_with_the_range_before_it() {
    let (fixture, frames) = drive();
    for (topic, words) in [
        ("/cam0/image_raw", "the left images are the same"),
        ("/cam1/image_raw", "the right images are the same"),
        ("/depth", "the truth is the same"),
    ] {
        let bag = in_time(&frames, ARENA);
        let from = at(30) + LATENCY_NS;
        let mut of_topic = bag.0.iter().filter(|message| message.topic == topic);
        let first = of_topic.find(|message| message.log_time == from);
        let first = first.unwrap().clone();
        let stuck = bag.each(|message| {
            let log_time = message.log_time;
            let is_stuck = message.topic == topic && log_time > from;
            let copy = is_stuck.then(|| first.at(log_time - LATENCY_NS, log_time));
            [copy.unwrap_or(message)]
        });
        stuck.write(&fixture);
        fixture
            .svl(SCORE)
            .says(words)
            .says("`--to 3.000` ends before");
        forget(&fixture);
        let cured = fixture.svl(&format!("{SCORE} --to 3.000"));
        cured.lacks("stuck").done();
        forget(&fixture);
    }
    // A sensor's limit in place of none.
    let depths = depth_messages(&frames, "/depth", &|z| if z > 1.0 { 10.0 } else { z });
    Bag(messages(&frames, ARENA)).and(depths).write(&fixture);
    fixture.svl(SCORE).says("it is the limit of a sensor");
}

#[test]
fn copies_of_one_camera_or_by_turns_have_a_cure_of_their_own() {
    type Order = fn(usize) -> usize;
    let (fixture, frames) = drive();
    let write = |left: Order, right: Order| {
        let images = |i, _: &_| [frames[left(i)].pair.left(), frames[right(i)].pair.right()];
        in_time(&shown(&frames, images), ARENA).write(&fixture);
        fixture.svl(REPLAY)
    };
    let even: Order = |i| i / 2 * 2;
    let odd: Order = |i| (i.div_ceil(2) * 2).saturating_sub(1);
    write(even, odd).says("those of the two cameras alternate");
    for (order, cure) in [(even, "--every 2"), (odd, "--from 0.099 --every 2")] {
        write(|i| i, order)
            .says("comes twice")
            .says(&format!("`{cure}`"));
        let report = fixture.json(&format!("{SCORE} {cure} --json"));
        forget(&fixture);
        let cells = |name: &str| report["algorithms"][0][name].as_f64().unwrap();
        let right = cells("cells_right") / cells("scored_cells");
        assert!(right > 0.8, "{cure}: {right}");
    }
}

#[test]
fn cameras_that_are_a_pair_apart_are_no_matter_of_rectification() {
    let (fixture, frames) = drive();
    for apart in [-1_isize, 1] {
        let cure = &format!("--right-offset-ms {apart}00.0");
        let moved = shown(&frames, |i, pair| {
            let other = i.saturating_add_signed(apart).min(frames.len() - 1);
            [pair.left(), frames[other].pair.right()]
        });
        bag_of(&moved, ARENA, |_, i| Some((at(i), at(i)))).write(&fixture);
        let said = fixture.svl(REPLAY).says("vertical misalignment");
        said.says("the cameras are a pair apart").says(cure);
        let told = fixture.json("info bag.mcap --json")["usability"]["doubts"].take();
        let is_apart = |doubt: &serde_json::Value| doubt["cure"]["cure"]["kind"] == "pair_apart";
        assert!(told.as_array().unwrap().iter().any(is_apart), "{told}");
        let cured = fixture.svl(&format!("{REPLAY} {cure}"));
        cured.lacks("misalignment").done();
    }
}

#[test]
fn exchanged_images_or_calibrations_have_a_cure_each() {
    let (fixture, frames) = drive();
    let frames = &frames[..8];
    let calib = "cam0=[328 0 159.5; 0 328 119.5; 0 0 1]\ncam1=[328 0 159.5; 0 328 119.5; 0 0 1]\n\
                 doffs=0\nbaseline=44\nwidth=320\nheight=240\n";
    fixture.write("calib.txt", calib);
    let exchanged = shown(frames, |_, pair| [pair.right(), pair.left()]);
    let alone = "if the calibrations alone are, --calib FILE replaces them";
    let other_infos = ARENA.offsets([ARENA.cameras[1].tx, ARENA.cameras[0].tx]);
    for (frames, stereo, words, cure) in [
        (
            &exchanged[..],
            ARENA,
            "name them the other way round (--left and --right, the files of match, or \
             --side-by-side=right-left, or bottom-top, for halves of one image), and as the \
             calibrations are not exchanged, --calib FILE",
            "--left /cam1/image_raw --right /cam0/image_raw --calib calib.txt",
        ),
        (frames, other_infos, alone, "--calib calib.txt"),
        (
            &exchanged,
            other_infos,
            "if svl info finds the images exchanged, too, --left and --right name their topics",
            "--left /cam1/image_raw --right /cam0/image_raw",
        ),
    ] {
        in_time(frames, stereo).write(&fixture);
        let line = fixture.answer("").says(words);
        // Pairs without a rig are raw, and recorded as they are.
        if line.contains(", calibrated") && line.contains("look exchanged") {
            for door in ["record --force -o x.mcap", "calibrate check"] {
                let ran = fixture.svl(&format!("{door} bag.mcap"));
                ran.says("look exchanged");
            }
        }
        // The truth has the frame of the left camera, which exchanged topics do not.
        let cured = fixture.svl(&format!("{REPLAY} {cure}"));
        cured.lacks("exchanged").done();
        let baseline = fixture.first_pairs(cure)["rig"]["baseline_m"].as_f64();
        assert_eq!(baseline.map(|m| (m * 1e3).round()), Some(44.0));
    }
}

#[test]
fn truths_along_rays_cut_short_or_without_a_cell_and_a_baseline_in_centimetres() {
    let (fixture, frames) = drive();
    let frames = &frames[..12];
    // Distances along the rays.
    let rig = *frames[0].rig().unwrap();
    let mut ranges = frames.to_vec();
    for frame in &mut ranges {
        let truth = frame.truth.as_mut().unwrap();
        let ray = |x: usize, y: usize| {
            let [u, v] = [x as f64 - 159.5, y as f64 - 119.5].map(|at| at / rig.focal_px());
            (1.0 + u * u + v * v).sqrt() as f32
        };
        let px = |x, y| truth.disparity.get(x, y) / ray(x, y);
        truth.disparity = Plane::from_fn(320, 240, px).unwrap();
    }
    in_time(&ranges, ARENA).write(&fixture);
    joined(&fixture.run(SCORE)).says("the truth is doubtful | along the rays");
    forget(&fixture);
    // The first depth image is cut.
    let mut cut = in_time(frames, ARENA);
    let first = cut.0.iter_mut().find(|message| message.topic == "/depth");
    first.unwrap().data.truncate(100_000);
    cut.write(&fixture);
    let answer = fixture.answer("");
    let is_found = answer.ends_with("calibrated, truth from /depth");
    assert!(is_found, "{answer}");
    let report = fixture.json(&format!("{SCORE} --json"));
    assert_eq!(report["algorithms"][0]["scored_pairs"], 11);
    forget(&fixture);
    let mut in_centimetres = ARENA;
    in_centimetres.cameras[1].tx *= 100.0;
    in_time(frames, in_centimetres).write(&fixture);
    let words = "likely a baseline of 0.044 m instead of 4.4 m, written in centimetres";
    fixture.svl(SCORE).failed(1, &[words]);
    // No distance at all.
    let none = depth_messages(frames, "/depth", &|_| 0.0);
    Bag(messages(frames, ARENA)).and(none).write(&fixture);
    let words = "nothing was compared: no cell has enough of the truth /depth";
    fixture.svl(SCORE).exits(4).says(words);
}
