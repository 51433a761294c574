//! Images that are pictures of a video: each message holds one.

pub(crate) mod bits;
pub(crate) mod decoder;
pub(crate) mod headers;
pub(crate) mod matroska;
pub(crate) mod message;
pub(crate) mod order;
pub(crate) mod topic;
