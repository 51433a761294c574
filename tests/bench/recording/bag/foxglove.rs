//! Messages of Foxglove, in protobuf and JSON.

use super::Message;
use foxglove::messages as fox;

/// Seconds and nanoseconds of a stamp.
fn parts(stamp: u64) -> [u32; 2] {
    [stamp / 1_000_000_000, stamp % 1_000_000_000].map(|part| part as u32)
}

pub(crate) fn timestamp(stamp: u64) -> Option<fox::Timestamp> {
    let [seconds, nanoseconds] = parts(stamp);
    Some(fox::Timestamp::new(seconds, nanoseconds))
}

pub(crate) fn protobuf<T: foxglove::Encode>(
    topic: &'static str,
    schema: &'static str,
    log_time: u64,
    message: &T,
) -> Message {
    let mut data = Vec::new();
    message.encode(&mut data).unwrap();
    encoded("protobuf", Message::cdr(topic, schema, log_time, data))
}

fn json(
    topic: &'static str,
    schema: &'static str,
    log_time: u64,
    message: &serde_json::Value,
) -> Message {
    let data = message.to_string().into_bytes();
    encoded("json", Message::cdr(topic, schema, log_time, data))
}

fn encoded(encoding: &'static str, mut message: Message) -> Message {
    message.encoding = encoding;
    message
}

/// A foxglove.RawImage in protobuf, of an encoding with a byte per pixel in a row.
pub(crate) fn foxglove_raw(
    topic: &'static str,
    stamp: u64,
    (width, height): (usize, usize),
    (encoding, pixels): (&str, &[u8]),
) -> Message {
    let image = fox::RawImage {
        timestamp: timestamp(stamp),
        width: width as u32,
        height: height as u32,
        encoding: encoding.to_owned(),
        step: width as u32,
        data: pixels.to_vec().into(),
        ..Default::default()
    };
    protobuf(topic, "foxglove.RawImage", stamp, &image)
}

/// A foxglove.CompressedImage in protobuf.
pub(crate) fn foxglove_compressed(
    topic: &'static str,
    stamp: u64,
    format: &str,
    bytes: &[u8],
) -> Message {
    let image = fox::CompressedImage {
        timestamp: timestamp(stamp),
        frame_id: "cam".to_owned(),
        data: bytes.to_vec().into(),
        format: format.to_owned(),
    };
    protobuf(topic, "foxglove.CompressedImage", stamp, &image)
}

/// A foxglove.CompressedVideo in protobuf.
pub(crate) fn foxglove_video(
    topic: &'static str,
    stamp: u64,
    format: &str,
    bytes: &[u8],
) -> Message {
    let video = fox::CompressedVideo {
        timestamp: timestamp(stamp),
        frame_id: "cam".to_owned(),
        data: bytes.to_vec().into(),
        format: format.to_owned(),
    };
    protobuf(topic, "foxglove.CompressedVideo", stamp, &video)
}

/// A foxglove.CameraCalibration in JSON, of a focal length of 328 and a centre of (12, 8).
pub(crate) fn json_calibration(
    topic: &'static str,
    stamp: u64,
    (width, height): (u32, u32),
    tx: f64,
) -> Message {
    let data = serde_json::json!({
        "width": width, "height": height, "distortion_model": "plumb_bob", "D": [],
        "K": [328.0, 0.0, 12.0, 0.0, 328.0, 8.0, 0.0, 0.0, 1.0],
        "R": super::IDENTITY,
        "P": [328.0, 0.0, 12.0, tx, 0.0, 328.0, 8.0, 0.0, 0.0, 0.0, 1.0, 0.0],
    });
    json(topic, "foxglove.CameraCalibration", stamp, &data)
}

/// A foxglove.RawImage in JSON, mono8.
pub(crate) fn json_raw(
    topic: &'static str,
    stamp: u64,
    (width, height): (usize, usize),
    pixels: &[u8],
) -> Message {
    use base64::Engine as _;
    let [sec, nsec] = parts(stamp);
    let data = serde_json::json!({
        "timestamp": {"sec": sec, "nsec": nsec},
        "frame_id": "cam", "width": width, "height": height, "encoding": "mono8", "step": width,
        "data": base64::engine::general_purpose::STANDARD.encode(pixels),
    });
    json(topic, "foxglove.RawImage", stamp, &data)
}
