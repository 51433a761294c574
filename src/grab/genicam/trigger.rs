//! The software trigger of two cameras.

use super::camera::GenicamCamera;
use super::device::GenicamDevice;
use crate::camera::on_side;
use crate::clock::GrabClock;
use crate::trigger::{Pulse, Trigger};
use std::sync::Arc;
use std::thread;
use svl_core::Result;
use svl_core::stereo::Side;

/// Commands both cameras to expose.
///
/// Two commands do not make one edge: two threads send them at the same time, and the stamps show
/// the skew.
pub struct SoftwareTrigger {
    devices: [Arc<GenicamDevice>; 2],
    clock: Arc<GrabClock>,
    next_id: u64,
}

impl SoftwareTrigger {
    pub fn new([left, right]: &[GenicamCamera; 2], clock: &Arc<GrabClock>) -> Self {
        Self {
            devices: [left.device(), right.device()],
            clock: clock.clone(),
            next_id: 0,
        }
    }
}

impl Trigger for SoftwareTrigger {
    fn pulse(&mut self) -> Result<Pulse> {
        let pulse = Pulse {
            id: self.next_id,
            stamp_ns: self.clock.now_ns(),
        };
        self.next_id += 1;
        let [left, right] = &self.devices;
        // One after the other, they would be apart by the round trip of a command, 1 ms or more.
        let (left, right) = thread::scope(|scope| {
            let right = scope.spawn(|| right.trigger());
            (
                left.trigger(),
                right
                    .join()
                    .unwrap_or_else(|panic| std::panic::resume_unwind(panic)),
            )
        });
        left.map_err(|e| on_side(Side::Left, e))
            .and(right.map_err(|e| on_side(Side::Right, e)))?;
        Ok(pulse)
    }
}
