//! Fires only when both cameras are armed (thesis, figure 4.3), and makes pairs of what they took.

use super::acquire::{Event, Order, Report};
use super::camera::{Capture, Settings, Side, Taken};
use super::clock::Clock;
use super::exposure::Balance;
use super::mailbox::{Mailbox, Received};
use super::pairing::{Pairing, Unpaired};
use super::pulser::Pulser;
use super::queue::{Pushed, Queue};
use super::tally::Tally;
use super::trigger::{Policy, Trigger};
use crate::error::{Error, Result};
use crate::stereo::{Exposure, Frame, Rig, StereoPair};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A camera that let pass its time so often in a row is given up.
const PATIENCE: u32 = 3;

/// The grabber's main thread.
pub(super) struct Coordinator {
    pub(super) clock: Arc<Clock>,
    pub(super) orders: [Arc<Mailbox<Order>>; 2],
    pub(super) reports: Arc<Mailbox<Report>>,
    pub(super) firing: Firing,
    pub(super) pairing: Pairing,
    pub(super) balance: Balance,
    pub(super) queue: Arc<Queue<Frame>>,
    pub(super) tally: Arc<Mutex<Tally>>,
    pub(super) rig: Option<Rig>,
    pub(super) timeout_ns: u64,
    pub(super) cameras: [CameraState; 2],
    /// Settings of the latest order, and its number.
    pub(super) planned: (u64, Settings),
}

/// How the policy stands.
pub(super) enum Firing {
    WhenArmed {
        trigger: Box<dyn Trigger>,
        period_ns: u64,
        due_ns: u64,
        last_id: Option<u64>,
    },
    /// A trigger that begins once both cameras have been armed.
    FixedRate {
        trigger: Box<dyn Trigger>,
        period_ns: u64,
    },
    /// Something else fires: a pulser, or the cameras themselves.
    Elsewhere {
        _pulser: Option<Pulser>,
    },
}

impl From<Policy> for Firing {
    fn from(policy: Policy) -> Self {
        match policy {
            Policy::Coordinated { trigger, period_ns } => {
                Self::WhenArmed { trigger, period_ns, due_ns: 0, last_id: None }
            }
            Policy::FixedRate { trigger, period_ns } => Self::FixedRate { trigger, period_ns },
            Policy::Free => Self::Elsewhere { _pulser: None },
        }
    }
}

/// Where a camera stands.
pub(super) struct CameraState {
    pub(super) name: String,
    phase: Phase,
    since_ns: u64,
    order: u64,
    misses: u32,
    /// When the first of the damaged images came, if no whole one did since.
    damaged_since_ns: Option<u64>,
}

#[derive(Clone, Copy, PartialEq)]
enum Phase {
    Arming,
    Armed,
    /// A pulse was sent.
    Exposing,
}

impl CameraState {
    pub(super) fn new(name: String) -> Self {
        Self { name, phase: Phase::Arming, since_ns: 0, order: 0, misses: 0, damaged_since_ns: None }
    }
}

impl Coordinator {
    /// Runs until the reports are closed or something fails, and tells the queue how it ended.
    pub(super) fn run(mut self) {
        let ended = self.grab();
        self.firing = Firing::Elsewhere { _pulser: None };
        self.reports.close();
        self.orders.iter().for_each(|orders| orders.close());
        self.pairing.finish();
        self.tally().unpaired = self.pairing.unpaired();
        self.queue.close(ended);
    }

    fn grab(&mut self) -> Result<()> {
        Side::BOTH.into_iter().for_each(|side| self.order(side));
        loop {
            self.fire_if_due()?;
            match self.reports.receive(self.deadline_ns()) {
                Received::Closed => return Ok(()),
                Received::Nothing => self.check_silence()?,
                Received::Message(Report { side, event: Event::Failed(error), .. }) => {
                    self.finish_exposure(side.other())?;
                    return Err(error);
                }
                Received::Message(Report { side, number, event }) => {
                    if number == self.cameras[side as usize].order {
                        self.hear(side, event)?;
                    } else if let Event::Captured(_) = event {
                        // Of an order that was given up and repeated.
                        self.tally().frames[side as usize] += 1;
                        self.pairing.leave_out(Unpaired::Overdue);
                    }
                }
            }
        }
    }

    fn hear(&mut self, side: Side, event: Event) -> Result<()> {
        match event {
            Event::Armed => self.enter(side, Phase::Armed),
            Event::Captured(taken) => {
                self.cameras[side as usize].misses = 0;
                self.tally().frames[side as usize] += 1;
                self.order(side);
                let pair = match taken {
                    Taken::Image(mut capture) => {
                        self.cameras[side as usize].damaged_since_ns = None;
                        if let Firing::WhenArmed { last_id, .. } = self.firing {
                            // Both were armed, so there is one pulse that it can be of.
                            capture.trigger_id = capture.trigger_id.or(last_id);
                        }
                        self.pairing.push(side, capture)
                    }
                    Taken::Damaged => {
                        let now_ns = self.clock.now_ns();
                        self.cameras[side as usize].damaged_since_ns.get_or_insert(now_ns);
                        self.pairing.leave_out(Unpaired::Damaged);
                        None
                    }
                };
                self.tally().unpaired = self.pairing.unpaired();
                self.check_damage(side)?;
                pair.map_or(Ok(()), |pair| self.deliver(pair))?;
            }
            // Told by the caller.
            Event::Failed(error) => return Err(error),
        }
        Ok(())
    }

    /// Waits for the image that a camera is taking: its partner may be there.
    fn finish_exposure(&mut self, side: Side) -> Result<()> {
        let CameraState { phase, order, .. } = self.cameras[side as usize];
        let until_ns = self.clock.now_ns().saturating_add(self.timeout_ns);
        let mut taking = phase == Phase::Exposing || phase == Phase::Armed && self.is_awaited(side);
        while taking {
            match self.reports.receive(until_ns) {
                Received::Message(Report { side: from, number, event: event @ Event::Captured(_) }) => {
                    if (from, number) == (side, order) {
                        self.hear(side, event)?;
                        taking = false;
                    }
                }
                Received::Message(_) => {}
                Received::Nothing | Received::Closed => taking = false,
            }
        }
        Ok(())
    }

    /// Sends a camera the order for its next image. Both get the same settings with the same number.
    fn order(&mut self, side: Side) {
        let number = self.cameras[side as usize].order + 1;
        if number > self.planned.0 {
            self.planned = (number, self.balance.settings());
        }
        self.cameras[side as usize].order = number;
        self.enter(side, Phase::Arming);
        self.orders[side as usize].send(Order { number, settings: self.planned.1 });
    }

    fn enter(&mut self, side: Side, phase: Phase) {
        let since_ns = self.clock.now_ns();
        let camera = &mut self.cameras[side as usize];
        (camera.phase, camera.since_ns) = (phase, since_ns);
    }

    fn both_armed(&self) -> bool {
        self.cameras.iter().all(|camera| camera.phase == Phase::Armed)
    }

    fn fire_if_due(&mut self) -> Result<()> {
        if !self.both_armed() {
            return Ok(());
        }
        match &mut self.firing {
            Firing::WhenArmed { trigger, period_ns, due_ns, last_id } => {
                let now_ns = self.clock.now_ns();
                if now_ns < *due_ns {
                    return Ok(());
                }
                // The rate is kept to on average: a pulse that is late makes up for up to one period.
                let was_due_ns = if last_id.is_some() { *due_ns } else { now_ns };
                *due_ns = was_due_ns.max(now_ns.saturating_sub(*period_ns)) + *period_ns;
                let id = trigger.fire()?.id;
                let strays = last_id.replace(id).map_or(0, |last| id.saturating_sub(last + 1));
                let mut tally = self.tally();
                tally.pulses += 1;
                tally.stray_pulses += strays;
                drop(tally);
                Side::BOTH.into_iter().for_each(|side| self.enter(side, Phase::Exposing));
            }
            Firing::FixedRate { .. } => {
                let fixed = std::mem::replace(&mut self.firing, Firing::Elsewhere { _pulser: None });
                if let Firing::FixedRate { trigger, period_ns } = fixed {
                    let pulser = Pulser::start(&self.clock, trigger, period_ns, &self.reports, &self.tally);
                    self.firing = Firing::Elsewhere { _pulser: Some(pulser) };
                }
            }
            Firing::Elsewhere { .. } => {}
        }
        Ok(())
    }

    /// Until when there is nothing to do unless a camera reports.
    fn deadline_ns(&self) -> u64 {
        let silent = Side::BOTH.into_iter().filter(|&side| self.is_awaited(side));
        let silent_ns = silent.map(|side| self.cameras[side as usize].since_ns.saturating_add(self.timeout_ns)).min();
        let due_ns = match self.firing {
            Firing::WhenArmed { due_ns, .. } if self.both_armed() => Some(due_ns),
            _ => None,
        };
        silent_ns.into_iter().chain(due_ns).min().unwrap_or(u64::MAX)
    }

    /// Whether it is this camera's turn: an armed one may wait for the other.
    fn is_awaited(&self, side: Side) -> bool {
        let armed = self.cameras[side as usize].phase == Phase::Armed;
        !armed || matches!(self.firing, Firing::Elsewhere { .. })
    }

    fn check_silence(&mut self) -> Result<()> {
        let now_ns = self.clock.now_ns();
        for side in Side::BOTH {
            let silent_since_ns = self.cameras[side as usize].since_ns;
            if !self.is_awaited(side) || now_ns < silent_since_ns.saturating_add(self.timeout_ns) {
                continue;
            }
            let camera = &mut self.cameras[side as usize];
            camera.misses += 1;
            if camera.misses >= PATIENCE {
                let silence_s = self.timeout_ns as f64 * f64::from(PATIENCE) / 1e9;
                let reason = format!("silent for {silence_s:.1} s; check its power, its cable and its trigger line");
                return Err(side.blame(Error::camera(&camera.name, reason)));
            }
            self.order(side);
        }
        Ok(())
    }

    /// A camera all of whose images are damaged would be recorded from for ever.
    fn check_damage(&mut self, side: Side) -> Result<()> {
        let now_ns = self.clock.now_ns();
        let camera = &self.cameras[side as usize];
        let damaged_ns = camera.damaged_since_ns.map_or(0, |since_ns| now_ns.saturating_sub(since_ns));
        if damaged_ns < self.timeout_ns.saturating_mul(PATIENCE.into()) {
            return Ok(());
        }
        let reason = format!("all its images came damaged for {:.1} s; check its cable", damaged_ns as f64 / 1e9);
        Err(side.blame(Error::camera(&camera.name, reason)))
    }

    fn deliver(&mut self, [left, right]: [Capture; 2]) -> Result<()> {
        self.balance.observe(&left.image, &right.image, left.settings);
        let skew_ns = right.stamp_ns.wrapping_sub(left.stamp_ns) as i64;
        let mut tally = self.tally();
        // Saturates at an hour.
        tally.skew_ns.saturating_record(skew_ns.unsigned_abs());
        let (sequence, drops) = (tally.pairs, tally.drops());
        tally.pairs += 1;
        drop(tally);
        let frame = Frame {
            sequence,
            stamp_ns: left.stamp_ns,
            name: None,
            pair: StereoPair::new(left.image, right.image)?,
            rig: self.rig,
            pose: None,
            truth: None,
            exposure: Exposure {
                trigger_id: left.trigger_id.unwrap_or(sequence),
                skew_ns,
                shutter_us: left.settings.shutter_us,
                gain_mdb: left.settings.gain_mdb,
                drops,
            },
        };
        let pushed = self.queue.push(frame);
        let mut tally = self.tally();
        match pushed {
            Pushed::Taken => {}
            Pushed::Late => tally.waited += 1,
            Pushed::Dropped => tally.dropped += 1,
            Pushed::Abandoned => tally.unread += 1,
        }
        Ok(())
    }

    fn tally(&self) -> MutexGuard<'_, Tally> {
        self.tally.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
