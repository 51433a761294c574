//! Names of topics and frames: what they decide, and what a measurement says against them.

use super::bag::{Bag, STEREO, Stereo, camera_info, tf};
use super::frames::START_NS;
use super::says::Says;
use crate::cli::fixture::Fixture;

/// Adds three pairs of images, and writes the bag.
fn write(fixture: &Fixture, bag: Bag, stereo: Stereo<'_>) {
    bag.and((0..3).flat_map(|i| stereo.images(i)))
        .write(fixture);
}

/// The baseline by `svl info`, millimetres, and its warnings.
fn baseline(fixture: &Fixture, options: &str) -> (Option<i64>, String) {
    let ran = fixture.svl(&format!("info bag.mcap --json {options}"));
    let answer = ran.json();
    let metres = answer["first_pairs"]["rig"]["baseline_m"].as_f64();
    let millimetres = metres.map(|metres| (1e3 * metres).round() as i64);
    (millimetres, ran.stderr)
}

#[test]
fn calibrations_of_any_name_are_named() {
    let fixture = Fixture::new();
    let infos = [("/a/rear", 0.0), ("/b/front", -14.432), ("/c/top", -28.0)];
    let infos = infos.map(|(topic, tx)| camera_info(topic, START_NS, &[], tx));
    write(&fixture, Bag::new(infos), STEREO.in_frames(["p", "q"]));
    let unnamed = fixture.svl("info bag.mcap");
    unnamed.says("/a/rear, /b/front, /c/top | --left-info TOPIC");
    let options = "--left-info /a/rear --right-info /b/front";
    let (found, warnings) = baseline(&fixture, options);
    assert_eq!(found, Some(44));
    // The user's word is above the frames.
    warnings.lacks("frame");
    for door in ["record bag.mcap -o own.mcap", "replay bag.mcap --algo v3"] {
        let ran = fixture.svl(&format!("{door} {options}"));
        ran.exits(0).lacks("distances");
    }
    let no_topic = "no such topic of calibrations; it has /a/rear";
    for (wrong, why) in [
        ("bag.mcap --left-info /cam0/image_rect", no_topic),
        ("arena --left-info /a/rear", "--left-info is for"),
    ] {
        let ran = fixture
            .svl(&format!("record {wrong} -o never.mcap"))
            .says(why);
        assert_ne!(ran.code, Some(0), "{wrong}");
    }
}

#[test]
fn each_of_two_robots_has_the_transforms_of_its_namespace() {
    let fixture = Fixture::new();
    let one = Stereo {
        images: ["/one/cam0/image_rect", "/one/cam1/image_rect"],
        infos: ["/one/cam0/camera_info", "/one/cam1/camera_info"],
        ..STEREO
    };
    let one = one.offsets([0.0; 2]);
    let two = ("/two/tf_static", 0.2);
    let other = "/two/tf_static: not used | /one/cam0/image_rect";
    let unused = "/three/tf_static, /two/tf_static: not used";
    for (robots, expected, words) in [
        (&[two, ("/one/tf_static", 0.1)][..], Some(100), other),
        (&[two, ("/three/tf_static", 0.3)], None, unused),
        // The only one is that of the cameras' robot, whatever its namespace.
        (&[two], Some(200), ""),
    ] {
        let robot =
            |(topic, metres): &(&'static str, f64)| tf(topic, &[("l", "r", [*metres, 0.0, 0.0])]);
        let bag = Bag::new(robots.iter().map(robot)).and(one.infos(START_NS));
        write(&fixture, bag, one.in_frames(["l", "r"]));
        let (found, warnings) = baseline(&fixture, "");
        assert_eq!(found, expected, "{warnings}");
        warnings.says(words);
    }
}

#[test]
fn names_that_contradict_a_measurement_are_named_and_nothing_is_exchanged() {
    let fixture = Fixture::new();
    let stereo = STEREO.in_frames(["l", "r"]);
    // Names alone: P of the left topic is that of a right camera.
    let exchanged = STEREO.offsets([-14.432, 0.0]);
    write(&fixture, Bag::new(exchanged.infos(START_NS)), stereo);
    let words = "no calibration | 0.0440 m to the left | --left and --right";
    fixture.info("bag.mcap").says(words);
    // Frames alone.
    let bag = Bag::new(STEREO.infos(START_NS)).tf(&[("l", "r", [-0.044, 0.0, 0.0])]);
    write(&fixture, bag, stereo);
    assert_eq!(baseline(&fixture, "").0, Some(44));
    let words = "0.0440 m to the right | 0.0440 m to the left by /tf_static";
    fixture.info("bag.mcap").says(words);
}
