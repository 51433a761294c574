//! Hints of `svl score`: each appears for a recording made for it, and none for a sound one.

use super::bag::{self, CAMERA, Camera, Message, camera_info_of, ros_image};
use super::frames::{image, read, record, stamp};
use super::sensor::{cloud, tf};
use super::stamps::stamped;
use crate::cli::fixture::{Fixture, assert_says};
use svl::recording::ImageFormat;
use svl::stereo::{Frame, StereoPair};

const SIZE: (usize, usize) = (64, 48);
/// Words that identify the hints: swapped images, scale, calibration, transform.
const HINTS: [&str; 7] = [
    "look exchanged",
    "the truth is doubtful",
    "the calibration changes",
    "is used for /points",
    "images without a stamp",
    "images share a stamp",
    "not in 'lidar'",
];

/// The warnings of a score that are hints, as indices of [`HINTS`] with their lines.
#[track_caller]
fn hints(fixture: &Fixture, what: &str) -> Vec<(usize, String)> {
    let ran = fixture.svl(&format!("score {what} --rerun none -o report"));
    // A truth may have no cell.
    assert!(matches!(ran.code, Some(0 | 4)), "{}", ran.stderr);
    let hint = |line: &str| {
        let place = HINTS.iter().position(|words| line.contains(words))?;
        Some((place, line.to_owned()))
    };
    ran.stderr
        .lines()
        .chain(ran.stdout.lines())
        .filter_map(hint)
        .collect()
}

/// The only hint.
#[track_caller]
fn only(fixture: &Fixture, what: &str, place: usize) -> String {
    match &hints(fixture, what)[..] {
        [(found, line)] if *found == place => line.clone(),
        other => panic!("{what}: {other:?}"),
    }
}

/// The arena, and its pairs changed, as `changed.mcap`.
fn arena(fixture: &Fixture) -> Vec<Frame> {
    fixture.write_short_arena("arena.toml", 8);
    fixture.run("record arena.toml -o arena.mcap");
    read(&fixture.path("arena.mcap")).0
}

fn write(fixture: &Fixture, frames: impl Iterator<Item = Frame>) {
    let frames: Vec<_> = frames.collect();
    let path = record(&fixture.path(""), &frames, ImageFormat::Raw);
    std::fs::rename(path, fixture.path("changed.mcap")).unwrap();
}

#[test]
fn sound_recordings_have_no_hints() {
    let fixture = Fixture::new();
    arena(&fixture);
    fixture.run("record arena.mcap --ros2 -o ros.mcap");
    assert_eq!(hints(&fixture, "arena.mcap --algo bm --algo v1"), []);
    let ros = "ros.mcap --truth /truth/depth --algo bm --algo v5";
    assert_eq!(hints(&fixture, ros), []);
}

#[test]
fn distances_of_another_scale_than_the_truth_are_noticed() {
    let fixture = Fixture::new();
    let frames = arena(&fixture);
    for (factor, cause) in [
        (2.0, "twice the size"),
        (0.5, "half the size"),
        (1000.0, "the baseline is in millimetres"),
        (0.001, "the truth is in millimetres"),
    ] {
        // The recording contains depths, which are nearer by that factor.
        write(
            &fixture,
            frames.iter().cloned().map(|mut frame| {
                let truth = frame.truth.as_mut().unwrap();
                truth.disparity = truth.disparity.map(|d| d * factor);
                frame
            }),
        );
        let what = "score changed.mcap --algo v3 --algo bm --rerun none -o report";
        let ran = fixture.svl(what);
        let said = ran.stdout + &ran.stderr;
        let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
        // Nearer than a millimetre.
        let code = if factor == 1000.0 { 1 } else { 0 };
        assert_eq!(ran.code, Some(code), "{said}");
        assert_eq!(said.matches(cause).count(), 1, "{said}");
        assert_says(
            &said,
            &[
                "the truth",
                "likely its disparities divided by",
                "--calib FILE",
            ],
        );
    }
}

#[test]
fn exchanged_images_are_noticed() {
    let fixture = Fixture::new();
    let frames = arena(&fixture);
    write(
        &fixture,
        frames.into_iter().map(|frame| {
            let [left, right] = frame.pair.into_images();
            Frame {
                pair: StereoPair::new(right, left).unwrap(),
                truth: None,
                ..frame
            }
        }),
    );
    let line = only(&fixture, "changed.mcap --algo bm", 0);
    assert_says(&line, &["changed.mcap", "--left and --right"]);
    let cured = "changed.mcap --left /stereo/right/image --right /stereo/left/image --algo bm";
    assert_eq!(hints(&fixture, cured), []);
}

/// Rectified pairs with a rig, whose right camera has these fourth columns of P, one after the
/// other.
fn pairs(offsets: &[f64]) -> Vec<Message> {
    let pair = |(i, offset): (usize, &f64)| {
        let i = i as u64;
        let info = |topic, tx| {
            let camera = Camera {
                size: (SIZE.0 as u32, SIZE.1 as u32),
                tx,
                ..CAMERA
            };
            camera_info_of(topic, stamp(i), &camera)
        };
        let image = |topic, seed| {
            let pixels: Vec<u8> = image(SIZE, seed).pixels().collect();
            ros_image(topic, stamp(i), SIZE, "mono8", &pixels)
        };
        [
            info("/cam0/camera_info", 0.0),
            info("/cam1/camera_info", *offset),
            image("/cam0/image_rect", 2 * i),
            image("/cam1/image_rect", 2 * i + 1),
        ]
    };
    offsets.iter().enumerate().flat_map(pair).collect()
}

#[test]
fn a_calibration_that_changes_is_noticed() {
    let fixture = Fixture::new();
    bag::write(&fixture.path(""), &pairs(&[-14.0; 4]));
    assert_eq!(hints(&fixture, "bag.mcap --algo v3"), []);
    bag::write(&fixture.path(""), &pairs(&[-14.0, -14.0, -28.0, -14.0]));
    let line = only(&fixture, "bag.mcap --algo v3", 2);
    assert_says(
        &line,
        &[
            "/cam1/camera_info",
            "-14.000, then -28.000",
            "each pair uses that of its stamp",
        ],
    );
}

#[test]
fn transforms_that_differ_are_noticed() {
    let fixture = Fixture::new();
    let points = |i| cloud("lidar", stamp(i), &[[0.0, 0.0, 1.0]]);
    let static_tf = |x: f64| tf("/tf_static", &[("cam", "lidar", [x, 0.0, 0.0])]);
    let inverse = |x: f64| tf("/tf_static", &[("lidar", "cam", [-x, 0.0, 0.0])]);
    let bag = |second: Message| {
        let mut messages = vec![static_tf(0.1)];
        messages.extend(pairs(&[-14.0; 3]));
        messages.extend((0..2).map(points));
        messages.push(second);
        messages.push(points(2));
        bag::write(&fixture.path(""), &messages);
        hints(&fixture, "bag.mcap --truth /points --algo v3")
    };
    assert_eq!([bag(static_tf(0.1)), bag(inverse(0.1))], [[], []]);
    for (second, frames) in [
        (static_tf(0.3), "'lidar' in 'cam'"),
        // They form a cycle.
        (inverse(0.3), "'cam' in 'lidar'"),
    ] {
        let found = bag(second);
        assert_eq!(found.len(), 1, "{found:?}");
        let differ = format!("{frames} differ by 0.2000 m");
        assert_says(&found[0].1, &["/tf_static", &differ]);
    }
}

#[test]
fn stamps_that_say_little_are_noticed() {
    let fixture = Fixture::new();
    let messages = |stamp_of: &dyn Fn(u64) -> u64| {
        let places = 0_u64..;
        let all = pairs(&[-14.0; 4]).into_iter().zip(places);
        let all = all.map(|(message, place)| {
            let pair = place / 4;
            stamped(&message, stamp_of(pair), stamp(pair))
        });
        bag::write(&fixture.path(""), &all.collect::<Vec<_>>());
    };
    messages(&stamp);
    assert_eq!(hints(&fixture, "bag.mcap --algo v3"), []);
    messages(&|_| 0);
    let line = only(&fixture, "bag.mcap --algo v3", 4);
    assert_says(&line, &["/cam0/image_rect", "the log time"]);
    messages(&|_| stamp(0));
    let line = only(&fixture, "bag.mcap --algo v3", 5);
    assert_says(&line, &["in the order of the file"]);
}

#[test]
fn measurements_in_another_frame_than_the_first_are_left_out() {
    let fixture = Fixture::new();
    let mut messages = vec![tf("/tf_static", &[("cam", "lidar", [0.1, 0.0, 0.0])])];
    messages.extend(pairs(&[-14.0; 3]));
    let frames = ["lidar", "other", "/lidar"].into_iter().zip(0..);
    messages.extend(frames.map(|(frame, i)| cloud(frame, stamp(i), &[[0.0, 0.0, 1.0]])));
    bag::write(&fixture.path(""), &messages);
    let line = only(&fixture, "bag.mcap --truth /points --algo v3", 6);
    assert_says(&line, &["/points", "it is in 'other'", "left out"]);
}
