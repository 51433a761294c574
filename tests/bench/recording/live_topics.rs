//! Live topics without a network: pairs of the messages that a bag would hold.

use super::bag::{Bag, Message, SIZE, STEREO, cdr_in, ros_compressed, ros_image, tf, write_u32s};
use super::frames::{PERIOD_NS, START_NS, bare, stamp};
use super::says::Says;
use crate::cli::fixture::Fixture;
use svl::recording::{LiveTopic, Selection, TopicPairs};
use svl::stereo::Frame;

/// Pair `i` with its calibrations behind it.
fn messages(i: u64) -> [Message; 4] {
    let stereo = STEREO.offsets([0.0, -32.8]);
    let [[a, b], [c, d]] = [stereo.images(i), stereo.infos(stamp(i))];
    [a, b, c, d]
}

fn topics(messages: &[Message]) -> Vec<LiveTopic> {
    let topic = |message: &Message| LiveTopic {
        name: message.topic.to_owned(),
        schema: message.schema.to_owned(),
    };
    messages.iter().map(topic).collect()
}

fn pairs() -> TopicPairs {
    pairs_of(&messages(0))
}

/// Live topics of these messages.
pub(super) fn pairs_of(messages: &[Message]) -> TopicPairs {
    TopicPairs::new("ros2:", &topics(messages), &Selection::default()).unwrap()
}

fn drain(pairs: &mut TopicPairs) -> Vec<Frame> {
    let frames = std::iter::from_fn(|| pairs.pop(0));
    frames.map(|frame| frame.unwrap()).collect()
}

#[test]
fn pairs_have_the_calibration_that_comes_after_them() {
    let mut pairs = pairs();
    let first = messages(0);
    let names = topics(&first).into_iter().map(|topic| topic.name);
    assert!(pairs.topics().eq(names));
    let looks = first.iter().enumerate();
    let ready = looks.map(|(i, message)| pairs.look_at(i, 0, &message.data));
    assert_eq!(ready.collect::<Vec<_>>(), [false, false, false, true]);
    pairs.begin().unwrap();
    for messages in [first, messages(1)] {
        for (i, message) in messages.iter().enumerate() {
            pairs.take_in(i, 0, &message.data).unwrap();
        }
    }
    // A third left image has no partner.
    pairs.take_in(0, 0, &messages(2)[0].data).unwrap();
    pairs.end();
    let frames = drain(&mut pairs);
    assert_eq!(frames.len(), 2);
    for (i, frame) in (0..).zip(&frames) {
        assert_eq!(frame.stamp_ns, stamp(i));
        assert_eq!(frame.pair.left(), bare(i, SIZE).pair.left());
        assert!((frame.rig().unwrap().baseline_m() - 0.1).abs() < 1e-9);
    }
    let facts = pairs.facts();
    let counts = (pairs.counts(), facts.unpaired_ns.len(), facts.outside);
    assert_eq!(counts, ([3, 2], 0, 1));
}

/// An empty image in that frame.
fn header(frame: &str) -> Vec<u8> {
    cdr_in(frame, START_NS, |cdr| {
        write_u32s(cdr, [0; 2]);
        cdr.write_string("mono8");
        cdr.write_u8(0);
        write_u32s(cdr, [0; 2]);
    })
}

#[test]
fn the_frame_is_that_of_the_left_images() {
    for first in [[0, 1], [1, 0]] {
        let mut pairs = pairs();
        for topic in first {
            pairs.look_at(topic, 0, &header(["left", "right"][topic]));
        }
        pairs.begin().unwrap();
        assert_eq!(pairs.facts().frame_id.as_deref(), Some("left"));
        // A later frame changes nothing.
        drop(pairs.take_in(0, 0, &header("other")));
        assert_eq!(pairs.facts().frame_id.as_deref(), Some("left"));
    }
    let mut pairs = pairs();
    pairs.look_at(0, 0, &header(""));
    assert_eq!(pairs.facts().frame_id, None);
}

/// Pair `i` of cameras in these frames, calibrated without a baseline.
fn placed(i: u64, frames: [&str; 2]) -> [Message; 4] {
    let [left, right] = STEREO.in_frames(frames).images(i);
    let [left_info, right_info] = STEREO.offsets([0.0; 2]).infos(stamp(i));
    [left_info, left, right_info, right]
}

/// Calibrations without a baseline have that of the static transforms, as in a bag.
#[test]
fn the_baseline_is_in_the_static_transforms() {
    let [left_info, left, right_info, right] = placed(0, ["left", "right"]);
    let all = Bag::new([left, right, left_info, right_info]);
    let all = all.tf(&[("left", "right", [0.12, 0.0, 0.0])]);
    for order in [[0, 1, 2, 3, 4], [4, 3, 2, 1, 0]] {
        let mut pairs = pairs_of(&all.0);
        let ready = order.map(|i: usize| pairs.look_at(i, 0, &all.0[i].data));
        assert_eq!(ready, [false, false, false, false, true], "{order:?}");
        pairs.begin().unwrap();
        for i in order {
            pairs.take_in(i, 0, &all.0[i].data).unwrap();
        }
        let frames = drain(&mut pairs);
        assert!((frames[0].rig().unwrap().baseline_m() - 0.12).abs() < 1e-9);
    }
}

/// Without a baseline the reason is that of the static transforms, in a bag as live.
#[test]
fn a_baseline_that_is_missing_has_its_reason() {
    let fixture = Fixture::new();
    let at = |place| tf("/tf_static", &[("l", "r", place)]);
    let beside = |x| at([x, 0.0, 0.0]);
    let one_frame = "both cameras are in one frame, 'l'";
    let exchanged = "'r' is 0.120 m to the left of 'l': --left and --right";
    let elsewhere = "'r' is not beside 'l', but at (0.120, 0.050, 0.000) m";
    let first = "the first, with a baseline of 0.1200 m, is used";
    for (right, transforms, words) in [
        ("r", vec![], "no static transform leads from 'l' to 'r'"),
        ("l", vec![beside(0.12)], one_frame),
        ("r", vec![beside(-0.12)], exchanged),
        ("r", vec![at([0.12, 0.05, 0.0])], elsewhere),
        ("r", vec![beside(0.12), beside(0.24)], first),
    ] {
        let pairs = (0..2).flat_map(|i| placed(i, ["l", right]));
        Bag(transforms).and(pairs).write(&fixture);
        fixture.svl("record bag.mcap -o x.mcap --force").says(words);
    }
    // Live, one that comes after the first pair is used no more.
    let first = Bag::new(placed(0, ["l", "r"])).and([beside(0.12)]).0;
    let mut late = pairs_of(&first);
    let names: Vec<_> = late.topics().map(str::to_owned).collect();
    late.begin().unwrap();
    for message in &first {
        let place = names.iter().position(|name| name == message.topic);
        late.take_in(place.unwrap(), 0, &message.data).unwrap();
    }
    late.facts().remarks[0]
        .as_str()
        .says("disparities but no distances");
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
            let why = pairs.take_in(topic, 0, cut).unwrap_err().to_string();
            assert!(!why.contains('\n'), "{length} {why}");
        }
    }
    let format = "mono8; png compressed ";
    let compressed = ros_compressed("/cam0/image_rect", START_NS, format, b"no png");
    let taken = pairs().take_in(0, 0, &compressed.data);
    assert!(taken.is_err(), "a topic that changes its type");
}
