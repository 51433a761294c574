//! Exposure balance: one shutter time and one gain for both cameras, from what both see.

use super::camera::{Limits, Settings};
use crate::stereo::Gray;

/// Mean grey value that is aimed at: below the middle, since what is too bright is lost and what is dark is not.
const TARGET: f64 = 100.0;
/// Deviations from the target that are let be, so that noise does not keep it busy.
const TOLERANCE: f64 = 0.1;
/// Share of pixels that may be at the upper end of the scale.
const MAX_SATURATED: f64 = 0.02;
/// What a pixel at the upper end counts as.
const SATURATED: usize = 250;
/// Only every so many-th pixel of a row, and row, is looked at.
const STEP: usize = 4;

/// Watches pairs and says what the next ones are to be exposed with.
pub struct Balance {
    limits: Limits,
    settings: Settings,
    every: u32,
    since: u32,
}

impl Balance {
    /// Begins with `settings`; looks at every `every`-th of the pairs that were taken with what it last said.
    pub fn new(limits: Limits, settings: Settings, every: u32) -> Self {
        Self { limits, settings, every, since: 0 }
    }

    /// What both cameras are to be set to.
    pub fn settings(&self) -> Settings {
        self.settings
    }

    /// Looks at a pair, exposed with `settings`.
    pub fn observe(&mut self, left: &Gray, right: &Gray, settings: Settings) {
        // What was exposed before the last change says nothing about it.
        if settings != self.settings {
            return;
        }
        self.since += 1;
        if self.since >= self.every {
            self.since = 0;
            self.settings = self.apply(light(settings) * correction(&histogram([left, right])));
        }
    }

    /// The shutter does it, and the gain only what the shutter cannot: gain amplifies noise too.
    fn apply(&self, light: f64) -> Settings {
        let Limits { shutter_us, gain_mdb } = &self.limits;
        let plain = light / linear(*gain_mdb.start());
        let shutter = (plain.round().min(f64::from(u32::MAX)) as u32).clamp(*shutter_us.start(), *shutter_us.end());
        let gain = (20_000.0 * (light / f64::from(shutter)).log10()).round();
        Settings { shutter_us: shutter, gain_mdb: (gain as i32).clamp(*gain_mdb.start(), *gain_mdb.end()) }
    }
}

/// How much light settings make of: microseconds at 0 dB.
fn light(settings: Settings) -> f64 {
    f64::from(settings.shutter_us) * linear(settings.gain_mdb)
}

fn linear(gain_mdb: i32) -> f64 {
    10f64.powf(f64::from(gain_mdb) / 20_000.0)
}

fn histogram(images: [&Gray; 2]) -> [u32; 256] {
    let mut counts = [0; 256];
    let rows = images.into_iter().flat_map(|image| image.rows().step_by(STEP));
    rows.for_each(|row| row.iter().step_by(STEP).for_each(|&grey| counts[usize::from(grey)] += 1));
    counts
}

/// By what to multiply the light: 1 when all is well, never more than fourfold at once.
fn correction(histogram: &[u32; 256]) -> f64 {
    let total = histogram.iter().map(|&n| f64::from(n)).sum::<f64>().max(1.0);
    let mean = histogram.iter().enumerate().map(|(grey, &n)| grey as f64 * f64::from(n)).sum::<f64>() / total;
    let saturated = histogram[SATURATED..].iter().map(|&n| f64::from(n)).sum::<f64>() / total;
    let factor = (TARGET / mean.max(1.0)).clamp(0.25, 4.0);
    if saturated > MAX_SATURATED {
        // The mean says less than the truth of what is cut off. Beyond the target it must not grow.
        return factor.min(0.8);
    }
    if (factor - 1.0).abs() <= TOLERANCE { 1.0 } else { factor }
}
