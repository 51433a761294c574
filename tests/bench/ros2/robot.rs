//! A robot that publishes two rectified cameras, for as long as it lives.

use crate::recording::bag::{Message, camera_info, ros_image};
use crate::recording::frames::{PERIOD_NS, image};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;
use svl::dds::{Domain, TopicOutbox};
use svl::recording::LiveTopic;

pub(super) const SIZE: (usize, usize) = (24, 16);
pub(super) const START_NS: u64 = 1_700_000_000_000_000_000;
pub(super) const BASELINE_M: f64 = 0.1;
/// Focal length of [`camera_info`].
const FOCAL_PX: f64 = 328.0;

#[derive(Clone, Copy, PartialEq)]
pub(super) enum Fault {
    None,
    /// The right camera has a publisher and no images.
    Silent,
    /// The stamps of the right camera are an hour late.
    OtherClock,
    /// The stamps last a quarter of the time.
    Slow,
    /// The right images are narrower.
    OtherSize,
    /// Each camera has the calibration of the other.
    Swapped,
    /// Once svl has begun: a second without publishers, then new ones.
    Returns,
    /// From then on the publishers of the images have another type.
    OtherType,
    /// From then on the stamps are an hour earlier.
    ClockBack,
    /// From then on the images are wider.
    Grows,
}

pub(super) const HOUR_NS: u64 = 3_600_000_000_000;

pub(super) struct Robot {
    n: u16,
    ended: Arc<AtomicBool>,
    /// Number of the pair from which on a fault is there that svl does not begin with.
    later: Arc<AtomicU64>,
    thread: Option<JoinHandle<()>>,
}

/// The `n`-th domain of this test program; another one on this machine has others.
pub(super) fn domain(n: u16) -> u16 {
    30 + 20 * (std::process::id() % 10) as u16 + n
}

/// Topics in that domain.
pub(super) fn address(n: u16, topics: &str) -> String {
    let domain = domain(n);
    format!("ros2:{topics},domain={domain},interface=127.0.0.1").replace(":,", ":")
}

impl Robot {
    /// Publishes 15 pairs a second.
    pub(super) fn start(n: u16, fault: Fault) -> Self {
        Self::start_until(n, fault, || false)
    }

    /// The same; a fault that svl does not begin with comes once svl `has_begun`, however long it
    /// takes to find the topics.
    pub(super) fn start_until(
        n: u16,
        fault: Fault,
        has_begun: impl Fn() -> bool + Send + 'static,
    ) -> Self {
        let ended = Arc::new(AtomicBool::new(false));
        let later = Arc::new(AtomicU64::new(u64::MAX));
        let (told, began) = (Arc::clone(&ended), Arc::clone(&later));
        let publish = move || {
            let mut outbox = publishers(n, None);
            for i in 0.. {
                if told.load(Ordering::Relaxed) {
                    break;
                }
                if began.load(Ordering::Relaxed) == u64::MAX && has_begun() {
                    began.store(i, Ordering::Relaxed);
                    if [Fault::Returns, Fault::OtherType].contains(&fault) {
                        drop(outbox);
                        std::thread::sleep(Duration::from_secs(1));
                        let other = (fault == Fault::OtherType)
                            .then_some("sensor_msgs/msg/CompressedImage");
                        outbox = publishers(n, other);
                    }
                }
                let is_later = i >= began.load(Ordering::Relaxed);
                for mut message in messages(i, fault, is_later) {
                    if fault == Fault::OtherType && is_later {
                        message.data.truncate(24);
                    }
                    outbox.send(message.topic, message.data).unwrap();
                }
                std::thread::sleep(Duration::from_nanos(PERIOD_NS));
            }
        };
        let thread = Some(std::thread::spawn(publish));
        Self {
            n,
            ended,
            later,
            thread,
        }
    }

    /// Stamp of the first pair with a fault that svl does not begin with.
    pub(super) fn later_ns(&self) -> u64 {
        START_NS + self.later.load(Ordering::Relaxed) * PERIOD_NS
    }

    /// Topics of the robot, as a source or as a prefix.
    pub(super) fn source(&self, topics: &str) -> String {
        address(self.n, topics)
    }
}

impl Drop for Robot {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
        let ended = self.thread.take().map(JoinHandle::join);
        assert!(std::thread::panicking() || ended.is_some_and(|ended| ended.is_ok()));
    }
}

/// Publishers of all topics, those of the images with another type, if any.
fn publishers(n: u16, other: Option<&str>) -> TopicOutbox {
    let domain = Domain::join(&address(n, "").parse().unwrap()).unwrap();
    let mut outbox = TopicOutbox::new(domain).unwrap();
    for message in messages(0, Fault::None, false) {
        let other = other.filter(|_| message.topic.contains("image"));
        let topic = LiveTopic {
            name: message.topic.to_owned(),
            schema: other.unwrap_or(message.schema).to_owned(),
        };
        outbox.declare(&topic, false, false).unwrap();
    }
    outbox
}

/// The messages of pair `i`.
fn messages(i: u64, fault: Fault, is_later: bool) -> Vec<Message> {
    let stamp = START_NS + i * PERIOD_NS;
    let stamp = match fault {
        Fault::Slow => START_NS + i * PERIOD_NS / 4,
        Fault::ClockBack if is_later => stamp - HOUR_NS,
        _ => stamp,
    };
    let right_stamp = match fault {
        Fault::OtherClock => stamp + HOUR_NS,
        _ => stamp,
    };
    let size = match fault {
        Fault::Grows if is_later => (2 * SIZE.0, SIZE.1),
        _ => SIZE,
    };
    let right_size = match fault {
        Fault::OtherSize => (12, 16),
        _ => size,
    };
    let pixels = |size, seed| image(size, seed).pixels().collect::<Vec<u8>>();
    let mut tx = [0.0, -FOCAL_PX * BASELINE_M];
    if fault == Fault::Swapped {
        tx.reverse();
    }
    let mut messages = vec![
        camera_info("/cam0/camera_info", stamp, &[], tx[0]),
        camera_info("/cam1/camera_info", right_stamp, &[], tx[1]),
        ros_image(
            "/cam0/image_rect",
            stamp,
            size,
            "mono8",
            &pixels(size, 2 * i),
        ),
    ];
    if fault != Fault::Silent {
        let right = pixels(right_size, 2 * i + 1);
        messages.push(ros_image(
            "/cam1/image_rect",
            right_stamp,
            right_size,
            "mono8",
            &right,
        ));
    }
    messages
}
