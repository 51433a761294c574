//! Messages of ROS 2.

use super::Message;
use crate::recording::frames::{START_NS, stamp};
use re_cdr::{CdrWriter, LittleEndian};
use svl::stereo::Plane;

pub(crate) type Cdr<'a> = CdrWriter<'a, LittleEndian>;

/// A message without a header.
fn cdr(write: impl FnOnce(&mut Cdr<'_>)) -> Vec<u8> {
    let mut data = vec![0, 1, 0, 0];
    write(&mut CdrWriter::new(&mut data));
    data
}

/// A message with a header of that frame.
pub(crate) fn cdr_in(frame: &str, stamp: u64, write: impl FnOnce(&mut Cdr<'_>)) -> Vec<u8> {
    cdr(|cdr| {
        write_header(cdr, frame, stamp);
        write(cdr);
    })
}

fn write_header(cdr: &mut Cdr<'_>, frame: &str, stamp: u64) {
    let parts = [stamp / 1_000_000_000, stamp % 1_000_000_000];
    write_u32s(cdr, parts.map(|part| part as u32));
    cdr.write_string(frame);
}

pub(crate) fn write_u32s(cdr: &mut Cdr<'_>, values: impl IntoIterator<Item = u32>) {
    values.into_iter().for_each(|value| cdr.write_u32(value));
}

pub(crate) fn write_f64s<'a>(cdr: &mut Cdr<'_>, values: impl IntoIterator<Item = &'a f64>) {
    values.into_iter().for_each(|value| cdr.write_f64(*value));
}

/// A std_msgs/msg/String.
pub(crate) fn string(topic: &'static str, text: &str) -> Message {
    let data = cdr(|cdr| cdr.write_string(text));
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
        write_u32s(cdr, [height as u32, width as u32]);
        cdr.write_string(encoding);
        cdr.write_u8(0);
        cdr.write_u32((pixels.len() / height.max(1)) as u32);
        cdr.write_bytes(pixels);
    });
    Message::cdr(topic, "sensor_msgs/msg/Image", stamp + 1_234_567, data)
}

/// An image of 32-bit floats, as depths in metres.
pub(crate) fn float_image(
    frame: &str,
    topic: &'static str,
    stamp: u64,
    map: &Plane<f32>,
) -> Message {
    let bytes: Vec<u8> = map.pixels().flat_map(f32::to_le_bytes).collect();
    ros_image_in(frame, topic, stamp, map.size(), ("32FC1", &bytes))
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

/// A foxglove_msgs/msg/CompressedVideo.
pub(crate) fn ros_video(topic: &'static str, stamp: u64, format: &str, bytes: &[u8]) -> Message {
    let data = cdr_in("cam", stamp, |cdr| {
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
    let data = cdr_in("cam", stamp, |cdr| {
        write_u32s(cdr, [64, 48]);
        cdr.write_string(encoding);
        cdr.write_u64(stamp / 1000);
        [1, 0].into_iter().for_each(|byte| cdr.write_u8(byte));
        cdr.write_bytes(bytes);
    });
    let schema = "ffmpeg_image_transport_msgs/msg/FFMPEGPacket";
    Message::cdr(topic, schema, stamp, data)
}

pub(crate) const IDENTITY: [f64; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];

/// Fields of a sensor_msgs/msg/CameraInfo.
#[derive(Clone, Copy)]
pub(crate) struct Camera<'a> {
    pub(crate) frame: &'a str,
    pub(crate) size: (u32, u32),
    /// Focal length and principal point of K.
    pub(crate) k: [f64; 3],
    pub(crate) model: &'a str,
    pub(crate) d: &'a [f64],
    pub(crate) r: [f64; 9],
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
    r: IDENTITY,
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
    let &Camera { size, d, r, tx, .. } = camera;
    let ([f, cx, cy], [pf, px, py]) = (camera.k, camera.p);
    // K of a camera that was never calibrated has zeros alone.
    let one = if f > 0.0 { 1.0 } else { 0.0 };
    let k = [f, 0.0, cx, 0.0, f, cy, 0.0, 0.0, one];
    let p = [pf, 0.0, px, tx, 0.0, pf, py, 0.0, 0.0, 0.0, one, 0.0];
    let data = cdr_in(camera.frame, stamp, |cdr| {
        write_u32s(cdr, [size.1, size.0]);
        cdr.write_string(camera.model);
        cdr.write_sequence_length(d.len());
        write_f64s(cdr, d.iter().chain(&k).chain(&r).chain(&p));
        let rest = [camera.binning; 2].into_iter().chain(camera.roi);
        write_u32s(cdr, rest);
        cdr.write_bool(false);
    });
    Message::cdr(topic, "sensor_msgs/msg/CameraInfo", stamp, data)
}

/// A rotation by nothing, as x, y, z, w.
pub(crate) const PARALLEL: [f64; 4] = [0.0, 0.0, 0.0, 1.0];
/// From the axes of a robot (x forward, z up) to those of a camera (REP 103).
pub(crate) const OPTICAL: [f64; 4] = [-0.5, 0.5, -0.5, 0.5];

/// Parent and child frame, translation in metres, rotation.
pub(crate) type Link<'a> = (&'a str, &'a str, [f64; 3], [f64; 4]);

/// A tf2_msgs/msg/TFMessage of translations, with stamps of 0.
pub(crate) fn tf(topic: &'static str, links: &[(&str, &str, [f64; 3])]) -> Message {
    let links = links.iter().map(|(a, b, at)| (*a, *b, *at, PARALLEL));
    transforms(topic, 0, &links.collect::<Vec<_>>()).logged(START_NS)
}

/// A tf2_msgs/msg/TFMessage, logged at its stamp.
pub(crate) fn transforms(topic: &'static str, stamp: u64, links: &[Link<'_>]) -> Message {
    let data = cdr(|cdr| {
        cdr.write_sequence_length(links.len());
        for (parent, child, translation, rotation) in links {
            write_header(cdr, parent, stamp);
            cdr.write_string(child);
            write_f64s(cdr, translation.iter().chain(rotation));
        }
    });
    Message::cdr(topic, "tf2_msgs/msg/TFMessage", stamp, data)
}

/// A depth image of `/depth` that belongs to pair `i`.
pub(crate) fn depth32(
    i: u64,
    (width, height): (usize, usize),
    depth: impl Fn(usize, usize) -> f32,
) -> Message {
    let map = Plane::from_fn(width, height, depth).unwrap();
    float_image("cam", "/depth", stamp(i), &map)
}

/// A stereo_msgs/msg/DisparityImage; focal length, baseline, least and largest disparity.
pub(crate) fn disparity_image(
    stamp: u64,
    map: &Plane<f32>,
    [focal, baseline, min, max]: [f32; 4],
) -> Message {
    let pixels: Vec<u8> = map.pixels().flat_map(f32::to_le_bytes).collect();
    let (width, height) = (map.width() as u32, map.height() as u32);
    let data = cdr_in("cam", stamp, |cdr| {
        write_header(cdr, "cam", 0);
        write_u32s(cdr, [height, width]);
        cdr.write_string("32FC1");
        cdr.write_u8(0);
        cdr.write_u32(4 * width);
        cdr.write_bytes(&pixels);
        [focal, baseline].iter().for_each(|v| cdr.write_f32(*v));
        write_u32s(cdr, [0; 4]);
        cdr.write_bool(false);
        [min, max, 0.1].iter().for_each(|v| cdr.write_f32(*v));
    });
    let schema = "stereo_msgs/msg/DisparityImage";
    Message::cdr("/disparity", schema, stamp, data)
}

/// A sensor_msgs/msg/PointCloud2 of x, y, z as 32-bit floats, on `/points`.
pub(crate) fn cloud(frame: &str, stamp: u64, points: &[[f32; 3]]) -> Message {
    cloud_with(frame, stamp, points, false, 12 * points.len() as u32)
}

/// Same as [`cloud`], in this order of bytes and with rows of that length.
pub(crate) fn cloud_with(
    frame: &str,
    stamp: u64,
    points: &[[f32; 3]],
    big_endian: bool,
    row_step: u32,
) -> Message {
    let values = points.iter().flatten();
    let bytes: Vec<u8> = values.flat_map(|v| v.to_le_bytes()).collect();
    let data = cdr_in(frame, stamp, |cdr| {
        write_u32s(cdr, [1, points.len() as u32]);
        cdr.write_sequence_length(3);
        for (name, offset) in [("x", 0), ("y", 4), ("z", 8)] {
            cdr.write_string(name);
            cdr.write_u32(offset);
            cdr.write_u8(7);
            cdr.write_u32(1);
        }
        cdr.write_bool(big_endian);
        write_u32s(cdr, [12, row_step]);
        cdr.write_bytes(&bytes);
        cdr.write_bool(true);
    });
    Message::cdr("/points", "sensor_msgs/msg/PointCloud2", stamp, data)
}
