//! Users' images and bags, from the folder to the recording.

use super::fixture::{Fixture, pgm};
use crate::common::python;
use image::{DynamicImage, ImageBuffer, ImageFormat, Luma, Rgb, RgbImage};
use std::io::Cursor;
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

#[test]
fn rates_are_told_or_not_known() {
    let fixture = Fixture::new();
    for i in [8, 13, 18] {
        let stamp = 1_403_715_273_262_142_976 + 50_000_000 * i as u64;
        for [left, right] in [
            ["left", "right"].map(|side| format!("plain/{i}_{side}.pgm")),
            ["0", "1"].map(|camera| format!("stamped/cam{camera}/{stamp}.pgm")),
        ] {
            fixture.write_pair(&left, &right, (40, 20), i);
        }
    }
    fixture.transcript(
        "record plain -o plain.mcap => 0~ rate and skew are unknown
        info plain.mcap => stamps          nominal 0.5\\n | !period | !skew | !gaps
        record plain --fps 20 -o given.mcap
        info given.mcap => stamps          given 20\\n
        record stamped -o stamped.mcap
        info stamped.mcap => period          0.250 s\\n",
    );
    let names = frames(&fixture, "plain.mcap").into_iter();
    let names: Vec<_> = names.map(|frame| frame.name.unwrap()).collect();
    assert_eq!(names, ["8_", "13_", "18_"]);
}

#[test]
fn losses_of_a_folder_are_counted() {
    let fixture = Fixture::new();
    for i in 0..3 {
        let [left, right] = ["left", "right"].map(|side| format!("p/{side}/{i}.pgm"));
        fixture.write_pair(&left, &right, (40, 20), i);
    }
    let black = pgm(40, 20, &[0; 800]);
    fixture.write("p/left/1.pgm", &black[..99]);
    fixture.transcript(
        "record p -o p.mcap => 4~ left/1.pgm | 1 pair dropped | 1 pair could not be read",
    );
    assert_eq!(frames(&fixture, "p.mcap").len(), 2);
    fixture.write("p/left/1.pgm", &black);
    fixture.write("p/left/alone.pgm", &black);
    fixture.transcript("record p -o q.mcap => 4~ 1 image dropped | 1 image had no partner");
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
    fixture.write_pair("flat/left/1.pgm", "flat/right/1.pgm", (40, 20), 2);
    // Two images: the same.
    fixture.transcript(
        "record deep -o deep.mcap => 0~ grey is (value - 0) / 16, as 12 bits are used: 99.9 % of \
        the pixels of the first 16 pairs are at most 4039; --bits N overrides \
        | a later image has many values outside of 0 to 4095: black or white
        info deep.mcap => bits            12\\n
        info deep.mcap --json => /header/bits = 12 | /manifest/bits = 12
        record deep --bits 16 -o all.mcap
        record flat --bits 12 -o flat.mcap => 2: --bits is for 16-bit images
        match deep/left/0.png deep/right/0.png -o d.pfm => 0~ 12 bits are used",
    );
    let deep = frames(&fixture, "deep.mcap");
    let first = [deep[0].pair.left(), deep[0].pair.right()].map(|image| image.get(0, 0));
    assert_eq!(first, [125, 250]);
    assert_eq!(deep[19].pair.left().get(0, 0), 255);
    assert_eq!(frames(&fixture, "all.mcap")[0].pair.left().get(0, 0), 7);
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
    // A ROS 2 bag contains both; svl uses the grey ones unless the others are named.
    fixture.transcript(
        "record c -o raw.mcap
        record c -o png.mcap --compress
        record raw.mcap --ros2 -o ros.mcap
        record ros.mcap -o grey.mcap
        record ros.mcap -o color.mcap --left /stereo/left/image_rect_color \
        --right /stereo/right/image_rect_color",
    );
    for name in ["raw.mcap", "png.mcap"] {
        let read = frames(&fixture, name);
        let [left, right] = read[1].color.as_ref().expect("colour");
        assert_eq!(left.get(7, 3), [42, 36, 1]);
        assert_eq!(right.get(7, 3), [42, 36, 10]);
        assert_eq!(&Gray::from_color(left), read[1].pair.left());
    }
    let [grey, color] = ["grey.mcap", "color.mcap"].map(|name| frames(&fixture, name).remove(1));
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
    }
    fixture.fails(
        "record scene -o out.mcap => 1: calib.txt | 80x40 | 40x20
        record many -o out.mcap => 1: calib.txt | 80x40 | 40x20
        match -q scene/im0.pgm scene/im1.pgm -o d.pfm --calib scene/calib.txt \
        => 1: im0.pgm | 80x40 | 40x20",
    );
}

#[test]
fn euroc_s_cameras_rectify_its_folder() {
    let fixture = Fixture::new();
    fixture.write_euroc("60.0");
    // Also from the folder above. A raw recording keeps its calibration for rectification.
    fixture.transcript(
        "mkdir out
        record mav0 -o out/rectified.mcap => 0~ rectified by its own calibration
        record . --force -o out/rectified.mcap => 0~ rectified by its own calibration
        info out/rectified.mcap => period          50.000 ms\\n
        record mav0 --calib none -o out/raw.mcap
        record out/raw.mcap --calib out/raw.mcap -o out/later.mcap",
    );
    let read = frames(&fixture, "out/rectified.mcap");
    let baseline_m = read[0].rig().unwrap().baseline_m();
    assert!((baseline_m - 0.1).abs() < 1e-9, "{baseline_m}");
    let (stamp_ns, skew_ns) = (read[1].stamp_ns, read[1].exposure.skew_ns);
    assert_eq!((stamp_ns, skew_ns), (100_000_000, Some(0)));
    assert_eq!(frames(&fixture, "out/later.mcap")[0].pair, read[0].pair);
}

#[test]
fn options_are_for_what_takes_them() {
    let fixture = Fixture::new();
    fixture.write_pair("p/left/1.pgm", "p/right/1.pgm", (40, 20), 3);
    fixture.write_pair("scene/im0.pgm", "scene/im1.pgm", (40, 20), 3);
    fixture.write("film.mp4", "no video");
    fixture.transcript(
        "record p -o p.mcap
        record -o out.mcap p --left /a --right /b => 2: /a: is a topic
        record -o out.mcap p --left left/* => 2: --left and --right | together
        record -o out.mcap p --left l* --right r* => 1: no image is named 'l*' | left, right
        record -o out.mcap p.mcap --left left/*.png => 1: is a pattern
        record -o out.mcap p.mcap --fps 10 => 2: --fps is for a video, a folder
        record -o out.mcap p.mcap --side-by-side \
        => 1: which images are side by side | /stereo/left/image
        record -o out.mcap scene --fps 10 => 2: scenes of a data set
        record -o out.mcap film.mp4 => 2: --side-by-side | --left and --right
        replay p.mcap --fps 10 => 2: --fps is for
        replay p.mcap --bits 12 => 2: these have 8 bits",
    );
}

/// Bags of rosbags, in each storage and compression.
#[test]
fn bags_of_a_foreign_writer() {
    let fixture = Fixture::new();
    let Some(_) = python("write_bags.py", "rosbags, numpy", [fixture.path("")]) else {
        return;
    };
    fixture.transcript("record mcap -o mcap.mcap => 0~ as 12 bits are used");
    let plain = frames(&fixture, "mcap.mcap");
    assert_eq!(plain.len(), 6);
    assert_eq!(plain[0].pair.left().get(1, 0), 64, "12 bits of 1024");
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
        fixture.run(&format!("record {bag} -o {bag}.mcap"));
        assert!(frames(&fixture, &format!("{bag}.mcap")) == plain, "{bag}");
    }
    // A single file of a bag, and its contents.
    let db3 = fixture.bytes("sqlite/sqlite.db3");
    fixture.write("cut/cut.db3", &db3[..db3.len() * 2 / 3]);
    fixture.transcript(
        "info sqlite => paired topics   /left/image_raw
        record cut/cut.db3 -o cut.mcap => 1~ cut.db3: after message
        recover sqlite -o x.mcap => 1: is not an MCAP file",
    );
}
