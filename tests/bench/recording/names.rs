//! Names of topics and frames: what they decide, and what a measurement says against them.

use super::bag::{self, Message, camera_info, ros_image_in};
use super::frames::{START_NS, image, stamp};
use super::sensor::tf;
use crate::cli::fixture::{Fixture, assert_says};

const SIZE: (usize, usize) = (24, 16);

/// Three pairs of images in frames, after these messages.
fn write(fixture: &Fixture, first: Vec<Message>, images: [(&'static str, &str); 2]) {
    let mut messages = first;
    for i in 0..3 {
        messages.extend(images.iter().zip(0..).map(|(&(topic, frame), side)| {
            let pixels: Vec<u8> = image(SIZE, 2 * i + side).pixels().collect();
            ros_image_in(frame, topic, stamp(i), SIZE, ("mono8", &pixels))
        }));
    }
    bag::write(&fixture.path(""), &messages);
}

/// The baseline by `svl info`, millimetres, and its warnings.
fn baseline(fixture: &Fixture, options: &str) -> (Option<i64>, String) {
    let ran = fixture.svl(&format!("info bag.mcap --json {options}"));
    let answer = ran.json();
    let metres = answer["first_pairs"]["rig"]["baseline_m"].as_f64();
    (
        metres.map(|metres| (1e3 * metres).round() as i64),
        ran.stderr,
    )
}

#[test]
fn calibrations_of_any_name_are_named() {
    let fixture = Fixture::new();
    let infos = vec![
        camera_info("/a/rear", START_NS, &[], 0.0),
        camera_info("/b/front", START_NS, &[], -14.432),
        camera_info("/c/top", START_NS, &[], -28.0),
    ];
    let images = [("/cam0/image_rect", "p"), ("/cam1/image_rect", "q")];
    write(&fixture, infos, images);
    let unnamed = fixture.svl("info bag.mcap").stderr;
    assert_says(
        &unnamed,
        &["/a/rear, /b/front, /c/top", "--left-info TOPIC"],
    );
    let options = "--left-info /a/rear --right-info /b/front";
    let (found, warnings) = baseline(&fixture, options);
    assert_eq!(found, Some(44));
    // The user's word is above the frames.
    assert!(!warnings.contains("frame"), "{warnings}");
    for door in ["record bag.mcap -o own.mcap", "replay bag.mcap --algo v3"] {
        let ran = fixture.svl(&format!("{door} {options}"));
        assert_eq!(ran.code, Some(0), "{door}: {}", ran.stderr);
        assert!(!ran.stderr.contains("distances"), "{door}: {}", ran.stderr);
    }
    for (wrong, why) in [
        (
            "bag.mcap --left-info /cam0/image_rect",
            "no such topic of calibrations; it has /a/rear",
        ),
        ("arena --left-info /a/rear", "--left-info is for"),
    ] {
        let ran = fixture.svl(&format!("record {wrong} -o never.mcap"));
        assert_ne!(ran.code, Some(0), "{wrong}");
        assert_says(&ran.stderr, &[why]);
    }
}

#[test]
fn each_of_two_robots_has_the_transforms_of_its_namespace() {
    let fixture = Fixture::new();
    let robot = |topic, metres| tf(topic, &[("l", "r", [metres, 0.0, 0.0])]);
    let infos = |left, right| [left, right].map(|topic| camera_info(topic, START_NS, &[], 0.0));
    let images = [("/one/cam0/image_rect", "l"), ("/one/cam1/image_rect", "r")];
    let mut first = vec![robot("/two/tf_static", 0.2), robot("/one/tf_static", 0.1)];
    first.extend(infos("/one/cam0/camera_info", "/one/cam1/camera_info"));
    write(&fixture, first, images);
    let (found, warnings) = baseline(&fixture, "");
    assert_eq!(found, Some(100), "{warnings}");
    assert_says(
        &warnings,
        &["/two/tf_static: not used", "/one/cam0/image_rect"],
    );

    let mut first = vec![robot("/two/tf_static", 0.2), robot("/three/tf_static", 0.3)];
    first.extend(infos("/one/cam0/camera_info", "/one/cam1/camera_info"));
    write(&fixture, first, images);
    let (found, warnings) = baseline(&fixture, "");
    assert_eq!(found, None);
    assert_says(&warnings, &["/three/tf_static, /two/tf_static: not used"]);

    // The only one is that of the cameras' robot, whatever its namespace.
    let mut first = vec![robot("/two/tf_static", 0.2)];
    first.extend(infos("/one/cam0/camera_info", "/one/cam1/camera_info"));
    write(&fixture, first, images);
    let (found, warnings) = baseline(&fixture, "");
    assert_eq!(found, Some(200), "{warnings}");
}

#[test]
fn names_that_contradict_a_measurement_are_named_and_nothing_is_exchanged() {
    let fixture = Fixture::new();
    let infos = |left, right| {
        vec![
            camera_info("/cam0/camera_info", START_NS, &[], left),
            camera_info("/cam1/camera_info", START_NS, &[], right),
        ]
    };
    let images = [("/cam0/image_rect", "l"), ("/cam1/image_rect", "r")];
    // Names alone: P of the left topic is that of a right camera.
    write(&fixture, infos(-14.432, 0.0), images);
    let ran = fixture.svl("info bag.mcap");
    let words = ran.stdout.split_whitespace().collect::<Vec<_>>().join(" ");
    let parts = [
        "no calibration",
        "0.0440 m to the left",
        "--left and --right",
    ];
    assert_says(&words, &parts);
    // Frames alone.
    let mut first = infos(0.0, -14.432);
    first.push(tf("/tf_static", &[("l", "r", [-0.044, 0.0, 0.0])]));
    write(&fixture, first, images);
    let (found, _) = baseline(&fixture, "");
    assert_eq!(found, Some(44));
    let ran = fixture.svl("info bag.mcap");
    let words = ran.stdout.split_whitespace().collect::<Vec<_>>().join(" ");
    let said = [
        "0.0440 m to the right",
        "0.0440 m to the left by /tf_static",
    ];
    assert_says(&words, &said);
}
