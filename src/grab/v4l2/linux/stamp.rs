//! When an image was exposed.

use super::abi::{
    FLAG_STAMPED_AT_BEGIN, FLAG_STAMPED_AT_MASK, FLAG_TIMESTAMP_MASK, FLAG_TIMESTAMP_MONOTONIC,
};
use crate::grab::clock::Clock;

/// From the clock that drivers stamp by to the grabber's, the same way for both cameras.
#[derive(Clone, Copy, Debug)]
pub(super) struct Times {
    /// What to add to the monotonic clock.
    pub offset_ns: u64,
    /// No image can be from before this, of the monotonic clock.
    pub earliest_ns: u64,
}

/// A sensor that runs all the time may have begun an exposure before its stream, and drivers that
/// reckon with a camera's own clock err by some milliseconds. What is further off than this is no
/// time of the image.
const TOLERANCE_NS: u64 = 1_000_000_000;

impl Times {
    /// Before the streams begin, at `monotonic_ns`.
    pub(super) fn begin(clock: &Clock, monotonic_ns: u64) -> Self {
        let offset_ns = clock.now_ns().wrapping_sub(monotonic_ns);
        Self {
            offset_ns,
            earliest_ns: monotonic_ns.saturating_sub(TOLERANCE_NS),
        }
    }
}

/// What a driver says of the time of a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Stamp {
    /// Of the monotonic clock, if `flags` say so.
    pub ns: u64,
    pub flags: u32,
    /// When the buffer was given out, of the monotonic clock.
    pub arrived_ns: u64,
}

impl Stamp {
    /// The middle of the exposure on the monotonic clock. A driver stamps the begin of the exposure
    /// or the end of the transfer (and no driver tells how long that takes, so then it counts as
    /// exposure's end). Nothing when the driver gives no time, or one from before `earliest_ns` or
    /// far in the future.
    pub(super) fn middle_ns(&self, exposure_us: u32, earliest_ns: u64) -> Option<u64> {
        let is_told = self.flags & FLAG_TIMESTAMP_MASK == FLAG_TIMESTAMP_MONOTONIC;
        if !is_told || !(earliest_ns..=self.arrived_ns + TOLERANCE_NS).contains(&self.ns) {
            return None;
        }
        let half_ns = u64::from(exposure_us) * 500;
        Some(match self.flags & FLAG_STAMPED_AT_MASK {
            FLAG_STAMPED_AT_BEGIN => self.ns + half_ns,
            _ => self.ns.saturating_sub(half_ns),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_become_the_middle_of_the_exposure() {
        let begin = Stamp {
            ns: 1_000_000,
            flags: FLAG_TIMESTAMP_MONOTONIC | FLAG_STAMPED_AT_BEGIN,
            arrived_ns: 9_000_000,
        };
        assert_eq!(begin.middle_ns(4_000, 0), Some(3_000_000));
        let end = Stamp {
            ns: 8_000_000,
            flags: FLAG_TIMESTAMP_MONOTONIC,
            ..begin
        };
        assert_eq!(end.middle_ns(4_000, 0), Some(6_000_000));
        assert_eq!(end.middle_ns(0, 0), Some(8_000_000));
    }

    #[test]
    fn stamps_that_cannot_be_are_none() {
        let stamp = Stamp {
            ns: 5_000,
            flags: FLAG_TIMESTAMP_MONOTONIC | FLAG_STAMPED_AT_BEGIN,
            arrived_ns: 9_000,
        };
        assert_eq!(
            Stamp {
                ns: 9_001 + TOLERANCE_NS,
                ..stamp
            }
            .middle_ns(2, 0),
            None,
            "the future"
        );
        assert_eq!(
            stamp.middle_ns(2, 5_001),
            None,
            "from before the stream began"
        );
        for flags in [0, 0x4000, 0x6000] {
            assert_eq!(
                Stamp { flags, ..stamp }.middle_ns(2, 0),
                None,
                "another clock: {flags:x}"
            );
        }
    }
}
