//! Truth from another sensor of a bag: accepted and rejected messages.

use super::bag::{
    self, Bag, CAMERA, Camera, FB, Message, RAW, SIZE, STEREO, camera_info_of, cloud, cloud_with,
    depth32, disparity_image, open, protobuf, ros_image, tf, timestamp,
};
use super::frames::{START_NS, full, intact, record, stamp};
use foxglove::messages as fox;
use svl::recording::{ImageFormat, Reader, truth_topics};
use svl::stereo::{MapDensity, Plane, Truth, TruthKind, TruthOrigin};

/// Two rectified pairs with a rig, and these messages.
fn with(messages: impl IntoIterator<Item = Message>) -> Bag {
    Bag::pairs(2).and(messages)
}

/// The disparities of the first pair by a topic.
fn first(messages: impl IntoIterator<Item = Message>, topic: &str) -> Plane<f32> {
    let truth = with(messages).truths(topic).swap_remove(0);
    truth.unwrap().disparity
}

#[test]
fn an_aligned_depth_image_is_dense_and_without_what_is_no_depth() {
    let depth = |x: usize, y: usize| match (x, y) {
        (0, 0) => 0.0,
        (1, 0) => f32::NAN,
        (2, 0) => f32::INFINITY,
        _ => 0.5 + x as f32 / 10.0,
    };
    let truths = with([0, 1].map(|i| depth32(i, SIZE, depth))).truths("/depth");
    let kind = TruthKind {
        density: MapDensity::Dense,
        origin: TruthOrigin::Sensor("/depth".into()),
    };
    for truth in truths {
        let truth = truth.unwrap();
        assert_eq!(truth.kind, kind);
        assert!((0..3).all(|x| truth.disparity.get(x, 0) == f32::INFINITY));
        let expected = (FB / (0.5 + 0.7)) as f32;
        assert!((truth.disparity.get(7, 5) - expected).abs() < 1e-4);
    }
}

#[test]
fn millimetres_and_compressed_depth_are_the_same_depths() {
    let topic = "/depth/compressedDepth";
    let millimetres: Vec<u16> = (0..24 * 16).map(|i| 500 + i).collect();
    let bytes: Vec<u8> = millimetres.iter().flat_map(|z| z.to_le_bytes()).collect();
    // Twelve bytes of the transport's own header, then the PNG.
    let png = [vec![0; 12], bag::png(SIZE, &millimetres)].concat();
    let compressed = |i, format, bytes: &[u8]| bag::ros_compressed(topic, stamp(i), format, bytes);
    let raw = |i| ros_image("/depth", stamp(i), SIZE, "16UC1", &bytes);
    let raws = first([raw(0), raw(1)], "/depth");
    let codes = Plane::from_vec(SIZE.0, SIZE.1, millimetres).unwrap();
    let rvl = svl::files::encode_rvl(&codes, None);
    for (format, bytes) in [
        ("16UC1; compressedDepth png", &png[..]),
        ("16UC1; compressedDepth", &png),
        ("mono16; compressedDepth png", &png),
        ("16UC1; compressedDepth rvl", &rvl),
        ("16UC1;compressedDepth rvl", &rvl),
        ("16UC1; png compressed ", &png[12..]),
        ("png", &png[12..]),
    ] {
        let others = first([0, 1].map(|i| compressed(i, format, bytes)), topic);
        assert_eq!(raws, others, "{format}");
        let message = bag::foxglove_compressed(topic, stamp(0), format, bytes);
        assert_eq!(raws, first([message], topic), "{format}");
    }
    assert!((raws.get(0, 0) - (FB / 0.5) as f32).abs() < 1e-4);
    let cut = &rvl[..rvl.len() - 4];
    let eight_bits = &svl::files::encode_png(24, 16, &[9; 24 * 16]).unwrap()[..];
    let png = &png[..];
    let last_pixel = "RVL | ends before its last pixel";
    let zstd = "compressedDepth zstd | PNG or RVL";
    let [float, colour] = ["32FC1", "rgb8"].map(|e| format!("'{e}' | 16UC1 in millimetres"));
    for (bytes, format, words) in [
        (cut, "16UC1; compressedDepth rvl", last_pixel),
        (png, "16UC1; compressedDepth zstd", zstd),
        (png, "16UC1; jpeg compressed ", "jpeg | a PNG of 16 bits"),
        (&[0; 11], "16UC1; compressedDepth png", "shorter | header"),
        (eight_bits, "32FC1; png compressed ", &float),
        (eight_bits, "rgb8; png compressed bgr8", &colour),
        (eight_bits, "png", "PNG | one channel of 16 bits"),
    ] {
        with([compressed(0, format, bytes)]).refused(topic, words);
    }
}

/// A stereo_msgs/msg/DisparityImage of the first pair: focal length, baseline, least disparity.
fn disparities(pixels: &[f32], size: (usize, usize), [f, baseline, min]: [f32; 3]) -> Message {
    let map = Plane::from_vec(size.0, size.1, pixels.to_vec()).unwrap();
    disparity_image(stamp(0), &map, [f, baseline, min, 400.0])
}

#[test]
fn a_disparity_image_is_the_depth_of_its_own_baseline() {
    let pixels: Vec<_> = (0..24 * 16u16).map(|i| f32::from(i) / 20.0 - 3.0).collect();
    // Twice the focal length and half the baseline of the pairs: the same depths.
    let with_focal = |focal: f32| [disparities(&pixels, SIZE, [focal, 0.022, 5.0])];
    let disparity = first(with_focal(656.0), "/disparity");
    for ((i, d), pixel) in (0..).zip(disparity.pixels()).zip(&pixels) {
        let expected = f64::from(*pixel);
        assert_eq!(d.is_finite(), expected >= 5.0, "{i}");
        let is_near = (f64::from(d) / expected - 1.0).abs() < 1e-6;
        assert!(expected < 5.0 || is_near, "{i}");
    }
    with(with_focal(0.0)).refused("/disparity", "no focal length");
    let reader = Reader::open(&with(with_focal(656.0)).saved()).unwrap();
    let topics = truth_topics(reader.recording(), &reader.facts().topics);
    assert_eq!(topics.unwrap(), ["/disparity"]);
}

#[test]
fn a_camera_info_of_a_wider_namespace_is_used_for_its_own_frame_alone() {
    let topic = "/rgbd/depth/image";
    let image = |i| depth32(i, SIZE, |x, _| 0.5 + x as f32 / 10.0).on(topic);
    let [k, p] = [[164.0, 12.0, 8.0]; 2];
    let [alone, other, own, beside] = [
        None,
        Some(("/rgbd/camera_info", "other")),
        Some(("/rgbd/camera_info", "cam")),
        Some(("/rgbd/depth/camera_info", "other")),
    ]
    .map(|info| {
        let info = info.map(|(topic, frame)| {
            let camera = Camera {
                frame,
                k,
                p,
                ..CAMERA
            };
            camera_info_of(topic, stamp(0), &camera)
        });
        first(info.into_iter().chain([image(0), image(1)]), topic)
    });
    // The pixels of the left camera, or those of one of half its focal length.
    assert_eq!(other, alone);
    assert_ne!(own, alone);
    assert_eq!(beside, own);
}

/// A matcher may halve its images first: a camera_info says whose pixels these are.
#[test]
fn a_disparity_image_of_half_the_size_is_refused_or_has_its_camera() {
    let message = disparities(&[4.0; 12 * 8], (12, 8), [164.0, 0.044, 1.0]);
    let words = "12x8 | 24x16 | no camera_info for that camera";
    with([message.clone()]).refused("/disparity", words);
    let camera = Camera {
        size: (12, 8),
        ..CAMERA
    };
    let info = camera_info_of("/disparity/camera_info", stamp(0), &camera);
    let disparity = first([info, message], "/disparity");
    let known: Vec<_> = disparity.pixels().filter(|d| d.is_finite()).collect();
    // Twice as many pixels at twice the disparity.
    let is_right = known.iter().all(|d| (d - 8.0).abs() < 0.01);
    assert!(known.len() > 9 && is_right, "{known:?}");
}

/// Disparity images have the pixels of the rectified camera, also beside raw images: those of
/// stereo_image_proc.
#[test]
fn a_disparity_image_beside_raw_images_is_of_the_rectified_camera() {
    // The distortion moves pixels at the border by 2 px.
    let raw = RAW.with(|camera| camera.d = &[-150.0, 0.0, 0.0, 0.0, 0.0]);
    // A slanted plane: a step of a pixel per pixel.
    let pixels = (0..24 * 16u16).map(|i| 4.0 + f32::from(i % 24) / 2.0);
    let slanted: Vec<_> = pixels.collect();
    let truth = disparities(&slanted, SIZE, [328.0, (FB / 328.0) as f32, 1.0]);
    let saved = Bag::new(raw.pair(0)).and([truth]).saved();
    let mut source = open(&saved, "/disparity").unwrap().source;
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
        message.at(stamp(i) + late_ns, message.log_time)
    };
    let known = |messages| {
        let truths = with(messages).truths("/depth").into_iter();
        truths
            .map(|truth| truth.map(|truth| truth.disparity.get(3, 3)))
            .collect::<Vec<_>>()
    };
    let nearest = known([at(0, 15_000_000, 1.0), at(0, 4_000_000, 2.0)]);
    assert_eq!(nearest, [Some((FB / 2.0) as f32), None]);
    // The limit itself counts: 20 ms.
    for (late_ns, is_near) in [(20_000_000, true), (20_000_001, false)] {
        let late = known([at(0, late_ns, 1.0), at(1, 0, 1.0)]).into_iter();
        assert!(late.map(|z| z.is_some()).eq([is_near, true]), "{late_ns}");
    }
}

#[test]
fn an_odd_measurement_costs_only_itself() {
    let depth = |i| depth32(i, SIZE, |_, _| 2.0);
    // A message twice, one of another size, and rows of unknown length.
    let small = depth32(1, (12, 8), |_, _| 2.0);
    for messages in [vec![depth(0), depth(1), depth(1)], vec![depth(0), small]] {
        let truths = with(messages).truths("/depth");
        assert!(truths.len() == 2 && truths[0].is_some() && truths[1].is_none());
    }
    let rowless = cloud_with("cam", stamp(0), &[[0.0, 0.0, 2.0]], false, 0);
    let seen = first([rowless], "/points").get(12, 8);
    assert!((seen - (FB / 2.0) as f32).abs() < 1e-4, "{seen}");
    let words = "1 pair | 2 measurements | unknown which belong together";
    with([depth(0), depth(0)]).refused("/depth", words);
}

#[test]
fn a_cloud_is_moved_into_the_left_camera() {
    // A lidar 0.5 m behind the camera and 0.2 m to its right; a point 2 m before the lidar.
    let (camera, lidar) = (
        ("base", "cam", [0.0; 3]),
        ("base", "lidar", [0.2, 0.0, -0.5]),
    );
    let seen = [-0.2, 0.0, 2.0];
    let points = [seen, [0.0, 0.0, 0.2], [f32::NAN; 3], [9.0, 0.0, 2.0]];
    let clouds = (0..2).map(|i| cloud("lidar", stamp(i), &points));
    let found = with(clouds).tf(&[camera, lidar]).truths("/points");
    assert!(found[0].is_some());
    let truth = found[1].as_ref().unwrap();
    assert_eq!(truth.kind.density, MapDensity::Sparse);
    let pixels = (0..16).flat_map(|y| (0..24).map(move |x| (x, y)));
    let known = pixels.filter(|&(x, y)| truth.disparity.get(x, y).is_finite());
    // The principal point: the second is behind the camera, the last outside of the image.
    assert_eq!(known.collect::<Vec<_>>(), [(12, 8)]);
    assert!((truth.disparity.get(12, 8) - (FB / 1.5) as f32).abs() < 1e-4);
}

#[test]
fn foxglove_s_clouds_scans_and_transforms_are_read() {
    let rotation = |y, w| {
        Some(fox::Quaternion {
            x: 0.0,
            y,
            z: 0.0,
            w,
        })
    };
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
            rotation: rotation(0.0, 1.0),
        }],
    };
    let schema = "foxglove.FrameTransforms";
    let transform = protobuf("/transforms", schema, START_NS, &transform);
    let cloud = |i| {
        let field = |(name, offset): (&str, u32)| fox::PackedElementField {
            name: name.into(),
            offset,
            r#type: 8,
        };
        let point = [0.0f64, 0.0, 2.5].map(f64::to_le_bytes).concat();
        let message = fox::PointCloud {
            timestamp: timestamp(stamp(i)),
            frame_id: "lidar".into(),
            pose: None,
            point_stride: 24,
            fields: [("x", 0), ("y", 8), ("z", 16)].map(field).into(),
            data: point.into(),
        };
        protobuf("/points", "foxglove.PointCloud", stamp(i), &message)
    };
    // A scan in the camera's frame, whose pose rotates its x-y plane into the z-x plane.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let scan = |i| {
        let message = fox::LaserScan {
            timestamp: timestamp(stamp(i)),
            frame_id: "cam".into(),
            pose: Some(fox::Pose {
                position: None,
                orientation: rotation(-half, half),
            }),
            start_angle: -0.1,
            end_angle: 0.0,
            ranges: vec![f64::NAN, f64::NAN, 2.0],
            intensities: vec![],
        };
        protobuf("/scan", "foxglove.LaserScan", stamp(i), &message)
    };
    let clouds = vec![transform, cloud(0), cloud(1)];
    for (messages, topic) in [(clouds, "/points"), (vec![scan(0), scan(1)], "/scan")] {
        let seen = first(messages, topic).get(12, 8);
        assert!((seen - (FB / 2.0) as f32).abs() < 1e-4, "{topic}: {seen}");
    }
}

#[test]
fn topics_that_are_no_truth_are_refused_in_one_line() {
    let depth = |i| depth32(i, SIZE, |_, _| 1.0);
    let small = depth32(0, (12, 8), |_, _| 1.0);
    with([small]).refused("/depth", "12x8 | 24x16 | camera_info");
    let words = "no such topic | distances are in /depth";
    with([depth(0)]).refused("/elsewhere", words);
    with([])
        .tf(&[])
        .refused("/tf_static", "TFMessage | PointCloud2");
    let image = |encoding, pixels| ros_image("/depth", stamp(0), SIZE, encoding, pixels);
    with([image("mono8", &[0; 384])]).refused("/depth", "16UC1");
    with([image("16UC1", &[0; 32])]).refused("/depth", "does not fit");
    let uncalibrated = Bag::new((0..2).flat_map(|i| STEREO.images(i)));
    let words = "calibration | --calib";
    uncalibrated.and([depth(0)]).refused("/depth", words);
    // A day later.
    let words = "1700000000.0 | 1700086 | measurements";
    with([depth(1_300_000)]).refused("/depth", words);
    let point = [[0.0, 0.0, 2.0]];
    let lidar = || with([cloud("lidar", stamp(0), &point)]);
    lidar().refused("/points", "'lidar' to 'cam' | no transform");
    let arm = lidar().tf(&[("base", "arm", [0.0; 3])]);
    arm.refused("/points", "base → arm");
    // A moving transform is not static.
    let moving = |from, to| [tf("/tf", &[(from, to, [0.0; 3])])];
    let words = "no transform | /tf has one | static_transform_publisher";
    lidar()
        .and(moving("cam", "lidar"))
        .refused("/points", words);
    // The chain consists of both.
    let both = lidar().tf(&[("cam", "base", [0.0; 3])]);
    both.and(moving("base", "lidar"))
        .refused("/points", "/tf has one");
    for (big_endian, row_step, words) in [(true, 12, "big-endian"), (false, 4, "rows of 4")] {
        let odd = cloud_with("cam", stamp(0), &point, big_endian, row_step);
        with([odd]).refused("/points", words);
    }
}

#[test]
fn a_recording_keeps_how_its_truth_was_measured() {
    let origin = |topic: &str| TruthOrigin::Sensor(topic.into());
    let kind = TruthKind {
        density: MapDensity::Sparse,
        origin: origin("/points"),
    };
    let mut frame = full(0, SIZE);
    frame.truth.as_mut().unwrap().kind = kind.clone();
    let folder = tempfile::tempdir().unwrap();
    let path = record(folder.path(), &[frame], ImageFormat::Raw);
    let own = intact(&path)[0].truth.clone().unwrap();
    assert_eq!(own.kind, kind);
    // The recording's own truth, as a topic: the same, except for the stated origin.
    let mut source = open(&path, "/truth/depth").unwrap().source;
    let again: Truth = source.next().unwrap().unwrap().truth.unwrap();
    assert_eq!(again.disparity, own.disparity);
    assert_eq!(again.kind.origin, origin("/truth/depth"));
}
