//! The time that the grabber lives in: the machine's, or a scripted one in which every run is the
//! same.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Tells the time, and lets threads wait for it or for each other.
///
/// A scripted clock stands still while one of its participants has something to do, and jumps to
/// the next moment that one waits for when all wait. So a test of threads that sleep takes no time
/// and cannot fail for a slow machine.
pub struct Clock {
    time: Time,
    state: Mutex<State>,
    changed: Condvar,
}

enum Time {
    Real { began: Instant, epoch_ns: u64 },
    Scripted(AtomicU64),
}

#[derive(Default)]
struct State {
    participants: usize,
    next_id: u64,
    waiting: Vec<Waiting>,
}

struct Waiting {
    id: u64,
    until_ns: u64,
    /// It has looked at everything that changed, and found nothing for it.
    settled: bool,
}

/// A thread that a scripted clock reckons with, until it is dropped. Enter it before the thread
/// begins.
pub struct Participant(Arc<Clock>);

impl Clock {
    /// The machine's time, nanoseconds since 1970, never running backwards.
    pub fn real() -> Arc<Self> {
        let since_epoch = SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .unwrap_or_default();
        let epoch_ns = since_epoch.as_nanos() as u64;
        Self::with(Time::Real {
            began: Instant::now(),
            epoch_ns,
        })
    }

    /// A scripted time that begins at 0.
    pub fn scripted() -> Arc<Self> {
        Self::with(Time::Scripted(AtomicU64::new(0)))
    }

    fn with(time: Time) -> Arc<Self> {
        Arc::new(Self {
            time,
            state: Mutex::default(),
            changed: Condvar::new(),
        })
    }

    pub fn now_ns(&self) -> u64 {
        match &self.time {
            Time::Real { began, epoch_ns } => epoch_ns + began.elapsed().as_nanos() as u64,
            Time::Scripted(now_ns) => now_ns.load(Ordering::Acquire),
        }
    }

    /// Waits until `ready` gives something, or the time has come: then nothing. `ready` is asked
    /// again after every [`Clock::notify`]. On a scripted clock only participants may wait.
    pub fn wait_until<T>(&self, until_ns: u64, mut ready: impl FnMut() -> Option<T>) -> Option<T> {
        let mut state = self.lock();
        let id = state.next_id;
        state.next_id += 1;
        state.waiting.push(Waiting {
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
            state = match &self.time {
                Time::Real { .. } => {
                    let left = Duration::from_nanos(until_ns - now_ns);
                    self.changed
                        .wait_timeout(state, left)
                        .unwrap_or_else(PoisonError::into_inner)
                        .0
                }
                Time::Scripted(time) => {
                    state
                        .waiting
                        .iter_mut()
                        .filter(|w| w.id == id)
                        .for_each(|w| w.settled = true);
                    if self.advance(&mut state, time) {
                        state
                    } else {
                        self.changed
                            .wait(state)
                            .unwrap_or_else(PoisonError::into_inner)
                    }
                }
            };
        };
        state.waiting.retain(|w| w.id != id);
        found
    }

    pub fn sleep_until(&self, until_ns: u64) {
        self.wait_until(until_ns, || None::<()>);
    }

    /// Something changed that others may wait for. Not to be called while holding what their
    /// `ready` locks.
    pub fn notify(&self) {
        self.lock()
            .waiting
            .iter_mut()
            .for_each(|w| w.settled = false);
        self.changed.notify_all();
    }

    /// Reckons with one more thread.
    pub fn enter(self: &Arc<Self>) -> Participant {
        self.lock().participants += 1;
        Participant(self.clone())
    }

    /// Jumps to the next moment that a participant waits for, when all wait.
    fn advance(&self, state: &mut State, time: &AtomicU64) -> bool {
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

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Participant {
    fn drop(&mut self) {
        let mut state = self.0.lock();
        state.participants -= 1;
        if let Time::Scripted(time) = &self.0.time {
            self.0.advance(&mut state, time);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scripted_clock_jumps_when_all_wait() {
        let clock = Clock::scripted();
        let order = Mutex::new(Vec::new());
        let sleeper = |name: &'static str, naps_ms: &'static [u64]| {
            let (clock, order, participant) = (clock.clone(), &order, clock.enter());
            move || {
                for &nap in naps_ms {
                    clock.sleep_until(clock.now_ns() + nap * 3_600_000_000_000);
                    order
                        .lock()
                        .unwrap()
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
            order.into_inner().unwrap(),
            [("a", 2), ("b", 3), ("a", 4), ("a", 6), ("b", 7)]
        );
    }
}
