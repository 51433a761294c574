//! The measurements of a topic: their assignment to pairs, and random access to them.
//!
//! One pass over the recording collects the stamps of pairs and measurements, 16 bytes each. The
//! measurements themselves are read separately, in file order, next to the pairs.

use super::kind;
use super::kind::{SensorRole, SensorSelection};
use crate::bags::opened::Recording;
use crate::cameras::transforms::plain;
use crate::decode::head;
use crate::message::{MessageError, MessageResult};
use crate::pairs::pair_stamps::PairStamps;
use crate::stream::channel::{Channel, EventReader, FileEvent};
use kind::{Measured, MeasuredKind};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use svl_core::statistics::nearest_rank;
use svl_core::stereo::Frame;
use svl_core::{Error, Result, counted};

/// Limit on the bytes of measurements kept for later pairs; beyond it they are read again.
const HELD_BYTES: usize = 256 << 20;

/// Stamps with the sequence of their pair, or the index of their message on the topic. Sorted by
/// stamp; equal stamps stay in file order.
#[derive(Default)]
struct Stamps(Vec<(u64, u64)>);

impl Stamps {
    /// The entries with this stamp.
    fn at(&self, stamp_ns: u64) -> &[(u64, u64)] {
        let first = self.0.partition_point(|(stamp, _)| *stamp < stamp_ns);
        let rest = &self.0[first..];
        &rest[..rest.partition_point(|(stamp, _)| *stamp == stamp_ns)]
    }

    /// The nearest one for which `fits` is true, at most `limit_ns` away; the earlier of two
    /// equally near.
    fn nearest(
        &self,
        stamp_ns: u64,
        limit_ns: u64,
        fits: impl Fn(u64) -> bool,
    ) -> Option<(u64, u64)> {
        let (before, after) = self
            .0
            .split_at(self.0.partition_point(|(stamp, _)| *stamp < stamp_ns));
        let is_near = |(stamp, _): &&(u64, u64)| stamp.abs_diff(stamp_ns) <= limit_ns;
        let fits = |(_, number): &&(u64, u64)| fits(*number);
        let before = before.iter().rev().take_while(is_near).find(fits);
        let after = after.iter().take_while(is_near).find(fits);
        let both = before.into_iter().chain(after);
        both.min_by_key(|(stamp, _)| stamp.abs_diff(stamp_ns))
            .copied()
    }

    fn range(&self) -> Option<(u64, u64)> {
        Some((self.0.first()?.0, self.0.last()?.0))
    }
}

/// Log time minus stamp, sorted, ns: transport and processing on the robot. A clock that differs
/// from the recorder's makes it negative, or too long.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TopicLatency {
    /// Latency of the measurements.
    pub topic_ns: Vec<i64>,
    /// Latency of the left images.
    pub images_ns: Vec<i64>,
}

impl TopicLatency {
    fn median(delays: &[i64]) -> Option<i64> {
        nearest_rank(delays, 0.5)
    }

    /// Time by which the stamps of the measurements are behind those of the images, by their log
    /// times: that between their clocks, besides the difference of their latencies.
    fn offset_ns(&self) -> Option<i64> {
        Some(Self::median(&self.topic_ns)? - Self::median(&self.images_ns)?)
    }
}

/// The stamps in a recording.
#[derive(Default)]
pub(super) struct StampScan {
    pairs: Stamps,
    /// Stamps and indices of the measurements.
    stamps: Stamps,
    /// Index of the first measurement of each file.
    starts: Vec<u64>,
    /// Number of measurements without one.
    without_stamp: u64,
    /// Log time minus stamp of the measurements and of the left images.
    pub(super) latency: TopicLatency,
}

impl StampScan {
    /// Reads all of a recording. `look` is called with every message.
    fn run(
        recording: &Recording,
        [topic, left]: [&str; 2],
        mut pair_stamps: PairStamps,
        look: &mut dyn FnMut(&Channel, u64, &[u8]),
    ) -> Result<Self> {
        let mut found = Self::default();
        let mut next = 0;
        for file in recording.files() {
            found.starts.push(next);
            let mut messages = file.messages()?;
            // Damage is reported with the pairs.
            while let Ok(Some(event)) = messages.next() {
                let FileEvent::Message(channel, log_time, data) = event else {
                    continue;
                };
                look(channel, log_time, &data);
                pair_stamps.take_in(channel, log_time, &data, head::head, &mut found.pairs.0);
                let delays = match channel.topic.as_str() {
                    name if name == topic => Some(&mut found.latency.topic_ns),
                    name if name == left => Some(&mut found.latency.images_ns),
                    _ => None,
                };
                if let Some(delays) = delays
                    && let Ok((Some(stamp), _)) = head::head(channel, &data)
                {
                    // Stamps above 2⁶³ ns are damage; wrapping still keeps their difference right.
                    delays.push(log_time.wrapping_sub(stamp).cast_signed());
                }
                if channel.topic == topic {
                    let head = head::head(channel, &data);
                    let is_used = !channel.stamps.is_log();
                    let has_none = is_used && matches!(&head, Ok((None, _))) && log_time > 0;
                    found.without_stamp += u64::from(has_none);
                    let stamp = head.map(|(stamp, _)| (stamp.unwrap_or(log_time), next));
                    found.stamps.0.extend(stamp);
                    next += 1;
                }
            }
        }
        pair_stamps.end(&mut found.pairs.0);
        for stamps in [&mut found.pairs, &mut found.stamps] {
            stamps.0.sort_by_key(|(stamp, _)| *stamp);
        }
        found.latency.topic_ns.sort_unstable();
        found.latency.images_ns.sort_unstable();
        Ok(found)
    }
}

/// Checks that a measurement is in the frame of the sensor, if that is known.
///
/// # Errors
/// The fault.
fn check_frame(frame: &str, sensor: &str) -> MessageResult<()> {
    if sensor.is_empty() || plain(frame) == sensor {
        return Ok(());
    }
    Err(MessageError::Frames(format!(
        "it is in '{frame}', not in '{sensor}' as the first one"
    )))
}

/// Warns of the first measurement that cannot be read.
fn warn_of_first(recording: &Recording, topic: &str, log_time: u64, reason: &MessageError) {
    let path = recording.path().display();
    tracing::warn!("{path}: {topic} at {log_time} ns: {reason}; left out");
}

/// The measurements of a topic.
pub(crate) struct Measurements {
    recording: Recording,
    selection: SensorSelection,
    kind: &'static MeasuredKind,
    pub(super) scan: StampScan,
    messages: Box<dyn EventReader>,
    /// Index of the next file to read, and of the next message.
    next_file: usize,
    next: u64,
    /// Measurements needed by the current pair or later ones, by index, with their stamps.
    held: BTreeMap<u64, (u64, Arc<Measured>)>,
    unreadable: BTreeSet<u64>,
    /// True once the user was warned of one that cannot be read.
    has_warned: bool,
    /// The sensor's frame, whose transform is used; empty if not needed.
    frame: String,
    unit_m: Option<f32>,
}

impl Measurements {
    /// Collects the stamps. `look` is called with every message on the way.
    ///
    /// # Errors
    /// [`svl_core::Error::Io`]. Inner: stamps that do not assign measurements to pairs.
    pub(crate) fn find(
        recording: &Recording,
        selection: &SensorSelection,
        left: &str,
        (frame, unit_m): (&str, Option<f32>),
        kind: &'static MeasuredKind,
        pair_stamps: PairStamps,
        look: &mut dyn FnMut(&Channel, u64, &[u8]),
    ) -> Result<MessageResult<Self>> {
        let scan = StampScan::run(recording, [&selection.topic, left], pair_stamps, look)?;
        if scan.without_stamp > 0 {
            let path = recording.path().display();
            let measurements = counted(scan.without_stamp, "measurement");
            tracing::warn!(
                "{path}: {}: {measurements} without a stamp; the log time, which is later, is used \
                 instead",
                selection.asked()
            );
        }
        let first = recording.files().next();
        let first = first.ok_or_else(|| Error::format(recording.path(), "has no files"))?;
        let mut found = Self {
            recording: recording.clone(),
            selection: selection.clone(),
            kind,
            scan,
            messages: first.messages()?,
            next_file: 1,
            next: 0,
            held: BTreeMap::new(),
            unreadable: BTreeSet::new(),
            has_warned: false,
            frame: frame.to_owned(),
            unit_m,
        };
        Ok(found
            .check_clock()
            .and_then(|()| found.check_stamps())
            .map(|()| found))
    }

    /// Rejects stamps of pairs and measurements from different times.
    fn check_clock(&self) -> MessageResult<()> {
        let (Some(pairs), Some(measured)) = (self.scan.pairs.range(), self.scan.stamps.range())
        else {
            return Ok(());
        };
        let limit_ns = self.selection.max_skew_ns;
        let apart = |a: (u64, u64), b: (u64, u64)| a.1.saturating_add(limit_ns) < b.0;
        if !apart(pairs, measured) && !apart(measured, pairs) {
            return Ok(());
        }
        let range =
            |(first, last): (u64, u64)| format!("{} to {} s", seconds(first), seconds(last));
        let offset = self.scan.latency.offset_ns().map(|ns| {
            format!(
                "; by the log times the clock of the measurements is {:.3} s {}: correct their \
                 stamps and record again",
                ns.unsigned_abs() as f64 / 1e9,
                if ns > 0 { "behind" } else { "ahead" }
            )
        });
        Err(MessageError::Stamps(format!(
            "its stamps are from another time: the pairs are from {}, the measurements from {}{}",
            range(pairs),
            range(measured),
            offset.unwrap_or_default()
        )))
    }

    /// Warns if measurements are assigned to pairs by order, and leaves those out whose stamps no
    /// order resolves; rejects stamps of which that is so for all.
    fn check_stamps(&mut self) -> MessageResult<()> {
        let (mut by_order, mut unique) = (0, 0);
        let mut fault = None;
        for &(stamp, _) in &self.scan.pairs.0 {
            let limit_ns = self.selection.max_skew_ns;
            let Some((nearest, _)) = self.scan.stamps.nearest(stamp, limit_ns, |_| true) else {
                continue;
            };
            let [pairs, measured] = [self.scan.pairs.at(stamp), self.scan.stamps.at(nearest)];
            let counts = [pairs.len(), measured.len()];
            if counts == [1, 1] {
                unique += 1;
            } else if stamp == nearest && pairs.len() == measured.len() {
                by_order += 1;
            } else {
                self.unreadable
                    .extend(measured.iter().map(|(_, number)| number));
                fault.get_or_insert_with(|| {
                    format!(
                        "{} with the stamp {} s and {} with {} s: it is unknown which belong \
                         together",
                        counted(pairs.len() as u64, "pair"),
                        seconds(stamp),
                        counted(measured.len() as u64, "measurement"),
                        seconds(nearest)
                    )
                });
            }
        }
        let (path, asked) = (self.recording.path().display(), self.selection.asked());
        if by_order > 0 {
            tracing::warn!(
                "{path}: {asked}: {by_order} pairs share their stamps, as many \
                 measurements do: used in the order of the file"
            );
        }
        match fault {
            Some(fault) if unique + by_order == 0 => Err(MessageError::Stamps(format!(
                "{fault}; name another topic, or give the messages stamps of their own"
            ))),
            Some(fault) => {
                let left_out = counted(self.unreadable.len() as u64, "such measurement");
                tracing::warn!("{path}: {asked}: {fault}; {left_out} left out");
                Ok(())
            }
            None => Ok(()),
        }
    }

    /// The measurement of a pair, or `None` within the limit.
    ///
    /// # Errors
    /// [`svl_core::Error::Io`].
    pub(crate) fn for_pair(&mut self, frame: &Frame) -> Result<Option<(u64, Arc<Measured>)>> {
        let (stamp_ns, limit_ns) = (frame.stamp_ns, self.selection.max_skew_ns);
        self.held
            .retain(|_, (stamp, _)| stamp.saturating_add(limit_ns) >= stamp_ns);
        let sharing = self.scan.pairs.at(stamp_ns);
        if sharing.len() > 1 {
            let mut pairs = sharing.iter().zip(self.scan.stamps.at(stamp_ns));
            let own = pairs.find(|((_, sequence), _)| *sequence == frame.sequence);
            return match own {
                Some((_, &(_, number))) => self.fetch(number, stamp_ns),
                None => Ok(None),
            };
        }
        // If it cannot be read, the pair gets the next nearest.
        loop {
            let readable = |number: u64| !self.unreadable.contains(&number);
            let Some((nearest_ns, number)) = self.scan.stamps.nearest(stamp_ns, limit_ns, readable)
            else {
                return Ok(None);
            };
            if self.belongs_to_another(nearest_ns, stamp_ns) {
                return Ok(None);
            }
            if let Some(found) = self.fetch(number, stamp_ns)? {
                return Ok(Some(found));
            }
        }
    }

    /// True if a map is that of another pair, which is nearer to it: it is the answer to one.
    fn belongs_to_another(&self, measured_ns: u64, pair_ns: u64) -> bool {
        let limit_ns = self.selection.max_skew_ns;
        let nearest = self.scan.pairs.nearest(measured_ns, limit_ns, |_| true);
        self.selection.role == SensorRole::Map && nearest.is_some_and(|(stamp, _)| stamp != pair_ns)
    }

    /// Reads on to a message, or again from the start of its file. Others on the way that later
    /// pairs may need are kept.
    fn fetch(&mut self, number: u64, stamp_ns: u64) -> Result<Option<(u64, Arc<Measured>)>> {
        if let Some(held) = self.held.get(&number) {
            return Ok(Some(held.clone()));
        }
        if self.unreadable.contains(&number) {
            return Ok(None);
        }
        let file = self.scan.starts.partition_point(|first| *first <= number) - 1;
        if number < self.next || file >= self.next_file {
            self.go_to(file)?;
        }
        while self.next <= number {
            match self.messages.next() {
                Ok(Some(FileEvent::Message(channel, log_time, data)))
                    if channel.topic == self.selection.topic =>
                {
                    let this = self.next;
                    self.next += 1;
                    let head = head::head(channel, &data).ok();
                    let stamp = head.as_ref().map(|(stamp, _)| stamp.unwrap_or(log_time));
                    let is_later = stamp.is_some_and(|stamp| stamp > stamp_ns);
                    if this != number && (!is_later || bytes(&self.held) > HELD_BYTES) {
                        continue;
                    }
                    let frame = head.map_or_else(String::new, |(_, frame)| frame);
                    let checked = check_frame(&frame, &self.frame);
                    match checked.and_then(|()| self.kind.read(channel, log_time, &data)) {
                        Ok((stamp, measured)) => {
                            let measured = Arc::new(measured.in_unit(self.unit_m));
                            self.held.insert(this, (stamp, measured));
                        }
                        Err(reason) => {
                            if !std::mem::replace(&mut self.has_warned, true) {
                                let topic = &self.selection.topic;
                                warn_of_first(&self.recording, topic, log_time, &reason);
                            }
                            self.unreadable.insert(this);
                        }
                    }
                }
                Ok(Some(_)) => {}
                // Damage is reported with the pairs.
                Ok(None) | Err(_) if self.next_file < self.scan.starts.len() => {
                    self.go_to(self.next_file)?;
                }
                // The file has changed since.
                Ok(None) | Err(_) => {
                    self.unreadable.insert(number);
                    break;
                }
            }
        }
        let found = self.held.get(&number).cloned();
        while self.held.len() > 1 && bytes(&self.held) > HELD_BYTES {
            self.held.pop_first();
        }
        Ok(found)
    }

    /// Reads on from the start of a file.
    fn go_to(&mut self, file: usize) -> Result<()> {
        if let Some(found) = self.recording.files().nth(file) {
            self.messages = found.messages()?;
            self.next = self.scan.starts[file];
            self.next_file = file + 1;
        }
        Ok(())
    }
}

fn bytes(held: &BTreeMap<u64, (u64, Arc<Measured>)>) -> usize {
    held.values().map(|(_, measured)| measured.bytes()).sum()
}

fn seconds(ns: u64) -> String {
    format!("{:.3}", ns as f64 / 1e9)
}
