//! Calibrations that contradict themselves, the pairs or the transforms: the same answer at every
//! door.

use super::bag::{self, CAMERA, Camera, Message, camera_info_of, ros_image_in};
use super::bag_folders::describe;
use super::frames::read;
use super::sensor::tf;
use crate::cli::fixture::{Fixture, Ran, assert_says};
use serde_json::Value;
use svl::stereo::{Frame, Rig};

const SIZE: (usize, usize) = (320, 240);
const F: f64 = 328.0;
const BASELINE_M: f64 = 0.044;

/// The arena's cameras, which are rectified.
pub(super) fn infos() -> [Camera<'static>; 2] {
    [0.0, -F * BASELINE_M].map(|tx| Camera {
        frame: "cam0",
        size: (320, 240),
        k: [F, 159.5, 119.5],
        d: &[0.0; 5],
        p: [F, 159.5, 119.5],
        tx,
        ..CAMERA
    })
}

/// The cameras of the arena's pixels beside the K and D that these had before rectification.
fn raw_infos() -> [Camera<'static>; 2] {
    let [left, right] = infos();
    let d = &[-0.05, 0.0, 0.0, 0.0, 0.0];
    [
        left,
        Camera {
            k: [F, 159.5, 126.5],
            ..right
        },
    ]
    .map(|info| Camera { d, ..info })
}

pub(super) fn arena(fixture: &Fixture) -> Vec<Frame> {
    fixture.write_short_arena("arena.toml", 4);
    fixture.run("record arena.toml -q -o arena.mcap");
    read(&fixture.path("arena.mcap")).0
}

/// The messages of these pairs.
pub(super) fn messages(frames: &[Frame], infos: [Camera<'_>; 2]) -> Vec<Message> {
    let sides = [
        ("cam0", "/cam0/image_raw", "/cam0/camera_info"),
        ("cam1", "/cam1/image_raw", "/cam1/camera_info"),
    ];
    let mut all = Vec::new();
    for (i, frame) in frames.iter().enumerate() {
        let stamp = (i as u64 + 1) * 100_000_000;
        let images = [frame.pair.left(), frame.pair.right()];
        for (((frame, image, info), pixels), camera) in sides.into_iter().zip(images).zip(infos) {
            let pixels: Vec<u8> = pixels.pixels().collect();
            all.push(camera_info_of(info, stamp, &Camera { frame, ..camera }));
            all.push(ros_image_in(frame, image, stamp, SIZE, ("mono8", &pixels)));
        }
    }
    all
}

/// A transform: its frames, and the place of the second in the first.
type Link = (&'static str, &'static str, [f64; 3]);

/// The first line of `svl info`, in one line.
fn answer(fixture: &Fixture, what: &str) -> String {
    let ran: Ran = fixture.svl(&format!("info {what}"));
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    let lines = ran
        .stdout
        .lines()
        .take_while(|line| !line.contains("bag.mcap"));
    lines.map(str::trim).collect::<Vec<_>>().join(" ")
}

fn rig_of(frame: &Frame) -> Rig {
    *frame.rig().unwrap()
}

#[test]
fn contradictions_in_a_bag_are_named_first() {
    let fixture = Fixture::new();
    let frames = arena(&fixture);
    let with = |change: &dyn Fn(&mut Camera<'static>)| {
        let mut all = infos();
        all.iter_mut().for_each(change);
        all
    };
    let none: &[Link] = &[];
    let apart = |metres: f64| [("cam0", "cam1", [metres, 0.0, 0.0])];
    let (near, far) = (apart(0.045), apart(0.06));
    let (middle, to_each_other) = (
        apart(BASELINE_M),
        [0.5, -0.5].map(|part| part * F * BASELINE_M),
    );
    let offsets = |both: [f64; 2]| {
        let mut all = infos();
        (all[0].tx, all[1].tx) = (both[0], both[1]);
        all
    };
    let cases: [(&str, [Camera<'_>; 2], &[Link]); 13] = [
        (
            "usable: 4 rectified pairs, calibrated, no truth",
            infos(),
            none,
        ),
        (
            "usable: 4 rectified pairs, calibrated, no truth",
            infos(),
            &near,
        ),
        (
            "0.0440 m by the calibration, which is used, and 0.0600 m by /tf_static",
            infos(),
            &far,
        ),
        (
            "the principal point (60, 120) of the left rectified camera is far from the middle",
            with(&|info| (info.k[1], info.p[1]) = (60.0, 60.0)),
            none,
        ),
        (
            "(400, 120) of the left rectified camera is outside its image of 320x240",
            with(&|info| (info.k[1], info.p[1]) = (400.0, 400.0)),
            none,
        ),
        (
            "its binning of 2x2 would put the principal point at (82, 62)",
            with(&|info| {
                (info.size, info.binning, info.tx) = ((640, 480), 2, info.tx);
                (info.k, info.p) = ([F, 165.0, 125.0], [F, 165.0, 125.0]);
            }),
            none,
        ),
        (
            "the focal length is 328.0 px in P and 656.0 px in K",
            with(&|info| (info.k, info.d) = ([2.0 * F + 1e-3, 159.5, 119.5], &[1e-9; 5])),
            none,
        ),
        (
            "its baseline of 4.400e1 m is not between 0.5 mm and 30 m: likely 0.0440 m, written in \
             millimetres where metres are expected",
            with(&|info| info.tx *= 1000.0),
            none,
        ),
        (
            "of 0.0220 m in the left camera and of -0.0220 m in the right one",
            offsets(to_each_other),
            none,
        ),
        // Offsets to the middle of the cameras.
        (
            "usable: 4 rectified pairs, calibrated, no truth",
            offsets(to_each_other),
            &middle,
        ),
        (
            "the offset is likely the baseline itself, 0.0440 m",
            with(&|info| info.tx /= F),
            none,
        ),
        // A calibration without a size is for that of the images.
        (
            "is the middle of 160x120 pixels, and its image has 320x240",
            with(&|info| {
                (info.size, info.tx) = ((0, 0), info.tx / 2.0);
                (info.k, info.p) = ([F / 2.0, 79.5, 59.5], [F / 2.0, 79.5, 59.5]);
            }),
            none,
        ),
        (
            "the calibration is for images of 640x480 pixels, these have 320x240",
            with(&|info| info.size = (640, 480)),
            none,
        ),
    ];
    for (i, (words, infos, links)) in cases.into_iter().enumerate() {
        let mut all = vec![tf("/tf_static", links)];
        all.extend(messages(&frames, infos));
        bag::write(&fixture.path(""), &all);
        let line = answer(&fixture, "bag.mcap");
        assert!(line.contains(words), "{words}: {line}");
        let json = fixture.json("info bag.mcap --json");
        let checks = &json["first_pairs"]["calibration_checks"];
        let doubts = checks.as_array().unwrap().iter();
        let doubts = doubts.filter(|check| !check["cure"].is_null()).count();
        let is_named = !words.starts_with("usable");
        let is_doubted = is_named && !line.contains("no calibration");
        assert_eq!(doubts, usize::from(is_doubted), "{words}: {checks}");
        let told = json["usability"]["doubts"].as_array().unwrap();
        let is_told = |own: &Value| own["words"].as_str().unwrap().contains(words);
        assert_eq!(told.iter().any(is_told), is_doubted, "{words}: {told:?}");
        // So it is in the manifest of a report.
        fixture.svl(&format!("score bag.mcap --algo v3 --rerun none -q -o r{i}"));
        let manifest = fixture.json_file(&format!("r{i}/manifest.json"));
        let kept = manifest["doubts"].as_array().map_or(&[][..], Vec::as_slice);
        assert_eq!(kept.iter().any(is_told), is_doubted, "{words}: {kept:?}");
        if is_doubted && fixture.path(&format!("r{i}/summary.json")).exists() {
            let missing = fixture.json_file(&format!("r{i}/summary.json"))["missing"].take();
            let kept = missing["doubts"].as_array().unwrap();
            assert_eq!(
                kept.iter().filter(|own| is_told(own)).count(),
                1,
                "{kept:?}"
            );
        }
        // Every other command says it too.
        let replayed = fixture.svl("replay bag.mcap --algo v3");
        assert_eq!(replayed.code, Some(0), "{}", replayed.stderr);
        let said = replayed.stderr.contains(words);
        assert_eq!(said, is_named, "{words}: {}", replayed.stderr);
    }
}

#[test]
fn coefficients_need_a_model_where_images_are_raw() {
    let fixture = Fixture::new();
    let frames = arena(&fixture);
    let fisheye = [-0.013, 0.02, -0.02, 0.006];
    let k = [F, 159.5, 126.5];
    for (model, d, is_named) in [
        ("", &fisheye[..], true),
        ("", &[-0.05, 0.0, 0.0, 0.0, 0.0], true),
        ("", &[0.0; 4], false),
        ("", &[], false),
        ("plumb_bob", &[-0.05, 0.0, 0.0, 0.0, 0.0], false),
        ("equidistant", &fisheye, false),
    ] {
        let infos = infos().map(|info| Camera {
            model,
            d,
            k,
            ..info
        });
        bag::write(&fixture.path(""), &messages(&frames, infos));
        let words = "the distortion model '' is not supported";
        for door in [
            "info bag.mcap",
            "replay bag.mcap",
            "record bag.mcap --force -o r.mcap",
        ] {
            let ran = fixture.svl(door);
            let said = ran.stdout + &ran.stderr;
            let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
            assert_eq!(
                said.contains(words),
                is_named,
                "{model} {d:?}, {door}: {said}"
            );
        }
        let answer = answer(&fixture, "bag.mcap");
        assert_eq!(answer.starts_with("not usable yet"), is_named, "{answer}");
    }
}

/// Kalibr's chain of four of the arena's cameras; the last two are 0.1 m apart.
const CHAIN: [(&str, f64); 4] = [("a", 0.0), ("b", 0.25), ("cam0", 1.0), ("cam1", 0.1)];

#[test]
fn cameras_of_a_chain_are_those_of_the_topics() {
    let fixture = Fixture::new();
    let frames = arena(&fixture);
    let images = messages(&frames, infos()).into_iter();
    let images = images.filter(|message| !message.topic.contains("info"));
    bag::write(&fixture.path(""), &images.collect::<Vec<_>>());
    let chain = |named: &[&str]| {
        let mut text = String::new();
        for (i, ((_, apart), topic)) in CHAIN.iter().zip(named).enumerate() {
            text += &format!(
                "cam{i}:\n  camera_model: pinhole\n  distortion_model: radtan\n  \
                 distortion_coeffs: [0.0, 0.0, 0.0, 0.0]\n  \
                 intrinsics: [{F}, {F}, 159.5, 119.5]\n  \
                 resolution: [320, 240]\n  rostopic: /{topic}/image_raw\n  T_cn_cnm1:\n  \
                 - [1.0, 0.0, 0.0, -{apart}]\n  - [0.0, 1.0, 0.0, 0.0]\n  \
                 - [0.0, 0.0, 1.0, 0.0]\n  - [0.0, 0.0, 0.0, 1.0]\n"
            );
        }
        fixture.write("chain.yaml", text);
    };
    let baseline = |line: &str| {
        let facts = fixture.json(&format!("info {line} --json"))["first_pairs"].take();
        facts["rig"]["baseline_m"]
            .as_f64()
            .map(|m| (m * 1e4).round() / 1e4)
    };
    chain(&CHAIN.map(|(topic, _)| topic));
    assert_eq!(baseline("bag.mcap --calib chain.yaml"), Some(0.1));
    chain(&["a", "b", "c", "d"]);
    let refused = fixture.svl("replay bag.mcap --calib chain.yaml");
    refused.failed(1, &["has 4 cameras", "as FILE:cam0,cam1"]);
    assert_eq!(
        baseline("bag.mcap --calib chain.yaml:cam0,cam1"),
        Some(0.25)
    );
    // A recording keeps the choice, and so do its copies.
    fixture.run("record bag.mcap --calib chain.yaml:cam2,cam3 -o kept.mcap");
    fixture.run("record kept.mcap -o copy.mcap");
    assert_eq!(baseline("bag.mcap --calib copy.mcap"), Some(0.1));
    let text = "name = \"chain\"\n[source]\nkind = \"recording\"\nfiles = [\"bag.mcap\"]\n\
                calib = \"chain.yaml:cam2,cam3\"\n";
    fixture.write("below/s.toml", text.replace("bag.mcap", "../bag.mcap"));
    std::fs::copy(fixture.path("chain.yaml"), fixture.path("below/chain.yaml")).unwrap();
    let ran = fixture.svl("score below/s.toml --algo bm -o r");
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    // A chain of two is a pair, whatever its topics.
    chain(&["a", "b"]);
    assert_eq!(baseline("bag.mcap --calib chain.yaml"), Some(0.25));
}

#[test]
fn images_that_are_rectified_already_are_named_and_taken_as_they_are_by_an_option() {
    let fixture = Fixture::new();
    let frames = arena(&fixture);
    bag::write(&fixture.path(""), &messages(&frames, raw_infos()));
    let words = [
        "px without rectification and ",
        "--calib none uses them as they are",
    ];
    assert_says(&answer(&fixture, "bag.mcap"), &words);
    let facts = fixture.json("info bag.mcap --json")["first_pairs"].take();
    let median = |name: &str| facts[name]["median_abs_px"].as_f64().unwrap();
    let (before, after) = (
        median("unrectified_misalignment"),
        median("vertical_misalignment"),
    );
    assert!(
        before < 0.5 && (5.0..9.0).contains(&after),
        "{before} {after}"
    );
    for command in [
        "record bag.mcap --force -o r.mcap",
        "replay bag.mcap",
        "score bag.mcap -o r",
    ] {
        let said = fixture.svl(command).stderr;
        assert_says(&said, &words);
        assert!(!said.contains("rectify with --calib"), "{said}");
    }
    let check = fixture.svl("calibrate check bag.mcap");
    assert_eq!(check.code, Some(1), "{}", check.stderr);
    assert_says(
        &check.stderr,
        &["if the images are rectified already, --calib none uses them as they are"],
    );
    fixture.run("calibrate check bag.mcap --calib none");

    let line = answer(&fixture, "bag.mcap --calib none");
    assert!(
        line.starts_with("usable: 4 rectified pairs") && line.contains("calibrated"),
        "{line}"
    );
    fixture.run("record bag.mcap -q --calib none -o as-they-are.mcap");
    let taken = read(&fixture.path("as-they-are.mcap")).0;
    assert_eq!(taken.len(), frames.len());
    for (taken, frame) in taken.iter().zip(&frames) {
        assert!(taken.pair == frame.pair);
        let rig = rig_of(taken);
        assert_eq!(rig.focal_px(), F);
        assert!((rig.baseline_m() - BASELINE_M).abs() < 1e-12);
    }
    // Raw pairs that a calibration aligns are not named.
    let [left, right] = infos();
    let straight = [
        left,
        Camera {
            d: &[1e-6, 0.0, 0.0, 0.0, 0.0],
            ..right
        },
    ];
    bag::write(&fixture.path(""), &messages(&frames, straight));
    let line = answer(&fixture, "bag.mcap");
    assert!(!line.contains("rectification"), "{line}");
}

#[test]
fn files_are_checked_as_bags_are() {
    let fixture = Fixture::new();
    fixture.write_pair("p/left/1.pgm", "p/right/1.pgm", (640, 480), 3);
    let calib = |baseline: &str, doffs: &str, cx: &str| {
        format!(
            "cam0=[500 0 {cx}; 0 500 240; 0 0 1]\ncam1=[500 0 351; 0 500 240; 0 0 1]\n\
             doffs={doffs}\nbaseline={baseline}\nwidth=640\nheight=480\n"
        )
    };
    let commands = |file: &str| {
        [
            "info p".to_owned(),
            "score p --algo v3 --rerun none -o r".to_owned(),
            format!("match p/left/1.pgm p/right/1.pgm --calib {file} -o d.pfm"),
            format!("calibrate convert {file} out.xml --force"),
        ]
    };
    for (text, words) in [
        (
            calib("0.176", "31", "320"),
            "likely 0.1760 m, written in metres where millimetres",
        ),
        (calib("1e8", "31", "320"), "is not between 0.5 mm and 30 m"),
        (
            calib("176", "0", "320"),
            "its doffs is 0 px, and its principal points are",
        ),
        (
            calib("176", "31", "320").replace("width=640", "width=1280"),
            "1280x480 pixels",
        ),
    ] {
        fixture.write("p/calib.txt", &text);
        for command in commands("p/calib.txt") {
            // Without images there is no size to compare.
            if command.starts_with("calibrate") && words.contains("1280") {
                continue;
            }
            let ran = fixture.svl(&command);
            assert_says(&ran.stderr, &[words]);
            assert_eq!(ran.code, Some(1), "{command}");
        }
    }
    fixture.write("p/calib.txt", calib("176", "251", "100"));
    let named = "the principal point (100, 240) of the left";
    for command in commands("p/calib.txt") {
        let ran = fixture.svl(&command);
        assert_eq!(ran.code, Some(0), "{command}: {}", ran.stderr);
        let text = ran.stdout + &ran.stderr;
        let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(text.contains(named), "{command}: {text}");
    }
    // Offsets of which each is that to the other camera.
    let kitti = |offset: f64| {
        format!(
            "P0: 500 0 320 {offset} 0 500 240 0 0 0 1 0\nP1: 500 0 320 -88 0 500 240 0 0 0 1 0\n"
        )
    };
    for (offset, is_named) in [(0.0, false), (88.0, true)] {
        fixture.write("k.txt", kitti(offset));
        let ran = fixture.svl("calibrate convert k.txt out.xml --force --size 640x480");
        let said = ran.stdout + &ran.stderr;
        assert_eq!(
            said.contains("distances are twice too long"),
            is_named,
            "{said}"
        );
    }
    // svl's own crop is named to nobody.
    fixture.write("p/calib.txt", calib("176", "31", "320"));
    fixture.run("record p -q --crop 300,0,340,480 -o cropped.mcap");
    let text = fixture.run("info cropped.mcap");
    assert!(
        text.starts_with("usable: 1 rectified pair, calibrated, no truth"),
        "{text}"
    );
}

/// Every kind of input has one answer of all commands that take a source.
#[test]
fn a_source_of_one_command_is_one_of_all() {
    let fixture = Fixture::new();
    let frames = arena(&fixture);
    let all = messages(&frames, infos());
    let bag = bag::write(&fixture.path(""), &all);
    for name in ["cut.bag.active", "bare"] {
        std::fs::copy(&bag, fixture.path(name)).unwrap();
    }
    let (half, rest) = all.split_at(all.len() / 2);
    std::fs::create_dir(fixture.path("split")).unwrap();
    let mut names = String::new();
    for (i, part) in [half, rest].into_iter().enumerate() {
        let name = format!("split_{i}.mcap");
        std::fs::rename(
            bag::write(&fixture.path("split"), part),
            fixture.path("split").join(&name),
        )
        .unwrap();
        names += &format!("    - {name}\n");
    }
    describe(&fixture.path("split"), "mcap", "", &names);
    bag::write_sqlite(&fixture.path(""), &all);
    for i in 0..2 {
        let image = |side: &str| format!("pairs/{side}/{i}.pgm");
        fixture.write_pair(&image("left"), &image("right"), (320, 240), 3);
        fixture.write_pair(
            &format!("scenes/s{i}/im0.pgm"),
            &format!("scenes/s{i}/im1.pgm"),
            SIZE,
            3,
        );
    }
    fixture.write_euroc("60.0");
    fixture.write("notes.txt", "no source");
    fixture.write("keys.txt", "q\n");
    let commands = [
        ("info", "info NAME"),
        ("record", "record NAME -q --force -o out.mcap"),
        ("replay", "replay NAME -q --algo v3"),
        ("score", "score NAME -q --algo v3 --rerun none -o REPORT"),
        ("check", "calibrate check NAME"),
        ("tune", "tune NAME --algo v3 --rerun none --script keys.txt"),
        (
            "label",
            "label checkpoints NAME --script keys.txt -o REPORT.toml",
        ),
        ("match", "match NAME NAME -o out.pfm"),
        ("eval", "eval NAME NAME --protocol kitti2012"),
    ];
    let kinds = [
        "arena.mcap",
        "bag.mcap",
        "bag.db3",
        "split",
        "cut.bag.active",
        "bare",
        "pairs",
        "scenes",
        "mav0",
        "arena.toml",
        "notes.txt",
        "no.mcap",
    ];
    let mut table = String::new();
    for (i, kind) in kinds.into_iter().enumerate() {
        table += &format!("{kind:16}");
        for (name, command) in commands {
            let line = command
                .replace("NAME", kind)
                .replace("REPORT", &format!("r{i}{name}"));
            let ran = fixture.svl(&line);
            let last = ran
                .stderr
                .lines()
                .find(|line| line.starts_with("error"))
                .unwrap_or_default();
            let is_unknown = last.contains("not a source") || last.contains("not MCAP");
            let word = match (ran.code, is_unknown) {
                (Some(0), _) => "yes".to_owned(),
                (_, true) => "unknown".to_owned(),
                (code, _) => format!("{}", code.unwrap_or(-1)),
            };
            assert!(ran.code != Some(0) || last.is_empty(), "{line}");
            table += &format!(" {name} {word:8}");
        }
        table = table.trim_end().to_owned() + "\n";
    }
    insta::assert_snapshot!(table);
}
