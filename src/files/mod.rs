//! Images and disparity maps on disk. Everything read here is taken for hostile: sizes are bounded
//! before memory is.

mod disparity;
mod image;
mod jpeg;
mod npz;
mod pfm;
mod picture;

pub(crate) use crate::bounded::{read_bounded, read_text};
pub use disparity::{
    has_ending, read_estimate, read_scaled_disparity, read_truth, write_disparity, write_why,
};
pub(crate) use image::{decode_bytes, gray, gray_of};
pub use image::{encode_png, read_gray, read_mask, read_object_map, write_png};
#[cfg(all(feature = "v4l2", target_os = "linux"))]
pub(crate) use jpeg::brightness;
pub use npz::read_npz;
pub use pfm::{read_pfm, write_pfm};
pub use picture::{encode_jpeg, encode_palette_png};

use crate::stereo::Plane;

/// Largest image or map that is read, bytes.
const MAX_BYTES: u64 = 1 << 30;

/// The values with `+∞`, "unknown", for all that is not finite.
fn known(values: &Plane<f32>) -> Plane<f32> {
    values.map(|v| if v.is_finite() { v } else { f32::INFINITY })
}
