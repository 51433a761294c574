//! The rule by which the stamps of a topic are read: as they are written, or repaired as the user
//! says.

use crate::messages::{Channel, EventReader, FileEvent};
use std::collections::BTreeMap;
use std::sync::Arc;
use svl_core::Result;

const SECOND_NS: u64 = 1_000_000_000;

/// What stamps are in truth, by the user's word.
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
pub(super) enum Reading {
    #[default]
    AsWritten,
    /// All of it, in units of so many nanoseconds.
    Whole(u64),
    /// The part below a second, in units of so many nanoseconds.
    BelowSecond(u64),
    /// The message counts as one without a stamp.
    Log,
}

/// How the stamps of a topic are read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct StampRule {
    pub(super) reading: Reading,
    /// True if the clock begins at 0: elsewhere a stamp of 0 was never set.
    pub(super) begins_at_0: bool,
    /// Added to all stamps.
    pub(super) shift_ns: i64,
}

impl StampRule {
    /// True if the stamps are not read as they are written.
    pub(super) fn has_unit(self) -> bool {
        self.reading != Reading::AsWritten
    }

    /// True if log times are used in place of all stamps.
    pub(crate) fn is_log(self) -> bool {
        self.reading == Reading::Log
    }

    /// The stamp of seconds and nanoseconds; `None` if it was never set.
    pub(crate) fn stamp(self, (seconds, nanoseconds): (u32, u32)) -> Option<u64> {
        let (seconds_ns, below) = (u64::from(seconds) * SECOND_NS, u64::from(nanoseconds));
        let written_ns = seconds_ns + below;
        if written_ns == 0 && !self.begins_at_0 {
            return None;
        }
        let read_ns = match self.reading {
            Reading::AsWritten => written_ns,
            Reading::Whole(unit_ns) => written_ns.saturating_mul(unit_ns),
            Reading::BelowSecond(unit_ns) => seconds_ns.saturating_add(below * unit_ns),
            Reading::Log => return None,
        };
        Some(read_ns.saturating_add_signed(self.shift_ns))
    }
}

/// The rules of the topics that have one.
pub(crate) type StampRules = Arc<BTreeMap<String, StampRule>>;

/// Messages whose stamps are read by rules.
pub(crate) struct Restamped {
    messages: Box<dyn EventReader>,
    rules: StampRules,
    /// The channel of the last message, with its rule.
    channel: Option<Channel>,
}

impl Restamped {
    /// The messages themselves if there are no rules.
    pub(crate) fn over(messages: Box<dyn EventReader>, rules: &StampRules) -> Box<dyn EventReader> {
        if rules.is_empty() {
            return messages;
        }
        Box::new(Self {
            messages,
            rules: Arc::clone(rules),
            channel: None,
        })
    }
}

impl EventReader for Restamped {
    fn next(&mut self) -> Result<Option<FileEvent<'_>>> {
        Ok(match self.messages.next()? {
            Some(FileEvent::Message(channel, log_time, data)) => {
                let rule = self.rules.get(&channel.topic);
                let channel = match rule {
                    Some(rule) => &*self.channel.insert(channel.restamped(*rule)),
                    None => channel,
                };
                Some(FileEvent::Message(channel, log_time, data))
            }
            other => other,
        })
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
            with(Reading::Whole(1_000_000)).stamp((0, 1_033)),
            Some(1_033_000_000)
        );
        assert_eq!(
            with(Reading::BelowSecond(1_000)).stamp((7, 33_333)),
            Some(7_033_333_000)
        );
        assert_eq!(with(Reading::Log).stamp((7, 1)), None);
        assert_eq!(
            with(Reading::Whole(1_000_000)).stamp((u32::MAX, 0)),
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
