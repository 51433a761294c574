//! Pairs on their way to the writer.

use crate::error::Result;
use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// What to do with a pair when the writer is behind and the queue is full.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WhenFull {
    /// Wait for the writer: nothing is fired meanwhile.
    Wait,
    /// Drop the new pair.
    Drop,
}

/// What became of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pushed {
    Taken,
    /// Taken, after waiting for the writer.
    Late,
    /// The queue was full.
    Dropped,
    /// Nobody will read it.
    Abandoned,
}

/// From one question whether to stop to the next.
const ASKING: Duration = Duration::from_millis(50);

/// A queue of bounded length with one end to write and one to read.
pub struct Queue<T> {
    length: usize,
    when_full: WhenFull,
    content: Mutex<Content<T>>,
    changed: Condvar,
}

struct Content<T> {
    items: VecDeque<T>,
    /// How the writing end ended.
    ended: Option<Result<()>>,
    closed: bool,
    abandoned: bool,
}

impl<T> Queue<T> {
    /// At most `length` items, at least one.
    pub fn new(length: usize, when_full: WhenFull) -> Self {
        let content = Content {
            items: VecDeque::new(),
            ended: None,
            closed: false,
            abandoned: false,
        };
        Self {
            length: length.max(1),
            when_full,
            content: Mutex::new(content),
            changed: Condvar::new(),
        }
    }

    pub fn push(&self, item: T) -> Pushed {
        let mut content = self.lock();
        let mut pushed = Pushed::Taken;
        while content.items.len() >= self.length && !content.abandoned {
            if self.when_full == WhenFull::Drop {
                return Pushed::Dropped;
            }
            pushed = Pushed::Late;
            content = self
                .changed
                .wait(content)
                .unwrap_or_else(PoisonError::into_inner);
        }
        if content.abandoned {
            return Pushed::Abandoned;
        }
        content.items.push_back(item);
        self.changed.notify_all();
        pushed
    }

    /// No more items come, and why.
    pub fn close(&self, ended: Result<()>) {
        let mut content = self.lock();
        (content.ended, content.closed) = (Some(ended), true);
        self.changed.notify_all();
    }

    /// The next item, waiting for it. After the last one nothing, and when `stopped`, which is
    /// asked again and again.
    ///
    /// # Errors
    /// What ended the writing end, once, after the last item.
    pub fn pop_unless(&self, stopped: impl Fn() -> bool) -> Result<Option<T>> {
        let mut content = self.lock();
        loop {
            if let Some(item) = content.items.pop_front() {
                self.changed.notify_all();
                return Ok(Some(item));
            }
            if content.closed {
                return content.ended.take().unwrap_or(Ok(())).map(|()| None);
            }
            if stopped() {
                return Ok(None);
            }
            content = self
                .changed
                .wait_timeout(content, ASKING)
                .unwrap_or_else(PoisonError::into_inner)
                .0;
        }
    }

    /// As [`Queue::pop_unless`], for ever.
    ///
    /// # Errors
    /// As there.
    pub fn pop(&self) -> Result<Option<T>> {
        self.pop_unless(|| false)
    }

    /// Nothing is read any more. Says how many items were left.
    pub fn abandon(&self) -> usize {
        let mut content = self.lock();
        content.abandoned = true;
        self.changed.notify_all();
        std::mem::take(&mut content.items).len()
    }

    fn lock(&self) -> MutexGuard<'_, Content<T>> {
        self.content.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
