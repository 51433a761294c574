//! Samples of images as floating-point numbers.

use crate::decode::encoding::{self, Samples, samples, u16_of};
use crate::message::ros::read::RawPixels;
use crate::message::{MessageResult, ros};
use crate::stream::channel::Channel;
use svl_core::stereo::Plane;

/// The samples of an image of floats, as they are.
pub(crate) fn floats(channel: &Channel, data: &[u8]) -> MessageResult<Plane<f32>> {
    values(&ros::read(channel, data, ros::image)?.1)
}

/// The samples of an image of depths, in metres, before invalid ones are removed.
pub(crate) fn values(raw: &RawPixels<'_>) -> MessageResult<Plane<f32>> {
    let why_no_depths = || encoding::why_no_depths(raw.encoding);
    let encoding = encoding::named(raw.encoding).ok_or_else(why_no_depths)?;
    let rows = encoding.rows(raw)?;
    let depths: Vec<f32> = match (encoding.samples, raw.big_endian) {
        (Samples::Grey16, _) => samples(rows, u16_of(raw)).map(metres).collect(),
        (Samples::Float32, false) => samples(rows, f32::from_le_bytes).collect(),
        (Samples::Float32, true) => samples(rows, f32::from_be_bytes).collect(),
        (Samples::Float64, false) => samples(rows, f64::from_le_bytes)
            .map(|z| z as f32)
            .collect(),
        (Samples::Float64, true) => samples(rows, f64::from_be_bytes)
            .map(|z| z as f32)
            .collect(),
        _ => return Err(why_no_depths()),
    };
    let (width, height) = (raw.width as usize, raw.height as usize);
    Ok(Plane::from_vec(width, height, depths)?)
}

/// A depth in metres.
pub(crate) fn metres(millimetres: u16) -> f32 {
    f32::from(millimetres) / 1000.0
}
