//! Clocks of topics that differ from that of the left images, at every door.

use super::bag::{self, Bag, Message, SIZE, depth32, write_split};
use super::frames::{PERIOD_NS, START_NS};
use super::says::Says;
use crate::cli::fixture::Fixture;
use std::path::{Path, PathBuf};
use svl::source::{RecordingSource, Source};

const PAIRS: u64 = 24;
/// Time until a message is logged.
const LATENCY_NS: u64 = 5_000_000;

/// Pairs and depths, with stamps by topic and time, logged when they came.
fn drive(stamp: impl Fn(&str, u64) -> u64) -> Bag {
    long_drive(PAIRS, stamp)
}

fn long_drive(pairs: u64, stamp: impl Fn(&str, u64) -> u64) -> Bag {
    logged_drive(pairs, |topic, at| (stamp(topic, at), at + LATENCY_NS))
}

/// So many pairs and depths, with stamps and log times by topic and time, in the order of the log.
fn logged_drive(pairs: u64, times: impl Fn(&str, u64) -> (u64, u64)) -> Bag {
    let one = Bag::pairs(1).and([depth32(0, SIZE, |_, _| 2.0)]).0;
    let all = (0..pairs).flat_map(|i| {
        let times = &times;
        one.iter().map(move |message| {
            let (stamp, log) = times(message.topic, START_NS + i * PERIOD_NS);
            let mut message = message.at(stamp, log);
            // Images differ.
            *message.data.last_mut().unwrap() ^= i as u8;
            message
        })
    });
    Bag::new(all).by_log_time()
}

/// Every image and depth so many times, a log time apart, with its stamp or one of its own.
fn copied(times: u64, own_stamps: bool) -> Bag {
    let copies = drive(|_, at| at).each(|message| {
        let copy = move |i| {
            let later = i * PERIOD_NS / times;
            let stamp = message.log_time - LATENCY_NS + later * u64::from(own_stamps);
            message.at(stamp, message.log_time + later)
        };
        (0..times).map(copy)
    });
    copies.by_log_time()
}

/// A time that is behind by so many milliseconds, if it is.
fn behind(at: u64, ms: u64, is_behind: bool) -> u64 {
    at - ms * 1_000_000 * u64::from(is_behind)
}

/// The words of the first fault of a bag.
fn fault(fixture: &Fixture, name: &str) -> String {
    let faults = &fixture.json(&format!("info {name} --json"))["clocks"]["faults"];
    faults[0]["words"].as_str().unwrap_or_default().to_owned()
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
    drive(|topic, at| behind(at, 300, is_right(topic))).write(&fixture);
    let words = "/cam1/image_rect: by the log times its clock is 0.300 s behind";
    let cure = "--right-offset-ms 300.0";
    let line = fixture.info("bag.mcap").says(words);
    assert!(line.starts_with("not usable yet"), "{line}");
    for door in DOORS {
        fixture.svl(door).failed(1, &[words, cure]);
        fixture.run(&format!("{door} {cure}"));
    }
    let json = fixture.json("info bag.mcap --json");
    assert_eq!(json["clocks"]["faults"][0]["denies_pairs"], true);
    assert_eq!((&json["pairs"], &json["skew"]), (&0.into(), &().into()));
}

/// Every cure that a fault offers makes pairs, without a loss and at every door alike.
#[test]
fn cures_of_clocks_work() {
    let fixture = Fixture::new();
    // A right clock that steps behind the first third.
    let steps = |topic: &str, at| {
        let is_off = is_right(topic) && at >= START_NS + 2_000_000_000;
        behind(at, 200, is_off)
    };
    let left = |topic: &str, at| behind(at, 400, topic.starts_with("/cam0"));
    // The same with log times that are not those of one moment.
    let unsteady = |topic: &str, at| {
        let late = (at / PERIOD_NS % 3) * 4_000_000 * u64::from(is_right(topic));
        (steps(topic, at), at + LATENCY_NS + late)
    };
    let right_words = "/cam1/image_rect: by the log times its clock steps";
    let left_words = "/cam0/image_rect: by the log times its clock is 0.400 s behind those of";
    for (words, bag, least) in [
        (right_words, long_drive(90, steps), 1),
        ("--max-skew-ms 10", logged_drive(90, unsteady), 1),
        (left_words, long_drive(40, left), 2),
        ("comes twice", copied(2, false), 1),
        ("comes twice", copied(2, true), 1),
        ("comes 3 times", copied(3, false), 1),
        ("comes 3 times", copied(3, true), 1),
    ] {
        bag.write(&fixture);
        let replay = "replay bag.mcap --algo blind --rerun none";
        fixture.svl(replay).says(words);
        let fault = fault(&fixture, "bag.mcap");
        let quoted = fault.split('`').skip(1).step_by(2);
        // Stamps that step may stay, with pairs of different moments.
        let is_cure = |quoted: &&str| quoted.starts_with("--") && *quoted != "--right-offset-ms 0";
        let cures: Vec<_> = quoted.filter(is_cure).collect();
        assert!(cures.len() >= least, "{words}: {cures:?}");
        for cure in cures {
            fixture.run(&format!("{replay} {cure}"));
            fixture.run(&format!("record bag.mcap -q --force -o out.mcap {cure}"));
        }
    }
}

#[test]
fn a_step_between_the_places_is_noticed_while_pairing() {
    let fixture = Fixture::new();
    let steps = |topic: &str, at: u64| {
        let since = at - START_NS;
        let is_off = (6_000_000_000..7_500_000_000).contains(&since);
        behind(at, 200, is_right(topic) && is_off)
    };
    // Without an index there are no places.
    let path = long_drive(220, steps).write(&fixture);
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() - 30]).unwrap();
    let words = "/cam1/image_rect: by the log times its clock steps or drifts against that of \
                 the left images, from none to 0.200 s behind, 6 s after";
    for door in DOORS {
        fixture.svl(door).says(words);
    }
    fault(&fixture, "bag.mcap").says("from none to");
}

#[test]
fn a_range_before_a_step_has_no_fault() {
    let fixture = Fixture::new();
    let steps = |topic: &str, at: u64| {
        let is_off = is_right(topic) && at >= START_NS + 6_000_000_000;
        behind(at, 200, is_off)
    };
    long_drive(220, steps).write(&fixture);
    for door in DOORS {
        fixture.svl(door).failed(1, &["its clock steps"]);
        fixture.svl(&format!("{door} --to 4")).lacks("clock").done();
    }
}

#[test]
fn info_tells_the_pairs_that_other_commands_take() {
    let fixture = Fixture::new();
    long_drive(60, |topic, at| behind(at, 17, is_right(topic))).write(&fixture);
    for (options, pairs) in [
        ("", 0),
        ("--right-offset-ms 17", 60),
        ("--right-offset-ms 17 --every 7", 9),
        ("--max-skew-ms 20", 60),
        ("--max-skew-ms 20 --from 1 --to 2.01", 16),
        ("--stamps log --every 2 --to 2", 15),
    ] {
        let info = fixture.json(&format!("info bag.mcap --json {options}"));
        assert_eq!(info["pairs"], pairs, "{options}");
        if pairs == 0 {
            // It is a clock, and no skew.
            let line = info["no_pairs"].as_str().unwrap();
            line.says("`--right-offset-ms 17.0` corrects").lacks("skew");
            continue;
        }
        assert_eq!(info["usability"]["pairs"], pairs, "{options}");
        fixture.run(&format!("record bag.mcap -q --force -o out.mcap {options}"));
        let recorded = fixture.json("info out.mcap --json")["pairs"].take();
        assert_eq!(recorded, pairs, "{options}");
    }
}

#[test]
fn a_split_bag_is_told_as_one_file() {
    let fixture = Fixture::new();
    let bag = long_drive(40, |topic, at| behind(at, 1000, topic == "/depth"));
    bag.write(&fixture);
    let parts = bag.0.chunks(bag.0.len() / 3 + 1).enumerate();
    let parts = parts.map(|(i, part)| (format!("split_{i}.mcap"), part));
    write_split(&fixture.path("split"), "mcap", parts, bag::write);
    let [one, split] =
        ["bag.mcap", "split"].map(|name| fixture.json(&format!("info {name} --json")));
    let keys = "usability is_intact duration_ns checksums losses stereo topics pairs period_ns \
                gaps skew unpaired clocks library profile";
    for key in keys.split(' ') {
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
    let microseconds = |_: &str, at| (at - START_NS) / 1000 + 77_000_000;
    drive(microseconds).write(&fixture);
    for door in DOORS {
        let words = ["15000 messages a second by its stamps, 15.0", "--stamps us"];
        fixture.svl(door).failed(1, &words);
        fixture.run(&format!("{door} --stamps us"));
    }
    let refused = fixture.svl("record out.mcap -o again.mcap --stamps us");
    refused.failed(2, &["other programs' recordings"]);
}

#[test]
fn a_truth_of_another_clock_is_named_with_its_offset() {
    let fixture = Fixture::new();
    drive(|topic, at| behind(at, 1000, topic == "/depth")).write(&fixture);
    let words = "/depth: by the log times its clock is 1.000 s behind";
    for door in DOORS.iter().chain(&["info bag.mcap"]) {
        fixture.svl(*door).says(words);
    }
    let clocks = fixture.json("info bag.mcap --json")["clocks"]["topics"].take();
    for (topic, name, median_ns) in [
        ("/depth", "behind", 1_000_000_000),
        ("/cam1/image_rect", "behind", 0),
        ("/cam0/image_rect", "offset", LATENCY_NS),
    ] {
        let mut clocks = clocks.as_array().unwrap().iter();
        let clock = clocks.find(|clock| clock["topic"] == topic).unwrap();
        assert_eq!(clock[name]["median_ns"], median_ns.to_string());
    }
}

#[test]
fn a_simulation_begins_at_0() {
    let mut source = RecordingSource::open(&drive(|_, at| at - START_NS).saved()).unwrap();
    let frames = std::iter::from_fn(|| source.next().unwrap());
    let stamps = frames.map(|frame| frame.stamp_ns);
    assert!(stamps.eq((0..PAIRS).map(|i| i * PERIOD_NS)));
}

/// A topic that begins behind the first megabytes is found by the index, in each container.
#[test]
fn clocks_are_measured_all_over_a_bag() {
    let fixture = Fixture::new();
    let late = || drive(|topic, at| behind(at, 2000, topic == "/depth"));
    let filled = late().0.into_iter().zip(0..).map(|(message, i)| {
        if message.topic != "/depth" || i >= 5 * 19 {
            return message;
        }
        let blob = vec![i as u8; 1 << 20];
        bag::ros_compressed("/front", message.log_time, "jpeg", &blob)
    });
    // Again, with depths alone behind the megabytes.
    let again = late().each(|message| {
        let later = PAIRS * PERIOD_NS;
        [message.at(message.stamp() + later, message.log_time + later)]
    });
    let bag = Bag::new(filled).and(again);
    type Write = fn(&Path, &[Message]) -> PathBuf;
    let writes: [Write; 3] = [bag::write, bag::write_sqlite, |folder, messages| {
        super::ros1::write_bag(folder, messages, "none")
    }];
    for write in writes {
        let path = write(&fixture.path(""), &bag.0);
        let name = path.file_name().unwrap().to_str().unwrap();
        fault(&fixture, name).says("2.000 s behind");
    }
}
