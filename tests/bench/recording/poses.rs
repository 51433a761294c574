//! Poses in other programs' recordings, and truths that are moved by them.

use super::bag::{self, Message, cdr_in, ros_image};
use super::frames::{PERIOD_NS, START_NS, image, read};
use super::sensor::{SIZE, cloud, open, pairs, tf};
use crate::cli::fixture::Fixture;
use crate::common::assert_says;
use re_cdr::{CdrWriter, LittleEndian};
use std::path::Path;
use svl::report::{CheckpointRow, read_rows};
use svl::stereo::{Frame, MapDensity, Truth};

/// Speed along the optical axis, m/s, of a robot that starts at x = 3 m.
const SPEED: f64 = 1.5;
/// Rotation of an optical frame in a robot's: z ahead, x right. As x, y, z, w.
const OPTICAL: [f64; 4] = [-0.5, 0.5, -0.5, 0.5];

fn x_at(stamp: u64) -> f64 {
    3.0 + SPEED * (stamp as f64 - START_NS as f64) / 1e9
}

fn numbers(cdr: &mut CdrWriter<'_, LittleEndian>, pose: [f64; 3], turn: [f64; 4]) {
    pose.iter().chain(&turn).for_each(|&v| cdr.write_f64(v));
}

fn transform(
    topic: &'static str,
    stamp: u64,
    frames: [&str; 2],
    at: [f64; 3],
    turn: [f64; 4],
) -> Message {
    let mut data = vec![0, 1, 0, 0];
    let mut cdr = CdrWriter::<LittleEndian>::new(&mut data);
    cdr.write_sequence_length(1);
    cdr.write_u32((stamp / 1_000_000_000) as u32);
    cdr.write_u32((stamp % 1_000_000_000) as u32);
    cdr.write_string(frames[0]);
    cdr.write_string(frames[1]);
    numbers(&mut cdr, at, turn);
    Message {
        data,
        log_time: stamp,
        ..tf(topic, &[])
    }
}

fn odometry(stamp: u64) -> Message {
    odometry_of("/odom", "base_link", stamp, [x_at(stamp), 1.0, 0.0])
}

fn odometry_of(topic: &'static str, child: &str, stamp: u64, at: [f64; 3]) -> Message {
    let data = cdr_in("odom", stamp, |cdr| {
        cdr.write_string(child);
        numbers(cdr, at, [0.0, 0.0, 0.0, 1.0]);
        (0..36 + 6 + 36).for_each(|_| cdr.write_f64(0.0));
    });
    Message {
        topic,
        schema: "nav_msgs/msg/Odometry",
        encoding: "cdr",
        log_time: stamp,
        data,
    }
}

fn moving(stamp: u64) -> Message {
    let at = [x_at(stamp), 1.0, 0.0];
    transform(
        "/tf",
        stamp,
        ["odom", "base_link"],
        at,
        [0.0, 0.0, 0.0, 1.0],
    )
}

/// Two pairs of a camera 0.1 m ahead of the robot's middle and 0.3 m above it, and the robot's
/// poses every 40 ms, which are not the pairs' times.
fn messages(pose: fn(u64) -> Message) -> Vec<Message> {
    let camera = transform(
        "/tf_static",
        0,
        ["base_link", "cam"],
        [0.1, 0.0, 0.3],
        OPTICAL,
    );
    let stamps = (0..8).map(|i| START_NS - 30_000_000 + 40_000_000 * i);
    let mut all: Vec<_> = [camera].into_iter().chain(stamps.map(pose)).collect();
    all.extend(pairs());
    all
}

fn truths(path: &Path) -> Vec<Option<Truth>> {
    let mut source = open(path, "/points").unwrap().source;
    let frames = std::iter::from_fn(|| source.next().unwrap());
    frames.map(|frame: Frame| frame.truth).collect()
}

#[test]
fn transforms_and_odometry_are_poses() {
    let folder = tempfile::tempdir().unwrap();
    for pose in [moving, odometry] {
        let (frames, error) = read(&bag::write(folder.path(), &messages(pose)));
        assert!(error.is_none() && frames.len() == 2);
        for frame in &frames {
            let pose = frame.pose.unwrap();
            let expected = nalgebra::Vector3::new(x_at(frame.stamp_ns) + 0.1, 1.0, 0.3);
            assert!((pose.translation.vector - expected).norm() < 1e-6, "{pose}");
            let view = pose.rotation * nalgebra::Vector3::z() - nalgebra::Vector3::x();
            assert!(view.norm() < 1e-9, "{pose}");
        }
    }
    // Without the transform to the camera, or with poses of another time, there is none.
    let (frames, _) = read(&bag::write(folder.path(), &messages(moving)[1..]));
    assert!(frames[0].pose.is_none());
    let late: fn(u64) -> Message = |stamp| moving(stamp + 60_000_000_000);
    let (frames, _) = read(&bag::write(folder.path(), &messages(late)));
    assert!(frames[0].pose.is_none());
}

/// A `/tf_static` message of two transforms, the first of a gripper with a quaternion of zeros.
fn damaged_and_camera() -> Message {
    let mut data = vec![0, 1, 0, 0];
    let mut cdr = CdrWriter::<LittleEndian>::new(&mut data);
    cdr.write_sequence_length(2);
    let frames = [
        ("gripper", [0.0; 3], [0.0; 4]),
        ("cam", [0.1, 0.0, 0.3], OPTICAL),
    ];
    for (child, at, turn) in frames {
        cdr.write_u32(0);
        cdr.write_u32(0);
        cdr.write_string("base_link");
        cdr.write_string(child);
        numbers(&mut cdr, at, turn);
    }
    Message {
        data,
        ..tf("/tf_static", &[])
    }
}

#[test]
fn an_invalid_transform_costs_no_other() {
    let fixture = Fixture::new();
    let mut all = messages(moving);
    let expected = places(&all).unwrap();
    all[0] = damaged_and_camera();
    assert_eq!(places(&all).unwrap(), expected);
    bag::write(&fixture.path(""), &all);
    let ran = fixture.svl("record bag.mcap -q --calib none -o x.mcap");
    assert!(ran.stderr.is_empty(), "{}", ran.stderr);
    let ran = fixture.svl("record bag.mcap --calib none -o y.mcap");
    let words = "/tf_static: its transform of 'gripper' in 'base_link' has a quaternion whose norm";
    assert_eq!(ran.stderr.matches(words).count(), 1, "{}", ran.stderr);
}

/// Place of the camera in each pair of these messages; `None` if a pair has no pose.
fn places(messages: &[Message]) -> Option<Vec<[f64; 3]>> {
    let folder = tempfile::tempdir().unwrap();
    let (frames, error) = read(&bag::write(folder.path(), messages));
    assert!(error.is_none() && frames.len() == 2);
    let place = |frame: &Frame| Some(frame.pose?.translation.vector.into());
    frames.iter().map(place).collect()
}

#[test]
fn poses_of_other_frames_and_topics_change_none() {
    let expected = places(&messages(moving)).unwrap();
    let still = |frames, stamp| transform("/tf", stamp, frames, [0.0; 3], [0.0, 0.0, 0.0, 1.0]);
    let ahead = START_NS + 10_000_000_000;
    let mut all = messages(moving);
    all.insert(1, still(["arm", "hand"], ahead));
    assert_eq!(places(&all).unwrap(), expected);
    // A moving frame above the camera's has no pose at the pairs' time, nor between two 11 s apart.
    all.insert(1, still(["map", "odom"], ahead));
    assert_eq!(places(&all), None);
    all.insert(1, still(["map", "odom"], START_NS - 1_000_000_000));
    assert_eq!(places(&all), None);
    // A second odometry of one frame is another estimate: it is not mixed with the first.
    let second =
        |stamp: u64| odometry_of("/wheels", "base_link", stamp, [x_at(stamp) + 7.0, 0.0, 0.0]);
    let all = messages(odometry).into_iter().flat_map(|message| {
        let second = (message.topic == "/odom").then(|| second(message.log_time));
        std::iter::once(message).chain(second)
    });
    assert_eq!(places(&all.collect::<Vec<_>>()).unwrap(), expected);
}

#[test]
fn odometry_that_contradicts_tf_is_told() {
    let fixture = Fixture::new();
    let other = |stamp| odometry_of("/wheels", "base_link", stamp, [-x_at(stamp), 1.0, 0.0]);
    for (second, is_told) in [(odometry as fn(u64) -> Message, false), (other, true)] {
        let all = messages(moving).into_iter().flat_map(|message| {
            let second = (message.topic == "/tf").then(|| second(message.log_time));
            std::iter::once(message).chain(second)
        });
        bag::write(&fixture.path(""), &all.collect::<Vec<_>>());
        let ran = fixture.svl("record bag.mcap -o x.mcap --force");
        let words = "/wheels: poses of 'base_link' differ from those of /tf, which are used";
        assert_eq!(ran.stderr.contains(words), is_told, "{}", ran.stderr);
    }
}

#[test]
fn odometry_of_a_frame_with_a_static_parent_is_used() {
    // The odometry of an inertial sensor, a child of the robot, in which the camera is.
    let sensor_pose = |stamp: u64| odometry_of("/vio", "imu", stamp, [x_at(stamp), 1.0, 0.0]);
    let fixed = |frames: [&str; 2], at, turn| transform("/tf_static", 0, frames, at, turn);
    let mut all = vec![
        fixed(["base_link", "imu"], [0.0, 0.0, 0.5], [0.0, 0.0, 0.0, 1.0]),
        fixed(["imu", "cam"], [0.1, 0.0, 0.3], OPTICAL),
    ];
    all.extend(messages(sensor_pose).into_iter().skip(1));
    let expected = places(&messages(moving)).unwrap();
    let found = places(&all).unwrap();
    for (a, b) in expected.iter().flatten().zip(found.iter().flatten()) {
        assert!((a - b).abs() < 1e-9, "{expected:?} {found:?}");
    }
}

#[test]
fn a_truth_of_another_time_is_moved_to_the_pair_s() {
    let fixture = Fixture::new();
    let folder = fixture.path("");
    // A wall 2 m ahead, seen at the pair's time, and 12 ms later from nearer.
    let wall = |late_ns: u64| {
        let z = 2.0 - SPEED * late_ns as f64 / 1e9;
        let points = (0..60).map(|i| [f64::from(i % 10) * 0.006, f64::from(i / 10) * 0.006, z]);
        let points: Vec<_> = points.map(|point| point.map(|v| v as f32)).collect();
        cloud("cam", START_NS + PERIOD_NS + late_ns, &points)
    };
    let with = |pose: fn(u64) -> Message, wall: Message| {
        let all: Vec<_> = messages(pose).into_iter().chain([wall]).collect();
        bag::write(&folder, &all)
    };
    let still = truths(&with(moving, wall(0)));
    let moved = truths(&with(moving, wall(12_000_000)));
    let disparities = [&still, &moved].map(|truths| truths[1].as_ref().unwrap().disparity.clone());
    let known = disparities[0].pixels().filter(|d| d.is_finite()).count();
    assert!(known > 40 && still[0].is_none(), "{known}");
    for (a, b) in disparities[0].pixels().zip(disparities[1].pixels()) {
        assert!(a == b || (a - b).abs() < 1e-4, "{a} {b}");
    }
    assert_eq!(moved[1].as_ref().unwrap().kind.density, MapDensity::Sparse);
    // Without poses it stays where it was measured, which is reported.
    let none: fn(u64) -> Message =
        |stamp| transform("/other", stamp, ["a", "b"], [0.0; 3], [0.0; 4]);
    let fixed = messages(none).into_iter();
    let fixed = fixed.filter(|message| message.topic != "/other");
    let all: Vec<_> = fixed.chain([wall(12_000_000)]).collect();
    bag::write(&folder, &all);
    let ran = fixture.svl("record bag.mcap --truth /points -o x.mcap");
    let words = [
        "a measurement is 12.0 ms from its pair",
        "off by 1.2 cm",
        "by 1.1°",
    ];
    assert_says(&ran.stderr, &words);
    with(moving, wall(12_000_000));
    let ran = fixture.svl("record bag.mcap --truth /points -o x.mcap --force");
    assert!(!ran.stderr.contains("no pose"), "{}", ran.stderr);
    // The poses are kept, and the place of a checkpoint finds its frames.
    let (kept, _) = read(&fixture.path("x.mcap"));
    assert!(kept.iter().all(|frame| frame.pose.is_some()));
}

/// The second pair is 0.1 m ahead of the first: a checkpoint at its place is scored by it alone.
#[test]
fn a_checkpoint_by_place_is_scored_in_a_bag() {
    for pose in [moving, odometry] {
        let fixture = Fixture::new();
        bag::write(&fixture.path(""), &messages(pose));
        let at = x_at(START_NS + PERIOD_NS) + 0.1;
        let scenario = |heading: u32| {
            format!(
                "name = \"place\"\nalgorithms = [\"v3\"]\n[source]\nkind = \"recording\"\n\
                 files = [\"bag.mcap\"]\n[[checkpoint]]\nnumber = 1\nname = \"door\"\n\
                 at_m = [{at}, 1.0]\nradius_m = 0.05\nheading_deg = {heading}\n\
                 heading_tolerance_deg = 5\n[[checkpoint.cell]]\nat = [1, 1]\nfree = true\n"
            )
        };
        fixture.write("place.toml", scenario(0));
        fixture
            .svl(&["score", "place.toml", "-q", "-o", "r"])
            .done();
        let rows: Vec<CheckpointRow> = read_rows(&fixture.path("r/checkpoints.csv")).unwrap();
        let frames: Vec<_> = rows.iter().map(|row| row.frames).collect();
        assert_eq!(frames, [1]);
        // Seen in the other direction, no pair is there.
        fixture.write("place.toml", scenario(180));
        fixture
            .svl(&["score", "place.toml", "-q", "-o", "s"])
            .done();
        let rows: Vec<CheckpointRow> = read_rows(&fixture.path("s/checkpoints.csv")).unwrap();
        assert!(rows.iter().all(|row| row.frames == 0));
        // Poses of the robot without the transform to its camera: the reason is named.
        bag::write(&fixture.path(""), &messages(pose)[1..]);
        let info = fixture.svl("info bag.mcap").done();
        assert_says(&info, &["no transform"]);
        let ran = fixture.svl(&["score", "place.toml", "-q", "-o", "t"]);
        let words = ["at_m needs poses, and those of", "not usable (no transform"];
        ran.failed(1, &words);
    }
}

/// A head that moves on a robot says nothing of the robot's place.
#[test]
fn poses_in_a_robots_own_frame_are_none() {
    let mut all = messages(moving);
    all[0] = transform("/tf_static", 0, ["head", "cam"], [0.1, 0.0, 0.3], OPTICAL);
    for message in &mut all[1..9] {
        let stamp = message.log_time;
        let at = [x_at(stamp), 1.0, 0.0];
        *message = transform("/tf", stamp, ["base_link", "head"], at, FACING_AHEAD);
    }
    assert_eq!(places(&all), None);
    // With the odometry of the robot they are.
    let stamps = (0..8).map(|i| START_NS - 30_000_000 + 40_000_000 * i);
    let still = |stamp| transform("/tf", stamp, ["odom", "base_link"], [0.0; 3], FACING_AHEAD);
    all.extend(stamps.map(still));
    all.sort_by_key(|message| message.log_time);
    assert!(places(&all).is_some());
}

#[test]
fn all_places_are_in_the_frame_of_the_first() {
    let fixture = Fixture::new();
    let mut all = messages(moving);
    // A third pair 3 s later, and a map that places the odometry from 2 s on.
    let last_ns = START_NS + 3_000_000_000;
    all.extend((7..80).map(|i| moving(START_NS - 30_000_000 + 40_000_000 * i)));
    let map_poses = (50..80).map(|i| {
        let stamp = START_NS - 30_000_000 + 40_000_000 * i;
        transform(
            "/tf",
            stamp,
            ["map", "odom"],
            [100.0, 0.0, 0.0],
            FACING_AHEAD,
        )
    });
    all.extend(map_poses);
    for topic in ["/cam0/image_rect", "/cam1/image_rect"] {
        let pixels: Vec<u8> = image(SIZE, 9).pixels().collect();
        all.push(ros_image(topic, last_ns, SIZE, "mono8", &pixels));
    }
    all.sort_by_key(|message| message.log_time);
    let (frames, error) = read(&bag::write(&fixture.path(""), &all));
    assert!(error.is_none() && frames.len() == 3);
    for frame in &frames {
        let x = frame.pose.unwrap().translation.x;
        assert!((x - x_at(frame.stamp_ns) - 0.1).abs() < 1e-6, "{x}");
    }
    let ran = fixture.svl("record bag.mcap -o x.mcap");
    let words = "poses in 'map' begin after the first pairs, whose poses are in 'odom'";
    assert_eq!(ran.stderr.matches(words).count(), 1, "{}", ran.stderr);
}

/// A wall 2 m ahead, seen 12 ms after the second pair from nearer.
fn late_wall() -> Message {
    let late_ns = 12_000_000;
    let z = 2.0 - SPEED * late_ns as f64 / 1e9;
    let points = (0..60).map(|i| [f64::from(i % 10) * 0.006, f64::from(i / 10) * 0.006, z]);
    let points: Vec<_> = points.map(|point| point.map(|v| v as f32)).collect();
    cloud("cam", START_NS + PERIOD_NS + late_ns, &points)
}

/// True from the second pair on, in all poses of [`messages`] but those before it.
fn is_after_the_second(stamp: u64) -> bool {
    stamp > START_NS + PERIOD_NS
}

const FACING_AHEAD: [f64; 4] = [0.0, 0.0, 0.0, 1.0];

#[test]
fn a_map_that_is_corrected_moves_no_truth() {
    let folder = tempfile::tempdir().unwrap();
    let truth = |messages: Vec<Message>| {
        let path = bag::write(folder.path(), &messages);
        truths(&path)[1].clone().map(|truth| truth.disparity)
    };
    let by_odometry: Vec<_> = messages(moving).into_iter().chain([late_wall()]).collect();
    let expected = truth(by_odometry.clone()).unwrap();
    // The map is corrected by 3 m between the pair and its measurement, the robot's odometry is
    // not.
    let corrected = by_odometry.into_iter().flat_map(|message| {
        let x = if is_after_the_second(message.log_time) {
            3.0
        } else {
            0.0
        };
        let map = (message.topic == "/tf").then(|| {
            let frames = ["map", "odom"];
            transform("/tf", message.log_time, frames, [x, 0.0, 0.0], FACING_AHEAD)
        });
        std::iter::once(message).chain(map)
    });
    assert_eq!(truth(corrected.collect()), Some(expected));
}

/// A robot's poses in a frame, which jump by 3 m after the second pair.
fn jumping(stamp: u64, parent: &str) -> Message {
    let by = if is_after_the_second(stamp) { 3.0 } else { 0.0 };
    let at = [x_at(stamp) - by, 1.0, 0.0];
    transform("/tf", stamp, [parent, "base_link"], at, FACING_AHEAD)
}

#[test]
fn poses_that_jump_move_no_truth_and_are_reported() {
    let fixture = Fixture::new();
    let in_odom = |stamp| jumping(stamp, "odom");
    let in_map = |stamp| jumping(stamp, "map");
    let poses: [fn(u64) -> Message; 3] = [in_odom, in_map, moving];
    for (i, (pose, jumps)) in poses.into_iter().zip([true, true, false]).enumerate() {
        let report = format!("r{i}");
        let all: Vec<_> = messages(pose).into_iter().chain([late_wall()]).collect();
        let path = bag::write(&fixture.path(""), &all);
        assert_eq!(truths(&path)[1].is_none(), jumps);
        let ran = fixture.svl(&format!(
            "score bag.mcap --truth /points --algo v3 -o {report}"
        ));
        let words = [
            "--truth /points: the measurement of",
            "the poses jump by 2.94 m and 0.0° in 40 ms",
        ];
        let page = fixture.text(&format!("{report}/index.html"));
        let note = "1 pair whose truth is of another time, between which poses jump";
        assert_eq!(page.contains(note), jumps, "{i}");
        for words in words {
            assert_eq!(ran.stderr.contains(words), jumps, "{}", ran.stderr);
        }
        let summary = std::fs::read_to_string(fixture.path(&report).join("summary.json")).unwrap();
        let summary: serde_json::Value = serde_json::from_str(&summary).unwrap();
        let jumped = summary.pointer("/missing/jumped").and_then(|n| n.as_u64());
        assert_eq!(jumped, Some(u64::from(jumps)), "{summary:#}");
        let info = fixture.svl("info bag.mcap").done();
        let info = info.split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(!info.contains("jumps 0"), jumps, "{info}");
    }
}

#[test]
fn poses_of_a_map_alone_move_the_truth_with_a_warning() {
    let fixture = Fixture::new();
    let in_map: fn(u64) -> Message = |stamp| {
        let at = [x_at(stamp), 1.0, 0.0];
        transform("/tf", stamp, ["map", "base_link"], at, FACING_AHEAD)
    };
    for (pose, is_warned) in [(in_map, true), (moving, false)] {
        let all: Vec<_> = messages(pose).into_iter().chain([late_wall()]).collect();
        let path = bag::write(&fixture.path(""), &all);
        assert!(truths(&path)[1].is_some());
        let ran = fixture.svl("record bag.mcap --truth /points -o x.mcap --force");
        let words = "poses in 'map' move the truth, as there is none in an odometry frame";
        assert_eq!(ran.stderr.contains(words), is_warned, "{}", ran.stderr);
    }
}

#[test]
fn info_says_why_poses_are_not_usable() {
    let fixture = Fixture::new();
    let late: fn(u64) -> Message = |stamp| moving(stamp + 60_000_000_000);
    let without_camera = messages(moving).split_off(1);
    let unnormed: fn(u64) -> Message = |stamp| {
        let frames = ["odom", "base_link"];
        transform("/tf", stamp, frames, [0.0; 3], [0.0, 0.0, 0.0, 2.0])
    };
    bag::write(&fixture.path(""), &messages(unnormed));
    let info = fixture.svl("info bag.mcap").done();
    let info = info.split_whitespace().collect::<Vec<_>>().join(" ");
    assert_says(
        &info,
        &["faulty (/tf (8, its transform of 'base_link' in 'odom' has a quaternion whose norm"],
    );
    for (messages, reason) in [
        (messages(moving), "poses images 2, placed 2 "),
        (
            without_camera,
            "placed 0, unusable no transform leads from 'cam', the left camera, to a frame that \
             moves",
        ),
        (
            messages(late),
            "placed 0, unusable /tf: the poses of 'base_link' are from",
        ),
    ] {
        bag::write(&fixture.path(""), &messages);
        let info = fixture.svl("info bag.mcap").done();
        let info = info.split_whitespace().collect::<Vec<_>>().join(" ");
        let words = [
            "/tf, frame base_link, parent odom, ",
            "poses 8, rate 25.00 Hz",
            reason,
        ];
        assert_says(&info, &words);
    }
}
