//! The files of units: each whole, with a checksum, and renamed into place.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;
use std::fs::{File, OpenOptions};
use std::io::{BufReader, Write};
use std::path::{Path, PathBuf};
use svl_core::{Error, Result};
use svl_files::outputs::remove_file;
use svl_score::manifest::hash;

/// Makes a folder; a link or a file in its place is removed.
pub(super) fn make_real_folder(folder: &Path) -> Result<()> {
    if folder.is_symlink() || folder.is_file() {
        remove_file(folder)?;
    }
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))
}

pub(super) fn copy(from: &Path, to: &Path) -> Result<()> {
    let bytes = read(from)?;
    write_whole(to, &[&bytes])
}

/// The extension of a file that is being written, behind the number of its process.
const PART: &str = "part";

/// True for a file that [`write_whole`] began.
pub(super) fn is_part(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let mut words = name.rsplit('.');
    let is_number = |word: &str| word.parse::<u32>().is_ok();
    words.next() == Some(PART) && words.next().is_some_and(is_number)
}

/// Most bytes of a file of units.
const MAX_BYTES: u64 = 1 << 40;

/// Reads a file, which is a regular one.
pub(super) fn read(path: &Path) -> Result<Vec<u8>> {
    svl_core::bounded::read_bounded(path, MAX_BYTES)
}

/// Opens a file of units, which is a regular one.
pub(super) fn open(path: &Path) -> Result<BufReader<File>> {
    let io = |e| Error::io(path, e);
    if !std::fs::metadata(path).map_err(io)?.is_file() {
        return Err(Error::format(path, "is not a regular file"));
    }
    Ok(BufReader::new(File::open(path).map_err(io)?))
}

/// Writes a file under another name, and renames it once it is on the disk.
///
/// # Errors
/// [`Error::Io`] with the file.
pub(super) fn write_whole(path: &Path, parts: &[&[u8]]) -> Result<()> {
    // Another process may write the same file.
    let begun = path.with_extension(format!("{}.{PART}", std::process::id()));
    let write = || {
        let _ = std::fs::remove_file(&begun);
        let mut file = OpenOptions::new()
            .write(true)
            .create_new(true)
            .open(&begun)?;
        parts.iter().try_for_each(|part| file.write_all(part))?;
        file.sync_all()?;
        std::fs::rename(&begun, path)
    };
    write().map_err(|e| {
        let _ = std::fs::remove_file(&begun);
        Error::io(path, e)
    })
}

/// The JSON of a value.
pub(super) fn json(value: &impl Serialize) -> Result<Vec<u8>> {
    serde_json::to_vec(value).map_err(|e| Error::Invalid(format!("units: {e}")))
}

/// A value with the checksum of its JSON.
#[derive(Deserialize)]
struct CheckedJson<'a> {
    checksum: String,
    #[serde(borrow)]
    content: &'a RawValue,
}

pub(super) fn write_checked(path: &Path, value: &impl Serialize) -> Result<()> {
    let content = serde_json::to_string(value);
    let content = content.map_err(|e| Error::Invalid(format!("units: {e}")))?;
    let head = format!("{{\"checksum\":\"{}\",\"content\":", hash(&content));
    write_whole(path, &[head.as_bytes(), content.as_bytes(), b"}\n"])
}

pub(super) fn read_checked<T: DeserializeOwned>(path: &Path) -> Result<T> {
    let bytes = read(path)?;
    let checked = serde_json::from_slice::<CheckedJson<'_>>(&bytes).ok();
    let content = checked.filter(|own| hash(own.content.get()) == own.checksum);
    let value = content.and_then(|own| serde_json::from_str(own.content.get()).ok());
    value.ok_or_else(|| {
        Error::format(
            path,
            "is damaged: `svl score` with the same options makes it again",
        )
    })
}

/// The content of a file; none, with a warning, if it is damaged: its results are missing then.
pub(super) fn read_or_warn<T: DeserializeOwned>(path: &Path) -> Option<T> {
    let read = read_checked(path);
    read.inspect_err(|error| tracing::warn!("{error}")).ok()
}

/// The paths in a folder, in the order of their names; none if there is no folder.
pub(super) fn entries(folder: &Path) -> Result<Vec<PathBuf>> {
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let read = std::fs::read_dir(folder);
    let paths: std::io::Result<Vec<_>> =
        read.and_then(|entries| entries.map(|entry| Ok(entry?.path())).collect());
    let mut paths = paths.map_err(|e| Error::io(folder, e))?;
    paths.sort_unstable();
    Ok(paths)
}

pub(super) fn files(folder: &Path, extension: &str) -> Result<Vec<PathBuf>> {
    let mut paths = entries(folder)?;
    paths.retain(|path| path.extension().is_some_and(|own| own == extension));
    Ok(paths)
}
