//! Messages of the scene that all drivers show: a wall of noise, parallel to the cameras.

use crate::recording::bag::{Message, cdr_in, ros_image_in};
use re_cdr::{CdrWriter, LittleEndian};
use svl::stereo::Gray;

pub(super) const SIZE: (usize, usize) = (160, 120);
pub(super) const FOCAL_PX: f64 = 150.0;
pub(super) const CENTER_PX: (f64, f64) = (79.5, 59.5);
pub(super) const BASELINE_M: f64 = 0.1;
/// Even, so that both images of a mosaic have the same phase.
const DISPARITY_PX: usize = 10;
pub(super) const DEPTH_M: f64 = FOCAL_PX * BASELINE_M / DISPARITY_PX as f64;
pub(super) const PAIRS: u64 = 6;
/// Nanoseconds from a pair to the next: 30 a second.
const PERIOD_NS: u64 = 33_333_333;

/// Distortion of raw cameras, model and coefficients: 0.03 px at the border, so that the images
/// need not be distorted.
const DISTORTION: (&str, &[f64]) = ("plumb_bob", &[-0.001, 0.0, 0.0, 0.0, 0.0]);
/// That of the drivers that publish rational_polynomial.
pub(super) const RATIONAL: (&str, &[f64]) = (
    "rational_polynomial",
    &[0.299, 0.0, 0.0, 0.0, 0.0, 0.3, 0.0, 0.0],
);

pub(super) fn stamp(i: u64) -> u64 {
    1_700_000_000_000_000_000 + i * PERIOD_NS
}

/// The left (0) or right (1) image of a pair.
pub(super) fn grey(side: usize, i: u64) -> Gray {
    let noise = |x: usize, y: usize| {
        let mixed = (x as u64 * 7919 + y as u64 * 104_729 + i * 15_485_863 + 12_345)
            .wrapping_mul(0x9E37_79B9_7F4A_7C15);
        (mixed >> 56) as u8
    };
    let (width, height) = SIZE;
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x + side * DISPARITY_PX, y)));
    let pixels = pixels.map(|(x, y)| noise(x, y)).collect();
    Gray::from_vec(width, height, pixels).unwrap()
}

/// The grey image in an encoding.
fn encoded(grey: &Gray, encoding: &str) -> Vec<u8> {
    let each = |pixel: fn(u8) -> Vec<u8>| grey.pixels().flat_map(pixel).collect();
    match encoding {
        "rgb8" => each(|y| vec![y; 3]),
        "bgra8" => each(|y| vec![y, y, y, 255]),
        "mono16" => each(|y| vec![0, y]),
        "yuv422" => each(|y| vec![128, y]),
        "nv12" => {
            let mut bytes: Vec<u8> = grey.pixels().collect();
            bytes.resize(bytes.len() * 3 / 2, 128);
            bytes
        }
        // Grey, and a mosaic of grey things.
        _ => each(|y| vec![y]),
    }
}

/// A sensor_msgs/msg/Image of the left (0) or right (1) camera.
pub(super) fn image(
    topic: &'static str,
    frame: &str,
    (side, i): (usize, u64),
    encoding: &str,
) -> Message {
    image_at(topic, frame, (side, i), encoding, stamp(i))
}

/// Same as [`image`], at another time.
pub(super) fn image_at(
    topic: &'static str,
    frame: &str,
    (side, i): (usize, u64),
    encoding: &str,
    stamp_ns: u64,
) -> Message {
    let pixels = encoded(&grey(side, i), encoding);
    let image = ros_image_in(frame, topic, stamp_ns, SIZE, (encoding, &pixels));
    if encoding != "nv12" {
        return image;
    }
    // The step is that of the luma.
    let data = cdr_in(frame, stamp_ns, |cdr| {
        [SIZE.1, SIZE.0]
            .into_iter()
            .for_each(|side| cdr.write_u32(side as u32));
        cdr.write_string(encoding);
        cdr.write_u8(0);
        cdr.write_u32(SIZE.0 as u32);
        cdr.write_bytes(&pixels);
    });
    image.with(data)
}

/// A depth image of the wall: `16UC1` in millimetres, `32FC1` in metres.
pub(super) fn depth(topic: &'static str, frame: &str, i: u64, encoding: &str) -> Message {
    let pixel = match encoding {
        "16UC1" => ((DEPTH_M * 1000.0) as u16).to_le_bytes().to_vec(),
        _ => (DEPTH_M as f32).to_le_bytes().to_vec(),
    };
    let bytes = pixel.repeat(SIZE.0 * SIZE.1);
    ros_image_in(frame, topic, stamp(i), SIZE, (encoding, &bytes))
}

/// Fields of a sensor_msgs/msg/CameraInfo.
#[derive(Clone, Copy)]
pub(super) struct Info {
    pub(super) size: (usize, usize),
    pub(super) distortion: (&'static str, &'static [f64]),
    /// Focal lengths of K and of P, pixels.
    pub(super) focal_px: [f64; 2],
    pub(super) center_px: (f64, f64),
    pub(super) r: [f64; 9],
    /// Fourth column of P, pixels times metres.
    pub(super) tx: f64,
}

pub(super) const IDENTITY: [f64; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];

/// A rectified camera, without a baseline.
pub(super) const RECTIFIED: Info = Info {
    size: SIZE,
    distortion: ("plumb_bob", &[0.0; 5]),
    focal_px: [FOCAL_PX; 2],
    center_px: CENTER_PX,
    r: IDENTITY,
    tx: 0.0,
};

/// A raw camera, without a baseline.
pub(super) const RAW: Info = Info {
    distortion: DISTORTION,
    ..RECTIFIED
};

/// A raw camera of DepthAI, Azure Kinect or Isaac ROS.
pub(super) const RAW_RATIONAL: Info = Info {
    distortion: RATIONAL,
    ..RECTIFIED
};

/// A camera that was never calibrated, as camera_info_manager publishes it.
pub(super) const UNCALIBRATED: Info = Info {
    distortion: ("", &[]),
    focal_px: [0.0; 2],
    center_px: (0.0, 0.0),
    r: [0.0; 9],
    ..RECTIFIED
};

/// A camera of a model that svl does not know.
pub(super) const UNKNOWN: Info = Info {
    distortion: ("double_sphere", &[-0.2, 0.6]),
    ..RECTIFIED
};

impl Info {
    /// The right camera of a pair.
    pub(super) fn right(self) -> Self {
        Self {
            tx: -self.focal_px[1] * BASELINE_M,
            ..self
        }
    }

    pub(super) fn message(&self, topic: &'static str, frame: &str, i: u64) -> Message {
        self.message_at(topic, frame, stamp(i))
    }

    pub(super) fn message_at(&self, topic: &'static str, frame: &str, stamp_ns: u64) -> Message {
        let ([f, fp], (cx, cy)) = (self.focal_px, self.center_px);
        let one = if f > 0.0 { 1.0 } else { 0.0 };
        let k = [f, 0.0, cx, 0.0, f, cy, 0.0, 0.0, one];
        let p = [fp, 0.0, cx, self.tx, 0.0, fp, cy, 0.0, 0.0, 0.0, one, 0.0];
        let (model, d) = self.distortion;
        let data = cdr_in(frame, stamp_ns, |cdr| {
            cdr.write_u32(self.size.1 as u32);
            cdr.write_u32(self.size.0 as u32);
            cdr.write_string(model);
            cdr.write_sequence_length(d.len());
            let numbers = d.iter().chain(&k).chain(&self.r).chain(&p);
            numbers.for_each(|v| cdr.write_f64(*v));
            (0..6).for_each(|_| cdr.write_u32(0));
            cdr.write_bool(false);
        });
        Message::cdr(
            topic,
            "sensor_msgs/msg/CameraInfo",
            stamp_ns + 2_000_000,
            data,
        )
    }
}

/// Quaternion of an optical frame in its camera's: x right, y down, z forward (REP 103).
pub(super) const OPTICAL: [f64; 4] = [-0.5, 0.5, -0.5, 0.5];
pub(super) const PARALLEL: [f64; 4] = [0.0, 0.0, 0.0, 1.0];

/// Parent and child frame, translation in metres, quaternion x y z w.
pub(super) type Link = (&'static str, &'static str, [f64; 3], [f64; 4]);

/// A message on /tf_static.
pub(super) fn tf_static(i: u64, links: &[Link]) -> Message {
    let mut data = vec![0, 1, 0, 0];
    let mut cdr = CdrWriter::<LittleEndian>::new(&mut data);
    cdr.write_sequence_length(links.len());
    for (parent, child, translation, rotation) in links {
        (0..2).for_each(|_| cdr.write_u32(0));
        cdr.write_string(parent);
        cdr.write_string(child);
        let numbers = translation.iter().chain(rotation);
        numbers.for_each(|v| cdr.write_f64(*v));
    }
    let log_time = stamp(i) + 3_000_000;
    Message::cdr("/tf_static", "tf2_msgs/msg/TFMessage", log_time, data)
}

/// A message of a type that svl does not read.
pub(super) fn other(topic: &'static str, schema: &'static str, i: u64) -> Message {
    Message::cdr(topic, schema, stamp(i), cdr_in("frame", stamp(i), |_| {}))
}

/// The calibration of both cameras as OpenCV's file.
pub(super) fn calibration() -> String {
    let (_, d) = DISTORTION;
    let matrix = |name: &str, rows: usize, columns: usize, data: &[f64]| {
        let data: Vec<_> = data.iter().map(|v| format!("{v:?}")).collect();
        format!(
            "{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   \
             data: [ {} ]\n",
            data.join(", ")
        )
    };
    let k = [
        FOCAL_PX,
        0.0,
        CENTER_PX.0,
        0.0,
        FOCAL_PX,
        CENTER_PX.1,
        0.0,
        0.0,
        1.0,
    ];
    let parts = [
        format!(
            "%YAML:1.0\n---\nlength_unit: m\nimage_width: {}\nimage_height: {}\n",
            SIZE.0, SIZE.1
        ),
        matrix("M1", 3, 3, &k),
        matrix("D1", 1, 5, d),
        matrix("M2", 3, 3, &k),
        matrix("D2", 1, 5, d),
        matrix("R", 3, 3, &IDENTITY),
        matrix("T", 3, 1, &[-BASELINE_M, 0.0, 0.0]),
    ];
    parts.concat()
}
