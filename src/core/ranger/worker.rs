//! The thread of a ranger: a job that waits for pairs inside the ranger's pool.
//!
//! A call into a pool from outside allocates in its queue now and then. A job that never leaves the
//! pool does not, and every matcher sees the pool's number of threads.

use super::engine::Engine;
use crate::error::{Error, Result};
use parking_lot::{Condvar, Mutex};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

/// What lies between the ranger and its job. Boxed: an engine is handed over without a copy.
enum JobSlot {
    Empty,
    /// An engine with a pair that is to be matched.
    Loaded(Box<Engine>),
    Done(Box<Engine>, Result<()>),
    /// A panic: there is no engine any more.
    Panicked,
    Closed,
}

struct PairJob {
    slot: Mutex<JobSlot>,
    changed: Condvar,
}

impl PairJob {
    fn put(&self, content: JobSlot) {
        *self.slot.lock() = content;
        self.changed.notify_all();
    }

    /// Waits until the content is one of `wanted`, and takes it.
    fn take(&self, wanted: fn(&JobSlot) -> bool) -> JobSlot {
        let mut slot = self.slot.lock();
        self.changed.wait_while(&mut slot, |slot| !wanted(slot));
        std::mem::replace(&mut *slot, JobSlot::Empty)
    }

    fn serve(&self) {
        let is_mine = |slot: &JobSlot| matches!(slot, JobSlot::Loaded(_) | JobSlot::Closed);
        while let JobSlot::Loaded(mut engine) = self.take(is_mine) {
            let result = catch_unwind(AssertUnwindSafe(|| engine.compute()));
            self.put(match result {
                Ok(result) => JobSlot::Done(engine, result),
                Err(_) => JobSlot::Panicked,
            });
        }
    }
}

pub(super) struct PairWorker {
    job: Arc<PairJob>,
    /// Ends its threads when dropped, after the job has left it.
    pool: Option<rayon::ThreadPool>,
    /// The process whose threads these are.
    process: u32,
}

impl PairWorker {
    /// A worker with that many threads; 0 is one per core.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the threads cannot be started.
    pub(super) fn start(threads: usize) -> Result<Self> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(|i| format!("svl-{i}"))
            .build()
            .map_err(|e| Error::Invalid(format!("threads cannot be started: {e}")))?;
        let job = Arc::new(PairJob {
            slot: Mutex::new(JobSlot::Empty),
            changed: Condvar::new(),
        });
        let served = Arc::clone(&job);
        pool.spawn(move || served.serve());
        Ok(Self {
            job,
            pool: Some(pool),
            process: std::process::id(),
        })
    }

    /// True in a process that a fork made, which has no threads of this pool.
    pub(super) fn is_forked(&self) -> bool {
        self.process != std::process::id()
    }

    /// Matches the pair of an engine, and returns the engine; `None` after a panic.
    pub(super) fn run(&self, engine: Box<Engine>) -> Option<(Box<Engine>, Result<()>)> {
        self.job.put(JobSlot::Loaded(engine));
        let is_mine = |slot: &JobSlot| matches!(slot, JobSlot::Done(..) | JobSlot::Panicked);
        match self.job.take(is_mine) {
            JobSlot::Done(engine, result) => Some((engine, result)),
            _ => None,
        }
    }
}

impl Drop for PairWorker {
    fn drop(&mut self) {
        if self.is_forked() {
            // Locks that were held at the fork never open.
            std::mem::forget(self.pool.take());
        } else {
            self.job.put(JobSlot::Closed);
        }
    }
}
