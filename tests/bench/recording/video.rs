//! Videos in messages, coded by ffmpeg without loss: H.264 and H.265, whole and damaged.

use super::bag::{self, Bag, Message};
use super::frames::image;
use super::says::Says;
use crate::cli::fixture::{Fixture, has};
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};
use svl::Error;
use svl::recording::Reader;
use svl::stereo::Gray;

const SIZE: (usize, usize) = (64, 48);
const LEFT: &str = "/left/video";
const RIGHT: &str = "/right/video";
/// Pictures from a keyframe to the next.
const GROUP: u64 = 6;
const PERIOD_NS: u64 = 50_000_000;

type Build = fn(&'static str, u64, &str, &[u8]) -> Message;

/// The pictures of a video, coded one by one.
pub(super) fn coded(
    size: (usize, usize),
    codec: &str,
    images: &[Gray],
    b_frames: u32,
) -> Vec<Vec<u8>> {
    let frames = format!("{}x{}", size.0, size.1);
    // An H.264 decoder gives grey as the luma of a colour image: exact in the full range. Each
    // picture begins with an access unit delimiter.
    let (options, pixels, mark) = match codec {
        "h264" => (
            format!("libx264 -qp 0 -bf {b_frames} -x264-params aud=1:scenecut=0"),
            "yuvj420p",
            [0, 0, 0, 1, 9],
        ),
        _ => (
            format!(
                "libx265 -x265-params lossless=1:bframes={b_frames}:aud=1:scenecut=0:open-gop=0:\
                 repeat-headers=1:log-level=none:keyint={GROUP}:min-keyint={GROUP}"
            ),
            "gray",
            [0, 0, 0, 1, 0x46],
        ),
    };
    let args = format!(
        "-v error -f rawvideo -pix_fmt gray -s {frames} -color_range pc -i pipe:0 -c:v {options} \
         -g {GROUP} -color_range pc -pix_fmt {pixels} -f {codec} pipe:1"
    );
    let mut encoder = Command::new("ffmpeg");
    encoder.args(args.split(' ')).stdin(Stdio::piped());
    let mut encoder = encoder.stdout(Stdio::piped()).spawn().unwrap();
    let mut input = encoder.stdin.take().unwrap();
    let pixels: Vec<u8> = images.iter().flat_map(Gray::pixels).collect();
    let feeder = std::thread::spawn(move || input.write_all(&pixels));
    let stream = encoder.wait_with_output().unwrap().stdout;
    feeder.join().unwrap().unwrap();
    let starts = (0..stream.len()).filter(|at| stream[*at..].starts_with(&mark));
    let starts: Vec<_> = starts.chain([stream.len()]).collect();
    let units = starts
        .windows(2)
        .map(|ends| stream[ends[0]..ends[1]].to_vec());
    units.collect()
}

fn images(count: u64, side: u64) -> Vec<Gray> {
    (0..count).map(|i| image(SIZE, 2 * i + side)).collect()
}

fn stamp(i: u64) -> u64 {
    1_700_000_000_000_000_000 + i * PERIOD_NS
}

/// The messages of both cameras in turn.
fn messages(build: Build, format: &str, left: &[Vec<u8>], right: &[Vec<u8>]) -> Bag {
    let pair = |(i, (left, right)): (u64, (&Vec<u8>, &Vec<u8>))| {
        let left = build(LEFT, stamp(i), format, left);
        [left, build(RIGHT, stamp(i) + 1000, format, right)]
    };
    let pairs = left.iter().zip(right);
    Bag::new((0..).zip(pairs).flat_map(pair))
}

/// Twenty pictures of both cameras, coded.
fn sides(codec: &str) -> [Vec<Vec<u8>>; 2] {
    [0, 1].map(|side| coded(SIZE, codec, &images(20, side), 0))
}

/// Numbers of the pairs that can be read, by their stamps; their images are checked. The reasons of
/// the others, in order.
fn numbers(path: &Path) -> (Vec<u64>, Vec<String>) {
    let mut reader = Reader::open(path).unwrap();
    let (mut numbers, mut reasons) = (Vec::new(), Vec::new());
    loop {
        match reader.next_pair() {
            Ok(Some(frame)) => {
                let number = (frame.stamp_ns - stamp(0)) / PERIOD_NS;
                let images = [0, 1].map(|side| image(SIZE, 2 * number + side));
                let found = [frame.pair.left(), frame.pair.right()];
                assert!(found == images.each_ref(), "pair {number}: {reasons:?}");
                assert!(frame.color.is_none());
                assert_eq!(frame.exposure.skew_ns, Some(1000));
                numbers.push(number);
            }
            Ok(None) => return (numbers, reasons),
            Err(Error::Format { reason, .. }) => reasons.push(reason.to_string()),
            Err(error) => panic!("{error}"),
        }
    }
}

#[test]
fn the_pictures_are_those_of_the_images() {
    if !has("ffmpeg", &["-version"]) {
        return;
    }
    let kinds: [(Build, &str, &str); 4] = [
        (bag::foxglove_video, "h264", "h264"),
        (bag::ros_video, "hevc", "h265"),
        (bag::ffmpeg_packet, "h264", "libx264"),
        (bag::ffmpeg_packet, "hevc", "hevc;yuv420p;mono8;mono8"),
    ];
    for (build, codec, format) in kinds {
        let [left, right] = sides(codec);
        let all = messages(build, format, &left, &right);
        let saved = all.saved();
        let expected = (0..20).collect::<Vec<_>>();
        // Again, and with all messages of a camera before those of the other.
        for _ in 0..2 {
            assert_eq!(numbers(&saved), (expected.clone(), vec![]), "{format}");
        }
        let right_first = all.clone().without(LEFT).and(all.without(RIGHT));
        assert_eq!(numbers(&right_first.saved()).0, expected);
    }
}

#[test]
fn after_damage_a_video_goes_on_at_the_next_keyframe() {
    if !has("ffmpeg", &["-version"]) {
        return;
    }
    let foxglove: Build = bag::foxglove_video;
    for (codec, build) in [("h264", foxglove), ("hevc", bag::ros_video)] {
        let [left, right] = sides(codec);
        let all = messages(build, codec, &left, &right).0;
        let check = |bag: &Bag, expected: &[u64], words: &str| {
            let (found, reasons) = numbers(&bag.saved());
            assert_eq!(found, expected, "{codec}: {words}: {reasons:?}");
            let is_it = |reason: &String| reason.contains(words);
            assert!(reasons.iter().any(is_it), "{codec}: {words}: {reasons:?}");
        };
        // Cut at its beginning: two pairs, each of two messages.
        let later: Vec<_> = (6..20).collect();
        let cut = Bag(all[4..].to_vec());
        check(&cut, &later, "the video begins without one");
        // A message of the right camera is lost, between keyframes.
        let lost = Bag([&all[..2 * 8 + 1], &all[2 * 9..]].concat());
        let rest: Vec<_> = (0..8).chain(12..20).collect();
        check(&lost, &rest, "a message before it is missing");
        // One is cut off, which H.265 decoders conceal; one is another, or not a video.
        let with_packet = |format: &str, bytes: &[u8]| {
            let mut changed = Bag(all.clone());
            changed.0[16] = build(LEFT, stamp(8), format, bytes);
            changed
        };
        let picture = &left[8];
        if codec == "h264" {
            let half = with_packet(codec, &picture[..picture.len() / 2]);
            assert_eq!(numbers(&half.saved()).0, rest);
        }
        let both = [&picture[..], &left[9]].concat();
        for (format, bytes, words) in [
            (codec, &b"anything"[..], "not in Annex B"),
            (codec, &[], "not in Annex B"),
            (codec, &[0, 0, 1], "no picture"),
            (codec, &left[9], "a message before it is missing"),
            (codec, &both, "one whole picture"),
            ("av1", picture, "svl reads h264 and h265"),
        ] {
            check(&with_packet(format, bytes), &rest, words);
        }
    }
}

#[test]
fn another_size_and_b_frames_are_dropped_with_the_reason() {
    if !has("ffmpeg", &["-version"]) {
        return;
    }
    let small = (32, 48);
    let little: Vec<_> = (0..6).map(|i| image(small, i)).collect();
    let [left, right] = [0, 1].map(|side| {
        let all = coded(SIZE, "h264", &images(18, side), 0);
        [&all[..6], &coded(small, "h264", &little, 0), &all[12..]].concat()
    });
    let all = messages(bag::foxglove_video, "h264", &left, &right);
    let (found, reasons) = numbers(&all.saved());
    assert!(found.into_iter().eq((0..6).chain(12..18)));
    reasons[0]
        .as_str()
        .says("32x48 pixels, the video began with 64x48");
    // Images that move, so that the encoder uses B-frames.
    let moving =
        |i: usize| Gray::from_fn(SIZE.0, SIZE.1, |x, y| ((x + 2 * i) * 7 % 200 + y) as u8).unwrap();
    let moving: Vec<_> = (0..12).map(moving).collect();
    let coded = coded(SIZE, "hevc", &moving, 2);
    let all = messages(bag::foxglove_video, "h265", &coded, &coded);
    let mut reader = Reader::open(&all.saved()).unwrap();
    let errors = (0..12).filter_map(|_| reader.next_pair().err());
    let errors: Vec<_> = errors.map(|error| error.to_string()).collect();
    let is_named = errors.iter().any(|error| error.contains("B-frames"));
    assert!(is_named, "{errors:?}");
}

#[test]
fn a_video_becomes_a_recording_of_svl() {
    if !has("ffmpeg", &["-version"]) {
        return;
    }
    let fixture = Fixture::new();
    let [left, right] = sides("h264");
    let all = messages(bag::foxglove_video, "h264", &left, &right).0;
    Bag(all[4..].to_vec()).write(&fixture);
    let info = fixture.run("info bag.mcap");
    info.says("foxglove.CompressedVideo | /left/video (h264, pictures 18,  | pairs           14\n");
    fixture.svl("record bag.mcap -o run.mcap").exits(4);
    fixture.run("record bag.mcap -o run.mcap --allow-loss 4 --force");
    let found = numbers(&fixture.path("run.mcap"));
    assert_eq!(found, ((6..20).collect(), vec![]));
    let nowhere = fixture.path("nowhere").display().to_string();
    let ran = fixture.svl_with("replay bag.mcap", &[("PATH", &nowhere)]);
    ran.failed(1, &["not installed", "apt install ffmpeg"]);
}
