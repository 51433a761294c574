//! Messages of other programs decoded to pixels.

pub(crate) mod bayer;
pub(crate) mod encoding;
pub(crate) mod head;
pub(crate) mod image;
pub(crate) mod json;
pub(crate) mod pixels;
pub(crate) mod realsense;
pub(crate) mod video;
