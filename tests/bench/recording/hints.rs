//! Hints of `svl score`: each appears for a recording made for it, and none for a sound one.

use super::bag::{Bag, STEREO, Stereo, cloud, tf};
use super::frames::{intact, record, stamp};
use super::says::Says;
use crate::cli::fixture::Fixture;
use svl::recording::ImageFormat;
use svl::stereo::{Frame, StereoPair};

/// Words that identify the hints: swapped images, scale, calibration, transform.
const HINTS: [&str; 7] = [
    "look exchanged",
    "the truth is doubtful",
    "the calibration changes",
    "is used for /points",
    "images without a stamp",
    "images share a stamp",
    "not in 'lidar'",
];

/// The warnings of a score that are hints, as indices of [`HINTS`] with their lines.
#[track_caller]
fn hints(fixture: &Fixture, what: &str) -> Vec<(usize, String)> {
    let ran = fixture.svl(&format!("score {what} --rerun none -o report"));
    // A truth may have no cell.
    assert!(matches!(ran.code, Some(0 | 4)), "{}", ran.stderr);
    let hint = |line: &str| {
        let place = HINTS.iter().position(|words| line.contains(words))?;
        Some((place, line.to_owned()))
    };
    let lines = ran.stderr.lines().chain(ran.stdout.lines());
    lines.filter_map(hint).collect()
}

/// The only hint.
#[track_caller]
fn only(fixture: &Fixture, what: &str, place: usize) -> String {
    match &hints(fixture, what)[..] {
        [(found, line)] if *found == place => line.clone(),
        other => panic!("{what}: {other:?}"),
    }
}

fn arena(fixture: &Fixture) -> Vec<Frame> {
    fixture.write_short_arena("arena.toml", 8);
    fixture.run("record arena.toml -o arena.mcap");
    intact(&fixture.path("arena.mcap"))
}

/// Writes the frames, each changed, as `changed.mcap`.
fn write(fixture: &Fixture, frames: &[Frame], change: impl Fn(&mut Frame)) {
    let mut frames = frames.to_vec();
    frames.iter_mut().for_each(change);
    let path = record(&fixture.path(""), &frames, ImageFormat::Raw);
    std::fs::rename(path, fixture.path("changed.mcap")).unwrap();
}

#[test]
fn sound_recordings_have_no_hints() {
    let fixture = Fixture::new();
    arena(&fixture);
    fixture.run("record arena.mcap --ros2 -o ros.mcap");
    assert_eq!(hints(&fixture, "arena.mcap --algo bm --algo v1"), []);
    let ros = "ros.mcap --truth /truth/depth --algo bm --algo v5";
    assert_eq!(hints(&fixture, ros), []);
}

#[test]
fn distances_of_another_scale_than_the_truth_are_noticed() {
    let fixture = Fixture::new();
    let frames = arena(&fixture);
    for (factor, cause) in [
        (2.0, "twice the size"),
        (0.5, "half the size"),
        (1000.0, "the baseline is in millimetres"),
        (0.001, "the truth is in millimetres"),
    ] {
        // The recording contains depths, which are nearer by that factor.
        write(&fixture, &frames, |frame| {
            let truth = frame.truth.as_mut().unwrap();
            truth.disparity = truth.disparity.map(|d| d * factor);
        });
        // Nearer than a millimetre.
        let code = if factor == 1000.0 { 1 } else { 0 };
        let line = "score changed.mcap --algo v3 --algo bm --rerun none -o report";
        let said = fixture.svl(line).exits(code).line().counts(1, cause);
        said.says("the truth | likely its disparities divided by | --calib FILE");
    }
}

#[test]
fn exchanged_images_are_noticed() {
    let fixture = Fixture::new();
    write(&fixture, &arena(&fixture), |frame| {
        let [left, right] = frame.pair.clone().into_images();
        frame.pair = StereoPair::new(right, left).unwrap();
        frame.truth = None;
    });
    let line = only(&fixture, "changed.mcap --algo bm", 0);
    line.says("changed.mcap | --left and --right");
    let cured = "changed.mcap --left /stereo/right/image --right /stereo/left/image --algo bm";
    assert_eq!(hints(&fixture, cured), []);
}

/// Rectified pairs with a rig, whose right camera has these fourth columns of P, one after the
/// other.
fn pairs(offsets: &[f64]) -> Bag {
    let size = (64, 48);
    let stereo = Stereo { size, ..STEREO };
    let stereo = stereo.with(|camera| camera.size = (64, 48));
    let pair = |(i, tx): (u64, &f64)| stereo.offsets([0.0, *tx]).pair(i);
    Bag::new((0..).zip(offsets).flat_map(pair))
}

#[test]
fn a_calibration_that_changes_is_noticed() {
    let fixture = Fixture::new();
    pairs(&[-14.0; 4]).write(&fixture);
    assert_eq!(hints(&fixture, "bag.mcap --algo v3"), []);
    pairs(&[-14.0, -14.0, -28.0, -14.0]).write(&fixture);
    only(&fixture, "bag.mcap --algo v3", 2)
        .says("/cam1/camera_info | -14.000, then -28.000 | each pair uses that of its stamp");
}

#[test]
fn transforms_that_differ_are_noticed() {
    let fixture = Fixture::new();
    let points = |i| cloud("lidar", stamp(i), &[[0.0, 0.0, 1.0]]);
    let static_tf = |x: f64| tf("/tf_static", &[("cam", "lidar", [x, 0.0, 0.0])]);
    let inverse = |x: f64| tf("/tf_static", &[("lidar", "cam", [-x, 0.0, 0.0])]);
    let bag = |second| {
        let bag = Bag::new([static_tf(0.1)]).and(pairs(&[-14.0; 3]));
        let bag = bag.and([points(0), points(1), second, points(2)]);
        bag.write(&fixture);
        hints(&fixture, "bag.mcap --truth /points --algo v3")
    };
    assert_eq!([bag(static_tf(0.1)), bag(inverse(0.1))], [[], []]);
    for (second, frames) in [
        (static_tf(0.3), "'lidar' in 'cam'"),
        // They form a cycle.
        (inverse(0.3), "'cam' in 'lidar'"),
    ] {
        let found = bag(second);
        assert_eq!(found.len(), 1, "{found:?}");
        let differ = format!("/tf_static | {frames} differ by 0.2000 m");
        found[0].1.as_str().says(&differ);
    }
}

#[test]
fn stamps_that_say_little_are_noticed() {
    let fixture = Fixture::new();
    let messages = |stamp_of: &dyn Fn(u64) -> u64| {
        let stamped = pairs(&[-14.0; 4]).each(|message| {
            let own = message.stamp();
            [message.at(stamp_of(own), own)]
        });
        stamped.write(&fixture);
    };
    messages(&|own| own);
    assert_eq!(hints(&fixture, "bag.mcap --algo v3"), []);
    messages(&|_| 0);
    let line = only(&fixture, "bag.mcap --algo v3", 4);
    line.says("/cam0/image_rect | the log time");
    messages(&|_| stamp(0));
    let line = only(&fixture, "bag.mcap --algo v3", 5);
    line.says("in the order of the file");
}

#[test]
fn measurements_in_another_frame_than_the_first_are_left_out() {
    let fixture = Fixture::new();
    let bag = Bag::default().tf(&[("cam", "lidar", [0.1, 0.0, 0.0])]);
    let clouds = ["lidar", "other", "/lidar"].into_iter().zip(0..);
    let clouds = clouds.map(|(frame, i)| cloud(frame, stamp(i), &[[0.0, 0.0, 1.0]]));
    bag.and(pairs(&[-14.0; 3])).and(clouds).write(&fixture);
    let line = only(&fixture, "bag.mcap --truth /points --algo v3", 6);
    line.says("/points | it is in 'other' | left out");
}
