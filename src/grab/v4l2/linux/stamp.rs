//! Stamps of V4L2 buffers, converted to the middle of the exposure on the grabber's clock.

use super::abi::{
    FLAG_STAMPED_AT_BEGIN, FLAG_STAMPED_AT_MASK, FLAG_TIMESTAMP_MASK, FLAG_TIMESTAMP_MONOTONIC,
};
use crate::clock::GrabClock;

/// Conversion from the drivers' monotonic clock to the grabber's, one for both cameras so that the
/// skew is exact.
#[derive(Clone, Copy, Debug)]
pub(super) struct Times {
    /// Grabber's clock minus monotonic clock.
    pub offset_ns: u64,
    /// Earliest possible stamp on the monotonic clock.
    pub earliest_ns: u64,
}

/// A running sensor may have started an exposure before its stream, and drivers that convert a
/// camera's own clock err by some milliseconds. A stamp further off is invalid.
const TOLERANCE_NS: u64 = 1_000_000_000;

impl Times {
    /// Before the streams start, at `monotonic_ns`.
    pub(super) fn begin(clock: &GrabClock, monotonic_ns: u64) -> Self {
        // Wraps if the grabber's clock is behind, and wraps back when it is added.
        let offset_ns = clock.now_ns().wrapping_sub(monotonic_ns);
        Self {
            offset_ns,
            earliest_ns: monotonic_ns.saturating_sub(TOLERANCE_NS),
        }
    }
}

/// The driver's stamp of a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct BufferStamp {
    /// On the monotonic clock, if `flags` indicate that.
    pub ns: u64,
    pub flags: u32,
    /// Time at which the buffer was dequeued, on the monotonic clock.
    pub arrived_ns: u64,
}

impl BufferStamp {
    /// Middle of the exposure on the monotonic clock. A driver stamps the start of the exposure, or
    /// the end of the transfer, whose duration no driver reports: that stamp is used as the end of
    /// the exposure. `None` if the driver gives no stamp, or one from before `earliest_ns` or far
    /// in the future.
    pub(super) fn middle_ns(&self, exposure_us: u32, earliest_ns: u64) -> Option<u64> {
        let is_monotonic = self.flags & FLAG_TIMESTAMP_MASK == FLAG_TIMESTAMP_MONOTONIC;
        if !is_monotonic || !(earliest_ns..=self.arrived_ns + TOLERANCE_NS).contains(&self.ns) {
            return None;
        }
        let half_ns = u64::from(exposure_us) * 500;
        Some(match self.flags & FLAG_STAMPED_AT_MASK {
            // uvcvideo stamps the start of the exposure by default, most sensor drivers the end of
            // the transfer.
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
        let begin = BufferStamp {
            ns: 1_000_000,
            flags: FLAG_TIMESTAMP_MONOTONIC | FLAG_STAMPED_AT_BEGIN,
            arrived_ns: 9_000_000,
        };
        assert_eq!(begin.middle_ns(4_000, 0), Some(3_000_000));
        let end = BufferStamp {
            ns: 8_000_000,
            flags: FLAG_TIMESTAMP_MONOTONIC,
            ..begin
        };
        assert_eq!(end.middle_ns(4_000, 0), Some(6_000_000));
        assert_eq!(end.middle_ns(0, 0), Some(8_000_000));
    }

    #[test]
    fn stamps_that_cannot_be_are_none() {
        let stamp = BufferStamp {
            ns: 5_000,
            flags: FLAG_TIMESTAMP_MONOTONIC | FLAG_STAMPED_AT_BEGIN,
            arrived_ns: 9_000,
        };
        assert_eq!(
            BufferStamp {
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
                BufferStamp { flags, ..stamp }.middle_ns(2, 0),
                None,
                "another clock: {flags:x}"
            );
        }
    }
}
