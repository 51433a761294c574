//! Each pair has the calibration of its own stamp, wherever the file has it.

use super::bag::{Bag, Message, RAW, STEREO, Stereo};
use super::frames::stamp;
use super::live_topics::pairs_of;
use super::says::Says;
use crate::cli::fixture::Fixture;
use std::path::Path;
use svl::recording::{Reader, TopicPairs};
use svl::stereo::Frame;

/// Cameras that show a region of their sensors, from column `x` on; those of raw images distort.
fn shot(
    cameras: Stereo<'static>,
    x: u32,
    size: (usize, usize),
    baseline_m: f64,
) -> Stereo<'static> {
    let is_raw = cameras.images == RAW.images;
    let cameras = Stereo { size, ..cameras }.offsets([0.0, -328.0 * baseline_m]);
    cameras.with(|camera| {
        let raw: &[f64] = &[-0.2, 0.0, 0.0, 0.0];
        camera.d = if is_raw { raw } else { &[0.0; 4] };
        camera.size = (48, 32);
        camera.roi = [x, 0, size.1 as u32, size.0 as u32];
    })
}

/// Rectified images of 24x16 from column `x` on.
fn rectified(x: u32, baseline_m: f64) -> Stereo<'static> {
    shot(STEREO, x, STEREO.size, baseline_m)
}

/// The images of pair `i`, which image_transport's CameraPublisher publishes first, and their
/// calibrations.
fn messages(shot: &Stereo<'_>, i: u64) -> [Message; 4] {
    let log_time = stamp(i) + 2_000_000;
    let infos = shot.infos(stamp(i)).map(|info| info.logged(log_time));
    let [[a, b], [c, d]] = [shot.images(i), infos];
    [a, b, c, d]
}

/// A bag of so many shots.
fn shots(count: u64, shot: impl Fn(u64) -> Stereo<'static>) -> Bag {
    Bag::new((0..count).flat_map(|i| messages(&shot(i), i)))
}

/// A shot whose region moves by two columns per pair.
fn moving(i: u64) -> Stereo<'static> {
    rectified(2 * i as u32, 0.1)
}

fn is_info(message: &Message) -> bool {
    message.topic.ends_with("info")
}

fn frames(path: &Path) -> Vec<Frame> {
    let mut reader = Reader::open(path).unwrap();
    std::iter::from_fn(|| reader.next_pair().unwrap()).collect()
}

/// Column of the principal point of each pair, and its baseline in millimetres.
fn facts(path: &Path) -> Vec<(f64, u32)> {
    let facts = |frame: &Frame| {
        let rig = frame.rig().unwrap();
        (rig.center_px().0, (rig.baseline_m() * 1e3).round() as u32)
    };
    frames(path).iter().map(facts).collect()
}

/// Column of the principal point of each pair.
fn centers(path: &Path) -> Vec<f64> {
    facts(path).into_iter().map(|(x, _)| x).collect()
}

#[test]
fn pairs_have_the_calibration_that_is_published_after_them() {
    let bag = shots(5, |i| {
        rectified(2 * i as u32, if i < 3 { 0.1 } else { 0.2 })
    });
    let expected = [(12.0, 100), (10.0, 100), (8.0, 100), (6.0, 200), (4.0, 200)];
    assert_eq!(facts(&bag.saved()), expected);
}

#[test]
fn a_damaged_calibration_costs_nothing_but_itself() {
    let fixture = Fixture::new();
    let baseline_m = |i| if i == 2 { f64::NAN } else { 0.1 };
    let bag = shots(4, |i| rectified(2 * i as u32, baseline_m(i)));
    // The left camera has its own, the right one that before it.
    let expected = [(12.0, 100), (10.0, 100), (8.0, 100), (6.0, 100)];
    assert_eq!(facts(&bag.write(&fixture)), expected);
    let ran = fixture.svl("replay bag.mcap --algo v3:max_disparity=8");
    ran.says("/cam1/camera_info at | it has numbers that are not finite; dropped");
}

#[test]
fn a_pair_without_a_calibration_of_its_stamp_has_the_last_one_before() {
    let fixture = Fixture::new();
    // Calibrations of pairs 0, 1 and 4 are missing.
    let missing = [0, 1, 4].map(|i| stamp(i) + 2_000_000);
    let bag = shots(6, moving).each(|message| {
        let is_missing = is_info(&message) && missing.contains(&message.log_time);
        (!is_missing).then_some(message)
    });
    let path = bag.write(&fixture);
    assert_eq!(centers(&path), [8.0, 8.0, 8.0, 6.0, 6.0, 2.0]);
    let ran = fixture.svl("record bag.mcap -o own.mcap");
    let is_late = |line: &&str| line.contains("first calibration");
    let late: Vec<_> = ran.stderr.lines().filter(is_late).collect();
    assert_eq!(late.len(), 1, "{}", ran.stderr);
    late[0].says("/cam0/camera_info | 0.133 s after the first pair");
}

#[test]
fn a_calibration_without_a_stamp_goes_by_its_log_time() {
    let unstamped = shots(4, moving).each(|message| {
        let log_time = message.log_time - 3_000_000;
        let unstamped = is_info(&message).then(|| message.at(0, log_time));
        [unstamped.unwrap_or(message)]
    });
    assert_eq!(centers(&unstamped.saved()), [12.0, 10.0, 8.0, 6.0]);
}

#[test]
fn one_pair_of_another_size_is_a_pair_as_the_others() {
    let fixture = Fixture::new();
    for cameras in [STEREO, RAW] {
        let size = |i| if i == 2 { (16, 12) } else { (24, 16) };
        shots(4, |i| shot(cameras, 0, size(i), 0.1)).write(&fixture);
        let ran = fixture.svl("record bag.mcap -o own.mcap --force");
        ran.stdout.says("4 pairs");
        let own = fixture.path("own.mcap");
        let sizes = frames(&own).into_iter().map(|frame| frame.pair.size());
        assert!(sizes.eq((0..4).map(size)));
        assert_eq!(facts(&own), [(12.0, 100); 4]);
        let algo = "--algo v3:max_disparity=4,min_disparity=0";
        fixture.run(&format!("replay bag.mcap {algo} --rows r.csv --force"));
        let rows = fixture.text("r.csv");
        assert_eq!(rows.lines().count(), 1 + 4, "{rows}");
    }
}

#[test]
fn half_a_second_out_of_order_changes_nothing() {
    let mut random = fastrand::Rng::with_seed(48);
    for cameras in [STEREO, RAW] {
        let bag = shots(60, |i| {
            let baseline_m = 0.1 + 0.01 * (i / 9) as f64;
            shot(cameras, (i as u32 * 7) % 20, (24, 16), baseline_m)
        });
        // The first calibrations come a second late, and an image is missing now and then.
        let bag = bag.each(|message| {
            let i = (message.stamp() - stamp(0)) / (stamp(1) - stamp(0));
            let is_late = i < 15 && is_info(&message);
            let is_lost = i % 11 == 5 && message.topic == cameras.images[1];
            (!is_late && !is_lost).then_some(message)
        });
        let expected = frames(&bag.saved());
        assert_eq!(expected.len(), 60 - 5);
        for _ in 0..20 {
            // A recorder logs the time of arrival; other programs sort what was logged.
            let mut log_time =
                |message: &Message| message.log_time - 500_000_000 + random.u64(0..1_000_000_000);
            let logged = bag
                .clone()
                .each(|message| [message.clone().logged(log_time(&message))]);
            let mut arrived: Vec<_> = logged.into_iter().zip(bag.clone()).collect();
            arrived.sort_by_key(|(logged, _)| logged.log_time);
            let keeps_log_time = random.bool();
            let permuted = arrived.into_iter();
            let permuted = permuted.map(|(new, old)| if keeps_log_time { old } else { new });
            let found = frames(&Bag::new(permuted).saved());
            assert!(found == expected, "{} pairs", found.len());
        }
    }
}

const MS: u64 = 1_000_000;

/// Live topics, fed by hand.
struct Live {
    pairs: TopicPairs,
    now_ns: u64,
}

impl Live {
    fn new() -> Self {
        let first = messages(&moving(0), 0);
        let pairs = pairs_of(&first);
        let mut live = Self { pairs, now_ns: 0 };
        for message in first {
            let place = live.place(message.topic);
            live.pairs.look_at(place, message.log_time, &message.data);
        }
        live.pairs.begin().unwrap();
        live
    }

    fn place(&self, topic: &str) -> usize {
        self.pairs.topics().position(|name| name == topic).unwrap()
    }

    fn send(&mut self, message: &Message) {
        let place = self.place(message.topic);
        self.pairs.take_in(place, 0, &message.data).unwrap();
    }

    /// The column of the principal point in the pair of the images sent, whose calibrations come
    /// that much later, and the milliseconds after which there was a pair.
    fn pair(&mut self, i: u64, x: u32, calibrated_after_ms: Option<u64>) -> (f64, u64) {
        let [left, right, infos @ ..] = messages(&rectified(x, 0.1), i);
        [left, right].iter().for_each(|image| self.send(image));
        for waited_ms in 0..1000 {
            if calibrated_after_ms == Some(waited_ms) {
                infos.iter().for_each(|info| self.send(info));
            }
            let pair = self.pairs.pop(self.now_ns);
            self.now_ns += MS;
            if let Some(pair) = pair {
                return (pair.unwrap().rig().unwrap().center_px().0, waited_ms);
            }
        }
        panic!("no pair {i}");
    }
}

#[test]
fn live_pairs_wait_for_their_calibrations_until_these_are_settled() {
    let mut live = Live::new();
    // The first calibrations were there before the first pair.
    assert_eq!(live.pair(0, 0, Some(3)), (12.0, 0));
    assert_eq!(live.pair(1, 2, Some(3)), (10.0, 3));
    // The period is 67 ms; without calibrations the last ones are used.
    assert_eq!(live.pair(2, 4, None), (10.0, 67));
    for i in 3..12 {
        assert_eq!(live.pair(i, 2, Some(5)), (10.0, 5), "{i}");
    }
    // Ten pairs with the same calibrations: a change takes effect one pair later.
    assert_eq!(live.pair(12, 6, Some(5)), (10.0, 0));
    assert_eq!(live.pair(13, 6, Some(0)), (6.0, 0));
}
