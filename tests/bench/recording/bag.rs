//! Small ROS 2 bags and Foxglove recordings, written without svl.

use re_cdr::{CdrWriter, LittleEndian};
use std::path::{Path, PathBuf};

/// A message: topic, schema, encoding, log time, bytes.
#[derive(Clone)]
pub(crate) struct Message {
    pub(crate) topic: &'static str,
    pub(crate) schema: &'static str,
    pub(crate) encoding: &'static str,
    pub(crate) log_time: u64,
    pub(crate) data: Vec<u8>,
}

impl Message {
    /// In CDR, like ROS 2.
    pub(crate) fn cdr(
        topic: &'static str,
        schema: &'static str,
        log_time: u64,
        data: Vec<u8>,
    ) -> Self {
        Self {
            topic,
            schema,
            encoding: "cdr",
            log_time,
            data,
        }
    }

    /// The message with other bytes.
    pub(crate) fn with(&self, data: Vec<u8>) -> Self {
        Self {
            data,
            ..self.clone()
        }
    }
}

/// Writes the messages in this order, in small chunks.
pub(crate) fn write(folder: &Path, messages: &[Message]) -> PathBuf {
    write_as(mcap::WriteOptions::new(), folder, messages, |_| {
        String::new()
    })
}

/// Same as [`write`], with the QoS of each topic's publisher as rosbag2 stores it.
pub(crate) fn write_with_qos(
    folder: &Path,
    messages: &[Message],
    qos: impl Fn(&str) -> String,
) -> PathBuf {
    write_as(mcap::WriteOptions::new(), folder, messages, qos)
}

/// Same as [`write`], like ROS 2's own recorder: without compression and without checksums.
pub(crate) fn write_unchecked(folder: &Path, messages: &[Message]) -> PathBuf {
    let options = mcap::WriteOptions::new()
        .compression(None)
        .calculate_chunk_crcs(false);
    write_as(
        options
            .calculate_data_section_crc(false)
            .calculate_summary_section_crc(false),
        folder,
        messages,
        |_| String::new(),
    )
}

/// Same as [`write`], with a summary that does not repeat what the chunks declare.
pub(crate) fn write_unrepeated(folder: &Path, messages: &[Message]) -> PathBuf {
    let options = mcap::WriteOptions::new();
    let options = options.repeat_channels(false).repeat_schemas(false);
    write_as(options, folder, messages, |_| String::new())
}

fn write_as(
    options: mcap::WriteOptions,
    folder: &Path,
    messages: &[Message],
    qos: impl Fn(&str) -> String,
) -> PathBuf {
    let path = folder.join("bag.mcap");
    let file = std::io::BufWriter::new(std::fs::File::create(&path).unwrap());
    let mut writer = options
        .profile("ros2")
        .chunk_size(Some(4096))
        .create(file)
        .unwrap();
    for message in messages {
        let schema = writer
            .add_schema(message.schema, "some", b"definition")
            .unwrap();
        let qos = Some(qos(message.topic)).filter(|qos| !qos.is_empty());
        let metadata = qos.map(|qos| ("offered_qos_profiles".to_owned(), qos));
        let metadata = metadata.into_iter().collect();
        let channel_id = writer
            .add_channel(schema, message.topic, message.encoding, &metadata)
            .unwrap();
        let header = mcap::records::MessageHeader {
            channel_id,
            sequence: 7,
            log_time: message.log_time,
            publish_time: message.log_time + 1,
        };
        writer
            .write_to_known_channel(&header, &message.data)
            .unwrap();
    }
    writer.finish().unwrap();
    path
}

/// Same as [`write`], in SQLite as ROS 2's recorder and the RealSense SDK do.
pub(crate) fn write_sqlite(folder: &Path, messages: &[Message]) -> PathBuf {
    let path = folder.join("bag.db3");
    let mut connection = rusqlite::Connection::open(&path).unwrap();
    let tables = "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT \
                  NULL, serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);
                  CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, \
                  timestamp INTEGER NOT NULL, data BLOB NOT NULL);";
    connection.execute_batch(tables).unwrap();
    let rows = connection.transaction().unwrap();
    let mut topics: Vec<&str> = Vec::new();
    for message in messages {
        let known = topics.iter().position(|topic| *topic == message.topic);
        let id = known.unwrap_or_else(|| {
            let topic = (
                topics.len() as i64,
                message.topic,
                message.schema,
                message.encoding,
            );
            rows.execute("INSERT INTO topics VALUES(?, ?, ?, ?, '')", topic)
                .unwrap();
            topics.push(message.topic);
            topics.len() - 1
        });
        let row = (id as i64, message.log_time as i64, &message.data);
        rows.execute(
            "INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)",
            row,
        )
        .unwrap();
    }
    rows.commit().unwrap();
    path
}

/// A std_msgs/msg/String.
pub(crate) fn string(topic: &'static str, text: &str) -> Message {
    let mut data = vec![0, 1, 0, 0];
    CdrWriter::<LittleEndian>::new(&mut data).write_string(text);
    Message::cdr(topic, "std_msgs/msg/String", 1, data)
}

/// The message compressed on its own, as rosbag2 does.
pub(crate) fn packed(message: &Message) -> Message {
    message.with(zstd::bulk::compress(&message.data, 1).unwrap())
}

/// A PNG of 8 or 16 bits.
pub(crate) fn png<T>((width, height): (usize, usize), pixels: &[T]) -> Vec<u8>
where
    T: image::Primitive,
    image::Luma<T>: image::PixelWithColorType<Subpixel = T>,
    [T]: image::EncodableLayout,
{
    let (width, height) = (width as u32, height as u32);
    let image = image::ImageBuffer::<image::Luma<T>, _>::from_raw(width, height, pixels).unwrap();
    let mut png = std::io::Cursor::new(Vec::new());
    image.write_to(&mut png, image::ImageFormat::Png).unwrap();
    png.into_inner()
}

fn cdr(stamp: u64, write: impl FnOnce(&mut CdrWriter<'_, LittleEndian>)) -> Vec<u8> {
    cdr_in("cam", stamp, write)
}

/// A message with a header of that frame.
pub(crate) fn cdr_in(
    frame: &str,
    stamp: u64,
    write: impl FnOnce(&mut CdrWriter<'_, LittleEndian>),
) -> Vec<u8> {
    let mut data = vec![0, 1, 0, 0];
    let mut cdr = CdrWriter::<LittleEndian>::new(&mut data);
    cdr.write_u32((stamp / 1_000_000_000) as u32);
    cdr.write_u32((stamp % 1_000_000_000) as u32);
    cdr.write_string(frame);
    write(&mut cdr);
    data
}

/// A sensor_msgs/msg/Image, logged a while after its stamp.
pub(crate) fn ros_image(
    topic: &'static str,
    stamp: u64,
    size: (usize, usize),
    encoding: &str,
    pixels: &[u8],
) -> Message {
    ros_image_in("cam", topic, stamp, size, (encoding, pixels))
}

/// Same as [`ros_image`], of a camera with that frame.
pub(crate) fn ros_image_in(
    frame: &str,
    topic: &'static str,
    stamp: u64,
    (width, height): (usize, usize),
    (encoding, pixels): (&str, &[u8]),
) -> Message {
    let data = cdr_in(frame, stamp, |cdr| {
        cdr.write_u32(height as u32);
        cdr.write_u32(width as u32);
        cdr.write_string(encoding);
        cdr.write_u8(0);
        cdr.write_u32((pixels.len() / height.max(1)) as u32);
        cdr.write_bytes(pixels);
    });
    Message::cdr(topic, "sensor_msgs/msg/Image", stamp + 1_234_567, data)
}

/// A sensor_msgs/msg/CompressedImage.
pub(crate) fn ros_compressed(
    topic: &'static str,
    stamp: u64,
    format: &str,
    bytes: &[u8],
) -> Message {
    ros_compressed_in("cam", topic, stamp, format, bytes)
}

pub(crate) fn ros_compressed_in(
    frame: &str,
    topic: &'static str,
    stamp: u64,
    format: &str,
    bytes: &[u8],
) -> Message {
    let data = cdr_in(frame, stamp, |cdr| {
        cdr.write_string(format);
        cdr.write_bytes(bytes);
    });
    Message::cdr(topic, "sensor_msgs/msg/CompressedImage", stamp, data)
}

/// A foxglove.CompressedVideo in protobuf.
pub(crate) fn foxglove_video(
    topic: &'static str,
    stamp: u64,
    format: &str,
    bytes: &[u8],
) -> Message {
    let video = foxglove::messages::CompressedVideo {
        timestamp: timestamp(stamp),
        frame_id: "cam".to_owned(),
        data: bytes.to_vec().into(),
        format: format.to_owned(),
    };
    protobuf(topic, "foxglove.CompressedVideo", stamp, &video)
}

/// A foxglove_msgs/msg/CompressedVideo.
pub(crate) fn ros_video(topic: &'static str, stamp: u64, format: &str, bytes: &[u8]) -> Message {
    let data = cdr(stamp, |cdr| {
        cdr.write_bytes(bytes);
        cdr.write_string(format);
    });
    Message::cdr(topic, "foxglove_msgs/msg/CompressedVideo", stamp, data)
}

/// An ffmpeg_image_transport_msgs/msg/FFMPEGPacket.
pub(crate) fn ffmpeg_packet(
    topic: &'static str,
    stamp: u64,
    encoding: &str,
    bytes: &[u8],
) -> Message {
    let data = cdr(stamp, |cdr| {
        [64, 48].into_iter().for_each(|side| cdr.write_u32(side));
        cdr.write_string(encoding);
        cdr.write_u64(stamp / 1000);
        [1, 0].into_iter().for_each(|byte| cdr.write_u8(byte));
        cdr.write_bytes(bytes);
    });
    let schema = "ffmpeg_image_transport_msgs/msg/FFMPEGPacket";
    Message::cdr(topic, schema, stamp, data)
}

/// Fields of a sensor_msgs/msg/CameraInfo.
#[derive(Clone, Copy)]
pub(crate) struct Camera<'a> {
    pub(crate) frame: &'a str,
    pub(crate) size: (u32, u32),
    /// Focal length and principal point of K.
    pub(crate) k: [f64; 3],
    pub(crate) model: &'a str,
    pub(crate) d: &'a [f64],
    pub(crate) p: [f64; 3],
    /// Fourth column of P.
    pub(crate) tx: f64,
    pub(crate) binning: u32,
    /// Left and upper side, height and width.
    pub(crate) roi: [u32; 4],
}

/// A camera of 24x16.
pub(crate) const CAMERA: Camera<'_> = Camera {
    frame: "cam",
    size: (24, 16),
    k: [328.0, 12.0, 8.0],
    model: "plumb_bob",
    d: &[],
    p: [328.0, 12.0, 8.0],
    tx: 0.0,
    binning: 0,
    roi: [0; 4],
};

/// A sensor_msgs/msg/CameraInfo of 24x16 with these distortion coefficients and this fourth column
/// of P.
pub(crate) fn camera_info(topic: &'static str, stamp: u64, d: &[f64], tx: f64) -> Message {
    camera_info_of(topic, stamp, &Camera { d, tx, ..CAMERA })
}

pub(crate) fn camera_info_of(topic: &'static str, stamp: u64, camera: &Camera<'_>) -> Message {
    let &Camera { size, d, tx, .. } = camera;
    let ([f, cx, cy], [pf, px, py]) = (camera.k, camera.p);
    let data = cdr_in(camera.frame, stamp, |cdr| {
        cdr.write_u32(size.1);
        cdr.write_u32(size.0);
        cdr.write_string(camera.model);
        cdr.write_sequence_length(d.len());
        let k = [f, 0.0, cx, 0.0, f, cy, 0.0, 0.0, 1.0];
        let r = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        let p = [pf, 0.0, px, tx, 0.0, pf, py, 0.0, 0.0, 0.0, 1.0, 0.0];
        let numbers = d.iter().chain(&k).chain(&r).chain(&p);
        numbers.for_each(|&v| cdr.write_f64(v));
        let rest = [camera.binning; 2].into_iter().chain(camera.roi);
        rest.for_each(|v| cdr.write_u32(v));
        cdr.write_bool(false);
    });
    Message::cdr(topic, "sensor_msgs/msg/CameraInfo", stamp, data)
}

pub(crate) fn timestamp(stamp: u64) -> Option<foxglove::messages::Timestamp> {
    Some(foxglove::messages::Timestamp::new(
        (stamp / 1_000_000_000) as u32,
        (stamp % 1_000_000_000) as u32,
    ))
}

pub(crate) fn protobuf<T: foxglove::Encode>(
    topic: &'static str,
    schema: &'static str,
    log_time: u64,
    message: &T,
) -> Message {
    let mut data = Vec::new();
    message.encode(&mut data).unwrap();
    Message {
        topic,
        schema,
        encoding: "protobuf",
        log_time,
        data,
    }
}

/// A foxglove.RawImage in protobuf, of an encoding with a byte per pixel in a row.
pub(crate) fn foxglove_raw(
    topic: &'static str,
    stamp: u64,
    (width, height): (usize, usize),
    (encoding, pixels): (&str, &[u8]),
) -> Message {
    let (width, height, data) = (width as u32, height as u32, pixels.to_vec().into());
    let (timestamp, encoding) = (timestamp(stamp), encoding.to_owned());
    let image = foxglove::messages::RawImage {
        timestamp,
        width,
        height,
        encoding,
        step: width,
        data,
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
    let (timestamp, data, format) = (timestamp(stamp), bytes.to_vec().into(), format.to_owned());
    let image = foxglove::messages::CompressedImage {
        timestamp,
        frame_id: "cam".to_owned(),
        data,
        format,
    };
    protobuf(topic, "foxglove.CompressedImage", stamp, &image)
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
        "R": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        "P": [328.0, 0.0, 12.0, tx, 0.0, 328.0, 8.0, 0.0, 0.0, 0.0, 1.0, 0.0],
    });
    let data = data.to_string().into_bytes();
    Message {
        topic,
        schema: "foxglove.CameraCalibration",
        encoding: "json",
        log_time: stamp,
        data,
    }
}

/// A foxglove.RawImage in JSON, mono8.
pub(crate) fn json_raw(
    topic: &'static str,
    stamp: u64,
    (width, height): (usize, usize),
    pixels: &[u8],
) -> Message {
    use base64::Engine as _;
    let data = serde_json::json!({
        "timestamp": {"sec": stamp / 1_000_000_000, "nsec": stamp % 1_000_000_000},
        "frame_id": "cam", "width": width, "height": height, "encoding": "mono8", "step": width,
        "data": base64::engine::general_purpose::STANDARD.encode(pixels),
    });
    let data = data.to_string().into_bytes();
    Message {
        topic,
        schema: "foxglove.RawImage",
        encoding: "json",
        log_time: stamp,
        data,
    }
}
