//! The coordinator: triggers when both cameras are armed (thesis, figure 4.3), pairs their images,
//! monitors timeouts.

use super::acquire::{CameraEvent, CameraReport, Order};
use super::camera::{Capture, Settings, Taken};
use super::clock::GrabClock;
use super::exposure::Balance;
use super::mailbox::{Mailbox, Received};
use super::pairing::{Pairing, Unpaired};
use super::queue::{Pushed, Queue};
use super::tally::Tally;
use super::triggering::Triggering;
use super::watchdog::{CameraState, PairWatchdog, Phase};
use parking_lot::Mutex;
use std::sync::Arc;
use svl_core::Result;
use svl_core::stereo::{Exposure, Frame, Geometry, Rig, Side, StereoPair};

/// The grabber's main thread.
pub(super) struct Coordinator {
    pub(super) clock: Arc<GrabClock>,
    pub(super) orders: [Arc<Mailbox<Order>>; 2],
    pub(super) reports: Arc<Mailbox<CameraReport>>,
    pub(super) triggering: Triggering,
    pub(super) pairing: Pairing,
    pub(super) pair_watchdog: PairWatchdog,
    pub(super) balance: Balance,
    pub(super) queue: Arc<Queue<Frame>>,
    pub(super) tally: Arc<Mutex<Tally>>,
    pub(super) rig: Option<Rig>,
    pub(super) timeout_ns: u64,
    pub(super) cameras: [CameraState; 2],
    /// Number of the latest order, and its settings.
    pub(super) planned: (u64, Settings),
    /// True once it has warned that the cameras expose differently with the same settings.
    pub(super) warned_unlike: bool,
}

impl Coordinator {
    /// Runs until the reports are closed or something fails, and closes the queue with the result.
    pub(super) fn run(mut self) {
        let mut ended = self.grab();
        self.triggering.end();
        self.reports.close();
        self.orders.iter().for_each(|orders| orders.close());
        // Every image is in a pair or counted, including those that arrived meanwhile.
        for CameraReport { side, event } in self.reports.drain() {
            if let CameraEvent::Captured(taken) = event {
                ended = ended.and(self.handle_image(side, taken));
            }
        }
        ended = ended.and(self.deliver_pairs(Pairing::finish));
        self.queue.close(ended);
    }

    fn grab(&mut self) -> Result<()> {
        Side::BOTH.into_iter().for_each(|side| self.order(side));
        loop {
            self.pulse_if_due()?;
            match self.reports.receive(self.deadline_ns()) {
                Received::Closed => return Ok(()),
                Received::Nothing => self.check_timeouts()?,
                Received::Message(CameraReport { side, event }) => match event {
                    CameraEvent::Armed => self.enter(side, Phase::Armed),
                    CameraEvent::Captured(taken) => self.handle_image(side, taken)?,
                    CameraEvent::Failed(error) => {
                        // Images of one pulse arrive one after the other: the partner of the last
                        // image may still be on its way.
                        self.finish_exposure(side.other())?;
                        return Err(error);
                    }
                },
            }
        }
    }

    fn handle_image(&mut self, side: Side, taken: Taken) -> Result<()> {
        let (now_ns, camera) = (self.clock.now_ns(), &mut self.cameras[side as usize]);
        // Otherwise it belongs to an order that timed out and was repeated.
        let is_ordered = camera.phase != Phase::Arming;
        let mut checked = Ok(());
        let next: fn(&mut Self, Side) = match taken {
            Taken::Image(capture) => match self.triggering.with_pulse(capture) {
                Some(capture) => {
                    let next = if self.triggering.is_late(&capture) {
                        Self::order_next
                    } else {
                        Self::order
                    };
                    camera.on_image();
                    self.pairing.push(side, capture);
                    next
                }
                None => {
                    camera.on_stray();
                    self.pairing.discard(Unpaired::Unready);
                    Self::order_next
                }
            },
            Taken::Damaged => {
                checked = camera.on_damaged(now_ns, self.timeout_ns);
                self.pairing.discard(Unpaired::Damaged);
                Self::order
            }
            Taken::Unready => {
                camera.on_unready(now_ns);
                self.pairing.discard(Unpaired::Unready);
                |_, _| {}
            }
        };
        self.tally.lock().frames[side as usize] += 1;
        if is_ordered {
            next(self, side);
        }
        self.deliver_pairs(Pairing::pair)?;
        // Only now, as a camera failure must not cost a complete pair.
        checked?;
        self.pair_watchdog
            .on_image(side, now_ns, self.timeout_ns, self.pairing.unpaired)
    }

    /// After a failure of the other camera: waits for the image in progress, whose partner may
    /// already have arrived.
    fn finish_exposure(&mut self, side: Side) -> Result<()> {
        let until_ns = self.clock.now_ns().saturating_add(self.timeout_ns);
        let mut taking = self.cameras[side as usize].phase != Phase::Arming
            && self.timeout_of_ns(side).is_some();
        while taking {
            match self.reports.receive(until_ns) {
                Received::Message(CameraReport {
                    side: from,
                    event: CameraEvent::Captured(taken),
                }) if from == side => {
                    taking = taken == Taken::Unready;
                    self.handle_image(side, taken)?;
                }
                Received::Message(_) => {}
                Received::Nothing | Received::Closed => taking = false,
            }
        }
        Ok(())
    }

    /// Orders the next image of a camera. Settings change only together with the number, so that
    /// both images of a pair have the same.
    fn order(&mut self, side: Side) {
        let number = self.cameras[side as usize].order + 1;
        if number > self.planned.0 {
            self.planned = (number, self.balance.settings);
        }
        self.send_order(side, number);
    }

    fn send_order(&mut self, side: Side, number: u64) {
        self.cameras[side as usize].order = number;
        self.enter(side, Phase::Arming);
        self.orders[side as usize].send(Order::Take(self.planned.1));
    }

    /// Lets a camera capture again: the image of its order is still outstanding.
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

    fn pulse_if_due(&mut self) -> Result<()> {
        if self.both_armed() {
            let (clock, reports, tally) = (&self.clock, &self.reports, &self.tally);
            if self.triggering.pulse_if_due(clock, reports, tally)? {
                Side::BOTH
                    .into_iter()
                    .for_each(|side| self.enter(side, Phase::Exposing));
            }
        }
        Ok(())
    }

    /// Time of the next pulse or timeout.
    fn deadline_ns(&self) -> u64 {
        let timeouts = Side::BOTH
            .into_iter()
            .filter_map(|side| self.timeout_at_ns(side));
        timeouts
            .chain(self.triggering.due_ns().filter(|_| self.both_armed()))
            .min()
            .unwrap_or(u64::MAX)
    }

    fn timeout_at_ns(&self, side: Side) -> Option<u64> {
        Some(
            self.cameras[side as usize]
                .since_ns
                .saturating_add(self.timeout_of_ns(side)?),
        )
    }

    /// Timeout of a camera in its state; `None` if it is armed and waits for the other camera.
    fn timeout_of_ns(&self, side: Side) -> Option<u64> {
        let needed_ns = match self.cameras[side as usize].phase {
            Phase::Arming => 0,
            Phase::Armed => self.triggering.independent_period_ns()?,
            Phase::Exposing => u64::from(self.planned.1.shutter_us) * 1000,
        };
        Some(needed_ns.saturating_add(self.timeout_ns))
    }

    fn check_timeouts(&mut self) -> Result<()> {
        let now_ns = self.clock.now_ns();
        for side in Side::BOTH {
            let Some(timeout_of_ns) = self.timeout_of_ns(side) else {
                continue;
            };
            let camera = &mut self.cameras[side as usize];
            if now_ns < camera.since_ns.saturating_add(timeout_of_ns) {
                continue;
            }
            camera.on_timeout(timeout_of_ns)?;
            match camera.phase {
                // It still has its order: a second one would only make it start over.
                Phase::Arming => camera.enter(Phase::Arming, now_ns),
                // The pulse was lost: the camera joins the other camera's current order.
                Phase::Armed | Phase::Exposing => self.send_order(side, self.planned.0),
            }
        }
        Ok(())
    }

    fn deliver_pairs(&mut self, next: fn(&mut Pairing) -> Option<[Capture; 2]>) -> Result<()> {
        loop {
            let pair = next(&mut self.pairing);
            self.tally.lock().unpaired = self.pairing.unpaired;
            match pair {
                Some(pair) => self.deliver(pair)?,
                None => return Ok(()),
            }
        }
    }

    fn deliver(&mut self, [left, right]: [Capture; 2]) -> Result<()> {
        self.balance
            // By the ordered settings, as the balance does not know a camera's rounding.
            .observe(&left.image, &right.image, left.ordered);
        if !left.settings.is_near(right.settings)
            && !std::mem::replace(&mut self.warned_unlike, true)
        {
            let [a, b] = &self.cameras;
            let (ordered, a, b, right) = (left.ordered, &a.name, &b.name, right.settings);
            tracing::warn!(
                "ordered {ordered}: {a} uses {}, {b} {right}; the two expose differently",
                left.settings
            );
        }
        let skew_ns = right.stamp_ns.wrapping_sub(left.stamp_ns) as i64;
        let mut tally = self.tally.lock();
        // Saturates at an hour.
        tally.skew_ns.saturating_record(skew_ns.unsigned_abs());
        let (sequence, drops) = (tally.pairs, tally.drops());
        // The drops of a frame are those before it, so they are read before it is pushed.
        tally.pairs += 1;
        drop(tally);
        let rectified = |rig| Geometry::Rectified(Some(rig));
        let geometry = self.rig.map_or(Geometry::Raw, rectified);
        let frame = Frame {
            sequence,
            stamp_ns: left.stamp_ns,
            exposure: Exposure {
                // Without a trigger there is no pulse: the number of the pair is used instead.
                trigger_id: left.trigger_id.unwrap_or(sequence),
                skew_ns: Some(skew_ns),
                shutter_us: left.settings.shutter_us,
                gain_mdb: left.settings.gain_mdb,
                drops,
            },
            ..Frame::new(StereoPair::new(left.image, right.image)?, geometry)
        };
        // This may wait for the writer (backpressure), and meanwhile nothing is triggered. The
        // watchdog is reset afterwards, or the wait would count as time without a pair.
        let pushed = self.queue.push(frame);
        self.pair_watchdog.on_pair(self.pairing.unpaired);
        let mut tally = self.tally.lock();
        match pushed {
            Pushed::Taken => {}
            Pushed::Late => tally.waited += 1,
            Pushed::Dropped | Pushed::Replaced => tally.dropped += 1,
            Pushed::Abandoned => tally.unread += 1,
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::pairing::Rule;
    use super::super::queue::WhenFull;
    use super::super::{Limits, Policy};
    use super::*;
    use svl_core::stereo::Gray;

    #[test]
    fn images_taken_before_the_end_are_in_a_pair_or_counted() {
        let clock = GrabClock::scripted();
        let settings = Settings::new(100, 0);
        let limits = Limits::new(100..=100, 0..=0);
        let (reports, tally) = (Mailbox::new(&clock), Arc::<Mutex<Tally>>::default());
        let queue = Arc::new(Queue::new(1, WhenFull::Drop));
        let coordinator = Coordinator {
            orders: [Mailbox::new(&clock), Mailbox::new(&clock)],
            reports: reports.clone(),
            triggering: Policy::FreeRunning { period_ns: 1 }.into(),
            pairing: Pairing::new(Rule::Arrival),
            pair_watchdog: PairWatchdog::default(),
            balance: Balance::new(limits, settings, 1),
            queue: queue.clone(),
            tally: tally.clone(),
            rig: None,
            timeout_ns: 1,
            cameras: Side::BOTH.map(|side| CameraState::new(side, String::new())),
            planned: (0, settings),
            warned_unlike: false,
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
            reports.send(CameraReport {
                side,
                event: CameraEvent::Captured(taken),
            });
        }
        reports.close();
        coordinator.run();
        assert!(queue.pop().unwrap().is_some());
        let tally = tally.lock();
        assert_eq!((tally.frames, tally.pairs), ([2, 2], 1));
        assert_eq!(tally.unpaired.iter().sum::<u64>(), 2);
    }
}
