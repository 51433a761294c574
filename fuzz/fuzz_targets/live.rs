//! Messages of live ROS 2 topics in CDR, with any bytes in them, as pairs are formed of them.
//!
//! The input begins with a byte that chooses the topics' types, and one for the number of messages
//! before the first pair is decided. Messages follow: a byte that chooses the topic, one for the
//! time, two of length, and that many bytes.
#![no_main]

use svl::recording::{LiveTopic, Selection, TopicPairs};

const IMAGES: [&str; 2] = ["sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"];

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let [types, ahead, bytes @ ..] = bytes else {
        return;
    };
    let image = |side: usize| IMAGES[usize::from(types >> side) & 1];
    let name = ["image_raw", "image_rect"][usize::from(types >> 2) & 1];
    let info = "sensor_msgs/msg/CameraInfo";
    let topics = [
        (format!("/left/{name}"), image(0)),
        (format!("/right/{name}"), image(1)),
        ("/left/camera_info".to_owned(), info),
        ("/right/camera_info".to_owned(), info),
    ];
    let topics = topics.map(|(name, schema)| LiveTopic {
        name,
        schema: schema.to_owned(),
    });
    let mut pairs =
        TopicPairs::new("ros2:", &topics, &Selection::default()).expect("a left and a right topic");
    let count = pairs.topics().count();
    let messages = messages(bytes, count);
    let ahead = messages.len().min(usize::from(*ahead));
    for (topic, _, data) in &messages[..ahead] {
        pairs.look_at(*topic, 0, data);
    }
    // Bits beyond those of the images are refused.
    if pairs.begin().is_err() {
        return;
    }
    let mut images = 0;
    let mut pop = |pairs: &mut TopicPairs, now_ns: u64| {
        while let Some(pair) = pairs.pop(now_ns) {
            images += 2;
            if let Ok(frame) = pair {
                let [left, right] = frame.pair.into_images();
                assert_eq!(left.pixels().count(), right.pixels().count());
            }
        }
    };
    for (i, (topic, received_ns, data)) in (0_u64..).zip(&messages) {
        // The reason why it cannot be read.
        let _ = pairs.take_in(*topic, *received_ns, data);
        pop(&mut pairs, 20_000_000 * i);
    }
    pairs.end();
    pop(&mut pairs, u64::MAX);
    let facts = pairs.facts();
    let left_over = facts.unpaired_ns.len() as u64 + facts.outside;
    let received: u64 = pairs.counts().iter().sum();
    assert!(images + left_over <= received && received <= messages.len() as u64);
});

/// Topic, time and bytes of each message.
fn messages(mut bytes: &[u8], topics: usize) -> Vec<(usize, u64, &[u8])> {
    let mut messages = Vec::new();
    while let [topic, time, low, high, rest @ ..] = bytes {
        let length = usize::from(u16::from_le_bytes([*low, *high])).min(rest.len());
        let (data, rest) = rest.split_at(length);
        messages.push((usize::from(*topic) % topics, u64::from(*time), data));
        bytes = rest;
    }
    messages
}
