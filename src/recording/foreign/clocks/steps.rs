//! The offset of two cameras' clocks over the log time: a clock that steps, drifts away or is set.

use super::scan::TimedMessage;
use svl_core::statistics::nearest_rank;

/// Log time of a bin, and the same in periods of the slower camera.
const BIN_NS: f64 = 1e9;
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

    /// The usual offset, and the first bin of two or more that are beyond `limit_ns` from it, in one
    /// direction and alike.
    pub(super) fn step(&self, limit_ns: f64) -> Option<(i64, BinOffset)> {
        let mut sorted: Vec<_> = self.offsets.iter().map(|bin| bin.ns).collect();
        sorted.sort_unstable();
        let usual = nearest_rank(&sorted, 0.5)?;
        let apart = |one: i64, other: i64| one.saturating_sub(other).unsigned_abs() as f64;
        let beyond = || {
            let bins = self.offsets.iter();
            bins.filter(|bin| apart(bin.ns, usual) > limit_ns)
        };
        let has_another = |step: &&BinOffset| {
            beyond()
                .filter(|bin| apart(bin.ns, step.ns) < limit_ns)
                .count()
                > 1
        };
        let step = beyond().find(has_another)?;
        Some((usual, *step))
    }
}
