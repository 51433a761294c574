//! Images of every pixel encoding equal what OpenCV or numpy makes of them, pixel by pixel, as
//! pairs and as truth: `tests/python/image_encodings.py` writes the bags and computes the pixels.

use super::bag::{FB, open};
use crate::common::python;
use serde_json::Value;
use std::path::Path;
use svl::recording::{Reader, Recording, Selection, truth_topics};
use svl::stereo::Frame;

const SIZE: (usize, usize) = (14, 10);

/// The only pair of two topics.
fn pair(recording: &Recording, name: &str) -> Frame {
    let topic = |side| Some(format!("/{name}/{side}/image_rect"));
    let selection = Selection {
        left: topic("left"),
        right: topic("right"),
        ..Selection::default()
    };
    let mut reader = Reader::new(recording.clone(), &selection).unwrap();
    reader.next_pair().unwrap().expect(name)
}

/// The numbers of a value, each with its place in rows of `width`.
fn placed(values: &Value, width: usize) -> impl Iterator<Item = ((usize, usize), f64)> {
    let values = values.as_array().unwrap().iter().enumerate();
    values.map(move |(i, value)| ((i % width, i / width), value.as_f64().unwrap()))
}

/// OpenCV fills the border of a demosaiced image otherwise.
fn is_compared(name: &str, (x, y): (usize, usize)) -> bool {
    let is_inside = (1..SIZE.0 - 1).contains(&x) && (1..SIZE.1 - 1).contains(&y);
    !name.starts_with("bayer_") || is_inside
}

fn check_pair(name: &str, frame: &Frame, expected: &Value) {
    let images = [frame.pair.left(), frame.pair.right()];
    for (side, image) in images.into_iter().enumerate() {
        assert_eq!(image.size(), SIZE, "{name}");
        let [grey, rgb] = [0, 1].map(|i| &expected[side][i]);
        for (at, expected) in placed(grey, SIZE.0).filter(|(at, _)| is_compared(name, *at)) {
            let found = f64::from(image.get(at.0, at.1));
            assert_eq!(found, expected, "{name} at {at:?}");
        }
        let color = frame.color.as_ref().map(|colors| &colors[side]);
        assert_eq!(color.is_some(), !rgb.is_null(), "{name}");
        let Some(color) = color else { continue };
        for ((x, y), expected) in placed(rgb, 3 * SIZE.0) {
            let at = (x / 3, y);
            let found = color.get(at.0, at.1)[x % 3];
            let is_right = !is_compared(name, at) || f64::from(found) == expected;
            assert!(is_right, "{name} at {at:?}: {found}, {expected}");
        }
    }
}

fn check_truth(bag: &Path, topic: &str, expected: &Value) {
    let mut source = open(bag, topic).unwrap().source;
    let frame = source.next().unwrap().unwrap();
    let truth = frame.truth.expect(topic).disparity;
    for ((x, y), metres) in placed(expected, SIZE.0) {
        let found = f64::from(truth.get(x, y));
        let depth = FB / found;
        assert_eq!(found.is_finite(), metres > 0.0, "{topic} at {x}, {y}");
        let is_right = found.is_infinite() || (depth / metres - 1.0).abs() < 1e-6;
        assert!(is_right, "{topic} at {x}, {y}: {depth} m, {metres} m");
    }
}

#[test]
fn every_encoding_is_read_as_opencv_and_numpy_do() {
    let folder = tempfile::tempdir().unwrap();
    let modules = "cv2, numpy, rosbags";
    let Some(printed) = python("image_encodings.py", modules, [folder.path()]) else {
        return;
    };
    let expected: Value = serde_json::from_slice(&printed).unwrap();
    let recording = Recording::open(folder.path().join("images")).unwrap();
    let images = expected["images"].as_object().unwrap();
    assert_eq!(images.len(), 45);
    for (name, expected) in images {
        check_pair(name, &pair(&recording, name), expected);
    }
    let depths = expected["depths"].as_object().unwrap();
    assert_eq!(depths.len(), 19);
    for (topic, expected) in depths {
        check_truth(&folder.path().join("depths"), topic, expected);
    }
    let reader = Reader::open(folder.path().join("depths")).unwrap();
    let topics = truth_topics(reader.recording(), &reader.facts().topics);
    assert_eq!(topics.unwrap().len(), depths.len());
}
