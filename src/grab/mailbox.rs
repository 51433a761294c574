//! A channel between threads that waits on the grabber's clock.

use super::clock::GrabClock;
use parking_lot::Mutex;
use std::collections::VecDeque;
use std::sync::Arc;

/// An unbounded channel. A scripted clock knows which threads wait on it, which a channel of the
/// standard library could not offer. Its users bound it: a camera gets an order only after its
/// report was read, and delivers few images per order.
pub(super) struct Mailbox<T> {
    clock: Arc<GrabClock>,
    state: Mutex<MailboxState<T>>,
}

struct MailboxState<T> {
    messages: VecDeque<T>,
    closed: bool,
}

/// Result of [`Mailbox::receive`].
#[derive(Debug, PartialEq)]
pub(super) enum Received<T> {
    Message(T),
    /// Nothing arrived in time.
    Nothing,
    /// Nothing more will arrive.
    Closed,
}

impl<T> Mailbox<T> {
    pub(super) fn new(clock: &Arc<GrabClock>) -> Arc<Self> {
        let state = Mutex::new(MailboxState {
            messages: VecDeque::new(),
            closed: false,
        });
        Arc::new(Self {
            clock: clock.clone(),
            state,
        })
    }

    /// Sends, unless it is closed.
    pub(super) fn send(&self, message: T) {
        let mut state = self.state.lock();
        if !state.closed {
            state.messages.push_back(message);
        }
        // Unlocked before the clock wakes the receiver, whose condition takes this lock.
        drop(state);
        self.clock.notify();
    }

    /// Ends the channel. Waiting messages are no longer received, only drained.
    pub(super) fn close(&self) {
        self.state.lock().closed = true;
        self.clock.notify();
    }

    /// The next message, after waiting for it until that time.
    pub(super) fn receive(&self, until_ns: u64) -> Received<T> {
        let look = || {
            let mut state = self.state.lock();
            // Closed takes precedence over waiting messages: a camera that is to end must not start
            // another image.
            if state.closed {
                return Some(Received::Closed);
            }
            state.messages.pop_front().map(Received::Message)
        };
        self.clock
            .wait_until(until_ns, look)
            .unwrap_or(Received::Nothing)
    }

    /// The messages left in a closed mailbox.
    pub(super) fn drain(&self) -> VecDeque<T> {
        std::mem::take(&mut self.state.lock().messages)
    }
}
