//! Readers of whole files up to a size limit.

use crate::error::{Error, Result};
use crate::inputs;
use std::io::Read;
use std::path::Path;

/// The reason why the first bytes of a file are not those of the file that its name promises: a
/// pointer of Git LFS, a web page.
pub fn stand_in(first: &[u8]) -> Option<&'static str> {
    let text = String::from_utf8_lossy(&first[..first.len().min(64)]).to_ascii_lowercase();
    let text = text.trim_start_matches('\u{feff}').trim_start();
    if text.starts_with("version https://") {
        return Some("is a pointer of Git LFS; `git lfs pull` fetches the file");
    }
    let is_page = ["<!doctype html", "<html"]
        .iter()
        .any(|tag| text.starts_with(tag));
    is_page.then_some("is a web page (HTML), not the file; download it again")
}

/// Reads a whole file of at most `max_bytes`.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] for an empty file, a larger one, one that stands in for another
/// ([`stand_in`]), and anything but a regular file (a folder, a device, a pipe).
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
        _ => match stand_in(&bytes) {
            Some(why) => Err(Error::format(path, why)),
            None => Ok(bytes),
        },
    }
}

/// Reads a text file of at most `max_bytes`.
pub fn read_text(path: &Path, max_bytes: u64) -> Result<String> {
    String::from_utf8(read_bounded(path, max_bytes)?)
        .map_err(|_| Error::format(path, "is not UTF-8 text; is it the right file?"))
}
