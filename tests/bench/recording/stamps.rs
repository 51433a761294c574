//! Truth for pairs whose stamps are equal or zero, and truth far from its pair in time.

use super::bag::{Bag, FB, Message, SIZE, depth32, open, truths_in};
use super::frames::{PERIOD_NS, START_NS, full, record, stamp, summarize};
use svl::recording::ImageFormat;
use svl::source::{RecordingSource, Source};

/// A depth image of `z` metres.
fn depth(z: u64, stamp: u64) -> Message {
    depth32(0, SIZE, |_, _| z as f32).at(stamp, stamp)
}

/// Messages of that many pairs with the stamps of `stamp`.
fn stereo(count: u64, stamp: impl Fn(u64) -> u64) -> Bag {
    let one = Bag::pairs(1);
    let pair = |i| {
        one.clone()
            .each(|message| [message.at(stamp(i), START_NS + i)])
    };
    Bag::new((0..count).flat_map(pair))
}

/// The true depth of each pair, metres.
fn depths(bag: &Bag) -> Vec<Option<u64>> {
    let depth = |disparity: f32| (FB / f64::from(disparity)).round() as u64;
    let truths = truths_in(&bag.saved(), "/depth").into_iter();
    truths
        .map(|truth| Some(depth(truth?.disparity.get(3, 3))))
        .collect()
}

fn all(count: u64) -> Vec<Option<u64>> {
    (1..=count).map(Some).collect()
}

#[test]
fn pairs_of_one_stamp_get_truths_in_their_order() {
    let truths = || (1..=4).map(|z| depth(z, START_NS));
    let images = || stereo(4, |_| START_NS);
    assert_eq!(depths(&images().and(truths())), all(4));
    assert_eq!(depths(&Bag::new(truths()).and(images())), all(4));
    // Two of three stamps are shared.
    let second = |i: u64| START_NS + i / 2 * PERIOD_NS;
    let truths = (0..5).map(|i| depth(i + 1, second(i)));
    assert_eq!(depths(&Bag::new(truths).and(stereo(5, second))), all(5));
}

#[test]
fn stamps_that_were_never_set_are_those_of_one_moment_of_the_log() {
    let images = stereo(3, |_| 0).and((1..=3).map(|z| depth(z, 0)));
    let unset = images.each(|message| [message.at(0, START_NS)]);
    assert_eq!(depths(&unset), all(3));
}

#[test]
fn counts_that_differ_are_refused() {
    let with = |pairs, truths: u64, late_ns: u64| {
        let truths = (1..=truths).map(move |z| depth(z, START_NS + late_ns));
        stereo(pairs, |_| START_NS).and(truths)
    };
    for (pairs, truths, late_ns, counts) in [
        (3, 2, 0, "3 pairs | 2 measurements"),
        (1, 2, 0, "1 pair with | 2 measurements"),
        (2, 1, 0, "2 pairs | 1 measurement with"),
        (2, 2, 1000, "2 pairs | 2 measurements"),
    ] {
        let words = format!("{counts} | name another topic");
        with(pairs, truths, late_ns).refused("/depth", &words);
    }
    // A measurement farther than the limit belongs to no pair.
    let far = (5..7).map(|z| depth(z, START_NS + 1_000_000_000));
    assert_eq!(depths(&with(1, 1, 0).and(far)), all(1));
}

#[test]
fn a_truth_is_found_wherever_it_lies() {
    let images = || stereo(40, stamp);
    let truth = |i: u64| depth(i + 1, stamp(i));
    // The one for each pair, between two that are near but belong to others.
    let near = |i| [(90, stamp(i) - 2_000_000), (91, stamp(i) + 2_000_000)];
    let decoys = || (0..40).flat_map(near).map(|(z, stamp)| depth(z, stamp));
    let late = images().and(decoys()).and((0..40).map(truth));
    assert_eq!(depths(&late), all(40));
    let early = Bag::new((0..40).map(truth)).and(decoys()).and(images());
    assert_eq!(depths(&early), all(40));
    assert_eq!(depths(&images().and((0..40).rev().map(truth))), all(40));
    // One of them far after all others.
    let one = images().and((1..40).map(truth)).and([truth(0)]);
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
    // One right image is missing, and those after it wait for its partner.
    let mut lonely = stereo(6, |i| START_NS + i / 3 * PERIOD_NS);
    lonely.0.remove(4 * 2 + 3);
    let unset = stereo(4, |_| 0).each(|message| [message.at(0, 0)]);
    for (bag, pairs) in [(stereo(4, |_| START_NS), 4), (unset, 4), (lonely, 3)] {
        let saved = bag.saved();
        let summary = summarize(&saved).unwrap();
        let mut source = RecordingSource::open(&saved).unwrap();
        let frames = std::iter::from_fn(|| source.next().unwrap()).count() as u64;
        let losses = source.finish(frames);
        let unpaired = losses.unpaired + losses.outside;
        assert_eq!(summary.unpaired.unwrap().total(), unpaired);
        assert_eq!((summary.pairs, frames), (frames, pairs));
    }
}
