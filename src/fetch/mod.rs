//! Getting files from where they are published: download, check, unpack. All that arrives is taken
//! for hostile.

mod download;
mod receipt;
mod unpack;

pub use download::download;
pub use receipt::{Receipt, Receipts, sha256};
pub use unpack::{Unpacked, is_archive, unpack};

use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// Told how many bytes are done, and of how many where that is known; says whether to go on.
pub type Watch<'a> = &'a mut dyn FnMut(u64, Option<u64>) -> bool;

/// Why something ended that [`Watch`] said should end.
const STOPPED: &str = "stopped; run it again to go on from there";

/// Bytes moved at once.
const CHUNK: usize = 1 << 17;

/// Where a file is made before it has its name: what has the name is whole.
fn unfinished(path: &Path) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(".part");
    name.into()
}
