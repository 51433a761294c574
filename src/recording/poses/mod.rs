//! Poses of the left camera, and motion between two moments.

pub(crate) mod motion;
pub(crate) mod pose_summary;
pub(crate) mod reader;
