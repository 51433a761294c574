//! The offset of two cameras' clocks over the log time: a clock that steps, drifts away or is set.

use crate::stream::channel::Channel;
use crate::stream::stamp_rule::StampRule;
use svl_core::doubt::{ClockCure, ClockStep, Doubt, LogTimes, Subject};
use svl_core::statistics::nearest_rank;
use svl_core::stereo::Side;

/// Log time of a bin, and the same in periods of the slower camera.
const BIN_NS: f64 = 0.5e9;
const BIN_PERIODS: f64 = 5.0;

/// The least delay of the left images and of another topic, in a bin of log time: batches and
/// stalls make some messages late, not all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct BinOffset {
    pub(crate) log_ns: u64,
    floors_ns: [i64; 2],
}

impl BinOffset {
    /// The offset of the clocks.
    pub(crate) fn ns(self) -> i64 {
        self.floors_ns[1].saturating_sub(self.floors_ns[0])
    }
}

/// A step of one clock against the other, or a drift, up to its first bin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FoundStep {
    from_ns: i64,
    pub(crate) to: BinOffset,
    /// The clock whose delays change.
    pub(crate) side: Side,
    /// Log time of the beginning.
    begin_ns: u64,
}

impl FoundStep {
    /// The step to `to`, behind the bin `before` it.
    fn new(from_ns: i64, before: BinOffset, to: BinOffset, begin_ns: u64) -> Self {
        let [left, right] = [0, 1].map(|i| to.floors_ns[i].abs_diff(before.floors_ns[i]));
        let side = if left > right {
            Side::Left
        } else {
            Side::Right
        };
        Self {
            from_ns,
            to,
            side,
            begin_ns,
        }
    }

    /// The shift of the right stamps behind it that corrects them.
    pub(crate) fn shift_ns(&self) -> i64 {
        self.to.ns().saturating_sub(self.from_ns)
    }

    /// The step of the clock of that side.
    pub(crate) fn against(&self, side: Side) -> ClockStep {
        ClockStep {
            is_left: side == Side::Left,
            from_ns: self.from_ns,
            to_ns: self.to.ns(),
            after_s: self.to.log_ns.saturating_sub(self.begin_ns) as f64 / 1e9,
        }
    }

    /// The doubt about the camera's clock, one of the topics `images`.
    pub(crate) fn camera_doubt(&self, images: &[String; 2], limit_ns: f64, log: LogTimes) -> Doubt {
        let step = self.against(self.side);
        let topic = images[self.side as usize].clone();
        self.doubt(topic, limit_ns, ClockCure::CameraStep { step, log })
    }

    /// The doubt about the clock of a topic, of a step beyond that limit.
    pub(crate) fn doubt(&self, topic: String, limit_ns: f64, cure: ClockCure) -> Doubt {
        let (step_s, limit_s) = (self.shift_ns() as f64 / 1e9, limit_ns / 1e9);
        let usual = [-limit_s, limit_s];
        cure.doubt(Subject::Topic(topic), "clock_step_s", step_s, usual)
    }
}

/// The offsets of the bins that have images of both cameras.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct OffsetBins {
    pub(crate) width_ns: u64,
    /// Index of the current bin, with the least delay of each camera.
    current: (u64, [Option<i64>; 2]),
    pub(crate) offsets: Vec<BinOffset>,
}

impl OffsetBins {
    pub(crate) fn new(period_ns: f64) -> Self {
        Self {
            width_ns: (BIN_PERIODS * period_ns).max(BIN_NS) as u64,
            current: (0, [None; 2]),
            offsets: Vec::new(),
        }
    }

    /// Adds the messages of both cameras, each in the order of its log times.
    pub(crate) fn take_in_all(&mut self, cameras: [&[TimedMessage]; 2]) {
        let mut all: Vec<_> = (0..2)
            .flat_map(|side| cameras[side].iter().map(move |message| (message, side)))
            .collect();
        all.sort_by_key(|(message, _)| message.log_ns);
        for (message, side) in all {
            self.take_in(side, message);
        }
        self.end_bin();
    }

    /// Adds an image of a camera.
    pub(crate) fn take_in(&mut self, side: usize, message: &TimedMessage) {
        let bin = message.log_ns / self.width_ns;
        if bin != self.current.0 {
            self.end_bin();
            self.current = (bin, [None; 2]);
        }
        let floor = self.current.1[side].get_or_insert(i64::MAX);
        *floor = message.delay_ns().min(*floor);
    }

    fn end_bin(&mut self) {
        if let (bin, [Some(left), Some(right)]) = self.current {
            self.offsets.push(BinOffset {
                log_ns: bin * self.width_ns,
                floors_ns: [left, right],
            });
        }
    }

    /// The usual offset, nanoseconds.
    pub(crate) fn usual_ns(&self) -> Option<i64> {
        let mut sorted: Vec<_> = self.offsets.iter().map(|bin| bin.ns()).collect();
        sorted.sort_unstable();
        nearest_rank(&sorted, 0.5)
    }

    /// The place of the first bin of two or more that are beyond `limit_ns` from the offset
    /// `usual_ns`, and alike.
    fn beyond(&self, usual_ns: i64, limit_ns: f64) -> Option<usize> {
        let apart = |one: i64, other: i64| one.saturating_sub(other).unsigned_abs() as f64;
        let bins = self.offsets.iter().map(|bin| bin.ns()).enumerate();
        let beyond: Vec<_> = bins
            .filter(|(_, ns)| apart(*ns, usual_ns) > limit_ns)
            .collect();
        let has_another = |(_, step): &&(usize, i64)| {
            let alike = beyond.iter().filter(|(_, ns)| apart(*ns, *step) < limit_ns);
            alike.count() > 1
        };
        beyond.iter().find(has_another).map(|(place, _)| *place)
    }

    /// The step from the first bin on; see [`OffsetBins::beyond`].
    pub(crate) fn step(&self, limit_ns: f64) -> Option<FoundStep> {
        let usual_ns = self.usual_ns()?;
        let is_off = |bin: &BinOffset, ns| bin.ns().abs_diff(ns) as f64 > limit_ns;
        let mut place = self.beyond(usual_ns, limit_ns)?;
        let begin = *self.offsets.first()?;
        let mut from_ns = begin.ns();
        if !is_off(&self.offsets[place], from_ns) {
            // Most are behind the step, or the beginning is between both.
            let is_behind = |bin: &BinOffset| is_off(bin, from_ns) && !is_off(bin, usual_ns);
            match self.offsets.iter().position(is_behind) {
                Some(behind) => place = behind,
                None => from_ns = usual_ns,
            }
        }
        let before = self.offsets[place.saturating_sub(1)];
        Some(FoundStep::new(
            from_ns,
            before,
            self.offsets[place],
            begin.log_ns,
        ))
    }
}

/// Bins that a watch keeps: the step is between two of them.
const KEPT_BINS: usize = 4;

/// Notices a step while the images are paired: between the places that were looked at before.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct StepWatch {
    pub(crate) bins: OffsetBins,
    pub(crate) usual_ns: i64,
    pub(crate) limit_ns: f64,
    /// The shift of right stamps by which the images are of one moment, nanoseconds.
    pub(crate) shift_ns: i64,
    /// Largest offset that different latencies explain.
    pub(crate) latency_ns: f64,
    /// Log time of the first image.
    pub(crate) begin_ns: Option<u64>,
    pub(crate) log: LogTimes,
}

impl StepWatch {
    /// The shift of the right stamps that the log times show, if none has a partner for it: more
    /// than the largest skew, and than latencies explain.
    pub(crate) fn shift_ns(&self, max_skew_ns: u64) -> Option<i64> {
        let is_shown = self.usual_ns.unsigned_abs() as f64 > self.latency_ns
            && self.usual_ns.unsigned_abs() > max_skew_ns
            && self.usual_ns.abs_diff(self.shift_ns) <= max_skew_ns;
        is_shown.then_some(self.shift_ns)
    }

    /// Adds an image of a camera, of the topics `images`; the step of a camera's clock, once two
    /// bins show it.
    pub(crate) fn take_in(
        &mut self,
        images: &[String; 2],
        side: Side,
        log_ns: u64,
        stamp_ns: u64,
    ) -> Option<Doubt> {
        let begin_ns = *self.begin_ns.get_or_insert(log_ns);
        self.bins
            .take_in(side as usize, &TimedMessage { log_ns, stamp_ns });
        let old = self.bins.offsets.len().saturating_sub(KEPT_BINS);
        self.bins.offsets.drain(..old);
        let place = self.bins.beyond(self.usual_ns, self.limit_ns)?;
        let [before, to] = [place.saturating_sub(1), place].map(|i| self.bins.offsets[i]);
        let step = FoundStep::new(self.usual_ns, before, to, begin_ns);
        Some(step.camera_doubt(images, self.limit_ns, self.log))
    }
}

/// Log time and stamp of a message; the stamp as it is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TimedMessage {
    pub(crate) log_ns: u64,
    pub(crate) stamp_ns: u64,
}

impl TimedMessage {
    /// The time from the stamp to the log time. Stamps above 2⁶³ ns are damage; wrapping still
    /// keeps their difference right.
    pub(crate) fn delay_ns(&self) -> i64 {
        self.log_ns.wrapping_sub(self.stamp_ns).cast_signed()
    }

    /// The same by another rule.
    pub(crate) fn restamped(self, rule: StampRule) -> Self {
        let parts = (
            (self.stamp_ns / 1_000_000_000) as u32,
            (self.stamp_ns % 1_000_000_000) as u32,
        );
        Self {
            stamp_ns: rule.stamp(parts).unwrap_or(self.log_ns),
            ..self
        }
    }
}

/// The bytes of a message behind its stamp, which comes first in all of them.
pub(crate) fn without_stamp<'a>(channel: &Channel, data: &'a [u8]) -> &'a [u8] {
    let stamp = match (channel.encoding.as_str(), data) {
        // A number and the stamp; or the encapsulation and the stamp.
        ("ros1" | "cdr", _) => 12,
        // The first field, a message of its own.
        ("protobuf", [0x0a, len, ..]) => 2 + usize::from(*len),
        _ => 0,
    };
    data.get(stamp..).unwrap_or(data)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_is_between_two_offsets_that_differ_by_more_than_the_limit() {
        let step = |offsets_ms: &[i64]| {
            let offset = |(i, ms): (usize, &i64)| BinOffset {
                log_ns: i as u64 * 500_000_000,
                floors_ns: [0, ms * 1_000_000],
            };
            let bins = OffsetBins {
                offsets: offsets_ms.iter().enumerate().map(offset).collect(),
                ..OffsetBins::new(0.0)
            };
            let step = bins.step(10e6)?;
            let topics = [String::new(), String::new()];
            let doubt = step.camera_doubt(&topics, 10e6, LogTimes::default());
            assert!(doubt.is_unusual(), "{doubt:?}");
            Some((doubt.value * 1e3).round() as i64)
        };
        assert_eq!(step(&[0, 1, 0, 0, 9, 0]), None);
        assert_eq!(step(&[0, 0, 0, 0, 50, 50]), Some(50));
        assert_eq!(step(&[0, 0, 50, 50, 50, 50]), Some(50));
        // The beginning is nearer to both than the limit.
        assert_eq!(step(&[6, 0, 0, 0, 0, 12, 12]), Some(12));
    }
}
