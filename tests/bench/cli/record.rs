//! `svl record` from every source but cameras.

use super::fixture::{Fixture, pgm};
use crate::common::python;
use assert_cmd::cargo::cargo_bin;
use std::process::Command;
use svl::recording::{Recording, Selection};
use svl::source::{RecordingSource, Source};
use svl::stereo::{Frame, Geometry, StereoPair};

#[test]
fn records_the_arena_and_says_how_much() {
    let fixture = Fixture::new();
    fixture.transcript("record --frames 5 -o a.mcap => ^a.mcap: 5 pairs in");
    let mut source = RecordingSource::open(fixture.path("a.mcap")).unwrap();
    assert_eq!(source.pairs(), Some(5));
    let frame = source.next().unwrap().unwrap();
    assert_eq!(frame.pair.size(), (320, 240));
    assert!(frame.truth.is_some() && frame.rig().is_some() && frame.pose.is_some());
}

/// The frames of a recording.
fn frames(fixture: &Fixture, name: &str) -> impl Iterator<Item = Frame> {
    let mut source = RecordingSource::open(fixture.path(name)).unwrap();
    std::iter::from_fn(move || source.next().unwrap())
}

/// Pairs on standard output, as docs/exec-protocol.md says: a line, two images, the truth.
#[test]
fn pairs_go_to_a_program_as_bytes() {
    let fixture = Fixture::new();
    fixture.record("a.mcap", "--frames 3");
    let mut command = Command::new(cargo_bin!("svl"));
    command.args(["record", "a.mcap", "-o", "-"]);
    let ran = command.current_dir(fixture.path("")).output().unwrap();
    assert!(ran.status.success() && ran.stderr.is_empty(), "{ran:?}");
    let mut bytes = &ran.stdout[..];
    let frames: Vec<_> = frames(&fixture, "a.mcap").collect();
    assert_eq!(frames.len(), 3);
    for (sequence, frame) in frames.into_iter().enumerate() {
        let end = bytes.iter().position(|byte| *byte == b'\n').unwrap();
        let line: serde_json::Value = serde_json::from_slice(&bytes[..end]).unwrap();
        let expected = serde_json::json!({
            "width": 320, "height": 240, "sequence": sequence, "stamp_ns": frame.stamp_ns,
            "rig": frame.rig().unwrap(), "truth": true
        });
        for (key, value) in expected.as_object().unwrap() {
            assert_eq!(line[key], *value, "{key}");
        }
        let truth = frame.truth.unwrap().disparity;
        let mut pixels: Vec<u8> = frame.pair.left().pixels().collect();
        pixels.extend(frame.pair.right().pixels());
        pixels.extend(truth.pixels().flat_map(f32::to_le_bytes));
        bytes = bytes[end + 1..].strip_prefix(&pixels[..]).unwrap();
    }
    assert!(bytes.is_empty());
    fixture.fails(
        "record a.mcap -o - --ros2 => 2: --ros2 | are for files\n\
         record a.mcap -o run.txt => 2: run.txt | .mcap",
    );
}

#[test]
fn a_bag_has_the_results_of_its_recording() {
    let fixture = Fixture::new();
    fixture.record("run.mcap", "--frames 3");
    // Results of other pixels are not those of the recorded pairs.
    fixture.transcript(
        "replay run.mcap --algo bm -o result.mcap
        record result.mcap --ros2 --scale 0.5 -o half.mcap => 0~ 3 results not recorded",
    );
    let ran = fixture.svl("record result.mcap --ros2 --from 0.05 -o bag.mcap");
    assert_eq!((ran.code, ran.stderr.as_str()), (Some(0), ""));
    let stored = Recording::open(fixture.path("result.mcap")).unwrap();
    assert_eq!(stored.results().unwrap()[0].range_px, Some(80.0));
    let topics = |name: &str| {
        let bag = Recording::open(fixture.path(name)).unwrap();
        bag.summary(&Selection::default()).unwrap().topics
    };
    let found = topics("bag.mcap");
    for (name, schema) in [
        ("points", "sensor_msgs/msg/PointCloud2"),
        ("scan", "sensor_msgs/msg/LaserScan"),
        ("disparity", "stereo_msgs/msg/DisparityImage"),
        ("depth", "sensor_msgs/msg/Image"),
        ("result", "std_msgs/msg/String"),
    ] {
        let name = format!("/algo/bm/{name}");
        let own = found.iter().find(|topic| topic.name == name).expect(&name);
        assert_eq!((own.schema.as_str(), own.messages), (schema, 2));
    }
    let mut scaled = topics("half.mcap").into_iter();
    assert!(!scaled.any(|topic| topic.name.starts_with("/algo/")));
    // Foreign readers read every message by its definition, which is ROS's.
    let modules = "mcap_ros2, numpy, PIL, rosbags";
    let Some(printed) = python("read_bag.py", modules, [&fixture.path("bag.mcap")]) else {
        return;
    };
    let found: serde_json::Value = serde_json::from_slice(&printed).unwrap();
    let product = found["topics"]["/algo/bm/disparity"][1].as_f64().unwrap();
    let rig = *frames(&fixture, "run.mcap").next().unwrap().rig().unwrap();
    assert!((product / 2.0 - rig.focal_px() * rig.baseline_m()).abs() < 1e-4);
    assert!(found["topics"]["/algo/bm/scan"][1].as_f64().unwrap() > 0.0);
}

#[test]
fn unnamed_recordings_never_collide() {
    Fixture::new().transcript(
        "record --frames 1
        record --frames 1
        test -e recordings/arena-seed1-1.mcap
        test -e recordings/arena-seed1-2.mcap",
    );
}

#[test]
fn same_seed_same_pixels() {
    let fixture = Fixture::new();
    let pixels = |name: &str, args: &str| {
        fixture.run(&format!("record --frames 2 -o {name} {args}"));
        frames(&fixture, name).next().unwrap().pair
    };
    let one = pixels("one.mcap", "--threads 1");
    assert_eq!(one, pixels("again.mcap", "--threads 2 --compress"));
    assert_ne!(one, pixels("other.mcap", "--seed 2"));
}

#[test]
fn a_scene_and_a_folder_of_pairs() {
    let fixture = Fixture::new();
    fixture.write_pair("scene/im0.pgm", "scene/im1.pgm", (40, 20), 3);
    for i in 0..3 {
        let [left, right] = ["left", "right"].map(|side| format!("many/{side}/{i}.pgm"));
        fixture.write_pair(&left, &right, (40, 20), i);
    }
    fixture.write("many/left/alone.pgm", pgm(40, 20, &[0; 800]));
    fixture.transcript(
        "record scene -o scene.mcap
        record many -o many.mcap => 4~ 1 image dropped: without a partner",
    );
    assert_eq!(frames(&fixture, "many.mcap").count(), 3);
}

/// Stamps, pairs and rigs of a recording.
fn pairs(fixture: &Fixture, name: &str) -> Vec<(u64, StereoPair, Geometry)> {
    frames(fixture, name)
        .map(|frame| (frame.stamp_ns, frame.pair, frame.geometry))
        .collect()
}

#[test]
fn a_ros_2_bag_has_the_pairs_of_the_recording() {
    let fixture = Fixture::new();
    fixture.record("a.mcap", "--frames 2");
    for (bag, more) in [("raw.mcap", ""), ("png.mcap", "--compress")] {
        fixture.transcript(&format!(
            "record a.mcap --ros2 -o {bag} {more}
            info {bag} => /stereo/left/image_rect | sensor_msgs/msg/CameraInfo \
            | tf2_msgs/msg/TFMessage | seed            1\\n | !foxglove"
        ));
        assert!(pairs(&fixture, bag) == pairs(&fixture, "a.mcap"), "{bag}");
    }
}

#[test]
fn topics_of_another_programs_recording_are_named() {
    let fixture = Fixture::new();
    fixture.record("a.mcap", "--frames 3");
    let named = "--left /stereo/left/image --right /stereo/right/image";
    let ran = fixture.svl(&format!("record a.mcap -o b.mcap --max-skew-ms 1 {named}"));
    assert_eq!((ran.code, ran.stderr.as_str()), (Some(0), ""));
    assert!(pairs(&fixture, "a.mcap") == pairs(&fixture, "b.mcap"));
    let wrong = "
        replay a.mcap --left /stereo/sync --right /stereo/right/image => \
            1: a.mcap | --left /stereo/sync has messages of svl.StereoSync
        record --left /x -o c.mcap => \
            2: a recording, a folder, and 'arena' is the arena
        replay a.mcap --max-skew-ms -1 => 2: --max-skew-ms
    ";
    fixture.fails(wrong);
}

#[test]
fn a_scenario_is_recorded_with_its_first_seed() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 2);
    fixture.edit(
        "short.toml",
        "later.toml",
        &[["seeds = [1, 2]", "seeds = [7, 8]"]],
    );
    fixture.transcript(
        "record later.toml -o run.mcap -q
        info run.mcap => seed            7\\n
        record later.toml --seed 3 --force -o run.mcap -q
        info run.mcap => seed            3\\n",
    );
}
