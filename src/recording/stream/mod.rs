//! Messages as a stream: channels, stamps, unpacked records.

pub(crate) mod channel;
pub(crate) mod restamped;
pub(crate) mod stamp_rule;
pub(crate) mod unpack;
