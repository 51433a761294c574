//! One file of a recording: MCAP, SQLite or a ROS 1 bag, plain or compressed as a whole.

use super::ros1_bag::Ros1Messages;
use super::sqlite::SqliteFile;
use super::{ros1_bag, sqlite};
use crate::mcap::file::McapFile;
use crate::mcap::messages::Messages;
use crate::stream::channel::{EventReader, FileEvent};
use crate::stream::unpack::{ZSTD, unpack, unpack_message};
use std::borrow::Cow;
use std::path::Path;
use svl_core::{Error, Result};

/// One file of a recording.
pub(crate) enum Container {
    Mcap(McapFile),
    Sqlite(SqliteFile),
    Ros1(McapFile),
}

/// True if the file at `path` begins as one of a recording does, whatever its name.
pub fn is_recording(path: &Path) -> bool {
    let start = McapFile::open(path, true).and_then(|file| file.start());
    start.is_ok_and(|start| {
        let magics = [mcap::MAGIC, &ZSTD, ros1_bag::MAGIC];
        start == sqlite::MAGIC || magics.iter().any(|magic| start.starts_with(magic))
    })
}

impl Container {
    /// Opens a file by its first bytes. One that is compressed as a whole is unpacked into a
    /// temporary file.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] for a folder, an empty file, and one that cannot be
    /// unpacked.
    pub(crate) fn open(path: &Path, keep: bool) -> Result<Self> {
        let file = McapFile::open(path, keep)?;
        if let Some(cure) = closed_format(path) {
            return Err(Error::format(path, cure));
        }
        let start = file.start()?;
        if !start.starts_with(&ZSTD) {
            return Ok(if start == sqlite::MAGIC {
                Self::Sqlite(SqliteFile::new(path, file.len(), None))
            } else if start.starts_with(ros1_bag::MAGIC) {
                Self::Ros1(file)
            } else {
                Self::Mcap(file)
            });
        }
        let unpacked = unpack(&file)?;
        let io = |e| Error::io(path, e);
        let handle = unpacked.reopen().map_err(io)?;
        let inside = McapFile::from_handle(path, handle)?;
        Ok(if inside.start()? == sqlite::MAGIC {
            let (len, file) = (inside.len(), unpacked.into_temp_path());
            Self::Sqlite(SqliteFile::new(path, len, Some(file)))
        } else {
            // The handle keeps the unpacked data alive, even after its name is removed.
            Self::Mcap(inside)
        })
    }

    /// Bytes in the file.
    pub(crate) fn len(&self) -> u64 {
        match self {
            Self::Mcap(file) | Self::Ros1(file) => file.len(),
            Self::Sqlite(file) => file.len(),
        }
    }

    pub(crate) fn path(&self) -> &Path {
        match self {
            Self::Mcap(file) | Self::Ros1(file) => file.path(),
            Self::Sqlite(file) => file.path(),
        }
    }

    /// Messages from the start, unpacked if they were compressed on their own.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] for a file that is neither MCAP nor a bag.
    pub(crate) fn messages(&self) -> Result<Box<dyn EventReader>> {
        Ok(match self {
            Self::Mcap(file) => Box::new(UnpackedMessages(Messages::open(file)?)),
            Self::Sqlite(file) => Box::new(UnpackedMessages(file.messages()?)),
            Self::Ros1(file) => Box::new(Ros1Messages::open(file)?),
        })
    }
}

/// Unpacks messages that rosbag2 compressed on their own. One that cannot be unpacked stays as it
/// is: its reader reports why.
pub(crate) struct UnpackedMessages<R>(pub(crate) R);

impl<R: EventReader> EventReader for UnpackedMessages<R> {
    fn next(&mut self) -> Result<Option<FileEvent<'_>>> {
        let mut event = self.0.next()?;
        if let Some(FileEvent::Message(_, _, data)) = &mut event
            && let Ok(Some(unpacked)) = unpack_message(data)
        {
            *data = Cow::Owned(unpacked);
        }
        Ok(event)
    }
}

/// Name of a recording that only its vendor's programs read, with the command that exports it.
fn closed_format(path: &Path) -> Option<&'static str> {
    match path.extension()?.to_str()? {
        "svo" | "svo2" => Some(
            "is a recording of ZED's SDK, which alone reads it: its `ZED_SVO_Export FILE FOLDER/ \
             2` writes left and right images, which `svl record FOLDER` reads; or record its ROS 2 \
             topics, `ros2 bag record`",
        ),
        "tar" | "gz" => Some(
            "is an archive; of an OAK's holistic recording, unpack it, `tar xf FILE -C FOLDER`, \
             and name the videos of its two cameras: `svl record FOLDER --left LEFT.mp4 --right \
             RIGHT.mp4`",
        ),
        _ => None,
    }
}
