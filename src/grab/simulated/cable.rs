//! Simulated trigger lines, and their triggers.

use crate::clock::GrabClock;
use crate::trigger::{Pulse, Trigger};
use parking_lot::Mutex;
use std::sync::Arc;
use svl_core::Result;
use svl_core::stereo::Side;

/// Two trigger lines. A pulse reaches the armed cameras; the others miss it, as on a real cable.
pub struct TriggerCable {
    clock: Arc<GrabClock>,
    lines: Mutex<[CableLine; 2]>,
}

#[derive(Clone, Copy, Default)]
struct CableLine {
    armed: bool,
    pulse: Option<Pulse>,
}

impl TriggerCable {
    pub fn new(clock: &Arc<GrabClock>) -> Arc<Self> {
        Arc::new(Self {
            clock: clock.clone(),
            lines: Mutex::default(),
        })
    }

    /// Raises both lines.
    pub fn raise(&self, pulse: Pulse) {
        // Nothing is queued: a camera that is not armed misses the pulse (thesis, figure 4.2).
        for line in self.lines.lock().iter_mut().filter(|line| line.armed) {
            *line = CableLine {
                armed: false,
                pulse: Some(pulse),
            };
        }
        // The lock is released by now; waiting cameras acquire it in their condition.
        self.clock.notify();
    }

    /// Arms a camera: the next pulse exposes.
    pub(super) fn arm(&self, side: Side) {
        self.lines.lock()[side as usize] = CableLine {
            armed: true,
            pulse: None,
        };
    }

    /// The first pulse since it was armed, after waiting for it.
    pub(super) fn pulse(&self, side: Side, until_ns: u64) -> Option<Pulse> {
        self.clock
            .wait_until(until_ns, || self.lines.lock()[side as usize].pulse.take())
    }
}

/// A real trigger whose pulses also reach the simulated cameras.
pub struct CabledTrigger {
    trigger: Box<dyn Trigger>,
    cable: Arc<TriggerCable>,
}

impl CabledTrigger {
    pub fn new(trigger: Box<dyn Trigger>, cable: &Arc<TriggerCable>) -> Self {
        Self {
            trigger,
            cable: cable.clone(),
        }
    }
}

impl Trigger for CabledTrigger {
    fn pulse(&mut self) -> Result<Pulse> {
        let pulse = self.trigger.pulse()?;
        self.cable.raise(pulse);
        Ok(pulse)
    }
}

/// A simulated trigger on that cable.
pub struct SimulatedTrigger {
    cable: Arc<TriggerCable>,
    next_id: u64,
}

impl SimulatedTrigger {
    pub fn new(cable: &Arc<TriggerCable>) -> Self {
        Self {
            cable: cable.clone(),
            next_id: 0,
        }
    }
}

impl Trigger for SimulatedTrigger {
    fn pulse(&mut self) -> Result<Pulse> {
        let pulse = Pulse {
            id: self.next_id,
            stamp_ns: self.cable.clock.now_ns(),
        };
        self.next_id += 1;
        self.cable.raise(pulse);
        Ok(pulse)
    }
}
