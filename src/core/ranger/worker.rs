//! The thread of a ranger: a job that waits for pairs inside the ranger's pool.
//!
//! A call into a pool from outside allocates in its queue now and then. A job that never leaves the
//! pool does not, and every matcher sees the pool's number of threads.

use super::engine::Engine;
use crate::error::{Error, Result};
use parking_lot::{Condvar, Mutex, MutexGuard};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Duration;

/// How often a caller is asked if it still waits.
const ASKED_EVERY: Duration = Duration::from_millis(50);

/// Is asked if its caller still waits; without one, it does.
pub(super) type Patience<'a, 'b> = Option<&'a mut (dyn FnMut() -> bool + 'b)>;

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
    /// A closed one stays closed: its caller may have gone while a pair was matched.
    fn put(&self, content: JobSlot) {
        let mut slot = self.slot.lock();
        if !matches!(*slot, JobSlot::Closed) {
            *slot = content;
        }
        self.changed.notify_all();
    }

    /// Waits until the content is one of `wanted`, and takes it; `None` once `is_waiting` is false.
    fn take(
        &self,
        wanted: fn(&JobSlot) -> bool,
        mut is_waiting: Patience<'_, '_>,
    ) -> Option<JobSlot> {
        let mut slot = self.slot.lock();
        while !wanted(&slot) {
            let Some(is_waiting) = &mut is_waiting else {
                self.changed.wait(&mut slot);
                continue;
            };
            let is_late = self.changed.wait_for(&mut slot, ASKED_EVERY).timed_out();
            if is_late && !wanted(&slot) && !MutexGuard::unlocked(&mut slot, is_waiting) {
                return None;
            }
        }
        Some(std::mem::replace(&mut *slot, JobSlot::Empty))
    }

    fn serve(&self) {
        let is_mine = |slot: &JobSlot| matches!(slot, JobSlot::Loaded(_) | JobSlot::Closed);
        while let Some(JobSlot::Loaded(mut engine)) = self.take(is_mine, None) {
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

    /// Begins to match the pair of an engine.
    pub(super) fn begin(&self, engine: Box<Engine>) {
        self.job.put(JobSlot::Loaded(engine));
    }

    /// The engine, once its pair is matched.
    ///
    /// # Errors
    /// [`Error::Panicked`]; [`Error::Interrupted`] once `is_waiting` is false: the work goes on,
    /// and the engine may be asked for again.
    pub(super) fn end(&self, is_waiting: Patience<'_, '_>) -> Result<(Box<Engine>, Result<()>)> {
        let is_mine = |slot: &JobSlot| matches!(slot, JobSlot::Done(..) | JobSlot::Panicked);
        match self.job.take(is_mine, is_waiting) {
            Some(JobSlot::Done(engine, result)) => Ok((engine, result)),
            Some(_) => Err(Error::Panicked),
            None => Err(Error::Interrupted),
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
