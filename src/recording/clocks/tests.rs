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
const INFOS: [&str; 2] = ["/left/camera_info", "/right/camera_info"];

/// A topic of a simulated robot.
#[derive(Clone)]
struct Publisher {
    topic: &'static str,
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

fn publisher(topic: &'static str, period_ms: i64) -> Publisher {
    Publisher {
        topic,
        period_ns: period_ms * MS,
        from_ns: 0,
        clock_ns: 0,
        drift: 0.0,
        latency_ns: 5 * MS,
        jitter_ns: 2 * MS,
        drops: 0.0,
    }
}

/// Both images, points, odometry, and a calibration.
fn robot() -> Vec<Publisher> {
    let images = IMAGES.map(|topic| publisher(topic, 33));
    let others = [("/points", 100), ("/odom", 20), (INFOS[0], 33)];
    let others = others.map(|(topic, period_ms)| publisher(topic, period_ms));
    images.into_iter().chain(others).collect()
}

fn channel(topic: &str) -> Channel {
    let schema = match topic {
        "/points" => "sensor_msgs/msg/PointCloud2",
        "/odom" => "nav_msgs/msg/Odometry",
        info if INFOS.contains(&info) => "sensor_msgs/msg/CameraInfo",
        _ => "sensor_msgs/msg/Image",
    };
    Channel::cdr(topic, schema)
}

/// A message: its log time, and a number that stands for its data.
#[derive(Clone, Copy)]
struct Logged {
    log: i64,
    topic: &'static str,
    stamp: i64,
    data: u32,
}

fn sort_by_log(messages: &mut [Logged]) {
    messages.sort_by_key(|message| message.log);
}

/// The messages that a recorder logs in 20 s.
fn logged_at_random(robot: &[Publisher], random: &mut Rng) -> Vec<Logged> {
    let mut messages = Vec::new();
    for one in robot {
        let mut at = one.from_ns;
        while at < 20 * S {
            if random.f64() >= one.drops {
                let drift = (at as f64 * one.drift / 1e6) as i64;
                let late = one.latency_ns + random.i64(0..=one.jitter_ns);
                // Calibrations do not change.
                let is_info = INFOS.contains(&one.topic);
                messages.push(Logged {
                    log: BEGIN + at + late,
                    topic: one.topic,
                    stamp: BEGIN + at + one.clock_ns + drift,
                    data: if is_info { 7 } else { at as u32 },
                });
            }
            at += one.period_ns;
        }
    }
    sort_by_log(&mut messages);
    messages
}

fn logged(robot: &[Publisher]) -> Vec<Logged> {
    logged_at_random(robot, &mut Rng::with_seed(1))
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

fn new_scan() -> ClockScan {
    ClockScan::new(&IMAGES.map(str::to_owned))
}

fn table_with(messages: &[Logged], selection: &Selection) -> ClockTable {
    table_of(messages, &[], selection)
}

fn table_of(messages: &[Logged], channels: &[&Channel], selection: &Selection) -> ClockTable {
    let mut scan = new_scan();
    for one in messages {
        let data = message(one.stamp, one.data);
        scan.take_in(&channel(one.topic), one.log as u64, &data);
    }
    ClockTable::new(&scan, channels, selection)
}

fn table(messages: &[Logged]) -> ClockTable {
    table_with(messages, &Selection::default())
}

fn robot_table(change: impl Fn(&mut [Publisher])) -> ClockTable {
    let mut robot = robot();
    change(&mut robot);
    table(&logged(&robot))
}

/// The messages with stamps changed by `change`, of all topics or of one.
fn stamped(topic: Option<&str>, change: impl Fn(i64) -> i64) -> Vec<Logged> {
    let mut messages = logged(&robot());
    for message in &mut messages {
        if topic.is_none_or(|topic| topic == message.topic) {
            message.stamp = change(message.stamp);
        }
    }
    messages
}

fn by_unit(unit: StampUnit) -> Selection {
    Selection {
        stamps: Some(unit),
        ..Selection::default()
    }
}

fn by_offset(offset_ns: i64) -> Selection {
    Selection {
        right_offset_ns: Some(offset_ns),
        ..Selection::default()
    }
}

/// The first fault is in these words.
#[track_caller]
fn check_words(table: &ClockTable, words: &str) {
    let found = table.faults[0].doubt.to_string();
    assert!(found.contains(words), "{words}: {found}");
}

/// The only fault is that of the topic, in these words.
#[track_caller]
fn check_fault(table: &ClockTable, topic: &str, denies_pairs: bool, words: &str) {
    let faults = &table.faults;
    assert_eq!(faults.len(), 1, "{faults:#?}");
    assert!(faults[0].doubt.subject.is_topic(topic), "{faults:?}");
    assert_eq!(faults[0].denies_pairs, denies_pairs, "{faults:?}");
    check_words(table, words);
}

fn right_images(messages: &mut [Logged]) -> impl Iterator<Item = &mut Logged> {
    let messages = messages.iter_mut();
    messages.filter(|message| message.topic == IMAGES[1])
}

/// A clock of the points on another robot: no fault without, one in these words with its offset.
#[track_caller]
fn check_points(change: impl Fn(&mut [Publisher]), offset_s: i64, words: &str) {
    assert_eq!(robot_table(&change).faults, []);
    let found = robot_table(|robot| {
        change(robot);
        robot[2].clock_ns = offset_s * S;
    });
    check_fault(&found, "/points", false, words);
}

#[test]
fn a_topic_of_another_clock_is_named_with_its_offset() {
    check_points(|_| {}, -1, "1.000 s behind");
    check_points(|_| {}, -60, "60.000 s behind");
    check_points(|_| {}, 1, "1.000 s ahead");
    // Left log times that are stamps are compared with others.
    let unlogged = |robot: &mut [Publisher]| (robot[0].latency_ns, robot[0].jitter_ns) = (0, 0);
    check_points(unlogged, -1, "1.006 s behind");
    // Left images that come late accuse no camera.
    check_points(
        |robot| robot[0].latency_ns += 800 * MS,
        -3,
        "2.200 s behind",
    );
    // Ahead of the images and of the log times.
    let ahead = robot_table(|robot| robot[2].clock_ns = 20 * MS);
    check_fault(&ahead, "/points", false, "/points by 0.014 s");
    let odometry = robot_table(|robot| robot[3].clock_ns = -700 * MS);
    check_fault(&odometry, "/odom", false, "0.700 s behind");
}

#[test]
fn a_latency_is_no_offset_of_a_camera_that_begins_later() {
    let with = |latency_ms, from_ms| {
        robot_table(|robot| {
            robot[1].latency_ns += latency_ms * MS;
            robot[1].from_ns = from_ms * MS;
        })
    };
    assert_eq!(with(40, 0).faults, [], "one stamp");
    assert_eq!(with(40, 3 * 33).faults, [], "later");
    check_fault(&with(140, 3 * 33), IMAGES[1], true, "0.140 s behind");
}

#[test]
fn poses_may_be_ahead_by_2_s_and_equal_calibrations_are_never_wrong() {
    let with = |odom_ms| {
        robot_table(|robot| {
            robot[3].clock_ns = odom_ms * MS;
            robot[4].clock_ns = -100 * S;
        })
    };
    assert_eq!(with(1_900).faults, []);
    check_fault(&with(2_100), "/odom", false, "/odom by 2.094 s");
    // Calibrations that change.
    let images = logged(&robot()[..2]);
    let infos = images.iter().map(|image| Logged {
        topic: INFOS[0],
        stamp: image.stamp - 3 * S,
        ..*image
    });
    let mut messages: Vec<_> = images.iter().copied().chain(infos).collect();
    sort_by_log(&mut messages);
    check_fault(&table(&messages), INFOS[0], false, "3.000 s behind");
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
        let messages = logged(&robot);
        let found = table(&messages);
        let fault = &found.faults[0];
        assert!(fault.denies_pairs && fault.doubt.subject.is_topic(IMAGES[1]));
        check_words(&found, words);
        check_words(&found, offset);
        let told = table_with(&messages, &by_offset(-clock_ms * MS));
        assert_eq!(told.faults, []);
        let rules = told.rules();
        assert_eq!(rules[IMAGES[1]].shift_ns, -clock_ms * MS);
        assert!(!rules.contains_key(IMAGES[0]));
        // Zero is the user's word, too.
        assert!(table_with(&messages, &by_offset(0)).permits_pairs());
    }
    let stepped = |after_s| {
        let is_after = |stamp| i64::from(stamp - BEGIN >= after_s * S);
        let step = |stamp| stamp - is_after(stamp) * 300 * MS;
        table(&stamped(Some(IMAGES[1]), step))
    };
    // A clock that steps in the first third is wrong for most of the recording.
    assert!(!stepped(6).permits_pairs());
    // One that steps in the last third is found by the bins of log time.
    check_fault(&stepped(14), IMAGES[1], true, "from none to 0.30");
    check_words(&stepped(14), "14 s after");
}

#[test]
fn right_images_that_come_late_have_no_fault() {
    // Half a period is the latency of a slower node; more, if it is so from the first stamp on.
    for late_ms in [16, 90] {
        let late = robot_table(|robot| robot[1].latency_ns += late_ms * MS);
        assert_eq!(late.faults, [], "{late_ms}");
    }
    // For a while, as their calibrations of the same stamps show; a clock steps for both.
    let mut robot = robot();
    robot.push(publisher(INFOS[1], 33));
    let mut right = logged(&robot);
    right.iter_mut().for_each(|one| one.data = one.log as u32);
    let permits = |change: &dyn Fn(&mut Logged)| {
        let mut messages = right.clone();
        messages.iter_mut().for_each(change);
        sort_by_log(&mut messages);
        let channels = [channel(IMAGES[1]), channel(INFOS[1])];
        table_of(&messages, &channels.each_ref(), &Selection::default()).permits_pairs()
    };
    for (late_ms, clock_ms) in [(120, 0), (0, 120)] {
        let permitted = permits(&|message| {
            let is_then = (7..13).contains(&((message.stamp - BEGIN) / S));
            let is_late = is_then && message.topic == IMAGES[1];
            message.log += late_ms * MS * i64::from(is_late);
            let is_other = is_then && message.topic.starts_with("/right");
            message.stamp -= clock_ms * MS * i64::from(is_other);
        });
        assert_eq!(permitted, late_ms > 0);
    }
    // Images ahead of their calibrations, by ten periods, are not late.
    assert!(!permits(&|message| {
        message.log += 400 * MS;
        message.stamp += 330 * MS * i64::from(message.topic == IMAGES[1]);
    }));
    // In batches of as many.
    for images in [10, 30] {
        let mut messages = stamped(None, |stamp| stamp);
        for message in right_images(&mut messages) {
            let place = (message.stamp - BEGIN) / (33 * MS);
            message.log += (images - 1 - place % images) * 33 * MS;
        }
        sort_by_log(&mut messages);
        assert_eq!(table(&messages).faults, [], "{images}");
    }
}

#[test]
fn the_left_clock_is_named_if_it_is_the_odd_one_out() {
    for (clock_ms, words, offset) in [
        (-300, "0.300 s behind", "--right-offset-ms -300.0`"),
        (1000, "1.000 s ahead of", "--right-offset-ms 1000.0`"),
    ] {
        let mut robot = robot();
        robot[0].clock_ns = clock_ms * MS;
        let messages = logged(&robot);
        let found = table(&messages);
        let words = format!("{words} those of /odom, /points and");
        check_fault(&found, IMAGES[0], true, &words);
        check_words(&found, offset);
        assert_eq!(table_with(&messages, &by_unit(StampUnit::Log)).faults, []);
    }
}

#[test]
fn stamps_in_another_unit_are_repaired_by_it() {
    for (unit_ns, unit, words) in [
        (1_000, StampUnit::Microseconds, "--stamps us"),
        (MS, StampUnit::Milliseconds, "--stamps ms"),
    ] {
        let messages = stamped(None, |stamp| (stamp - BEGIN + 500 * S) / unit_ns);
        let found = table(&messages);
        assert_eq!(found.faults.len(), 4, "{:#?}", found.faults);
        assert!(!found.permits_pairs());
        for fault in &found.faults {
            assert!(fault.doubt.to_string().contains(words), "{fault:?}");
        }
        let repaired = table_with(&messages, &by_unit(unit));
        assert_eq!(repaired.faults, [], "{unit:?}");
        let hz = repaired.topics[0].stamps_hz.unwrap();
        assert!((hz - 30.3).abs() < 0.3, "{hz}");
        // Microseconds beside whole seconds.
        let parts = stamped(None, |stamp| stamp / S * S + stamp % S / unit_ns);
        check_words(&table(&parts), words);
        assert_eq!(table_with(&parts, &by_unit(unit)).faults, []);
    }
}

#[test]
fn units_below_a_second_are_read_within_one() {
    let mut parts = stamped(None, |stamp| stamp / S * S + stamp % S / 1_000);
    parts.retain(|message| message.stamp - BEGIN < S && message.log < BEGIN + 2 * S);
    check_words(&table(&parts), "--stamps us");
    let repaired = table_with(&parts, &by_unit(StampUnit::Microseconds));
    assert_eq!(repaired.faults, []);
}

#[test]
fn a_unit_that_no_topic_has_is_refused() {
    let check = |change: fn(i64) -> i64, unit, words| {
        let found = table_with(&stamped(None, change), &by_unit(unit));
        assert!(found.faults[0].denies_pairs);
        check_words(&found, words);
    };
    check(|stamp| stamp, StampUnit::Microseconds, "leave it out");
    let in_microseconds = |stamp| (stamp - BEGIN + 500 * S) / 1_000;
    check(in_microseconds, StampUnit::Milliseconds, "--stamps us");
}

#[test]
fn stamps_that_count_images_are_replaced_by_log_times_alone() {
    let messages = stamped(None, |stamp| (stamp - BEGIN) / (20 * MS) + 1);
    check_words(&table(&messages), "--stamps log");
    let repaired = table_with(&messages, &by_unit(StampUnit::Log));
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
    let begins = |change: fn(i64) -> i64| {
        let messages = stamped(None, change);
        let rules = table(&messages).rules();
        let begins = rules.get(IMAGES[0]).is_some_and(|rule| rule.begins_at_0);
        (messages[0].stamp, begins)
    };
    assert_eq!(begins(|stamp| stamp - BEGIN), (0, true));
    // The first image of a camera whose clock is set later.
    let set_later = |stamp| if stamp < BEGIN + 50 * MS { 0 } else { stamp };
    assert_eq!(begins(set_later), (0, false));
    assert_eq!(begins(|_| 0), (0, false));
}

#[test]
fn messages_that_come_several_times_are_named_with_a_cure() {
    let copied = |topics: &[&str], copies: u32, stamps: u32| {
        let topics_at = |place: u32| {
            [IMAGES[0], IMAGES[1], "/points"].map(|topic| {
                let is_copied = topics.contains(&topic);
                let (copies, stamps) = if is_copied { (copies, stamps) } else { (1, 1) };
                Logged {
                    log: BEGIN + i64::from(place) * 33 * MS + 5 * MS,
                    topic,
                    stamp: BEGIN + i64::from(place / stamps * stamps) * 33 * MS,
                    data: place / copies,
                }
            })
        };
        table(&(0..60).flat_map(topics_at).collect::<Vec<_>>())
    };
    for (topic, copies, stamps, words) in [
        (IMAGES[1], 2, 1, "comes twice: the first 60 are 30 and"),
        (IMAGES[1], 3, 3, "comes 3 times: the first 60 are 20 and"),
        ("/points", 2, 2, "comes twice"),
    ] {
        check_fault(&copied(&[topic], copies, stamps), topic, false, words);
    }
    for (stamps, cure) in [(1, "`--every 3`"), (3, "`--allow-loss 81%`")] {
        let both = copied(&IMAGES, 3, stamps);
        assert_eq!(both.faults.len(), 2, "{:?}", both.faults);
        check_words(&both, cure);
    }
    // A camera at rest, and one that repeats some.
    for copies in [60, 30, 1] {
        assert_eq!(copied(&[IMAGES[1]], copies, 1).faults, []);
    }
}

#[test]
fn a_clock_without_proof_is_not_measured() {
    let check = |messages: &[Logged], why: &str| {
        let found = table(messages);
        assert_eq!(found.faults, []);
        for clock in &found.topics {
            assert_eq!(clock.not_measured, Some(why));
        }
    };
    let behind = || stamped(Some("/points"), |stamp| stamp - 3 * S);
    let logged_at = |log: fn(i64) -> i64| {
        let mut messages = behind();
        messages.iter_mut().for_each(|one| one.log = log(one.stamp));
        messages
    };
    check(&logged_at(|stamp| stamp), "log times are stamps");
    check(&logged_at(|_| BEGIN), "log times do not advance");
    check(&behind()[..20], "fewer than 10 messages");
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
    let is_late = |message: &mut Logged| (from..to).contains(&message.log);
    let mut late: Vec<_> = messages.extract_if(.., is_late).collect();
    if random.bool() {
        late.sort_by_key(|message| message.topic);
    }
    let late = late.into_iter().zip(0..);
    messages.extend(late.map(|(message, i)| Logged {
        log: to + i * 50_000,
        ..message
    }));
    sort_by_log(&mut messages);
    messages
}

/// A script that writes a bag as fast as it can, in the order of the stamps or by topics.
fn scripted(mut messages: Vec<Logged>, random: &mut Rng) -> Vec<Logged> {
    messages.sort_by_key(|message| message.stamp);
    if random.bool() {
        messages.sort_by_key(|message| message.topic);
    }
    let step = random.i64(10_000..3 * MS);
    for (message, i) in messages.iter_mut().zip(0..) {
        message.log = BEGIN + 1000 * S + i * step;
    }
    messages
}

/// A simulation whose log times are those of a wall clock, at 0.3 to 1 of real time.
fn slowed(mut messages: Vec<Logged>, random: &mut Rng) -> Vec<Logged> {
    let speed = 0.3 + 0.7 * random.f64();
    for message in &mut messages {
        message.log = BEGIN + ((message.log - BEGIN) as f64 / speed) as i64;
        message.stamp -= BEGIN;
    }
    messages
}

/// The clocks by the first messages and by some at twenty places, as large images permit.
fn sparse_table(messages: &[Logged], random: &mut Rng) -> ClockTable {
    let mut scan = new_scan();
    let mut places: Vec<_> = (0..20).map(|_| random.usize(0..messages.len())).collect();
    places.sort_unstable();
    for (place, one) in messages.iter().enumerate() {
        let data = message(one.stamp, one.data);
        let is_later = places.iter().any(|from| (*from..from + 8).contains(&place));
        if !scan.has_enough() {
            scan.take_in(&channel(one.topic), one.log as u64, &data);
        } else if is_later {
            scan.take_in_later(&channel(one.topic), one.log as u64, &data);
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
        let mut messages = logged_at_random(&robot, &mut random);
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

#[test]
fn a_pause_or_a_few_odd_times_hide_no_clock() {
    // Measurements that are 3 s behind.
    let mut behind = robot();
    behind[2].clock_ns = -3 * S;
    let is_late = |message: &Logged| i64::from(message.log > BEGIN + 6 * S);
    let pause = |message: &mut Logged| {
        let later = is_late(message) * 60 * S;
        (message.log, message.stamp) = (message.log + later, message.stamp + later);
    };
    let log_pause = |message: &mut Logged| message.log += is_late(message) * 60 * S;
    let odd_stamp = |message: &mut Logged| {
        let is_odd = message.topic == IMAGES[0] && message.stamp == BEGIN + 33 * 9 * MS;
        message.stamp -= i64::from(is_odd) * 50 * S;
    };
    let early_log = |message: &mut Logged| {
        message.log -= i64::from(message.log < BEGIN + 10 * MS) * 20 * S;
    };
    let changes: [&dyn Fn(&mut Logged); 4] = [&pause, &log_pause, &odd_stamp, &early_log];
    for change in changes {
        let mut messages = logged(&behind);
        messages.iter_mut().for_each(change);
        sort_by_log(&mut messages);
        let mut faults = table(&messages).faults;
        faults.retain(|fault| fault.doubt.subject.is_topic("/points"));
        let reason = faults[0].doubt.to_string();
        let is_near = reason.contains("3.000 s behind") || reason.contains("2.99");
        assert!(is_near, "{reason}");
    }
    // Pauses of a sound recording are no fault.
    let mut sound = logged(&robot());
    sound.iter_mut().for_each(pause);
    assert_eq!(table(&sound).faults, []);
}

#[test]
fn images_that_a_node_repeats_at_times_are_named() {
    let copied = |is_copy: fn(u32) -> bool| {
        let mut messages = logged(&robot());
        let mut data = 0;
        messages
            .iter_mut()
            .for_each(|one| one.data = one.log as u32);
        for (image, count) in right_images(&mut messages).zip(0..) {
            data += u32::from(!is_copy(count));
            image.data = data;
        }
        table(&messages)
    };
    // 20 images a second at 30, and every image twice but one.
    for is_copy in [|i| i % 3 == 2, |i| i % 2 == 1 && i != 99] {
        let words = "are copies of the one before";
        check_fault(&copied(is_copy), IMAGES[1], false, words);
    }
    // A robot that stands, and one image that comes twice.
    for is_copy in [|i| (100..300).contains(&i), |i| i == 50] {
        assert_eq!(copied(is_copy).faults, []);
    }
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
    let points = channel("/points");
    let mut scan = new_scan();
    let mut read = |known: usize| {
        for i in 0..known {
            scan.take_in(&points, i as u64, &message(S, i as u32));
        }
        // Images of 200 kB, and a measurement behind the tenth pair.
        let images = (0..20).map(|i| (channel(IMAGES[i % 2]), i as u64, 200_000));
        let place = images.chain([(points.clone(), 20, 100)]).collect();
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
