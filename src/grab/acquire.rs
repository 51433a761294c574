//! One camera's acquisition thread.

use super::camera::{Camera, Settings, Side, Taken};
use super::mailbox::{Mailbox, Received};
use crate::error::Error;
use std::time::Duration;

/// What the coordinator asks of a camera's thread. A later one replaces the one before.
pub(super) enum Order {
    /// To take one image.
    Take(Settings),
    /// To wait for another image without being armed again: the last one was of an earlier pulse.
    TakeNext,
}

/// What a camera's thread tells the coordinator.
pub(super) struct Report {
    pub(super) side: Side,
    pub(super) event: Event,
}

pub(super) enum Event {
    /// A trigger now exposes.
    Armed,
    /// Except for [`Taken::Unready`], this ends the order.
    Captured(Taken),
    Failed(Error),
}

/// How long a camera waits for its trigger before it looks whether there is a new order.
const SLICE: Duration = Duration::from_millis(100);

/// Follows orders until there are no more, or the camera fails.
pub(super) fn acquire(
    side: Side,
    mut camera: Box<dyn Camera>,
    orders: &Mailbox<Order>,
    reports: &Mailbox<Report>,
) {
    let report = |event| reports.send(Report { side, event });
    let mut next = orders.receive(u64::MAX);
    while let Received::Message(order) = next {
        let armed = match order {
            Order::Take(settings) => camera.arm(settings).map(|()| report(Event::Armed)),
            Order::TakeNext => Ok(()),
        };
        let followed = armed.and_then(|()| {
            loop {
                match orders.receive(0) {
                    Received::Nothing => {}
                    replaced => return Ok(replaced),
                }
                match camera.capture(SLICE)? {
                    None => {}
                    Some(Taken::Unready) => report(Event::Captured(Taken::Unready)),
                    Some(taken) => {
                        report(Event::Captured(taken));
                        return Ok(orders.receive(u64::MAX));
                    }
                }
            }
        });
        next = match followed {
            Ok(next) => next,
            Err(error) => return report(Event::Failed(side.blame(error))),
        };
    }
}
