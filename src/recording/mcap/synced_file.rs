//! Syncs a file (fsync) about once a second, on a separate thread.

use super::append_file::AppendFile;
use parking_lot::Mutex;
use std::io;
use std::sync::Arc;
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::thread::{self, JoinHandle};
use std::time::Duration;
use svl_core::Result;

/// Length of a recording that a crash may lose.
const SYNC_PERIOD: Duration = Duration::from_secs(1);

/// A file synced by a background thread. Dropping it ends the thread, then finishes the file.
pub(crate) struct SyncedFile {
    shared: Arc<Mutex<Shared>>,
    /// Dropping it ends the thread.
    life: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

struct Shared {
    file: AppendFile,
    /// Outcome of the thread's last sync.
    synced: Result<()>,
}

impl SyncedFile {
    /// # Errors
    /// If no thread can be started.
    pub(crate) fn new(file: AppendFile) -> io::Result<Self> {
        let shared = Arc::new(Mutex::new(Shared {
            file,
            synced: Ok(()),
        }));
        let (life, ended) = mpsc::channel();
        let threads = Arc::clone(&shared);
        let keep = move || {
            // The timeout is the period; a closed channel ends the loop at once.
            while let Err(RecvTimeoutError::Timeout) = ended.recv_timeout(SYNC_PERIOD) {
                let mut shared = threads.lock();
                // After an error the file is closed; the writer receives the error on its next
                // call.
                if shared.synced.is_ok() {
                    shared.synced = shared.file.sync();
                }
            }
        };
        let thread = thread::Builder::new().spawn(keep)?;
        Ok(Self {
            shared,
            life: Some(life),
            thread: Some(thread),
        })
    }

    /// Locks the file for `act`.
    ///
    /// # Errors
    /// The errors of `act`; the error of the thread's last sync, once.
    pub(crate) fn with<T>(&self, act: impl FnOnce(&mut AppendFile) -> Result<T>) -> Result<T> {
        let mut shared = self.shared.lock();
        std::mem::replace(&mut shared.synced, Ok(()))?;
        act(&mut shared.file)
    }
}

impl Drop for SyncedFile {
    fn drop(&mut self) {
        drop(self.life.take());
        // The thread does not panic; if it did, the file would still be finished.
        self.thread.take().map(JoinHandle::join);
    }
}
