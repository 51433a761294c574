//! Live ROS 2 topics on the loopback interface: pairs in, results out.

mod foreign;
mod robot;
mod service;

use crate::cli::fixture::{Fixture, assert_says};
use crate::cli::interrupt::{interrupted, interrupted_times};
use crate::recording::frames::{PERIOD_NS, image};
use robot::{BASELINE_M, Fault, Robot, START_NS};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use svl::dds::{Domain, TopicInbox};
use svl::recording::{Recording, Selection};
use svl::source::{RecordingSource, Source};

#[test]
fn topics_are_recorded_pixel_by_pixel() {
    let robot = Robot::start(0, Fault::None);
    let fixture = Fixture::new();
    let source = robot.source("");
    let text = fixture.run(&format!("record {source} --frames 12 -o run.mcap"));
    assert_says(&text, &["no message lost", "run.mcap: 12 pairs"]);
    let mut source = RecordingSource::open(fixture.path("run.mcap")).unwrap();
    let mut last = None;
    while let Some(frame) = source.next().unwrap() {
        // The number of the pair, by its stamp.
        let i = (frame.stamp_ns - START_NS) / PERIOD_NS;
        assert_eq!(frame.stamp_ns, START_NS + i * PERIOD_NS);
        let sent = [2 * i, 2 * i + 1].map(|seed| image(robot::SIZE, seed));
        assert_eq!(frame.pair.clone().into_images(), sent, "pair {i}");
        assert!(last.is_none_or(|last| i > last));
        last = Some(i);
        let rig = frame.rig().expect("its calibrations make a rig");
        assert!((rig.baseline_m() - BASELINE_M).abs() < 1e-12);
    }
    let summary = Recording::open(fixture.path("run.mcap"))
        .unwrap()
        .summary(&Selection::default());
    let facts = summary.unwrap().grabber;
    assert_eq!(facts["dropped_pairs"], "0");
    assert!(facts.contains_key("counts") && facts["left_images"].parse::<u64>().unwrap() >= 12);
}

#[test]
fn live_topics_are_recorded_to_be_scored() {
    let robot = Robot::start(8, Fault::None);
    let fixture = Fixture::new();
    let source = robot.source("");
    let ran = fixture.svl(&format!(
        "score {source} --to 1.5 --from 0.5 --algo bm --algo v3"
    ));
    assert_says(&ran.stderr, &["recordings/ros2-1.mcap: "]);
    assert!(matches!(ran.code, Some(0 | 4)), "{}", ran.stderr);
    assert!(fixture.path("reports/ros2-1/index.html").exists());
    // The same file again has the same score.
    let rows = |folder: &str| std::fs::read_to_string(fixture.path(folder)).unwrap();
    let again = "score recordings/ros2-1.mcap --to 1.5 --from 0.5 --algo bm --algo v3 -o again";
    fixture.svl(again).done();
    let hashes = |text: &str| -> Vec<String> {
        let at = text
            .lines()
            .next()
            .unwrap()
            .split(',')
            .position(|name| name == "result_hash");
        let result_hash = |line: &str| line.split(',').nth(at.unwrap()).unwrap().to_owned();
        text.lines().map(result_hash).collect()
    };
    let [first, second] = ["reports/ros2-1/rows.csv", "again/rows.csv"].map(rows);
    assert!(first.lines().count() > 10, "{first}");
    assert_eq!(hashes(&first), hashes(&second));
}

/// Longest wait for an svl that failed, so that the test ends.
const MAX_WAIT: Duration = Duration::from_secs(600);

/// Waits however long another program takes.
fn wait_for(ready: impl Fn() -> bool) {
    let began = Instant::now();
    while !ready() && began.elapsed() < MAX_WAIT {
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn a_duration_is_of_stamps_and_ends_without_publishers() {
    let robot = Robot::start(14, Fault::None);
    let source = robot.source("");
    let fixture = Fixture::new();
    let ran = std::thread::scope(|scope| {
        scope.spawn(|| {
            // The file is made once the first pair is there.
            wait_for(|| fixture.path("run.mcap").exists());
            drop(robot);
        });
        fixture.svl(&format!("record {source} --duration 8 -o run.mcap"))
    });
    assert_says(&ran.stderr, &["ended by the clock of this machine"]);
    let pairs = RecordingSource::open(fixture.path("run.mcap"))
        .unwrap()
        .pairs();
    assert!(pairs.is_some_and(|pairs| pairs > 0), "{pairs:?}");
    // Two seconds by stamps are eight by the clock of this machine.
    let robot = Robot::start(14, Fault::Slow);
    let ran = fixture.svl(&format!(
        "record {} --duration 2 -o slow.mcap",
        robot.source("")
    ));
    // A busy machine may lose images.
    assert!(matches!(ran.code, Some(0 | 4)), "{}", ran.stderr);
    let ended = "clock of this machine";
    assert!(!ran.stderr.contains(ended), "{}", ran.stderr);
    assert_says(&ran.stdout, &[" in 2.0 s ("]);
}

#[cfg(unix)]
#[test]
fn live_results_are_published_and_proved_by_a_recording() {
    let robot = Robot::start(1, Fault::None);
    let fixture = Fixture::new();
    let (source, publish) = (robot.source(""), robot.source("/svl"));
    let line = format!("replay {source} --publish {publish} --rows live.csv");
    let (heard_all, replayed) = (AtomicBool::new(false), AtomicBool::new(false));
    let is = |told: &AtomicBool| told.load(Ordering::Relaxed);
    std::thread::scope(|scope| {
        // The recording lasts longer than the replay at both ends.
        scope.spawn(|| {
            let record = format!("record {source} -o run.mcap");
            let (code, stderr) = interrupted(&fixture, &record, || is(&replayed));
            assert!(matches!(code, Some(0 | 4)), "{stderr}");
        });
        let replay = scope.spawn(|| {
            wait_for(|| fixture.path("run.mcap").exists());
            let ran = interrupted(&fixture, &line, || is(&heard_all));
            replayed.store(true, Ordering::Relaxed);
            ran
        });
        let names = ["/svl/points", "/svl/scan", "/svl/disparity", "/svl/depth"];
        let mut clouds = 0;
        let (topics, messages) = heard(&publish, &names, |_| {
            clouds += 1;
            clouds > 30
        });
        heard_all.store(true, Ordering::Relaxed);
        let (code, stderr) = replay.join().unwrap();
        assert_eq!(code, Some(0), "{stderr}");
        let schema = |name: &str| {
            let found = topics.iter().find(|topic| topic.topic.name == name);
            found.map(|found| found.topic.schema.clone())
        };
        let expected = [
            "sensor_msgs/msg/PointCloud2",
            "sensor_msgs/msg/LaserScan",
            "stereo_msgs/msg/DisparityImage",
            "sensor_msgs/msg/Image",
        ];
        assert_eq!(
            names.map(schema),
            expected.map(|schema| Some(schema.to_owned()))
        );
        // The stamp of the images.
        let [sec, nanosec] =
            [4, 8].map(|at| u32::from_le_bytes(*messages[at..].first_chunk().unwrap()));
        let stamp = u64::from(sec) * 1_000_000_000 + u64::from(nanosec);
        assert!((stamp - START_NS).is_multiple_of(PERIOD_NS), "{stamp}");
    });
    // A machine under load drops pairs of the live run, and says so with 4.
    let ran = fixture.svl("replay run.mcap --verify=live.csv --json");
    let json = ran.json();
    let verification = &json["verification"];
    assert_eq!(verification["differing"], serde_json::json!({}));
    let common = verification["live"]["common"].as_u64().unwrap();
    assert!(common > 3, "{verification}");
    let alone =
        ["only_now", "only_then"].map(|key| verification["live"][key].as_array().unwrap().len());
    let is_enough = alone.iter().sum::<usize>() as u64 * 99 <= common;
    assert_eq!(
        ran.code,
        Some(if is_enough { 0 } else { 4 }),
        "{verification}"
    );
}

/// Matches a pair of the robot's in more time than three take to come.
const SLOW: &str = r#"#!/bin/sh
seq=0
while read -r line; do
    dd bs=1 count=768 of=/dev/null 2>/dev/null
    sleep 0.25
    seq=$((seq + 1))
    echo "{\"seq\":$seq,\"millis\":250}"
    head -c 1536 /dev/zero
done
"#;

#[cfg(unix)]
#[test]
fn newer_pairs_replace_those_that_wait() {
    let robot = Robot::start(19, Fault::None);
    let fixture = Fixture::new();
    let slow = fixture.write("slow", SLOW);
    let permissions = std::os::unix::fs::PermissionsExt::from_mode(0o755);
    std::fs::set_permissions(slow, permissions).unwrap();
    let (source, publish) = (robot.source(""), robot.source("/svl"));
    let line = format!(
        "replay {source} --publish {publish} --algo slow=exec:command=./slow --rows live.csv"
    );
    let (is_heard, replayed) = (AtomicBool::new(false), AtomicBool::new(false));
    let is = |told: &AtomicBool| told.load(Ordering::Relaxed);
    let (code, stderr) = std::thread::scope(|scope| {
        scope.spawn(|| {
            let record = format!("record {source} -o run.mcap");
            interrupted(&fixture, &record, || is(&replayed))
        });
        let replay = scope.spawn(|| {
            wait_for(|| fixture.path("run.mcap").exists());
            let stdout = std::fs::File::create(fixture.path("said")).unwrap();
            let ran = interrupted_times(&[0], &fixture, &line, stdout.into(), || is(&is_heard));
            replayed.store(true, Ordering::Relaxed);
            ran
        });
        let has_replaced = |message: &[u8]| {
            let key = b"pairs replaced\0";
            let at = message.windows(key.len()).position(|part| part == key);
            // The value follows, aligned, with its length.
            at.is_some_and(|at| message[(at + key.len()).next_multiple_of(4) + 4] != b'0')
        };
        heard(&publish, &["/diagnostics"], has_replaced);
        is_heard.store(true, Ordering::Relaxed);
        replay.join().unwrap()
    });
    let said = fixture.text("said");
    // A busy machine may lose images.
    if code != Some(4) {
        assert_eq!(code, Some(0), "{stderr}");
        assert_says(&said, &[" replaced by newer ones; none lost"]);
    }
    // The recording has those between, too, and a program may remember earlier pairs.
    let verify = "replay run.mcap --verify=live.csv --algo slow=exec:command=./slow --json";
    let ran = fixture.svl(verify);
    let live = &ran.json()["verification"]["live"];
    assert!(live["common"].as_u64().unwrap() > 0, "{live}");
    assert_eq!(live["only_now"], serde_json::json!([]));
}

/// All published topics, once `names` are among them, and the first wanted message of the first.
fn heard(
    address: &str,
    names: &[&str],
    mut is_wanted: impl FnMut(&[u8]) -> bool,
) -> (Vec<svl::dds::FoundTopic>, Vec<u8>) {
    let (domain, began) = (
        Domain::join(&address.parse().unwrap()).unwrap(),
        Instant::now(),
    );
    let topics = loop {
        assert!(began.elapsed() < MAX_WAIT, "nothing is published");
        let topics = domain.topics();
        let is_found = |name: &&str| topics.iter().any(|found| found.topic.name == *name);
        if names.iter().all(is_found) {
            break topics;
        }
        std::thread::sleep(Duration::from_millis(20));
    };
    let wanted: Vec<_> = topics
        .iter()
        .filter(|found| found.topic.name == names[0])
        .cloned()
        .collect();
    let mut inbox = TopicInbox::new(domain, &wanted).unwrap();
    let mut first = None;
    while first.is_none() {
        assert!(began.elapsed() < MAX_WAIT, "no message came");
        let step = Duration::from_millis(50);
        inbox
            .receive(step, |_, message| {
                if first.is_none() && is_wanted(&message) {
                    first = Some(message);
                }
            })
            .unwrap();
    }
    (topics, first.unwrap())
}

#[test]
fn info_says_what_is_published_and_why_there_are_no_pairs() {
    let fixture = Fixture::new();
    for (n, fault, words) in [
        (
            2,
            Fault::None,
            &["pairs      ", "baseline        0.1000 m", "24x16 px"][..],
        ),
        (3, Fault::Silent, &["silent topics   /cam1/image_rect 1"]),
        (
            4,
            Fault::OtherClock,
            &["its clock is 3600.", "--right-offset-ms"],
        ),
        (5, Fault::OtherSize, &["24x16", "12x16"]),
    ] {
        let robot = Robot::start(n, fault);
        let ran = fixture.svl(&format!("info {}", robot.source("")));
        assert_eq!(ran.code, Some(0), "{}", ran.stderr);
        assert_says(&ran.stdout, words);
    }
    let robot = Robot::start(6, Fault::Swapped);
    let ran = fixture.svl(&format!("info {}", robot.source("")));
    assert_says(&ran.stderr, &["0.1000 m to the left", "--left and --right"]);
}

#[test]
fn topics_that_cannot_be_opened_are_one_line() {
    let fixture = Fixture::new();
    fixture.fails(
        "record ros2:/left -o a.mcap => 2: name two topics
        record ros2:left,right -o a.mcap => 2: 'left' is no topic
        record ros2:domain=300 -o a.mcap => 2: '300'
        record ros2: --rate 5 -o a.mcap => 2: --rate is for
        score ros2: => 2: --to SECONDS records and scores that long
        score ros2: --to 2 --truth /depth => 2: --truth is for recordings
        score ros2: --print-scenario => 2: record them first
        score ros2: --to 2 --from 5 => 2: --to has to be after --from
        score ros2: --to 2 --gate => 2: --gate and --drives are for scenarios
        score ros2: --to 2 --fps 3 => 2: --fps is for folders
        score ros2: --to 2 --seeds 1..3 => 2: --seeds is for
        score ros2: arena --to 2 => 2: not 'arena'
        replay ros2: --publish /svl => 2: expected ros2:/PREFIX
        replay ros2: --publish ros2:/svl --algo v5 --algo bm => 2: one algorithm",
    );
    let empty = robot::address(7, "");
    for (command, words) in [
        ("replay", &["it has no images", "0 topics found"][..]),
        ("info", &["no topic in domain"]),
    ] {
        let ran = fixture.svl(&format!("{command} {empty}"));
        assert_eq!(ran.code, Some(1), "{}", ran.stderr);
        assert_says(&ran.stderr, words);
    }
}

#[test]
fn a_recording_survives_resets_and_restarts() {
    let fixture = Fixture::new();
    let record = |n, fault, robots: usize| {
        let file = fixture.path(&format!("{n}.mcap"));
        let robots: Vec<_> = (0..robots)
            .map(|_| {
                let file = file.clone();
                Robot::start_until(n, fault, move || file.exists())
            })
            .collect();
        let line = format!("record {} --frames 110 -o {n}.mcap", robots[0].source(""));
        let ran = fixture.svl(&line);
        // Two clocks on one topic, or a busy machine, leave images without partners: losses.
        assert!(matches!(ran.code, Some(0 | 4)), "{}", ran.stderr);
        let mut source = RecordingSource::open(file).unwrap();
        let frames: Vec<_> = std::iter::from_fn(|| source.next().unwrap()).collect();
        assert_eq!(frames.len(), 110);
        (frames, ran, robots[0].later_ns())
    };
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let (frames, _, later_ns) = record(9, Fault::Returns, 1);
            assert!(frames[0].stamp_ns < later_ns && frames[109].stamp_ns >= later_ns);
        });
        scope.spawn(|| {
            let (frames, ran, _) = record(10, Fault::ClockBack, 1);
            assert!(frames[0].stamp_ns >= START_NS && frames[109].stamp_ns < START_NS);
            assert_says(&ran.stderr, &["jumped back by 3599."]);
            assert_says(&ran.stdout, &["2 jumps of the clock"]);
        });
        scope.spawn(|| {
            let (frames, ..) = record(11, Fault::Grows, 1);
            let (width, height) = robot::SIZE;
            assert_eq!(frames[0].pair.size(), (width, height));
            assert_eq!(frames[109].pair.size(), (2 * width, height));
            // The calibration is of the first size.
            assert!(frames[0].rig().is_some() && frames[109].rig().is_none());
        });
        scope.spawn(|| {
            let (_, ran, _) = record(12, Fault::None, 2);
            assert_says(&ran.stderr, &["/cam0/image_rect: 2 publishers"]);
        });
    });
}

#[cfg(unix)]
#[test]
fn silence_is_published_and_has_a_reason() {
    let fixture = Fixture::new();
    let rows = fixture.path("rows.csv");
    let robot = Robot::start_until(13, Fault::OtherType, move || rows.exists());
    let publish = robot.source("/svl");
    let line = format!(
        "replay {} --publish {publish} --rows rows.csv",
        robot.source("")
    );
    let stale = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let words = b"no pairs for ";
            let is_stale = |message: &[u8]| {
                let mut places = message.windows(words.len() + 1);
                places.any(|place| place.starts_with(words) && place[words.len()] >= b'4')
            };
            let (_, message) = heard(&publish, &["/diagnostics"], is_stale);
            // The level follows header and count.
            assert_eq!(message[4 + 8 + 8 + 4], 3, "{message:?}");
            stale.store(true, Ordering::Relaxed);
        });
        let (code, stderr) = interrupted(&fixture, &line, || stale.load(Ordering::Relaxed));
        assert_eq!(code, Some(4), "{stderr}");
        let reason = "published as sensor_msgs/msg/CompressedImage too";
        assert_says(&stderr, &["/cam0/image_rect: ", reason]);
    });
}
