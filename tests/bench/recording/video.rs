//! Videos in messages, coded by ffmpeg without loss: H.264 and H.265, whole and damaged.

use super::bag::{self, Message};
use super::frames::image;
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
    let options = match codec {
        "h264" => format!("-c:v libx264 -qp 0 -bf {b_frames} -x264-params aud=1:scenecut=0"),
        _ => format!(
            "-c:v libx265 -x265-params lossless=1:bframes={b_frames}:aud=1:scenecut=0:open-gop=0:\
             repeat-headers=1:log-level=none:keyint={GROUP}:min-keyint={GROUP}"
        ),
    };
    // An H.264 decoder gives grey as the luma of a colour image: exact in the full range.
    let pixels = if codec == "h264" { "yuvj420p" } else { "gray" };
    let mut encoder = Command::new("ffmpeg")
        .args(["-v", "error", "-f", "rawvideo", "-pix_fmt", "gray", "-s"])
        .args([&frames, "-color_range", "pc", "-i", "pipe:0"])
        .args(options.split(' '))
        .args(["-g", &GROUP.to_string(), "-color_range", "pc", "-pix_fmt"])
        .args([pixels, "-f", codec, "pipe:1"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut input = encoder.stdin.take().unwrap();
    let pixels: Vec<u8> = images.iter().flat_map(Gray::pixels).collect();
    let feeder = std::thread::spawn(move || input.write_all(&pixels));
    let stream = encoder.wait_with_output().unwrap().stdout;
    feeder.join().unwrap().unwrap();
    // Each picture begins with an access unit delimiter.
    let mark: &[u8] = if codec == "h264" {
        &[0, 0, 0, 1, 9]
    } else {
        &[0, 0, 0, 1, 0x46]
    };
    let starts = (0..stream.len()).filter(|at| stream[*at..].starts_with(mark));
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
fn messages(build: Build, format: &str, left: &[Vec<u8>], right: &[Vec<u8>]) -> Vec<Message> {
    let pairs = (0..).zip(left.iter().zip(right));
    pairs
        .flat_map(|(i, (left, right))| {
            [
                build(LEFT, stamp(i), format, left),
                build(RIGHT, stamp(i) + 1000, format, right),
            ]
        })
        .collect()
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
        let sides = [0, 1].map(|side| coded(SIZE, codec, &images(20, side), 0));
        let all = messages(build, format, &sides[0], &sides[1]);
        let folder = tempfile::tempdir().unwrap();
        let path = bag::write(folder.path(), &all);
        let expected = (0..20).collect::<Vec<_>>();
        // Again, and with all messages of a camera before those of the other.
        for _ in 0..2 {
            assert_eq!(numbers(&path), (expected.clone(), vec![]), "{format}");
        }
        let (left, right): (Vec<_>, Vec<_>) = all.into_iter().partition(|m| m.topic == LEFT);
        let path = bag::write(folder.path(), &[right, left].concat());
        assert_eq!(numbers(&path).0, expected);
    }
}

#[test]
fn after_damage_a_video_goes_on_at_the_next_keyframe() {
    if !has("ffmpeg", &["-version"]) {
        return;
    }
    for (codec, build) in [
        ("h264", bag::foxglove_video as Build),
        ("hevc", bag::ros_video),
    ] {
        let sides = [0, 1].map(|side| coded(SIZE, codec, &images(20, side), 0));
        let all = messages(build, codec, &sides[0], &sides[1]);
        let folder = tempfile::tempdir().unwrap();
        let check = |messages: &[Message], expected: &[u64], words: &str| {
            let path = bag::write(folder.path(), messages);
            let (found, reasons) = numbers(&path);
            assert_eq!(found, expected, "{codec}: {words}: {reasons:?}");
            let is_it = |reason: &String| reason.contains(words);
            assert!(reasons.iter().any(is_it), "{codec}: {words}: {reasons:?}");
        };
        // Cut at its beginning: two pairs, each of two messages.
        let later: Vec<_> = (6..20).collect();
        check(&all[4..], &later, "the video begins without one");
        // A message of the right camera is lost, between keyframes.
        let lost = [&all[..2 * 8 + 1], &all[2 * 9..]].concat();
        let rest = [
            &(0..8).collect::<Vec<_>>()[..],
            &(12..20).collect::<Vec<_>>(),
        ]
        .concat();
        check(&lost, &rest, "a message before it is missing");
        // One is cut off, which H.265 decoders conceal; one is another, or not a video.
        let with_packet = |i: usize, bytes: &[u8]| {
            let mut changed = all.clone();
            changed[i] = build(changed[i].topic, changed[i].log_time, codec, bytes);
            changed
        };
        let picture = &sides[0][8];
        if codec == "h264" {
            let path = bag::write(
                folder.path(),
                &with_packet(16, &picture[..picture.len() / 2]),
            );
            assert_eq!(numbers(&path).0, rest);
        }
        check(&with_packet(16, b"anything"), &rest, "not in Annex B");
        check(&with_packet(16, &[]), &rest, "not in Annex B");
        check(&with_packet(16, &[0, 0, 1]), &rest, "no picture");
        check(
            &with_packet(16, &sides[0][9]),
            &rest,
            "a message before it is missing",
        );
        let both = [&picture[..], &sides[0][9]].concat();
        check(&with_packet(16, &both), &rest, "one whole picture");
        let mut other = all.clone();
        other[16] = build(LEFT, stamp(8), "av1", picture);
        check(&other, &rest, "svl reads h264 and h265");
    }
}

#[test]
fn another_size_and_b_frames_are_dropped_with_the_reason() {
    if !has("ffmpeg", &["-version"]) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let small = (32, 48);
    let little: Vec<_> = (0..6).map(|i| image(small, i)).collect();
    let sides = [0, 1].map(|side| {
        let all = coded(SIZE, "h264", &images(18, side), 0);
        [&all[..6], &coded(small, "h264", &little, 0), &all[12..]].concat()
    });
    let all = messages(bag::foxglove_video, "h264", &sides[0], &sides[1]);
    let (found, reasons) = numbers(&bag::write(folder.path(), &all));
    assert_eq!(
        found,
        [&[0, 1, 2, 3, 4, 5][..], &[12, 13, 14, 15, 16, 17]].concat()
    );
    assert!(
        reasons[0].contains("32x48 pixels, the video began with 64x48"),
        "{reasons:?}"
    );
    // Images that move, so that the encoder uses B-frames.
    let moving =
        |i: usize| Gray::from_fn(SIZE.0, SIZE.1, |x, y| ((x + 2 * i) * 7 % 200 + y) as u8).unwrap();
    let moving: Vec<_> = (0..12).map(moving).collect();
    let coded = coded(SIZE, "hevc", &moving, 2);
    let all = messages(bag::foxglove_video, "h265", &coded, &coded);
    let mut reader = Reader::open(bag::write(folder.path(), &all)).unwrap();
    let pairs = (0..12).map(|_| reader.next_pair());
    let errors: Vec<_> = pairs
        .filter_map(|pair| pair.err().map(|e| e.to_string()))
        .collect();
    assert!(
        errors.iter().any(|error| error.contains("B-frames")),
        "{errors:?}"
    );
}

#[test]
fn a_video_becomes_a_recording_of_svl() {
    if !has("ffmpeg", &["-version"]) {
        return;
    }
    let fixture = Fixture::new();
    let sides = [0, 1].map(|side| coded(SIZE, "h264", &images(20, side), 0));
    let all = messages(bag::foxglove_video, "h264", &sides[0], &sides[1]);
    bag::write(&fixture.path(""), &all[4..]);
    let info = fixture.run("info bag.mcap");
    for words in [
        "foxglove.CompressedVideo",
        "/left/video (h264, pictures 18, ",
        "pairs           14\n",
    ] {
        assert!(info.contains(words), "{words}: {info}");
    }
    let ran = fixture.svl(&["record", "bag.mcap", "-o", "run.mcap"]);
    assert_eq!(ran.code, Some(4), "{}", ran.stderr);
    fixture.run("record bag.mcap -o run.mcap --allow-loss 4 --force");
    assert_eq!(
        numbers(&fixture.path("run.mcap")),
        ((6..20).collect(), vec![])
    );
    let nowhere = fixture.path("nowhere").display().to_string();
    fixture
        .svl_with(&["replay", "bag.mcap"], &[("PATH", &nowhere)])
        .failed(1, &["not installed", "apt install ffmpeg"]);
}
