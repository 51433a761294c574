//! Stamps and log times of the topics of a recording: of its first messages, and at places all over
//! it.

use crate::bags::opened::Recording;
use crate::cameras::camera;
use crate::cameras::topics::is_image;
use crate::cameras::transforms::Transforms;
use crate::decode::head::head;
use crate::pairs::steps::{TimedMessage, without_stamp};
use crate::poses::reader::ODOMETRY;
use crate::sensor::topic::measures_distances;
use crate::stream::channel::{Channel, EventReader, FileEvent};
use std::collections::{BTreeMap, BTreeSet};
use svl_core::Result;

/// Number of first messages of each camera, and of places behind them.
const FIRST_MESSAGES: usize = 200;
const PLACES: usize = 20;
/// Number of images of each camera that the first messages have to contain.
pub(crate) const MIN_MESSAGES: usize = 10;
/// Bytes of the first messages, unless they have too few images, and then; bytes of a place, and of
/// one without what is needed of it.
const FIRST_BYTES: [usize; 2] = [8 << 20, 64 << 20];
const PLACE_BYTES: [usize; 2] = [128 << 10, 8 << 20];

/// Longest run of equal messages of a node that repeats them.
const MAX_RUN: usize = 4;

/// The use of a topic's messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ClockRole {
    Image,
    Calibration,
    /// Distances of another sensor or program.
    Measurement,
    Pose,
}

impl ClockRole {
    pub(crate) fn for_channel(channel: &Channel) -> Option<Self> {
        if camera::is_calibration(channel) {
            Some(Self::Calibration)
        } else if is_image(channel) {
            Some(Self::Image)
        } else if measures_distances(channel) {
            Some(Self::Measurement)
        } else if channel.schema == ODOMETRY || Transforms::are_moving(channel) {
            Some(Self::Pose)
        } else {
            None
        }
    }
}

/// The messages of a topic.
#[derive(Clone, Debug)]
pub(crate) struct TopicScan {
    pub(crate) role: ClockRole,
    /// Consecutive messages from the first one on, and those at other places.
    pub(crate) first: Vec<TimedMessage>,
    pub(crate) later: Vec<TimedMessage>,
    /// Messages before the first one that has a stamp.
    pub(crate) unset: u64,
    /// Hash of the last message without its stamp.
    hash: Option<u64>,
    /// Lengths of the runs of equal messages among the first ones.
    pub(crate) runs: Vec<usize>,
}

impl TopicScan {
    fn new(role: ClockRole) -> Self {
        Self {
            role,
            first: Vec::new(),
            later: Vec::new(),
            unset: 0,
            hash: None,
            runs: Vec::new(),
        }
    }

    /// True if the messages differ in more than their stamps.
    pub(crate) fn changes(&self) -> bool {
        self.runs.len() > 1
    }

    /// The number of times that each message comes, if all come equally often and more than once;
    /// the first and the last run may be cut.
    pub(crate) fn copies(&self) -> Option<usize> {
        let [_, runs @ .., _] = &self.runs[..] else {
            return None;
        };
        let copies = *runs.first()?;
        let is_even = runs.len() > 3 && runs.iter().all(|run| *run == copies);
        (copies > 1 && is_even).then_some(copies)
    }

    /// The number of messages that are copies of the one before, if a part of all come several
    /// times: those of a camera that is slower than the node that repeats it. A robot that stands
    /// before a simulated camera has longer runs.
    pub(crate) fn mixed_copies(&self) -> Option<usize> {
        let copied = self.runs.iter().filter(|run| **run > 1).count();
        let is_mixed = self.runs.iter().all(|run| *run <= MAX_RUN)
            && self.runs.len() >= MIN_MESSAGES
            && 5 * copied >= self.runs.len()
            && self.copies().is_none();
        is_mixed.then(|| self.runs.iter().map(|run| run - 1).sum())
    }

    /// Stamp of the first message that is not a copy of the one before, and the period.
    pub(crate) fn first_new_ns(&self) -> Option<(u64, u64)> {
        let copies = self.copies()?;
        let cut = self.runs.first().filter(|run| **run != copies);
        let new = self.first.get(cut.copied().unwrap_or(0))?;
        let [first, .., last] = &self.first[..] else {
            return None;
        };
        let span_ns = last.stamp_ns.saturating_sub(first.stamp_ns);
        let period_ns = span_ns / (self.first.len() as u64 - 1);
        Some((new.stamp_ns, period_ns.max(1)))
    }

    /// True if some messages have the stamps of those before.
    pub(crate) fn repeats_stamps(&self) -> bool {
        let mut two = self.first.windows(2);
        two.any(|two| two[0].stamp_ns == two[1].stamp_ns)
    }

    fn compare(&mut self, channel: &Channel, data: &[u8]) {
        // The stamp may be anywhere in JSON.
        let hash = if channel.encoding == "json" {
            0
        } else {
            xxhash_rust::xxh3::xxh3_64(without_stamp(channel, data))
        };
        match self.runs.last_mut() {
            Some(run) if self.hash == Some(hash) => *run += 1,
            _ => self.runs.push(1),
        }
        self.hash = Some(hash);
    }
}

/// The stamp of a message, as it is written.
fn stamp(role: ClockRole, channel: &Channel, data: &[u8]) -> Option<u64> {
    if role == ClockRole::Pose && channel.schema != ODOMETRY {
        let transforms = Transforms::read(channel, data).ok()?;
        return transforms.into_iter().find_map(|(_, _, stamp)| stamp);
    }
    head(channel, data).ok()?.0
}

/// The topics of a source whose stamps are used.
#[derive(Clone, Debug)]
pub(crate) struct ClockScan {
    pub(crate) images: [String; 2],
    pub(crate) topics: BTreeMap<String, TopicScan>,
    bytes: usize,
}

impl ClockScan {
    /// `images`: topics of the left and the right images.
    pub(crate) fn new(images: &[String; 2]) -> Self {
        Self {
            images: images.clone(),
            topics: BTreeMap::new(),
            bytes: 0,
        }
    }

    /// Reads as much of a recording as clocks need; see [`crate::cameras::topics::Selection::to_ns`].
    ///
    /// # Errors
    /// [`svl_core::Error::Io`], [`svl_core::Error::Format`].
    pub(crate) fn read(
        recording: &Recording,
        images: &[String; 2],
        to_ns: Option<u64>,
    ) -> Result<Self> {
        let mut scan = Self::new(images);
        let mut begin_ns = None;
        for file in recording.files() {
            let mut messages = file.messages()?;
            // Damage is reported with the pairs.
            while let Ok(Some(event)) = messages.next() {
                if let FileEvent::Message(channel, log_ns, data) = event {
                    let since_ns = log_ns.saturating_sub(*begin_ns.get_or_insert(log_ns));
                    let is_all = to_ns.is_some_and(|to_ns| since_ns > to_ns) && scan.has_enough();
                    if !is_all {
                        scan.take_in(channel, log_ns, &data);
                        if !scan.has_first() {
                            continue;
                        }
                        scan.read_places(recording)?;
                    }
                    return Ok(scan);
                }
            }
        }
        Ok(scan)
    }

    /// Adds one of the first messages.
    pub(crate) fn take_in(&mut self, channel: &Channel, log_ns: u64, data: &[u8]) {
        self.bytes += data.len();
        let Some((topic, sample)) = self.sample(channel, log_ns, data) else {
            return;
        };
        match sample {
            Some(sample) => topic.first.push(sample),
            None => topic.unset += u64::from(topic.first.is_empty()),
        }
        if topic.role != ClockRole::Pose {
            topic.compare(channel, data);
        }
    }

    fn sample(
        &mut self,
        channel: &Channel,
        log_ns: u64,
        data: &[u8],
    ) -> Option<(&mut TopicScan, Option<TimedMessage>)> {
        if !self.topics.contains_key(&channel.topic) {
            let role = ClockRole::for_channel(channel)?;
            self.topics
                .insert(channel.topic.clone(), TopicScan::new(role));
        }
        let topic = self.topics.get_mut(&channel.topic)?;
        let stamp_ns = stamp(topic.role, channel, data);
        let sample = stamp_ns.map(|stamp_ns| TimedMessage { log_ns, stamp_ns });
        Some((topic, sample))
    }

    /// True if each camera has at least that many first images.
    pub(crate) fn has_images(&self, least: usize) -> bool {
        let mut images = self.images.iter().map(|topic| self.topics.get(topic));
        images.all(|topic| topic.is_some_and(|topic| topic.first.len() >= least))
    }

    /// True if each camera has the images that clocks need.
    pub(crate) fn has_enough(&self) -> bool {
        self.has_images(MIN_MESSAGES)
    }

    fn has_first(&self) -> bool {
        let [usual, most] = FIRST_BYTES;
        self.has_images(FIRST_MESSAGES)
            || self.bytes > usual && self.has_enough()
            || self.bytes > most
    }

    fn read_places(&mut self, recording: &Recording) -> Result<()> {
        let files: Vec<_> = recording.files().collect();
        let places = PLACES.div_ceil(files.len());
        for file in files.iter().step_by((files.len() / PLACES).max(1)) {
            for mut messages in file.places(places)? {
                self.read_place(&mut *messages);
            }
        }
        Ok(())
    }

    pub(crate) fn read_place(&mut self, messages: &mut dyn EventReader) {
        let [least, most] = PLACE_BYTES;
        // Depth images and other measurements are needed only of a topic with few of them.
        let is_few = |topic: &TopicScan| {
            matches!(topic.role, ClockRole::Image | ClockRole::Measurement)
                && topic.first.len() + topic.later.len() < MIN_MESSAGES
        };
        let few = self.topics.iter().filter(|(_, topic)| is_few(topic));
        let wanted = few.map(|(name, _)| name).chain(&self.images).cloned();
        let mut wanted: BTreeSet<_> = wanted.collect();
        let mut bytes = 0;
        while bytes < least || bytes < most && !wanted.is_empty() {
            let Ok(Some(event)) = messages.next() else {
                return;
            };
            let FileEvent::Message(channel, log_ns, data) = event else {
                continue;
            };
            bytes += data.len();
            wanted.remove(&channel.topic);
            self.take_in_later(channel, log_ns, &data);
        }
    }

    /// Adds a message of a place behind the first ones.
    pub(crate) fn take_in_later(&mut self, channel: &Channel, log_ns: u64, data: &[u8]) {
        if let Some((topic, Some(sample))) = self.sample(channel, log_ns, data) {
            topic.later.push(sample);
        }
    }

    /// The greatest time in the log from a right image to the nearest left one, of the first ones
    /// that have others around; at most half a period of the slower camera.
    pub(crate) fn log_skew_ns(&self) -> Option<u64> {
        let logs = self.images.each_ref().map(|topic| {
            let first = self.topics.get(topic).map_or(&[][..], |topic| &topic.first);
            first
                .iter()
                .map(|message| message.log_ns)
                .collect::<Vec<_>>()
        });
        let period_ns = |logs: &Vec<u64>| Some((logs.last()? - logs.first()?) / logs.len() as u64);
        let half_ns = period_ns(&logs[0])?.max(period_ns(&logs[1])?) / 2;
        let nearest = |log: &u64| {
            let at = logs[0].partition_point(|left| left < log);
            let around = logs[0].get(at.checked_sub(1)?)?.abs_diff(*log);
            Some(around.min(logs[0].get(at)?.abs_diff(*log)))
        };
        let worst_ns = logs[1].iter().filter_map(nearest).max()?;
        Some(worst_ns.min(half_ns))
    }
}
