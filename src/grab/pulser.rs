//! A trigger of fixed rate, which asks nobody whether he is ready.

use super::acquire::{Event, Report};
use super::camera::Side;
use super::clock::Clock;
use super::mailbox::{Mailbox, Received};
use super::tally::Tally;
use super::trigger::Trigger;
use std::sync::{Arc, Mutex, PoisonError};

/// A thread that fires until this is dropped.
pub(super) struct Pulser(Arc<Mailbox<()>>);

impl Pulser {
    pub(super) fn start(
        clock: &Arc<Clock>,
        mut trigger: Box<dyn Trigger>,
        period_ns: u64,
        reports: &Arc<Mailbox<Report>>,
        tally: &Arc<Mutex<Tally>>,
    ) -> Self {
        let stop = Mailbox::new(clock);
        let (pulser, clock, reports, tally) = (
            Self(stop.clone()),
            clock.clone(),
            reports.clone(),
            tally.clone(),
        );
        let participant = clock.enter();
        std::thread::spawn(move || {
            let mut due_ns = clock.now_ns();
            while stop.receive(due_ns) == Received::Nothing {
                if let Err(error) = trigger.pulse() {
                    // Whatever the side, it ends the run.
                    reports.send(Report {
                        side: Side::Left,
                        event: Event::Failed(error),
                    });
                    break;
                }
                tally.lock().unwrap_or_else(PoisonError::into_inner).pulses += 1;
                due_ns = due_ns.saturating_add(period_ns).max(clock.now_ns());
            }
            drop(participant);
        });
        pulser
    }
}

impl Drop for Pulser {
    fn drop(&mut self) {
        self.0.close();
    }
}
