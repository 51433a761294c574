//! A recording written, and recovered.

pub(crate) mod dialect;
pub(crate) mod recovery;
pub(crate) mod topic_file;
pub(crate) mod writer;
