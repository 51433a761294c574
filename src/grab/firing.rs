//! How the policy of firing stands.

use super::camera::{Capture, Settings};
use super::pulser::Pulser;
use super::tally::Tally;
use super::trigger::{Policy, Pulse, Trigger};
use super::watch::PATIENCE;
use crate::error::Result;
use std::collections::VecDeque;
use std::sync::{Mutex, PoisonError};

/// A policy in motion.
pub(super) enum Firing {
    WhenArmed {
        trigger: Box<dyn Trigger>,
        period_ns: u64,
        due_ns: u64,
        /// The latest, the last one last.
        pulses: VecDeque<Pulse>,
    },
    /// A trigger that begins once both cameras have been armed.
    FixedRate {
        trigger: Box<dyn Trigger>,
        period_ns: u64,
    },
    /// Something else fires: a pulser, or the cameras themselves.
    Elsewhere {
        period_ns: u64,
        _pulser: Option<Pulser>,
    },
}

/// Times of a camera and of a pulse that are one may be so far apart: clocks are brought together
/// to less.
const SAME_NS: u64 = 1_000_000;
/// Pulses whose images may still come: who is slower than that is given up.
const PULSES: usize = PATIENCE as usize + 1;

impl From<Policy> for Firing {
    fn from(policy: Policy) -> Self {
        match policy {
            Policy::Coordinated { trigger, period_ns } => Self::WhenArmed {
                trigger,
                period_ns,
                due_ns: 0,
                pulses: VecDeque::new(),
            },
            Policy::FixedRate { trigger, period_ns } => Self::FixedRate { trigger, period_ns },
            Policy::FreeRunning { period_ns } => Self::Elsewhere {
                period_ns,
                _pulser: None,
            },
        }
    }
}

impl Firing {
    /// Fires, if that is due, two cameras that are armed; whether it did. `begin` starts a trigger
    /// of fixed rate.
    ///
    /// # Errors
    /// The trigger's.
    pub(super) fn fire_if_due(
        &mut self,
        now_ns: u64,
        tally: &Mutex<Tally>,
        begin: impl FnOnce(Box<dyn Trigger>, u64) -> Pulser,
    ) -> Result<bool> {
        match self {
            Self::WhenArmed {
                trigger,
                period_ns,
                due_ns,
                pulses,
            } if now_ns >= *due_ns => {
                // The rate is kept to on average: a pulse that is late makes up for up to one
                // period.
                let was_due_ns = if pulses.is_empty() { now_ns } else { *due_ns };
                *due_ns = was_due_ns
                    .max(now_ns.saturating_sub(*period_ns))
                    .saturating_add(*period_ns);
                let pulse = trigger.pulse()?;
                let strays = pulses
                    .back()
                    .map_or(0, |last| pulse.id.saturating_sub(last.id + 1));
                pulses.push_back(pulse);
                if pulses.len() > PULSES {
                    pulses.pop_front();
                }
                let mut tally = tally.lock().unwrap_or_else(PoisonError::into_inner);
                tally.pulses += 1;
                tally.stray_pulses += strays;
                Ok(true)
            }
            Self::FixedRate { period_ns, .. } => {
                let period_ns = *period_ns;
                let fixed = std::mem::replace(
                    self,
                    Self::Elsewhere {
                        period_ns,
                        _pulser: None,
                    },
                );
                if let Self::FixedRate { trigger, .. } = fixed {
                    *self = Self::Elsewhere {
                        period_ns,
                        _pulser: Some(begin(trigger, period_ns)),
                    };
                }
                Ok(false)
            }
            Self::WhenArmed { .. } | Self::Elsewhere { .. } => Ok(false),
        }
    }

    /// When two cameras that are armed are to be fired.
    pub(super) fn due_ns(&self) -> Option<u64> {
        match self {
            Self::WhenArmed { due_ns, .. } => Some(*due_ns),
            _ => None,
        }
    }

    /// From one exposure to the next of cameras that this does not fire itself.
    pub(super) fn elsewhere_ns(&self) -> Option<u64> {
        match self {
            Self::Elsewhere { period_ns, .. } => Some(*period_ns),
            _ => None,
        }
    }

    /// Ends it.
    pub(super) fn end(&mut self) {
        *self = Self::Elsewhere {
            period_ns: 0,
            _pulser: None,
        };
    }

    /// Writes the pulse into an image whose camera does not know it. Both were armed when it rose,
    /// so an image that is in time is of the last one; one that began before that is of a pulse
    /// that had been given up. Nothing when it is of none.
    pub(super) fn with_pulse(&self, mut capture: Capture) -> Option<Capture> {
        if let (Self::WhenArmed { pulses, .. }, None) = (self, capture.trigger_id) {
            let Settings { shutter_us, .. } = capture.settings;
            let began_ns = capture.stamp_ns.saturating_sub(u64::from(shutter_us) * 500);
            let before = |pulse: &&Pulse| pulse.stamp_ns <= began_ns.saturating_add(SAME_NS);
            capture.trigger_id = Some(pulses.iter().rfind(before)?.id);
        }
        Some(capture)
    }

    /// Whether an image is of a pulse before the last, so that another one is still to come.
    pub(super) fn is_late(&self, capture: &Capture) -> bool {
        match self {
            Self::WhenArmed { pulses, .. } => pulses
                .back()
                .is_some_and(|last| capture.trigger_id < Some(last.id)),
            _ => false,
        }
    }
}
