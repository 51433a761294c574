//! Depths of topics in another unit, with distortion or without a depth: as truth and as a map.

use super::bag::{self, Camera, Message, camera_info_of, ros_image_in};
use super::calibration_checks::{arena, infos, messages};
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

/// A bag of these depths on a topic.
fn write(fixture: &Fixture, frames: &[Frame], topic: &'static str, scaled: &dyn Fn(f32) -> f32) {
    let mut all = messages(frames, infos());
    all.extend(depth_messages(frames, topic, scaled));
    bag::write(&fixture.path(""), &all);
}

/// Depths on a topic: as 16 bits if it is named so, else as floats.
pub(super) fn depth_messages(
    frames: &[Frame],
    topic: &'static str,
    scaled: &dyn Fn(f32) -> f32,
) -> Vec<Message> {
    let is_short = topic.contains("16");
    let bytes = |z: f32| match is_short {
        true => (z as u16).to_le_bytes().to_vec(),
        false => z.to_le_bytes().to_vec(),
    };
    let encoding = if is_short { "16UC1" } else { "32FC1" };
    let message = |(i, frame): (usize, &Frame)| {
        let bytes: Vec<u8> = depths(frame).map(scaled).pixels().flat_map(bytes).collect();
        let stamp = (i as u64 + 1) * 100_000_000;
        ros_image_in("cam0", topic, stamp, (320, 240), (encoding, &bytes))
    };
    frames.iter().enumerate().map(message).collect()
}

/// The change of a depth.
type Change<'a> = &'a dyn Fn(f32) -> f32;

/// All that a score says, in one line.
fn said(fixture: &Fixture, options: &str) -> String {
    let ran = fixture.svl(&format!("score bag.mcap {options} --rerun none -o r"));
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    std::fs::remove_dir_all(fixture.path("r")).unwrap();
    let said = ran.stdout + &ran.stderr;
    said.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn a_map_and_a_truth_of_another_unit_are_told_apart() {
    let fixture = Fixture::new();
    let frames = arena(&fixture);
    let maps: [(&str, Change<'_>); 4] = [
        ("", &|z| z),
        (
            "its distances are 1000 times those of the truth and of the matchers",
            &|z| 1000.0 * z,
        ),
        (
            "its distances are 2 times those of the truth and of the matchers",
            &|z| 2.0 * z,
        ),
        ("its distances are proportional to disparities", &|z| {
            14.432 / z
        }),
    ];
    let as_truth = [
        "",
        "its distances are 1000 times those of every algorithm",
        "its distances are 2 times those of every algorithm",
        "likely disparities, which a topic has as stereo_msgs/DisparityImage",
    ];
    for ((words, scaled), truth_words) in maps.into_iter().zip(as_truth) {
        // One depth is right and is the truth, the other is the map; then the reverse.
        write(&fixture, &frames, "/depth", scaled);
        let line = said(&fixture, "--algo v5 --truth /depth");
        assert_eq!(
            line.contains("the truth is doubtful"),
            !words.is_empty(),
            "{line}"
        );
        assert!(line.contains(truth_words), "{line}");
        let map = "--algo v5 --algo z=topic:/depth --truth /right";
        let mut all = messages(&frames, infos());
        all.extend(depth_messages(&frames, "/depth", scaled));
        all.extend(depth_messages(&frames, "/right", &|z| z));
        bag::write(&fixture.path(""), &all);
        let line = said(&fixture, map);
        let named = line.contains("the map of z is doubtful");
        assert_eq!(named, !words.is_empty(), "{line}");
        assert!(
            line.contains(words) && !line.contains("the truth is doubtful"),
            "{line}"
        );
    }
}

#[test]
fn values_that_are_no_depths_are_named() {
    let fixture = Fixture::new();
    let frames = arena(&fixture);
    let cases: [(&str, &str, Change<'_>); 5] = [
        (
            "/depth",
            "have the largest depth, 10 m, which likely stands for none",
            &|z| if z > 1.0 { 10.0 } else { z },
        ),
        (
            "/depth16",
            "have the largest depth, 65.535 m, which likely stands for none",
            &|z| {
                if z > 1.0 { 65535.0 } else { 1000.0 * z }
            },
        ),
        ("/depth16", "", &|z| (1000.0 * z).min(60_000.0)),
        ("/range_image", "is named a range image", &|z| z),
        ("/arrange", "", &|z| z),
    ];
    for (topic, words, scaled) in cases {
        write(&fixture, &frames, topic, scaled);
        let line = said(&fixture, &format!("--algo v3 --truth {topic}"));
        let is_named = line.contains(" WARN /");
        assert_eq!(is_named, !words.is_empty(), "{line}");
        assert!(line.contains(words), "{line}");
    }
}

/// The camera of depths has the K of images of twice the size.
#[test]
fn the_calibration_of_a_depth_camera_is_checked() {
    let fixture = Fixture::new();
    let frames = arena(&fixture);
    let says = |factor: f64| {
        let mut all = messages(&frames, infos());
        all.extend(depth_messages(&frames, "/z/image", &|z| z));
        let mut camera = infos()[0];
        camera.k[1..]
            .iter_mut()
            .for_each(|center| *center *= factor);
        let stamps = (1..=frames.len() as u64).map(|i| i * 100_000_000);
        all.extend(stamps.map(|stamp| camera_info_of("/z/camera_info", stamp, &camera)));
        bag::write(&fixture.path(""), &all);
        said(&fixture, "--algo v3 --truth /z/image")
    };
    let words = "/z/image: the principal point (319, 239) of the depth camera is far from";
    assert!(says(2.0).contains(words), "{}", says(2.0));
    assert!(!says(1.0).contains("depth camera"), "{}", says(1.0));
}

/// A depth camera with nearly the left camera's K: its distortion moves its pixels.
#[test]
fn the_distortion_of_a_depth_camera_is_used() {
    let fixture = Fixture::new();
    let frames = arena(&fixture);
    let pixels = |distortion: f64| {
        let mut all = messages(&frames, infos());
        all.extend(depth_messages(&frames, "/z/image", &|z| z));
        let camera = Camera {
            d: &[distortion, 0.0, 0.0, 0.0, 0.0],
            ..infos()[0]
        };
        let stamps = (1..=frames.len() as u64).map(|i| i * 100_000_000);
        all.extend(stamps.map(|stamp| camera_info_of("/z/camera_info", stamp, &camera)));
        bag::write(&fixture.path(""), &all);
        fixture.json("info bag.mcap --json")["first_pairs"]["truths"].take()
    };
    let [plain, distorted] = [0.0, -0.3].map(pixels);
    assert!(plain[0]["scored_cells"].as_u64() > Some(0), "{plain}");
    assert_ne!(plain[0]["disparity_px"], distorted[0]["disparity_px"]);
}
