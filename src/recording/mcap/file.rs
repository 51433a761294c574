//! One MCAP file of a recording, opened once and read at several positions.

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use svl_core::bounded::stand_in;
use svl_core::{Error, Result, inputs};

/// Length of the longest magic, SQLite's.
const START: u64 = 16;

/// An open file. Clones share its handle.
#[derive(Clone)]
pub(crate) struct McapFile {
    path: PathBuf,
    /// Bytes in the file when it was opened.
    len: u64,
    /// Not kept if a recording has more files than a process may hold open.
    handle: Option<Arc<File>>,
}

impl McapFile {
    /// Opens a file, and keeps it open if `keep` is true; otherwise each reader reopens it.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] for anything but a regular file and for an empty one.
    pub(crate) fn open(path: &Path, keep: bool) -> Result<Self> {
        let io = |e| Error::io(path, e);
        // Before opening: opening a pipe would wait for its writer, and Linux opens folders.
        let metadata = std::fs::metadata(path).map_err(io)?;
        if metadata.is_dir() {
            return Err(Error::format(path, "is a folder, not a recording"));
        }
        if !metadata.is_file() {
            // Summary and index are read from the end of the file.
            let reason = "is a pipe or a device, not a file; copy it into a file first";
            return Err(Error::format(path, reason));
        }
        let file = Self::from_handle(path, inputs::open(path).map_err(io)?)?;
        Ok(Self {
            // Beyond the limit a handle per file would hit the process's limit of open files.
            handle: file.handle.filter(|_| keep),
            ..file
        })
    }

    /// A regular file that is already open and named `path`.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] for an empty file.
    pub(crate) fn from_handle(path: &Path, handle: File) -> Result<Self> {
        let len = handle.metadata().map_err(|e| Error::io(path, e))?.len();
        if len == 0 {
            let reason = "is empty: nothing was recorded, or not yet";
            return Err(Error::format(path, reason));
        }
        Ok(Self {
            path: path.to_owned(),
            len,
            handle: Some(Arc::new(handle)),
        })
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    pub(crate) fn len(&self) -> u64 {
        self.len
    }

    /// The first bytes, by which the format is known.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn start(&self) -> Result<Vec<u8>> {
        let mut start = Vec::new();
        let read = self.reader()?.take(START).read_to_end(&mut start);
        read.map(|_| start).map_err(|e| Error::io(&self.path, e))
    }

    /// A reader with a position of its own, at the start of the file.
    ///
    /// # Errors
    /// [`Error::Io`] if the handle was not kept.
    pub(crate) fn reader(&self) -> Result<FileReader> {
        let file = match &self.handle {
            Some(handle) => Arc::clone(handle),
            None => Arc::new(inputs::open(&self.path).map_err(|e| Error::io(&self.path, e))?),
        };
        Ok(FileReader { file, at: 0 })
    }
}

/// Reads a file at its own position.
pub(crate) struct FileReader {
    file: Arc<File>,
    at: u64,
}

impl FileReader {
    /// Goes on reading at `at`.
    pub(crate) fn seek(&mut self, at: u64) {
        self.at = at;
    }

    /// Reads bytes, which must be in the file, in place of those in `to`.
    pub(crate) fn read_at(&mut self, at: u64, bytes: u64, to: &mut Vec<u8>) -> io::Result<()> {
        // Zeroed by the system, and only if there is too little.
        if to.len() < bytes as usize {
            *to = vec![0; bytes as usize];
        }
        to.truncate(bytes as usize);
        self.at = at;
        self.read_exact(to)
    }
}

impl Read for FileReader {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        // Positioned reads: the readers of one file share its handle, and so would share a cursor.
        #[cfg(unix)]
        let read = std::os::unix::fs::FileExt::read_at(&*self.file, bytes, self.at)?;
        #[cfg(windows)]
        let read = std::os::windows::fs::FileExt::seek_read(&*self.file, bytes, self.at)?;
        self.at += read as u64;
        Ok(read)
    }
}

/// Description of a file that begins with `start` and is not MCAP, with the remedy.
pub(crate) fn not_mcap(path: &Path, start: &[u8]) -> String {
    if let Some(why) = stand_in(start) {
        return why.to_owned();
    }
    // `#ROSBAG V2.0` is read.
    if start.starts_with(b"#ROSBAG ") {
        let bag = path.display();
        return format!(
            "is a ROS 1 bag of another format than 2.0; `rosbag fix {bag} NEW.bag` of ROS 1 \
             renews it"
        );
    }
    "is not an MCAP file, nor a bag of ROS 2 in SQLite or of ROS 1; svl reads these (.mcap, .db3, \
     .bag)"
        .to_owned()
}
