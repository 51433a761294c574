//! ROS 2 bags and Foxglove recordings as sources.

use super::bag::{self, Bag, Message, RAW, SIZE, STEREO, Saved, Stereo, ros_image};
use super::frames::{PERIOD_NS, START_NS, bare, complaint, image, intact, read, stamp};
use super::says::Says;
use ::image::codecs::jpeg::JpegEncoder;
use std::path::Path;
use svl::files::SideBySide;
use svl::losses::Losses;
use svl::recording::{Reader, Recording, Selection};
use svl::source::{RecordingSource, Source};
use svl::stereo::{Exposure, Frame, Gray, Rig};

const LEFT: &str = STEREO.images[0];
const RIGHT: &str = STEREO.images[1];

fn bytes(image: &Gray) -> Vec<u8> {
    image.pixels().collect()
}

/// Images of pairs, without calibrations.
fn images(pairs: impl IntoIterator<Item = u64>) -> Bag {
    Bag::new(pairs.into_iter().flat_map(|i| STEREO.images(i)))
}

/// The remarks on a bag, and the rig of its first pair.
fn opened(bag: &Bag) -> (Vec<String>, Option<Rig>) {
    let mut reader = Reader::open(&bag.saved()).unwrap();
    let rig = reader.next_pair().unwrap().unwrap().rig().copied();
    (reader.facts().remarks, rig)
}

/// Asserts that there is one remark, with these words.
#[track_caller]
fn remarks(remarks: &[String], words: &str) {
    assert_eq!(remarks.len(), 1, "{remarks:?}");
    remarks[0].as_str().says(words);
}

/// The reason why pairs of this selection cannot be read.
fn denied(path: &Path, selection: &Selection) -> svl::Error {
    let recording = Recording::open(path).unwrap();
    Reader::new(recording, selection).err().unwrap()
}

#[test]
fn a_bag_of_rectified_images_has_pairs_stamps_and_a_rig() {
    let distorted = STEREO.with(|camera| camera.d = &[0.1]);
    let pair = |i| {
        let [left, right] = distorted.images(i);
        let late = right.at(stamp(i) + 2_000, right.log_time + 2_000);
        // The calibrations come after their images.
        [left, late].into_iter().chain(distorted.infos(stamp(i)))
    };
    let scan = Message::cdr("/scan", "sensor_msgs/msg/LaserScan", 9, vec![1]);
    let saved = Bag::new((0..10).flat_map(pair)).and([scan]).saved();
    let mut source = RecordingSource::open(&saved).unwrap();
    assert!(source.reader.facts().remarks.is_empty() && source.reader.header().is_none());
    for i in 0..10 {
        let frame = source.next().unwrap().unwrap();
        // The header's stamp counts, not log time.
        assert_eq!((frame.sequence, frame.stamp_ns), (i, stamp(i)));
        assert_eq!(frame.exposure.skew_ns, Some(2_000));
        assert_eq!(frame.pair, bare(i, SIZE).pair);
        let rig = frame.rig().unwrap();
        assert_eq!((rig.focal_px(), rig.center_px()), (328.0, (12.0, 8.0)));
        assert!((rig.baseline_m() - 0.044).abs() < 1e-12);
    }
    assert!(source.next().unwrap().is_none() && source.finish(0) == Losses::default());
}

/// Raw cameras that show their images on these topics.
fn raw(images: [&'static str; 2], infos: [&'static str; 2]) -> Bag {
    let stereo = Stereo {
        images,
        infos,
        ..STEREO
    };
    let raw = stereo.with(|camera| camera.d = &[-0.28, 0.0, 0.0, 0.0]);
    Bag::new(raw.infos(9)).and(raw.images(0))
}

#[test]
fn raw_images_are_called_so() {
    let (said, rig) = opened(&raw(RAW.images, RAW.infos));
    assert_eq!(rig, None);
    remarks(&said, "not rectified");
    let said = Reader::open(&images([0]).saved()).unwrap().facts().remarks;
    remarks(&said, "no calibration of both cameras");
}

#[test]
fn a_calibration_is_of_the_images_that_it_says() {
    let distances = |infos: [Message; 2]| opened(&Bag::new(infos).and(STEREO.images(0)));
    let infos = |size, binning, roi| {
        let stereo = STEREO.with(|camera| {
            (camera.size, camera.binning, camera.roi) = (size, binning, roi);
        });
        stereo.infos(9)
    };
    let (said, rig) = distances(infos((48, 32), 2, [0; 4]));
    let rig = rig.unwrap();
    assert!(said.is_empty(), "{said:?}");
    assert_eq!((rig.focal_px(), rig.center_px()), (164.0, (6.0, 4.0)));
    assert!((rig.baseline_m() - 0.044).abs() < 1e-12, "{rig:?}");
    let (said, rig) = distances(infos((640, 480), 1, [10, 5, 16, 24]));
    assert!(said.is_empty() && rig.unwrap().center_px() == (2.0, 3.0));
    let json = |size| {
        let offsets = STEREO.cameras.map(|camera| camera.tx);
        [0, 1].map(|side| bag::json_calibration(STEREO.infos[side], 9, size, offsets[side]))
    };
    assert!(distances(json((24, 16))).1.is_some());
    let [larger, binned] = [infos((48, 32), 0, [0; 4]), infos((24, 16), 2, [0; 4])];
    for infos in [larger, binned, json((48, 32))] {
        let (said, rig) = distances(infos);
        assert!(rig.is_none());
        let words = "disparities but no distances: the calibration is for images of";
        remarks(&said, words);
    }
    // A message that ends before them is invalid.
    let [left, right] = STEREO.infos(9);
    for length in (0..left.data.len() - 1).step_by(7) {
        let infos = [left.cut(length), right.clone()];
        let mut reader = Reader::open(&Bag::new(infos).and(STEREO.images(0)).saved()).unwrap();
        let broken = [("/cam0/camera_info".into(), 1)].into();
        assert_eq!(reader.facts().broken, broken);
        let pair = reader.next_pair().unwrap().unwrap();
        assert!(pair.rig().is_none() && reader.facts().remarks.len() == 1);
    }
}

#[test]
fn raw_images_are_known_by_the_last_part_of_their_topics() {
    let rect = "/director/left/image_rect /director/right/image_rect";
    let unrectified = "/director/left/image_unrectified /director/right/image_unrectified";
    for (topics, is_raw) in [
        ("/director/left/image_raw /director/right/image_raw", true),
        (unrectified, true),
        (rect, false),
    ] {
        let (left, right) = topics.split_once(' ').unwrap();
        let infos = ["/director/left/camera_info", "/director/right/camera_info"];
        let mut reader = Reader::open(&raw([left, right], infos).saved()).unwrap();
        assert_eq!(reader.facts().calibration.is_some(), is_raw);
        let pair = reader.next_pair().unwrap().unwrap();
        assert_eq!(pair.rig().is_none(), is_raw);
    }
}

#[test]
fn both_images_may_be_in_one_topic() {
    let wide = |i: u64| {
        let pair = bare(i, SIZE).pair;
        let [left, right] = [pair.left(), pair.right()].map(bytes);
        let rows = left.chunks(SIZE.0).zip(right.chunks(SIZE.0));
        let rows: Vec<u8> = rows.flat_map(|(l, r)| [l, r].concat()).collect();
        let size = (2 * SIZE.0, SIZE.1);
        ros_image("/stereo/image", stamp(i), size, "mono8", &rows)
    };
    let saved = Bag::new((0..5).map(wide)).saved();
    complaint(&saved).says("--side-by-side if each shows both cameras");
    let mut selection = Selection {
        side_by_side: Some(SideBySide::LeftRight),
        ..Selection::default()
    };
    let mut reader = Reader::new(Recording::open(&saved).unwrap(), &selection).unwrap();
    for i in 0..5 {
        let frame = reader.next_pair().unwrap().unwrap();
        assert_eq!(frame.pair, bare(i, SIZE).pair);
        let times = (frame.stamp_ns, frame.exposure.skew_ns);
        assert_eq!(times, (stamp(i), Some(0)));
    }
    assert!(reader.next_pair().unwrap().is_none());
    selection.right = Some("/stereo/image".to_owned());
    denied(&saved, &selection).says("leave --right out");
}

#[test]
fn calibrations_elsewhere_are_used_unless_a_frame_differs() {
    // The calibrations are of the frame 'cam'.
    let elsewhere = ["/calibrations/left", "/calibrations/right"];
    for (frames, infos, is_used) in [
        (["cam", "cam"], elsewhere, true),
        (["", ""], elsewhere, true),
        // ROS 1 writes frames with a leading slash.
        (["/cam", "cam"], elsewhere, true),
        (["cam", "other"], elsewhere, false),
        (["cam", "other"], ["/info_left", "/info_right"], false),
        // Calibrations of the cameras' own namespaces need no name of a frame.
        (["a", "b"], STEREO.infos, true),
    ] {
        let infos = Stereo { infos, ..STEREO }.infos(9);
        let bag = Bag::new(infos).and(STEREO.in_frames(frames).images(0));
        assert_eq!(opened(&bag).1.is_some(), is_used, "{frames:?}");
    }
}

/// A pair of this left image.
fn pair_with(left: Message) -> Saved {
    let right = bytes(&image(SIZE, 3));
    let right = ros_image(RIGHT, stamp(0), SIZE, "mono8", &right);
    Bag(vec![left, right]).saved()
}

#[test]
fn a_compressed_mosaic_is_that_mosaic() {
    let pixels = bytes(&image(SIZE, 3));
    let png = |pixels: &[u8]| svl::files::encode_png(SIZE.0, SIZE.1, pixels).unwrap();
    let left = |message| bytes(read(&pair_with(message)).0[0].pair.left());
    let compressed = |format, png: &[u8]| left(bag::ros_compressed(LEFT, stamp(0), format, png));
    let grey = png(&pixels);
    let raw = left(ros_image(LEFT, stamp(0), SIZE, "bayer_grbg8", &pixels));
    assert_ne!(raw, pixels);
    assert_eq!(compressed("bayer_grbg8; png compressed ", &grey), raw);
    assert_eq!(compressed("mono8; png compressed ", &grey), pixels);
    // Three channels: its colours were demosaiced before.
    let colours = png(&pixels.iter().flat_map(|&p| [p; 3]).collect::<Vec<_>>());
    let demosaiced = compressed("bayer_grbg8; png compressed bgr8", &colours);
    assert_eq!(demosaiced, pixels);
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
    // Bytes of a pixel in each encoding of equal bytes.
    let raw = [
        ("mono8", 1),
        ("mono16", 2),
        ("rgb8", 3),
        ("bgr8", 3),
        ("rgba8", 4),
        ("bgra8", 4),
        ("16UC1", 2),
        ("rgb16", 6),
        ("bgr16", 6),
        ("yuv422_yuy2", 2),
        ("yuyv", 2),
        ("uyvy", 2),
    ];
    let raw = raw.map(|(form, n)| (ros_image(LEFT, at, size, form, &spread(n)), 0));
    let compressed = |format, bytes| bag::ros_compressed(LEFT, at, format, bytes);
    let others = [
        // Interpolated between pixels that differ by noise.
        (ros_image(LEFT, at, size, "bayer_rggb8", &pixels), 30),
        (compressed("mono8; png compressed", &png), 0),
        (compressed("rgb8; jpeg compressed bgr8", &jpeg), 6),
        (bag::foxglove_raw(LEFT, at, size, ("mono8", &pixels)), 0),
        (bag::foxglove_raw(LEFT, at, size, ("nv12", &with_chroma)), 0),
        (bag::foxglove_compressed(LEFT, at, "png", &png), 0),
        (bag::foxglove_compressed(LEFT, at, "jpeg", &jpeg), 6),
        (bag::json_raw(LEFT, at, size, &pixels), 0),
    ];
    raw.into_iter().chain(others).collect()
}

#[test]
fn every_form_of_an_image_gives_its_pixels() {
    let grey = image(SIZE, 3);
    for (left, tolerance) in forms(&grey) {
        let length = left.data.len();
        let form = format!("{} {}, {length} bytes", left.schema, left.encoding);
        let (frames, error) = read(&pair_with(left));
        assert!(error.is_none() && frames.len() == 1, "{form}: {error:?}");
        assert_eq!(frames[0].stamp_ns, stamp(0), "{form}");
        let pixels = frames[0].pair.left().pixels().zip(grey.pixels());
        let off = pixels.map(|(a, b)| (i32::from(a) - i32::from(b)).abs());
        assert!(off.max().unwrap() <= tolerance, "{form}");
    }
}

#[test]
fn no_form_of_an_image_that_is_cut_off_gives_other_pixels() {
    let left_of = |message| {
        let frames = read(&pair_with(message)).0;
        frames.first().map(|frame| bytes(frame.pair.left()))
    };
    for (whole, _) in forms(&image(SIZE, 3)) {
        let whole_left = left_of(whole.clone()).unwrap();
        for length in (0..whole.data.len()).step_by(11) {
            // The missing part may be the camera's name, which comes last in some.
            let is_right = left_of(whole.cut(length)).is_none_or(|left| left == whole_left);
            assert!(is_right, "{}: {length} bytes", whole.schema);
        }
    }
}

#[test]
fn the_unpaired_are_counted_and_the_skew_is_bounded() {
    // Every fifth right image is missing; every seventh is 6 ms late.
    let skew = |i: u64| if i % 7 == 6 { 6_000_000 } else { 50_000 };
    let messages = (0..35).flat_map(|i| {
        let [left, right] = STEREO.images(i);
        let right = right.at(stamp(i) + skew(i), right.log_time + skew(i));
        std::iter::once(left).chain((i % 5 != 4).then_some(right))
    });
    let saved = Bag::new(messages).saved();
    let within = |max_skew_ns| Selection {
        max_skew_ns,
        ..Selection::default()
    };
    let pairs = |max_skew_ns| {
        let recording = Recording::open(&saved).unwrap();
        let mut reader = Reader::new(recording, &within(max_skew_ns)).unwrap();
        let frames = std::iter::from_fn(|| reader.next_pair().unwrap());
        let exposures: Vec<_> = frames.map(|frame| frame.exposure).collect();
        let facts = reader.facts();
        // The last image may have no partner.
        assert_eq!(facts.outside, 1);
        (exposures, facts.unpaired_ns.len() as u64)
    };
    let (wide, unpaired) = pairs(7_000_000);
    assert_eq!((wide.len(), unpaired), (28, 6));
    let skews = [Some(6_000_000), Some(50_000)];
    let is_one = |exposure: &Exposure| skews.contains(&exposure.skew_ns);
    assert!(wide.iter().all(is_one));
    let (narrow, unpaired) = pairs(Selection::MAX_SKEW_NS);
    assert_eq!((narrow.len(), unpaired), (24, 6 + 2 * 4));
    let is_small = |exposure: &Exposure| exposure.skew_ns == Some(50_000);
    assert!(narrow.iter().all(is_small));
    assert_eq!(narrow[23].drops, unpaired);
    denied(&saved, &within(10))
        .says("within 0.00001 ms of each other: at best 0.05 ms, see --max-skew-ms");
}

#[test]
fn a_pair_that_cannot_be_read_costs_only_itself() {
    let left_out = |bad: &[u64]| {
        let messages = (0..12).flat_map(|i| {
            let format = "mono8; png compressed";
            let nothing = |topic| bag::ros_compressed(topic, stamp(i), format, &[]);
            let [left, right] = STEREO.images(i);
            match (bad.contains(&i), i % 2) {
                (false, _) => [left, right],
                (true, 0) => [nothing(LEFT), right],
                // It still counts as one pair.
                (true, _) => [nothing(LEFT), nothing(RIGHT)],
            }
        });
        let mut source = RecordingSource::open(&Bag::new(messages).saved())?;
        let frames = std::iter::from_fn(|| source.next().unwrap());
        let numbers = frames.map(|frame| (frame.stamp_ns - START_NS) / PERIOD_NS);
        let numbers: Vec<_> = numbers.collect();
        let losses = source.finish(0);
        Ok::<_, svl::Error>((numbers, losses.unreadable, losses.unpaired))
    };
    let others = [0, 1, 2, 3, 4, 5, 7, 8, 9, 10, 11].into();
    assert_eq!(left_out(&[6]).unwrap(), (others, 1, 0));
    assert_eq!(left_out(&[0, 1, 2, 11]).unwrap(), ((3..11).collect(), 4, 0));
    let all: Vec<_> = (0..12).collect();
    let words = format!("the pair at {START_NS} ns: {LEFT}: its image");
    left_out(&all).unwrap_err().says(&words);
}

#[test]
fn unpaired_images_are_reported() {
    let [left, right] = STEREO.images(0);
    let zstd = [&left, &right].map(|whole| whole.with(vec![0x28, 0xB5, 0x2F, 0xFD, 4, 0]));
    let named = "--left TOPIC --right TOPIC; it has /cam0/image_rect, /cam1/image_rect, /cam2";
    let sizes = "left image is 24x16, right image is 12x16";
    let packed = "it is compressed with zstd and cannot be unpacked";
    let unknown = "is in 'xml', svl reads cdr, ros1, protobuf and json";
    let small = ros_image(RIGHT, stamp(0), (12, 16), "mono8", &[9; 12 * 16]);
    let mut odd = right.clone();
    odd.encoding = "xml";
    let third = left.clone().on("/cam2/image_rect");
    let [left, right] = [&left, &right].map(|message| move || message.clone());
    for (messages, words) in [
        (vec![left()], "/cam0/image_rect is its only topic of images"),
        (vec![left(), right(), third], named),
        (vec![left(), small], sizes),
        (vec![left(), odd], unknown),
        (vec![left().cut(60), right()], "its CDR cannot be read"),
        (zstd.into(), packed),
    ] {
        complaint(&Bag(messages).saved()).says(words);
    }
}

#[test]
fn a_damaged_bag_gives_its_whole_pairs_and_says_so() {
    let saved = images(0..12).saved();
    let bytes = std::fs::read(&*saved).unwrap();
    let is_true = |frame: &Frame| {
        let i = (frame.stamp_ns - START_NS) / PERIOD_NS;
        frame.pair == bare(i, SIZE).pair
    };
    let path = saved.folder.path().join("bad.mcap");
    let pairs = |bad: &[u8], what: &str| {
        std::fs::write(&path, bad).unwrap();
        let (frames, error) = read(&path);
        assert!(error.is_some() && frames.iter().all(is_true), "{what}");
        frames.len()
    };
    let mut most = 0;
    for at in (0..bytes.len()).step_by(37) {
        most = most.max(pairs(&bytes[..at], &format!("cut at {at}")));
        let mut flipped = bytes.clone();
        flipped[at] ^= 1 << (at % 8);
        pairs(&flipped, &format!("byte {at} changed"));
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
        let frames = intact(&folder.join(bag));
        assert_eq!(frames.len(), 4, "{bag}");
        for frame in frames {
            for (camera, image) in [("cam0", frame.pair.left()), ("cam1", frame.pair.right())] {
                let png = folder.join(format!("mav0/{camera}/data/{}.png", frame.stamp_ns));
                let is_equal = *image == svl::files::read_gray(&png).unwrap();
                assert!(is_equal, "{bag}: {}", png.display());
            }
            assert_eq!(frame.exposure.skew_ns, Some(0));
        }
        let reader = Reader::open(folder.join(bag)).unwrap();
        remarks(&reader.facts().remarks, "not rectified");
    }
}
