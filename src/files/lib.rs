//! Image and disparity files. Input is untrusted: sizes are checked before memory is allocated.

mod bit_depth;
mod build_info;
mod cloud;
mod columns;
mod decoded;
mod depth;
mod disparity;
mod fault;
pub mod ffmpeg;
mod image;
mod jpeg;
mod levels;
mod map;
mod npz;
pub mod outputs;
pub mod overlay;
pub mod pairing;
mod pfm;
mod picture;
mod rvl;

pub use bit_depth::BitDepth;
pub use cloud::{pixel_points, write_ply};
pub use columns::{ColumnPlaces, ColumnValue, TableText};
pub use decoded::{DecodedImage, SideBySide};
pub use depth::{known_depths, no_depth, read_depth, read_points};
pub use disparity::{MapScale, read_disparities, read_disparity_steps};
pub use disparity::{write_disparity, write_why};
pub use fault::{ImageFault, MapFault};
pub use image::{IMAGE_ENDINGS, decode_bytes, read_image};
pub use image::{encode_png, read_gray, read_mask, read_object_map, write_png};
#[cfg(target_os = "linux")]
pub use jpeg::brightness;
pub use levels::GreyLevels;
pub use pfm::{read_pfm, write_pfm};
pub use picture::{
    encode_classes_png, encode_color_jpeg, encode_jpeg, encode_palette_png, through_jpeg,
};
pub use rvl::{InverseDepth, encode_rvl};
pub use rvl::{RVL_HEADER, decode_rvl};
pub(crate) use svl_core::bounded::read_bounded;
pub use svl_core::bounded::read_text;

use std::path::{Component, Path, PathBuf, absolute};

/// A text as a name of a file or folder, of at most `max` characters: letters and digits of any
/// script, `_`, `-` and, unless it is the first, `.`; every other character becomes `-`.
pub fn safe_name(text: &str, max: usize) -> String {
    let is_safe = |i, c: char| c.is_alphanumeric() || "_-".contains(c) || (c == '.' && i > 0);
    let characters = text.chars().take(max).enumerate();
    characters
        .map(|(i, c)| if is_safe(i, c) { c } else { '-' })
        .collect()
}
use svl_core::stereo::Plane;

/// Limit on the size of an image or map file, in bytes.
const MAX_BYTES: u64 = 1 << 30;

/// True if a file has this extension, in lower or upper case.
pub fn has_ending(path: &Path, ending: &str) -> bool {
    path.extension()
        .is_some_and(|e| e.eq_ignore_ascii_case(ending))
}

/// `path` relative to `folder`; absolute if they have nothing in common. A link keeps its name.
pub fn relative_path(path: &Path, folder: &Path) -> PathBuf {
    let here = Path::new(".");
    let folder = if folder.as_os_str().is_empty() {
        here
    } else {
        folder
    };
    let own = match (path.parent(), path.file_name()) {
        (Some(parent), Some(name)) => {
            let parent = if parent.as_os_str().is_empty() {
                here
            } else {
                parent
            };
            real_path(parent).map(|parent| parent.join(name))
        }
        _ => real_path(path),
    };
    let (Ok(path), Ok(folder)) = (own, real_path(folder)) else {
        return path.to_owned();
    };
    let both = path.components().zip(folder.components());
    let shared = both.take_while(|(a, b)| a == b).count();
    if shared <= 1 {
        return path;
    }
    let up = folder
        .components()
        .skip(shared)
        .map(|_| Component::ParentDir);
    up.chain(path.components().skip(shared)).collect()
}

/// A path without links, with which `..` would lead elsewhere; its end need not exist.
fn real_path(path: &Path) -> std::io::Result<PathBuf> {
    if let Ok(real) = path.canonicalize() {
        return Ok(real);
    }
    let path = absolute(path)?;
    match (path.parent(), path.file_name()) {
        (Some(parent), Some(name)) => Ok(real_path(parent)?.join(name)),
        _ => Ok(path),
    }
}

/// The rows of an image in memory: `height` rows of `row_bytes` bytes, `stride` bytes apart. The
/// padding of the last row may be missing.
///
/// # Errors
/// The number of bytes needed, if `data` has fewer, or if rows overlap or are empty.
pub fn strided_rows(
    data: &[u8],
    row_bytes: usize,
    height: usize,
    stride: usize,
) -> Result<impl Iterator<Item = &[u8]>, usize> {
    let before_last = stride.saturating_mul(height.saturating_sub(1));
    let expected = before_last.saturating_add(row_bytes);
    if row_bytes == 0 || stride < row_bytes || data.len() < expected {
        return Err(expected);
    }
    let rows = data.chunks(stride).take(height);
    Ok(rows.map(move |row| &row[..row_bytes]))
}

/// Byte `at` of every `bytes` of the rows.
pub fn every_byte<'a>(rows: impl Iterator<Item = &'a [u8]>, bytes: usize, at: usize) -> Vec<u8> {
    rows.flat_map(|row| row.chunks_exact(bytes))
        .map(|pixel| pixel[at])
        .collect()
}

/// The values with `+∞`, "unknown", for everything that is not finite.
fn known(values: &Plane<f32>) -> Plane<f32> {
    values.map(|v| if v.is_finite() { v } else { f32::INFINITY })
}

pub use build_info::{BuildInfo, slow_profile};
