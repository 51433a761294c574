//! Bags of every format with every feature: the pairs are those of an MCAP file with the same
//! messages, each after the other.

use super::bag::{
    self, Bag, Message, SIZE, STEREO, Stereo, cloud, depth32, truths_in, write_split,
};
use super::frames::{bare, intact, stamp, summarize};
use super::ros1;
use std::path::{Path, PathBuf};
use svl::recording::{Reader, truth_topics};

type Write = fn(&Path, &[Message]) -> PathBuf;

/// Formats of bags: name, and how a file, or a folder of files, is written.
const FORMATS: &[(&str, Write)] = &[
    ("mcap without checksums", bag::write_unchecked),
    ("mcap without repeated channels", bag::write_unrepeated),
    ("mcap, compressed message by message", |folder, messages| {
        bag::write(folder, &packed(messages))
    }),
    (TWO_MCAP, |to, all| split(to, "mcap", all, bag::write)),
    ("db3", bag::write_sqlite),
    ("db3, compressed message by message", |folder, messages| {
        bag::write_sqlite(folder, &packed(messages))
    }),
    ("db3, compressed as a file", |folder, messages| {
        compressed_file(&bag::write_sqlite(folder, messages))
    }),
    (TWO_DB3, |folder, messages| {
        split(folder, "sqlite3", messages, bag::write_sqlite)
    }),
    ("bag", |to, all| ros1::write_bag(to, all, "none")),
    ("bag, lz4", |to, all| ros1::write_bag(to, all, "lz4")),
    ("bag, bz2", |to, all| ros1::write_bag(to, all, "bz2")),
];

/// Bags of several files have no summary.
const TWO_MCAP: &str = "mcap, two files";
const TWO_DB3: &str = "db3, two files";

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
fn split(folder: &Path, storage: &str, messages: &[Message], write: Write) -> PathBuf {
    let folder = folder.join("split");
    let (first, second) = messages.split_at(messages.len() / 2 + 1);
    let extension = if storage == "mcap" { "mcap" } else { "db3" };
    let parts = (0..2).map(|i| (format!("part_{i}.{extension}"), [first, second][i]));
    write_split(&folder, storage, parts, write);
    folder
}

/// A feature of a bag's messages.
struct Feature {
    name: &'static str,
    messages: fn() -> Bag,
    /// Number of pairs, and of images without a partner.
    pairs: usize,
    unpaired: u64,
    has_rig: bool,
    /// Topics that measure the truth.
    truths: &'static [&'static str],
}

/// Pairs of images alone.
const IMAGES: Feature = Feature {
    name: "",
    messages: Bag::default,
    pairs: 6,
    unpaired: 0,
    has_rig: false,
    truths: &[],
};

const FEATURES: &[Feature] = &[
    Feature {
        name: "a rig, a lidar beside the camera, a depth camera",
        messages: with_sensors,
        pairs: 2,
        has_rig: true,
        truths: &["/depth", "/points"],
        ..IMAGES
    },
    Feature {
        name: "calibrations of binned images",
        messages: || Bag::new(binned().infos(stamp(0))).and(images(6)),
        has_rig: true,
        ..IMAGES
    },
    Feature {
        name: "messages out of order",
        messages: || {
            let mut all = images(12);
            all.0.chunks_mut(8).for_each(<[_]>::reverse);
            all
        },
        pairs: 12,
        ..IMAGES
    },
    Feature {
        name: "one camera after the other",
        messages: || {
            let [left, right] = STEREO.images;
            images(100).without(right).and(images(100).without(left))
        },
        pairs: 100,
        ..IMAGES
    },
    Feature {
        name: "a clock of its own: stamps an hour before the log times",
        messages: || {
            images(6).each(|message| {
                let log_time = message.log_time + 3_600_000_000_000;
                [message.logged(log_time)]
            })
        },
        ..IMAGES
    },
    Feature {
        name: "images without a partner",
        messages: || {
            let mut all = images(9);
            all.0.remove(2 * 4);
            all.0.remove(2 * 2 + 1);
            all
        },
        pairs: 7,
        unpaired: 2,
        ..IMAGES
    },
];

/// The images of pairs, left and right.
fn images(pairs: u64) -> Bag {
    Bag::new((0..pairs).flat_map(|i| STEREO.images(i)))
}

fn binned() -> Stereo<'static> {
    STEREO.with(|camera| (camera.size, camera.binning) = ((48, 32), 2))
}

/// Pairs with a calibration, a lidar beside the camera, and a depth camera.
pub(super) fn with_sensors() -> Bag {
    let bag = Bag::pairs(2).tf(&[("cam", "lidar", [0.1, 0.0, 0.0])]);
    let points = [[0.0, 0.0, 2.0], [0.05, 0.02, 1.5]];
    let depth = |x: usize, y: usize| 1.0 + 0.1 * x as f32 + 0.01 * y as f32;
    bag.and([cloud("lidar", stamp(0), &points), depth32(0, SIZE, depth)])
}

#[test]
fn every_format_has_every_feature() {
    for feature in FEATURES {
        let messages = (feature.messages)();
        let plain = messages.saved();
        let expected = intact(&plain);
        assert_eq!(expected.len(), feature.pairs, "{}", feature.name);
        for (frame, i) in expected.iter().zip(0..) {
            assert_eq!(frame.rig().is_some(), feature.has_rig, "{}", feature.name);
            if feature.unpaired == 0 {
                assert_eq!(frame.pair, bare(i, SIZE).pair);
                assert_eq!((frame.sequence, frame.stamp_ns), (i, stamp(i)));
            }
        }
        let truth = |path: &Path| {
            let topics = feature.truths.iter();
            topics
                .map(|topic| truths_in(path, topic))
                .collect::<Vec<_>>()
        };
        let expected_truths = truth(&plain);
        let are_known = expected_truths.iter().all(|truths| truths[0].is_some());
        assert!(are_known, "{}", feature.name);
        for (name, write) in FORMATS {
            let about = format!("{name}: {}", feature.name);
            let folder = tempfile::tempdir().unwrap();
            let path = write(folder.path(), &messages.0);
            assert!(intact(&path) == expected, "{about}");
            assert!(truth(&path) == expected_truths, "{about}");
            let reader = Reader::open(&path).unwrap();
            let topics = truth_topics(reader.recording(), &reader.facts().topics);
            assert_eq!(topics.unwrap(), feature.truths, "{about}");
            if [TWO_MCAP, TWO_DB3].contains(name) {
                continue;
            }
            let profile = if name.starts_with("bag") {
                "ros1"
            } else {
                "ros2"
            };
            let summary = summarize(&path).unwrap();
            let is_unchecked = summary.is_intact() && !summary.checksums;
            assert!(is_unchecked || profile == "ros2", "{about}");
            assert_eq!(summary.profile, profile, "{about}");
            let unpaired = summary.unpaired.map(|images| images.inside);
            let found = (summary.pairs, unpaired);
            let expected = (feature.pairs as u64, Some(feature.unpaired));
            assert_eq!(found, expected, "{about}");
        }
    }
}
