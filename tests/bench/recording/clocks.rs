//! Clocks of topics that differ from that of the left images, at every door.

use super::bag::{self, Message};
use super::frames::PERIOD_NS;
use super::sensor::{SIZE, START_NS, depth32, pairs};
use super::stamps::stamped;
use crate::cli::fixture::Fixture;
use std::path::Path;
use svl::source::{RecordingSource, Source};

const PAIRS: u64 = 24;
/// Time until a message is logged.
const LATENCY_NS: u64 = 5_000_000;

/// Pairs and depths, with stamps by topic and time, logged when they came.
fn drive(stamp: impl Fn(&str, u64) -> u64) -> Vec<Message> {
    let mut messages = Vec::new();
    let one = [&pairs()[..4], &[depth32(0, SIZE, |_, _| 2.0)]].concat();
    for i in 0..PAIRS {
        let at = START_NS + i * PERIOD_NS;
        for message in &one {
            let mut message = stamped(message, stamp(message.topic, at), at + LATENCY_NS);
            // Images differ.
            *message.data.last_mut().unwrap() ^= i as u8;
            messages.push(message);
        }
    }
    messages
}

fn is_right(topic: &str) -> bool {
    topic.starts_with("/cam1")
}

/// Commands that read the pairs of a bag, with its depth as the truth where they use one.
const DOORS: [&str; 4] = [
    "record bag.mcap -o out.mcap",
    "replay bag.mcap --algo blind --rerun none",
    "score bag.mcap --algo blind --rerun none -o rep --truth /depth",
    "label bag.mcap -o labels.toml",
];

#[test]
fn a_right_clock_that_differs_makes_no_pair_at_any_door() {
    let fixture = Fixture::new();
    let behind = |topic: &str, at| at - 300_000_000 * u64::from(is_right(topic));
    bag::write(&fixture.path(""), &drive(behind));
    let words = "/cam1/image_rect: by the log times its clock is 0.300 s behind";
    let cure = "--right-offset-ms 300.0";
    let info = fixture.run("info bag.mcap");
    let line = info.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(
        line.starts_with("not usable yet") && line.contains(words),
        "{info}"
    );
    for door in &DOORS[..3] {
        fixture.svl(*door).failed(1, &[words, cure]);
        fixture.svl(&format!("{door} {cure}")).done();
    }
    let json = fixture.json("info bag.mcap --json");
    assert_eq!(json["clocks"]["faults"][0]["denies_pairs"], true);
    assert_eq!((&json["pairs"], &json["skew"]), (&0.into(), &().into()));
}

#[test]
fn stamps_in_microseconds_are_read_by_the_option_alone() {
    let fixture = Fixture::new();
    bag::write(
        &fixture.path(""),
        &drive(|_, at| (at - START_NS) / 1000 + 77_000_000),
    );
    for door in &DOORS[..3] {
        let words = ["15000 messages a second by its stamps, 15.0", "--stamps us"];
        fixture.svl(*door).failed(1, &words);
        fixture.svl(&format!("{door} --stamps us")).done();
    }
    let refused = fixture.svl("record out.mcap -o again.mcap --stamps us");
    refused.failed(2, &["other programs' recordings"]);
}

#[test]
fn a_truth_of_another_clock_is_named_with_its_offset() {
    let fixture = Fixture::new();
    let behind = |topic: &str, at| at - 1_000_000_000 * u64::from(topic == "/depth");
    bag::write(&fixture.path(""), &drive(behind));
    let words = "/depth: by the log times its clock is 1.000 s behind";
    for door in DOORS[..3].iter().chain(&["info bag.mcap"]) {
        let ran = fixture.svl(*door);
        assert!(ran.stderr.contains(words), "{door}: {}", ran.stderr);
    }
    let clocks = &fixture.json("info bag.mcap --json")["clocks"]["topics"];
    let clock = |topic: &str| {
        let mut clocks = clocks.as_array().unwrap().iter();
        clocks.find(|clock| clock["topic"] == topic).unwrap()
    };
    assert_eq!(clock("/depth")["behind"]["median_ns"], 1_000_000_000);
    assert_eq!(clock("/cam1/image_rect")["behind"]["median_ns"], 0);
    assert_eq!(clock("/cam0/image_rect")["offset"]["median_ns"], LATENCY_NS);
}

#[test]
fn a_simulation_begins_at_0() {
    let folder = tempfile::tempdir().unwrap();
    let path = bag::write(folder.path(), &drive(|_, at| at - START_NS));
    let mut source = RecordingSource::open(path).unwrap();
    let frames: Vec<_> = std::iter::from_fn(|| source.next().unwrap()).collect();
    let stamps: Vec<_> = frames.iter().map(|frame| frame.stamp_ns).collect();
    assert_eq!(
        stamps,
        (0..PAIRS).map(|i| i * PERIOD_NS).collect::<Vec<_>>()
    );
}

/// A topic that begins behind the first megabytes is found by the index, in each container.
#[test]
fn clocks_are_measured_all_over_a_bag() {
    let fixture = Fixture::new();
    let fill = |messages: Vec<Message>| {
        let mut filled = Vec::new();
        for (message, i) in messages.into_iter().zip(0..) {
            if message.topic == "/depth" && i < 5 * 19 {
                let blob = vec![i as u8; 1 << 20];
                let blob = bag::ros_compressed("/front", message.log_time, "jpeg", &blob);
                filled.push(blob);
            } else {
                filled.push(message);
            }
        }
        filled
    };
    let behind = |topic: &str, at| at - 2_000_000_000 * u64::from(topic == "/depth");
    let mut messages = fill(drive(behind));
    // Again, with depths alone behind the megabytes.
    let again = drive(behind).into_iter();
    messages.extend(again.map(|message| {
        let later = PAIRS * PERIOD_NS;
        let stamp = u64::from(u32::from_le_bytes(
            *message.data[4..].first_chunk().unwrap(),
        ));
        let nanoseconds = u64::from(u32::from_le_bytes(
            *message.data[8..].first_chunk().unwrap(),
        ));
        let stamp = stamp * 1_000_000_000 + nanoseconds + later;
        stamped(&message, stamp, message.log_time + later)
    }));
    let write: [fn(&Path, &[Message]) -> std::path::PathBuf; 3] =
        [bag::write, bag::write_sqlite, |folder, messages| {
            super::ros1::write_bag(folder, messages, "none")
        }];
    for write in write {
        let path = write(&fixture.path(""), &messages);
        let name = path.file_name().unwrap().to_str().unwrap();
        let faults = &fixture.json(&format!("info {name} --json"))["clocks"]["faults"];
        let reason = faults[0]["reason"].as_str().unwrap_or_default();
        assert!(reason.contains("2.000 s behind"), "{name}: {faults}");
    }
}
