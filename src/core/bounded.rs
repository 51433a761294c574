//! Readers of whole files up to a size limit.

use crate::error::{Error, Result};
use crate::inputs;
use std::io::Read;
use std::path::Path;

/// Reads a whole file of at most `max_bytes`.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] for an empty file, a larger one, and anything but a regular
/// file (a folder, a device, a pipe).
pub fn read_bounded(path: &Path, max_bytes: u64) -> Result<Vec<u8>> {
    let io = |e| Error::io(path, e);
    // Before opening: opening a pipe would wait for its writer.
    let kind = std::fs::metadata(path).map_err(io)?.file_type();
    if !kind.is_file() {
        let what = if kind.is_dir() {
            "is a folder"
        } else {
            "is not a regular file"
        };
        return Err(Error::format(path, format!("{what}; name a file")));
    }
    let mut bytes = Vec::new();
    inputs::open(path)
        .map_err(io)?
        // One more than allowed, as the file may grow while it is read.
        .take(max_bytes + 1)
        .read_to_end(&mut bytes)
        .map_err(io)?;
    match bytes.len() as u64 {
        0 => Err(Error::format(path, "is empty")),
        length if length > max_bytes => Err(Error::format(
            path,
            format!("is larger than the {max_bytes} bytes it may be"),
        )),
        _ => Ok(bytes),
    }
}

/// Reads a text file of at most `max_bytes`.
pub fn read_text(path: &Path, max_bytes: u64) -> Result<String> {
    String::from_utf8(read_bounded(path, max_bytes)?)
        .map_err(|_| Error::format(path, "is not UTF-8 text; is it the right file?"))
}
