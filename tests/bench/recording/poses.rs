//! Poses in other programs' recordings, and truths that are moved by them.

use super::bag::{
    Bag, Message, OPTICAL, PARALLEL, STEREO, cdr_in, cloud, transforms, truths_in, write_f64s,
};
use super::frames::{PERIOD_NS, START_NS, intact, read};
use super::says::Says;
use crate::cli::fixture::Fixture;
use crate::cli::way::{counts, write_near};
use svl::report::{CheckpointRow, read_rows};
use svl::stereo::{Frame, MapDensity};

/// Speed along the optical axis, m/s, of a robot that starts at x = 3 m.
const SPEED: f64 = 1.5;
const RECORD: &str = "record bag.mcap --truth /points -o x.mcap --force";

fn x_at(stamp: u64) -> f64 {
    3.0 + SPEED * (stamp as f64 - START_NS as f64) / 1e9
}

/// Parent and child, and the place of the child, whose axes are parallel.
fn moved(stamp: u64, [parent, child]: [&str; 2], at: [f64; 3]) -> Message {
    transforms("/tf", stamp, &[(parent, child, at, PARALLEL)])
}

/// A transform from the robot to the camera.
fn fixed(parent: &str, child: &str, at: [f64; 3], turn: [f64; 4]) -> Message {
    transforms("/tf_static", 0, &[(parent, child, at, turn)])
}

fn odometry(stamp: u64) -> Message {
    odometry_of("/odom", "base_link", stamp, [x_at(stamp), 1.0, 0.0])
}

fn odometry_of(topic: &'static str, child: &str, stamp: u64, at: [f64; 3]) -> Message {
    let data = cdr_in("odom", stamp, |cdr| {
        cdr.write_string(child);
        write_f64s(cdr, at.iter().chain(&PARALLEL).chain(&[0.0; 36 + 6 + 36]));
    });
    Message::cdr(topic, "nav_msgs/msg/Odometry", stamp, data)
}

/// The robot's pose in a frame.
fn robot_in(parent: &str, stamp: u64) -> Message {
    moved(stamp, [parent, "base_link"], [x_at(stamp), 1.0, 0.0])
}

fn moving(stamp: u64) -> Message {
    robot_in("odom", stamp)
}

/// Stamps of a robot's poses, every 40 ms, which are not the pairs' times.
fn stamps(numbers: std::ops::Range<u64>) -> impl Iterator<Item = u64> {
    numbers.map(|i| START_NS - 30_000_000 + 40_000_000 * i)
}

/// Two pairs of a camera 0.1 m ahead of the robot's middle and 0.3 m above it, and its poses.
fn messages(pose: impl Fn(u64) -> Message) -> Bag {
    let camera = fixed("base_link", "cam", [0.1, 0.0, 0.3], OPTICAL);
    let poses = Bag(vec![camera]).and(stamps(0..8).map(pose));
    poses.and(Bag::pairs(2))
}

/// The bag with a message of the same time after each of a topic.
fn beside(bag: Bag, topic: &str, second: impl Fn(u64) -> Message) -> Bag {
    bag.each(|message| {
        let second = (message.topic == topic).then(|| second(message.log_time));
        std::iter::once(message).chain(second)
    })
}

/// Place of the camera in each pair of these messages; `None` if a pair has no pose.
fn places(bag: &Bag) -> Option<Vec<[f64; 3]>> {
    let frames = intact(&bag.saved());
    assert_eq!(frames.len(), 2);
    let place = |frame: &Frame| Some(frame.pose?.translation.vector.into());
    frames.iter().map(place).collect()
}

#[test]
fn transforms_and_odometry_are_poses() {
    for pose in [moving, odometry] {
        let frames = intact(&messages(pose).saved());
        assert_eq!(frames.len(), 2);
        for frame in &frames {
            let pose = frame.pose.unwrap();
            let expected = nalgebra::Vector3::new(x_at(frame.stamp_ns) + 0.1, 1.0, 0.3);
            assert!((pose.translation.vector - expected).norm() < 1e-6, "{pose}");
            let view = pose.rotation * nalgebra::Vector3::z() - nalgebra::Vector3::x();
            assert!(view.norm() < 1e-9, "{pose}");
        }
    }
    // Without the transform to the camera, or with poses of another time, there is none.
    let late = messages(|stamp| moving(stamp + 60_000_000_000));
    for bag in [messages(moving).without("/tf_static"), late] {
        assert!(read(&bag.saved()).0[0].pose.is_none());
    }
}

#[test]
fn an_invalid_transform_costs_no_other() {
    let fixture = Fixture::new();
    let mut bag = messages(moving);
    let expected = places(&bag).unwrap();
    // The first of two is that of a gripper, with a quaternion of zeros.
    let gripper = ("base_link", "gripper", [0.0; 3], [0.0; 4]);
    let camera = ("base_link", "cam", [0.1, 0.0, 0.3], OPTICAL);
    bag.0[0] = transforms("/tf_static", 0, &[gripper, camera]);
    assert_eq!(places(&bag).unwrap(), expected);
    bag.write(&fixture);
    let ran = fixture.svl("record bag.mcap -q --calib none -o x.mcap");
    assert!(ran.stderr.is_empty(), "{}", ran.stderr);
    let words = "/tf_static: its transform of 'gripper' in 'base_link' has a quaternion whose norm";
    fixture
        .svl("record bag.mcap --calib none -o y.mcap")
        .counts(1, words);
}

#[test]
fn poses_of_other_frames_and_topics_change_none() {
    let expected = places(&messages(moving)).unwrap();
    let still = |frames, stamp| moved(stamp, frames, [0.0; 3]);
    let ahead = START_NS + 10_000_000_000;
    let mut bag = messages(moving);
    bag.0.insert(1, still(["arm", "hand"], ahead));
    assert_eq!(places(&bag).unwrap(), expected);
    // A moving frame above the camera's has no pose at the pairs' time, nor between two 11 s apart.
    for stamp in [ahead, START_NS - 1_000_000_000] {
        bag.0.insert(1, still(["map", "odom"], stamp));
        assert_eq!(places(&bag), None);
    }
    // A second odometry of one frame is another estimate: it is not mixed with the first.
    let bag = beside(messages(odometry), "/odom", |stamp| {
        odometry_of("/wheels", "base_link", stamp, [x_at(stamp) + 7.0, 0.0, 0.0])
    });
    assert_eq!(places(&bag).unwrap(), expected);
}

#[test]
fn odometry_that_contradicts_tf_is_told() {
    let fixture = Fixture::new();
    let other = |stamp| odometry_of("/wheels", "base_link", stamp, [-x_at(stamp), 1.0, 0.0]);
    for (second, is_told) in [(odometry as fn(u64) -> Message, false), (other, true)] {
        beside(messages(moving), "/tf", second).write(&fixture);
        let words = "/wheels: poses of 'base_link' differ from those of /tf, which are used";
        fixture
            .svl("record bag.mcap -o x.mcap --force")
            .says_if(is_told, words);
    }
}

#[test]
fn odometry_of_a_frame_with_a_static_parent_is_used() {
    // The odometry of an inertial sensor, a child of the robot, in which the camera is.
    let sensor_pose = |stamp: u64| odometry_of("/vio", "imu", stamp, [x_at(stamp), 1.0, 0.0]);
    let links = [
        fixed("base_link", "imu", [0.0, 0.0, 0.5], PARALLEL),
        fixed("imu", "cam", [0.1, 0.0, 0.3], OPTICAL),
    ];
    let bag = Bag::new(links).and(messages(sensor_pose).without("/tf_static"));
    let expected = places(&messages(moving)).unwrap();
    let found = places(&bag).unwrap();
    for (a, b) in expected.iter().flatten().zip(found.iter().flatten()) {
        assert!((a - b).abs() < 1e-9, "{expected:?} {found:?}");
    }
}

/// A wall 2 m ahead, seen that long after the second pair, from nearer.
fn wall(late_ns: u64) -> Message {
    let z = 2.0 - SPEED * late_ns as f64 / 1e9;
    let points = (0..60).map(|i| [f64::from(i % 10) * 0.006, f64::from(i / 10) * 0.006, z]);
    let points: Vec<_> = points.map(|point| point.map(|v| v as f32)).collect();
    cloud("cam", START_NS + PERIOD_NS + late_ns, &points)
}

fn late_wall() -> Message {
    wall(12_000_000)
}

#[test]
fn a_truth_of_another_time_is_moved_to_the_pair_s() {
    let fixture = Fixture::new();
    let truths = |wall| truths_in(&messages(moving).and([wall]).saved(), "/points");
    let [still, moved] = [wall(0), late_wall()].map(truths);
    let disparities = [&still, &moved].map(|truths| truths[1].as_ref().unwrap().disparity.clone());
    let known = disparities[0].pixels().filter(|d| d.is_finite()).count();
    assert!(known > 40 && still[0].is_none(), "{known}");
    for (a, b) in disparities[0].pixels().zip(disparities[1].pixels()) {
        assert!(a == b || (a - b).abs() < 1e-4, "{a} {b}");
    }
    assert_eq!(moved[1].as_ref().unwrap().kind.density, MapDensity::Sparse);
    // Without poses it stays where it was measured, which is reported.
    messages(moving)
        .without("/tf")
        .and([late_wall()])
        .write(&fixture);
    let words = "a measurement is 12.0 ms from its pair | off by 1.2 cm | by 1.1°";
    fixture.svl(RECORD).says(words);
    messages(moving).and([late_wall()]).write(&fixture);
    fixture.svl(RECORD).lacks("no pose");
    // The poses are kept, and the place of a checkpoint finds its frames.
    let (kept, _) = read(&fixture.path("x.mcap"));
    assert!(kept.iter().all(|frame| frame.pose.is_some()));
}

/// The second pair is 0.1 m ahead of the first: a checkpoint at its place is scored by it alone.
#[test]
fn a_checkpoint_by_place_is_scored_in_a_bag() {
    for pose in [moving, odometry] {
        let fixture = Fixture::new();
        messages(pose).write(&fixture);
        let at = x_at(START_NS + PERIOD_NS) + 0.1;
        let scenario = |heading: u32| {
            let text = format!(
                "name = \"place\"\nalgorithms = [\"v3\"]\n[source]\nkind = \"recording\"\n\
                 files = [\"bag.mcap\"]\n[[checkpoint]]\nnumber = 1\nname = \"door\"\n\
                 at_m = [{at}, 1.0]\nradius_m = 0.05\nheading_deg = {heading}\n\
                 heading_tolerance_deg = 5\n[[checkpoint.cell]]\nat = [1, 1]\nfree = true\n"
            );
            fixture.write("place.toml", text);
        };
        let frames = |report: &str| {
            fixture.run(&format!("score place.toml -q -o {report}"));
            let table = fixture.path(&format!("{report}/checkpoints.csv"));
            let rows: Vec<CheckpointRow> = read_rows(&table).unwrap();
            rows.iter().map(|row| row.frames).collect::<Vec<_>>()
        };
        scenario(0);
        assert_eq!(frames("r"), [1]);
        // Seen in the other direction, no pair is there.
        scenario(180);
        assert!(frames("s").iter().all(|frames| *frames == 0));
        // Poses of the robot without the transform to its camera: the reason is named.
        messages(pose).without("/tf_static").write(&fixture);
        fixture.run("info bag.mcap").says("no transform");
        let words = ["at_m needs poses, and those of", "not usable (no transform"];
        fixture.svl("score place.toml -q -o t").failed(1, &words);
    }
}

/// A head that moves on a robot says nothing of the robot's place.
#[test]
fn poses_in_a_robots_own_frame_are_none() {
    let mut bag = messages(|stamp| moved(stamp, ["base_link", "head"], [x_at(stamp), 1.0, 0.0]));
    bag.0[0] = fixed("head", "cam", [0.1, 0.0, 0.3], OPTICAL);
    assert_eq!(places(&bag), None);
    // With the odometry of the robot they are.
    let still = |stamp| moved(stamp, ["odom", "base_link"], [0.0; 3]);
    let bag = bag.and(stamps(0..8).map(still)).by_log_time();
    assert!(places(&bag).is_some());
}

#[test]
fn all_places_are_in_the_frame_of_the_first() {
    let fixture = Fixture::new();
    // A third pair 3 s later, and a map that places the odometry from 2 s on.
    let in_map = |stamp| moved(stamp, ["map", "odom"], [100.0, 0.0, 0.0]);
    let bag = messages(moving)
        .and(stamps(7..80).map(moving))
        .and(stamps(50..80).map(in_map))
        .and(STEREO.images_at(4, START_NS + 3_000_000_000))
        .by_log_time();
    let frames = intact(&bag.write(&fixture));
    assert_eq!(frames.len(), 3);
    for frame in &frames {
        let x = frame.pose.unwrap().translation.x;
        assert!((x - x_at(frame.stamp_ns) - 0.1).abs() < 1e-6, "{x}");
    }
    let words = "poses in 'map' begin after the first pairs, whose poses are in 'odom'";
    fixture.svl("record bag.mcap -o x.mcap").counts(1, words);
}

/// 3 m from the second pair on, in all poses of [`messages`] but those before it.
fn jump(stamp: u64) -> f64 {
    if stamp > START_NS + PERIOD_NS {
        3.0
    } else {
        0.0
    }
}

#[test]
fn a_map_that_is_corrected_moves_no_truth() {
    let truth = |bag: &Bag| {
        let truth = truths_in(&bag.saved(), "/points").swap_remove(1);
        truth.map(|truth| truth.disparity)
    };
    let by_odometry = messages(moving).and([late_wall()]);
    let expected = truth(&by_odometry).unwrap();
    // The map is corrected by 3 m between the pair and its measurement, the robot's odometry is
    // not.
    let corrected = beside(by_odometry, "/tf", |stamp| {
        moved(stamp, ["map", "odom"], [jump(stamp), 0.0, 0.0])
    });
    assert_eq!(truth(&corrected), Some(expected));
}

/// A robot's poses in a frame, which jump by 3 m after the second pair.
fn jumping(stamp: u64, parent: &str) -> Message {
    let at = [x_at(stamp) - jump(stamp), 1.0, 0.0];
    moved(stamp, [parent, "base_link"], at)
}

#[test]
fn poses_that_jump_move_no_truth_and_are_reported() {
    let fixture = Fixture::new();
    let in_odom = |stamp| jumping(stamp, "odom");
    let in_map = |stamp| jumping(stamp, "map");
    let poses: [fn(u64) -> Message; 3] = [in_odom, in_map, moving];
    for (i, (pose, jumps)) in poses.into_iter().zip([true, true, false]).enumerate() {
        let path = messages(pose).and([late_wall()]).write(&fixture);
        assert_eq!(truths_in(&path, "/points")[1].is_none(), jumps);
        fixture
            .svl(&format!("score bag.mcap --truth /points --algo v3 -o r{i}"))
            .says_if(jumps, "--truth /points: the measurement of")
            .says_if(jumps, "the poses jump by 2.94 m and 0.0° in 40 ms");
        let note = "1 pair whose truth is of another time, between which poses jump";
        fixture
            .text(&format!("r{i}/index.html"))
            .says_if(jumps, note);
        let summary = fixture.json_file(&format!("r{i}/summary.json"));
        let jumped = summary.pointer("/missing/jumped").and_then(|n| n.as_u64());
        assert_eq!(jumped, Some(u64::from(jumps)), "{summary:#}");
        fixture.info("bag.mcap").says_if(!jumps, "jumps 0");
    }
}

#[test]
fn poses_of_a_map_alone_move_the_truth_with_a_warning() {
    let fixture = Fixture::new();
    let in_map: fn(u64) -> Message = |stamp| robot_in("map", stamp);
    for (pose, is_warned) in [(in_map, true), (moving, false)] {
        let path = messages(pose).and([late_wall()]).write(&fixture);
        assert!(truths_in(&path, "/points")[1].is_some());
        let words = "poses in 'map' move the truth, as there is none in an odometry frame";
        fixture.svl(RECORD).says_if(is_warned, words);
    }
}

#[test]
fn info_says_why_poses_are_not_usable() {
    let fixture = Fixture::new();
    let late = messages(|stamp| moving(stamp + 60_000_000_000));
    let turn = [0.0, 0.0, 0.0, 2.0];
    let unnormed =
        messages(|stamp| transforms("/tf", stamp, &[("odom", "base_link", [0.0; 3], turn)]));
    let is_faulty =
        "faulty (/tf (8, its transform of 'base_link' in 'odom' has a quaternion whose norm";
    let usual = "/tf, frame base_link, parent odom,  | poses 8, rate 25.00 Hz";
    let too_late = "placed 0, unusable /tf: the poses of 'base_link' are from";
    let no_camera = "placed 0, unusable no transform leads from 'cam', the left camera, to a \
                     frame that moves";
    for (bag, words, reason) in [
        (unnormed, is_faulty, ""),
        (messages(moving), usual, "poses images 2, placed 2 "),
        (messages(moving).without("/tf_static"), usual, no_camera),
        (late, usual, too_late),
    ] {
        bag.write(&fixture);
        fixture.info("bag.mcap").says(words).says(reason);
    }
}

/// A way that ends, jumps or stands frees less or nothing, with the reason.
#[test]
fn a_way_is_what_sound_poses_tell() {
    let fixture = Fixture::new();
    // 0.24 and 0.18 m.
    write_near(&fixture, super::bag::SIZE, [60.0, 80.0]);
    let told = |pose: &dyn Fn(u64, f64) -> Message, robot: &str, why: &str| {
        let camera = fixed("base_link", "cam", [0.1, 0.0, 0.3], OPTICAL);
        let poses = stamps(0..48)
            .zip(0..)
            .map(|(stamp, i)| pose(stamp, f64::from(i)));
        Bag(vec![camera])
            .and(poses)
            .and(Bag::pairs(24))
            .write(&fixture);
        let score = "score bag.mcap --algo near=files:out/*.pfm --rerun none --force -o r";
        fixture.transcript(&format!("{score} --robot {robot} => 0~ {why}"));
        counts(&fixture, "r", "near")
    };
    let at = |stamp, x: f64| moved(stamp, ["odom", "base_link"], [x, 1.0, 0.0]);
    let [whole, _, reports] = told(&|stamp, i| at(stamp, 0.06 * i), "0.5x0.6", "!no phantoms");
    assert!(
        whole > 0.8 * reports && whole > 100.0,
        "{whole} of {reports}"
    );
    let jump = |stamp, i: f64| at(stamp, 0.06 * i + if i < 24.0 { 0.0 } else { 5.0 });
    let until = |stamp: u64, i: f64| at(stamp + if i < 24.0 { 0 } else { 1 << 40 }, 0.06 * i);
    for pose in [&jump as &dyn Fn(u64, f64) -> Message, &until] {
        let [phantoms, ..] = told(pose, "0.5x0.6", "!no phantoms");
        assert!(0.0 < phantoms && phantoms < whole, "{phantoms} of {whole}");
    }
    let turning = |stamp, i: f64| {
        let (sin, cos) = (0.05 * i).sin_cos();
        let link = ("odom", "base_link", [3.0, 1.0, 0.0], [0.0, 0.0, sin, cos]);
        transforms("/tf", stamp, &[link])
    };
    let other = |stamp, i: f64| moved(stamp, ["odom", "other/base_link"], [0.06 * i, 1.0, 0.0]);
    let still = "no phantoms are told: its poses go nowhere";
    let none = "no phantoms are told: no pair has a pose with a calibration and a base";
    let outside = "the camera is 0.30 m above the base | outside a body of 0.5x0.2 m";
    for (pose, robot, why) in [
        (&turning as &dyn Fn(u64, f64) -> Message, "0.5x0.6", still),
        (&|stamp, _| at(stamp, 3.0), "0.5x0.6", still),
        (&other, "0.5x0.6", none),
        (&|stamp, i| at(stamp, 0.06 * i), "0.5x0.2", outside),
    ] {
        assert_eq!(told(pose, robot, why), [-1.0; 3]);
    }
}
