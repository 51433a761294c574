//! What fires the cameras, and when.

use crate::error::Result;

/// A pulse on both cameras' trigger lines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pulse {
    /// Number of the pulse.
    pub id: u64,
    /// When it was asked for, by the host's clock just before: it rose as much later as the way to
    /// the cameras takes, with the trigger controller a byte's way over USB.
    pub stamp_ns: u64,
}

/// Something that raises the trigger lines of both cameras at once.
pub trait Trigger: Send {
    /// Sends one pulse.
    ///
    /// # Errors
    /// [`crate::Error::Camera`] when none was sent, or nobody knows.
    fn fire(&mut self) -> Result<Pulse>;
}

/// When the cameras expose.
pub enum Policy {
    /// When both are armed, at most so often: a slow camera slows the rate and never shifts the
    /// phase (thesis, figure 4.3).
    Coordinated {
        trigger: Box<dyn Trigger>,
        period_ns: u64,
    },
    /// At a fixed rate, armed or not: a camera that is late misses its pulse (thesis, figure 4.2).
    FixedRate {
        trigger: Box<dyn Trigger>,
        period_ns: u64,
    },
    /// Each by its own clock, without a trigger.
    Free { period_ns: u64 },
}
