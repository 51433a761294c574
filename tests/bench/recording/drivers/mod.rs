//! The drivers of docs/cameras.md: a bag of each, with the topics, encodings, frames, QoS and order
//! of messages that its published source gives, is recorded and scored.
//!
//! All show a wall at 1.5 m, so the distances, and the scores against each driver's truth, prove
//! that pair, calibration, truth and frames belong together.

mod bags;
mod scene;

use super::ros1;
use crate::cli::fixture::{Fixture, assert_says, has};
use crate::recording::bag::{self, Message};
use scene::{BASELINE_M, DEPTH_M, PAIRS};
use std::path::Path;

/// A driver, and what svl does with its bag.
struct Driver {
    /// Row of the driver in docs/cameras.md.
    name: &'static str,
    bag: fn() -> Vec<Message>,
    storage: Storage,
    /// Durability of its images' publisher; that of static transforms is transient local.
    durability: &'static str,
    /// First line of `svl info`; `{rational}` is the model of the scene.
    usable: &'static str,
    /// Topics of the pair.
    pair: [&'static str; 2],
    /// Options by which it is recorded and scored.
    options: &'static str,
    /// Topic of its truth.
    truth: Option<&'static str>,
    needs_ffmpeg: bool,
}

/// File format of a bag.
#[derive(Clone, Copy, PartialEq)]
enum Storage {
    Mcap,
    Ros1,
}

/// A driver of ROS 2 with a calibration and no truth.
const ROS2: Driver = Driver {
    name: "",
    bag: Vec::new,
    storage: Storage::Mcap,
    durability: "volatile",
    usable: "",
    pair: [""; 2],
    options: "",
    truth: None,
    needs_ffmpeg: false,
};

const DRIVERS: &[Driver] = &[
    Driver {
        name: "RealSense D4xx",
        bag: bags::realsense,
        usable: "usable: 6 rectified pairs, calibrated, truth from \
                 /camera/camera/depth/image_rect_raw",
        pair: [
            "/camera/camera/infra1/image_rect_raw",
            "/camera/camera/infra2/image_rect_raw",
        ],
        truth: Some("/camera/camera/depth/image_rect_raw"),
        ..ROS2
    },
    Driver {
        name: "OAK-D",
        bag: bags::depthai,
        usable: "usable: 6 raw pairs ({rational}), calibrated, truth from /oak/stereo/image_raw",
        pair: ["/oak/left/image_raw", "/oak/right/image_raw"],
        truth: Some("/oak/stereo/image_raw"),
        ..ROS2
    },
    Driver {
        name: "ZED",
        bag: bags::zed,
        usable: "usable: 6 rectified pairs, calibrated, truth from \
                 /zed/zed_node/depth/depth_registered",
        pair: [
            "/zed/zed_node/left/gray/rect/image",
            "/zed/zed_node/right/gray/rect/image",
        ],
        truth: Some("/zed/zed_node/depth/depth_registered"),
        ..ROS2
    },
    Driver {
        name: "Bumblebee",
        bag: bags::bumblebee,
        storage: Storage::Ros1,
        usable: "usable: 6 raw pairs (plumb_bob), calibrated, no truth",
        pair: ["/camera/left/image_raw", "/camera/right/image_raw"],
        ..ROS2
    },
    Driver {
        name: "FLIR pair by trigger",
        bag: bags::flir,
        usable: "usable: 6 raw pairs (plumb_bob), calibrated, no truth",
        pair: ["/cam_sync/cam_0/image_raw", "/cam_sync/cam_1/image_raw"],
        ..ROS2
    },
    Driver {
        name: "Argus",
        bag: bags::argus,
        usable: "usable: 6 raw pairs ({rational}), calibrated, no truth",
        pair: ["/left/image_raw", "/right/image_raw"],
        ..ROS2
    },
    Driver {
        name: "Isaac ROS, rectified",
        bag: bags::isaac_rectified,
        usable: "usable: 6 rectified pairs, calibrated, no truth",
        pair: ["/left/image_rect", "/right/image_rect"],
        ..ROS2
    },
    Driver {
        name: "Isaac ROS, H.264",
        bag: bags::isaac_h264,
        usable: "usable: 6 raw pairs ({rational}), calibrated, no truth",
        pair: [
            "/front_stereo_camera/left/image_compressed",
            "/front_stereo_camera/right/image_compressed",
        ],
        needs_ffmpeg: true,
        ..ROS2
    },
    Driver {
        name: "Azure Kinect, as truth",
        bag: bags::azure_kinect,
        durability: "transient_local",
        usable: "usable: 6 rectified pairs, calibrated, truth from /depth/image_raw, \
                 /depth_to_rgb/image_raw, /points2",
        pair: ["/stereo/left/image_rect", "/stereo/right/image_rect"],
        truth: Some("/depth/image_raw"),
        ..ROS2
    },
    Driver {
        name: "EuRoC-like rig",
        bag: bags::euroc,
        storage: Storage::Ros1,
        usable: "not usable yet: 6 pairs, no calibration: add --calib FILE, or --calib none if \
                 they are rectified",
        pair: ["/cam0/image_raw", "/cam1/image_raw"],
        options: " --calib calib.yaml",
        ..ROS2
    },
    Driver {
        name: "Webcams",
        bag: bags::webcams,
        usable: "not usable yet: has no stereo pairs: of 6 images of /camera1/image_raw and 6 of \
                 /camera2/image_raw none are within 5 ms of each other: at best 8 ms, see \
                 --max-skew-ms",
        pair: ["/camera1/image_raw", "/camera2/image_raw"],
        options: " --max-skew-ms 17 --calib calib.yaml",
        ..ROS2
    },
    Driver {
        name: "GMSL by V4L2",
        bag: bags::gmsl,
        usable: "usable: 6 raw pairs (plumb_bob), calibrated, no truth",
        pair: ["/camera/left/image_raw", "/camera/right/image_raw"],
        ..ROS2
    },
];

impl Driver {
    /// Writes its bag into the folder of a fixture; its name there.
    fn write(&self, fixture: &Fixture) -> &'static str {
        let messages = (self.bag)();
        let folder = fixture.path("");
        if self.storage == Storage::Ros1 {
            ros1::write_bag(&folder, &messages, "lz4");
            return "a.bag";
        }
        bag::write_with_qos(&folder, &messages, |topic| self.qos(topic));
        "bag.mcap"
    }

    /// The QoS of a topic, as rosbag2 stores it.
    fn qos(&self, topic: &str) -> String {
        let durability = match topic {
            "/tf_static" => "transient_local",
            _ => self.durability,
        };
        format!(
            "- history: keep_last\n  depth: 1\n  reliability: reliable\n  \
             durability: {durability}\n"
        )
    }
}

/// Cells of a report that have a distance, and those of them at the wall's.
fn cells_at_the_wall(fixture: &Fixture) -> (usize, usize) {
    let text = fixture.text("report/cells.csv");
    let mut rows = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let head = rows.next().unwrap();
    let place = head.iter().position(|name| *name == "distance_m").unwrap();
    let distances = rows.filter_map(|row| row[place].parse::<f64>().ok());
    let distances: Vec<_> = distances.collect();
    let near = |metres: &&f64| (**metres - DEPTH_M).abs() < 0.03 * DEPTH_M;
    (distances.len(), distances.iter().filter(near).count())
}

#[test]
fn bags_of_drivers_are_recorded_and_scored() {
    for driver in DRIVERS {
        let name = driver.name;
        if driver.needs_ffmpeg && !has("ffmpeg", &["-version"]) {
            continue;
        }
        let fixture = Fixture::new();
        let bag = driver.write(&fixture);
        fixture.write("calib.yaml", scene::calibration());
        let info = fixture.json(&format!("info {bag} --json"));
        let text = fixture.run(&format!("info {bag}"));
        let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
        let usable = driver.usable.replace("{rational}", scene::RATIONAL.0);
        assert!(words.starts_with(&usable), "{name}:\n{text}");
        assert_eq!(info["stereo"], serde_json::json!(driver.pair), "{name}");
        let is_usable = driver.usable.starts_with("usable: ");
        assert_eq!(info["usability"]["is_usable"], is_usable, "{name}");

        let options = driver.options;
        fixture.run(&format!("record {bag}{options} -o own.mcap"));
        let own = fixture.json("info own.mcap --json");
        assert_eq!(own["pairs"], PAIRS, "{name}");
        let baseline = own["first_pairs"]["rig"]["baseline_m"].as_f64().unwrap();
        assert!((baseline - BASELINE_M).abs() < 1e-6, "{name}: {baseline}");

        let truth = driver.truth.map(|topic| format!(" --truth {topic}"));
        let truth = truth.unwrap_or_default();
        fixture.run(&format!(
            "score {bag}{options}{truth} --algo bm:max_disparity=16 --rerun none -o report"
        ));
        let (known, near) = cells_at_the_wall(&fixture);
        assert!(
            known >= 60 && 10 * near >= 9 * known,
            "{name}: {near} of {known}"
        );
        if let Some(topic) = driver.truth {
            check_score(&fixture, name);
            // The driver's own depth as an algorithm, against what the images say.
            fixture.run(&format!(
                "score {bag}{options} --reference bm:max_disparity=16 --algo own=topic:{topic} \
                 --rerun none -o report"
            ));
            check_score(&fixture, name);
        }
    }
}

/// Most cells are right by the driver's truth, and few are wrong.
fn check_score(fixture: &Fixture, name: &str) {
    let summary = fixture.json_file("report/summary.json");
    let share = |key: &str| summary["algorithms"][0][key].as_f64().unwrap_or(f64::NAN);
    let (right, wrong) = (share("cells_right"), share("cells_wrong"));
    assert!(
        right > 0.6 && wrong < 0.1,
        "{name}: {right} right, {wrong} wrong"
    );
}

/// The bag without a topic.
fn without(messages: Vec<Message>, topic: &str) -> Vec<Message> {
    messages
        .into_iter()
        .filter(|message| message.topic != topic)
        .collect()
}

#[test]
fn an_oak_without_its_transforms_names_the_driver_s_option() {
    let fixture = Fixture::new();
    let messages = without(bags::depthai(), "/tf_static");
    bag::write(&fixture.path(""), &messages);
    let usability = fixture.json("info bag.mcap --json")["usability"].take();
    assert_eq!(usability["is_usable"], false);
    let missing = usability["missing"][0].as_str().unwrap();
    assert_says(
        missing,
        &["i_reverse_stereo_socket_order", "add --calib FILE"],
    );
}

#[test]
fn depths_of_an_unknown_distortion_model_are_no_truth() {
    let fixture = Fixture::new();
    let info = "/depth/camera_info";
    let mut messages = without(bags::azure_kinect(), info);
    messages.insert(0, scene::UNKNOWN.message(info, "depth_camera_link", 0));
    bag::write(&fixture.path(""), &messages);
    let line = "score bag.mcap --truth /depth/image_raw --algo bm --rerun none -o report";
    fixture
        .svl(line)
        .failed(1, &["--truth /depth/image_raw", "'double_sphere'"]);
}

/// Each row of the page stands for an entry of the table here, in the same order.
#[test]
fn the_page_of_cameras_has_a_row_for_each_driver() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/cameras.md");
    let page = std::fs::read_to_string(page).unwrap();
    let rows = page.lines().filter_map(|line| line.strip_prefix("| **"));
    let rows = rows.filter_map(|row| row.split_once("**"));
    let rows: Vec<_> = rows.map(|(name, _)| name).collect();
    let names: Vec<_> = DRIVERS.iter().map(|driver| driver.name).collect();
    assert_eq!(rows, names);
}
