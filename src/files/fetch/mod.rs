//! Fetches published data sets: download, checksums, unpacking. Input is untrusted.

mod download;
mod receipt;
mod unpack;

pub use download::download;
pub use receipt::{Receipt, Receipts, sha256};
pub use unpack::{Unpacked, is_archive, unpack};

use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// Progress callback: bytes done, and in total if known; returns false to stop.
pub type Watch<'a> = &'a mut dyn FnMut(u64, Option<u64>) -> bool;

/// The error after [`Watch`] returned false.
const STOPPED: &str = "stopped; run it again to resume from there";

/// Bytes copied at a time.
const CHUNK: usize = 1 << 17;

/// The name of a file until it is complete, so that a file with its final name is always complete.
fn unfinished(path: &Path) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(".part");
    name.into()
}
