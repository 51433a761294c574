//! Images and disparity maps on disk. Everything read here is taken for hostile: sizes are bounded before memory is.

mod bounded;
#[cfg(feature = "bench")]
mod disparity;
#[cfg(feature = "bench")]
mod image;
#[cfg(feature = "bench")]
mod npz;
#[cfg(feature = "bench")]
mod pfm;
#[cfg(feature = "bench")]
mod picture;

#[cfg(feature = "bench")]
pub(crate) use bounded::read_bounded;
pub(crate) use bounded::read_text;
#[cfg(feature = "bench")]
pub use disparity::{has_ending, read_estimate, read_scaled_disparity, read_truth, write_disparity, write_why};
#[cfg(feature = "bench")]
pub(crate) use image::gray_of;
#[cfg(feature = "bench")]
pub use image::{encode_png, read_gray, read_mask, read_object_map, write_png};
#[cfg(feature = "bench")]
pub use npz::read_npz;
#[cfg(feature = "bench")]
pub use pfm::{read_pfm, write_pfm};
#[cfg(feature = "bench")]
pub use picture::{encode_jpeg, encode_palette_png};

#[cfg(feature = "bench")]
use crate::stereo::Plane;

/// Largest image or map that is read, bytes.
#[cfg(feature = "bench")]
const MAX_BYTES: u64 = 1 << 30;

/// The values with `+∞`, "unknown", for all that is not finite.
#[cfg(feature = "bench")]
fn known(values: &Plane<f32>) -> Plane<f32> {
    values.map(|v| if v.is_finite() { v } else { f32::INFINITY })
}
