//! Depths of topics in another unit, with distortion or without a depth: as truth and as a map.

use super::bag::{Bag, Camera, Message, camera_info_of, float_image, ros_image_in};
use super::calibration_checks::{ARENA, arena, messages, stamp};
use super::says::Says;
use crate::cli::fixture::Fixture;
use svl::stereo::{Frame, Plane};

/// The true depths of a frame, 0 where there is none, with an error of some per mille.
fn depths(frame: &Frame) -> Plane<f32> {
    let rig = frame.rig().unwrap();
    let truth = &frame.truth.as_ref().unwrap().disparity;
    Plane::from_fn(320, 240, |x, y| {
        let depth = rig.depth_m(truth.get(x, y).into()).unwrap_or(0.0);
        let error = ((7 * x + 13 * y) % 11) as f64 / 1000.0;
        (depth * (1.0 + error)) as f32
    })
    .unwrap()
}

/// The pairs of these frames, and their depths on a topic.
fn bag_of(frames: &[Frame], topic: &'static str, scaled: Change<'_>) -> Bag {
    Bag(messages(frames, ARENA)).and(depth_messages(frames, topic, scaled))
}

/// Depths on a topic: as 16 bits if it is named so, else as floats.
pub(super) fn depth_messages(
    frames: &[Frame],
    topic: &'static str,
    scaled: Change<'_>,
) -> Vec<Message> {
    let message = |(i, frame): (u64, &Frame)| {
        let depths = depths(frame).map(scaled);
        if !topic.contains("16") {
            return float_image("cam0", topic, stamp(i), &depths);
        }
        let bytes: Vec<u8> = depths
            .pixels()
            .flat_map(|z| (z as u16).to_le_bytes())
            .collect();
        ros_image_in("cam0", topic, stamp(i), depths.size(), ("16UC1", &bytes))
    };
    (0..).zip(frames).map(message).collect()
}

/// The change of a depth.
type Change<'a> = &'a dyn Fn(f32) -> f32;

/// All that a score says, in one line.
fn said(fixture: &Fixture, options: &str) -> String {
    let ran = fixture
        .svl(&format!("score bag.mcap {options} --rerun none -o r"))
        .exits(0);
    std::fs::remove_dir_all(fixture.path("r")).unwrap();
    ran.line()
}

#[test]
fn a_map_and_a_truth_of_another_unit_are_told_apart() {
    let fixture = Fixture::new();
    let frames = arena(&fixture);
    // What is said of a map, and of a truth.
    let cases: [(&str, &str, Change<'_>); 4] = [
        ("", "", &|z| z),
        (
            "its distances are 1000 times those of the truth and of the matchers",
            "its distances are 1000 times those of every algorithm",
            &|z| 1000.0 * z,
        ),
        (
            "its distances are 2 times those of the truth and of the matchers",
            "its distances are 2 times those of every algorithm",
            &|z| 2.0 * z,
        ),
        (
            "its distances are proportional to disparities",
            "likely disparities, which a topic has as stereo_msgs/DisparityImage",
            &|z| 14.432 / z,
        ),
    ];
    for (words, truth_words, scaled) in cases {
        let is_named = !words.is_empty();
        // One depth is right and is the truth, the other is the map; then the reverse.
        let bag = bag_of(&frames, "/depth", scaled);
        bag.write(&fixture);
        said(&fixture, "--algo v5 --truth /depth")
            .says_if(is_named, "the truth is doubtful")
            .says(truth_words);
        bag.and(depth_messages(&frames, "/right", &|z| z))
            .write(&fixture);
        said(&fixture, "--algo v5 --algo z=topic:/depth --truth /right")
            .says_if(is_named, "the map of z is doubtful")
            .says(words)
            .lacks("the truth is doubtful");
    }
}

#[test]
fn values_that_are_no_depths_are_named() {
    let fixture = Fixture::new();
    let frames = arena(&fixture);
    let largest = |m: f32| format!("have the largest depth, {m} m, which likely stands for none");
    let [ten, most] = [10.0, 65.535].map(largest);
    let to_ten: Change<'_> = &|z| if z > 1.0 { 10.0 } else { z };
    let to_most: Change<'_> = &|z| if z > 1.0 { 65535.0 } else { 1000.0 * z };
    let cases: [(&str, &str, Change<'_>); 5] = [
        ("/depth", &ten, to_ten),
        ("/depth16", &most, to_most),
        ("/depth16", "", &|z| (1000.0 * z).min(60_000.0)),
        ("/range_image", "is named a range image", &|z| z),
        ("/arrange", "", &|z| z),
    ];
    for (topic, words, scaled) in cases {
        bag_of(&frames, topic, scaled).write(&fixture);
        said(&fixture, &format!("--algo v3 --truth {topic}"))
            .says_if(!words.is_empty(), " WARN /")
            .says(words);
    }
}

/// Depths on `/z/image`, with this calibration.
fn calibrated(frames: &[Frame], camera: &Camera<'_>) -> Bag {
    let info = |i| camera_info_of("/z/camera_info", stamp(i), camera);
    let infos = (0..frames.len() as u64).map(info);
    bag_of(frames, "/z/image", &|z| z).and(infos)
}

/// The camera of depths has the K of images of twice the size.
#[test]
fn the_calibration_of_a_depth_camera_is_checked() {
    let fixture = Fixture::new();
    let frames = arena(&fixture);
    let says = |factor: f64| {
        let mut camera = ARENA.cameras[0];
        camera.k[1..]
            .iter_mut()
            .for_each(|center| *center *= factor);
        calibrated(&frames, &camera).write(&fixture);
        said(&fixture, "--algo v3 --truth /z/image")
    };
    says(2.0).says("/z/image: the principal point (319, 239) of the depth camera is far from");
    says(1.0).lacks("depth camera");
}

/// A depth camera with nearly the left camera's K: its distortion moves its pixels.
#[test]
fn the_distortion_of_a_depth_camera_is_used() {
    let fixture = Fixture::new();
    let frames = arena(&fixture);
    let [plain, distorted] = [0.0, -0.3].map(|distortion| {
        let mut camera = ARENA.cameras[0];
        let d = [distortion, 0.0, 0.0, 0.0, 0.0];
        camera.d = &d;
        calibrated(&frames, &camera).write(&fixture);
        fixture.first_pairs("")["truths"].take()
    });
    assert!(plain[0]["scored_cells"].as_u64() > Some(0), "{plain}");
    assert_ne!(plain[0]["disparity_px"], distorted[0]["disparity_px"]);
}
