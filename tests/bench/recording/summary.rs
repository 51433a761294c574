//! Summaries of recordings, as `svl info` shows them.

use super::bag::{self, Bag, Message, SIZE};
use super::frames::{PERIOD_NS, bare, full, record, stamp, summarize};
use super::says::Says;
use svl::recording::{Gap, ImageFormat, RecordingSummary, UnpairedImages};
use svl::stereo::Frame;

/// An image of a bag at a multiple of the period.
fn image(topic: &'static str, i: u64) -> Message {
    bag::ros_image(topic, i * PERIOD_NS, SIZE, "mono8", &[7; 24 * 16])
}

/// A gap of so many periods after a frame.
fn gap(frame: &Frame, periods: u64) -> Gap {
    Gap {
        after_ns: frame.stamp_ns,
        length_ns: periods * PERIOD_NS,
    }
}

#[test]
fn a_summary_knows_counts_gaps_and_skew() {
    let folder = tempfile::tempdir().unwrap();
    let skews = [3, -5, 8, 1, 2, 0, 4];
    let frames: Vec<Frame> = (0..7)
        .map(|i| {
            let mut frame = full(i, SIZE);
            frame.stamp_ns += if i > 3 { 2 * PERIOD_NS } else { 0 };
            frame.exposure.skew_ns = Some(skews[i as usize]);
            frame
        })
        .collect();
    let summary = summarize(&record(folder.path(), &frames, ImageFormat::Raw)).unwrap();
    assert!(summary.is_intact());
    let counts = (summary.pairs, summary.period_ns, summary.drops);
    assert_eq!(counts, (7, Some(PERIOD_NS), 2));
    assert_eq!(summary.gaps, [gap(&frames[3], 3)]);
    let skew = summary.skew.clone().unwrap();
    assert_eq!((skew.min_ns, skew.median_ns, skew.max_ns), (-5, 2, 8));
    let binned = skew.histogram.iter().map(|bin| bin.pairs);
    assert_eq!(binned.sum::<u64>(), summary.pairs);
    assert_eq!(summary.duration_ns(), 8 * PERIOD_NS + 4);
    assert_eq!(summary.header.unwrap().source, "test");
    let topics = summary.topics.iter();
    let topics = topics.map(|t| (t.name.as_str(), t.schema.as_str(), t.messages));
    let expected = [
        ("/rig/baseline", "foxglove.FrameTransform", 7),
        ("/rig/pose", "foxglove.FrameTransform", 7),
        ("/stereo/left/calibration", "foxglove.CameraCalibration", 7),
        ("/stereo/left/image", "foxglove.RawImage", 7),
        ("/stereo/right/calibration", "foxglove.CameraCalibration", 7),
        ("/stereo/right/image", "foxglove.RawImage", 7),
        ("/stereo/sync", "svl.StereoSync", 7),
        ("/truth/depth", "sensor_msgs/msg/Image", 7),
        ("/truth/surface", "foxglove.RawImage", 7),
        ("/truth/visibility", "foxglove.RawImage", 7),
    ];
    assert_eq!(topics.collect::<Vec<_>>(), expected);
    let rate = summary.topics[0].rate_hz.unwrap();
    assert!((rate - 6.0 / (8.0 * PERIOD_NS as f64 / 1e9)).abs() < 1e-9);
}

#[test]
fn a_bag_has_the_gaps_of_its_left_images() {
    // Sixty pairs without the second ten, and images of a third camera all along.
    let pair = |i| ["/cam0/image", "/cam1/image"].map(|topic| image(topic, i));
    let pairs = (1..60).filter(|i| !(10..20).contains(i)).flat_map(pair);
    let other = Bag::new((1..60).map(|i| image("/depth/image", i)));
    let summary = summarize(&Bag::new(pairs).and(other.clone()).saved()).unwrap();
    let stereo = ["/cam0/image", "/cam1/image"].map(str::to_owned);
    assert_eq!(summary.stereo, Some(stereo));
    let [gap] = &summary.gaps[..] else {
        panic!("{:?}", summary.gaps)
    };
    assert_eq!(summary.period_ns, Some(PERIOD_NS));
    assert_eq!(gap.length_ns, 11 * PERIOD_NS);
    let by_log_time = 9 * PERIOD_NS..10 * PERIOD_NS;
    assert!(by_log_time.contains(&gap.after_ns));
    let summary = summarize(&other.saved()).unwrap();
    let found = (summary.stereo, summary.period_ns, summary.gaps);
    assert_eq!(found, (None, None, vec![]));
}

#[test]
fn a_bag_s_images_without_a_partner_are_counted_at_its_edges_and_inside() {
    // The left camera runs alone before the 4th and behind the 20th period, the right one misses
    // two.
    let lefts = (1..24).map(|i| image("/cam0/image", i));
    let rights = (4..20).filter(|i| ![9, 10].contains(i));
    let bag = Bag::new(lefts).and(rights.map(|i| image("/cam1/image", i)));
    let summary = summarize(&bag.saved()).unwrap();
    let unpaired = UnpairedImages {
        before: 3,
        inside: 2,
        after: 4,
    };
    assert_eq!((summary.pairs, summary.unpaired), (14, Some(unpaired)));
    assert_eq!(summary.skew.map(|skew| skew.max_ns), Some(0));
}

#[test]
fn clocks_that_jump_are_no_gaps() {
    let folder = tempfile::tempdir().unwrap();
    // svl's own recording, whose log times are its stamps, after a clock that was set back by 20 s.
    let frames: Vec<Frame> = (0..20)
        .map(|i| {
            let mut frame = bare(i, SIZE);
            frame.stamp_ns -= if i < 10 { 0 } else { 20_000_000_000 };
            // A gap of two periods behind the jump.
            frame.stamp_ns += if i < 15 { 0 } else { PERIOD_NS };
            frame
        })
        .collect();
    let summary = summarize(&record(folder.path(), &frames, ImageFormat::Raw)).unwrap();
    let jumps = |summary: &RecordingSummary| -> Vec<_> {
        let jumps = summary.clock_jumps.iter();
        jumps.map(|jump| (jump.after_ns, jump.by_ns)).collect()
    };
    let back = -20_000_000_000 + PERIOD_NS as i64;
    assert_eq!(jumps(&summary), [(frames[9].stamp_ns, back)]);
    let gap = gap(&frames[14], 2);
    let found = (summary.period_ns, summary.gaps);
    assert_eq!(found, (Some(PERIOD_NS), vec![gap]));

    // A bag whose stamps jump ahead and back again, while its log times go on.
    let hour = 3_600_000_000_000;
    let messages = |i: u64| {
        let jump_ns = if (10..20).contains(&i) {
            hour as u64
        } else {
            0
        };
        ["/cam0/image", "/cam1/image"].map(|topic| image(topic, i).at(stamp(i) + jump_ns, stamp(i)))
    };
    let summary = summarize(&Bag::new((1..30).flat_map(messages)).saved()).unwrap();
    let expected = [(stamp(9), hour), (stamp(19) + hour as u64, -hour)];
    assert_eq!(jumps(&summary), expected);
    assert_eq!((summary.period_ns, summary.gaps), (Some(PERIOD_NS), vec![]));
}

#[test]
fn a_truncated_file_is_summed_up_as_far_as_it_goes() {
    let folder = tempfile::tempdir().unwrap();
    let frames: Vec<_> = (0..40).map(|i| bare(i, (200, 150))).collect();
    let path = record(folder.path(), &frames, ImageFormat::Png);
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() * 2 / 3]).unwrap();
    let summary = summarize(&path).unwrap();
    summary.damage.as_ref().unwrap().says("incomplete");
    assert!((1..40).contains(&summary.pairs), "{} pairs", summary.pairs);
}
