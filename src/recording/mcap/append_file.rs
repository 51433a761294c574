//! An append-only MCAP file: every prefix of complete chunks is valid.

use mcap::records::{AttachmentHeader, MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{Compression, McapError, McapResult, WriteOptions};
use parking_lot::Mutex;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use svl_core::{Error, Result};

/// Chunks close once they exceed this: two pairs of 320x240 with truth.
const CHUNK_BYTES: u64 = 1 << 20;

/// A file to which only complete chunks are appended, without seeking back. Dropping it finishes
/// the file and discards errors; call [`AppendFile::finish`] to see them.
pub(crate) struct AppendFile {
    path: PathBuf,
    file: File,
    /// mcap writes into memory, where it cannot fail: its writer panics when it is dropped after
    /// some failures.
    mcap: mcap::Writer<NoSeek<Memory>>,
    memory: Memory,
    /// Bytes in the file.
    written: u64,
    /// True if bytes were written since the last fsync.
    unsynced: bool,
    open: bool,
}

/// A schema: its name, the encoding of its definition, and the definition.
pub(crate) type SchemaParts<'a> = (&'a str, &'a str, &'a [u8]);

impl AppendFile {
    /// # Errors
    /// [`Error::Io`] if the file exists already or cannot be created.
    pub(crate) fn create(path: PathBuf, profile: &str, library: &str) -> Result<Self> {
        let file = File::create_new(&path).map_err(|e| match e.kind() {
            io::ErrorKind::AlreadyExists => {
                let cure = "exists already, and a recording is never overwritten: remove it or \
                            choose another name";
                Error::io(&path, io::Error::new(e.kind(), cure))
            }
            _ => Error::io(&path, e),
        })?;
        // Another svl that tries to replace the file detects that it is being written. On systems
        // without file locks there is no such guard.
        let _ = file.try_lock();
        let memory = Memory::default();
        let mcap = WriteOptions::new()
            .profile(profile)
            .library(library)
            // Pairs of the arena with truth (539 kB) compress to 390 kB at level 1, 465 with lz4,
            // and 378 at level 3 at half the speed.
            .compression(Some(Compression::Zstd))
            .compression_level(1)
            // mcap would use all CPUs, which the cameras and matchers need.
            .compression_threads(0)
            .chunk_size(Some(CHUNK_BYTES))
            .disable_seeking(true)
            .create(NoSeek::new(memory.clone()))
            .map_err(|e| refused(&path, e))?;
        Ok(Self {
            path,
            file,
            mcap,
            memory,
            written: 0,
            unsynced: true,
            open: true,
        })
    }

    /// Declares a topic and returns the id of its channel, the same for the same topic. A topic may
    /// have no schema.
    pub(crate) fn channel(
        &mut self,
        topic: &str,
        schema: Option<SchemaParts<'_>>,
        encoding: &str,
        metadata: &BTreeMap<String, String>,
    ) -> Result<u16> {
        self.check_open()?;
        // MCAP's number for "no schema".
        let schema = schema.map_or(Ok(0), |(name, encoding, data)| {
            self.mcap.add_schema(name, encoding, data)
        });
        let channel =
            schema.and_then(|schema| self.mcap.add_channel(schema, topic, encoding, metadata));
        channel.map_err(|e| refused(&self.path, e))
    }

    pub(crate) fn message(&mut self, header: &MessageHeader, data: &[u8]) -> Result<()> {
        self.write(|mcap| mcap.write_to_known_channel(header, data))
    }

    pub(crate) fn begin_attachment(&mut self, bytes: u64, header: AttachmentHeader) -> Result<()> {
        self.write(|mcap| mcap.start_attachment(bytes, header))
    }

    pub(crate) fn attachment_piece(&mut self, piece: &[u8]) -> Result<()> {
        self.write(|mcap| mcap.put_attachment_bytes(piece))
    }

    pub(crate) fn finish_attachment(&mut self) -> Result<()> {
        self.write(mcap::Writer::finish_attachment)
    }

    pub(crate) fn metadata(&mut self, metadata: &Metadata) -> Result<()> {
        self.write(|mcap| mcap.write_metadata(metadata))
    }

    /// Closes the chunk and syncs the file (fsync), if anything was written since the last sync. A
    /// finished file is already synced.
    ///
    /// # Errors
    /// [`Error::Io`], also if the file has disappeared from its folder.
    pub(crate) fn sync(&mut self) -> Result<()> {
        if !self.open {
            return Ok(());
        }
        if self.unsynced {
            self.write(mcap::Writer::flush)?;
            self.file.sync_data().map_err(|e| self.failed(e))?;
            self.unsynced = false;
        }
        // Writes to a file whose folder was removed succeed, and the bytes are lost.
        self.path.metadata().map_err(|e| self.failed(e))?;
        Ok(())
    }

    /// Completes the file. A second call does nothing.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn finish(&mut self) -> Result<()> {
        if self.open {
            self.write(|mcap| mcap.finish().map(drop))?;
            self.open = false;
            self.file.sync_all().map_err(|e| Error::io(&self.path, e))?;
            self.path.metadata().map_err(|e| Error::io(&self.path, e))?;
        }
        Ok(())
    }

    /// Performs an operation of mcap, and appends the bytes it wrote to the file.
    fn write(
        &mut self,
        act: impl FnOnce(&mut mcap::Writer<NoSeek<Memory>>) -> McapResult<()>,
    ) -> Result<()> {
        self.check_open()?;
        self.unsynced = true;
        act(&mut self.mcap).map_err(|e| refused(&self.path, e))?;
        // Empty until mcap closes a chunk.
        let bytes = self.memory.take();
        self.file.write_all(&bytes).map_err(|e| self.failed(e))?;
        self.written += bytes.len() as u64;
        Ok(())
    }

    /// mcap panics on a write to a finished file.
    fn check_open(&self) -> Result<()> {
        let closed = || {
            Error::format(
                &self.path,
                "accepts no more pairs: it is finished, or writing to it failed",
            )
        };
        self.open.then_some(()).ok_or_else(closed)
    }

    /// Closes the file after an error; it keeps its valid prefix.
    fn failed(&mut self, error: io::Error) -> Error {
        self.open = false;
        // Half a chunk may have been written. If it cannot be cut off, readers stop before it.
        let _ = self.file.set_len(self.written);
        Error::io(&self.path, error)
    }
}

impl Drop for AppendFile {
    fn drop(&mut self) {
        let _ = self.finish();
    }
}

/// The error of mcap, which writes to memory: more topics than a file can contain.
fn refused(path: &Path, error: McapError) -> Error {
    Error::format(path, error.to_string())
}

/// Bytes on their way from mcap to the file.
#[derive(Clone, Default)]
struct Memory(Arc<Mutex<Vec<u8>>>);

impl Memory {
    fn take(&self) -> Vec<u8> {
        std::mem::take(&mut self.0.lock())
    }
}

impl io::Write for Memory {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
