use super::scan::ClockScan;
use super::table::ClockTable;
use crate::cameras::topics::Selection;
use crate::stream::channel::{Channel, EventReader, FileEvent};
use crate::stream::stamp_rule::StampUnit;
use fastrand::Rng;

const MS: i64 = 1_000_000;
const S: i64 = 1_000 * MS;
/// Beginning of the log times.
const BEGIN: i64 = 1_700_000_000 * S;
const IMAGES: [&str; 2] = ["/left/image_rect", "/right/image_rect"];

/// A topic of a simulated robot.
#[derive(Clone)]
struct Publisher {
    topic: &'static str,
    schema: &'static str,
    period_ns: i64,
    from_ns: i64,
    /// Offset of its clock from that of the robot, nanoseconds, and its drift in millionths.
    clock_ns: i64,
    drift: f64,
    /// Time until a message is logged, and its largest random part.
    latency_ns: i64,
    jitter_ns: i64,
    /// Share of the messages that are lost.
    drops: f64,
}

fn publisher(topic: &'static str, schema: &'static str, period_ms: i64) -> Publisher {
    Publisher {
        topic,
        schema,
        period_ns: period_ms * MS,
        from_ns: 0,
        clock_ns: 0,
        drift: 0.0,
        latency_ns: 5 * MS,
        jitter_ns: 2 * MS,
        drops: 0.0,
    }
}

fn robot() -> Vec<Publisher> {
    let image = |topic| publisher(topic, "sensor_msgs/msg/Image", 33);
    vec![
        image(IMAGES[0]),
        image(IMAGES[1]),
        publisher("/points", "sensor_msgs/msg/PointCloud2", 100),
        publisher("/odom", "nav_msgs/msg/Odometry", 20),
        publisher("/left/camera_info", "sensor_msgs/msg/CameraInfo", 33),
    ]
}

/// A message: log time, topic, schema, stamp.
type Logged = (i64, &'static str, &'static str, i64);

/// The messages that a recorder logs in 20 s.
fn logged(robot: &[Publisher], random: &mut Rng) -> Vec<Logged> {
    let mut messages = Vec::new();
    for one in robot {
        let mut at = one.from_ns;
        while at < 20 * S {
            if random.f64() >= one.drops {
                let drift = (at as f64 * one.drift / 1e6) as i64;
                let late = one.latency_ns + random.i64(0..=one.jitter_ns);
                let stamp = BEGIN + at + one.clock_ns + drift;
                messages.push((BEGIN + at + late, one.topic, one.schema, stamp));
            }
            at += one.period_ns;
        }
    }
    messages.sort_by_key(|(log, ..)| *log);
    messages
}

/// A header with that stamp, and some bytes.
fn message(stamp: i64, bytes: u32) -> Vec<u8> {
    let mut data = vec![0, 1, 0, 0];
    data.extend(((stamp / S) as u32).to_le_bytes());
    data.extend(((stamp % S) as u32).to_le_bytes());
    data.extend([1, 0, 0, 0, 0, 0, 0, 0]);
    data.extend(bytes.to_le_bytes());
    data
}

fn table_with(messages: &[Logged], selection: &Selection) -> ClockTable {
    let mut scan = ClockScan::new(&IMAGES.map(str::to_owned));
    for (place, &(log, topic, schema, stamp)) in messages.iter().enumerate() {
        // Calibrations do not change.
        let bytes = if schema.ends_with("Info") { 7 } else { place };
        let data = message(stamp, bytes as u32);
        scan.take_in(&Channel::cdr(topic, schema), log as u64, &data);
    }
    ClockTable::new(&scan, &[], selection)
}

fn table(messages: &[Logged]) -> ClockTable {
    table_with(messages, &Selection::default())
}

fn robot_table(robot: &[Publisher]) -> ClockTable {
    table(&logged(robot, &mut Rng::with_seed(1)))
}

/// The messages with stamps changed by `change`, of all topics or of one.
fn stamped(topic: Option<&str>, change: impl Fn(i64) -> i64) -> Vec<Logged> {
    let mut messages = logged(&robot(), &mut Rng::with_seed(1));
    for message in &mut messages {
        if topic.is_none_or(|topic| topic == message.1) {
            message.3 = change(message.3);
        }
    }
    messages
}

/// The only fault is that of the topic, in these words.
#[track_caller]
fn names(table: &ClockTable, topic: &str, denies_pairs: bool, words: &str) {
    let [fault] = &table.faults[..] else {
        panic!("{:#?}", table.faults);
    };
    assert!(fault.doubt.subject.is_topic(topic), "{fault:?}");
    assert_eq!(fault.denies_pairs, denies_pairs, "{fault:?}");
    assert!(fault.doubt.to_string().contains(words), "{fault:?}");
}

#[test]
fn a_topic_of_another_clock_is_named_with_its_offset() {
    for (place, clock_s, words) in [
        (2, -1.0, "1.000 s behind"),
        (2, -60.0, "60.000 s behind"),
        (3, -0.7, "0.700 s behind"),
    ] {
        let mut robot = robot();
        robot[place].clock_ns = (clock_s * 1e9) as i64;
        names(&robot_table(&robot), robot[place].topic, false, words);
    }
    // Ahead of the images and of the log times.
    let mut ahead = robot();
    ahead[2].clock_ns = S;
    names(&robot_table(&ahead), "/points", false, "1.000 s ahead");
    ahead[2].clock_ns = 20 * MS;
    names(&robot_table(&ahead), "/points", false, "/points by 0.014 s");
}

#[test]
fn poses_may_be_ahead_by_2_s_and_equal_calibrations_are_never_wrong() {
    let mut robot = robot();
    robot[3].clock_ns = 1_900 * MS;
    robot[4].clock_ns = -100 * S;
    assert_eq!(robot_table(&robot).faults, []);
    robot[3].clock_ns = 2_100 * MS;
    names(&robot_table(&robot), "/odom", false, "/odom by 2.094 s");
    // Calibrations that change.
    let changing = logged(&robot[..2], &mut Rng::with_seed(1));
    let mut scan = ClockScan::new(&IMAGES.map(str::to_owned));
    for (place, (log, topic, schema, stamp)) in changing.into_iter().enumerate() {
        let data = message(stamp, place as u32);
        scan.take_in(&Channel::cdr(topic, schema), log as u64, &data);
        let calibration = message(stamp - 3 * S, place as u32);
        let info = Channel::cdr("/left/camera_info", "sensor_msgs/msg/CameraInfo");
        scan.take_in(&info, log as u64, &calibration);
    }
    let table = ClockTable::new(&scan, &[], &Selection::default());
    names(&table, "/left/camera_info", false, "3.000 s behind");
}

#[test]
fn a_right_clock_permits_no_pair_without_its_offset() {
    for (clock_ms, words, offset) in [
        (-300, "0.308 s behind", "--right-offset-ms 300.0`"),
        (1000, "0.992 s ahead", "--right-offset-ms -1000.0`"),
        (-33, "0.0", "--right-offset-ms 33.0`"),
    ] {
        let mut robot = robot();
        robot[1].clock_ns = clock_ms * MS;
        // The offset is that of the stamps, whatever the latency.
        robot[1].latency_ns += 8 * MS;
        let messages = logged(&robot, &mut Rng::with_seed(1));
        let found = table(&messages);
        let fault = &found.faults[0];
        assert!(
            fault.denies_pairs && fault.doubt.subject.is_topic(IMAGES[1]),
            "{fault:?}"
        );
        assert!(fault.doubt.to_string().contains(words), "{fault:?}");
        assert!(fault.doubt.to_string().contains(offset), "{fault:?}");
        let told = Selection {
            right_offset_ns: Some(-clock_ms * MS),
            ..Selection::default()
        };
        let told = table_with(&messages, &told);
        assert_eq!(told.faults, []);
        let rules = told.rules();
        assert_eq!(rules[IMAGES[1]].shift_ns, -clock_ms * MS);
        assert!(!rules.contains_key(IMAGES[0]));
        // Zero is the user's word, too.
        let left = Selection {
            right_offset_ns: Some(0),
            ..Selection::default()
        };
        assert!(table_with(&messages, &left).permits_pairs());
    }
    // A clock that steps in the first third is wrong for most of the recording.
    let stepped = stamped(Some(IMAGES[1]), |stamp| {
        if stamp - BEGIN < 6 * S {
            stamp
        } else {
            stamp - 300 * MS
        }
    });
    assert!(!table(&stepped).permits_pairs());
    // One that steps in the last third is found by the bins of log time.
    let stepped = stamped(Some(IMAGES[1]), |stamp| {
        stamp - if stamp - BEGIN < 14 * S { 0 } else { 300 * MS }
    });
    let found = table(&stepped);
    names(&found, IMAGES[1], true, "from none to 0.30");
    assert!(
        found.faults[0].doubt.to_string().contains("14 s after"),
        "{:?}",
        found.faults
    );
    // Half a period is the latency of a slower node.
    let mut slow = robot();
    slow[1].latency_ns += 16 * MS;
    assert_eq!(robot_table(&slow).faults, []);
}

#[test]
fn right_images_that_come_late_have_no_fault() {
    // By a constant time, from the first stamp on.
    let mut late = robot();
    late[1].latency_ns += 90 * MS;
    assert_eq!(robot_table(&late).faults, []);
    // For a while, as their calibrations of the same stamps show; a clock steps for both.
    let channels = [
        Channel::cdr("/right/image_rect", "sensor_msgs/msg/Image"),
        Channel::cdr("/right/camera_info", "sensor_msgs/msg/CameraInfo"),
    ];
    let mut with_infos = robot();
    with_infos.push(publisher(
        "/right/camera_info",
        "sensor_msgs/msg/CameraInfo",
        33,
    ));
    let right = logged(&with_infos, &mut Rng::with_seed(1));
    let permits = |mut messages: Vec<Logged>| {
        let mut scan = ClockScan::new(&IMAGES.map(str::to_owned));
        messages.sort_by_key(|(log, ..)| *log);
        for (place, (log, topic, schema, stamp)) in messages.into_iter().enumerate() {
            let data = message(stamp, place as u32);
            scan.take_in(&Channel::cdr(topic, schema), log as u64, &data);
        }
        let channels: Vec<_> = channels.iter().collect();
        ClockTable::new(&scan, &channels, &Selection::default()).permits_pairs()
    };
    for (late_ms, clock_ms) in [(120, 0), (0, 120)] {
        let mut messages = right.clone();
        for message in &mut messages {
            let is_then = (7..13).contains(&((message.3 - BEGIN) / S));
            message.0 += late_ms * MS * i64::from(is_then && message.1 == IMAGES[1]);
            message.3 -= clock_ms * MS * i64::from(is_then && message.1.starts_with("/right"));
        }
        assert_eq!(permits(messages), late_ms > 0);
    }
    // Images ahead of their calibrations, by ten periods, are not late.
    let mut ahead = right;
    for message in &mut ahead {
        message.0 += 400 * MS;
        message.3 += 330 * MS * i64::from(message.1 == IMAGES[1]);
    }
    assert!(!permits(ahead));
    // In batches of as many.
    for images in [10, 30] {
        let mut messages = logged(&robot(), &mut Rng::with_seed(1));
        for message in &mut messages {
            if message.1 == IMAGES[1] {
                let place = (message.3 - BEGIN) / (33 * MS);
                message.0 += (images - 1 - place % images) * 33 * MS;
            }
        }
        messages.sort_by_key(|(log, ..)| *log);
        assert_eq!(table(&messages).faults, [], "{images}");
    }
}

#[test]
fn the_left_clock_is_named_if_it_is_the_odd_one_out() {
    for (clock_ms, words, offset) in [
        (
            -300,
            "0.300 s behind those of /odom, /points and",
            "--right-offset-ms -300.0`",
        ),
        (
            1000,
            "1.000 s ahead of those of /odom, /points and",
            "--right-offset-ms 1000.0`",
        ),
    ] {
        let mut robot = robot();
        robot[0].clock_ns = clock_ms * MS;
        let messages = logged(&robot, &mut Rng::with_seed(1));
        let found = table(&messages);
        names(&found, IMAGES[0], true, words);
        assert!(
            found.faults[0].doubt.to_string().contains(offset),
            "{:?}",
            found.faults
        );
        let by_log = Selection {
            stamps: Some(StampUnit::Log),
            ..Selection::default()
        };
        assert_eq!(table_with(&messages, &by_log).faults, []);
    }
}

#[test]
fn stamps_in_another_unit_are_repaired_by_it() {
    let since = |unit: i64| move |stamp: i64| (stamp - BEGIN + 500 * S) / unit;
    for (unit_ns, unit, words) in [
        (1_000, StampUnit::Microseconds, "--stamps us"),
        (MS, StampUnit::Milliseconds, "--stamps ms"),
    ] {
        let messages = stamped(None, since(unit_ns));
        let found = table(&messages);
        assert_eq!(found.faults.len(), 4, "{:#?}", found.faults);
        assert!(!found.permits_pairs());
        for fault in &found.faults {
            assert!(fault.doubt.to_string().contains(words), "{fault:?}");
        }
        let selection = Selection {
            stamps: Some(unit),
            ..Selection::default()
        };
        let repaired = table_with(&messages, &selection);
        assert_eq!(repaired.faults, [], "{unit:?}");
        let hz = repaired.topics[0].stamps_hz.unwrap();
        assert!((hz - 30.3).abs() < 0.3, "{hz}");
        // Microseconds beside whole seconds.
        let parts = stamped(None, |stamp| stamp / S * S + stamp % S / unit_ns);
        assert!(table(&parts).faults[0].doubt.to_string().contains(words));
        assert_eq!(table_with(&parts, &selection).faults, []);
    }
}

#[test]
fn a_unit_that_no_topic_has_is_refused() {
    let with = |messages: &[Logged], unit| {
        let stamps = Some(unit);
        let selection = Selection {
            stamps,
            ..Selection::default()
        };
        table_with(messages, &selection).faults.swap_remove(0)
    };
    let right = stamped(None, |stamp| stamp);
    let fault = with(&right, StampUnit::Microseconds);
    assert!(
        fault.denies_pairs && fault.doubt.to_string().contains("leave it out"),
        "{fault:?}"
    );
    let microseconds = stamped(None, |stamp| (stamp - BEGIN + 500 * S) / 1_000);
    let fault = with(&microseconds, StampUnit::Milliseconds);
    assert!(
        fault.denies_pairs && fault.doubt.to_string().contains("--stamps us"),
        "{fault:?}"
    );
}

#[test]
fn stamps_that_count_images_are_replaced_by_log_times_alone() {
    let messages = stamped(None, |stamp| (stamp - BEGIN) / (20 * MS) + 1);
    let found = table(&messages);
    assert!(found.faults[0].doubt.to_string().contains("--stamps log"));
    let selection = Selection {
        stamps: Some(StampUnit::Log),
        ..Selection::default()
    };
    let repaired = table_with(&messages, &selection);
    assert!(repaired.faults.is_empty() && repaired.permits_pairs());
    let why = repaired.topics[0].not_measured;
    assert_eq!(why, Some("log times are stamps"));
    // One topic alone permits pairs, but none of its measurements.
    let one = stamped(Some("/points"), |stamp| (stamp - BEGIN) / (100 * MS) + 1);
    let found = table(&one);
    assert!(found.permits_pairs());
    assert!(found.check_measurements("/points").is_err());
    assert!(found.check_measurements("/odom").is_ok());
}

#[test]
fn a_stamp_of_0_is_one_where_the_clock_begins_there() {
    let begins = |messages: &[Logged]| {
        let rules = table(messages).rules();
        rules.get(IMAGES[0]).is_some_and(|rule| rule.begins_at_0)
    };
    let simulated = stamped(None, |stamp| stamp - BEGIN);
    assert_eq!(simulated[0].3, 0);
    assert!(begins(&simulated));
    // The first image of a camera whose clock is set later.
    assert!(!begins(&stamped(
        None,
        |stamp| if stamp < BEGIN + 50 * MS { 0 } else { stamp }
    )));
    assert!(!begins(&stamped(None, |_| 0)));
}

#[test]
fn messages_that_come_several_times_are_named_with_a_cure() {
    let copied = |topics: &[&str], copies: u32, stamps: u32| {
        let mut scan = ClockScan::new(&IMAGES.map(str::to_owned));
        for place in 0..60_u32 {
            for (topic, schema) in [
                (IMAGES[0], "sensor_msgs/msg/Image"),
                (IMAGES[1], "sensor_msgs/msg/Image"),
                ("/points", "sensor_msgs/msg/PointCloud2"),
            ] {
                let [number, stamp] = if topics.contains(&topic) {
                    [place / copies, place / stamps * stamps]
                } else {
                    [place; 2]
                };
                let stamp = BEGIN + i64::from(stamp) * 33 * MS;
                let log = BEGIN + i64::from(place) * 33 * MS + 5 * MS;
                let data = message(stamp, number);
                scan.take_in(&Channel::cdr(topic, schema), log as u64, &data);
            }
        }
        ClockTable::new(&scan, &[], &Selection::default())
    };
    let right = [IMAGES[1]];
    names(
        &copied(&right, 2, 1),
        IMAGES[1],
        false,
        "comes twice: the first 60 are 30 and",
    );
    names(
        &copied(&right, 3, 3),
        IMAGES[1],
        false,
        "comes 3 times: the first 60 are 20 and",
    );
    names(&copied(&["/points"], 2, 2), "/points", false, "comes twice");
    for (stamps, cure) in [(1, "`--every 3`"), (3, "`--allow-loss 81%`")] {
        let both = copied(&IMAGES, 3, stamps);
        assert_eq!(both.faults.len(), 2, "{:?}", both.faults);
        assert!(
            both.faults[0].doubt.to_string().contains(cure),
            "{:?}",
            both.faults
        );
    }
    // A camera at rest, and one that repeats some.
    assert_eq!(copied(&right, 60, 1).faults, []);
    assert_eq!(copied(&right, 30, 1).faults, []);
    assert_eq!(copied(&right, 1, 1).faults, []);
}

#[test]
fn a_clock_without_proof_is_not_measured() {
    let why = |messages: &[Logged]| {
        let found = table(messages);
        assert_eq!(found.faults, []);
        found
            .topics
            .iter()
            .map(|clock| clock.not_measured)
            .collect::<Vec<_>>()
    };
    let mut equal = stamped(Some("/points"), |stamp| stamp - 3 * S);
    equal.iter_mut().for_each(|message| message.0 = message.3);
    assert!(
        why(&equal)
            .iter()
            .all(|why| *why == Some("log times are stamps"))
    );
    let mut stopped = stamped(Some("/points"), |stamp| stamp - 3 * S);
    stopped.iter_mut().for_each(|message| message.0 = BEGIN);
    let expected = Some("log times do not advance");
    assert!(why(&stopped).iter().all(|why| *why == expected));
    let few = &stamped(Some("/points"), |stamp| stamp - 3 * S)[..20];
    assert!(
        why(few)
            .iter()
            .all(|why| *why == Some("fewer than 10 messages"))
    );
}

/// One of the ways in which a right recording differs from the simplest one.
fn disturb(robot: &mut [Publisher], random: &mut Rng) {
    for one in robot.iter_mut() {
        match random.u32(0..8) {
            0 => one.drops = random.f64() * 0.3,
            1 => one.jitter_ns = random.i64(0..40) * MS,
            2 => one.drift = 50.0,
            3 => one.from_ns = random.i64(0..10) * S,
            4 => one.period_ns *= 2,
            5 => one.latency_ns = random.i64(1..15) * MS,
            _ => {}
        }
    }
    if random.u32(0..8) == 0 {
        let jitter_ns = random.i64(100..1_000) * MS;
        robot.iter_mut().for_each(|one| one.jitter_ns = jitter_ns);
    }
    if random.bool() {
        robot[3].clock_ns = random.i64(0..1_900) * MS;
    }
}

/// A recorder that logs nothing for a while, and then the messages of one topic after another.
fn stalled(mut messages: Vec<Logged>, random: &mut Rng) -> Vec<Logged> {
    let from = BEGIN + random.i64(0..15) * S;
    let to = from + random.i64(200..3_000) * MS;
    let mut late: Vec<_> = messages
        .extract_if(.., |(log, ..)| (from..to).contains(log))
        .collect();
    if random.bool() {
        late.sort_by_key(|&(_, topic, ..)| topic);
    }
    let late = late.into_iter().zip(0..);
    messages
        .extend(late.map(|((_, topic, schema, stamp), i)| (to + i * 50_000, topic, schema, stamp)));
    messages.sort_by_key(|(log, ..)| *log);
    messages
}

/// A script that writes a bag as fast as it can, in the order of the stamps or by topics.
fn scripted(mut messages: Vec<Logged>, random: &mut Rng) -> Vec<Logged> {
    messages.sort_by_key(|&(.., stamp)| stamp);
    if random.bool() {
        messages.sort_by_key(|&(_, topic, ..)| topic);
    }
    let step = random.i64(10_000..3 * MS);
    let messages = messages.into_iter().zip(0..);
    messages
        .map(|((_, topic, schema, stamp), i)| (BEGIN + 1000 * S + i * step, topic, schema, stamp))
        .collect()
}

/// A simulation whose log times are those of a wall clock, at 0.3 to 1 of real time.
fn slowed(mut messages: Vec<Logged>, random: &mut Rng) -> Vec<Logged> {
    let speed = 0.3 + 0.7 * random.f64();
    for (log, .., stamp) in &mut messages {
        *log = BEGIN + ((*log - BEGIN) as f64 / speed) as i64;
        *stamp -= BEGIN;
    }
    messages
}

/// The clocks by the first messages and by some at twenty places, as large images permit.
fn sparse_table(messages: &[Logged], random: &mut Rng) -> ClockTable {
    let mut scan = ClockScan::new(&IMAGES.map(str::to_owned));
    let mut places: Vec<_> = (0..20).map(|_| random.usize(0..messages.len())).collect();
    places.sort_unstable();
    for (place, &(log, topic, schema, stamp)) in messages.iter().enumerate() {
        let bytes = if schema.ends_with("Info") { 7 } else { place };
        let data = message(stamp, bytes as u32);
        let is_later = places.iter().any(|from| (*from..from + 8).contains(&place));
        if !scan.has_enough() {
            scan.take_in(&Channel::cdr(topic, schema), log as u64, &data);
        } else if is_later {
            scan.take_in_later(&Channel::cdr(topic, schema), log as u64, &data);
        }
    }
    ClockTable::new(&scan, &[], &Selection::default())
}

#[test]
fn no_right_recording_is_warned_of() {
    let mut random = Rng::with_seed(73);
    for number in 0..200 {
        let mut robot = robot();
        disturb(&mut robot, &mut random);
        let mut messages = logged(&robot, &mut random);
        if number % 3 == 0 {
            messages = stalled(messages, &mut random);
        }
        messages = match number % 4 {
            0 => scripted(messages, &mut random),
            1 => slowed(messages, &mut random),
            _ => messages,
        };
        for found in [table(&messages), sparse_table(&messages, &mut random)] {
            let faults = found.faults;
            assert!(faults.is_empty(), "{number}: {faults:#?}");
        }
    }
}

/// The messages of a robot whose measurements are 3 s behind, changed.
fn behind(change: impl Fn(&mut Logged)) -> Vec<Logged> {
    let mut robot = robot();
    robot[2].clock_ns = -3 * S;
    let mut messages = logged(&robot, &mut Rng::with_seed(1));
    messages.iter_mut().for_each(change);
    messages.sort_by_key(|(log, ..)| *log);
    messages
}

#[test]
fn a_pause_or_a_few_odd_times_hide_no_clock() {
    let first = BEGIN + 10 * MS;
    let pause = |message: &mut Logged| {
        let later = i64::from(message.0 > BEGIN + 6 * S) * 60 * S;
        (message.0, message.3) = (message.0 + later, message.3 + later);
    };
    let log_pause =
        |message: &mut Logged| message.0 += i64::from(message.0 > BEGIN + 6 * S) * 60 * S;
    let odd_stamp = |message: &mut Logged| {
        let is_odd = message.1 == IMAGES[0] && message.3 == BEGIN + 33 * 9 * MS;
        message.3 -= i64::from(is_odd) * 50 * S;
    };
    let early_log = |message: &mut Logged| message.0 -= i64::from(message.0 < first) * 20 * S;
    let changes: [&dyn Fn(&mut Logged); 4] = [&pause, &log_pause, &odd_stamp, &early_log];
    for change in changes {
        let found = table(&behind(change));
        let fault = found
            .faults
            .iter()
            .find(|fault| fault.doubt.subject.is_topic("/points"));
        let reason = &fault.unwrap().doubt.to_string();
        assert!(
            reason.contains("3.000 s behind") || reason.contains("2.99"),
            "{reason}"
        );
    }
    // Pauses of a sound recording are no fault.
    let mut sound = logged(&robot(), &mut Rng::with_seed(1));
    sound.iter_mut().for_each(pause);
    assert_eq!(table(&sound).faults, []);
}

#[test]
fn left_log_times_that_are_stamps_are_compared_with_others() {
    let mut robot = robot();
    (robot[0].latency_ns, robot[0].jitter_ns) = (0, 0);
    assert_eq!(robot_table(&robot).faults, []);
    robot[2].clock_ns = -S;
    names(&robot_table(&robot), "/points", false, "1.006 s behind");
}

#[test]
fn images_that_a_node_repeats_at_times_are_named() {
    let messages = logged(&robot(), &mut Rng::with_seed(1));
    let copied = |is_copy: fn(u32) -> bool| {
        let mut scan = ClockScan::new(&IMAGES.map(str::to_owned));
        let (mut bytes, mut count) = (0, 0);
        for &(log, topic, schema, stamp) in &messages {
            if topic == IMAGES[1] {
                bytes += u32::from(!is_copy(count));
                count += 1;
            }
            let bytes = if topic == IMAGES[1] {
                bytes
            } else {
                log as u32
            };
            scan.take_in(
                &Channel::cdr(topic, schema),
                log as u64,
                &message(stamp, bytes),
            );
        }
        ClockTable::new(&scan, &[], &Selection::default())
    };
    // 20 images a second at 30, and every image twice but one.
    for is_copy in [|i| i % 3 == 2, |i| i % 2 == 1 && i != 99] {
        names(
            &copied(is_copy),
            IMAGES[1],
            false,
            "are copies of the one before",
        );
    }
    // A robot that stands, and one image that comes twice.
    for is_copy in [|i| (100..300).contains(&i), |i| i == 50] {
        assert_eq!(copied(is_copy).faults, []);
    }
}

#[test]
fn a_latency_is_no_offset_of_a_camera_that_begins_later() {
    let mut robot = robot();
    robot[1].latency_ns += 40 * MS;
    assert_eq!(robot_table(&robot).faults, [], "one stamp");
    robot[1].from_ns = 3 * 33 * MS;
    assert_eq!(robot_table(&robot).faults, [], "later");
    robot[1].latency_ns += 100 * MS;
    names(&robot_table(&robot), IMAGES[1], true, "0.140 s behind");
}

#[test]
fn units_below_a_second_are_read_within_one() {
    let within = |message: &Logged| message.3 - BEGIN < S && message.0 < BEGIN + 2 * S;
    let parts = stamped(None, |stamp| stamp / S * S + stamp % S / 1_000);
    let parts: Vec<_> = parts.into_iter().filter(within).collect();
    assert!(
        table(&parts).faults[0]
            .doubt
            .to_string()
            .contains("--stamps us")
    );
    let selection = Selection {
        stamps: Some(StampUnit::Microseconds),
        ..Selection::default()
    };
    assert_eq!(table_with(&parts, &selection).faults, []);
}

#[test]
fn left_images_that_come_late_accuse_nobody() {
    let mut robot = robot();
    robot[0].latency_ns += 800 * MS;
    assert_eq!(robot_table(&robot).faults, []);
    // Measurements of another clock besides.
    robot[2].clock_ns = -3 * S;
    names(&robot_table(&robot), "/points", false, "2.200 s behind");
}

/// Messages of a place of a recording, each of that many bytes.
struct PlaceMessages(Vec<(Channel, u64, usize)>, usize);

impl EventReader for PlaceMessages {
    fn next(&mut self) -> svl_core::Result<Option<FileEvent<'_>>> {
        self.1 += 1;
        let next = self.0.get(self.1 - 1);
        Ok(next.map(|(channel, log_ns, bytes)| {
            let mut data = message(*log_ns as i64, 0);
            data.resize(*bytes, 0);
            FileEvent::Message(channel, *log_ns, data.into())
        }))
    }
}

#[test]
fn a_place_is_read_up_to_a_measurement_that_is_needed() {
    let image = |side: usize| Channel::cdr(IMAGES[side], "sensor_msgs/msg/Image");
    let points = Channel::cdr("/points", "sensor_msgs/msg/PointCloud2");
    let mut scan = ClockScan::new(&IMAGES.map(str::to_owned));
    let mut read = |known: usize| {
        for i in 0..known {
            scan.take_in(&points, i as u64, &message(S, i as u32));
        }
        // Images of 200 kB, and a measurement behind the tenth pair.
        let mut place: Vec<_> = (0..20).map(|i| (image(i % 2), i as u64, 200_000)).collect();
        place.push((points.clone(), 20, 100));
        scan.read_place(&mut PlaceMessages(place, 0));
        scan.topics["/points"].later.len()
    };
    assert_eq!(read(1), 1, "few");
    assert_eq!(
        read(20),
        1,
        "enough: the place ends with an image of each camera"
    );
}
