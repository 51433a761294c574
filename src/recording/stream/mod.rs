//! Messages as a stream: channels, stamps, unpacked records.

pub(crate) mod restamped;
pub(crate) mod stamp_rule;
