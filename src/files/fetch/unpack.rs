//! Unpacks zip and 7z archives. Nothing is written outside the folder, no link is created, nothing
//! is replaced, sizes are checked beforehand.

use super::{CHUNK, STOPPED, Watch, unfinished};
use std::collections::BTreeSet;
use std::fs::File;
use std::io::{BufReader, Read, Write};
use std::path::{Component, Path, PathBuf};
use svl_core::{Error, Result};

/// Limit on entries in an archive.
const MAX_ENTRIES: usize = 1 << 20;

/// Limit on the compression ratio, beyond the first [`MAX_FREE`] bytes: images hardly shrink,
/// disparity maps by a factor of ten at most, a zip bomb by a thousand.
const MAX_RATIO: u64 = 100;
const MAX_FREE: u64 = 1 << 24;

/// Limit on an entry's name in bytes.
const MAX_NAME: usize = 1024;

/// Outcome of unpacking.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Unpacked {
    /// Files written.
    pub written: usize,
    /// Files that existed and were kept.
    pub kept: usize,
    /// Top-level names in the archive.
    pub top: BTreeSet<String>,
}

/// True if `name` is that of an archive that [`unpack`] reads.
pub fn is_archive(name: &str) -> bool {
    [".zip", ".7z"].iter().any(|ending| name.ends_with(ending))
}

/// Unpacks an archive into `folder`, which is created. Every file gets its name only once it is
/// complete and its CRC matches; existing files are kept.
///
/// # Errors
/// [`Error::Format`] for a file that is not an archive or is corrupt, for entries outside the
/// folder or of absurd size, or if `watch` returns false; [`Error::Io`].
pub fn unpack(archive: &Path, folder: &Path, watch: Watch<'_>) -> Result<Unpacked> {
    let file = File::open(archive).map_err(|e| Error::io(archive, e))?;
    let length = file.metadata().map_err(|e| Error::io(archive, e))?.len();
    // Small archives of text compress better than the ratio allows.
    let most = length.saturating_mul(MAX_RATIO).saturating_add(MAX_FREE);
    let file = BufReader::with_capacity(CHUNK, file);
    let target = Unpacker {
        archive,
        folder,
        watch,
        done: 0,
        total: 0,
        made: Unpacked::default(),
    };
    match archive.extension().and_then(|e| e.to_str()) {
        Some("zip") => zip(file, most, target),
        Some("7z") => seven(file, most, target),
        _ => Err(Error::format(
            archive,
            "not an archive that svl unpacks (.zip, .7z); unpack it yourself",
        )),
    }
}

fn zip(file: BufReader<File>, most: u64, mut target: Unpacker<'_>) -> Result<Unpacked> {
    let path = target.archive;
    let broken = |e: zip::result::ZipError| damaged(path, &e);
    let mut archive = zip::ZipArchive::new(file).map_err(broken)?;
    // A wrong size of an entry is detected when it is written.
    let mut sizes = Vec::new();
    for index in 0..archive.len() {
        sizes.push(archive.by_index_raw(index).map_err(broken)?.size());
    }
    target.expect(sizes, most)?;
    for index in 0..archive.len() {
        let mut entry = archive.by_index(index).map_err(broken)?;
        let (name, size) = (entry.name().map_err(broken)?.into_owned(), entry.size());
        let kind = match (entry.is_symlink(), entry.is_dir()) {
            (true, _) => EntryKind::Other,
            (_, true) => EntryKind::Folder,
            _ => EntryKind::File(size),
        };
        target.take(&name, kind, &mut entry)?;
    }
    Ok(target.made)
}

fn seven(file: BufReader<File>, most: u64, mut target: Unpacker<'_>) -> Result<Unpacked> {
    let path = target.archive;
    let broken = |e: sevenz_rust2::Error| damaged(path, &e);
    let mut archive =
        sevenz_rust2::ArchiveReader::new(file, sevenz_rust2::Password::empty()).map_err(broken)?;
    target.expect(
        archive
            .archive()
            .files
            .iter()
            .map(|entry| entry.size)
            .collect(),
        most,
    )?;
    let mut failure = None;
    let walked = archive.for_each_entries(|entry, bytes| {
        // Unix archivers keep the file mode in the upper half; 0o120000 is a symbolic link.
        let link = entry.windows_attributes >> 16 & 0o170_000 == 0o120_000;
        let kind = match (link || entry.is_anti_item, entry.is_directory) {
            (true, _) => EntryKind::Other,
            (_, true) => EntryKind::Folder,
            _ => EntryKind::File(entry.size),
        };
        failure = target.take(&entry.name, kind, bytes).err();
        Ok(failure.is_none())
    });
    let walked = failure.map_or_else(|| walked.map_err(broken), Err);
    walked.map(|()| target.made)
}

fn damaged(archive: &Path, error: &dyn std::fmt::Display) -> Error {
    Error::format(
        archive,
        format!("not an intact archive ({error}); delete it and fetch it again"),
    )
}

/// Kind of an entry.
enum EntryKind {
    /// With its size in bytes.
    File(u64),
    Folder,
    Other,
}

/// Writes the entries of one archive.
struct Unpacker<'a> {
    archive: &'a Path,
    folder: &'a Path,
    watch: Watch<'a>,
    done: u64,
    total: u64,
    made: Unpacked,
}

impl Unpacker<'_> {
    /// Rejects an archive whose entries are too many or contain more than `most` bytes.
    fn expect(&mut self, sizes: Vec<u64>, most: u64) -> Result<()> {
        self.total = sizes
            .iter()
            .fold(0, |sum: u64, &size| sum.saturating_add(size));
        if sizes.len() > MAX_ENTRIES || self.total > most {
            let what = format!(
                "contains {} entries of {} bytes in total",
                sizes.len(),
                self.total
            );
            return Err(Error::format(
                self.archive,
                format!("{what}, absurdly many for its size; it is not unpacked"),
            ));
        }
        std::fs::create_dir_all(self.folder).map_err(|e| Error::io(self.folder, e))
    }

    fn take(&mut self, name: &str, kind: EntryKind, bytes: &mut dyn Read) -> Result<()> {
        let refuse = |why: &str| {
            let shown: String = name
                .chars()
                .take(80)
                .flat_map(char::escape_default)
                .collect();
            Error::format(
                self.archive,
                format!("its entry '{shown}' {why}; the archive is not to be trusted"),
            )
        };
        let inside = inside(name).ok_or_else(|| refuse("would be written outside its folder"))?;
        let size = match kind {
            EntryKind::Other => return Err(refuse("is a link or a deletion")),
            EntryKind::Folder => 0,
            EntryKind::File(size) => size,
        };
        if let Some(Component::Normal(top)) = inside.components().next() {
            self.made.top.insert(top.to_string_lossy().into_owned());
        }
        let path = self.folder.join(inside);
        let folder = if matches!(kind, EntryKind::Folder) {
            &path
        } else {
            path.parent().unwrap_or(self.folder)
        };
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
        if matches!(kind, EntryKind::Folder) {
            return Ok(());
        }
        // symlink_metadata: a dangling link counts as existing and is not followed.
        if path.symlink_metadata().is_ok() {
            self.made.kept += 1;
            // Kept files count as done, so that progress reaches the total.
            self.done += size;
        } else {
            self.write(&path, size, bytes)?;
            self.made.written += 1;
        }
        Ok(())
    }

    fn write(&mut self, path: &Path, size: u64, bytes: &mut dyn Read) -> Result<()> {
        let part = unfinished(path);
        let mut file = File::create(&part).map_err(|e| Error::io(&part, e))?;
        let (mut left, mut chunk) = (size, vec![0; CHUNK]);
        loop {
            if !(self.watch)(self.done, Some(self.total)) {
                return Err(Error::format(self.archive, STOPPED));
            }
            let n = bytes
                .read(&mut chunk)
                .map_err(|e| damaged(self.archive, &e))?;
            if n == 0 && left == 0 {
                break;
            }
            // Neither more nor fewer bytes than announced: the sum of sizes was checked before.
            let Some(rest) = left.checked_sub(n as u64).filter(|_| n > 0) else {
                return Err(damaged(
                    self.archive,
                    &format!("{} does not have the size it claims", path.display()),
                ));
            };
            file.write_all(&chunk[..n])
                .map_err(|e| Error::io(&part, e))?;
            left = rest;
            self.done += n as u64;
        }
        std::fs::rename(&part, path).map_err(|e| Error::io(path, e))
    }
}

/// The relative path of an entry's name; `None` if it would leave the folder or is not portable.
fn inside(name: &str) -> Option<PathBuf> {
    // Backslash and colon are separators elsewhere, and would escape the check of components.
    let strange = |c: char| c.is_control() || c == '\\' || c == ':';
    let path = Path::new(name);
    let normal = path
        .components()
        .all(|c| matches!(c, Component::Normal(_) | Component::CurDir));
    let named = path.components().any(|c| matches!(c, Component::Normal(_)));
    (name.len() <= MAX_NAME && normal && named && !name.chars().any(strange))
        .then(|| path.components().collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stay_inside() {
        assert_eq!(inside("a/./b.png"), Some(PathBuf::from("a/b.png")));
        assert_eq!(inside("a/"), Some(PathBuf::from("a")));
        for name in [
            "../a",
            "a/../../b",
            "/etc/passwd",
            "",
            ".",
            "C:\\a",
            "a\\b",
            "a\0b",
            "a\nb",
            &"a".repeat(1025),
        ] {
            assert_eq!(inside(name), None, "{name}");
        }
    }
}
