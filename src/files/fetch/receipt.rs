//! Receipts of fetched files, with their checksums: publishers of data sets provide none, so the
//! first fetch sets them.

use super::{CHUNK, STOPPED, Watch, unfinished};
use crate::read_text;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use svl_core::{Error, Result};

/// Largest file of receipts accepted, bytes.
const MAX_BYTES: u64 = 1 << 24;

/// One fetched file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Receipt {
    /// URL or path of the source.
    pub from: String,
    pub bytes: u64,
    /// In hexadecimal.
    pub sha256: String,
    /// Files and folders made from it, relative to the folder of the receipts.
    pub made: Vec<String>,
}

/// The receipts of a folder, by the fetched file's name, in `fetched.json`.
#[derive(Debug)]
pub struct Receipts {
    path: PathBuf,
    by_name: BTreeMap<String, Receipt>,
}

impl Receipts {
    /// Reads the receipts of `folder`; empty if nothing was fetched.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] for receipts svl did not write.
    pub fn read(folder: &Path) -> Result<Self> {
        let path = folder.join("fetched.json");
        let by_name = if path.exists() {
            // Read with a limit, as it is next to downloaded files.
            serde_json::from_str(&read_text(&path, MAX_BYTES)?).map_err(|e| {
                Error::format(
                    &path,
                    format!("not svl's list of what was fetched ({e}); delete it"),
                )
            })?
        } else {
            BTreeMap::new()
        };
        Ok(Self { path, by_name })
    }

    /// True if the file `name` was fetched and everything made from it still exists.
    pub fn fulfilled(&self, name: &str) -> bool {
        let folder = self.path.parent().unwrap_or(Path::new("."));
        self.by_name
            .get(name)
            .is_some_and(|receipt| receipt.made.iter().all(|made| folder.join(made).exists()))
    }

    /// Checks that a file has the checksum of the one fetched before under that name.
    ///
    /// # Errors
    /// [`Error::Format`] with both checksums if it does not.
    pub fn agrees(&self, name: &str, path: &Path, sha256: &str) -> Result<()> {
        match self
            .by_name
            .get(name)
            .filter(|receipt| receipt.sha256 != sha256)
        {
            Some(earlier) => {
                let what = format!(
                    "its sha256 is {sha256}, of the one fetched before it was {}",
                    earlier.sha256
                );
                let cure = format!(
                    "delete it to fetch it again, or {} to trust the new one",
                    self.path.display()
                );
                Err(Error::format(path, format!("{what}; {cure}")))
            }
            None => Ok(()),
        }
    }

    /// Adds a receipt and writes them all.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn add(&mut self, name: &str, receipt: Receipt) -> Result<()> {
        self.by_name.insert(name.to_owned(), receipt);
        let text = serde_json::to_string_pretty(&self.by_name)
            .map_err(|e| Error::Invalid(e.to_string()))?
            + "\n";
        // Renamed when complete: a crash must not lose the receipts of hours of downloads.
        let part = unfinished(&self.path);
        let written = std::fs::write(&part, text).and_then(|()| std::fs::rename(&part, &self.path));
        written.map_err(|e| Error::io(&self.path, e))
    }
}

/// SHA-256 of a file, in hexadecimal, and its length.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] if `watch` returns false.
pub fn sha256(path: &Path, watch: Watch<'_>) -> Result<(String, u64)> {
    let io = |e| Error::io(path, e);
    let mut file = File::open(path).map_err(io)?;
    let total = file.metadata().map_err(io)?.len();
    let (mut hasher, mut done, mut chunk) = (Sha256::new(), 0, vec![0; CHUNK]);
    loop {
        if !watch(done, Some(total)) {
            return Err(Error::format(path, STOPPED));
        }
        match file.read(&mut chunk).map_err(io)? {
            0 => return Ok((format!("{:x}", hasher.finalize()), done)),
            n => {
                hasher.update(&chunk[..n]);
                done += n as u64;
            }
        }
    }
}
