//! Clocks of topics that differ from that of the left images, at every door.

use super::bag::{self, Message};
use super::bag_folders::describe;
use super::frames::{PERIOD_NS, START_NS};
use super::sensor::{SIZE, depth32, pairs};
use super::stamps::stamped;
use crate::cli::fixture::Fixture;
use std::path::Path;
use svl::source::{RecordingSource, Source};

const PAIRS: u64 = 24;
/// Time until a message is logged.
const LATENCY_NS: u64 = 5_000_000;

/// Pairs and depths, with stamps by topic and time, logged when they came.
fn drive(stamp: impl Fn(&str, u64) -> u64) -> Vec<Message> {
    long_drive(PAIRS, |topic, at| (stamp(topic, at), at + LATENCY_NS))
}

/// So many pairs and depths, with stamps and log times by topic and time, in the order of the log.
fn long_drive(pairs: u64, times: impl Fn(&str, u64) -> (u64, u64)) -> Vec<Message> {
    let mut messages = Vec::new();
    let one = [&self::pairs()[..4], &[depth32(0, SIZE, |_, _| 2.0)]].concat();
    for i in 0..pairs {
        for message in &one {
            let (stamp, log) = times(message.topic, START_NS + i * PERIOD_NS);
            let mut message = stamped(message, stamp, log);
            // Images differ.
            *message.data.last_mut().unwrap() ^= i as u8;
            messages.push(message);
        }
    }
    messages.sort_by_key(|message| message.log_time);
    messages
}

/// Every image and depth so many times, a log time apart, with its stamp or one of its own.
fn copied(times: u64, own_stamps: bool) -> Vec<Message> {
    let mut all = Vec::new();
    for message in drive(|_, at| at) {
        for copy in 0..times {
            let later = copy * PERIOD_NS / times;
            let stamp = message.log_time - LATENCY_NS + later * u64::from(own_stamps);
            all.push(stamped(&message, stamp, message.log_time + later));
        }
    }
    all.sort_by_key(|message| message.log_time);
    all
}

/// The options in the first fault of a bag that are its cures.
fn cures(fixture: &Fixture) -> Vec<String> {
    let faults = &fixture.json("info bag.mcap --json")["clocks"]["faults"];
    let reason = faults[0]["words"].as_str().unwrap_or_default().to_owned();
    let quoted = reason.split('`').skip(1).step_by(2);
    let cures = quoted.filter(|quoted| quoted.starts_with("--"));
    cures.map(str::to_owned).collect()
}

fn is_right(topic: &str) -> bool {
    topic.starts_with("/cam1")
}

/// Commands that read the pairs of a bag, with its depth as the truth where they use one.
const DOORS: [&str; 3] = [
    "record bag.mcap -o out.mcap",
    "replay bag.mcap --algo blind --rerun none",
    "score bag.mcap --algo blind --rerun none -o rep --truth /depth",
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
    for door in DOORS {
        fixture.svl(door).failed(1, &[words, cure]);
        fixture.svl(&format!("{door} {cure}")).done();
    }
    let json = fixture.json("info bag.mcap --json");
    assert_eq!(json["clocks"]["faults"][0]["denies_pairs"], true);
    assert_eq!((&json["pairs"], &json["skew"]), (&0.into(), &().into()));
}

/// Every cure that a fault offers makes pairs, without a loss and at every door alike.
#[test]
fn cures_of_clocks_work() {
    let fixture = Fixture::new();
    let since = |at: u64, seconds: u64| at >= START_NS + seconds * 1_000_000_000;
    // A right clock that steps behind the first third.
    let steps = |topic: &str, at| {
        let back = 200_000_000 * u64::from(is_right(topic) && since(at, 2));
        (at - back, at + LATENCY_NS)
    };
    let left = |topic: &str, at| {
        let back = 400_000_000 * u64::from(topic.starts_with("/cam0"));
        (at - back, at + LATENCY_NS)
    };
    // The same with log times that are not those of one moment.
    let unsteady = |topic: &str, at| {
        let late = (at / PERIOD_NS % 3) * 4_000_000 * u64::from(is_right(topic));
        (steps(topic, at).0, at + LATENCY_NS + late)
    };
    let cases: [(&str, Vec<Message>, usize); 7] = [
        (
            "/cam1/image_rect: by the log times its clock steps",
            long_drive(90, steps),
            1,
        ),
        ("--max-skew-ms 10", long_drive(90, unsteady), 1),
        (
            "/cam0/image_rect: by the log times its clock is 0.400 s behind those of",
            long_drive(40, left),
            2,
        ),
        ("comes twice", copied(2, false), 1),
        ("comes twice", copied(2, true), 1),
        ("comes 3 times", copied(3, false), 1),
        ("comes 3 times", copied(3, true), 1),
    ];
    for (words, messages, least) in cases {
        bag::write(&fixture.path(""), &messages);
        let said = fixture
            .svl("replay bag.mcap --algo blind --rerun none")
            .stderr;
        assert!(said.contains(words), "{words}: {said}");
        let cures = cures(&fixture);
        // Stamps that step may stay, with pairs of different moments.
        let cures: Vec<_> = cures
            .iter()
            .filter(|cure| *cure != "--right-offset-ms 0")
            .collect();
        assert!(cures.len() >= least, "{words}: {cures:?}");
        for cure in cures {
            fixture
                .svl(&format!("replay bag.mcap --algo blind --rerun none {cure}"))
                .done();
            fixture
                .svl(&format!("record bag.mcap -q --force -o out.mcap {cure}"))
                .done();
        }
    }
}

#[test]
fn a_step_between_the_places_is_noticed_while_pairing() {
    let fixture = Fixture::new();
    let steps = |topic: &str, at: u64| {
        let is_off = (START_NS + 6_000_000_000..START_NS + 7_500_000_000).contains(&at);
        let back = 200_000_000 * u64::from(is_right(topic) && is_off);
        (at - back, at + LATENCY_NS)
    };
    // Without an index there are no places.
    let path = bag::write(&fixture.path(""), &long_drive(220, steps));
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() - 30]).unwrap();
    let words = "/cam1/image_rect: by the log times its clock steps or drifts against that of \
                 the left \
                 images, from none to 0.200 s behind, 6 s after";
    for door in DOORS {
        let said = fixture.svl(door).stderr;
        assert!(said.contains(words), "{door}: {said}");
    }
    let faults = fixture.json("info bag.mcap --json")["clocks"]["faults"].take();
    assert!(
        faults[0]["words"]
            .as_str()
            .unwrap()
            .contains("from none to"),
        "{faults}"
    );
}

#[test]
fn a_range_before_a_step_has_no_fault() {
    let fixture = Fixture::new();
    let steps = |topic: &str, at: u64| {
        let back = 200_000_000 * u64::from(is_right(topic) && at >= START_NS + 6_000_000_000);
        (at - back, at + LATENCY_NS)
    };
    bag::write(&fixture.path(""), &long_drive(220, steps));
    for door in DOORS {
        fixture.svl(door).failed(1, &["its clock steps"]);
        let ran = fixture.svl(&format!("{door} --to 4"));
        assert!(!ran.stderr.contains("clock"), "{}", ran.stderr);
        ran.done();
    }
}

#[test]
fn info_tells_the_pairs_that_other_commands_take() {
    let fixture = Fixture::new();
    let behind = |topic: &str, at| {
        (
            at - 17_000_000 * u64::from(is_right(topic)),
            at + LATENCY_NS,
        )
    };
    bag::write(&fixture.path(""), &long_drive(60, behind));
    for (options, pairs) in [
        ("", 0),
        ("--right-offset-ms 17", 60),
        ("--right-offset-ms 17 --every 7", 9),
        ("--max-skew-ms 20", 60),
        ("--max-skew-ms 20 --from 1 --to 2.01", 16),
        ("--stamps log --every 2 --to 2", 15),
    ] {
        let info = fixture.json(&format!("info bag.mcap --json {options}"));
        let told = [&info["pairs"], &info["usability"]["pairs"]];
        assert_eq!(told[0], pairs, "{options}");
        if pairs == 0 {
            // It is a clock, and no skew.
            let line = info["no_pairs"].as_str().unwrap();
            assert!(line.contains("`--right-offset-ms 17.0` corrects") && !line.contains("skew"));
            continue;
        }
        assert_eq!(told[1], pairs, "{options}");
        fixture.run(&format!("record bag.mcap -q --force -o out.mcap {options}"));
        assert_eq!(
            fixture.json("info out.mcap --json")["pairs"],
            pairs,
            "{options}"
        );
    }
}

#[test]
fn a_split_bag_is_told_as_one_file() {
    let fixture = Fixture::new();
    let late = |topic: &str, at| {
        let back = 1_000_000_000 * u64::from(topic == "/depth");
        (at - back, at + LATENCY_NS)
    };
    let all = long_drive(40, late);
    bag::write(&fixture.path(""), &all);
    std::fs::create_dir(fixture.path("split")).unwrap();
    let mut names = String::new();
    for (i, part) in all.chunks(all.len() / 3 + 1).enumerate() {
        let name = format!("split_{i}.mcap");
        let path = bag::write(&fixture.path("split"), part);
        std::fs::rename(path, fixture.path("split").join(&name)).unwrap();
        names += &format!("    - {name}\n");
    }
    describe(&fixture.path("split"), "mcap", "", &names);
    let [one, split] =
        ["bag.mcap", "split"].map(|name| fixture.json(&format!("info {name} --json")));
    for key in [
        "usability",
        "is_intact",
        "duration_ns",
        "checksums",
        "losses",
        "stereo",
        "topics",
        "pairs",
        "period_ns",
        "gaps",
        "skew",
        "unpaired",
        "clocks",
        "library",
        "profile",
    ] {
        assert_eq!(one[key], split[key], "{key}");
    }
    assert_eq!(split["pairs"], 40);
    assert_eq!(split["clocks"]["faults"][0]["of"]["topic"], "/depth");
    // Without a pair as well.
    fixture.run("info split --left /cam0/image_rect --right /depth");
}

#[test]
fn stamps_in_microseconds_are_read_by_the_option_alone() {
    let fixture = Fixture::new();
    bag::write(
        &fixture.path(""),
        &drive(|_, at| (at - START_NS) / 1000 + 77_000_000),
    );
    for door in DOORS {
        let words = ["15000 messages a second by its stamps, 15.0", "--stamps us"];
        fixture.svl(door).failed(1, &words);
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
    for door in DOORS.iter().chain(&["info bag.mcap"]) {
        let ran = fixture.svl(*door);
        assert!(ran.stderr.contains(words), "{door}: {}", ran.stderr);
    }
    let clocks = &fixture.json("info bag.mcap --json")["clocks"]["topics"];
    let clock = |topic: &str| {
        let mut clocks = clocks.as_array().unwrap().iter();
        clocks.find(|clock| clock["topic"] == topic).unwrap()
    };
    assert_eq!(clock("/depth")["behind"]["median_ns"], "1000000000");
    assert_eq!(clock("/cam1/image_rect")["behind"]["median_ns"], "0");
    let latency = LATENCY_NS.to_string();
    assert_eq!(clock("/cam0/image_rect")["offset"]["median_ns"], latency);
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
        let reason = faults[0]["words"].as_str().unwrap_or_default();
        assert!(reason.contains("2.000 s behind"), "{name}: {faults}");
    }
}
