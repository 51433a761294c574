//! The cameras of a recording: topics, calibrations, transforms, baselines.

pub(crate) mod baseline;
pub(crate) mod camera;
pub(crate) mod camera_track;
pub(crate) mod topics;
pub(crate) mod transforms;
