//! Fires only when both cameras are armed (thesis, figure 4.3), and makes pairs of what they took.

use super::acquire::{Event, Order, Report};
use super::camera::{Capture, Settings, Side, Taken};
use super::clock::Clock;
use super::exposure::Balance;
use super::firing::Firing;
use super::mailbox::{Mailbox, Received};
use super::pairing::{Pairing, Unpaired};
use super::pairless::Pairless;
use super::pulser::Pulser;
use super::queue::{Pushed, Queue};
use super::tally::Tally;
use super::watch::{CameraState, Phase};
use crate::error::Result;
use crate::stereo::{Exposure, Frame, Geometry, Rig, StereoPair};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The grabber's main thread.
pub(super) struct Coordinator {
    pub(super) clock: Arc<Clock>,
    pub(super) orders: [Arc<Mailbox<Order>>; 2],
    pub(super) reports: Arc<Mailbox<Report>>,
    pub(super) firing: Firing,
    pub(super) pairing: Pairing,
    pub(super) pairless: Pairless,
    pub(super) balance: Balance,
    pub(super) queue: Arc<Queue<Frame>>,
    pub(super) tally: Arc<Mutex<Tally>>,
    pub(super) rig: Option<Rig>,
    pub(super) timeout_ns: u64,
    pub(super) cameras: [CameraState; 2],
    /// Number of the latest order, and its settings.
    pub(super) planned: (u64, Settings),
    /// It was told that the cameras make different things of the same settings.
    pub(super) told_apart: bool,
}

impl Coordinator {
    /// Runs until the reports are closed or something fails, and tells the queue how it ended.
    pub(super) fn run(mut self) {
        let mut ended = self.grab();
        self.firing.end();
        self.reports.close();
        self.orders.iter().for_each(|orders| orders.close());
        // What was taken already is to be in a pair or counted.
        for Report { side, event } in self.reports.drain() {
            if let Event::Captured(taken) = event {
                ended = ended.and(self.hear_image(side, taken));
            }
        }
        ended = ended.and(self.deliver_pairs(Pairing::finish));
        self.queue.close(ended);
    }

    fn grab(&mut self) -> Result<()> {
        Side::BOTH.into_iter().for_each(|side| self.order(side));
        loop {
            self.fire_if_due()?;
            match self.reports.receive(self.deadline_ns()) {
                Received::Closed => return Ok(()),
                Received::Nothing => self.check_silence()?,
                Received::Message(Report { side, event }) => match event {
                    Event::Armed => self.enter(side, Phase::Armed),
                    Event::Captured(taken) => self.hear_image(side, taken)?,
                    Event::Failed(error) => {
                        self.finish_exposure(side.other())?;
                        return Err(error);
                    }
                },
            }
        }
    }

    fn hear_image(&mut self, side: Side, taken: Taken) -> Result<()> {
        let (now_ns, camera) = (self.clock.now_ns(), &mut self.cameras[side as usize]);
        // Else it is of an order that was given up, and repeated already.
        let is_ordered = camera.phase != Phase::Arming;
        let mut checked = Ok(());
        let next: fn(&mut Self, Side) = match taken {
            Taken::Image(capture) => match self.firing.with_pulse(capture) {
                Some(capture) => {
                    let next = if self.firing.is_late(&capture) {
                        Self::order_next
                    } else {
                        Self::order
                    };
                    camera.gave_image();
                    self.pairing.push(side, capture);
                    next
                }
                None => {
                    camera.gave_stray();
                    self.pairing.leave_out(Unpaired::Unready);
                    Self::order_next
                }
            },
            Taken::Damaged => {
                checked = camera.gave_damaged(now_ns, self.timeout_ns);
                self.pairing.leave_out(Unpaired::Damaged);
                Self::order
            }
            Taken::Unready => {
                camera.gave_unready(now_ns);
                self.pairing.leave_out(Unpaired::Unready);
                |_, _| {}
            }
        };
        self.tally().frames[side as usize] += 1;
        if is_ordered {
            next(self, side);
        }
        self.deliver_pairs(Pairing::pair)?;
        checked?;
        self.pairless
            .image(side, now_ns, self.timeout_ns, self.pairing.unpaired())
    }

    /// Waits for the image that a camera is taking: its partner may be there.
    fn finish_exposure(&mut self, side: Side) -> Result<()> {
        let until_ns = self.clock.now_ns().saturating_add(self.timeout_ns);
        let mut taking =
            self.cameras[side as usize].phase != Phase::Arming && self.patience_ns(side).is_some();
        while taking {
            match self.reports.receive(until_ns) {
                Received::Message(Report {
                    side: from,
                    event: Event::Captured(taken),
                }) if from == side => {
                    taking = taken == Taken::Unready;
                    self.hear_image(side, taken)?;
                }
                Received::Message(_) => {}
                Received::Nothing | Received::Closed => taking = false,
            }
        }
        Ok(())
    }

    /// Sends a camera the order for its next image.
    fn order(&mut self, side: Side) {
        let turn = self.cameras[side as usize].turn + 1;
        if turn > self.planned.0 {
            self.planned = (turn, self.balance.settings());
        }
        self.order_turn(side, turn);
    }

    fn order_turn(&mut self, side: Side, turn: u64) {
        self.cameras[side as usize].turn = turn;
        self.enter(side, Phase::Arming);
        self.orders[side as usize].send(Order::Take(self.planned.1));
    }

    /// The image of this order is still to come.
    fn order_next(&mut self, side: Side) {
        self.orders[side as usize].send(Order::TakeNext);
    }

    fn enter(&mut self, side: Side, phase: Phase) {
        let now_ns = self.clock.now_ns();
        self.cameras[side as usize].enter(phase, now_ns);
    }

    fn both_armed(&self) -> bool {
        self.cameras
            .iter()
            .all(|camera| camera.phase == Phase::Armed)
    }

    fn fire_if_due(&mut self) -> Result<()> {
        if self.both_armed() {
            let Self {
                clock,
                reports,
                tally,
                ..
            } = self;
            let begin =
                |trigger, period_ns| Pulser::start(clock, trigger, period_ns, reports, tally);
            if self.firing.fire_if_due(clock.now_ns(), tally, begin)? {
                Side::BOTH
                    .into_iter()
                    .for_each(|side| self.enter(side, Phase::Exposing));
            }
        }
        Ok(())
    }

    /// Until when there is nothing to do unless a camera reports.
    fn deadline_ns(&self) -> u64 {
        let silent = Side::BOTH
            .into_iter()
            .filter_map(|side| self.silent_at_ns(side));
        silent
            .chain(self.firing.due_ns().filter(|_| self.both_armed()))
            .min()
            .unwrap_or(u64::MAX)
    }

    fn silent_at_ns(&self, side: Side) -> Option<u64> {
        Some(
            self.cameras[side as usize]
                .since_ns
                .saturating_add(self.patience_ns(side)?),
        )
    }

    /// How long a camera may take for what it is at, if it is its turn: an armed one may wait for
    /// the other.
    fn patience_ns(&self, side: Side) -> Option<u64> {
        let needed_ns = match self.cameras[side as usize].phase {
            Phase::Arming => 0,
            Phase::Armed => self.firing.elsewhere_ns()?,
            Phase::Exposing => u64::from(self.planned.1.shutter_us) * 1000,
        };
        Some(needed_ns.saturating_add(self.timeout_ns))
    }

    fn check_silence(&mut self) -> Result<()> {
        let now_ns = self.clock.now_ns();
        for side in Side::BOTH {
            let Some(patience_ns) = self.patience_ns(side) else {
                continue;
            };
            let camera = &mut self.cameras[side as usize];
            if now_ns < camera.since_ns.saturating_add(patience_ns) {
                continue;
            }
            camera.missed(patience_ns)?;
            match camera.phase {
                // It has its order: another would only make it begin anew.
                Phase::Arming => camera.enter(Phase::Arming, now_ns),
                // The pulse was lost, so it goes on with the other one's next.
                Phase::Armed | Phase::Exposing => self.order_turn(side, self.planned.0),
            }
        }
        Ok(())
    }

    fn deliver_pairs(&mut self, next: fn(&mut Pairing) -> Option<[Capture; 2]>) -> Result<()> {
        loop {
            let pair = next(&mut self.pairing);
            self.tally().unpaired = self.pairing.unpaired();
            match pair {
                Some(pair) => self.deliver(pair)?,
                None => return Ok(()),
            }
        }
    }

    fn deliver(&mut self, [left, right]: [Capture; 2]) -> Result<()> {
        self.balance
            .observe(&left.image, &right.image, left.ordered);
        if !left.settings.is_near(right.settings) && !std::mem::replace(&mut self.told_apart, true)
        {
            let [a, b] = &self.cameras;
            let (ordered, a, b, right) = (left.ordered, &a.name, &b.name, right.settings);
            tracing::warn!(
                "of {ordered} {a} makes {}, {b} {right}: the two do not expose alike",
                left.settings
            );
        }
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
            geometry: self
                .rig
                .map_or(Geometry::Raw, |rig| Geometry::Rectified(Some(rig))),
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
        self.pairless.pair(self.pairing.unpaired());
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

#[cfg(test)]
mod tests {
    use super::super::pairing::Rule;
    use super::super::queue::WhenFull;
    use super::super::{Limits, Policy};
    use super::*;
    use crate::stereo::Gray;

    #[test]
    fn what_was_taken_before_the_end_is_in_a_pair_or_counted() {
        let clock = Clock::scripted();
        let settings = Settings {
            shutter_us: 100,
            gain_mdb: 0,
        };
        let limits = Limits {
            shutter_us: 100..=100,
            gain_mdb: 0..=0,
        };
        let (reports, tally) = (Mailbox::new(&clock), Arc::<Mutex<Tally>>::default());
        let queue = Arc::new(Queue::new(1, WhenFull::Drop));
        let coordinator = Coordinator {
            orders: [Mailbox::new(&clock), Mailbox::new(&clock)],
            reports: reports.clone(),
            firing: Policy::FreeRunning { period_ns: 1 }.into(),
            pairing: Pairing::new(Rule::Arrival),
            pairless: Pairless::default(),
            balance: Balance::new(limits, settings, 1),
            queue: queue.clone(),
            tally: tally.clone(),
            rig: None,
            timeout_ns: 1,
            cameras: Side::BOTH.map(|side| CameraState::new(side, String::new())),
            planned: (0, settings),
            told_apart: false,
            clock,
        };
        let image = Gray::filled(1, 1, 7).unwrap();
        let capture = Capture {
            image,
            stamp_ns: 1,
            trigger_id: None,
            ordered: settings,
            settings,
        };
        for (side, taken) in [
            (Side::Left, Taken::Image(capture.clone())),
            (Side::Left, Taken::Image(capture.clone())),
            (Side::Right, Taken::Damaged),
            (Side::Right, Taken::Image(capture)),
        ] {
            reports.send(Report {
                side,
                event: Event::Captured(taken),
            });
        }
        reports.close();
        coordinator.run();
        assert!(queue.pop().unwrap().is_some());
        let tally = tally.lock().unwrap();
        assert_eq!((tally.frames, tally.pairs), ([2, 2], 1));
        assert_eq!(tally.unpaired.iter().sum::<u64>(), 2);
    }
}
