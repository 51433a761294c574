//! The acquisition thread of a camera: executes orders, and reports the camera's state.

use super::camera::{Camera, Settings, Taken, on_side};
use super::mailbox::{Mailbox, Received};
use std::time::Duration;
use svl_core::Error;
use svl_core::stereo::Side;

/// An order to a camera's thread. A later one replaces the earlier one.
pub(super) enum Order {
    /// Arm, and capture one image.
    Take(Settings),
    /// Capture another image without arming: the last one belonged to an earlier pulse.
    TakeNext,
}

/// A report of a camera's thread to the coordinator.
pub(super) struct CameraReport {
    pub(super) side: Side,
    pub(super) event: CameraEvent,
}

pub(super) enum CameraEvent {
    /// The next trigger exposes.
    Armed,
    /// Except for [`Taken::Unready`], this ends the order.
    Captured(Taken),
    Failed(Error),
}

/// Duration of one capture attempt: between attempts the thread checks for a new order.
const SLICE: Duration = Duration::from_millis(100);

/// Executes orders until there are no more, or the camera fails.
pub(super) fn acquire(
    side: Side,
    mut camera: Box<dyn Camera>,
    orders: &Mailbox<Order>,
    reports: &Mailbox<CameraReport>,
) {
    let report = |event| reports.send(CameraReport { side, event });
    let mut next = orders.receive(u64::MAX);
    while let Received::Message(order) = next {
        let armed = match order {
            Order::Take(settings) => camera.arm(settings).map(|()| report(CameraEvent::Armed)),
            Order::TakeNext => Ok(()),
        };
        let followed = armed.and_then(|()| {
            loop {
                match orders.receive(0) {
                    Received::Nothing => {}
                    // The coordinator's watchdog has abandoned this order.
                    replaced => return Ok(replaced),
                }
                match camera.capture(SLICE)? {
                    None => {}
                    Some(Taken::Unready) => report(CameraEvent::Captured(Taken::Unready)),
                    Some(taken) => {
                        report(CameraEvent::Captured(taken));
                        return Ok(orders.receive(u64::MAX));
                    }
                }
            }
        });
        next = match followed {
            Ok(next) => next,
            Err(error) => return report(CameraEvent::Failed(on_side(side, error))),
        };
    }
}
