//! The files that a process reads: registered where they are opened, with what shows later that
//! they changed.
//!
//! A reader opens files with [`open`], lists folders with [`list`] and looks for files with
//! [`is_file`]; what others open (SQLite, ffmpeg), it registers by [`register`]. Nothing is noted
//! unless somebody asked for it: [`InputLog::enter`].

use parking_lot::Mutex;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::{File, Metadata};
use std::io::Result;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

/// A file that was changed less than this before it was read may change again within the same step
/// of the file system's clock, as in git's index.
const RECENT_NS: u64 = 2_000_000_000;

type Stamps = Arc<Mutex<BTreeMap<PathBuf, FileStamp>>>;

/// The log that files are noted in.
static CURRENT: Mutex<Option<Stamps>> = Mutex::new(None);

/// The files that were read while it was entered, each as it was when it was opened first.
#[derive(Clone, Debug, Default)]
pub struct InputLog(Stamps);

/// Files are noted in a log while this lives.
#[must_use]
pub struct EnteredLog(Option<Stamps>);

impl InputLog {
    /// Notes the files that any thread opens, until the result is dropped.
    pub fn enter(&self) -> EnteredLog {
        EnteredLog(CURRENT.lock().replace(Arc::clone(&self.0)))
    }

    /// The files so far, by their paths.
    pub fn stamps(&self) -> Vec<FileStamp> {
        self.0.lock().values().cloned().collect()
    }
}

impl Drop for EnteredLog {
    fn drop(&mut self) {
        *CURRENT.lock() = self.0.take();
    }
}

/// Opens a file to be read.
///
/// # Errors
/// The errors of [`File::open`].
pub fn open(path: &Path) -> Result<File> {
    let file = File::open(path);
    note(path, || match &file {
        Ok(file) => file.metadata().map_or(FileState::Absent, FileState::from),
        Err(_) => FileState::Absent,
    });
    file
}

/// The entries of a folder, in the order of their names.
///
/// # Errors
/// The errors of [`std::fs::read_dir`].
pub fn list(folder: &Path) -> Result<Vec<PathBuf>> {
    let listed = std::fs::read_dir(folder).and_then(|entries| {
        let paths: Result<Vec<_>> = entries.map(|entry| Ok(entry?.path())).collect();
        let mut paths = paths?;
        // Names of one case before the other: read_dir has no order of its own.
        paths.sort_unstable();
        Ok(paths)
    });
    note(folder, || {
        listed
            .as_ref()
            .map_or(FileState::Absent, |paths| names(paths))
    });
    listed
}

/// True if a regular file is there; none is noted, too: one may come.
pub fn is_file(path: &Path) -> bool {
    let is_file = path.is_file();
    if !is_file {
        note(path, || FileState::Absent);
    }
    is_file
}

/// Notes a file, or a folder with its entries, that another library or program opens.
pub fn register(path: &Path) {
    note(path, || FileState::read(path));
}

fn note(path: &Path, state: impl FnOnce() -> FileState) {
    let log = CURRENT.lock().clone();
    if let Some(log) = log {
        let mut stamps = log.lock();
        if !stamps.contains_key(path) {
            let stamp = FileStamp {
                // A name that is not UTF-8 is not found again: its file counts as changed.
                path: path.to_string_lossy().into_owned(),
                state: state(),
            };
            stamps.insert(path.to_owned(), stamp);
        }
    }
}

/// A file as it was when it was read.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileStamp {
    path: String,
    state: FileState,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum FileState {
    /// Nothing is there, or nothing that can be opened.
    Absent,
    /// A folder, with the hash of the names in it.
    Folder(String),
    File {
        bytes: u64,
        modified_ns: u64,
        /// Time of the last change of the file or of what describes it (`ctime`), and its inode;
        /// none where the system has neither.
        identity: Option<(u64, u64)>,
        /// True if the last change was not just before the file was read.
        is_settled: bool,
    },
}

/// What has become of a file since it was read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileChange {
    /// It is the same file, with the same times.
    Unchanged,
    /// The same, but it was changed just before it was read, so that its times say little.
    Recent,
    Changed,
    /// It is not there any more.
    Gone,
}

impl FileStamp {
    /// The path by which it was opened.
    pub fn path(&self) -> &Path {
        Path::new(&self.path)
    }

    /// What has become of the file.
    pub fn change(&self) -> FileChange {
        let now = FileState::read(self.path());
        match (&self.state, &now) {
            (
                FileState::File {
                    bytes,
                    modified_ns,
                    identity: identity @ Some(_),
                    is_settled,
                },
                FileState::File {
                    bytes: bytes_now,
                    modified_ns: modified_now,
                    identity: identity_now,
                    ..
                },
            ) if (bytes, modified_ns, identity) == (bytes_now, modified_now, identity_now) => {
                match is_settled {
                    true => FileChange::Unchanged,
                    false => FileChange::Recent,
                }
            }
            (FileState::File { .. }, FileState::Absent) => FileChange::Gone,
            (FileState::File { .. }, _) => FileChange::Changed,
            (before, now) if before == now => FileChange::Unchanged,
            _ => FileChange::Changed,
        }
    }
}

impl FileState {
    fn read(path: &Path) -> Self {
        match std::fs::metadata(path) {
            Err(_) => Self::Absent,
            Ok(metadata) if metadata.is_dir() => {
                let entries = std::fs::read_dir(path).into_iter().flatten().flatten();
                let mut paths: Vec<_> = entries.map(|entry| entry.path()).collect();
                paths.sort_unstable();
                names(&paths)
            }
            Ok(metadata) => Self::from(metadata),
        }
    }
}

impl From<Metadata> for FileState {
    fn from(metadata: Metadata) -> Self {
        let ns = |time: SystemTime| {
            let since = time.duration_since(UNIX_EPOCH).unwrap_or_default();
            since.as_nanos() as u64
        };
        let modified_ns = metadata.modified().map_or(0, ns);
        #[cfg(unix)]
        let identity = {
            use std::os::unix::fs::MetadataExt;
            let changed_ns = metadata.ctime() as u64 * 1_000_000_000 + metadata.ctime_nsec() as u64;
            Some((changed_ns, metadata.ino()))
        };
        #[cfg(not(unix))]
        let identity = None;
        let last_ns = modified_ns.max(identity.map_or(0, |(changed_ns, _): (u64, u64)| changed_ns));
        Self::File {
            bytes: metadata.len(),
            modified_ns,
            identity,
            is_settled: last_ns.saturating_add(RECENT_NS) < ns(SystemTime::now()),
        }
    }
}

/// A folder with these entries.
fn names(paths: &[PathBuf]) -> FileState {
    let mut hasher = xxhash_rust::xxh3::Xxh3Default::new();
    for name in paths.iter().filter_map(|path| path.file_name()) {
        hasher.update(name.as_encoded_bytes());
        hasher.update(b"/");
    }
    FileState::Folder(format!("h{:032x}", hasher.digest128()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One test at a time may enter a log.
    static ALONE: Mutex<()> = Mutex::new(());

    fn temporary(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("svl-inputs-{}-{name}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).unwrap();
        folder
    }

    fn settled(mut stamp: FileStamp) -> FileStamp {
        if let FileState::File { is_settled, .. } = &mut stamp.state {
            *is_settled = true;
        }
        stamp
    }

    #[test]
    fn whatever_is_opened_listed_or_looked_for_is_noted() {
        let _alone = ALONE.lock();
        let folder = temporary("noted");
        let [a, b, none] = ["a", "b", "none"].map(|name| folder.join(name));
        std::fs::write(&a, "a").unwrap();
        let log = InputLog::default();
        {
            let _entered = log.enter();
            open(&a).unwrap();
            assert!(!is_file(&none));
            assert_eq!(list(&folder).unwrap(), std::slice::from_ref(&a));
        }
        std::fs::write(&b, "b").unwrap();
        open(&b).unwrap();
        let stamps = log.stamps();
        let paths: Vec<_> = stamps.iter().map(FileStamp::path).collect();
        assert_eq!(paths, [&*folder, &*a, &*none]);
        // The folder has one more, and what was looked for comes.
        std::fs::write(&none, "").unwrap();
        let changes: Vec<_> = stamps.iter().map(FileStamp::change).collect();
        use FileChange::{Changed, Recent};
        assert_eq!(changes, [Changed, Recent, Changed]);
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn a_file_in_the_place_of_another_is_changed_though_size_and_time_are_kept() {
        let _alone = ALONE.lock();
        let folder = temporary("kept");
        let [a, b] = ["a", "b"].map(|name| folder.join(name));
        std::fs::write(&a, "first").unwrap();
        let log = InputLog::default();
        let entered = log.enter();
        register(&a);
        drop(entered);
        let stamp = settled(log.stamps().remove(0));
        assert_eq!(stamp.change(), FileChange::Unchanged);
        let time = a.metadata().unwrap().modified().unwrap();
        for (replace, what) in [(true, "another file"), (false, "written in place")] {
            if replace {
                std::fs::write(&b, "other").unwrap();
                File::open(&b).unwrap().set_modified(time).unwrap();
                std::fs::rename(&b, &a).unwrap();
            } else {
                std::fs::write(&a, "third").unwrap();
                File::open(&a).unwrap().set_modified(time).unwrap();
            }
            assert_eq!(stamp.change(), FileChange::Changed, "{what}");
        }
        std::fs::remove_file(&a).unwrap();
        assert_eq!(stamp.change(), FileChange::Gone);
        std::fs::remove_dir_all(folder).unwrap();
    }
}
