//! svl's recordings, read by the public MCAP libraries.

use super::frames::full;
use crate::common::python;
use svl::recording::{Dialect, Header, ImageFormat, RecordingFormat, Writer};
use svl::stereo::{Frame, Gray, Side, Surface, Visibility};

const SIZE: (usize, usize) = (61, 47);
const FRAMES: u64 = 5;

fn pixel_sum(image: &Gray) -> f64 {
    image.pixels().map(f64::from).sum()
}

/// Value that a foreign reader should find under each topic, summed over all frames.
fn expected(topic: &str, frame: &Frame) -> f64 {
    let (rig, truth) = (frame.rig().unwrap(), frame.truth.as_ref().unwrap());
    let pose = frame.pose.unwrap();
    let calibration = |side| rig.intrinsics(side).sum() + rig.projection(side).sum() + 3.0;
    match topic {
        "/stereo/left/image" | "/stereo/left/image_rect" | "/stereo/left/image_rect/compressed" => {
            pixel_sum(frame.pair.left())
        }
        "/stereo/right/image"
        | "/stereo/right/image_rect"
        | "/stereo/right/image_rect/compressed" => pixel_sum(frame.pair.right()),
        "/stereo/left/calibration" | "/stereo/left/camera_info" => calibration(Side::Left),
        "/stereo/right/calibration" | "/stereo/right/camera_info" => calibration(Side::Right),
        "/rig/baseline" => rig.baseline_m() + 1.0,
        "/rig/pose" | "/tf" => pose.translation.vector.sum() + pose.rotation.coords.sum(),
        "/truth/depth" => truth
            .disparity
            .pixels()
            .filter_map(|d| rig.depth_m(d.into()))
            .filter(|z| *z > 0.0)
            .sum(),
        "/truth/visibility" => {
            let visibility = truth.visibility.as_ref().unwrap();
            pixel_sum(&visibility.map(|v: Visibility| v as u8))
        }
        "/truth/surface" => {
            let surface = truth.surface.as_ref().unwrap();
            pixel_sum(&surface.map(|s: Surface| s as u8))
        }
        "/stereo/sync" => frame.sequence as f64,
        other => panic!("unexpected topic {other}"),
    }
}

/// The recording of `frames` as read by the script; `None` if Python lacks one of `modules`.
fn read_by(
    script: &str,
    modules: &str,
    frames: &[Frame],
    format: RecordingFormat,
) -> Option<serde_json::Value> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let mut header = Header::new("arena");
    header.seed = Some(7);
    let mut writer = Writer::create(&path, &header, format).unwrap();
    let (media, text) = ("application/toml", b"seed = 7");
    writer.attach("scenario.toml", media, text).unwrap();
    frames.iter().for_each(|frame| writer.write(frame).unwrap());
    writer.finish().unwrap();
    let printed = python(script, modules, [&path])?;
    Some(serde_json::from_slice(&printed).unwrap())
}

/// Checks the counts and sums of topics against the written ones.
fn compare(found: &serde_json::Value, frames: &[Frame], topics: usize) {
    let found = found["topics"].as_object().unwrap();
    assert_eq!(found.len(), topics);
    for (topic, found) in found {
        let sum: f64 = frames.iter().map(|frame| expected(topic, frame)).sum();
        let error = (found[1].as_f64().unwrap() - sum).abs();
        let is_equal = error <= 1e-6 * sum.abs();
        assert!(is_equal, "{topic}: {found} found, {sum} written");
        assert_eq!(found[0], FRAMES, "{topic}");
    }
}

#[test]
fn python_reads_raw_and_compressed_recordings() {
    let frames: Vec<_> = (0..FRAMES).map(|i| full(i, SIZE)).collect();
    let modules = "mcap, mcap_protobuf, mcap_ros2, numpy, PIL";
    for images in [ImageFormat::Raw, ImageFormat::Png] {
        let Some(found) = read_by("read_recording.py", modules, &frames, images.into()) else {
            return;
        };
        assert_eq!(found["metadata"]["svl"]["seed"], "7");
        assert_eq!(found["attachments"]["scenario.toml"], "seed = 7");
        compare(&found, &frames, 10);
    }
}

#[test]
fn rosbags_reads_a_ros_2_bag() {
    let frames: Vec<_> = (0..FRAMES).map(|i| full(i, SIZE)).collect();
    let modules = "mcap_ros2, numpy, PIL, rosbags";
    let dialect = Dialect::Ros2;
    for images in [ImageFormat::Raw, ImageFormat::Png] {
        let format = RecordingFormat { dialect, images };
        let Some(found) = read_by("read_bag.py", modules, &frames, format) else {
            return;
        };
        compare(&found, &frames, 9);
    }
}
