//! Truth from another sensor of a bag: accepted and rejected messages.

use super::bag::{
    self, CAMERA, Camera, Message, camera_info, camera_info_of, cdr_in, protobuf, ros_image,
    timestamp,
};
use super::frames::{START_NS, full, image, read, stamp};
use ::image::codecs::png::PngEncoder;
use ::image::{ExtendedColorType, ImageEncoder};
use foxglove::messages as fox;
use std::path::{Path, PathBuf};
use svl::scenario::SourceOptions;
use svl::source::{Opened, Request, open_recording};
use svl::stereo::{Frame, MapDensity, Plane, Truth, TruthKind, TruthOrigin};

pub(super) const SIZE: (usize, usize) = (24, 16);
/// Focal length times baseline of [`pairs`], pixels times metres.
pub(super) const FB: f64 = 14.432;

/// Two rectified pairs in frame `cam`, with a rig.
pub(super) fn pairs() -> Vec<Message> {
    let pair = |i| {
        let [left, right] = [2 * i, 2 * i + 1].map(|seed| image(SIZE, seed).pixels().collect());
        let pixels: [Vec<u8>; 2] = [left, right];
        [
            camera_info("/cam0/camera_info", stamp(i), &[], 0.0),
            camera_info("/cam1/camera_info", stamp(i), &[], -FB),
            ros_image("/cam0/image_rect", stamp(i), SIZE, "mono8", &pixels[0]),
            ros_image("/cam1/image_rect", stamp(i), SIZE, "mono8", &pixels[1]),
        ]
    };
    (0..2).flat_map(pair).collect()
}

pub(super) fn depth32(
    i: u64,
    size: (usize, usize),
    depth: impl Fn(usize, usize) -> f32,
) -> Message {
    let pixels = (0..size.1).flat_map(|y| (0..size.0).map(move |x| (x, y)));
    let bytes: Vec<u8> = pixels
        .flat_map(|(x, y)| depth(x, y).to_le_bytes())
        .collect();
    ros_image("/depth", stamp(i), size, "32FC1", &bytes)
}

/// A sensor_msgs/msg/PointCloud2 of x, y, z as 32-bit floats.
pub(super) fn cloud(frame: &str, stamp: u64, points: &[[f32; 3]]) -> Message {
    cloud_with(frame, stamp, points, false, 12 * points.len() as u32)
}

/// Same as [`cloud`], on another topic.
pub(super) fn cloud_on(
    topic: &'static str,
    frame: &str,
    stamp: u64,
    points: &[[f32; 3]],
) -> Message {
    Message {
        topic,
        ..cloud(frame, stamp, points)
    }
}

fn cloud_with(
    frame: &str,
    stamp: u64,
    points: &[[f32; 3]],
    big_endian: bool,
    row_step: u32,
) -> Message {
    let bytes: Vec<u8> = points
        .iter()
        .flatten()
        .flat_map(|v| v.to_le_bytes())
        .collect();
    let data = cdr_in(frame, stamp, |cdr| {
        cdr.write_u32(1);
        cdr.write_u32(points.len() as u32);
        cdr.write_sequence_length(3);
        for (name, offset) in [("x", 0), ("y", 4), ("z", 8)] {
            cdr.write_string(name);
            cdr.write_u32(offset);
            cdr.write_u8(7);
            cdr.write_u32(1);
        }
        cdr.write_bool(big_endian);
        cdr.write_u32(12);
        cdr.write_u32(row_step);
        cdr.write_bytes(&bytes);
        cdr.write_bool(true);
    });
    Message {
        topic: "/points",
        schema: "sensor_msgs/msg/PointCloud2",
        encoding: "cdr",
        log_time: stamp,
        data,
    }
}

/// A tf2_msgs/msg/TFMessage of translations.
pub(super) fn tf(topic: &'static str, links: &[(&str, &str, [f64; 3])]) -> Message {
    let mut data = vec![0, 1, 0, 0];
    let mut cdr = re_cdr::CdrWriter::<re_cdr::LittleEndian>::new(&mut data);
    cdr.write_sequence_length(links.len());
    for (parent, child, translation) in links {
        cdr.write_u32(0);
        cdr.write_u32(0);
        cdr.write_string(parent);
        cdr.write_string(child);
        translation
            .iter()
            .chain(&[0.0, 0.0, 0.0, 1.0])
            .for_each(|&v| cdr.write_f64(v));
    }
    Message {
        topic,
        schema: "tf2_msgs/msg/TFMessage",
        encoding: "cdr",
        log_time: START_NS,
        data,
    }
}

fn write_bag(messages: impl IntoIterator<Item = Message>) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let messages: Vec<_> = messages.into_iter().collect();
    let path = bag::write(folder.path(), &messages);
    (folder, path)
}

pub(super) fn open(path: &Path, topic: &str) -> svl::Result<Opened> {
    open_recording(&Request {
        options: SourceOptions {
            truth: Some(topic.to_owned()),
            ..SourceOptions::default()
        },
        ..Request::new(path.to_str().unwrap())
    })
}

/// The truths of the two pairs, and the number of those that lack one.
pub(super) fn truths(
    messages: impl IntoIterator<Item = Message>,
    topic: &str,
) -> (Vec<Option<Truth>>, u64) {
    let (_folder, path) = write_bag(pairs().into_iter().chain(messages));
    let mut source = open(&path, topic).unwrap().source;
    let frames: Vec<Frame> = std::iter::from_fn(|| source.next().unwrap()).collect();
    let without = source.finish(2).without_truth;
    (
        frames.into_iter().map(|frame| frame.truth).collect(),
        without,
    )
}

/// The error of opening the source or reading its pairs, in one line.
#[track_caller]
pub(super) fn refused(messages: impl IntoIterator<Item = Message>, topic: &str, words: &[&str]) {
    let (_folder, path) = write_bag(messages);
    let read = open(&path, topic).and_then(|mut opened| {
        while opened.source.next()?.is_some() {}
        Ok(())
    });
    let error = read.expect_err("it is bad").to_string();
    assert!(!error.contains('\n'), "{error}");
    for word in [topic].iter().chain(words) {
        assert!(error.contains(word), "'{word}' is not in: {error}");
    }
}

#[test]
fn an_aligned_depth_image_is_dense_and_without_what_is_no_depth() {
    let depth = |x: usize, y: usize| match (x, y) {
        (0, 0) => 0.0,
        (1, 0) => f32::NAN,
        (2, 0) => f32::INFINITY,
        _ => 0.5 + x as f32 / 10.0,
    };
    let (truths, without) = truths([depth32(0, SIZE, depth), depth32(1, SIZE, depth)], "/depth");
    assert_eq!(without, 0);
    for truth in truths {
        let truth = truth.unwrap();
        assert_eq!(
            truth.kind,
            TruthKind {
                density: MapDensity::Dense,
                origin: TruthOrigin::Sensor("/depth".into()),
            }
        );
        assert!((0..3).all(|x| truth.disparity.get(x, 0) == f32::INFINITY));
        let expected = (FB / (0.5 + 0.7)) as f32;
        assert!((truth.disparity.get(7, 5) - expected).abs() < 1e-4);
    }
}

const COMPRESSED: &str = "/depth/compressedDepth";

#[test]
fn millimetres_and_compressed_depth_are_the_same_depths() {
    let millimetres: Vec<u16> = (0..24 * 16).map(|i| 500 + i).collect();
    let bytes: Vec<u8> = millimetres.iter().flat_map(|z| z.to_le_bytes()).collect();
    // Twelve bytes of the transport's own header, then the PNG.
    let mut png = vec![0; 12];
    PngEncoder::new(&mut png)
        .write_image(&bytes, 24, 16, ExtendedColorType::L16)
        .unwrap();
    let compressed =
        |i, format, bytes: &[u8]| bag::ros_compressed(COMPRESSED, stamp(i), format, bytes);
    let raw = |i| ros_image("/depth", stamp(i), SIZE, "16UC1", &bytes);
    let (raws, _) = truths([raw(0), raw(1)], "/depth");
    let codes = Plane::from_vec(SIZE.0, SIZE.1, millimetres).unwrap();
    let rvl = svl::files::encode_rvl(&codes, None);
    let disparity = |truth: &Option<Truth>| truth.as_ref().unwrap().disparity.clone();
    for (format, bytes) in [
        ("16UC1; compressedDepth png", &png),
        ("16UC1; compressedDepth", &png),
        ("mono16; compressedDepth png", &png),
        ("16UC1; compressedDepth rvl", &rvl),
        ("16UC1;compressedDepth rvl", &rvl),
        ("16UC1; png compressed ", &png[12..].to_vec()),
        ("png", &png[12..].to_vec()),
    ] {
        let (others, _) = truths([0, 1].map(|i| compressed(i, format, bytes)), COMPRESSED);
        assert_eq!(disparity(&raws[0]), disparity(&others[0]), "{format}");
        let message = bag::foxglove_compressed(COMPRESSED, stamp(0), format, bytes);
        let (others, _) = truths([message], COMPRESSED);
        assert_eq!(disparity(&raws[0]), disparity(&others[0]), "{format}");
    }
    assert!((disparity(&raws[0]).get(0, 0) - (FB / 0.5) as f32).abs() < 1e-4);
    let cut = rvl[..rvl.len() - 4].to_vec();
    let eight_bits = svl::files::encode_png(24, 16, &[9; 24 * 16]).unwrap();
    for (format, bytes, words) in [
        (
            "16UC1; compressedDepth rvl",
            &cut,
            ["RVL", "ends before its last pixel"],
        ),
        (
            "16UC1; compressedDepth zstd",
            &png,
            ["compressedDepth zstd", "PNG or RVL"],
        ),
        (
            "16UC1; jpeg compressed ",
            &png,
            ["jpeg", "a PNG of 16 bits"],
        ),
        (
            "16UC1; compressedDepth png",
            &vec![0; 11],
            ["shorter", "header"],
        ),
        (
            "32FC1; png compressed ",
            &eight_bits,
            ["'32FC1'", "16UC1 in millimetres"],
        ),
        (
            "rgb8; png compressed bgr8",
            &eight_bits,
            ["'rgb8'", "16UC1 in millimetres"],
        ),
        ("png", &eight_bits, ["PNG", "one channel of 16 bits"]),
    ] {
        let message = compressed(0, format, bytes);
        refused(pairs().into_iter().chain([message]), COMPRESSED, &words);
    }
}

/// A stereo_msgs/msg/DisparityImage of the first pair.
fn disparity_image(pixels: &[f32], numbers: [f32; 3]) -> Message {
    disparity_image_of((24, 16), pixels, numbers)
}

/// The same of another size.
fn disparity_image_of(
    (width, height): (u32, u32),
    pixels: &[f32],
    [focal, baseline, min]: [f32; 3],
) -> Message {
    let pixels: Vec<u8> = pixels.iter().flat_map(|d| d.to_le_bytes()).collect();
    let data = cdr_in("cam", stamp(0), |cdr| {
        (0..2).for_each(|_| cdr.write_u32(0));
        cdr.write_string("cam");
        cdr.write_u32(height);
        cdr.write_u32(width);
        cdr.write_string("32FC1");
        cdr.write_u8(0);
        cdr.write_u32(4 * width);
        cdr.write_bytes(&pixels);
        cdr.write_f32(focal);
        cdr.write_f32(baseline);
        (0..4).for_each(|_| cdr.write_u32(0));
        cdr.write_bool(false);
        [min, 400.0, 0.1].into_iter().for_each(|v| cdr.write_f32(v));
    });
    Message::cdr(
        "/disparity",
        "stereo_msgs/msg/DisparityImage",
        stamp(0),
        data,
    )
}

#[test]
fn a_disparity_image_is_the_depth_of_its_own_baseline() {
    let pixels: Vec<_> = (0..24 * 16u16).map(|i| f32::from(i) / 20.0 - 3.0).collect();
    // Twice the focal length and half the baseline of the pairs: the same depths.
    let disparities = |min: f32, focal: f32| disparity_image(&pixels, [focal, 0.022, min]);
    let (found, _) = truths([disparities(5.0, 656.0)], "/disparity");
    let disparity = &found[0].as_ref().unwrap().disparity;
    for ((i, d), pixel) in (0..).zip(disparity.pixels()).zip(&pixels) {
        let expected = f64::from(*pixel);
        assert_eq!(d.is_finite(), expected >= 5.0, "{i}");
        assert!(
            expected < 5.0 || (f64::from(d) / expected - 1.0).abs() < 1e-6,
            "{i}"
        );
    }
    let all = || pairs().into_iter();
    refused(
        all().chain([disparities(5.0, 0.0)]),
        "/disparity",
        &["no focal length"],
    );
    let (_folder, path) = write_bag(all().chain([disparities(5.0, 656.0)]));
    let reader = svl::recording::Reader::open(&path).unwrap();
    let topics = svl::recording::truth_topics(reader.recording(), &reader.facts().topics);
    assert_eq!(topics.unwrap(), ["/disparity"]);
}

#[test]
fn a_camera_info_of_a_wider_namespace_is_used_for_its_own_frame_alone() {
    let image = |i| Message {
        topic: "/rgbd/depth/image",
        ..depth32(i, SIZE, |x, _| 0.5 + x as f32 / 10.0)
    };
    let info = |topic, frame| {
        let (k, p) = ([164.0, 12.0, 8.0], [164.0, 12.0, 8.0]);
        let camera = Camera {
            frame,
            k,
            p,
            ..CAMERA
        };
        camera_info_of(topic, stamp(0), &camera)
    };
    let [alone, other, own, beside] = [
        None,
        Some(info("/rgbd/camera_info", "other")),
        Some(info("/rgbd/camera_info", "cam")),
        Some(info("/rgbd/depth/camera_info", "other")),
    ]
    .map(|info| {
        let messages = info.into_iter().chain([image(0), image(1)]);
        let (truths, _) = truths(messages, "/rgbd/depth/image");
        truths[0].clone().unwrap().disparity
    });
    // The pixels of the left camera, or those of one of half its focal length.
    assert_eq!(other, alone);
    assert_ne!(own, alone);
    assert_eq!(beside, own);
}

/// A matcher may halve its images first: a camera_info says whose pixels these are.
#[test]
fn a_disparity_image_of_half_the_size_is_refused_or_has_its_camera() {
    let half = vec![4.0; 12 * 8];
    let message = disparity_image_of((12, 8), &half, [164.0, 0.044, 1.0]);
    refused(
        pairs().into_iter().chain([message.clone()]),
        "/disparity",
        &["12x8", "24x16", "no camera_info for that camera"],
    );
    let camera = Camera {
        size: (12, 8),
        ..CAMERA
    };
    let info = camera_info_of("/disparity/camera_info", stamp(0), &camera);
    let (found, _) = truths([info, message], "/disparity");
    let truth = found[0].as_ref().unwrap();
    let known = truth.disparity.pixels().filter(|d| d.is_finite());
    let known: Vec<_> = known.collect();
    // Twice as many pixels at twice the disparity.
    assert!(
        known.len() > 9 && known.iter().all(|d| (d - 8.0).abs() < 0.01),
        "{known:?}"
    );
}

/// Disparity images have the pixels of the rectified camera, also beside raw images: those of
/// stereo_image_proc.
#[test]
fn a_disparity_image_beside_raw_images_is_of_the_rectified_camera() {
    // The distortion moves pixels at the border by 2 px.
    let distortion = [-150.0, 0.0, 0.0, 0.0, 0.0];
    let camera = |images, info, tx: f64| {
        let pixels: Vec<u8> = image(SIZE, tx.abs() as u64).pixels().collect();
        [
            camera_info(info, stamp(0), &distortion, tx),
            ros_image(images, stamp(0), SIZE, "mono8", &pixels),
        ]
    };
    // A slanted plane: a step of a pixel per pixel.
    let slanted: Vec<_> = (0..24 * 16u16)
        .map(|i| 4.0 + f32::from(i % 24) / 2.0)
        .collect();
    let messages = camera("/cam0/image_raw", "/cam0/camera_info", 0.0).into_iter();
    let right = camera("/cam1/image_raw", "/cam1/camera_info", -FB);
    let truth = disparity_image(&slanted, [328.0, (FB / 328.0) as f32, 1.0]);
    let (_folder, path) = write_bag(messages.chain(right).chain([truth]));
    let mut source = open(&path, "/disparity").unwrap().source;
    let frame = source.next().unwrap().unwrap();
    let (rig, truth) = (*frame.rig().unwrap(), frame.truth.unwrap());
    let mut known = 0;
    for (i, d) in (0..).zip(truth.disparity.pixels()) {
        let x = (f64::from(i % 24) - rig.center_px().0) / rig.focal_px() * 328.0 + 12.0;
        let expected = (4.0 + x / 2.0) * rig.focal_px() / 328.0;
        known += u32::from(d.is_finite());
        // Half a pixel by rounding.
        let is_right = (f64::from(d) - expected).abs() < 0.75;
        assert!(is_right || d.is_infinite(), "{i}: {d} {expected}");
    }
    assert!(known > 200, "{known}");
}

#[test]
fn the_nearest_measurement_within_the_limit_counts() {
    let at = |i: u64, late_ns: u64, z: f32| {
        let message = depth32(i, SIZE, |_, _| z);
        let mut data = message.data.clone();
        let stamp = stamp(i) + late_ns;
        data[4..8].copy_from_slice(&((stamp / 1_000_000_000) as u32).to_le_bytes());
        data[8..12].copy_from_slice(&((stamp % 1_000_000_000) as u32).to_le_bytes());
        message.with(data)
    };
    let first = |truths: &[Option<Truth>]| truths[0].as_ref().map(|t| t.disparity.get(3, 3));
    let (nearest, without) = truths([at(0, 15_000_000, 1.0), at(0, 4_000_000, 2.0)], "/depth");
    assert_eq!((first(&nearest), without), (Some((FB / 2.0) as f32), 1));
    let (late, without) = truths([at(0, 21_000_000, 1.0), at(1, 0, 1.0)], "/depth");
    assert_eq!((first(&late), without), (None, 1));
}

#[test]
fn an_odd_measurement_costs_only_itself() {
    let depth = |i| depth32(i, SIZE, |_, _| 2.0);
    let known = |truths: &[Option<Truth>]| [0, 1].map(|i| truths[i].is_some());
    // A message twice, one of another size, and rows of unknown length.
    let (found, without) = truths([depth(0), depth(1), depth(1)], "/depth");
    assert_eq!((known(&found), without), ([true, false], 1));
    let small = depth32(1, (12, 8), |_, _| 2.0);
    let (found, without) = truths([depth(0), small], "/depth");
    assert_eq!((known(&found), without), ([true, false], 1));
    let rowless = cloud_with("cam", stamp(0), &[[0.0, 0.0, 2.0]], false, 0);
    let (found, _) = truths([rowless], "/points");
    let seen = found[0].as_ref().unwrap().disparity.get(12, 8);
    assert!((seen - (FB / 2.0) as f32).abs() < 1e-4, "{seen}");
    refused(
        pairs().into_iter().chain([depth(0), depth(0)]),
        "/depth",
        &["1 pair", "2 measurements", "unknown which belong together"],
    );
}

#[test]
fn a_cloud_is_moved_into_the_left_camera() {
    // A lidar 0.5 m behind the camera and 0.2 m to its right; a point 2 m before the lidar.
    let links = [
        ("base", "cam", [0.0; 3]),
        ("base", "lidar", [0.2, 0.0, -0.5]),
    ];
    let points = [
        [-0.2, 0.0, 2.0],
        [0.0, 0.0, 0.2],
        [f32::NAN; 3],
        [9.0, 0.0, 2.0],
    ];
    let clouds = (0..2).map(|i| cloud("lidar", stamp(i), &points));
    let (found, without) = truths(clouds.chain([tf("/tf_static", &links)]), "/points");
    let truth = found[1].as_ref().unwrap();
    assert_eq!((truth.kind.density, without), (MapDensity::Sparse, 0));
    let known: Vec<_> = (0..16)
        .flat_map(|y| (0..24).map(move |x| (x, y)))
        .filter(|&(x, y)| truth.disparity.get(x, y).is_finite())
        .collect();
    // The principal point: the second is behind the camera, the last outside of the image.
    assert_eq!(known, [(12, 8)]);
    assert!((truth.disparity.get(12, 8) - (FB / 1.5) as f32).abs() < 1e-4);
}

#[test]
fn foxglove_s_clouds_scans_and_transforms_are_read() {
    let transform = fox::FrameTransforms {
        transforms: vec![fox::FrameTransform {
            timestamp: timestamp(START_NS),
            parent_frame_id: "cam".into(),
            child_frame_id: "lidar".into(),
            translation: Some(fox::Vector3 {
                x: 0.0,
                y: 0.0,
                z: -0.5,
            }),
            rotation: Some(fox::Quaternion {
                x: 0.0,
                y: 0.0,
                z: 0.0,
                w: 1.0,
            }),
        }],
    };
    let transform = protobuf(
        "/transforms",
        "foxglove.FrameTransforms",
        START_NS,
        &transform,
    );
    let field = |name: &str, offset| fox::PackedElementField {
        name: name.into(),
        offset,
        r#type: 8,
    };
    let cloud = |i| {
        let point = [0.0f64, 0.0, 2.5]
            .iter()
            .flat_map(|v| v.to_le_bytes())
            .collect::<Vec<_>>();
        let message = fox::PointCloud {
            timestamp: timestamp(stamp(i)),
            frame_id: "lidar".into(),
            pose: None,
            point_stride: 24,
            fields: vec![field("x", 0), field("y", 8), field("z", 16)],
            data: point.into(),
        };
        protobuf("/points", "foxglove.PointCloud", stamp(i), &message)
    };
    let (found, _) = truths([transform, cloud(0), cloud(1)], "/points");
    let truth = found[0].as_ref().unwrap();
    assert!((truth.disparity.get(12, 8) - (FB / 2.0) as f32).abs() < 1e-4);
    // A scan in the camera's frame, whose pose rotates its x-y plane into the z-x plane.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let scan = |i| {
        let message = fox::LaserScan {
            timestamp: timestamp(stamp(i)),
            frame_id: "cam".into(),
            pose: Some(fox::Pose {
                position: None,
                orientation: Some(fox::Quaternion {
                    x: 0.0,
                    y: -half,
                    z: 0.0,
                    w: half,
                }),
            }),
            start_angle: 0.0,
            end_angle: 0.1,
            ranges: vec![2.0, f64::NAN],
            intensities: vec![],
        };
        protobuf("/scan", "foxglove.LaserScan", stamp(i), &message)
    };
    let (found, _) = truths([scan(0), scan(1)], "/scan");
    let truth = found[0].as_ref().unwrap();
    assert!((truth.disparity.get(12, 8) - (FB / 2.0) as f32).abs() < 1e-4);
}

#[test]
fn topics_that_are_no_truth_are_refused_in_one_line() {
    let with = |message: Message| pairs().into_iter().chain([message]);
    let flat = |_: usize, _: usize| 1.0;
    refused(
        with(depth32(0, (12, 8), flat)),
        "/depth",
        &["12x8", "24x16", "camera_info"],
    );
    refused(
        with(depth32(0, SIZE, flat)),
        "/elsewhere",
        &["no such topic", "distances are in /depth"],
    );
    refused(
        with(tf("/tf_static", &[])),
        "/tf_static",
        &["TFMessage", "PointCloud2"],
    );
    refused(
        with(ros_image("/depth", stamp(0), SIZE, "mono8", &[0; 384])),
        "/depth",
        &["16UC1"],
    );
    refused(
        with(ros_image("/depth", stamp(0), SIZE, "16UC1", &[0; 32])),
        "/depth",
        &["does not fit"],
    );
    let uncalibrated = pairs()
        .into_iter()
        .filter(|m| m.schema == "sensor_msgs/msg/Image");
    refused(
        uncalibrated.chain([depth32(0, SIZE, flat)]),
        "/depth",
        &["calibration", "--calib"],
    );
    // A day later.
    refused(
        with(depth32(1_300_000, SIZE, flat)),
        "/depth",
        &["1700000000.0", "1700086", "measurements"],
    );
    let point = [[0.0, 0.0, 2.0]];
    refused(
        with(cloud("lidar", stamp(0), &point)),
        "/points",
        &["'lidar' to 'cam'", "no transform"],
    );
    let links = tf("/tf_static", &[("base", "arm", [0.0; 3])]);
    refused(
        with(links).chain([cloud("lidar", stamp(0), &point)]),
        "/points",
        &["base → arm"],
    );
    // A moving transform is not static.
    let links = tf("/tf", &[("cam", "lidar", [0.0; 3])]);
    refused(
        with(links).chain([cloud("lidar", stamp(0), &point)]),
        "/points",
        &["no transform", "/tf has one", "static_transform_publisher"],
    );
    // The chain consists of both.
    let links = [
        tf("/tf_static", &[("cam", "base", [0.0; 3])]),
        tf("/tf", &[("base", "lidar", [0.0; 3])]),
    ];
    let pairs_and_links = pairs().into_iter().chain(links);
    refused(
        pairs_and_links.chain([cloud("lidar", stamp(0), &point)]),
        "/points",
        &["/tf has one"],
    );
    refused(
        with(cloud_with("cam", stamp(0), &point, true, 12)),
        "/points",
        &["big-endian"],
    );
    refused(
        with(cloud_with("cam", stamp(0), &point, false, 4)),
        "/points",
        &["rows of 4"],
    );
}

#[test]
fn a_recording_keeps_how_its_truth_was_measured() {
    let kind = TruthKind {
        density: MapDensity::Sparse,
        origin: TruthOrigin::Sensor("/points".into()),
    };
    let mut frame = full(0, SIZE);
    if let Some(truth) = &mut frame.truth {
        truth.kind = kind.clone();
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let (header, format) = (
        svl::recording::Header::new("test"),
        svl::recording::ImageFormat::Raw,
    );
    let mut writer = svl::recording::Writer::create(&path, &header, format).unwrap();
    writer.write(&frame).unwrap();
    writer.finish().unwrap();
    let (back, error) = read(&path);
    assert!(error.is_none());
    assert_eq!(back[0].truth.as_ref().unwrap().kind, kind);
    // The recording's own truth, as a topic: the same, except for the stated origin.
    let frame = open(&path, "/truth/depth")
        .unwrap()
        .source
        .next()
        .unwrap()
        .unwrap();
    let (again, own) = (frame.truth.unwrap(), back[0].truth.as_ref().unwrap());
    assert_eq!(again.disparity, own.disparity);
    assert_eq!(
        again.kind.origin,
        TruthOrigin::Sensor("/truth/depth".into())
    );
}
