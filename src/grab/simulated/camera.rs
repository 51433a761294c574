//! A simulated camera, with its delays and faults.

use super::cable::TriggerCable;
use super::pictures::RenderedPictures;
use super::sensor::{REFERENCE, Sensor};
use crate::camera::{Camera, Capture, Limits, Settings, Taken};
use crate::camera_error;
use crate::clock::GrabClock;
use std::sync::Arc;
use std::time::Duration;
use svl_core::Result;
use svl_core::stereo::Side;

/// Delays and faults of a simulated camera.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraBehavior {
    /// Time from the order until it is armed, and the largest random time added to it.
    pub arm_ms: f64,
    pub jitter_ms: f64,
    /// Time from the end of the exposure to the image.
    pub transfer_ms: f64,
    /// Free-running: start of the first period, and the excess of the period.
    pub phase_ms: f64,
    pub drift_ppm: f64,
    /// Index of the damaged image, from 0.
    pub damage_at: Option<u64>,
    /// Index of the exposure at which it hangs,
    pub hang_at: Option<u64>,
    /// or is unplugged.
    pub disconnect_at: Option<u64>,
}

impl Default for CameraBehavior {
    fn default() -> Self {
        Self {
            arm_ms: 2.0,
            jitter_ms: 0.0,
            transfer_ms: 2.0,
            phase_ms: 0.0,
            drift_ppm: 0.0,
            damage_at: None,
            hang_at: None,
            disconnect_at: None,
        }
    }
}

/// Trigger of a simulated camera.
pub enum TriggerInput {
    Cable(Arc<TriggerCable>),
    /// The camera's own clock.
    FreeRunning {
        period_ns: u64,
    },
}

/// One of two simulated cameras with the same pictures.
pub struct SimulatedCamera {
    side: Side,
    clock: Arc<GrabClock>,
    input: TriggerInput,
    pictures: Arc<RenderedPictures>,
    sensor: Sensor,
    behavior: CameraBehavior,
    random: fastrand::Rng,
    settings: Settings,
    armed_ns: u64,
    exposures: u64,
}

const NS_PER_MS: f64 = 1e6;

impl SimulatedCamera {
    /// `light`: brightness of the world, 1 as in the arena.
    pub fn new(
        side: Side,
        clock: &Arc<GrabClock>,
        input: TriggerInput,
        pictures: &Arc<RenderedPictures>,
        light: f64,
        behavior: CameraBehavior,
    ) -> Self {
        // Each camera has its own noise: with equal noise matching would be too easy.
        let seed = side as u64;
        Self {
            side,
            clock: clock.clone(),
            input,
            pictures: pictures.clone(),
            sensor: Sensor::new(light, seed),
            behavior,
            random: fastrand::Rng::with_seed(seed ^ 0x5EED),
            settings: REFERENCE,
            armed_ns: 0,
            exposures: 0,
        }
    }

    /// Start of the exposure and its pulse, if that is before `until_ns`.
    fn exposed_at(&self, until_ns: u64) -> Option<(u64, Option<u64>)> {
        match &self.input {
            TriggerInput::Cable(cable) => cable
                .pulse(self.side, until_ns)
                .map(|pulse| (pulse.stamp_ns, Some(pulse.id))),
            TriggerInput::FreeRunning { period_ns } => {
                let period_ns = *period_ns as f64 * (1.0 + self.behavior.drift_ppm * 1e-6);
                let phase_ns = self.behavior.phase_ms * NS_PER_MS;
                // The first period that begins after the camera is armed; earlier ones are not
                // captured.
                let periods = ((self.armed_ns as f64 - phase_ns) / period_ns).ceil();
                let begin_ns = ((phase_ns + periods * period_ns) as u64).max(self.armed_ns);
                self.clock.sleep_until(begin_ns.min(until_ns));
                (begin_ns <= until_ns).then_some((begin_ns, None))
            }
        }
    }
}

impl Camera for SimulatedCamera {
    fn name(&self) -> String {
        format!("sim {}", self.side.name())
    }

    fn limits(&self) -> Limits {
        Limits::new(50..=30_000, 0..=18_000)
    }

    fn arm(&mut self, settings: Settings) -> Result<()> {
        if self
            .behavior
            .disconnect_at
            .is_some_and(|at| self.exposures >= at)
        {
            return Err(camera_error(
                self.name(),
                "disconnected; plug it in and record again",
            ));
        }
        self.settings = settings;
        let delay_ms = self.behavior.arm_ms + self.behavior.jitter_ms * self.random.f64();
        self.clock
            .sleep_until(self.clock.now_ns() + (delay_ms * NS_PER_MS) as u64);
        self.armed_ns = self.clock.now_ns();
        if let TriggerInput::Cable(cable) = &self.input {
            cable.arm(self.side);
        }
        Ok(())
    }

    fn capture(&mut self, timeout: Duration) -> Result<Option<Taken>> {
        let until_ns = self
            .clock
            .now_ns()
            .saturating_add(timeout.as_nanos() as u64);
        let Some((begin_ns, trigger_id)) = self.exposed_at(until_ns) else {
            return Ok(None);
        };
        if self.behavior.hang_at.is_some_and(|at| self.exposures >= at) {
            // A hanging thread must not keep a scripted clock from advancing, so it waits on the
            // clock.
            self.clock.sleep_until(u64::MAX);
        }
        self.exposures += 1;
        let shutter_ns = u64::from(self.settings.shutter_us) * 1000;
        self.clock
            .sleep_until(begin_ns + shutter_ns + (self.behavior.transfer_ms * NS_PER_MS) as u64);
        if self
            .behavior
            .damage_at
            .is_some_and(|at| self.exposures == at + 1)
        {
            return Ok(Some(Taken::Damaged));
        }
        // The scene moves: the picture, like the stamp, belongs to the middle of the exposure.
        let stamp_ns = begin_ns + shutter_ns / 2;
        let image = self
            .sensor
            .expose(self.pictures.at(self.side, stamp_ns), self.settings)?;
        Ok(Some(Taken::Image(Capture {
            image,
            stamp_ns,
            trigger_id,
            ordered: self.settings,
            settings: self.settings,
        })))
    }
}
