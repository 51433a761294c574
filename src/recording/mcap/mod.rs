//! MCAP files: records, chunks, intact and corrupt parts, appending.

pub(crate) mod append_file;
pub(crate) mod chunk;
pub(crate) mod file;
pub(crate) mod layout;
pub(crate) mod messages;
pub(crate) mod records;
pub(crate) mod search;
pub(crate) mod synced_file;
