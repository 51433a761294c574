//! Recordings of the RealSense SDK, laid out as its `ros2_writer.cpp` does: raw and compressed.

use super::bag::{self, Message};
use super::frames::{bare, image, intact, read};
use super::says::Says;
use crate::cli::fixture::Fixture;
use std::path::Path;
use svl::recording::{Reader, SensorRole, SensorSelection, truth_topics};
use svl::stereo::{Frame, MapDensity, Truth, TruthOrigin};

const SIZE: (usize, usize) = (64, 48);
const FOCAL_PX: f64 = 48.5;
const BASELINE_M: f64 = 0.050_02;
const LEFT: &str = "/device_0/sensor_0/Infrared_1/image/data";
const RIGHT: &str = "/device_0/sensor_0/Infrared_2/image/data";
const DEPTH: &str = "/device_0/sensor_0/Depth_0/image/data";
const UNIT: &str = "/device_0/sensor_0/option/Depth_Units/value";

/// Steps of the depth image, from 0, which is no depth.
fn steps(i: u64) -> Vec<u16> {
    let step = |at| match at % 7 {
        0 => 0,
        _ => 300 + at + 10 * i as u16,
    };
    (0..(SIZE.0 * SIZE.1) as u16).map(step).collect()
}

/// The strings before the first frame, and the extrinsics after it.
fn calibrations(unit: &str) -> [Message; 7] {
    let (width, height) = SIZE;
    let info = format!(
        "width={width};height={height};fx={FOCAL_PX};ppx=31.25;fy={FOCAL_PX};ppy=23.75;model=Brown \
         Conrady;coeffs=0,0,0,0,0"
    );
    let motion = |x: f64| {
        format!(
            "rotation=1.000000,0.000000,0.000000,0.000000,1.000000,0.000000,0.000000,0.000000,\
             1.000000;translation={x:.6},0.000000,0.000000"
        )
    };
    let right = motion(-BASELINE_M);
    [
        bag::string(UNIT, unit),
        bag::string("/device_0/sensor_0/Depth_0/camera_info", &info),
        bag::string("/device_0/sensor_0/Infrared_1/camera_info", &info),
        bag::string("/device_0/sensor_0/Infrared_2/camera_info", &info),
        bag::string("/device_0/sensor_0/Depth_0/tf/ref_0", &motion(0.0)),
        bag::string("/device_0/sensor_0/Infrared_1/tf/ref_0", &motion(0.0)),
        bag::string("/device_0/sensor_0/Infrared_2/tf/ref_0", &right),
    ]
}

fn grey(seed: u64) -> Vec<u8> {
    image(SIZE, seed).pixels().collect()
}

/// Three frames of every stream, 33 ms apart, after their calibrations.
fn messages(unit: &str) -> Vec<Message> {
    let mut all = calibrations(unit).to_vec();
    for i in 0..3 {
        let stamp = (i + 1) * 33_000_000;
        let depth: Vec<u8> = steps(i).into_iter().flat_map(u16::to_le_bytes).collect();
        let image = |frame, topic, late_ns, format, pixels: &[u8]| {
            bag::ros_image_in(frame, topic, stamp + late_ns, SIZE, (format, pixels))
        };
        all.extend([
            image("Depth", DEPTH, 0, "mono16", &depth),
            image("Infrared1", LEFT, 0, "8UC1", &grey(2 * i)),
            image("Infrared2", RIGHT, 90_000, "8UC1", &grey(2 * i + 1)),
        ]);
    }
    all
}

/// The frames with the truth of the depth images.
fn with_truth(path: &Path, topic: &str) -> Vec<Frame> {
    let mut reader = Reader::open(path).unwrap();
    let selection = SensorSelection {
        topic: topic.to_owned(),
        max_skew_ns: 1_000_000,
        role: SensorRole::Truth,
    };
    let mut truth = reader.sensor(&selection).unwrap();
    let mut frames = Vec::new();
    while let Some(mut frame) = reader.next_pair().unwrap() {
        let found = truth.measured(&frame).unwrap();
        frame.truth = found.map(|(map, density)| {
            Truth::measured(map, density, TruthOrigin::Sensor(topic.to_owned()))
        });
        frames.push(frame);
    }
    frames
}

fn check(frames: &[Frame], unit_m: f64) {
    assert_eq!(frames.len(), 3);
    for (i, frame) in (0..).zip(frames) {
        assert_eq!(frame.pair, bare(i, SIZE).pair);
        let rig = frame.rig().unwrap();
        assert_eq!(rig.focal_px(), FOCAL_PX);
        assert_eq!(rig.center_px(), (31.25, 23.75));
        assert!((rig.baseline_m() - BASELINE_M).abs() < 1e-12);
        let truth = frame.truth.as_ref().unwrap();
        assert_eq!(truth.kind.density, MapDensity::Dense);
        for (step, disparity) in steps(i).into_iter().zip(truth.disparity.pixels()) {
            let expected = FOCAL_PX * BASELINE_M / (f64::from(step) * unit_m);
            assert_eq!(step == 0, !disparity.is_finite(), "{disparity}");
            assert!(step == 0 || (f64::from(disparity) / expected - 1.0).abs() < 1e-6);
        }
    }
}

#[test]
fn strings_are_calibration_and_depth_is_truth() {
    for (unit, unit_m) in [("0.001000", 0.001), ("0.000100", 0.0001)] {
        let folder = tempfile::tempdir().unwrap();
        let path = bag::write_sqlite(folder.path(), &messages(unit));
        let reader = Reader::open(&path).unwrap();
        let topics = truth_topics(reader.recording(), &reader.facts().topics);
        assert_eq!(topics.unwrap(), [DEPTH]);
        check(&with_truth(&path, DEPTH), unit_m);
    }
}

/// The SDK compresses whole messages at first, and images as PNG since.
#[test]
fn compressed_recordings_are_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let packed: Vec<_> = messages("0.001000").iter().map(bag::packed).collect();
    let path = bag::write_sqlite(folder.path(), &packed);
    check(&with_truth(&path, DEPTH), 0.001);
    std::fs::remove_file(path).unwrap();
    let mut all = calibrations("0.001000").to_vec();
    let topics = [
        "/device_0/sensor_0/Depth_0/image/data/compressedDepth",
        "/device_0/sensor_0/Infrared_1/image/data/compressed",
        "/device_0/sensor_0/Infrared_2/image/data/compressed",
    ];
    for i in 0..3 {
        let image = |topic, frame, format, png: &[u8]| {
            bag::ros_compressed_in(frame, topic, (i + 1) * 33_000_000, format, png)
        };
        let depth = [vec![0; 12], bag::png(SIZE, &steps(i))].concat();
        let [left, right] = [2 * i, 2 * i + 1].map(|seed| bag::png(SIZE, &grey(seed)));
        let format = "mono8; png compressed mono8";
        all.extend([
            image(topics[0], "Depth", "16UC1; compressedDepth png", &depth),
            image(topics[1], "Infrared1", format, &left),
            image(topics[2], "Infrared2", format, &right),
        ]);
    }
    let path = bag::write_sqlite(folder.path(), &all);
    check(&with_truth(&path, topics[0]), 0.001);
}

#[test]
fn damage_leaves_the_pairs() {
    let folder = tempfile::tempdir().unwrap();
    let all = messages("0.001000");
    // Each string in turn is missing, empty, or cut: the pairs remain, and nothing panics.
    for at in 0..7 {
        let cut = Some("rotation=1,0;translation=nan");
        for text in [None, Some(""), Some("width=64;fx"), cut] {
            let mut broken = all.clone();
            match text {
                Some(text) => broken[at] = bag::string(all[at].topic, text),
                None => drop(broken.remove(at)),
            }
            let path = bag::write_sqlite(folder.path(), &broken);
            let frames = intact(&path);
            assert_eq!(frames.len(), 3, "{at} {text:?}");
            // The depth camera and its unit do not matter for the pairs' distances.
            let has_pairs = ![0, 1, 4].contains(&at);
            assert_eq!(frames[0].rig().is_none(), has_pairs, "{at} {text:?}");
            std::fs::remove_file(path).unwrap();
        }
    }
    let path = bag::write_sqlite(folder.path(), &all);
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() - 4096]).unwrap();
    let (frames, error) = read(&path);
    assert!(frames.len() < 3 && error.is_some());
}

#[test]
fn info_and_scores_are_those_of_the_folder() {
    let fixture = Fixture::new();
    bag::write_sqlite(&fixture.path(""), &messages("0.001000"));
    let info = fixture.run("info bag.db3");
    info.says("rectified").says(DEPTH);
    for i in 0..3 {
        let write = |folder, png| fixture.write(&format!("scene/{folder}/{i}.png"), png);
        write("left", bag::png(SIZE, &grey(2 * i)));
        write("right", bag::png(SIZE, &grey(2 * i + 1)));
        write("depth", bag::png(SIZE, &steps(i)));
    }
    let camera = format!("[{FOCAL_PX} 0 31.25; 0 {FOCAL_PX} 23.75; 0 0 1]");
    let (baseline, (width, height)) = (1000.0 * BASELINE_M, SIZE);
    let calib = format!(
        "cam0={camera}\ncam1={camera}\ndoffs=0\nbaseline={baseline}\nwidth={width}\n\
         height={height}\nndisp=16\n"
    );
    fixture.write("scene/calib.txt", calib);
    let bag = format!("bag.db3 --truth {DEPTH}");
    fixture.assert_same([&bag, "scene --truth depth/*.png"]);
}
