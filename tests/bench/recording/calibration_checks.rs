//! Calibrations that contradict themselves, the pairs or the transforms: the same answer at every
//! door.

use super::bag::{self, Bag, CAMERA, Camera, Message, Stereo};
use super::frames::intact;
use super::says::Says;
use crate::cli::fixture::Fixture;
use serde_json::Value;
use svl::stereo::Frame;

const F: f64 = 328.0;
const BASELINE_M: f64 = 0.044;
const K: [f64; 3] = [F, 159.5, 119.5];

/// The arena's left camera, which is rectified.
const LEFT: Camera<'_> = Camera {
    frame: "cam0",
    size: (320, 240),
    k: K,
    d: &[0.0; 5],
    p: K,
    ..CAMERA
};

const RIGHT: Camera<'_> = Camera {
    frame: "cam1",
    tx: -F * BASELINE_M,
    ..LEFT
};

/// The arena's cameras.
pub(super) const ARENA: Stereo<'_> = Stereo {
    images: ["/cam0/image_raw", "/cam1/image_raw"],
    infos: ["/cam0/camera_info", "/cam1/camera_info"],
    size: (320, 240),
    cameras: [LEFT, RIGHT],
};

pub(super) fn arena(fixture: &Fixture) -> Vec<Frame> {
    fixture.write_short_arena("arena.toml", 4);
    fixture.run("record arena.toml -q -o arena.mcap");
    intact(&fixture.path("arena.mcap"))
}

/// The stamp of pair `i`.
pub(super) fn stamp(i: u64) -> u64 {
    (i + 1) * 100_000_000
}

/// The messages of these pairs.
pub(super) fn messages(frames: &[Frame], stereo: Stereo<'_>) -> Vec<Message> {
    stereo.record(frames, stamp)
}

/// What is said of cameras whose calibration contradicts itself or /tf_static, whose distance of
/// the cameras is last, or of sound ones.
fn contradictions() -> Vec<(&'static str, Stereo<'static>, Option<f64>)> {
    let with = |change: &dyn Fn(&mut Camera<'static>)| ARENA.with(change);
    let sound = "usable: 4 rectified pairs, calibrated, no truth";
    let apart_by_tf = "0.0440 m by the calibration, which is used, and 0.0600 m by /tf_static";
    let to_each_other = ARENA.offsets([0.5, -0.5].map(|part| part * F * BASELINE_M));
    let both = "of 0.0220 m in the left camera and of -0.0220 m in the right one";
    let in_metres = "the offset is likely the baseline itself, 0.0440 m";
    let unplaced = |(words, stereo)| (words, stereo, None);
    let placed = [
        (sound, ARENA, Some(0.045)),
        (apart_by_tf, ARENA, Some(0.06)),
        // Offsets to the middle of the cameras.
        (sound, to_each_other, Some(BASELINE_M)),
    ];
    let cases: [(&str, Stereo<'_>); 10] = [
        (sound, ARENA),
        (
            "the principal point (60, 120) of the left rectified camera is far from the middle",
            with(&|info| (info.k[1], info.p[1]) = (60.0, 60.0)),
        ),
        (
            "(400, 120) of the left rectified camera is outside its image of 320x240",
            with(&|info| (info.k[1], info.p[1]) = (400.0, 400.0)),
        ),
        (
            "its binning of 2x2 would put the principal point at (82, 62)",
            with(&|info| {
                (info.size, info.binning) = ((640, 480), 2);
                [info.k, info.p] = [[F, 165.0, 125.0]; 2];
            }),
        ),
        (
            "the focal length is 328.0 px in P and 656.0 px in K",
            with(&|info| (info.k, info.d) = ([2.0 * F + 1e-3, 159.5, 119.5], &[1e-9; 5])),
        ),
        (
            "its baseline of 4.400e1 m is not between 0.5 mm and 30 m: likely 0.0440 m, written in \
             millimetres where metres are expected",
            with(&|info| info.tx *= 1000.0),
        ),
        (both, to_each_other),
        (in_metres, with(&|info| info.tx /= F)),
        // A calibration without a size is for that of the images.
        (
            "is the middle of 160x120 pixels, and its image has 320x240",
            with(&|info| {
                (info.size, info.tx) = ((0, 0), info.tx / 2.0);
                [info.k, info.p] = [[F / 2.0, 79.5, 59.5]; 2];
            }),
        ),
        (
            "the calibration is for images of 640x480 pixels, these have 320x240",
            with(&|info| info.size = (640, 480)),
        ),
    ];
    cases.map(unplaced).into_iter().chain(placed).collect()
}

#[test]
fn contradictions_in_a_bag_are_named_first() {
    let fixture = Fixture::new();
    let frames = arena(&fixture);
    for (i, (words, stereo, apart)) in contradictions().into_iter().enumerate() {
        let links = apart.map(|metres| ("cam0", "cam1", [metres, 0.0, 0.0]));
        let bag = Bag::default().tf(links.as_slice());
        bag.and(messages(&frames, stereo)).write(&fixture);
        let line = fixture.answer("").says(words);
        let json = fixture.json("info bag.mcap --json");
        let checks = &json["first_pairs"]["calibration_checks"];
        let doubts = checks.as_array().unwrap().iter();
        let doubts = doubts.filter(|check| !check["cure"].is_null()).count();
        let is_named = !words.starts_with("usable");
        let is_doubted = is_named && !line.contains("no calibration");
        assert_eq!(doubts, usize::from(is_doubted), "{words}: {checks}");
        // Number of doubts with these words: `svl info` and the manifest of a report have them.
        let told = |doubts: &Value| {
            let all = doubts.as_array().map_or(&[][..], Vec::as_slice).iter();
            all.filter(|own| own["words"].as_str().unwrap().contains(words))
                .count()
        };
        let doubts = &json["usability"]["doubts"];
        assert!(doubts.is_array());
        assert_eq!(told(doubts) > 0, is_doubted, "{words}: {doubts}");
        fixture.svl(&format!("score bag.mcap --algo v3 --rerun none -q -o r{i}"));
        let kept = fixture.json_file(&format!("r{i}/manifest.json"))["doubts"].take();
        assert_eq!(told(&kept) > 0, is_doubted, "{words}: {kept}");
        let summary = format!("r{i}/summary.json");
        if is_doubted && fixture.path(&summary).exists() {
            let kept = fixture.json_file(&summary)["missing"]["doubts"].take();
            assert_eq!(told(&kept), 1, "{kept}");
        }
        // Every other command says it too.
        let replayed = fixture.svl("replay bag.mcap --algo v3").exits(0);
        replayed.says_if(is_named, words);
    }
}

#[test]
fn coefficients_need_a_model_where_images_are_raw() {
    let fixture = Fixture::new();
    let frames = arena(&fixture);
    let fisheye = [-0.013, 0.02, -0.02, 0.006];
    for (model, d, is_named) in [
        ("", &fisheye[..], true),
        ("", &[-0.05, 0.0, 0.0, 0.0, 0.0], true),
        ("", &[0.0; 4], false),
        ("", &[], false),
        ("plumb_bob", &[-0.05, 0.0, 0.0, 0.0, 0.0], false),
        ("equidistant", &fisheye, false),
    ] {
        let k = [F, 159.5, 126.5];
        let stereo = ARENA.with(|info| (info.model, info.d, info.k) = (model, d, k));
        Bag(messages(&frames, stereo)).write(&fixture);
        let record = "record bag.mcap --force -o r.mcap";
        for door in ["info bag.mcap", "replay bag.mcap", record] {
            let said = fixture.svl(door).line();
            said.says_if(is_named, "the distortion model '' is not supported");
        }
        let answer = fixture.answer("");
        assert_eq!(answer.starts_with("not usable yet"), is_named, "{answer}");
    }
}

/// Kalibr's chain of four of the arena's cameras; the last two are 0.1 m apart.
const CHAIN: [(&str, f64); 4] = [("a", 0.0), ("b", 0.25), ("cam0", 1.0), ("cam1", 0.1)];

#[test]
fn cameras_of_a_chain_are_those_of_the_topics() {
    let fixture = Fixture::new();
    let frames = arena(&fixture);
    let [left, right] = ARENA.infos;
    let bag = Bag(messages(&frames, ARENA)).without(left).without(right);
    bag.write(&fixture);
    let chain = |named: &[&str]| {
        let cameras = CHAIN.iter().zip(named).enumerate();
        let text = cameras.map(|(i, ((_, apart), topic))| {
            format!(
                "cam{i}:\n  camera_model: pinhole\n  distortion_model: radtan\n  \
                 distortion_coeffs: [0.0, 0.0, 0.0, 0.0]\n  \
                 intrinsics: [{F}, {F}, 159.5, 119.5]\n  \
                 resolution: [320, 240]\n  rostopic: /{topic}/image_raw\n  T_cn_cnm1:\n  \
                 - [1.0, 0.0, 0.0, -{apart}]\n  - [0.0, 1.0, 0.0, 0.0]\n  \
                 - [0.0, 0.0, 1.0, 0.0]\n  - [0.0, 0.0, 0.0, 1.0]\n"
            )
        });
        fixture.write("chain.yaml", text.collect::<String>());
    };
    let baseline = |calib: &str| {
        let facts = fixture.first_pairs(&format!("--calib {calib}"));
        let metres = facts["rig"]["baseline_m"].as_f64();
        metres.map(|metres| (metres * 1e4).round() / 1e4)
    };
    chain(&CHAIN.map(|(topic, _)| topic));
    assert_eq!(baseline("chain.yaml"), Some(0.1));
    chain(&["a", "b", "c", "d"]);
    let refused = fixture.svl("replay bag.mcap --calib chain.yaml");
    refused.failed(1, &["has 4 cameras", "as FILE:cam0,cam1"]);
    assert_eq!(baseline("chain.yaml:cam0,cam1"), Some(0.25));
    // A recording keeps the choice, and so do its copies.
    fixture.run("record bag.mcap --calib chain.yaml:cam2,cam3 -o kept.mcap");
    fixture.run("record kept.mcap -o copy.mcap");
    assert_eq!(baseline("copy.mcap"), Some(0.1));
    let text = "name = \"chain\"\n[source]\nkind = \"recording\"\n\
                files = [\"../bag.mcap\"]\ncalib = \"chain.yaml:cam2,cam3\"\n";
    fixture.write("below/s.toml", text);
    fixture.write("below/chain.yaml", fixture.text("chain.yaml"));
    fixture.run("score below/s.toml --algo bm -o r");
    // A chain of two is a pair, whatever its topics.
    chain(&["a", "b"]);
    assert_eq!(baseline("chain.yaml"), Some(0.25));
}

#[test]
fn images_that_are_rectified_already_are_named_and_taken_as_they_are_by_an_option() {
    let fixture = Fixture::new();
    let frames = arena(&fixture);
    // K and D that the cameras had before rectification.
    let mut raw = ARENA.with(|info| info.d = &[-0.05, 0.0, 0.0, 0.0, 0.0]);
    raw.cameras[1].k[2] = 126.5;
    Bag(messages(&frames, raw)).write(&fixture);
    let words = "px without rectification and  | --calib none uses them as they are";
    fixture.answer("").says(words);
    let facts = fixture.first_pairs("");
    let [before, after] = ["unrectified_misalignment", "vertical_misalignment"]
        .map(|name| facts[name]["median_abs_px"].as_f64().unwrap());
    let is_worse = before < 0.5 && (5.0..9.0).contains(&after);
    assert!(is_worse, "{before} {after}");
    let record = "record bag.mcap --force -o r.mcap";
    for command in [record, "replay bag.mcap", "score bag.mcap -o r"] {
        let ran = fixture.svl(command).says(words);
        ran.lacks("rectify with --calib");
    }
    fixture
        .svl("calibrate check bag.mcap")
        .exits(1)
        .says("if the images are rectified already, --calib none uses them as they are");
    fixture.run("calibrate check bag.mcap --calib none");

    let line = fixture.answer("--calib none").says("calibrated");
    assert!(line.starts_with("usable: 4 rectified pairs"), "{line}");
    fixture.run("record bag.mcap -q --calib none -o as-they-are.mcap");
    let taken = intact(&fixture.path("as-they-are.mcap"));
    assert_eq!(taken.len(), frames.len());
    for (taken, frame) in taken.iter().zip(&frames) {
        assert!(taken.pair == frame.pair);
        let rig = taken.rig().unwrap();
        assert_eq!(rig.focal_px(), F);
        assert!((rig.baseline_m() - BASELINE_M).abs() < 1e-12);
    }
    // Raw pairs that a calibration aligns are not named.
    let mut straight = ARENA;
    straight.cameras[1].d = &[1e-6, 0.0, 0.0, 0.0, 0.0];
    Bag(messages(&frames, straight)).write(&fixture);
    fixture.answer("").lacks("rectification");
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
    let in_metres = "likely 0.1760 m, written in metres where millimetres";
    let no_offset = "its doffs is 0 px, and its principal points are";
    let wide = calib("176", "31", "320").replace("width=640", "width=1280");
    for (text, words) in [
        (calib("0.176", "31", "320"), in_metres),
        (calib("1e8", "31", "320"), "is not between 0.5 mm and 30 m"),
        (calib("176", "0", "320"), no_offset),
        (wide, "1280x480 pixels"),
    ] {
        fixture.write("p/calib.txt", &text);
        for command in commands("p/calib.txt") {
            // Without images there is no size to compare.
            if command.starts_with("calibrate") && words.contains("1280") {
                continue;
            }
            fixture.svl(&command).says(words).exits(1);
        }
    }
    fixture.write("p/calib.txt", calib("176", "251", "100"));
    let named = "the principal point (100, 240) of the left";
    for command in commands("p/calib.txt") {
        fixture.svl(&command).exits(0).line().says(named);
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
        let words = "distances are twice too long";
        ran.line().says_if(is_named, words);
    }
    // svl's own crop is named to nobody.
    fixture.write("p/calib.txt", calib("176", "31", "320"));
    fixture.run("record p -q --crop 300,0,340,480 -o cropped.mcap");
    let text = fixture.run("info cropped.mcap");
    let is_usable = text.starts_with("usable: 1 rectified pair, calibrated, no truth");
    assert!(is_usable, "{text}");
}

/// Every kind of input has one answer of all commands that take a source.
#[test]
fn a_source_of_one_command_is_one_of_all() {
    let fixture = Fixture::new();
    let frames = arena(&fixture);
    let all = messages(&frames, ARENA);
    let bag = bag::write(&fixture.path(""), &all);
    for name in ["cut.bag.active", "bare"] {
        std::fs::copy(&bag, fixture.path(name)).unwrap();
    }
    let (half, rest) = all.split_at(all.len() / 2);
    let parts = (0..2).map(|i| (format!("split_{i}.mcap"), [half, rest][i]));
    bag::write_split(&fixture.path("split"), "mcap", parts, bag::write);
    bag::write_sqlite(&fixture.path(""), &all);
    for i in 0..2 {
        let image = |side: &str| format!("pairs/{side}/{i}.pgm");
        fixture.write_pair(&image("left"), &image("right"), (320, 240), 3);
        let [left, right] = [0, 1].map(|side| format!("scenes/s{i}/im{side}.pgm"));
        fixture.write_pair(&left, &right, (320, 240), 3);
    }
    fixture.write_euroc("60.0");
    fixture.write("notes.txt", "no source");
    fixture.write("keys.txt", "q\n");
    let label = "label checkpoints NAME --script keys.txt -o REPORT.toml";
    let commands = [
        ("info", "info NAME"),
        ("record", "record NAME -q --force -o out.mcap"),
        ("replay", "replay NAME -q --algo v3"),
        ("score", "score NAME -q --algo v3 --rerun none -o REPORT"),
        ("check", "calibrate check NAME"),
        ("tune", "tune NAME --algo v3 --rerun none --script keys.txt"),
        ("label", label),
        ("match", "match NAME NAME -o out.pfm"),
        ("eval", "eval NAME NAME --protocol kitti2012"),
    ];
    let kinds = "arena.mcap bag.mcap bag.db3 split cut.bag.active bare pairs scenes mav0 \
                 arena.toml notes.txt no.mcap";
    let mut table = String::new();
    for (i, kind) in kinds.split(' ').enumerate() {
        table += &format!("{kind:16}");
        for (name, command) in commands {
            let line = command
                .replace("NAME", kind)
                .replace("REPORT", &format!("r{i}{name}"));
            let ran = fixture.svl(&line);
            let mut lines = ran.stderr.lines();
            let last = lines.find(|line| line.starts_with("error"));
            let last = last.unwrap_or_default();
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
