//! The grabber's clock: real time, or a scripted one that makes every run identical.

use parking_lot::{Condvar, Mutex};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// A clock on which threads wait for a time or for each other.
///
/// A scripted clock stands still while one of its participants is busy, and jumps to the earliest
/// deadline once all wait. So tests of threads that sleep take no time and cannot fail on a slow
/// machine.
pub struct GrabClock {
    time: TimeSource,
    state: Mutex<ClockState>,
    changed: Condvar,
}

enum TimeSource {
    Real { began: Instant, epoch_ns: u64 },
    Scripted(AtomicU64),
}

#[derive(Default)]
struct ClockState {
    participants: usize,
    next_id: u64,
    waiting: Vec<Waiter>,
}

struct Waiter {
    id: u64,
    until_ns: u64,
    /// True if it has checked its condition since the last change.
    settled: bool,
}

/// A thread that a scripted clock waits for, until this is dropped. It is entered before the thread
/// starts.
pub struct Participant(Arc<GrabClock>);

impl GrabClock {
    /// Nanoseconds since 1970, monotonic.
    pub fn real() -> Arc<Self> {
        let since_epoch = SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .unwrap_or_default();
        let epoch_ns = since_epoch.as_nanos() as u64;
        // The system's clock is read once: if it is stepped during a recording, stamps must not
        // jump.
        Self::with(TimeSource::Real {
            began: Instant::now(),
            epoch_ns,
        })
    }

    /// A scripted clock that starts at 0.
    pub fn scripted() -> Arc<Self> {
        Self::with(TimeSource::Scripted(AtomicU64::new(0)))
    }

    fn with(time: TimeSource) -> Arc<Self> {
        Arc::new(Self {
            time,
            state: Mutex::default(),
            changed: Condvar::new(),
        })
    }

    pub fn now_ns(&self) -> u64 {
        match &self.time {
            TimeSource::Real { began, epoch_ns } => epoch_ns + began.elapsed().as_nanos() as u64,
            TimeSource::Scripted(now_ns) => now_ns.load(Ordering::Acquire),
        }
    }

    /// Waits until `ready` returns a value, and returns that; `None` at the deadline. `ready` is
    /// called again after every [`GrabClock::notify`]. On a scripted clock only participants may
    /// wait.
    pub fn wait_until<T>(&self, until_ns: u64, mut ready: impl FnMut() -> Option<T>) -> Option<T> {
        let mut state = self.state.lock();
        let id = state.next_id;
        state.next_id += 1;
        state.waiting.push(Waiter {
            id,
            until_ns,
            settled: false,
        });
        let found = loop {
            let found = ready();
            let now_ns = self.now_ns();
            if found.is_some() || now_ns >= until_ns {
                break found;
            }
            match &self.time {
                TimeSource::Real { .. } => {
                    let left = Duration::from_nanos(until_ns - now_ns);
                    self.changed.wait_for(&mut state, left);
                }
                TimeSource::Scripted(time) => {
                    state
                        .waiting
                        .iter_mut()
                        .filter(|w| w.id == id)
                        .for_each(|w| w.settled = true);
                    if !self.advance(&mut state, time) {
                        self.changed.wait(&mut state);
                    }
                }
            }
        };
        state.waiting.retain(|w| w.id != id);
        found
    }

    pub fn sleep_until(&self, until_ns: u64) {
        self.wait_until(until_ns, || None::<()>);
    }

    /// Wakes all waiting threads. The caller must not hold a lock that their `ready` takes.
    pub fn notify(&self) {
        self.state
            .lock()
            .waiting
            .iter_mut()
            .for_each(|w| w.settled = false);
        self.changed.notify_all();
    }

    /// Adds a participant.
    pub fn enter(self: &Arc<Self>) -> Participant {
        self.state.lock().participants += 1;
        Participant(self.clone())
    }

    /// Jumps to the earliest deadline of a participant, if all wait; returns true if it did.
    fn advance(&self, state: &mut ClockState, time: &AtomicU64) -> bool {
        // A thread that was notified but has not run yet may have work before that time.
        let all_wait =
            state.waiting.len() >= state.participants && state.waiting.iter().all(|w| w.settled);
        let next_ns = state.waiting.iter().map(|w| w.until_ns).min();
        let Some(next_ns) = next_ns.filter(|&ns| all_wait && ns < u64::MAX) else {
            return false;
        };
        time.fetch_max(next_ns, Ordering::AcqRel);
        state.waiting.iter_mut().for_each(|w| w.settled = false);
        self.changed.notify_all();
        true
    }
}

impl Drop for Participant {
    fn drop(&mut self) {
        let mut state = self.0.state.lock();
        state.participants -= 1;
        // The others may have been waiting only for this one.
        if let TimeSource::Scripted(time) = &self.0.time {
            self.0.advance(&mut state, time);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scripted_clock_jumps_when_all_wait() {
        let clock = GrabClock::scripted();
        let order = Mutex::new(Vec::new());
        let sleeper = |name: &'static str, naps_ms: &'static [u64]| {
            let (clock, order, participant) = (clock.clone(), &order, clock.enter());
            move || {
                for &nap in naps_ms {
                    clock.sleep_until(clock.now_ns() + nap * 3_600_000_000_000);
                    order
                        .lock()
                        .push((name, clock.now_ns() / 3_600_000_000_000));
                }
                drop(participant);
            }
        };
        let sleepers = [sleeper("a", &[2, 2, 2]), sleeper("b", &[3, 4])];
        std::thread::scope(|scope| {
            sleepers
                .map(|sleeper| scope.spawn(sleeper))
                .map(|thread| thread.join().unwrap())
        });
        assert_eq!(
            order.into_inner(),
            [("a", 2), ("b", 3), ("a", 4), ("a", 6), ("b", 7)]
        );
    }
}
