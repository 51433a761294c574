//! The running grabber: its threads, and the queue from which pairs are read.

use super::acquire::{CameraReport, acquire};
use super::camera::{Camera, Limits, Settings};
use super::clock::GrabClock;
use super::coordinator::Coordinator;
use super::exposure::Balance;
use super::mailbox::Mailbox;
use super::pairing::{Pairing, Rule};
use super::queue::{Queue, WhenFull};
use super::tally::Tally;
use super::trigger::Policy;
use super::watchdog::{CameraState, PairWatchdog};
use crate::camera_error;
use parking_lot::Mutex;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use svl_core::Result;
use svl_core::stereo::{Frame, Rig, Side};

/// Two opened cameras with the settings of the grabber.
pub struct Setup {
    pub clock: Arc<GrabClock>,
    /// Left, right.
    pub cameras: [Box<dyn Camera>; 2],
    pub policy: Policy,
    pub rule: Rule,
    /// First settings of both cameras, clamped to their common limits.
    pub settings: Settings,
    /// Longest shutter of the exposure balance, so that the rate can be held.
    pub max_shutter_us: u32,
    /// Pairs from one step of the exposure balance to the next.
    pub balance_every: u32,
    /// Watchdog: time that a camera may take to arm or to deliver, beyond its shutter time, and
    /// beyond the period if svl does not trigger it. The third timeout in a row is an error.
    pub timeout: Duration,
    /// Limit on the pairs that wait for the writer.
    pub queue: usize,
    pub when_full: WhenFull,
    pub rig: Option<Rig>,
}

/// A running grabber. Dropping it ends its threads.
pub struct Grabber {
    clock: Arc<GrabClock>,
    reports: Arc<Mailbox<CameraReport>>,
    queue: Arc<Queue<Frame>>,
    tally: Arc<Mutex<Tally>>,
    threads: Vec<JoinHandle<()>>,
    last_stamp_ns: Option<u64>,
}

/// The limits of both cameras, with the longest shutter that holds the rate.
fn common_limits(cameras: &[Box<dyn Camera>; 2], max_shutter_us: u32) -> Result<Limits> {
    let mut limits = cameras[0].limits().common(&cameras[1].limits())?;
    let (shortest, longest) = (*limits.shutter_us.start(), *limits.shutter_us.end());
    // Never below the shortest shutter: such cameras simply do not hold the rate.
    limits.shutter_us = shortest..=longest.min(max_shutter_us).max(shortest);
    Ok(limits)
}

impl Grabber {
    /// Starts the threads.
    ///
    /// # Errors
    /// [`crate::CameraError`] if the cameras have no settings in common or a thread cannot be
    /// started.
    pub fn start(setup: Setup) -> Result<Self> {
        let (clock, cameras) = (setup.clock, setup.cameras);
        let limits = common_limits(&cameras, setup.max_shutter_us)?;
        let settings = limits.clamp(setup.settings);
        let reports = Mailbox::new(&clock);
        let orders = [Mailbox::new(&clock), Mailbox::new(&clock)];
        let queue = Arc::new(Queue::new(setup.queue, setup.when_full));
        let tally = Arc::new(Mutex::new(Tally::default()));
        let states = Side::BOTH.map(|side| CameraState::new(side, cameras[side as usize].name()));
        let coordinator = Coordinator {
            clock: clock.clone(),
            orders: orders.clone(),
            reports: reports.clone(),
            triggering: setup.policy.into(),
            pairing: Pairing::new(setup.rule),
            pair_watchdog: PairWatchdog::default(),
            balance: Balance::new(limits, settings, setup.balance_every.max(1)),
            queue: queue.clone(),
            tally: tally.clone(),
            rig: setup.rig,
            timeout_ns: setup.timeout.as_nanos().min(u64::MAX.into()) as u64,
            cameras: states,
            planned: (0, settings),
            warned_unlike: false,
        };
        // All participants enter before the first thread starts, or a scripted clock would advance
        // as soon as that one waits.
        let mut work: Vec<(String, Box<dyn FnOnce() + Send>)> = Vec::new();
        for ((side, camera), orders) in Side::BOTH.into_iter().zip(cameras).zip(orders) {
            let (reports, participant) = (reports.clone(), clock.enter());
            let thread = move || {
                acquire(side, camera, &orders, &reports);
                drop(participant);
            };
            work.push((format!("{} camera", side.name()), Box::new(thread)));
        }
        let participant = clock.enter();
        work.push((
            "coordinator".to_owned(),
            Box::new(move || {
                coordinator.run();
                drop(participant);
            }),
        ));
        let mut grabber = Self {
            clock,
            reports,
            queue,
            tally,
            threads: Vec::new(),
            last_stamp_ns: None,
        };
        for (name, work) in work {
            let thread = std::thread::Builder::new().name(name.clone()).spawn(work);
            let failed = |e| camera_error(&name, format!("cannot start its thread: {e}"));
            grabber.threads.push(thread.map_err(failed)?);
        }
        Ok(grabber)
    }

    /// The next pair, after waiting for it. The call implies that the previous pair was written:
    /// its latency is recorded here.
    ///
    /// # Errors
    /// [`crate::CameraError`] if a camera or the trigger failed, once, after all earlier pairs.
    pub fn next_pair(&mut self) -> Result<Option<Frame>> {
        self.next_pair_unless(|| false)
    }

    /// [`Grabber::next_pair`], or `None` once `stopped` returns true, which is polled meanwhile.
    ///
    /// # Errors
    /// The errors of [`Grabber::next_pair`].
    pub fn next_pair_unless(&mut self, stopped: impl Fn() -> bool) -> Result<Option<Frame>> {
        if let Some(stamp_ns) = self.last_stamp_ns.take() {
            let latency_ns = self.clock.now_ns().saturating_sub(stamp_ns);
            // The histogram saturates at an hour.
            self.tally.lock().latency_ns.saturating_record(latency_ns);
        }
        let frame = self.queue.pop_unless(stopped)?;
        self.last_stamp_ns = frame.as_ref().map(|frame| frame.stamp_ns);
        Ok(frame)
    }

    /// Ends the threads and returns the counts of the run.
    pub fn stop(&mut self) -> Tally {
        self.reports.close();
        // Wakes a coordinator that waits for the writer.
        let unread = self.queue.abandon();
        // A driver may hang in a call forever: waiting for its thread would make Ctrl-C hang too.
        let began = Instant::now();
        while began.elapsed() < STOPPING && self.threads.iter().any(|thread| !thread.is_finished())
        {
            std::thread::sleep(Duration::from_millis(1));
        }
        self.threads.clear();
        let mut tally = self.tally.lock();
        tally.unread += unread as u64;
        tally.clone()
    }
}

/// Time that threads have to end: several of the slices after which they check for orders.
const STOPPING: Duration = Duration::from_millis(500);

impl Drop for Grabber {
    fn drop(&mut self) {
        self.stop();
    }
}
