//! Messages of the scene that all drivers show: a wall of noise, parallel to the cameras.

use crate::recording::bag::{
    CAMERA, Camera, IDENTITY, Message, camera_info_of, cdr_in, cloud, float_image, png,
    ros_compressed_in, ros_image_in, write_u32s,
};
use crate::recording::video::coded;
use std::sync::LazyLock;
use svl::stereo::{Gray, Plane};

pub(super) const SIZE: (usize, usize) = (160, 120);
const FOCAL_PX: f64 = 150.0;
const CENTER_PX: (f64, f64) = (79.5, 59.5);
pub(super) const BASELINE_M: f64 = 0.1;
/// Even, so that both images of a mosaic have the same phase.
const DISPARITY_PX: usize = 10;
pub(super) const DEPTH_M: f64 = FOCAL_PX * BASELINE_M / DISPARITY_PX as f64;
pub(super) const PAIRS: u64 = 6;
/// Nanoseconds from a pair to the next: 30 a second.
const PERIOD_NS: u64 = 33_333_333;

/// Distortion of raw cameras: 0.03 px at the border, so that the images need not be distorted.
const DISTORTION: &[f64] = &[-0.001, 0.0, 0.0, 0.0, 0.0];
/// The model of the drivers that publish eight coefficients.
pub(super) const RATIONAL: &str = "rational_polynomial";

pub(super) fn stamp(i: u64) -> u64 {
    1_700_000_000_000_000_000 + i * PERIOD_NS
}

/// The left (0) or right (1) image of a pair.
fn grey(side: usize, i: u64) -> Gray {
    let noise = |x: usize, y: usize| {
        let mixed = (x as u64 * 7919 + y as u64 * 104_729 + i * 15_485_863 + 12_345)
            .wrapping_mul(0x9E37_79B9_7F4A_7C15);
        (mixed >> 56) as u8
    };
    Gray::from_fn(SIZE.0, SIZE.1, |x, y| noise(x + side * DISPARITY_PX, y)).unwrap()
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

/// A camera by its name, `-right` if it is the right one of a pair.
fn camera(name: &str) -> Camera<'static> {
    let k = [FOCAL_PX, CENTER_PX.0, CENTER_PX.1];
    let mut camera = Camera {
        size: (SIZE.0 as u32, SIZE.1 as u32),
        k,
        p: k,
        d: &[0.0; 5],
        ..CAMERA
    };
    let kind = name.trim_end_matches("-right");
    if !["rect", "raw", "uncalibrated", "unknown"].contains(&kind) {
        camera.model = RATIONAL;
        camera.d = &[0.299, 0.0, 0.0, 0.0, 0.0, 0.3, 0.0, 0.0];
    }
    match kind {
        "rect" | "rational" => {}
        "raw" => camera.d = DISTORTION,
        // P has the sign of DepthAI, whose first camera is the right one.
        "reversed" => camera.tx = FOCAL_PX * BASELINE_M,
        // P has the camera's own intrinsics: it does not rectify the pair.
        "own" => [camera.k[0], camera.p[0]] = [FOCAL_PX - 1.0; 2],
        // Images of twice the size, of a camera that is rotated about y.
        "twice" => {
            let (sin, cos) = 0.01_f64.sin_cos();
            camera.r = [cos, 0.0, sin, 0.0, 1.0, 0.0, -sin, 0.0, cos];
            camera.size = (2 * camera.size.0, 2 * camera.size.1);
            [camera.k[0], camera.p[0]] = [2.0 * FOCAL_PX; 2];
        }
        // A camera that was never calibrated, as camera_info_manager publishes it.
        "uncalibrated" => {
            (camera.model, camera.d, camera.r) = ("", &[], [0.0; 9]);
            [camera.k, camera.p] = [[0.0; 3]; 2];
        }
        // A model that svl does not know.
        "unknown" => (camera.model, camera.d) = ("double_sphere", &[-0.2, 0.6]),
        other => panic!("{other}"),
    }
    if kind != name {
        camera.tx = -camera.p[0] * BASELINE_M;
    }
    camera
}

/// H.264 of both cameras, picture by picture.
static VIDEOS: LazyLock<[Vec<Vec<u8>>; 2]> = LazyLock::new(|| {
    let images = |side| (0..PAIRS).map(|i| grey(side, i)).collect::<Vec<_>>();
    [0, 1].map(|side| coded(SIZE, "h264", &images(side), 0))
});

/// The message of pair `i` that a line describes: topic, frame, and what it is.
///
/// `left` and `right` are images in an encoding, `depth` is the wall in an encoding, `other` a type
/// that svl does not read, any other word the camera_info of a [`camera`]; `+8` is eight
/// milliseconds late.
pub(super) fn message(line: &'static str, i: u64) -> Message {
    let mut words = line.split_whitespace();
    let [topic, frame, what, form] = [(); 4].map(|()| words.next().unwrap_or_default());
    let (what, late_ms) = what.split_once('+').unwrap_or((what, "0"));
    let stamp = stamp(i) + late_ms.parse::<u64>().unwrap() * 1_000_000;
    let side = usize::from(what == "right");
    match (what, form) {
        ("depth", "16UC1") => {
            let pixel = ((DEPTH_M * 1000.0) as u16).to_le_bytes();
            let pixels = pixel.repeat(SIZE.0 * SIZE.1);
            ros_image_in(frame, topic, stamp, SIZE, (form, &pixels))
        }
        ("depth", _) => {
            let wall = Plane::filled(SIZE.0, SIZE.1, DEPTH_M as f32).unwrap();
            float_image(frame, topic, stamp, &wall)
        }
        ("points", _) => {
            let pixels = (0..40).flat_map(|y| (0..40).map(move |x| [x, y]));
            let points = pixels.map(|at| at.map(|v| v as f32 / 20.0 - 1.0));
            let points: Vec<_> = points.map(|[x, y]| [x, y, DEPTH_M as f32]).collect();
            cloud(frame, stamp, &points).on(topic)
        }
        ("other", schema) => Message::cdr(topic, schema, stamp, cdr_in(frame, stamp, |_| {})),
        (_, "png") => {
            let png = png(SIZE, &grey(side, i).pixels().collect::<Vec<u8>>());
            ros_compressed_in(frame, topic, stamp, "mono8; png compressed ", &png)
        }
        (_, "h264") => ros_compressed_in(frame, topic, stamp, form, &VIDEOS[side][i as usize]),
        ("left" | "right", encoding) => {
            let pixels = encoded(&grey(side, i), encoding);
            let image = ros_image_in(frame, topic, stamp, SIZE, (encoding, &pixels));
            if encoding != "nv12" {
                return image;
            }
            // The step is that of the luma.
            image.with(cdr_in(frame, stamp, |cdr| {
                write_u32s(cdr, [SIZE.1 as u32, SIZE.0 as u32]);
                cdr.write_string(encoding);
                cdr.write_u8(0);
                cdr.write_u32(SIZE.0 as u32);
                cdr.write_bytes(&pixels);
            }))
        }
        (name, _) => {
            let camera = Camera {
                frame,
                ..camera(name)
            };
            camera_info_of(topic, stamp, &camera).logged(stamp + 2_000_000)
        }
    }
}

/// The calibration of both cameras as OpenCV's file.
pub(super) fn calibration() -> String {
    let matrix = |name: &str, rows: usize, columns: usize, data: &[f64]| {
        format!(
            "{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   \
             data: {data:?}\n"
        )
    };
    let (f, (cx, cy)) = (FOCAL_PX, CENTER_PX);
    let k = [f, 0.0, cx, 0.0, f, cy, 0.0, 0.0, 1.0];
    let (width, height) = SIZE;
    let head = "%YAML:1.0\n---\nlength_unit: m\n";
    let parts = [
        format!("{head}image_width: {width}\nimage_height: {height}\n"),
        matrix("M1", 3, 3, &k),
        matrix("D1", 1, 5, DISTORTION),
        matrix("M2", 3, 3, &k),
        matrix("D2", 1, 5, DISTORTION),
        matrix("R", 3, 3, &IDENTITY),
        matrix("T", 3, 1, &[-BASELINE_M, 0.0, 0.0]),
    ];
    parts.concat()
}
