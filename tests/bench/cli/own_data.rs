//! Users' images and bags, from the folder to the recording.

use super::fixture::{Fixture, Ran, assert_says, has, pgm};
use image::{DynamicImage, ImageBuffer, ImageFormat, Luma, Rgb, RgbImage};
use std::io::Cursor;
use std::process::Command;
use svl::source::{RecordingSource, Source};
use svl::stereo::{Frame, Gray};

fn encoded(image: impl Into<DynamicImage>, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    image.into().write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

pub(super) fn frames(fixture: &Fixture, name: &str) -> Vec<Frame> {
    let mut source = RecordingSource::open(fixture.path(name)).unwrap();
    std::iter::from_fn(|| source.next().unwrap()).collect()
}

/// The standard error of a run that kept everything except the losses it warned of.
#[track_caller]
pub(super) fn incomplete(ran: Ran, words: &[&str]) {
    assert_eq!(ran.code, Some(4), "{}", ran.stderr);
    for word in words {
        assert!(
            ran.stderr.contains(word),
            "'{word}' is not in: {}",
            ran.stderr
        );
    }
}

#[test]
fn rates_are_told_or_not_known() {
    let fixture = Fixture::new();
    for i in [8, 13, 18] {
        let name = |side: &str| format!("plain/{i}_{side}.pgm");
        fixture.write_pair(&name("left"), &name("right"), (40, 20), i);
        let stamp = 1_403_715_273_262_142_976 + 50_000_000 * i as u64;
        let name = |side: &str| format!("stamped/cam{side}/{stamp}.pgm");
        fixture.write_pair(&name("0"), &name("1"), (40, 20), i);
    }
    let ran = fixture.svl("record plain -o plain.mcap");
    assert!(
        ran.stderr.contains("rate and skew are unknown"),
        "{}",
        ran.stderr
    );
    ran.done();
    let info = fixture.run("info plain.mcap");
    assert!(info.contains("stamps          nominal 0.5\n"), "{info}");
    for label in ["period", "skew", "gaps"] {
        assert!(!info.contains(label), "{info}");
    }
    let names = frames(&fixture, "plain.mcap")
        .into_iter()
        .map(|frame| frame.name.unwrap());
    assert_eq!(names.collect::<Vec<_>>(), ["8_", "13_", "18_"]);
    fixture.run("record plain --fps 20 -o given.mcap");
    let info = fixture.run("info given.mcap");
    assert!(info.contains("stamps          given 20\n"), "{info}");
    fixture.run("record stamped -o stamped.mcap");
    let info = fixture.run("info stamped.mcap");
    assert!(info.contains("period          0.250 s\n"), "{info}");
}

#[test]
fn losses_of_a_folder_are_counted() {
    let fixture = Fixture::new();
    for i in 0..3 {
        fixture.write_pair(
            &format!("p/left/{i}.pgm"),
            &format!("p/right/{i}.pgm"),
            (40, 20),
            i,
        );
    }
    fixture.write("p/left/1.pgm", &pgm(40, 20, &[0; 800])[..99]);
    let ran = fixture.svl("record p -o p.mcap");
    incomplete(
        ran,
        &["left/1.pgm", "1 pair dropped", "1 pair could not be read"],
    );
    assert_eq!(frames(&fixture, "p.mcap").len(), 2);
    fixture.write("p/left/1.pgm", pgm(40, 20, &[0; 800]));
    fixture.write("p/left/alone.pgm", pgm(40, 20, &[0; 800]));
    let ran = fixture.svl("record p -o q.mcap");
    incomplete(ran, &["1 image dropped", "1 image had no partner"]);
}

#[test]
fn images_of_12_bits_are_not_dark() {
    let fixture = Fixture::new();
    let write = |name: &str, value: u16| {
        let image = ImageBuffer::from_fn(40, 20, |x, _| Luma([value + x as u16]));
        fixture.write(name, encoded(image, ImageFormat::Png));
    };
    for i in 0..20 {
        // One later pair is brighter than those that decide.
        let value = if i == 19 { 60_000 } else { 2000 };
        write(&format!("deep/left/{i}.png"), value);
        write(&format!("deep/right/{i}.png"), 4000);
    }
    let ran = fixture.svl("record deep -o deep.mcap");
    let note = "grey is (value - 0) / 16, as 12 bits are used: 99.9 % of the pixels of the first \
                16 pairs are at most 4039; --bits N overrides";
    assert!(ran.stderr.contains(note), "{}", ran.stderr);
    assert_says(
        &ran.stderr,
        &["a later image has many values outside of 0 to 4095: black or white"],
    );
    ran.done();
    let deep = frames(&fixture, "deep.mcap");
    let first = [deep[0].pair.left(), deep[0].pair.right()].map(|image| image.get(0, 0));
    assert_eq!(first, [125, 250]);
    assert_eq!(deep[19].pair.left().get(0, 0), 255);
    let info = fixture.run("info deep.mcap");
    assert!(info.contains("bits            12\n"), "{info}");
    let json = fixture.run("info deep.mcap --json");
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(
        (&json["header"]["bits"], &json["manifest"]["bits"]),
        (&12.into(), &12.into())
    );
    fixture.run("record deep --bits 16 -o all.mcap");
    assert_eq!(frames(&fixture, "all.mcap")[0].pair.left().get(0, 0), 7);
    fixture.write_pair("flat/left/1.pgm", "flat/right/1.pgm", (40, 20), 2);
    fixture
        .svl("record flat --bits 12 -o flat.mcap")
        .failed(2, &["--bits is for 16-bit images"]);
    // Two images: the same.
    let matched = fixture.svl("match deep/left/0.png deep/right/0.png -o d.pfm");
    assert!(
        matched.stderr.contains("12 bits are used"),
        "{}",
        matched.stderr
    );
    matched.done();
}

#[test]
fn colour_is_kept_and_the_pair_is_its_luma() {
    let fixture = Fixture::new();
    let image =
        |i: u32| RgbImage::from_fn(40, 20, |x, y| Rgb([(x * 6) as u8, (y * 12) as u8, i as u8]));
    for i in 0..2 {
        for (side, add) in [("left", 0), ("right", 9)] {
            let bytes = encoded(image(i + add), ImageFormat::Png);
            fixture.write(&format!("c/{side}/{i}.png"), bytes);
        }
    }
    for (name, more) in [("raw.mcap", None), ("png.mcap", Some("--compress"))] {
        let args = ["record", "c", "-o", name].into_iter().chain(more);
        fixture.svl(&args.collect::<Vec<_>>()).done();
        let read = frames(&fixture, name);
        let [left, right] = read[1].color.as_ref().expect("colour");
        assert_eq!(left.get(7, 3), [42, 36, 1]);
        assert_eq!(right.get(7, 3), [42, 36, 10]);
        assert_eq!(&Gray::from_color(left), read[1].pair.left());
    }
    // A ROS 2 bag contains both; svl uses the grey ones unless the others are named.
    fixture.run("record raw.mcap --ros2 -o ros.mcap");
    let [grey, color] = [
        ("grey.mcap", vec![]),
        (
            "color.mcap",
            vec![
                "--left",
                "/stereo/left/image_rect_color",
                "--right",
                "/stereo/right/image_rect_color",
            ],
        ),
    ]
    .map(|(name, more)| {
        fixture
            .svl(&[&["record", "ros.mcap", "-o", name], &more[..]].concat())
            .done();
        frames(&fixture, name).remove(1)
    });
    assert_eq!(grey.pair, color.pair);
    assert!(grey.color.is_none() && color.color.is_some());
}

#[test]
fn a_calibration_of_another_size_is_refused_everywhere() {
    let fixture = Fixture::new();
    let calib = "cam0=[300 0 20; 0 300 10; 0 0 1]\ncam1=[300 0 20; 0 300 10; 0 0 1]\ndoffs=0\n\
                 baseline=100\nwidth=80\nheight=40\n";
    fixture.write_pair("scene/im0.pgm", "scene/im1.pgm", (40, 20), 3);
    fixture.write_pair("many/left/1.pgm", "many/right/1.pgm", (40, 20), 3);
    for folder in ["scene", "many"] {
        fixture.write(&format!("{folder}/calib.txt"), calib);
        fixture
            .svl(&["record", folder, "-o", "out.mcap"])
            .failed(1, &["calib.txt", "80x40", "40x20"]);
    }
    let (left, right) = ("scene/im0.pgm", "scene/im1.pgm");
    fixture
        .svl(&[
            "match",
            "-q",
            left,
            right,
            "-o",
            "d.pfm",
            "--calib",
            "scene/calib.txt",
        ])
        .failed(1, &["im0.pgm", "80x40", "40x20"]);
}

#[test]
fn euroc_s_cameras_rectify_its_folder() {
    let fixture = Fixture::new();
    fixture.write_euroc("60.0");
    std::fs::create_dir(fixture.path("out")).unwrap();
    // Also from the folder above.
    for folder in ["mav0", "."] {
        let ran = fixture.svl(&["record", folder, "--force", "-o", "out/rectified.mcap"]);
        assert!(
            ran.stderr.contains("rectified by its own calibration"),
            "{}",
            ran.stderr
        );
        ran.done();
    }
    let read = frames(&fixture, "out/rectified.mcap");
    let baseline_m = read[0].rig().unwrap().baseline_m();
    assert!((baseline_m - 0.1).abs() < 1e-9, "{baseline_m}");
    assert_eq!(
        (read[1].stamp_ns, read[1].exposure.skew_ns),
        (100_000_000, Some(0))
    );
    let info = fixture.run("info out/rectified.mcap");
    assert!(info.contains("period          50.000 ms\n"), "{info}");
    // A raw recording keeps its calibration for rectification.
    fixture.run("record mav0 --calib none -o out/raw.mcap");
    let raw = "out/raw.mcap";
    fixture
        .svl(&["record", raw, "--calib", raw, "-o", "out/later.mcap"])
        .done();
    assert_eq!(frames(&fixture, "out/later.mcap")[0].pair, read[0].pair);
}

#[test]
fn options_are_for_what_takes_them() {
    let fixture = Fixture::new();
    fixture.write_pair("p/left/1.pgm", "p/right/1.pgm", (40, 20), 3);
    fixture.write_pair("scene/im0.pgm", "scene/im1.pgm", (40, 20), 3);
    fixture.run("record p -o p.mcap");
    fixture.write("film.mp4", "no video");
    for (args, code, words) in [
        (
            &["p", "--left", "/a", "--right", "/b"][..],
            2,
            &["/a: is a topic"][..],
        ),
        (
            &["p", "--left", "left/*"],
            2,
            &["--left and --right", "together"],
        ),
        (
            &["p", "--left", "l*", "--right", "r*"],
            1,
            &["no image is named 'l*'", "left, right"],
        ),
        (&["p.mcap", "--left", "left/*.png"], 1, &["is a pattern"]),
        (
            &["p.mcap", "--fps", "10"],
            2,
            &["--fps is for a video, a folder"],
        ),
        (
            &["p.mcap", "--side-by-side"],
            1,
            &["which images are side by side", "/stereo/left/image"],
        ),
        (&["scene", "--fps", "10"], 2, &["scenes of a data set"]),
        (&["film.mp4"], 2, &["--side-by-side", "--left and --right"]),
    ] {
        let args = [&["record", "-o", "out.mcap"], args].concat();
        fixture.svl(&args).failed(code, words);
    }
    fixture
        .svl("replay p.mcap --fps 10")
        .failed(2, &["--fps is for"]);
    fixture
        .svl("replay p.mcap --bits 12")
        .failed(2, &["these have 8 bits"]);
}

/// Bags of rosbags, in each storage and compression.
#[test]
fn bags_of_a_foreign_writer() {
    let python = std::env::var("SVL_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    if !has(&python, &["-c", "import rosbags, numpy"]) {
        return;
    }
    let fixture = Fixture::new();
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/python/write_bags.py");
    let written = Command::new(&python)
        .arg(script)
        .arg(fixture.path(""))
        .output()
        .unwrap();
    assert!(
        written.status.success(),
        "{}",
        String::from_utf8_lossy(&written.stderr)
    );
    let read = |bag: &str| {
        let out = format!("{bag}.mcap");
        let ran = fixture.svl(&["record", bag, "-o", &out]);
        (ran.code, ran.stderr, frames(&fixture, &out))
    };
    let (code, stderr, plain) = read("mcap");
    assert_eq!(code, Some(0), "{stderr}");
    assert_eq!(
        (plain.len(), plain[0].pair.left().get(1, 0)),
        (6, 64),
        "12 bits of 1024"
    );
    assert!(stderr.contains("as 12 bits are used"), "{stderr}");
    for bag in [
        "sqlite",
        "sqlite-file",
        "sqlite-message",
        "mcap-file",
        "mcap-message",
        "ros1-none.bag",
        "ros1-bz2.bag",
        "ros1-lz4.bag",
    ] {
        let (code, stderr, frames) = read(bag);
        assert_eq!(code, Some(0), "{bag}: {stderr}");
        assert!(frames == plain, "{bag}");
    }
    // A single file of a bag, and its contents.
    let info = fixture.run("info sqlite");
    assert!(info.contains("paired topics   /left/image_raw"), "{info}");
    let db3 = std::fs::read(fixture.path("sqlite/sqlite.db3")).unwrap();
    fixture.write("cut/cut.db3", &db3[..db3.len() * 2 / 3]);
    let ran = fixture.svl("record cut/cut.db3 -o cut.mcap");
    assert_eq!(ran.code, Some(1), "{}", ran.stderr);
    assert_says(&ran.stderr, &["cut.db3: after message"]);
    fixture
        .svl("recover sqlite -o x.mcap")
        .failed(1, &["is not an MCAP file"]);
}
