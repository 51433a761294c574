//! Videos as a source: one of both images side by side, or one of each camera.

pub(crate) mod log;
pub(crate) mod offset;
pub(crate) mod source;
pub(crate) mod stamped;
pub(crate) mod stream;
