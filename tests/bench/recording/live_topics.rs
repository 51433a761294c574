//! Live topics without a network: pairs of the messages that a bag would hold.

use super::bag::{self, Message, camera_info, cdr_in, ros_compressed, ros_image, ros_image_in};
use super::frames::{PERIOD_NS, START_NS, image};
use super::sensor::tf;
use crate::cli::fixture::Fixture;
use crate::common::assert_says;
use svl::recording::{LiveTopic, Selection, TopicPairs};
use svl::stereo::Frame;

const SIZE: (usize, usize) = (24, 16);

/// Pair `i` with its calibrations.
fn messages(i: u64) -> Vec<Message> {
    let stamp = START_NS + i * PERIOD_NS;
    let pixels = |seed| image(SIZE, seed).pixels().collect::<Vec<u8>>();
    vec![
        ros_image("/cam0/image_rect", stamp, SIZE, "mono8", &pixels(2 * i)),
        ros_image("/cam1/image_rect", stamp, SIZE, "mono8", &pixels(2 * i + 1)),
        camera_info("/cam0/camera_info", stamp, &[], 0.0),
        camera_info("/cam1/camera_info", stamp, &[], -32.8),
    ]
}

fn topics(messages: &[Message]) -> Vec<LiveTopic> {
    let topic = |message: &Message| LiveTopic {
        name: message.topic.to_owned(),
        schema: message.schema.to_owned(),
    };
    messages.iter().map(topic).collect()
}

fn pairs() -> TopicPairs {
    TopicPairs::new("ros2:", &topics(&messages(0)), &Selection::default()).unwrap()
}

fn drain(pairs: &mut TopicPairs) -> Vec<Frame> {
    let frames = std::iter::from_fn(|| pairs.pop(0));
    frames.map(|frame| frame.unwrap()).collect()
}

#[test]
fn pairs_have_the_calibration_that_comes_after_them() {
    let mut pairs = pairs();
    let needed: Vec<_> = pairs.topics().map(str::to_owned).collect();
    let first = messages(0);
    assert_eq!(
        needed,
        topics(&first)
            .into_iter()
            .map(|topic| topic.name)
            .collect::<Vec<_>>()
    );
    let ready = first.iter().enumerate();
    let ready: Vec<_> = ready
        .map(|(i, message)| pairs.look_at(i, 0, &message.data))
        .collect();
    assert_eq!(ready, [false, false, false, true]);
    pairs.begin().unwrap();
    for message in first
        .iter()
        .enumerate()
        .chain(messages(1).iter().enumerate())
    {
        pairs.take_in(message.0, 0, &message.1.data).unwrap();
    }
    // A third left image has no partner.
    pairs.take_in(0, 0, &messages(2)[0].data).unwrap();
    pairs.end();
    let frames = drain(&mut pairs);
    assert_eq!(frames.len(), 2);
    for (i, frame) in (0..).zip(&frames) {
        assert_eq!(frame.stamp_ns, START_NS + i * PERIOD_NS);
        assert_eq!(frame.pair.left(), &image(SIZE, 2 * i));
        assert!((frame.rig().unwrap().baseline_m() - 0.1).abs() < 1e-9);
    }
    let facts = pairs.facts();
    assert_eq!(
        (pairs.counts(), facts.unpaired_ns.len(), facts.outside),
        ([3, 2], 0, 1)
    );
}

/// An empty image in that frame.
fn header(frame: &str) -> Vec<u8> {
    cdr_in(frame, START_NS, |cdr| {
        (0..2).for_each(|_| cdr.write_u32(0));
        cdr.write_string("mono8");
        cdr.write_u8(0);
        (0..2).for_each(|_| cdr.write_u32(0));
    })
}

#[test]
fn the_frame_is_that_of_the_left_images() {
    for (first, expected) in [([0, 1], "left"), ([1, 0], "left")] {
        let mut pairs = pairs();
        for topic in first {
            pairs.look_at(topic, 0, &header(["left", "right"][topic]));
        }
        pairs.begin().unwrap();
        assert_eq!(pairs.facts().frame_id.as_deref(), Some(expected));
        // A later frame changes nothing.
        drop(pairs.take_in(0, 0, &header("other")));
        assert_eq!(pairs.facts().frame_id.as_deref(), Some(expected));
    }
    let mut pairs = pairs();
    pairs.look_at(0, 0, &header(""));
    assert_eq!(pairs.facts().frame_id, None);
}

/// Calibrations without a baseline have that of the static transforms, as in a bag.
#[test]
fn the_baseline_is_in_the_static_transforms() {
    let stamp = START_NS;
    let pixels = image(SIZE, 0).pixels().collect::<Vec<u8>>();
    let image = |topic, frame| ros_image_in(frame, topic, stamp, SIZE, ("mono8", &pixels));
    let all = [
        image("/cam0/image_rect", "left"),
        image("/cam1/image_rect", "right"),
        camera_info("/cam0/camera_info", stamp, &[], 0.0),
        camera_info("/cam1/camera_info", stamp, &[], 0.0),
        tf("/tf_static", &[("left", "right", [0.12, 0.0, 0.0])]),
    ];
    for order in [[0, 1, 2, 3, 4], [4, 3, 2, 1, 0]] {
        let mut pairs = TopicPairs::new("ros2:", &topics(&all), &Selection::default()).unwrap();
        let ready = order.map(|i: usize| pairs.look_at(i, 0, &all[i].data));
        assert_eq!(ready, [false, false, false, false, true], "{order:?}");
        pairs.begin().unwrap();
        for i in order {
            pairs.take_in(i, 0, &all[i].data).unwrap();
        }
        let frames = drain(&mut pairs);
        assert!((frames[0].rig().unwrap().baseline_m() - 0.12).abs() < 1e-9);
    }
}

/// Without a baseline the reason is that of the static transforms, in a bag as live.
#[test]
fn a_baseline_that_is_missing_has_its_reason() {
    let fixture = Fixture::new();
    let pixels = image(SIZE, 0).pixels().collect::<Vec<u8>>();
    let camera = |images, frame, info, stamp| {
        let image = ros_image_in(frame, images, stamp, SIZE, ("mono8", &pixels));
        [camera_info(info, stamp, &[], 0.0), image]
    };
    let pair = |right: &'static str, stamp| {
        let left = camera("/cam0/image_rect", "l", "/cam0/camera_info", stamp);
        let right = camera("/cam1/image_rect", right, "/cam1/camera_info", stamp);
        left.into_iter().chain(right)
    };
    let at = |x| tf("/tf_static", &[("l", "r", [x, 0.0, 0.0])]);
    for (right, transforms, words) in [
        ("r", vec![], "no static transform leads from 'l' to 'r'"),
        ("l", vec![at(0.12)], "both cameras are in one frame, 'l'"),
        (
            "r",
            vec![at(-0.12)],
            "'r' is 0.120 m to the left of 'l': --left and --right",
        ),
        (
            "r",
            vec![tf("/tf_static", &[("l", "r", [0.12, 0.05, 0.0])])],
            "'r' is not beside 'l', but at (0.120, 0.050, 0.000) m",
        ),
        (
            "r",
            vec![at(0.12), at(0.24)],
            "the first, with a baseline of 0.1200 m, is used",
        ),
    ] {
        let pairs = pair(right, START_NS).chain(pair(right, START_NS + PERIOD_NS));
        let all: Vec<_> = transforms.into_iter().chain(pairs).collect();
        bag::write(&fixture.path(""), &all);
        let ran = fixture.svl("record bag.mcap -o x.mcap --force");
        assert_says(&ran.stderr, &[words]);
    }
    // Live, one that comes after the first pair is used no more.
    let first: Vec<_> = pair("r", START_NS).chain([at(0.12)]).collect();
    let mut late = TopicPairs::new("ros2:", &topics(&first), &Selection::default()).unwrap();
    let place = |topic: &str| late_place(&late, topic);
    let order: Vec<_> = first.iter().map(|message| place(message.topic)).collect();
    late.begin().unwrap();
    for (at, message) in order.into_iter().zip(&first) {
        late.take_in(at, 0, &message.data).unwrap();
    }
    assert!(late.facts().remarks[0].contains("disparities but no distances"));
}

fn late_place(pairs: &TopicPairs, topic: &str) -> usize {
    pairs.topics().position(|name| name == topic).unwrap()
}

#[test]
fn a_silent_camera_does_not_fill_the_memory() {
    let mut pairs = pairs();
    pairs.begin().unwrap();
    let size = (2048, 2048);
    let pixels = vec![0; size.0 * size.1];
    for i in 0..100 {
        let stamp = START_NS + i * PERIOD_NS;
        let image = ros_image("/cam0/image_rect", stamp, size, "mono8", &pixels);
        pairs.take_in(0, 0, &image.data).unwrap();
        assert!(drain(&mut pairs).is_empty());
    }
    // At most 128 MB of the 400 wait; the others were before any image of the right camera.
    let dropped = pairs.facts().outside;
    assert!((68..80).contains(&dropped), "{dropped}");
}

#[test]
fn cut_messages_are_errors_of_a_line() {
    let first = messages(0);
    for (topic, message) in first.iter().enumerate() {
        // The last byte of a calibration, do_rectify, is not read.
        for length in 0..message.data.len() - 1 {
            let mut pairs = pairs();
            let cut = &message.data[..length];
            pairs.look_at(topic, 0, cut);
            pairs.begin().unwrap();
            // Pixels that are missing are reported with the pair.
            let taken = pairs.take_in(topic, 0, cut);
            assert!(
                taken
                    .as_ref()
                    .is_err_and(|why| !why.to_string().contains('\n')),
                "{length} {taken:?}"
            );
        }
    }
    let format = "mono8; png compressed ";
    let compressed = ros_compressed("/cam0/image_rect", START_NS, format, b"no png");
    assert!(
        pairs().take_in(0, 0, &compressed.data).is_err(),
        "a topic that changes its type"
    );
}
