//! The drivers of docs/cameras.md: a bag of each, with the topics, encodings, frames, QoS and order
//! of messages that its published source gives, is recorded and scored.
//!
//! All show a wall at 1.5 m, so the distances, and the scores against each driver's truth, prove
//! that pair, calibration, truth and frames belong together.

mod bags;
mod scene;

use super::ros1;
use super::says::Says;
use crate::cli::fixture::{Fixture, has};
use crate::recording::bag::{self, Bag};
use bags::DriverBag;
use scene::{BASELINE_M, DEPTH_M, PAIRS};
use std::path::Path;

/// A driver, and what svl does with its bag.
struct Driver {
    /// Row of the driver in docs/cameras.md.
    name: &'static str,
    bag: DriverBag,
    is_ros1: bool,
    /// Durability of its images' publisher; that of static transforms is transient local.
    durability: &'static str,
    /// First line of `svl info`; `{rational}` is the model of the scene.
    usable: &'static str,
    /// Topics of the pair, in which `{left|right}` is what differs.
    pair: &'static str,
    /// Options by which it is recorded and scored.
    options: &'static str,
    needs_ffmpeg: bool,
}

/// A driver of ROS 2 with a calibration and no truth.
const ROS2: Driver = Driver {
    name: "",
    bag: bags::EUROC,
    is_ros1: false,
    durability: "volatile",
    usable: "",
    pair: "",
    options: "",
    needs_ffmpeg: false,
};

const DRIVERS: &[Driver] = &[
    Driver {
        name: "RealSense D4xx",
        bag: bags::REALSENSE,
        usable: "usable: 6 rectified pairs, calibrated, truth from \
                 /camera/camera/depth/image_rect_raw",
        pair: "/camera/camera/infra{1|2}/image_rect_raw",
        ..ROS2
    },
    Driver {
        name: "OAK-D",
        bag: bags::DEPTHAI,
        usable: "usable: 6 raw pairs ({rational}), calibrated, truth from /oak/stereo/image_raw",
        pair: "/oak/{left|right}/image_raw",
        ..ROS2
    },
    Driver {
        name: "ZED",
        bag: bags::ZED,
        usable: "usable: 6 rectified pairs, calibrated, truth from \
                 /zed/zed_node/depth/depth_registered",
        pair: "/zed/zed_node/{left|right}/gray/rect/image",
        ..ROS2
    },
    Driver {
        name: "Bumblebee",
        bag: bags::BUMBLEBEE,
        is_ros1: true,
        usable: "usable: 6 raw pairs (plumb_bob), calibrated, no truth",
        pair: "/camera/{left|right}/image_raw",
        ..ROS2
    },
    Driver {
        name: "FLIR pair by trigger",
        bag: bags::FLIR,
        usable: "usable: 6 raw pairs (plumb_bob), calibrated, no truth",
        pair: "/cam_sync/cam_{0|1}/image_raw",
        ..ROS2
    },
    Driver {
        name: "Argus",
        bag: bags::ARGUS,
        usable: "usable: 6 raw pairs ({rational}), calibrated, no truth",
        pair: "/{left|right}/image_raw",
        ..ROS2
    },
    Driver {
        name: "Isaac ROS, rectified",
        bag: bags::ISAAC_RECTIFIED,
        usable: "usable: 6 rectified pairs, calibrated, no truth",
        pair: "/{left|right}/image_rect",
        ..ROS2
    },
    Driver {
        name: "Isaac ROS, H.264",
        bag: bags::ISAAC_H264,
        usable: "usable: 6 raw pairs ({rational}), calibrated, no truth",
        pair: "/front_stereo_camera/{left|right}/image_compressed",
        needs_ffmpeg: true,
        ..ROS2
    },
    Driver {
        name: "Azure Kinect, as truth",
        bag: bags::AZURE_KINECT,
        durability: "transient_local",
        usable: "usable: 6 rectified pairs, calibrated, truth from /depth/image_raw, \
                 /depth_to_rgb/image_raw, /points2",
        pair: "/stereo/{left|right}/image_rect",
        ..ROS2
    },
    Driver {
        name: "EuRoC-like rig",
        bag: bags::EUROC,
        is_ros1: true,
        usable: "not usable yet: 6 pairs, no calibration: add --calib FILE, or --calib none if \
                 they are rectified",
        pair: "/cam{0|1}/image_raw",
        options: " --calib calib.yaml",
        ..ROS2
    },
    Driver {
        name: "Webcams",
        bag: bags::WEBCAMS,
        usable: "not usable yet: has no stereo pairs: of 6 images of /camera1/image_raw and 6 of \
                 /camera2/image_raw none are within 5 ms of each other: at best 8 ms, see \
                 --max-skew-ms",
        pair: "/camera{1|2}/image_raw",
        options: " --max-skew-ms 17 --calib calib.yaml",
        ..ROS2
    },
    Driver {
        name: "GMSL by V4L2",
        bag: bags::GMSL,
        usable: "usable: 6 raw pairs (plumb_bob), calibrated, no truth",
        pair: "/camera/{left|right}/image_raw",
        ..ROS2
    },
];

impl Driver {
    fn pair(&self) -> [String; 2] {
        let parts: Vec<_> = self.pair.split(['{', '|', '}']).collect();
        [parts[1], parts[2]].map(|side| [parts[0], side, parts[3]].concat())
    }

    /// The first topic of its truth.
    fn truth(&self) -> Option<&str> {
        self.usable.split_once("truth from ")?.1.split(',').next()
    }

    /// Writes its bag into the folder of a fixture, with QoS as rosbag2 stores it; its name there.
    fn write(&self, fixture: &Fixture) -> &'static str {
        let (messages, folder) = (self.bag.messages(), fixture.path(""));
        if self.is_ros1 {
            ros1::write_bag(&folder, &messages, "lz4");
            return "a.bag";
        }
        let qos = "- history: keep_last\n  depth: 1\n  reliability: reliable\n  durability: ";
        bag::write_with_qos(&folder, &messages, |topic| match topic {
            "/tf_static" => format!("{qos}transient_local\n"),
            _ => format!("{qos}{}\n", self.durability),
        });
        "bag.mcap"
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
        let text = fixture.info(bag);
        let usable = driver.usable.replace("{rational}", scene::RATIONAL);
        assert!(text.starts_with(&usable), "{name}:\n{text}");
        assert_eq!(info["stereo"], serde_json::json!(driver.pair()), "{name}");
        let is_usable = driver.usable.starts_with("usable: ");
        assert_eq!(info["usability"]["is_usable"], is_usable, "{name}");

        let options = driver.options;
        fixture.run(&format!("record {bag}{options} -o own.mcap"));
        let own = fixture.json("info own.mcap --json");
        assert_eq!(own["pairs"], PAIRS, "{name}");
        let baseline = own["first_pairs"]["rig"]["baseline_m"].as_f64().unwrap();
        assert!((baseline - BASELINE_M).abs() < 1e-6, "{name}: {baseline}");

        let truth = driver.truth().map(|topic| format!(" --truth {topic}"));
        let truth = truth.unwrap_or_default();
        let score = format!("score {bag}{options} --rerun none -o report");
        fixture.run(&format!("{score}{truth} --algo bm:max_disparity=16"));
        let (known, near) = cells_at_the_wall(&fixture);
        let are_there = known >= 60 && 10 * near >= 9 * known;
        assert!(are_there, "{name}: {near} of {known}");
        if let Some(topic) = driver.truth() {
            check_score(&fixture, name);
            // The driver's own depth as an algorithm.
            fixture.run(&format!("{score} --algo own=topic:{topic}"));
            let summary = fixture.json_file("report/summary.json");
            let known = summary["algorithms"][0]["known_share"].as_f64();
            assert!(known > Some(0.6), "{name}: {known:?}");
        }
    }
}

/// Most cells are right by the driver's truth, and few are wrong.
fn check_score(fixture: &Fixture, name: &str) {
    let summary = fixture.json_file("report/summary.json");
    let share = |key: &str| summary["algorithms"][0][key].as_f64().unwrap_or(f64::NAN);
    let (right, wrong) = (share("cells_right"), share("cells_wrong"));
    let is_good = right > 0.6 && wrong < 0.1;
    assert!(is_good, "{name}: {right} right, {wrong} wrong");
}

#[test]
fn an_oak_without_its_transforms_names_the_driver_s_option() {
    let fixture = Fixture::new();
    let bag = Bag(bags::DEPTHAI.messages()).without("/tf_static");
    bag.write(&fixture);
    let usability = fixture.json("info bag.mcap --json")["usability"].take();
    assert_eq!(usability["is_usable"], false);
    let missing = usability["missing"][0].as_str().unwrap();
    missing.says("i_reverse_stereo_socket_order | add --calib FILE");
}

#[test]
fn depths_of_an_unknown_distortion_model_are_no_truth() {
    let fixture = Fixture::new();
    let bag = Bag(bags::AZURE_KINECT.messages()).without("/depth/camera_info");
    let unknown = scene::message("/depth/camera_info depth_camera_link unknown", 0);
    Bag(vec![unknown]).and(bag).write(&fixture);
    let line = "score bag.mcap --truth /depth/image_raw --algo bm --rerun none -o report";
    let ran = fixture.svl(line);
    ran.failed(1, &["--truth /depth/image_raw", "'double_sphere'"]);
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
