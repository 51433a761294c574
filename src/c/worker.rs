//! The thread of a handle: a job that waits for pairs inside the handle's pool.
//!
//! A call into a pool from outside allocates in its queue now and then. A job that never leaves the
//! pool does not, and every matcher sees the pool's number of threads.

use crate::engine::{Engine, Image};
use crate::errors::Failure;
use parking_lot::{Condvar, Mutex};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use svl_core::Error;

enum JobState {
    /// Waits for a pair.
    Idle,
    /// The engine holds a pair that is to be matched.
    Loaded,
    /// The pair was matched, or the error.
    Done(Result<(), Failure>),
    /// A panic: the engine is not used again.
    Broken,
    Closed,
}

struct JobSlot {
    state: Mutex<(JobState, Engine)>,
    changed: Condvar,
}

impl JobSlot {
    fn serve(&self) {
        let mut guard = self.state.lock();
        loop {
            match guard.0 {
                JobState::Loaded => {
                    let engine = &mut guard.1;
                    let result = catch_unwind(AssertUnwindSafe(|| engine.compute()));
                    guard.0 = result.map_or(JobState::Broken, |done| {
                        JobState::Done(done.map_err(Failure::from))
                    });
                    self.changed.notify_all();
                }
                JobState::Closed => return,
                JobState::Idle | JobState::Done(_) | JobState::Broken => {
                    self.changed.wait(&mut guard)
                }
            }
        }
    }
}

pub struct PairWorker {
    shared: Arc<JobSlot>,
    /// Ends its threads when dropped, after the job has left it.
    _pool: rayon::ThreadPool,
}

impl PairWorker {
    /// A worker with that many threads; 0 is one per core.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the threads cannot be started.
    pub fn start(engine: Engine, threads: usize) -> Result<Self, Error> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(|i| format!("svl-{i}"))
            .build()
            .map_err(|e| Error::Invalid(format!("threads cannot be started: {e}")))?;
        let shared = Arc::new(JobSlot {
            state: Mutex::new((JobState::Idle, engine)),
            changed: Condvar::new(),
        });
        let slot = Arc::clone(&shared);
        pool.spawn(move || slot.serve());
        Ok(Self {
            shared,
            _pool: pool,
        })
    }

    /// Matches a pair and waits for it.
    pub fn run(&self, left: Image, right: Image, stamp_ns: Option<u64>) -> Result<(), Failure> {
        let mut guard = self.shared.state.lock();
        if matches!(guard.0, JobState::Broken) {
            return Err(Failure::internal());
        }
        guard.1.load(left, right, stamp_ns)?;
        guard.0 = JobState::Loaded;
        self.shared.changed.notify_all();
        loop {
            self.shared.changed.wait(&mut guard);
            match std::mem::replace(&mut guard.0, JobState::Idle) {
                JobState::Done(result) => return result,
                JobState::Broken => {
                    guard.0 = JobState::Broken;
                    return Err(Failure::internal());
                }
                other => guard.0 = other,
            }
        }
    }

    /// Forgets the earlier pairs.
    pub fn reset(&self) -> Result<(), Failure> {
        let mut guard = self.shared.state.lock();
        if matches!(guard.0, JobState::Broken) {
            return Err(Failure::internal());
        }
        guard.1.reset();
        Ok(())
    }

    /// Reads the last result.
    pub fn result(&self, read: impl FnOnce(&Engine)) -> Result<(), Failure> {
        let guard = self.shared.state.lock();
        if matches!(guard.0, JobState::Broken) {
            return Err(Failure::internal());
        }
        if !guard.1.has_result() {
            return Err(Failure::no_result());
        }
        read(&guard.1);
        Ok(())
    }
}

impl Drop for PairWorker {
    fn drop(&mut self) {
        self.shared.state.lock().0 = JobState::Closed;
        self.shared.changed.notify_all();
    }
}
