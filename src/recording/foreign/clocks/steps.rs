//! The offset of two cameras' clocks over the log time: a clock that steps, drifts away or is set.

use super::scan::TimedMessage;
use svl_core::statistics::nearest_rank;
use svl_core::stereo::Side;

/// Log time of a bin, and the same in periods of the slower camera.
const BIN_NS: f64 = 0.5e9;
const BIN_PERIODS: f64 = 5.0;

/// An offset of clocks in a bin of log time, nanoseconds: the least delay of the right images less
/// that of the left ones. Batches and stalls make some messages late, not all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct BinOffset {
    pub(super) log_ns: u64,
    pub(super) ns: i64,
}

/// The offsets of the bins that have images of both cameras.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct OffsetBins {
    pub(super) width_ns: u64,
    /// Index of the current bin, with the least delay of each camera.
    current: (u64, [Option<i64>; 2]),
    pub(super) offsets: Vec<BinOffset>,
}

impl OffsetBins {
    pub(super) fn new(period_ns: f64) -> Self {
        Self {
            width_ns: (BIN_PERIODS * period_ns).max(BIN_NS) as u64,
            current: (0, [None; 2]),
            offsets: Vec::new(),
        }
    }

    /// Adds the messages of both cameras, each in the order of its log times.
    pub(super) fn take_in_all(&mut self, cameras: [&[TimedMessage]; 2]) {
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
    pub(super) fn take_in(&mut self, side: usize, message: &TimedMessage) {
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
                ns: right.saturating_sub(left),
            });
        }
    }

    /// The usual offset, nanoseconds.
    pub(super) fn usual_ns(&self) -> Option<i64> {
        let mut sorted: Vec<_> = self.offsets.iter().map(|bin| bin.ns).collect();
        sorted.sort_unstable();
        nearest_rank(&sorted, 0.5)
    }

    /// The first bin of two or more that are beyond `limit_ns` from the offset `usual_ns`, and
    /// alike.
    fn step(&self, usual_ns: i64, limit_ns: f64) -> Option<BinOffset> {
        let apart = |one: i64, other: i64| one.saturating_sub(other).unsigned_abs() as f64;
        let bins = self.offsets.iter();
        let beyond: Vec<_> = bins
            .filter(|bin| apart(bin.ns, usual_ns) > limit_ns)
            .collect();
        let has_another = |step: &&&BinOffset| {
            let alike = beyond
                .iter()
                .filter(|bin| apart(bin.ns, step.ns) < limit_ns);
            alike.count() > 1
        };
        beyond.iter().find(has_another).map(|step| **step)
    }

    /// The step from the first bin on, in words; see [`OffsetBins::step`].
    pub(super) fn words(&self, limit_ns: f64, cure: &str) -> Option<String> {
        let usual_ns = self.usual_ns()?;
        let step = self.step(usual_ns, limit_ns)?;
        let begin = *self.offsets.first()?;
        if step.ns.abs_diff(begin.ns) as f64 > limit_ns {
            return Some(step_words(begin.ns, step, begin.log_ns, cure));
        }
        // Most are behind the step.
        let is_usual = |bin: &&BinOffset| bin.ns.abs_diff(usual_ns) as f64 <= limit_ns;
        let after = *self.offsets.iter().find(is_usual)?;
        Some(step_words(begin.ns, after, begin.log_ns, cure))
    }
}

/// Notices a step while the images are paired: between the places that were looked at before.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct StepWatch {
    pub(super) bins: OffsetBins,
    pub(super) usual_ns: i64,
    pub(super) limit_ns: f64,
    /// The shift of right stamps by which the images are of one moment, nanoseconds.
    pub(super) shift_ns: i64,
    /// Largest offset that different latencies explain.
    pub(super) latency_ns: f64,
    /// Log time of the first image.
    pub(super) begin_ns: Option<u64>,
    pub(super) cure: String,
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

    /// Adds an image of a camera; the step, in words, once two bins in a row show it.
    pub(crate) fn take_in(&mut self, side: Side, log_ns: u64, stamp_ns: u64) -> Option<String> {
        let begin_ns = *self.begin_ns.get_or_insert(log_ns);
        self.bins
            .take_in(side as usize, &TimedMessage { log_ns, stamp_ns });
        let old = self.bins.offsets.len().saturating_sub(2);
        self.bins.offsets.drain(..old);
        let step = self.bins.step(self.usual_ns, self.limit_ns)?;
        Some(step_words(self.usual_ns, step, begin_ns, &self.cure))
    }
}

/// `begin_ns`: log time of the first image.
fn step_words(from_ns: i64, to: BinOffset, begin_ns: u64, cure: &str) -> String {
    let offset = |ns: i64| {
        let direction = match ns {
            ..-500_000 => "ahead",
            500_000.. => "behind",
            _ => return "none".to_owned(),
        };
        format!("{:.3} s {direction}", ns.unsigned_abs() as f64 / 1e9)
    };
    format!(
        "by the log times its clock steps or drifts against that of the left images, from {} to \
         {}, {:.0} s after the beginning, unless the images come late from there: pairs by stamp \
         are of different moments; {cure} takes log times for all stamps, `--right-offset-ms 0` \
         leaves them",
        offset(from_ns),
        offset(to.ns),
        to.log_ns.saturating_sub(begin_ns) as f64 / 1e9,
    )
}
