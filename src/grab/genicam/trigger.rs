//! The software trigger of two cameras.

use super::camera::GenicamCamera;
use super::device::Device;
use crate::error::Result;
use crate::grab::camera::Side;
use crate::grab::clock::Clock;
use crate::grab::trigger::{Pulse, Trigger};
use std::sync::Arc;
use std::thread;

/// Commands both cameras to expose.
///
/// Two commands are not one edge: they are sent at once by two threads, and the stamps say how far
/// apart they came.
pub struct SoftwareTrigger {
    devices: [Arc<Device>; 2],
    clock: Arc<Clock>,
    next_id: u64,
}

impl SoftwareTrigger {
    pub fn new([left, right]: &[GenicamCamera; 2], clock: &Arc<Clock>) -> Self {
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
        let (left, right) = thread::scope(|scope| {
            let right = scope.spawn(|| right.fire());
            (
                left.fire(),
                right
                    .join()
                    .unwrap_or_else(|panic| std::panic::resume_unwind(panic)),
            )
        });
        left.map_err(|e| Side::Left.blame(e))
            .and(right.map_err(|e| Side::Right.blame(e)))?;
        Ok(pulse)
    }
}
