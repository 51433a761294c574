//! Cameras that move: faults of their clocks, copies, order and truth, as pixels and log times tell
//! them together.

use super::bag::{self, Camera, Message};
use super::calibration_checks::{infos, messages};
use super::depth_units::depth_messages;
use super::frames::read;
use super::stamps::stamped;
use crate::cli::fixture::{Fixture, assert_says};
use svl::stereo::{Frame, Plane, StereoPair};

const PAIRS: u64 = 60;
const MS: u64 = 1_000_000;
const PERIOD_NS: u64 = 100 * MS;
const BEGIN_NS: u64 = 1_700_000_000_000_000_000;
const LATENCY_NS: u64 = 5 * MS;
const REPLAY: &str = "replay bag.mcap --algo blind --rerun none";
const SCORE: &str = "score bag.mcap --algo v5 --truth /depth --rerun none -o r";

/// Share of the first algorithm's cells that are right, of a score of the bag; its report is gone.
#[track_caller]
fn right(fixture: &Fixture, options: &str) -> f64 {
    let report = fixture.json(&format!("{SCORE} {options} --json"));
    std::fs::remove_dir_all(fixture.path("r")).unwrap();
    let cells = |name: &str| report["algorithms"][0][name].as_f64().unwrap();
    cells("cells_right") / cells("scored_cells")
}

/// A robot that drives through the arena, and its frames.
fn drive() -> (Fixture, Vec<Frame>) {
    let fixture = Fixture::new();
    fixture.write_made("drive", "drive of 60 pairs", |fixture| {
        std::fs::create_dir(fixture.path("drive")).unwrap();
        fixture.run(&format!(
            "record arena --frames {PAIRS} -q -o drive/arena.mcap"
        ));
    });
    let frames = read(&fixture.path("drive/arena.mcap")).0;
    (fixture, frames)
}

/// The messages of both cameras and a depth image of each pair, logged as they come; `times` has
/// the stamp and the log time of a topic's message by number, and leaves it out without.
fn bag_of(
    frames: &[Frame],
    infos: [Camera<'_>; 2],
    times: impl Fn(&str, u64) -> Option<(u64, u64)>,
) -> Vec<Message> {
    let mut all = messages(frames, infos);
    all.extend(depth_messages(frames, "/depth", &|z| z));
    let number = |message: &Message| message.log_time / PERIOD_NS - 1;
    let timed = all.iter().filter_map(|message| {
        let (stamp, log) = times(message.topic, number(message))?;
        Some(stamped(message, stamp, log))
    });
    let mut timed: Vec<_> = timed.collect();
    timed.sort_by_key(|message| message.log_time);
    timed
}

fn at(number: u64) -> u64 {
    BEGIN_NS + number * PERIOD_NS
}

/// Stamp and log time of a message that comes in time.
fn usual(number: u64) -> (u64, u64) {
    (at(number), at(number) + LATENCY_NS)
}

/// The first line of `svl info`.
fn answer(fixture: &Fixture) -> String {
    let text = fixture.run("info bag.mcap");
    let words: Vec<_> = text.split_whitespace().collect();
    words
        .join(" ")
        .split(" bag.mcap ")
        .next()
        .unwrap()
        .to_owned()
}

#[test]
fn right_images_that_come_late_are_told_from_a_clock_that_is_off() {
    let (fixture, frames) = drive();
    let write = |times: &dyn Fn(u64) -> Option<(u64, u64)>| {
        let times = |topic: &str, i| {
            let is_right = topic.starts_with("/cam1");
            if is_right { times(i) } else { Some(usual(i)) }
        };
        bag::write(&fixture.path(""), &bag_of(&frames, infos(), times));
        answer(&fixture)
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
        let said = fixture.svl(REPLAY).stderr;
        assert!(!said.contains("clock"), "{said}");
    }
    // A clock that is behind by whole periods, also if the first stamps are equal; one that steps.
    let behind = |i, ms: u64| Some((at(i) - ms * MS, at(i) + LATENCY_NS));
    for (answer, words) in [
        (write(&|i| behind(i, 300)), "clock is 0.300 s behind"),
        (
            write(&|i| behind(i, 300).filter(|_| i > 2)),
            "clock is 0.300 s behind",
        ),
        (
            write(&|i| behind(i, if i < 30 { 0 } else { 300 })),
            "from none to 0.300 s behind",
        ),
    ] {
        assert!(
            answer.starts_with("not usable yet: /cam1/image_raw: "),
            "{answer}"
        );
        assert!(answer.contains(words), "{answer}");
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
        bag::write(&fixture.path(""), &bag_of(&frames, infos(), times));
    };
    steps("/cam0", 270);
    let left = answer(&fixture);
    let words = "/cam0/image_raw: by the log times its clock steps or drifts against that of the \
                 right images, from none to 0.270 s behind, 3 s after";
    assert!(left.contains(words), "{left}");
    steps("/depth", 1000);
    let words = "/depth: by the log times its clock steps or drifts against that of the left \
                 images, from none to 1.000 s behind, 3 s after";
    for door in ["info bag.mcap", REPLAY, SCORE] {
        assert_says(&fixture.svl(door).stderr, &[words]);
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
        let mut all = bag_of(&frames, infos(), |_, i| Some(usual(i)));
        let from = at(30) + LATENCY_NS;
        let first = all.iter().find(|m| m.topic == topic && m.log_time == from);
        let first = first.unwrap().clone();
        let stuck = all
            .iter_mut()
            .filter(|m| m.topic == topic && m.log_time > from);
        stuck.for_each(|m| *m = stamped(&first, m.log_time - LATENCY_NS, m.log_time));
        bag::write(&fixture.path(""), &all);
        let said = fixture.svl(SCORE).stderr;
        assert_says(&said, &[words, "`--to 3.000` ends before"]);
        let cured = fixture.svl(&format!("{SCORE}2 --to 3.000"));
        assert!(!cured.stderr.contains("stuck"), "{}", cured.stderr);
        cured.done();
        for report in ["r", "r2"] {
            std::fs::remove_dir_all(fixture.path(report)).unwrap();
        }
    }
    // A sensor's limit in place of none.
    let mut all = messages(&frames, infos());
    all.extend(depth_messages(&frames, "/depth", &|z| {
        if z > 1.0 { 10.0 } else { z }
    }));
    bag::write(&fixture.path(""), &all);
    assert_says(&fixture.svl(SCORE).stderr, &["it is the limit of a sensor"]);
}

#[test]
fn copies_of_one_camera_or_by_turns_have_a_cure_of_their_own() {
    let (fixture, frames) = drive();
    let write = |left: fn(usize) -> usize, right: fn(usize) -> usize| {
        let copied = frames.iter().enumerate().map(|(i, frame)| {
            let pair = [
                frames[left(i)].pair.left().clone(),
                frames[right(i)].pair.right().clone(),
            ];
            Frame {
                pair: StereoPair::new(pair[0].clone(), pair[1].clone()).unwrap(),
                ..frame.clone()
            }
        });
        let copied: Vec<_> = copied.collect();
        bag::write(
            &fixture.path(""),
            &bag_of(&copied, infos(), |_, i| Some(usual(i))),
        );
        fixture.svl(REPLAY).stderr
    };
    let by_turns = write(|i| i / 2 * 2, |i| (i.div_ceil(2) * 2).saturating_sub(1));
    assert_says(&by_turns, &["those of the two cameras alternate"]);
    type Order = fn(usize) -> usize;
    let cases: [(Order, &str); 2] = [
        (|i| i / 2 * 2, "`--every 2`"),
        (
            |i| (i.div_ceil(2) * 2).saturating_sub(1),
            "`--from 0.099 --every 2`",
        ),
    ];
    for (order, cure) in cases {
        assert_says(&write(|i| i, order), &["comes twice", cure]);
        let right = right(&fixture, cure.trim_matches('`'));
        assert!(right > 0.8, "{cure}: {right}");
    }
}

#[test]
fn cameras_that_are_a_pair_apart_are_no_matter_of_rectification() {
    let (fixture, frames) = drive();
    for (apart, cure) in [
        (-1_isize, "--right-offset-ms -100.0"),
        (1, "--right-offset-ms 100.0"),
    ] {
        let moved = frames.iter().enumerate().map(|(i, frame)| {
            let other = i.saturating_add_signed(apart).min(frames.len() - 1);
            let right = frames[other].pair.right().clone();
            Frame {
                pair: StereoPair::new(frame.pair.left().clone(), right).unwrap(),
                ..frame.clone()
            }
        });
        let moved: Vec<_> = moved.collect();
        bag::write(
            &fixture.path(""),
            &bag_of(&moved, infos(), |_, i| Some((at(i), at(i)))),
        );
        let said = fixture.svl(REPLAY).stderr;
        assert_says(
            &said,
            &[
                "vertical misalignment",
                "the cameras are a pair apart",
                cure,
            ],
        );
        let told = fixture.json("info bag.mcap --json")["usability"]["doubts"].take();
        let is_apart = |doubt: &serde_json::Value| doubt["cure"]["cure"]["kind"] == "pair_apart";
        assert!(told.as_array().unwrap().iter().any(is_apart), "{told}");
        let cured = fixture.svl(&format!("{REPLAY} {cure}"));
        assert!(!cured.stderr.contains("misalignment"), "{}", cured.stderr);
        cured.done();
    }
}

#[test]
fn exchanged_images_or_calibrations_have_a_cure_each() {
    let (fixture, frames) = drive();
    let frames = &frames[..8];
    let calib = "cam0=[328 0 159.5; 0 328 119.5; 0 0 1]\ncam1=[328 0 159.5; 0 328 119.5; 0 0 1]\n\
                 doffs=0\nbaseline=44\nwidth=320\nheight=240\n";
    fixture.write("calib.txt", calib);
    let exchanged = frames.iter().map(|frame| {
        let [left, right] = frame.pair.clone().into_images();
        Frame {
            pair: StereoPair::new(right, left).unwrap(),
            ..frame.clone()
        }
    });
    let exchanged: Vec<_> = exchanged.collect();
    let [left, right] = infos();
    for (frames, infos, words, cure) in [
        (
            &exchanged[..],
            [left, right],
            "name them the other way round (--left and --right, the files of match, or \
             --side-by-side=right-left, or bottom-top, for halves of one image), and as the \
             calibrations are not exchanged, --calib FILE",
            "--left /cam1/image_raw --right /cam0/image_raw --calib calib.txt",
        ),
        (
            frames,
            [right, left],
            "if the calibrations alone are, --calib FILE replaces them",
            "--calib calib.txt",
        ),
        (
            &exchanged,
            [right, left],
            "if svl info finds the images exchanged, too, --left and --right name their topics",
            "--left /cam1/image_raw --right /cam0/image_raw",
        ),
    ] {
        bag::write(
            &fixture.path(""),
            &bag_of(frames, infos, |_, i| Some(usual(i))),
        );
        let line = answer(&fixture);
        assert!(line.contains(words), "{line}");
        // Pairs without a rig are raw, and recorded as they are.
        if line.contains(", calibrated") && line.contains("look exchanged") {
            for door in [
                "record bag.mcap --force -o x.mcap",
                "calibrate check bag.mcap",
            ] {
                assert_says(&fixture.svl(door).stderr, &["look exchanged"]);
            }
        }
        // The truth has the frame of the left camera, which exchanged topics do not.
        let cured = fixture.svl(&format!("{REPLAY} {cure}"));
        assert!(!cured.stderr.contains("exchanged"), "{}", cured.stderr);
        cured.done();
        let facts = fixture.json(&format!("info bag.mcap --json {cure}"))["first_pairs"].take();
        assert_eq!(
            facts["rig"]["baseline_m"]
                .as_f64()
                .map(|m| (m * 1e3).round()),
            Some(44.0)
        );
    }
}

#[test]
fn truths_along_rays_cut_short_or_without_a_cell_and_a_baseline_in_centimetres() {
    let (fixture, frames) = drive();
    let frames = &frames[..12];
    let all = || bag_of(frames, infos(), |_, i| Some(usual(i)));
    // Distances along the rays.
    let rig = *frames[0].rig().unwrap();
    let ranges = frames.iter().map(|frame| {
        let mut frame = frame.clone();
        let truth = frame.truth.as_mut().unwrap();
        let ray = |x: usize, y: usize| {
            let [u, v] = [x as f64 - 159.5, y as f64 - 119.5].map(|at| at / rig.focal_px());
            (1.0 + u * u + v * v).sqrt() as f32
        };
        let px = |x, y| truth.disparity.get(x, y) / ray(x, y);
        truth.disparity = Plane::from_fn(320, 240, px).unwrap();
        frame
    });
    let ranges: Vec<_> = ranges.collect();
    bag::write(
        &fixture.path(""),
        &bag_of(&ranges, infos(), |_, i| Some(usual(i))),
    );
    let said = fixture
        .run(SCORE)
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ");
    assert_says(&said, &["the truth is doubtful", "along the rays"]);
    std::fs::remove_dir_all(fixture.path("r")).unwrap();
    // The first depth image is cut.
    let mut cut = all();
    let first = cut
        .iter_mut()
        .find(|message| message.topic == "/depth")
        .unwrap();
    first.data.truncate(100_000);
    bag::write(&fixture.path(""), &cut);
    assert!(answer(&fixture).ends_with("calibrated, truth from /depth"));
    let report = fixture.json(&format!("{SCORE} --json"));
    assert_eq!(report["algorithms"][0]["scored_pairs"], 11);
    std::fs::remove_dir_all(fixture.path("r")).unwrap();
    // A baseline in centimetres.
    let [left, mut right] = infos();
    right.tx *= 100.0;
    bag::write(
        &fixture.path(""),
        &bag_of(frames, [left, right], |_, i| Some(usual(i))),
    );
    let words = "likely a baseline of 0.044 m instead of 4.4 m, written in centimetres";
    fixture.svl(SCORE).failed(1, &[words]);
    // No distance at all.
    let mut none = messages(frames, infos());
    none.extend(depth_messages(frames, "/depth", &|_| 0.0));
    bag::write(&fixture.path(""), &none);
    let none = fixture.svl(SCORE);
    assert_eq!(none.code, Some(4), "{}", none.stderr);
    let words = "nothing was compared: no cell has enough of the truth /depth";
    assert_says(&none.stderr, &[words]);
}
