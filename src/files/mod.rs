//! Images and disparity maps on disk. Everything read here is taken for hostile: sizes are bounded before memory is.

mod disparity;
mod image;
mod pfm;

pub use disparity::{read_scaled_disparity, write_disparity, write_why};
pub use image::{encode_png, read_gray, read_mask, write_png};
pub use pfm::{read_pfm, write_pfm};

use crate::error::{Error, Result};
use std::path::Path;

/// Largest file that is read whole, bytes.
const MAX_BYTES: u64 = 1 << 30;

/// Reads a file of bounded size whole.
fn read_bounded(path: &Path) -> Result<Vec<u8>> {
    let metadata = std::fs::metadata(path).map_err(|e| Error::io(path, e))?;
    if metadata.is_dir() {
        return Err(Error::format(path, "is a folder, expected a file"));
    }
    if metadata.len() > MAX_BYTES {
        return Err(Error::format(
            path,
            format!("{} bytes is more than the {MAX_BYTES} that are read", metadata.len()),
        ));
    }
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, e))?;
    if bytes.is_empty() {
        return Err(Error::format(path, "is empty"));
    }
    Ok(bytes)
}
