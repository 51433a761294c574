//! The cable from a simulated trigger to two simulated cameras.

use crate::error::Result;
use crate::grab::camera::Side;
use crate::grab::clock::Clock;
use crate::grab::trigger::{Pulse, Trigger};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Two trigger lines. A pulse reaches the cameras that are armed; for the others it is lost, as on
/// a real cable.
pub struct Wire {
    clock: Arc<Clock>,
    lines: Mutex<[Line; 2]>,
}

#[derive(Clone, Copy, Default)]
struct Line {
    armed: bool,
    pulse: Option<Pulse>,
}

impl Wire {
    pub fn new(clock: &Arc<Clock>) -> Arc<Self> {
        Arc::new(Self {
            clock: clock.clone(),
            lines: Mutex::default(),
        })
    }

    /// Raises both lines.
    pub fn raise(&self, pulse: Pulse) {
        for line in self.lock().iter_mut().filter(|line| line.armed) {
            *line = Line {
                armed: false,
                pulse: Some(pulse),
            };
        }
        self.clock.notify();
    }

    /// From now on the next pulse exposes.
    pub(super) fn arm(&self, side: Side) {
        self.lock()[side as usize] = Line {
            armed: true,
            pulse: None,
        };
    }

    /// The pulse that came since, waiting for it.
    pub(super) fn pulse(&self, side: Side, until_ns: u64) -> Option<Pulse> {
        self.clock
            .wait_until(until_ns, || self.lock()[side as usize].pulse.take())
    }

    fn lock(&self) -> MutexGuard<'_, [Line; 2]> {
        self.lines.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A real trigger whose pulses are taken to the simulated cameras too.
pub struct Cabled {
    trigger: Box<dyn Trigger>,
    wire: Arc<Wire>,
}

impl Cabled {
    pub fn new(trigger: Box<dyn Trigger>, wire: &Arc<Wire>) -> Self {
        Self {
            trigger,
            wire: wire.clone(),
        }
    }
}

impl Trigger for Cabled {
    fn pulse(&mut self) -> Result<Pulse> {
        let pulse = self.trigger.pulse()?;
        self.wire.raise(pulse);
        Ok(pulse)
    }
}

/// A simulated trigger at the end of that cable.
pub struct SimulatedTrigger {
    wire: Arc<Wire>,
    next_id: u64,
}

impl SimulatedTrigger {
    pub fn new(wire: &Arc<Wire>) -> Self {
        Self {
            wire: wire.clone(),
            next_id: 0,
        }
    }
}

impl Trigger for SimulatedTrigger {
    fn pulse(&mut self) -> Result<Pulse> {
        let pulse = Pulse {
            id: self.next_id,
            stamp_ns: self.wire.clock.now_ns(),
        };
        self.next_id += 1;
        self.wire.raise(pulse);
        Ok(pulse)
    }
}
