//! Truth for pairs whose stamps are equal or zero, and truth far from its pair in time.

use super::bag::{self, Message};
use super::frames::{PERIOD_NS, START_NS, full, record, stamp, summarize};
use super::sensor::{FB, SIZE, depth32, open, pairs, refused};
use svl::recording::ImageFormat;
use svl::source::{RecordingSource, Source};

/// The message with this stamp in its header and this log time.
pub(super) fn stamped(message: &Message, stamp: u64, log_time: u64) -> Message {
    let mut data = message.data.clone();
    data[4..8].copy_from_slice(&((stamp / 1_000_000_000) as u32).to_le_bytes());
    data[8..12].copy_from_slice(&((stamp % 1_000_000_000) as u32).to_le_bytes());
    Message {
        log_time,
        ..message.with(data)
    }
}

/// A depth image of `z` metres.
fn depth(z: u64, stamp: u64) -> Message {
    stamped(&depth32(0, SIZE, |_, _| z as f32), stamp, stamp)
}

/// Messages of that many pairs with the stamps of `stamp`.
fn stereo(count: u64, stamp: impl Fn(u64) -> u64) -> Vec<Message> {
    let one = &pairs()[..4];
    let pair = |i| one.iter().map(move |m| (m, i));
    let messages = (0..count).flat_map(pair);
    messages
        .map(|(message, i)| stamped(message, stamp(i), START_NS + i))
        .collect()
}

/// The true depth of each pair, metres.
fn depths(messages: &[Message]) -> Vec<Option<u64>> {
    let folder = tempfile::tempdir().unwrap();
    let path = bag::write(folder.path(), messages);
    let mut source = open(&path, "/depth").unwrap().source;
    let frames = std::iter::from_fn(|| source.next().unwrap());
    let depth = |disparity: f32| (FB / f64::from(disparity)).round() as u64;
    frames
        .map(|frame| Some(depth(frame.truth?.disparity.get(3, 3))))
        .collect()
}

fn all(count: u64) -> Vec<Option<u64>> {
    (1..=count).map(Some).collect()
}

#[test]
fn pairs_of_one_stamp_get_truths_in_their_order() {
    let truths = || (1..=4).map(|z| depth(z, START_NS));
    let images = || stereo(4, |_| START_NS);
    let after: Vec<_> = images().into_iter().chain(truths()).collect();
    assert_eq!(depths(&after), all(4));
    let before: Vec<_> = truths().chain(images()).collect();
    assert_eq!(depths(&before), all(4));
    // Two of three stamps are shared.
    let second = |i: u64| START_NS + i / 2 * PERIOD_NS;
    let truths = (0..5).map(|i| depth(i + 1, second(i)));
    let mixed: Vec<_> = truths.chain(stereo(5, second)).collect();
    assert_eq!(depths(&mixed), all(5));
}

#[test]
fn stamps_that_were_never_set_are_those_of_one_moment_of_the_log() {
    let images = stereo(3, |_| 0).into_iter();
    let images = images.map(|message| stamped(&message, 0, START_NS));
    let truths = (1..=3).map(|z| stamped(&depth(z, 0), 0, START_NS));
    assert_eq!(depths(&images.chain(truths).collect::<Vec<_>>()), all(3));
}

#[test]
fn counts_that_differ_are_refused() {
    let with = |pairs, truths: u64, late_ns: u64| {
        let truths = (1..=truths).map(move |z| depth(z, START_NS + late_ns));
        stereo(pairs, |_| START_NS).into_iter().chain(truths)
    };
    for (pairs, truths, late_ns, counts) in [
        (3, 2, 0, ["3 pairs", "2 measurements"]),
        (1, 2, 0, ["1 pair with", "2 measurements"]),
        (2, 1, 0, ["2 pairs", "1 measurement with"]),
        (2, 2, 1000, ["2 pairs", "2 measurements"]),
    ] {
        let [a, b] = counts;
        refused(
            with(pairs, truths, late_ns),
            "/depth",
            &[a, b, "name another topic"],
        );
    }
    // A measurement farther than the limit belongs to no pair.
    let far: Vec<_> = with(1, 1, 0)
        .chain((5..7).map(|z| depth(z, START_NS + 1_000_000_000)))
        .collect();
    assert_eq!(depths(&far), all(1));
}

#[test]
fn a_truth_is_found_wherever_it_lies() {
    let images = || stereo(40, stamp);
    let truth = |i: u64| depth(i + 1, stamp(i));
    // The one for each pair, between two that are near but belong to others.
    let near = |i: u64| {
        [
            depth(90, stamp(i) - 2_000_000),
            depth(91, stamp(i) + 2_000_000),
        ]
    };
    let decoys = || (0..40).flat_map(near);
    let late: Vec<_> = images()
        .into_iter()
        .chain(decoys())
        .chain((0..40).map(truth))
        .collect();
    assert_eq!(depths(&late), all(40));
    let early: Vec<_> = (0..40).map(truth).chain(decoys()).chain(images()).collect();
    assert_eq!(depths(&early), all(40));
    let reversed: Vec<_> = images()
        .into_iter()
        .chain((0..40).rev().map(truth))
        .collect();
    assert_eq!(depths(&reversed), all(40));
    // One of them far after all others.
    let others = (1..40).map(truth);
    let one: Vec<_> = images()
        .into_iter()
        .chain(others)
        .chain([truth(0)])
        .collect();
    assert_eq!(depths(&one), all(40));
}

#[test]
fn a_recording_whose_pairs_share_stamps_is_read_in_order() {
    let folder = tempfile::tempdir().unwrap();
    let mut frames: Vec<_> = (0..6).map(|i| full(i, (40, 30))).collect();
    frames
        .iter_mut()
        .for_each(|frame| frame.stamp_ns = START_NS);
    let path = record(folder.path(), &frames, ImageFormat::Raw);
    let mut source = RecordingSource::open(&path).unwrap();
    assert!(!source.seek(4).unwrap(), "their stamp does not say which");
    let mut source = open(&path, "/truth/depth").unwrap().source;
    for frame in &frames {
        let found = source.next().unwrap().unwrap();
        assert_eq!((found.sequence, &found.pair), (frame.sequence, &frame.pair));
        let [found, own] = [&found, frame].map(|f| &f.truth.as_ref().unwrap().disparity);
        assert!((found.get(9, 9) - own.get(9, 9)).abs() < 1e-3);
    }
}

#[test]
fn a_summary_pairs_as_a_source_does() {
    let folder = tempfile::tempdir().unwrap();
    let count = |messages: &[Message]| {
        let path = bag::write(folder.path(), messages);
        let summary = summarize(&path).unwrap();
        let mut source = RecordingSource::open(&path).unwrap();
        let frames = std::iter::from_fn(|| source.next().unwrap()).count() as u64;
        let losses = source.finish(frames);
        let unpaired = losses.unpaired + losses.outside;
        assert_eq!(
            (summary.pairs, summary.unpaired.unwrap().total()),
            (frames, unpaired)
        );
        frames
    };
    assert_eq!(count(&stereo(4, |_| START_NS)), 4);
    let unset = stereo(4, |_| 0).into_iter();
    let unset: Vec<_> = unset.map(|message| stamped(&message, 0, 0)).collect();
    assert_eq!(count(&unset), 4);
    // One right image is missing, and those after it wait for its partner.
    let is_missing = |at: usize| at % 4 == 3 && at / 4 == 2;
    let images = stereo(6, |i| START_NS + i / 3 * PERIOD_NS).into_iter();
    let images = images.enumerate().filter(|(at, _)| !is_missing(*at));
    let images: Vec<_> = images.map(|(_, message)| message).collect();
    assert_eq!(count(&images), 3);
}
