//! The bounded queue between the grabber and the writer.

use parking_lot::{Condvar, Mutex};
use std::collections::VecDeque;
use std::time::Duration;
use svl_core::Result;

/// Action on a pair if the queue is full.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WhenFull {
    /// Backpressure: wait for the writer, and trigger nothing meanwhile.
    Wait,
    /// Drop the new pair.
    Drop,
    /// Drop the oldest pair that waits: the reader needs the newest.
    Replace,
}

/// Result of [`Queue::push`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pushed {
    Taken,
    /// Accepted, after waiting for the writer.
    Late,
    /// The queue was full.
    Dropped,
    /// Accepted in the place of one that waited.
    Replaced,
    /// The reader has stopped.
    Abandoned,
}

/// Interval at which a waiting reader polls `stopped`.
const ASKING: Duration = Duration::from_millis(50);

/// A bounded queue with one writer and one reader.
pub struct Queue<T> {
    length: usize,
    when_full: WhenFull,
    state: Mutex<QueueState<T>>,
    changed: Condvar,
}

struct QueueState<T> {
    items: VecDeque<T>,
    /// Result with which the writer ended.
    ended: Option<Result<()>>,
    closed: bool,
    abandoned: bool,
}

impl<T> Queue<T> {
    /// `length`: limit on items, at least one.
    pub fn new(length: usize, when_full: WhenFull) -> Self {
        let state = QueueState {
            items: VecDeque::new(),
            ended: None,
            closed: false,
            abandoned: false,
        };
        Self {
            // A queue of length 0 would never pass anything on.
            length: length.max(1),
            when_full,
            state: Mutex::new(state),
            changed: Condvar::new(),
        }
    }

    pub fn push(&self, item: T) -> Pushed {
        let mut state = self.state.lock();
        let mut pushed = Pushed::Taken;
        while state.items.len() >= self.length && !state.abandoned {
            match self.when_full {
                WhenFull::Drop => return Pushed::Dropped,
                WhenFull::Replace => {
                    state.items.pop_front();
                    pushed = Pushed::Replaced;
                }
                WhenFull::Wait => {
                    pushed = Pushed::Late;
                    self.changed.wait(&mut state);
                }
            }
        }
        if state.abandoned {
            return Pushed::Abandoned;
        }
        state.items.push_back(item);
        self.changed.notify_all();
        pushed
    }

    /// Ends the writer, with its error if any.
    pub fn close(&self, ended: Result<()>) {
        let mut state = self.state.lock();
        (state.ended, state.closed) = (Some(ended), true);
        self.changed.notify_all();
    }

    /// The next item, after waiting for it. `None` after the last one, and once `stopped` returns
    /// true, which is polled meanwhile.
    ///
    /// # Errors
    /// The error that ended the writer, once, after the last item.
    pub fn pop_unless(&self, stopped: impl Fn() -> bool) -> Result<Option<T>> {
        let mut state = self.state.lock();
        loop {
            // Items from before an error come first: they are valid.
            if let Some(item) = state.items.pop_front() {
                self.changed.notify_all();
                return Ok(Some(item));
            }
            if state.closed {
                return state.ended.take().unwrap_or(Ok(())).map(|()| None);
            }
            if stopped() {
                return Ok(None);
            }
            // Ctrl-C wakes no condition variable, so `stopped` is polled.
            self.changed.wait_for(&mut state, ASKING);
        }
    }

    /// [`Queue::pop_unless`] that waits forever.
    ///
    /// # Errors
    /// The errors of [`Queue::pop_unless`].
    pub fn pop(&self) -> Result<Option<T>> {
        self.pop_unless(|| false)
    }

    /// Ends the reader. Returns the number of items left.
    pub fn abandon(&self) -> usize {
        let mut state = self.state.lock();
        state.abandoned = true;
        self.changed.notify_all();
        std::mem::take(&mut state.items).len()
    }
}
