//! `svl record` from everything but cameras.

use super::fixture::{Fixture, pgm};
use svl::source::{RecordingSource, Source};
use svl::stereo::{Geometry, StereoPair};

#[test]
fn records_the_arena_and_says_how_much() {
    let fixture = Fixture::new();
    let text = fixture
        .svl(&["record", "--frames", "5", "-o", "a.mcap"])
        .done();
    assert!(text.starts_with("a.mcap: 5 pairs in "), "{text}");
    let mut source = RecordingSource::open(fixture.path("a.mcap")).unwrap();
    assert_eq!(source.pairs(), Some(5));
    let frame = source.next().unwrap().unwrap();
    assert_eq!(frame.pair.size(), (320, 240));
    assert!(frame.truth.is_some() && frame.rig().is_some() && frame.pose.is_some());
}

#[test]
fn unnamed_recordings_never_collide() {
    let fixture = Fixture::new();
    fixture.svl(&["record", "--frames", "1"]).done();
    fixture.svl(&["record", "--frames", "1"]).done();
    assert!(fixture.path("recordings/arena-seed1-1.mcap").is_file());
    assert!(fixture.path("recordings/arena-seed1-2.mcap").is_file());
}

#[test]
fn same_seed_same_pixels() {
    let fixture = Fixture::new();
    let pixels = |name: &str, args: &[&str]| {
        fixture
            .svl(&[&["record", "--frames", "2", "-o", name], args].concat())
            .done();
        RecordingSource::open(fixture.path(name))
            .unwrap()
            .next()
            .unwrap()
            .unwrap()
            .pair
    };
    let one = pixels("one.mcap", &["--threads", "1"]);
    assert_eq!(one, pixels("again.mcap", &["--threads", "2", "--compress"]));
    assert_ne!(one, pixels("other.mcap", &["--seed", "2"]));
}

#[test]
fn a_scene_and_a_folder_of_pairs() {
    let fixture = Fixture::new();
    fixture.write_pair("scene/im0.pgm", "scene/im1.pgm", (40, 20), 3);
    fixture.svl(&["record", "scene", "-o", "scene.mcap"]).done();
    for i in 0..3 {
        fixture.write_pair(
            &format!("many/left/{i}.pgm"),
            &format!("many/right/{i}.pgm"),
            (40, 20),
            i,
        );
    }
    fixture.write("many/left/alone.pgm", pgm(40, 20, &[0; 800]));
    let ran = fixture.svl(&["record", "many", "-o", "many.mcap"]);
    assert!(
        ran.stderr.contains("1 image dropped: without a partner"),
        "{}",
        ran.stderr
    );
    assert_eq!(
        RecordingSource::open(fixture.path("many.mcap"))
            .unwrap()
            .pairs(),
        Some(3)
    );
}

#[test]
fn bad_input_is_one_line_that_names_it() {
    let fixture = Fixture::new();
    fixture.write("there.mcap", "precious");
    fixture.write("empty/readme.txt", "");
    fixture.write("bad.toml", "name = 3");
    fixture.write_pair("odd/im0.pgm", "odd/im1.pgm", (40, 20), 3);
    fixture.write("odd/im1.pgm", pgm(4, 2, &[0; 8]));
    fixture
        .svl(&["record", "-o", "there.mcap"])
        .failed(1, &["there.mcap: exists already", "--force"]);
    assert_eq!(
        std::fs::read(fixture.path("there.mcap")).unwrap(),
        b"precious"
    );
    fixture
        .svl(&["record", "nowhere", "-o", "a.mcap"])
        .failed(1, &["nowhere: no such source"]);
    fixture
        .svl(&["record", "empty", "-o", "a.mcap"])
        .failed(1, &["empty", "holds no stereo pair"]);
    fixture
        .svl(&["record", "odd", "-o", "b.mcap"])
        .failed(1, &["odd", "40x20", "4x2"]);
    assert!(
        !fixture.path("b.mcap").exists(),
        "a file without a pair stands in the way"
    );
    fixture
        .svl(&["record", "odd", "-o", "there.mcap", "--force"])
        .failed(1, &["odd"]);
    assert_eq!(
        std::fs::read(fixture.path("there.mcap")).unwrap(),
        b"precious"
    );
    fixture
        .svl(&["record", "odd", "--seed", "3", "-o", "a.mcap"])
        .failed(2, &["--seed is for the arena"]);
    fixture
        .svl(&["record", "-o", "a.txt"])
        .failed(2, &["a.txt: must end in .mcap"]);
    fixture
        .svl(&["record", "bad.toml", "-o", "a.mcap"])
        .failed(1, &["bad.toml: line 1, column 8"]);
    fixture
        .svl(&["record", "there.mcap", "-o", "a.mcap"])
        .failed(1, &["there.mcap"]);
    fixture
        .svl(&["record", "-o", "no/where.mcap"])
        .failed(1, &["no: no such folder"]);
    fixture
        .svl(&["record", "--frames", "0"])
        .failed(2, &["--frames"]);
    fixture
        .svl(&["record", "--duration", "-1"])
        .failed(2, &["--duration"]);
}

/// Stamps, pairs and rigs of a recording.
fn pairs(fixture: &Fixture, name: &str) -> Vec<(u64, StereoPair, Geometry)> {
    let mut source = RecordingSource::open(fixture.path(name)).unwrap();
    let frames = std::iter::from_fn(|| source.next().unwrap());
    frames
        .map(|frame| (frame.stamp_ns, frame.pair, frame.geometry))
        .collect()
}

#[test]
fn a_ros_2_bag_has_the_pairs_of_the_recording() {
    let fixture = Fixture::new();
    fixture
        .svl(&["record", "--frames", "2", "-o", "a.mcap"])
        .done();
    for (bag, more) in [("raw.mcap", &[][..]), ("png.mcap", &["--compress"])] {
        fixture
            .svl(&[&["record", "a.mcap", "--ros2", "-o", bag], more].concat())
            .done();
        let info = fixture.svl(&["info", bag]).done();
        for word in [
            "/stereo/left/image_rect",
            "sensor_msgs/msg/CameraInfo",
            "tf2_msgs/msg/TFMessage",
            "seed 1",
        ] {
            assert!(info.contains(word), "{word} is not in: {info}");
        }
        assert!(
            !info.contains("foxglove") && pairs(&fixture, bag) == pairs(&fixture, "a.mcap"),
            "{bag}"
        );
    }
}

#[test]
fn topics_of_another_programs_recording_are_named() {
    let fixture = Fixture::new();
    fixture
        .svl(&["record", "--frames", "3", "-o", "a.mcap"])
        .done();
    let named = [
        "--left",
        "/stereo/left/image",
        "--right",
        "/stereo/right/image",
    ];
    let ran = fixture.svl(
        &[
            &["record", "a.mcap", "-o", "b.mcap", "--max-skew-ms", "1"],
            &named[..],
        ]
        .concat(),
    );
    assert!(
        ran.code == Some(0) && ran.stderr.is_empty(),
        "{}",
        ran.stderr
    );
    assert!(pairs(&fixture, "a.mcap") == pairs(&fixture, "b.mcap"));
    let wrong = [
        "replay",
        "a.mcap",
        "--left",
        "/stereo/sync",
        "--right",
        "/stereo/right/image",
    ];
    fixture.svl(&wrong).failed(
        1,
        &[
            "a.mcap",
            "--left /stereo/sync has messages of svl.StereoSync",
        ],
    );
    fixture
        .svl(&["record", "--left", "/x", "-o", "c.mcap"])
        .failed(2, &["--left is for a recording, and 'arena' is the arena"]);
    fixture
        .svl(&["replay", "a.mcap", "--max-skew-ms", "-1"])
        .failed(2, &["--max-skew-ms"]);
}
