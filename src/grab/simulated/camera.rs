//! A camera that is none.

use super::pictures::Pictures;
use super::sensor::{REFERENCE, Sensor};
use super::wire::Wire;
use crate::error::{Error, Result};
use crate::grab::camera::{Camera, Capture, Limits, Settings, Side, Taken};
use crate::grab::clock::Clock;
use std::sync::Arc;
use std::time::Duration;

/// How a camera takes its time, and what goes wrong with it.
#[derive(Clone, Debug, PartialEq)]
pub struct Temper {
    /// From the order until it is armed, and a random part of it besides.
    pub arm_ms: f64,
    pub jitter_ms: f64,
    /// From the end of the exposure until the image is there.
    pub transfer_ms: f64,
    /// Of a camera that runs free: when its first period begins, and by how much its clock is slow.
    pub phase_ms: f64,
    pub drift_ppm: f64,
    /// The image of this number, from 0, is damaged on its way.
    pub damage_at: Option<u64>,
    /// At the exposure of this number, from 0, it stops answering ...
    pub hang_at: Option<u64>,
    /// ... or is unplugged.
    pub disconnect_at: Option<u64>,
}

impl Default for Temper {
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

/// What fires a simulated camera.
pub enum Drive {
    Wire(Arc<Wire>),
    /// Its own clock.
    FreeRunning {
        period_ns: u64,
    },
}

/// One of two cameras before the same pictures.
pub struct SimulatedCamera {
    side: Side,
    clock: Arc<Clock>,
    drive: Drive,
    pictures: Arc<Pictures>,
    sensor: Sensor,
    temper: Temper,
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
        clock: &Arc<Clock>,
        drive: Drive,
        pictures: &Arc<Pictures>,
        light: f64,
        temper: Temper,
    ) -> Self {
        let seed = side as u64;
        Self {
            side,
            clock: clock.clone(),
            drive,
            pictures: pictures.clone(),
            sensor: Sensor::new(light, seed),
            temper,
            random: fastrand::Rng::with_seed(seed ^ 0x5EED),
            settings: REFERENCE,
            armed_ns: 0,
            exposures: 0,
        }
    }

    /// Begin of the exposure, once it is known.
    fn exposed_at(&self, until_ns: u64) -> Option<(u64, Option<u64>)> {
        match &self.drive {
            Drive::Wire(wire) => wire
                .pulse(self.side, until_ns)
                .map(|pulse| (pulse.stamp_ns, Some(pulse.id))),
            Drive::FreeRunning { period_ns } => {
                let period_ns = *period_ns as f64 * (1.0 + self.temper.drift_ppm * 1e-6);
                let phase_ns = self.temper.phase_ms * NS_PER_MS;
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
        Limits {
            shutter_us: 50..=30_000,
            gain_mdb: 0..=18_000,
        }
    }

    fn arm(&mut self, settings: Settings) -> Result<()> {
        if self
            .temper
            .disconnect_at
            .is_some_and(|at| self.exposures >= at)
        {
            return Err(Error::camera(
                self.name(),
                "disconnected; plug it in and record again",
            ));
        }
        self.settings = settings;
        let delay_ms = self.temper.arm_ms + self.temper.jitter_ms * self.random.f64();
        self.clock
            .sleep_until(self.clock.now_ns() + (delay_ms * NS_PER_MS) as u64);
        self.armed_ns = self.clock.now_ns();
        if let Drive::Wire(wire) = &self.drive {
            wire.arm(self.side);
        }
        Ok(())
    }

    fn capture(&mut self, patience: Duration) -> Result<Option<Taken>> {
        let until_ns = self
            .clock
            .now_ns()
            .saturating_add(patience.as_nanos() as u64);
        let Some((begin_ns, trigger_id)) = self.exposed_at(until_ns) else {
            return Ok(None);
        };
        if self.temper.hang_at.is_some_and(|at| self.exposures >= at) {
            self.clock.sleep_until(u64::MAX);
        }
        self.exposures += 1;
        let shutter_ns = u64::from(self.settings.shutter_us) * 1000;
        self.clock
            .sleep_until(begin_ns + shutter_ns + (self.temper.transfer_ms * NS_PER_MS) as u64);
        if self
            .temper
            .damage_at
            .is_some_and(|at| self.exposures == at + 1)
        {
            return Ok(Some(Taken::Damaged));
        }
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
