//! Triggers of both cameras: sources of pulses, and their timing.

use std::ops::RangeInclusive;
use std::str::FromStr;
use svl_core::{Error, Result};

/// A pulse on both cameras' trigger lines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pulse {
    /// Number of the pulse.
    pub id: u64,
    /// The host's time just before the pulse was requested. The lines rise later by the latency of
    /// the path to the cameras; with the trigger controller, one byte over USB.
    pub stamp_ns: u64,
}

/// Raises the trigger lines of both cameras at once.
pub trait Trigger: Send {
    /// Sends one pulse.
    ///
    /// # Errors
    /// [`crate::CameraError`] if none was sent, or if that is unknown.
    fn pulse(&mut self) -> Result<Pulse>;
}

/// Rule for the times at which the cameras expose.
pub enum Policy {
    /// When both are armed, with at least a period from pulse to pulse: a slow camera slows the
    /// rate and never shifts the phase (thesis, figure 4.3).
    Coordinated {
        trigger: Box<dyn Trigger>,
        period_ns: u64,
    },
    /// At a fixed rate, armed or not: a late camera misses its pulse (thesis, figure 4.2).
    FixedRate {
        trigger: Box<dyn Trigger>,
        period_ns: u64,
    },
    /// Free-running: each camera on its own clock.
    FreeRunning { period_ns: u64 },
}

/// Source of pulses, as a user chooses it: `software`, `serial:DEVICE`, `fixed:HZ`, `free`.
#[derive(Clone, Debug, PartialEq)]
pub enum TriggerSource {
    /// The driver's own trigger, when both cameras are armed.
    Software,
    /// The trigger controller at this serial port, when both cameras are armed.
    Serial(String),
    /// The driver's own trigger, at this rate.
    FixedRate(f64),
    /// None: the cameras are free-running.
    FreeRunning,
}

/// Range of the rate, pairs per second.
pub const RATES_HZ: RangeInclusive<f64> = 0.1..=1000.0;

impl FromStr for TriggerSource {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let expected = |what: String| Error::Usage(format!("expected {what}"));
        match text.split_once(':') {
            None if text == "software" => Ok(Self::Software),
            None if text == "free" => Ok(Self::FreeRunning),
            Some(("serial", device)) if !device.is_empty() => Ok(Self::Serial(device.to_owned())),
            Some(("fixed", hz)) => match hz.parse() {
                Ok(hz) if RATES_HZ.contains(&hz) => Ok(Self::FixedRate(hz)),
                _ => Err(expected(format!(
                    "fixed:HZ, {} to {}",
                    RATES_HZ.start(),
                    RATES_HZ.end()
                ))),
            },
            _ => Err(expected(
                "software, serial:DEVICE, fixed:HZ or free".to_owned(),
            )),
        }
    }
}
