//! Messages from thread to thread, waited for in the grabber's time.

use super::clock::Clock;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A channel whose ends are the same thing, and whose waiting a scripted clock knows of. What is
/// sent is bounded by its users: a camera gets an order only after its answer was read, and gives
/// few images for one.
pub(super) struct Mailbox<T> {
    clock: Arc<Clock>,
    content: Mutex<Content<T>>,
}

struct Content<T> {
    messages: VecDeque<T>,
    closed: bool,
}

/// What [`Mailbox::receive`] found.
#[derive(Debug, PartialEq)]
pub(super) enum Received<T> {
    Message(T),
    /// Nothing came in time.
    Nothing,
    /// Nothing will come.
    Closed,
}

impl<T> Mailbox<T> {
    pub(super) fn new(clock: &Arc<Clock>) -> Arc<Self> {
        let content = Mutex::new(Content {
            messages: VecDeque::new(),
            closed: false,
        });
        Arc::new(Self {
            clock: clock.clone(),
            content,
        })
    }

    /// Sends, unless it is closed.
    pub(super) fn send(&self, message: T) {
        let mut content = self.lock();
        if !content.closed {
            content.messages.push_back(message);
        }
        drop(content);
        self.clock.notify();
    }

    /// Nothing is received after this, not even what was sent before: see [`Mailbox::drain`].
    pub(super) fn close(&self) {
        self.lock().closed = true;
        self.clock.notify();
    }

    /// The next message, waiting for it until then.
    pub(super) fn receive(&self, until_ns: u64) -> Received<T> {
        let look = || {
            let mut content = self.lock();
            if content.closed {
                return Some(Received::Closed);
            }
            content.messages.pop_front().map(Received::Message)
        };
        self.clock
            .wait_until(until_ns, look)
            .unwrap_or(Received::Nothing)
    }

    /// What was sent and not received, of a closed mailbox.
    pub(super) fn drain(&self) -> VecDeque<T> {
        std::mem::take(&mut self.lock().messages)
    }

    fn lock(&self) -> MutexGuard<'_, Content<T>> {
        self.content.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
