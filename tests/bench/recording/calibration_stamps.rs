//! Each pair has the calibration of its own stamp, wherever the file has it.

use super::bag::{self, CAMERA, Camera, Message, camera_info_of, ros_image};
use super::frames::{image, stamp};
use crate::cli::fixture::Fixture;
use crate::common::assert_says;
use std::path::Path;
use svl::recording::{LiveTopic, Reader, Selection, TopicPairs};
use svl::stereo::{Frame, Rig};

const CAMERAS: [[&str; 2]; 2] = [
    ["/cam0/image_rect", "/cam0/camera_info"],
    ["/cam1/image_rect", "/cam1/camera_info"],
];
/// Without `rect` in their names, so that distortion makes them raw.
const RAW: [[&str; 2]; 2] = [
    ["/cam0/image_raw", "/cam0/camera_info"],
    ["/cam1/image_raw", "/cam1/camera_info"],
];

/// Pixels of the sensor.
const SENSOR: (u32, u32) = (48, 32);

/// Region of the sensor that pair `i` shows, its baseline, and its distortion.
#[derive(Clone, Copy)]
struct Shot {
    x: u32,
    size: (usize, usize),
    baseline_m: f64,
    distortion: f64,
}

impl Shot {
    const FIRST: Self = Self {
        x: 0,
        size: (24, 16),
        baseline_m: 0.1,
        distortion: 0.0,
    };

    /// The images of pair `i`, which image_transport's CameraPublisher publishes first, and their
    /// calibrations.
    fn messages(self, i: u64, [left, right]: [[&'static str; 2]; 2]) -> [Message; 4] {
        let Self {
            x,
            size,
            baseline_m,
            distortion,
        } = self;
        let camera = |[images, info]: [&'static str; 2], seed, tx| {
            let pixels: Vec<u8> = image(size, seed).pixels().collect();
            let camera = Camera {
                size: SENSOR,
                d: &[distortion, 0.0, 0.0, 0.0],
                tx,
                roi: [x, 0, size.1 as u32, size.0 as u32],
                ..CAMERA
            };
            let info = camera_info_of(info, stamp(i), &camera);
            [
                ros_image(images, stamp(i), size, "mono8", &pixels),
                Message {
                    log_time: stamp(i) + 2_000_000,
                    ..info
                },
            ]
        };
        let [left, left_info] = camera(left, 2 * i, 0.0);
        let [right, right_info] = camera(right, 2 * i + 1, -328.0 * baseline_m);
        [left, right, left_info, right_info]
    }
}

fn frames(path: &Path) -> Vec<Frame> {
    let mut reader = Reader::open(path).unwrap();
    std::iter::from_fn(|| reader.next_pair().unwrap()).collect()
}

fn rigs(path: &Path) -> Vec<Rig> {
    let frames = frames(path);
    frames.iter().map(|frame| *frame.rig().unwrap()).collect()
}

/// Column of the principal point, and baseline in millimetres.
fn facts(rigs: &[Rig]) -> Vec<(f64, u32)> {
    let facts = |rig: &Rig| (rig.center_px().0, (rig.baseline_m() * 1e3).round() as u32);
    rigs.iter().map(facts).collect()
}

#[test]
fn pairs_have_the_calibration_that_is_published_after_them() {
    let folder = tempfile::tempdir().unwrap();
    let shot = |i: u64| Shot {
        x: 2 * i as u32,
        baseline_m: if i < 3 { 0.1 } else { 0.2 },
        ..Shot::FIRST
    };
    let all: Vec<_> = (0..5).flat_map(|i| shot(i).messages(i, CAMERAS)).collect();
    let expected = [(12.0, 100), (10.0, 100), (8.0, 100), (6.0, 200), (4.0, 200)];
    assert_eq!(facts(&rigs(&bag::write(folder.path(), &all))), expected);
}

#[test]
fn a_damaged_calibration_costs_nothing_but_itself() {
    let fixture = Fixture::new();
    let shot = |i: u64| Shot {
        x: 2 * i as u32,
        baseline_m: if i == 2 { f64::NAN } else { 0.1 },
        ..Shot::FIRST
    };
    let all: Vec<_> = (0..4).flat_map(|i| shot(i).messages(i, CAMERAS)).collect();
    let path = bag::write(&fixture.path(""), &all);
    // The left camera has its own, the right one that before it.
    let expected = [(12.0, 100), (10.0, 100), (8.0, 100), (6.0, 100)];
    assert_eq!(facts(&rigs(&path)), expected);
    let ran = fixture.svl("replay bag.mcap --algo v3:max_disparity=8");
    assert_says(
        &ran.stderr,
        &[
            "/cam1/camera_info at",
            "it has numbers that are not finite; dropped",
        ],
    );
}

#[test]
fn a_pair_without_a_calibration_of_its_stamp_has_the_last_one_before() {
    let fixture = Fixture::new();
    let shot = |i: u64| Shot {
        x: 2 * i as u32,
        ..Shot::FIRST
    };
    let all = (0..6).flat_map(|i| shot(i).messages(i, CAMERAS));
    // Calibrations of pairs 0, 1 and 4 are missing.
    let is_missing = |message: &Message| {
        let places = [0, 1, 4].map(|i| stamp(i) + 2_000_000);
        message.topic.ends_with("info") && places.contains(&message.log_time)
    };
    let all: Vec<_> = all.filter(|message| !is_missing(message)).collect();
    let path = bag::write(&fixture.path(""), &all);
    let centers: Vec<_> = facts(&rigs(&path)).into_iter().map(|(x, _)| x).collect();
    assert_eq!(centers, [8.0, 8.0, 8.0, 6.0, 6.0, 2.0]);
    let ran = fixture.svl("record bag.mcap -o own.mcap");
    let is_late = |line: &&str| line.contains("first calibration");
    let late: Vec<_> = ran.stderr.lines().filter(is_late).collect();
    assert_eq!(late.len(), 1, "{}", ran.stderr);
    assert_says(
        late[0],
        &["/cam0/camera_info", "0.133 s after the first pair"],
    );
}

#[test]
fn a_calibration_without_a_stamp_goes_by_its_log_time() {
    let folder = tempfile::tempdir().unwrap();
    let shot = |i: u64| Shot {
        x: 2 * i as u32,
        ..Shot::FIRST
    };
    let all = (0..4).flat_map(|i| shot(i).messages(i, CAMERAS));
    let unstamped = all.map(|message| match message.topic.ends_with("info") {
        // The stamp is behind the 4 bytes of CDR.
        true => {
            let data = [&message.data[..4], &[0; 8], &message.data[12..]].concat();
            let log_time = message.log_time - 3_000_000;
            Message {
                data,
                log_time,
                ..message
            }
        }
        false => message,
    });
    let path = bag::write(folder.path(), &unstamped.collect::<Vec<_>>());
    let centers: Vec<_> = facts(&rigs(&path)).into_iter().map(|(x, _)| x).collect();
    assert_eq!(centers, [12.0, 10.0, 8.0, 6.0]);
}

#[test]
fn one_pair_of_another_size_is_a_pair_as_the_others() {
    let fixture = Fixture::new();
    for topics in [CAMERAS, RAW] {
        let shot = |i: u64| Shot {
            size: if i == 2 { (16, 12) } else { (24, 16) },
            distortion: if topics == RAW { -0.2 } else { 0.0 },
            ..Shot::FIRST
        };
        let all: Vec<_> = (0..4).flat_map(|i| shot(i).messages(i, topics)).collect();
        bag::write(&fixture.path(""), &all);
        let ran = fixture.svl("record bag.mcap -o own.mcap --force");
        assert_says(&ran.stdout, &["4 pairs"]);
        let own = fixture.path("own.mcap");
        let sizes: Vec<_> = frames(&own).iter().map(|frame| frame.pair.size()).collect();
        assert_eq!(sizes, [(24, 16), (24, 16), (16, 12), (24, 16)]);
        assert_eq!(facts(&rigs(&own)), [(12.0, 100); 4]);
        let ran = fixture
            .svl("replay bag.mcap --algo v3:max_disparity=4,min_disparity=0 --rows r.csv --force");
        assert!(ran.code == Some(0), "{}", ran.stderr);
        let rows = std::fs::read_to_string(fixture.path("r.csv")).unwrap();
        assert_eq!(rows.lines().count(), 1 + 4, "{rows}");
    }
}

#[test]
fn half_a_second_out_of_order_changes_nothing() {
    let mut random = fastrand::Rng::with_seed(48);
    let folder = tempfile::tempdir().unwrap();
    for topics in [CAMERAS, RAW] {
        let shot = |i: u64| Shot {
            x: (i as u32 * 7) % 20,
            baseline_m: 0.1 + 0.01 * (i / 9) as f64,
            distortion: if topics == RAW { -0.2 } else { 0.0 },
            ..Shot::FIRST
        };
        // The first calibrations come a second late, and an image is missing now and then.
        let all = (0..60).flat_map(|i| {
            let messages = shot(i).messages(i, topics).into_iter();
            messages.filter(move |message| {
                let is_late = i < 15 && message.topic.ends_with("info");
                let is_lost = i % 11 == 5 && message.topic == topics[1][0];
                !is_late && !is_lost
            })
        });
        let all: Vec<_> = all.collect();
        let expected = frames(&bag::write(folder.path(), &all));
        assert_eq!(expected.len(), 60 - 5);
        for _ in 0..20 {
            let log_time =
                |message: &Message| message.log_time - 500_000_000 + random.u64(0..1_000_000_000);
            let mut permuted: Vec<_> = all.iter().map(log_time).zip(&all).collect();
            permuted.sort_by_key(|(log_time, _)| *log_time);
            // A recorder logs the time of arrival; other programs sort what was logged.
            let keeps_log_time = random.bool();
            let permuted: Vec<_> = permuted
                .into_iter()
                .map(|(log_time, message)| Message {
                    log_time: if keeps_log_time {
                        message.log_time
                    } else {
                        log_time
                    },
                    ..message.clone()
                })
                .collect();
            let found = frames(&bag::write(folder.path(), &permuted));
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
        let topics = Shot::FIRST.messages(0, CAMERAS).map(|message| LiveTopic {
            name: message.topic.to_owned(),
            schema: message.schema.to_owned(),
        });
        let pairs = TopicPairs::new("ros2:", &topics, &Selection::default()).unwrap();
        let mut live = Self { pairs, now_ns: 0 };
        for message in Shot::FIRST.messages(0, CAMERAS) {
            live.pairs
                .look_at(live.place(message.topic), message.log_time, &message.data);
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
        let shot = Shot { x, ..Shot::FIRST };
        let [left, right, infos @ ..] = shot.messages(i, CAMERAS);
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
