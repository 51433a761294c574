//! ROS 2 bags and Foxglove recordings as sources.

use super::bag::{
    self, CAMERA, Camera, Message, camera_info, camera_info_of, json_calibration, ros_image,
};
use super::frames::{PERIOD_NS, START_NS, image, one_line, read, stamp};
use crate::common::assert_says;
use ::image::codecs::jpeg::JpegEncoder;
use std::path::{Path, PathBuf};
use svl::files::SideBySide;
use svl::losses::Losses;
use svl::recording::{Reader, Recording, Selection};
use svl::source::{RecordingSource, Source};
use svl::stereo::{Frame, Gray};

const SIZE: (usize, usize) = (24, 16);
const LEFT: &str = "/cam0/image_rect";
const RIGHT: &str = "/cam1/image_rect";

fn bytes(image: &Gray) -> Vec<u8> {
    image.pixels().collect()
}

/// Pair `i`, its right image `skew_ns` later.
fn pair(i: u64, skew_ns: u64) -> [Message; 2] {
    let [left, right] = [2 * i, 2 * i + 1].map(|seed| bytes(&image(SIZE, seed)));
    [
        ros_image(LEFT, stamp(i), SIZE, "mono8", &left),
        ros_image(RIGHT, stamp(i) + skew_ns, SIZE, "mono8", &right),
    ]
}

fn write_bag(messages: impl IntoIterator<Item = Message>) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = bag::write(folder.path(), &messages.into_iter().collect::<Vec<_>>());
    (folder, path)
}

fn complaint(path: &Path) -> String {
    one_line(path, &Reader::open(path).err().expect("it is bad"))
}

#[test]
fn a_bag_of_rectified_images_has_pairs_stamps_and_a_rig() {
    let infos = |i| {
        [
            camera_info("/cam0/camera_info", stamp(i), &[0.1], 0.0),
            camera_info("/cam1/camera_info", stamp(i), &[0.1], -14.432),
        ]
    };
    let scan = Message {
        topic: "/scan",
        schema: "sensor_msgs/msg/LaserScan",
        encoding: "cdr",
        log_time: 9,
        data: vec![1],
    };
    // The calibrations come after their images.
    let (_folder, path) = write_bag(
        (0..10)
            .flat_map(|i| pair(i, 2_000).into_iter().chain(infos(i)))
            .chain([scan]),
    );
    let mut source = RecordingSource::open(&path).unwrap();
    assert!(source.reader().facts().remarks.is_empty() && source.reader().header().is_none());
    for i in 0..10 {
        let Frame {
            sequence,
            stamp_ns,
            pair,
            geometry,
            exposure,
            ..
        } = source.next().unwrap().unwrap();
        assert_eq!(
            (sequence, stamp_ns, exposure.skew_ns),
            (i, stamp(i), Some(2_000)),
            "by the header's stamp, not log time"
        );
        assert_eq!(
            (pair.left(), pair.right()),
            (&image(SIZE, 2 * i), &image(SIZE, 2 * i + 1))
        );
        let rig = geometry.rig().unwrap();
        assert!(
            (rig.focal_px(), rig.center_px()) == (328.0, (12.0, 8.0))
                && (rig.baseline_m() - 0.044).abs() < 1e-12
        );
    }
    assert!(source.next().unwrap().is_none() && source.finish(0) == Losses::default());
}

#[test]
fn raw_images_are_called_so() {
    let [left, right] = pair(0, 0);
    let raw = |topic, message: Message| Message { topic, ..message };
    let (left, right) = (raw("/cam0/image_raw", left), raw("/cam1/image_raw", right));
    let infos = [
        camera_info("/cam0/camera_info", 9, &[-0.28, 0.0, 0.0, 0.0], 0.0),
        camera_info("/cam1/camera_info", 9, &[], -14.432),
    ];
    let (_folder, path) = write_bag(infos.into_iter().chain([left, right]));
    let mut reader = Reader::open(&path).unwrap();
    assert_eq!(reader.next_pair().unwrap().unwrap().rig().copied(), None);
    let remarks = reader.facts().remarks;
    assert!(
        remarks.len() == 1 && remarks[0].contains("not rectified"),
        "{remarks:?}"
    );
    let (_folder, path) = write_bag(pair(0, 0));
    let remarks = Reader::open(&path).unwrap().facts().remarks;
    assert!(
        remarks.len() == 1 && remarks[0].contains("no calibration of both cameras"),
        "{remarks:?}"
    );
}

#[test]
fn a_calibration_is_of_the_images_that_it_says() {
    let distances = |infos: [Message; 2]| {
        let (_folder, path) = write_bag(infos.into_iter().chain(pair(0, 0)));
        let mut reader = Reader::open(&path).unwrap();
        (
            reader.facts().remarks,
            reader.next_pair().unwrap().unwrap().rig().copied(),
        )
    };
    let infos = |size, binning, roi| {
        let camera = |tx| Camera {
            size,
            tx,
            binning,
            roi,
            ..CAMERA
        };
        [("/cam0/camera_info", 0.0), ("/cam1/camera_info", -14.432)]
            .map(|(topic, tx)| camera_info_of(topic, 9, &camera(tx)))
    };
    let (remarks, rig) = distances(infos((48, 32), 2, [0; 4]));
    let rig = rig.unwrap();
    assert!(
        remarks.is_empty() && (rig.focal_px(), rig.center_px()) == (164.0, (6.0, 4.0)),
        "{rig:?}"
    );
    assert!((rig.baseline_m() - 0.044).abs() < 1e-12, "{rig:?}");
    let (remarks, rig) = distances(infos((640, 480), 1, [10, 5, 16, 24]));
    assert!(remarks.is_empty() && rig.unwrap().center_px() == (2.0, 3.0));
    let json = |size| {
        [("/cam0/calibration", 0.0), ("/cam1/calibration", -14.432)]
            .map(|(topic, tx)| json_calibration(topic, 9, size, tx))
    };
    assert!(distances(json((24, 16))).1.is_some());
    for infos in [
        infos((48, 32), 0, [0; 4]),
        infos((24, 16), 2, [0; 4]),
        json((48, 32)),
    ] {
        let (remarks, rig) = distances(infos);
        assert!(rig.is_none() && remarks.len() == 1, "{remarks:?}");
        assert!(
            remarks[0].contains("disparities but no distances: the calibration is for images of"),
            "{remarks:?}"
        );
    }
    // A message that ends before them is invalid.
    let [left, right] = infos((24, 16), 0, [0; 4]);
    for length in (0..left.data.len() - 1).step_by(7) {
        let short = left.with(left.data[..length].to_vec());
        let (_folder, path) = write_bag(
            [short, right.with(right.data.clone())]
                .into_iter()
                .chain(pair(0, 0)),
        );
        let mut reader = Reader::open(&path).unwrap();
        assert_eq!(
            reader.facts().broken,
            [("/cam0/camera_info".into(), 1)].into()
        );
        let pair = reader.next_pair().unwrap().unwrap();
        assert!(pair.rig().is_none() && reader.facts().remarks.len() == 1);
    }
}

#[test]
fn raw_images_are_known_by_the_last_part_of_their_topics() {
    let rig = |[left, right]: [&'static str; 2]| {
        let [image_left, image_right] = pair(0, 0);
        let images = [
            Message {
                topic: left,
                ..image_left
            },
            Message {
                topic: right,
                ..image_right
            },
        ];
        let info = |topic, tx| camera_info(topic, 9, &[-0.28, 0.0, 0.0, 0.0], tx);
        let infos = [
            info("/director/left/camera_info", 0.0),
            info("/director/right/camera_info", -14.432),
        ];
        let (_folder, path) = write_bag(infos.into_iter().chain(images));
        let mut reader = Reader::open(&path).unwrap();
        (
            reader.facts().calibration.is_some(),
            reader.next_pair().unwrap().unwrap().rig().is_some(),
        )
    };
    assert_eq!(
        rig(["/director/left/image_raw", "/director/right/image_raw"]),
        (true, false)
    );
    assert_eq!(
        rig([
            "/director/left/image_unrectified",
            "/director/right/image_unrectified"
        ]),
        (true, false)
    );
    assert_eq!(
        rig(["/director/left/image_rect", "/director/right/image_rect"]),
        (false, true)
    );
}

#[test]
fn both_images_may_be_in_one_topic() {
    let wide = |i: u64| {
        let [left, right] = [2 * i, 2 * i + 1].map(|seed| bytes(&image(SIZE, seed)));
        let rows = left.chunks(SIZE.0).zip(right.chunks(SIZE.0));
        let rows: Vec<u8> = rows.flat_map(|(l, r)| [l, r].concat()).collect();
        ros_image(
            "/stereo/image",
            stamp(i),
            (2 * SIZE.0, SIZE.1),
            "mono8",
            &rows,
        )
    };
    let (_folder, path) = write_bag((0..5).map(wide));
    assert!(complaint(&path).contains("--side-by-side if each shows both cameras"));
    let selection = Selection {
        side_by_side: Some(SideBySide::LeftRight),
        ..Selection::default()
    };
    let mut reader = Reader::new(Recording::open(&path).unwrap(), &selection).unwrap();
    for i in 0..5 {
        let frame = reader.next_pair().unwrap().unwrap();
        assert_eq!(frame.pair.left(), &image(SIZE, 2 * i));
        assert_eq!(frame.pair.right(), &image(SIZE, 2 * i + 1));
        assert_eq!(
            (frame.stamp_ns, frame.exposure.skew_ns),
            (stamp(i), Some(0))
        );
    }
    assert!(reader.next_pair().unwrap().is_none());
    let named = Selection {
        right: Some("/stereo/image".to_owned()),
        ..selection
    };
    let wrong = Reader::new(Recording::open(&path).unwrap(), &named)
        .err()
        .unwrap();
    assert!(wrong.to_string().contains("leave --right out"), "{wrong}");
}

#[test]
fn calibrations_elsewhere_are_used_unless_a_frame_differs() {
    let found = |frames: [&str; 2], infos: [&'static str; 2]| {
        let pixels = bytes(&image(SIZE, 3));
        let images = [(LEFT, frames[0]), (RIGHT, frames[1])].map(|(topic, frame)| {
            bag::ros_image_in(frame, topic, stamp(0), SIZE, ("mono8", &pixels))
        });
        let infos = [
            camera_info(infos[0], 9, &[], 0.0),
            camera_info(infos[1], 9, &[], -14.432),
        ];
        let (_folder, path) = write_bag(infos.into_iter().chain(images));
        let mut reader = Reader::open(&path).unwrap();
        reader.next_pair().unwrap().unwrap().rig().is_some()
    };
    let infos = ["/calibrations/left", "/calibrations/right"];
    // The calibrations are of the frame 'cam'.
    assert!(found(["cam", "cam"], infos));
    assert!(found(["", ""], infos));
    // ROS 1 writes frames with a leading slash.
    assert!(found(["/cam", "cam"], infos));
    assert!(!found(["cam", "other"], infos));
    assert!(!found(["cam", "other"], ["/info_left", "/info_right"]));
    // Calibrations of the cameras' own namespaces need no name of a frame.
    assert!(found(
        ["a", "b"],
        ["/cam0/camera_info", "/cam1/camera_info"]
    ));
}

#[test]
fn a_compressed_mosaic_is_that_mosaic() {
    let pixels = bytes(&image(SIZE, 3));
    let png = svl::files::encode_png(SIZE.0, SIZE.1, &pixels).unwrap();
    let left = |message: Message| {
        let (_folder, path) =
            write_bag([message, ros_image(RIGHT, stamp(0), SIZE, "mono8", &pixels)]);
        bytes(read(&path).0[0].pair.left())
    };
    let compressed = |format| left(bag::ros_compressed(LEFT, stamp(0), format, &png));
    let raw = left(ros_image(LEFT, stamp(0), SIZE, "bayer_grbg8", &pixels));
    assert_ne!(raw, pixels);
    assert_eq!(compressed("bayer_grbg8; png compressed "), raw);
    assert_eq!(compressed("mono8; png compressed "), pixels);
    // Three channels: its colours were demosaiced before.
    let colours = svl::files::encode_png(
        SIZE.0,
        SIZE.1,
        &pixels.iter().flat_map(|&p| [p; 3]).collect::<Vec<_>>(),
    )
    .unwrap();
    assert_eq!(
        left(bag::ros_compressed(
            LEFT,
            stamp(0),
            "bayer_grbg8; png compressed bgr8",
            &colours
        )),
        pixels
    );
}

/// The image in every format that is read, on the left, with the largest error of its pixels.
fn forms(grey: &Gray) -> Vec<(Message, i32)> {
    let pixels = bytes(grey);
    let spread = |n: usize| pixels.iter().flat_map(|&p| vec![p; n]).collect::<Vec<_>>();
    let png = svl::files::encode_png(SIZE.0, SIZE.1, &pixels).unwrap();
    let with_chroma = [&pixels[..], &vec![99; pixels.len() / 2]].concat();
    let mut jpeg = Vec::new();
    let colour = ::image::ExtendedColorType::Rgb8;
    JpegEncoder::new_with_quality(&mut jpeg, 100)
        .encode(&spread(3), SIZE.0 as u32, SIZE.1 as u32, colour)
        .unwrap();
    let (size, at) = (SIZE, stamp(0));
    vec![
        (ros_image(LEFT, at, size, "mono8", &pixels), 0),
        (ros_image(LEFT, at, size, "mono16", &spread(2)), 0),
        (ros_image(LEFT, at, size, "rgb8", &spread(3)), 0),
        (ros_image(LEFT, at, size, "bgr8", &spread(3)), 0),
        (ros_image(LEFT, at, size, "rgba8", &spread(4)), 0),
        (ros_image(LEFT, at, size, "bgra8", &spread(4)), 0),
        (ros_image(LEFT, at, size, "16UC1", &spread(2)), 0),
        (ros_image(LEFT, at, size, "rgb16", &spread(6)), 0),
        (ros_image(LEFT, at, size, "bgr16", &spread(6)), 0),
        (ros_image(LEFT, at, size, "yuv422_yuy2", &spread(2)), 0),
        (ros_image(LEFT, at, size, "yuyv", &spread(2)), 0),
        (ros_image(LEFT, at, size, "uyvy", &spread(2)), 0),
        // Interpolated between pixels that differ by noise.
        (ros_image(LEFT, at, size, "bayer_rggb8", &pixels), 30),
        (
            bag::ros_compressed(LEFT, at, "mono8; png compressed", &png),
            0,
        ),
        (
            bag::ros_compressed(LEFT, at, "rgb8; jpeg compressed bgr8", &jpeg),
            6,
        ),
        (bag::foxglove_raw(LEFT, at, size, ("mono8", &pixels)), 0),
        (bag::foxglove_raw(LEFT, at, size, ("nv12", &with_chroma)), 0),
        (bag::foxglove_compressed(LEFT, at, "png", &png), 0),
        (bag::foxglove_compressed(LEFT, at, "jpeg", &jpeg), 6),
        (bag::json_raw(LEFT, at, size, &pixels), 0),
    ]
}

#[test]
fn every_form_of_an_image_gives_its_pixels() {
    let grey = image(SIZE, 3);
    for (left, tolerance) in forms(&grey) {
        let form = format!(
            "{} {}, {} bytes",
            left.schema,
            left.encoding,
            left.data.len()
        );
        let (_folder, path) = write_bag([
            left,
            ros_image(RIGHT, stamp(0), SIZE, "mono8", &bytes(&grey)),
        ]);
        let (frames, error) = read(&path);
        assert!(
            error.is_none() && frames.len() == 1 && frames[0].stamp_ns == stamp(0),
            "{form}: {error:?}"
        );
        let off = frames[0]
            .pair
            .left()
            .pixels()
            .zip(grey.pixels())
            .map(|(a, b)| (i32::from(a) - i32::from(b)).abs());
        assert!(off.max().unwrap() <= tolerance, "{form}");
    }
}

#[test]
fn no_form_of_an_image_that_is_cut_off_gives_other_pixels() {
    let grey = image(SIZE, 3);
    let left_of = |message| {
        let (_folder, path) = write_bag([
            message,
            ros_image(RIGHT, stamp(0), SIZE, "mono8", &bytes(&grey)),
        ]);
        read(&path).0.first().map(|frame| bytes(frame.pair.left()))
    };
    for (whole, _) in forms(&grey) {
        let whole_left = left_of(whole.with(whole.data.clone())).unwrap();
        for length in (0..whole.data.len()).step_by(11) {
            // The missing part may be the camera's name, which comes last in some.
            let left = left_of(whole.with(whole.data[..length].to_vec()));
            assert!(
                left.is_none_or(|left| left == whole_left),
                "{}: {length} bytes",
                whole.schema
            );
        }
    }
}

#[test]
fn the_unpaired_are_counted_and_the_skew_is_bounded() {
    // Every fifth right image is missing; every seventh is 6 ms late.
    let skew = |i: u64| if i % 7 == 6 { 6_000_000 } else { 50_000 };
    let messages = (0..35).flat_map(|i| {
        let [left, right] = pair(i, skew(i));
        std::iter::once(left).chain((i % 5 != 4).then_some(right))
    });
    let (_folder, path) = write_bag(messages);
    let pairs = |max_skew_ns| {
        let selection = Selection {
            max_skew_ns,
            ..Selection::default()
        };
        let mut reader = Reader::new(Recording::open(&path).unwrap(), &selection).unwrap();
        let stamps = std::iter::from_fn(|| reader.next_pair().unwrap())
            .map(|frame| (frame.stamp_ns, frame.exposure));
        let stamps = stamps.collect::<Vec<_>>();
        let facts = reader.facts();
        assert_eq!(
            facts.outside, 1,
            "the last image, which may have no partner"
        );
        (stamps, facts.unpaired_ns.len() as u64)
    };
    let (wide, unpaired) = pairs(7_000_000);
    assert_eq!((wide.len(), unpaired), (28, 6));
    assert!(
        wide.iter()
            .all(|(_, exposure)| [Some(6_000_000), Some(50_000)].contains(&exposure.skew_ns))
    );
    let (narrow, unpaired) = pairs(Selection::MAX_SKEW_NS);
    assert_eq!((narrow.len(), unpaired), (24, 6 + 2 * 4));
    assert!(
        narrow
            .iter()
            .all(|(_, exposure)| exposure.skew_ns == Some(50_000))
    );
    assert_eq!(narrow[23].1.drops, unpaired);
    let never = Selection {
        max_skew_ns: 10,
        ..Selection::default()
    };
    let error = Reader::new(Recording::open(&path).unwrap(), &never)
        .err()
        .unwrap()
        .to_string();
    assert_says(
        &error,
        &["within 0.00001 ms of each other: at best 0.05 ms, see --max-skew-ms"],
    );
}

#[test]
fn a_pair_that_cannot_be_read_costs_only_itself() {
    let left_out = |bad: &[u64]| {
        let messages = (0..12).flat_map(|i| {
            let [left, right] = pair(i, 0);
            let nothing =
                |topic| bag::ros_compressed(topic, stamp(i), "mono8; png compressed", &[]);
            if !bad.contains(&i) {
                [left, right]
            } else if i % 2 == 0 {
                [nothing(LEFT), right]
            } else {
                // It still counts as one pair.
                [nothing(LEFT), nothing(RIGHT)]
            }
        });
        let (_folder, path) = write_bag(messages);
        let mut source = RecordingSource::open(&path)?;
        let stamps = std::iter::from_fn(|| source.next().unwrap())
            .map(|frame| (frame.stamp_ns - START_NS) / PERIOD_NS);
        let stamps = stamps.collect::<Vec<_>>();
        let losses = source.finish(0);
        Ok::<_, svl::Error>((stamps, losses.unreadable, losses.unpaired))
    };
    assert_eq!(
        left_out(&[6]).unwrap(),
        ([0, 1, 2, 3, 4, 5, 7, 8, 9, 10, 11].into(), 1, 0)
    );
    assert_eq!(left_out(&[0, 1, 2, 11]).unwrap(), ((3..11).collect(), 4, 0));
    let error = left_out(&(0..12).collect::<Vec<_>>())
        .unwrap_err()
        .to_string();
    assert!(
        error.contains(&format!("the pair at {START_NS} ns: {LEFT}: its image")),
        "{error}"
    );
}

#[test]
fn unpaired_images_are_reported() {
    let (_folder, path) = write_bag([pair(0, 0).into_iter().next().unwrap()]);
    assert!(complaint(&path).contains("/cam0/image_rect is its only topic of images"));
    let other = |i| Message {
        topic: "/cam2/image_rect",
        ..pair(i, 0).into_iter().next().unwrap()
    };
    let (_folder, path) = write_bag(pair(0, 0).into_iter().chain([other(0)]));
    let text = complaint(&path);
    assert!(
        text.contains(
            "--left TOPIC --right TOPIC; it has /cam0/image_rect, /cam1/image_rect, /cam2"
        ),
        "{text}"
    );
    let [left, _] = pair(0, 0);
    let small = ros_image(RIGHT, stamp(0), (12, 16), "mono8", &[9; 12 * 16]);
    let (_folder, path) = write_bag([left, small]);
    assert!(complaint(&path).contains("left image is 24x16, right image is 12x16"));
    let [left, right] = pair(0, 0);
    let other = Message {
        encoding: "xml",
        ..right
    };
    let (_folder, path) = write_bag([left, other]);
    assert!(complaint(&path).contains("is in 'xml', svl reads cdr, ros1, protobuf and json"));
    let [left, right] = pair(0, 0);
    let (_folder, path) = write_bag([
        Message {
            data: left.data[..60].to_vec(),
            ..left
        },
        right,
    ]);
    assert!(complaint(&path).contains("its CDR cannot be read"));
    let [left, right] = pair(0, 0).map(|whole| whole.with(vec![0x28, 0xB5, 0x2F, 0xFD, 4, 0]));
    let (_folder, path) = write_bag([left, right]);
    assert!(complaint(&path).contains("it is compressed with zstd and cannot be unpacked"));
}

#[test]
fn a_damaged_bag_gives_its_whole_pairs_and_says_so() {
    let (folder, path) = write_bag((0..12).flat_map(|i| pair(i, 0)));
    let bytes = std::fs::read(&path).unwrap();
    let is_true = |frame: &Frame| {
        let i = (frame.stamp_ns - START_NS) / PERIOD_NS;
        (frame.pair.left(), frame.pair.right()) == (&image(SIZE, 2 * i), &image(SIZE, 2 * i + 1))
    };
    let bad = folder.path().join("bad.mcap");
    let mut most = 0;
    for at in (0..bytes.len()).step_by(37) {
        std::fs::write(&bad, &bytes[..at]).unwrap();
        let (frames, error) = read(&bad);
        assert!(error.is_some() && frames.iter().all(is_true), "cut at {at}");
        most = most.max(frames.len());
        let mut flipped = bytes.clone();
        flipped[at] ^= 1 << (at % 8);
        std::fs::write(&bad, &flipped).unwrap();
        let (frames, error) = read(&bad);
        assert!(
            error.is_some() && frames.iter().all(is_true),
            "byte {at} changed"
        );
    }
    assert_eq!(most, 12);
}

#[test]
fn real_bags_hold_the_images_of_their_data_set() {
    let Some(folder) = crate::common::datasets() else {
        return;
    };
    let folder = folder.join("euroc-v1_01_easy");
    for bag in ["euroc_4frames_ros2.mcap", "euroc_4frames_foxglove_png.mcap"] {
        let (frames, error) = read(&folder.join(bag));
        assert!(error.is_none() && frames.len() == 4, "{bag}: {error:?}");
        for frame in frames {
            for (camera, image) in [("cam0", frame.pair.left()), ("cam1", frame.pair.right())] {
                let png = folder.join(format!("mav0/{camera}/data/{}.png", frame.stamp_ns));
                assert!(
                    *image == svl::files::read_gray(&png).unwrap(),
                    "{bag}: {}",
                    png.display()
                );
            }
            assert_eq!(frame.exposure.skew_ns, Some(0));
        }
        let remarks = Reader::open(folder.join(bag)).unwrap().facts().remarks;
        assert!(
            remarks.len() == 1 && remarks[0].contains("not rectified"),
            "{remarks:?}"
        );
    }
}
