//! A recording read: pairs, results and a summary.

pub(crate) mod reader;
pub(crate) mod summary;
pub(crate) mod topic_pairs;
