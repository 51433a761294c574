//! Brings a file to the disk about once a second, also while nothing new comes.

use super::append::Append;
use crate::error::Result;
use std::io;
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

/// How much of a recording a crash may cost.
const SYNC_PERIOD: Duration = Duration::from_secs(1);

/// A file that a thread of its own syncs. Dropping it ends the thread, then finishes the file.
pub(super) struct Steady {
    shared: Arc<Mutex<Shared>>,
    /// Its end is the thread's.
    life: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

struct Shared {
    file: Append,
    /// What the thread's last sync came to.
    synced: Result<()>,
}

impl Steady {
    /// # Errors
    /// When the machine has no room for a thread.
    pub(super) fn new(file: Append) -> io::Result<Self> {
        let shared = Arc::new(Mutex::new(Shared {
            file,
            synced: Ok(()),
        }));
        let (life, ended) = mpsc::channel();
        let threads = Arc::clone(&shared);
        let keep = move || {
            while let Err(RecvTimeoutError::Timeout) = ended.recv_timeout(SYNC_PERIOD) {
                let mut shared = threads.lock().unwrap_or_else(PoisonError::into_inner);
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

    /// Does something with the file.
    ///
    /// # Errors
    /// As `act`; what the thread failed with, once.
    pub(super) fn with<T>(&self, act: impl FnOnce(&mut Append) -> Result<T>) -> Result<T> {
        let mut shared = self.shared.lock().unwrap_or_else(PoisonError::into_inner);
        std::mem::replace(&mut shared.synced, Ok(()))?;
        act(&mut shared.file)
    }
}

impl Drop for Steady {
    fn drop(&mut self) {
        drop(self.life.take());
        // It does not panic; if it did, the file would be finished all the same.
        self.thread.take().map(JoinHandle::join);
    }
}
