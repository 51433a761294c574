//! Sends pulses by the policy of the run, and finds the pulse that belongs to an image.

use super::acquire::{CameraEvent, CameraReport};
use super::camera::{Capture, Settings};
use super::clock::GrabClock;
use super::mailbox::{Mailbox, Received};
use super::tally::Tally;
use super::trigger::{Policy, Pulse, Trigger};
use super::watchdog::MAX_MISSES;
use crate::camera_error;
use parking_lot::Mutex;
use std::collections::VecDeque;
use std::sync::Arc;
use svl_core::Result;
use svl_core::stereo::Side;

/// The state of a policy.
pub(super) enum Triggering {
    /// The coordinator triggers when both cameras are armed.
    WhenArmed {
        trigger: Box<dyn Trigger>,
        period_ns: u64,
        due_ns: u64,
        /// The latest pulses, in order.
        pulses: VecDeque<Pulse>,
    },
    /// The coordinator does not trigger: a thread does at a fixed rate, or the cameras are
    /// free-running.
    Independent {
        period_ns: u64,
        /// A fixed-rate trigger until its thread starts, once both cameras are armed.
        pending: Option<Box<dyn Trigger>>,
        thread: Option<FixedRateThread>,
    },
}

/// Largest difference between a camera's time and a pulse's time at the same moment: clocks are
/// synchronized better than this.
const CLOCK_ERROR_NS: u64 = 1_000_000;
/// Number of pulses whose images may still arrive: a camera later than this has timed out.
const PULSES: usize = MAX_MISSES as usize + 1;

impl From<Policy> for Triggering {
    fn from(policy: Policy) -> Self {
        let (period_ns, pending) = match policy {
            Policy::Coordinated { trigger, period_ns } => {
                return Self::WhenArmed {
                    trigger,
                    period_ns,
                    due_ns: 0,
                    pulses: VecDeque::new(),
                };
            }
            Policy::FixedRate { trigger, period_ns } => (period_ns, Some(trigger)),
            Policy::FreeRunning { period_ns } => (period_ns, None),
        };
        Self::Independent {
            period_ns,
            pending,
            thread: None,
        }
    }
}

impl Triggering {
    /// Called when both cameras are armed: sends a pulse if it is due, and returns true if it did.
    /// Starts a fixed-rate trigger.
    ///
    /// # Errors
    /// The trigger's; [`crate::CameraError`] if its thread cannot be started.
    pub(super) fn pulse_if_due(
        &mut self,
        clock: &Arc<GrabClock>,
        reports: &Arc<Mailbox<CameraReport>>,
        tally: &Arc<Mutex<Tally>>,
    ) -> Result<bool> {
        let now_ns = clock.now_ns();
        match self {
            Self::WhenArmed {
                trigger,
                period_ns,
                due_ns,
                pulses,
            } if now_ns >= *due_ns => {
                // The average rate is kept: a late pulse makes up for at most one period, or a
                // burst would follow when a camera was away for a second.
                let was_due_ns = if pulses.is_empty() { now_ns } else { *due_ns };
                *due_ns = was_due_ns
                    .max(now_ns.saturating_sub(*period_ns))
                    .saturating_add(*period_ns);
                let pulse = trigger.pulse()?;
                // A gap in the numbers: noise on the line made the controller send extra pulses.
                let strays = pulses
                    .back()
                    .map_or(0, |last| pulse.id.saturating_sub(last.id + 1));
                pulses.push_back(pulse);
                if pulses.len() > PULSES {
                    pulses.pop_front();
                }
                let mut tally = tally.lock();
                tally.pulses += 1;
                tally.stray_pulses += strays;
                Ok(true)
            }
            Self::WhenArmed { .. } => Ok(false),
            Self::Independent {
                period_ns,
                pending,
                thread,
            } => {
                if let Some(trigger) = pending.take() {
                    let started =
                        FixedRateThread::start(trigger, *period_ns, clock, reports, tally);
                    *thread = Some(started?);
                }
                Ok(false)
            }
        }
    }

    /// Time of the next pulse for two armed cameras from this trigger.
    pub(super) fn due_ns(&self) -> Option<u64> {
        match self {
            Self::WhenArmed { due_ns, .. } => Some(*due_ns),
            Self::Independent { .. } => None,
        }
    }

    /// The period of cameras that expose without the coordinator.
    pub(super) fn independent_period_ns(&self) -> Option<u64> {
        match self {
            Self::Independent {
                period_ns,
                pending: None,
                ..
            } => Some(*period_ns),
            _ => None,
        }
    }

    /// Drops the trigger and ends its thread.
    pub(super) fn end(&mut self) {
        *self = Policy::FreeRunning { period_ns: 0 }.into();
    }

    /// The image with the id of its pulse, if the camera does not report it. Both cameras were
    /// armed when a pulse was sent, so an image in time belongs to the last one; an image that
    /// began before the last pulse belongs to one that had timed out. `None` if it belongs to no
    /// pulse.
    pub(super) fn with_pulse(&self, mut capture: Capture) -> Option<Capture> {
        if let (Self::WhenArmed { pulses, .. }, None) = (self, capture.trigger_id) {
            let Settings { shutter_us, .. } = capture.settings;
            // Stamps mark the middle of the exposure, pulses its start.
            let began_ns = capture.stamp_ns.saturating_sub(u64::from(shutter_us) * 500);
            let before = |pulse: &&Pulse| pulse.stamp_ns <= began_ns.saturating_add(CLOCK_ERROR_NS);
            capture.trigger_id = Some(pulses.iter().rfind(before)?.id);
        }
        Some(capture)
    }

    /// True if an image belongs to a pulse before the last, so that another image is still to come.
    pub(super) fn is_late(&self, capture: &Capture) -> bool {
        match self {
            Self::WhenArmed { pulses, .. } => pulses
                .back()
                .is_some_and(|last| capture.trigger_id < Some(last.id)),
            Self::Independent { .. } => false,
        }
    }
}

/// A thread that triggers at a fixed rate, whether cameras are armed or not, until this is dropped.
pub(super) struct FixedRateThread(Arc<Mailbox<()>>);

impl FixedRateThread {
    fn start(
        mut trigger: Box<dyn Trigger>,
        period_ns: u64,
        clock: &Arc<GrabClock>,
        reports: &Arc<Mailbox<CameraReport>>,
        tally: &Arc<Mutex<Tally>>,
    ) -> Result<Self> {
        let stop = Mailbox::new(clock);
        let thread = Self(stop.clone());
        let (clock, reports, tally) = (clock.clone(), reports.clone(), tally.clone());
        // Entered here, so that a scripted clock does not advance before the thread runs.
        let participant = clock.enter();
        let run = move || {
            let mut due_ns = clock.now_ns();
            while stop.receive(due_ns) == Received::Nothing {
                if let Err(error) = trigger.pulse() {
                    // Reports come from a camera; either side ends the run.
                    reports.send(CameraReport {
                        side: Side::Left,
                        event: CameraEvent::Failed(error),
                    });
                    break;
                }
                tally.lock().pulses += 1;
                due_ns = due_ns.saturating_add(period_ns).max(clock.now_ns());
            }
            drop(participant);
        };
        let spawned = std::thread::Builder::new()
            .name("trigger".to_owned())
            .spawn(run);
        spawned
            .map(|_| thread)
            .map_err(|e| camera_error("trigger", format!("cannot start its thread: {e}")))
    }
}

impl Drop for FixedRateThread {
    fn drop(&mut self) {
        self.0.close();
    }
}
