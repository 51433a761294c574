//! The rule by which the stamps of a topic are read: as they are written, or repaired as the user
//! says.

const SECOND_NS: u64 = 1_000_000_000;

/// The unit that the user names for stamps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StampUnit {
    /// Milliseconds, written as nanoseconds.
    Milliseconds,
    /// Microseconds, written as nanoseconds.
    Microseconds,
    /// Nothing of use: log times are used instead.
    Log,
}

/// The part of a stamp that counts in the unit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum StampReading {
    #[default]
    AsWritten,
    /// All of it, in units of that many nanoseconds.
    Whole(u64),
    /// The part below a second, in units of that many nanoseconds.
    BelowSecond(u64),
    /// The message counts as one without a stamp.
    Log,
    /// The messages are of another robot, and of no use.
    Unread,
}

/// The reading of a topic's stamps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct StampRule {
    pub(crate) reading: StampReading,
    /// True if the clock begins at 0: elsewhere a stamp of 0 was never set.
    pub(crate) begins_at_0: bool,
    /// Added to all stamps.
    pub(crate) shift_ns: i64,
}

impl StampRule {
    /// True if the stamps are not read as they are written.
    pub(crate) fn has_unit(self) -> bool {
        self.reading != StampReading::AsWritten
    }

    /// True if log times are used in place of all stamps.
    pub(crate) fn is_log(self) -> bool {
        self.reading == StampReading::Log
    }

    /// True unless the messages are of another robot.
    pub(crate) fn is_read(self) -> bool {
        self.reading != StampReading::Unread
    }

    /// The stamp of seconds and nanoseconds; `None` if it was never set.
    pub(crate) fn stamp(self, (seconds, nanoseconds): (u32, u32)) -> Option<u64> {
        let (seconds_ns, below) = (u64::from(seconds) * SECOND_NS, u64::from(nanoseconds));
        let written_ns = seconds_ns + below;
        if written_ns == 0 && !self.begins_at_0 {
            return None;
        }
        let read_ns = match self.reading {
            StampReading::AsWritten => written_ns,
            StampReading::Whole(unit_ns) => written_ns.saturating_mul(unit_ns),
            StampReading::BelowSecond(unit_ns) => seconds_ns.saturating_add(below * unit_ns),
            StampReading::Log | StampReading::Unread => return None,
        };
        Some(read_ns.saturating_add_signed(self.shift_ns))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_are_read_in_their_unit_shifted_and_from_0_on() {
        let rule = StampRule::default();
        assert_eq!(rule.stamp((0, 0)), None);
        assert_eq!(rule.stamp((1, 5)), Some(1_000_000_005));
        let with = |reading| StampRule { reading, ..rule };
        assert_eq!(
            with(StampReading::Whole(1_000_000)).stamp((0, 1_033)),
            Some(1_033_000_000)
        );
        assert_eq!(
            with(StampReading::BelowSecond(1_000)).stamp((7, 33_333)),
            Some(7_033_333_000)
        );
        assert_eq!(with(StampReading::Log).stamp((7, 1)), None);
        assert_eq!(
            with(StampReading::Whole(1_000_000)).stamp((u32::MAX, 0)),
            Some(u64::MAX)
        );
        let zero = StampRule {
            begins_at_0: true,
            shift_ns: 300,
            ..rule
        };
        assert_eq!(zero.stamp((0, 0)), Some(300));
        let early = StampRule {
            shift_ns: -300,
            ..rule
        };
        assert_eq!(early.stamp((0, 7)), Some(0));
    }
}
