//! One camera's acquisition thread.

use super::camera::{Camera, Settings, Side, Taken};
use super::mailbox::{Mailbox, Received};
use crate::error::Error;
use std::time::Duration;

/// "Take one image": the coordinator to a camera's thread.
pub(super) struct Order {
    /// Later than the one before, which it replaces.
    pub(super) number: u64,
    pub(super) settings: Settings,
}

/// What a camera's thread tells the coordinator.
pub(super) struct Report {
    pub(super) side: Side,
    /// Of the order that it answers.
    pub(super) number: u64,
    pub(super) event: Event,
}

pub(super) enum Event {
    /// A trigger now exposes.
    Armed,
    Captured(Taken),
    Failed(Error),
}

/// How long a camera waits for its trigger before it looks whether there is a new order.
const SLICE: Duration = Duration::from_millis(100);

/// Follows orders until there are no more, or the camera fails.
pub(super) fn acquire(side: Side, mut camera: Box<dyn Camera>, orders: &Mailbox<Order>, reports: &Mailbox<Report>) {
    let mut next = orders.receive(u64::MAX);
    while let Received::Message(Order { number, settings }) = next {
        let report = |event| reports.send(Report { side, number, event });
        let armed = camera.arm(settings).map(|()| report(Event::Armed));
        let captured = armed.and_then(|()| {
            loop {
                match (camera.capture(SLICE)?, orders.receive(0)) {
                    (None, Received::Nothing) => {}
                    (captured, waiting) => return Ok((captured, waiting)),
                }
            }
        });
        next = match captured {
            Ok((captured, waiting)) => {
                captured.into_iter().for_each(|taken| report(Event::Captured(taken)));
                if matches!(waiting, Received::Nothing) { orders.receive(u64::MAX) } else { waiting }
            }
            Err(error) => return report(Event::Failed(side.blame(error))),
        };
    }
}
