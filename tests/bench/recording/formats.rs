//! Bags of every format with every feature: the pairs are those of an MCAP file with the same
//! messages, each after the other.

use super::bag::{self, CAMERA, Camera, Message, camera_info_of, ros_image};
use super::frames::{image, read, stamp, summarize};
use super::ros1;
use super::sensor::{SIZE, cloud, depth32, open, pairs, tf};
use std::path::{Path, PathBuf};
use svl::recording::{Reader, truth_topics};
use svl::stereo::{Frame, Truth};

/// A format of bags: writes a file, or a folder of files.
struct Format {
    name: &'static str,
    /// The profile in the summary; none for a bag of several files, which has no summary.
    profile: Option<&'static str>,
    write: fn(&Path, &[Message]) -> PathBuf,
}

const FORMATS: &[Format] = &[
    Format {
        name: "mcap without compression and checksums",
        profile: Some("ros2"),
        write: bag::write_unchecked,
    },
    Format {
        name: "mcap whose summary repeats no channels",
        profile: Some("ros2"),
        write: bag::write_unrepeated,
    },
    Format {
        name: "mcap, compressed message by message",
        profile: Some("ros2"),
        write: |folder, messages| bag::write(folder, &packed(messages)),
    },
    Format {
        name: "mcap, two files",
        profile: None,
        write: |folder, messages| split(folder, "mcap", messages, bag::write),
    },
    Format {
        name: "db3",
        profile: Some("ros2"),
        write: bag::write_sqlite,
    },
    Format {
        name: "db3, compressed message by message",
        profile: Some("ros2"),
        write: |folder, messages| bag::write_sqlite(folder, &packed(messages)),
    },
    Format {
        name: "db3, compressed as a file",
        profile: Some("ros2"),
        write: |folder, messages| compressed_file(&bag::write_sqlite(folder, messages)),
    },
    Format {
        name: "db3, two files",
        profile: None,
        write: |folder, messages| split(folder, "sqlite3", messages, bag::write_sqlite),
    },
    Format {
        name: "bag",
        profile: Some("ros1"),
        write: |folder, messages| ros1::write_bag(folder, messages, "none"),
    },
    Format {
        name: "bag, lz4",
        profile: Some("ros1"),
        write: |folder, messages| ros1::write_bag(folder, messages, "lz4"),
    },
    Format {
        name: "bag, bz2",
        profile: Some("ros1"),
        write: |folder, messages| ros1::write_bag(folder, messages, "bz2"),
    },
];

fn packed(messages: &[Message]) -> Vec<Message> {
    messages.iter().map(bag::packed).collect()
}

/// The file compressed with zstd, as rosbag2 does.
fn compressed_file(path: &Path) -> PathBuf {
    let compressed = path.with_extension("db3.zstd");
    let bytes = zstd::bulk::compress(&std::fs::read(path).unwrap(), 1).unwrap();
    std::fs::write(&compressed, bytes).unwrap();
    std::fs::remove_file(path).unwrap();
    compressed
}

/// A folder of two files: the second begins between the two images of a pair.
fn split(
    folder: &Path,
    storage: &str,
    messages: &[Message],
    write: fn(&Path, &[Message]) -> PathBuf,
) -> PathBuf {
    let folder = folder.join("split");
    std::fs::create_dir(&folder).unwrap();
    let (first, second) = messages.split_at(messages.len() / 2 + 1);
    let mut names = String::new();
    for (i, part) in [first, second].into_iter().enumerate() {
        let path = write(&folder, part);
        let ending = path.extension().unwrap().to_str().unwrap();
        let name = format!("part_{i}.{ending}");
        std::fs::rename(&path, folder.join(&name)).unwrap();
        names += &format!("    - {name}\n");
    }
    super::bag_folders::describe(&folder, storage, "", &names);
    folder
}

/// A feature of a bag's messages.
struct Feature {
    name: &'static str,
    messages: fn() -> Vec<Message>,
    /// Number of pairs, and of images without a partner.
    pairs: usize,
    unpaired: u64,
    has_rig: bool,
    /// Topics that measure the truth.
    truths: &'static [&'static str],
}

const FEATURES: &[Feature] = &[
    Feature {
        name: "a rig, a lidar beside the camera, a depth camera",
        messages: with_sensors,
        pairs: 2,
        unpaired: 0,
        has_rig: true,
        truths: &["/depth", "/points"],
    },
    Feature {
        name: "calibrations of binned images",
        messages: || [binned(), images(6)].concat(),
        pairs: 6,
        unpaired: 0,
        has_rig: true,
        truths: &[],
    },
    Feature {
        name: "messages out of order",
        messages: || {
            let mut all = images(12);
            all.chunks_mut(8).for_each(<[_]>::reverse);
            all
        },
        pairs: 12,
        unpaired: 0,
        has_rig: false,
        truths: &[],
    },
    Feature {
        name: "one camera after the other",
        messages: || {
            let (left, right): (Vec<_>, _) = images(100).into_iter().partition(|m| m.topic == LEFT);
            [left, right].concat()
        },
        pairs: 100,
        unpaired: 0,
        has_rig: false,
        truths: &[],
    },
    Feature {
        name: "a clock of its own: stamps an hour before the log times",
        messages: || {
            let mut all = images(6);
            all.iter_mut()
                .for_each(|message| message.log_time += 3_600_000_000_000);
            all
        },
        pairs: 6,
        unpaired: 0,
        has_rig: false,
        truths: &[],
    },
    Feature {
        name: "images without a partner",
        messages: || {
            let mut all = images(9);
            all.remove(2 * 4);
            all.remove(2 * 2 + 1);
            all
        },
        pairs: 7,
        unpaired: 2,
        has_rig: false,
        truths: &[],
    },
];

const LEFT: &str = "/cam0/image_rect";
const RIGHT: &str = "/cam1/image_rect";

/// The images of pairs, left and right.
fn images(pairs: u64) -> Vec<Message> {
    let image = |topic, i, seed| {
        let pixels: Vec<u8> = image(SIZE, seed).pixels().collect();
        ros_image(topic, stamp(i), SIZE, "mono8", &pixels)
    };
    let pair = |i| [image(LEFT, i, 2 * i), image(RIGHT, i, 2 * i + 1)];
    (0..pairs).flat_map(pair).collect()
}

fn binned() -> Vec<Message> {
    let info = |topic, tx| {
        let camera = Camera {
            size: (48, 32),
            tx,
            binning: 2,
            ..CAMERA
        };
        camera_info_of(topic, stamp(0), &camera)
    };
    vec![
        info("/cam0/camera_info", 0.0),
        info("/cam1/camera_info", -14.432),
    ]
}

/// Pairs with a calibration, a lidar beside the camera, and a depth camera.
pub(super) fn with_sensors() -> Vec<Message> {
    let mut all = pairs();
    all.push(tf("/tf_static", &[("cam", "lidar", [0.1, 0.0, 0.0])]));
    all.push(cloud(
        "lidar",
        stamp(0),
        &[[0.0, 0.0, 2.0], [0.05, 0.02, 1.5]],
    ));
    all.push(depth32(0, SIZE, |x, y| {
        1.0 + 0.1 * x as f32 + 0.01 * y as f32
    }));
    all
}

/// The truth of each pair by a topic.
fn truths(path: &Path, topic: &str) -> Vec<Option<Truth>> {
    let mut source = open(path, topic).unwrap().source;
    let frames = std::iter::from_fn(|| source.next().unwrap());
    frames.map(|frame: Frame| frame.truth).collect()
}

#[test]
fn every_format_has_every_feature() {
    for feature in FEATURES {
        let folder = tempfile::tempdir().unwrap();
        let plain = bag::write(folder.path(), &(feature.messages)());
        let (expected, error) = read(&plain);
        assert!(
            error.is_none() && expected.len() == feature.pairs,
            "{}",
            feature.name
        );
        for (frame, i) in expected.iter().zip(0..) {
            assert_eq!(frame.rig().is_some(), feature.has_rig, "{}", feature.name);
            if feature.unpaired == 0 {
                let images = [frame.pair.left(), frame.pair.right()];
                assert_eq!(images, [&image(SIZE, 2 * i), &image(SIZE, 2 * i + 1)]);
                assert_eq!((frame.sequence, frame.stamp_ns), (i, stamp(i)));
            }
        }
        let truth = |path: &Path| {
            feature
                .truths
                .iter()
                .map(|topic| truths(path, topic))
                .collect::<Vec<_>>()
        };
        let expected_truths = truth(&plain);
        assert!(
            expected_truths.iter().all(|truths| truths[0].is_some()),
            "{}",
            feature.name
        );
        for format in FORMATS {
            let about = format!("{}: {}", format.name, feature.name);
            let folder = tempfile::tempdir().unwrap();
            let path = (format.write)(folder.path(), &(feature.messages)());
            let (frames, error) = read(&path);
            assert!(error.is_none(), "{about}: {error:?}");
            assert!(frames == expected, "{about}");
            assert!(truth(&path) == expected_truths, "{about}");
            let reader = Reader::open(&path).unwrap();
            let topics = truth_topics(reader.recording(), &reader.facts().topics);
            assert_eq!(topics.unwrap(), feature.truths, "{about}");
            if let Some(profile) = format.profile {
                let summary = summarize(&path).unwrap();
                let unpaired = summary.unpaired.map(|images| images.inside);
                assert!(
                    summary.is_intact() && !summary.checksums || profile == "ros2",
                    "{about}"
                );
                assert_eq!(summary.profile, profile, "{about}");
                let found = (summary.pairs, unpaired);
                assert_eq!(
                    found,
                    (feature.pairs as u64, Some(feature.unpaired)),
                    "{about}"
                );
            }
        }
    }
}
