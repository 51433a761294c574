//! Exposure balance: one shutter time and one gain for both cameras, from both images.
//!
//! Two goals: a mean grey value near [`TARGET`], and few saturated pixels. Each demands an amount
//! of light, and the smaller one is used, so that neither undoes the other. A saturated image does
//! not show by how much it is too bright, so the light is reduced step by step. If a sensor has
//! coarse steps or is not linear, the light that was too much is an upper bound as long as the view
//! stays the same: so the control converges instead of oscillating.

use super::camera::{Limits, Settings};
use svl_core::stereo::Gray;

/// Target mean grey value: below the middle, as saturated pixels are lost and dark ones are not.
const TARGET: f64 = 100.0;
/// Fraction of pixels that may be brighter than [`BRIGHT`], and saturate.
const MAX_BRIGHTER: f64 = 0.02;
/// Target limit of all other pixels: with [`TOLERANCE`] it reaches up to [`SATURATED`].
const BRIGHT: f64 = 225.0;
/// Grey value from which a pixel may be saturated.
const SATURATED: f64 = 250.0;
/// Factor of light for a saturated image. From just saturated it leads into the tolerance.
const STEP_DOWN: f64 = 0.8;
/// Deviations that are not corrected, so that noise causes no changes; also the largest change in
/// brightness within the same view.
const TOLERANCE: f64 = 0.1;
/// Largest fraction of the light that was too much; a view that demands more than
/// `MAX_DEMAND_FACTOR` times that light is a different view.
const BELOW: f64 = 0.9;
const MAX_DEMAND_FACTOR: f64 = 2.0;
/// Interval of the sampled rows and columns.
const STEP: usize = 4;

/// Computes the settings of the next pairs from the brightness of the last ones.
pub struct Balance {
    limits: Limits,
    /// Settings of both cameras.
    pub settings: Settings,
    every: u32,
    since: u32,
    /// Brightness of the first pair with these settings.
    first: Option<Brightness>,
    /// The least light that was too much for this view, see [`light`].
    too_bright: Option<f64>,
}

impl Balance {
    /// Starts with `settings` and evaluates every `every`-th of the pairs that were exposed with
    /// the latest settings.
    pub fn new(limits: Limits, settings: Settings, every: u32) -> Self {
        Self {
            limits,
            settings,
            every,
            since: 0,
            first: None,
            too_bright: None,
        }
    }

    /// Processes a pair that was ordered with `settings`.
    pub fn observe(&mut self, left: &Gray, right: &Gray, settings: Settings) {
        // Pairs ordered before the last change still arrive after it, and would cause a second
        // change in the same direction: the control would overshoot.
        if settings != self.settings {
            return;
        }
        self.since += 1;
        if self.since >= self.every {
            self.since = 0;
            self.update(Brightness::measure([left, right]));
        }
    }

    fn update(&mut self, view: Brightness) {
        // The light or the scene changed: bounds learned from the earlier view no longer hold.
        if !self.first.get_or_insert(view).is_like(view) {
            (self.first, self.too_bright) = (Some(view), None);
        }
        let factor = view.correction();
        if is_small(factor) {
            return;
        }
        let light = light(self.settings);
        let mut wanted = light * factor;
        if factor < 1.0 {
            self.too_bright = Some(light);
        }
        self.too_bright = self
            .too_bright
            .filter(|too_bright| wanted <= MAX_DEMAND_FACTOR * too_bright);
        if let Some(too_bright) = self.too_bright.filter(|_| factor > 1.0) {
            // There may be no suitable light between two coarse steps of a sensor: stay below.
            wanted = wanted.min(BELOW * too_bright).max(light);
        }
        let settings = self.apply(wanted);
        if !is_small(wanted / light) && settings != self.settings {
            (self.settings, self.first) = (settings, None);
        }
    }

    /// Settings for an amount of light. The shutter is used first, as gain also amplifies noise.
    fn apply(&self, light: f64) -> Settings {
        let Limits {
            shutter_us,
            gain_mdb,
        } = &self.limits;
        // The shutter at the lowest gain; gain supplies anything beyond its limit.
        let plain = light / linear(*gain_mdb.start());
        let shutter = (plain.round().min(f64::from(u32::MAX)) as u32)
            .clamp(*shutter_us.start(), *shutter_us.end());
        let gain = if shutter < *shutter_us.end() {
            *gain_mdb.start()
        } else {
            (20_000.0 * (light / f64::from(shutter)).log10()).round() as i32
        };
        Settings::new(shutter, gain.clamp(*gain_mdb.start(), *gain_mdb.end()))
    }
}

/// The amount of light for settings: microseconds at 0 dB.
fn light(settings: Settings) -> f64 {
    f64::from(settings.shutter_us) * linear(settings.gain_mdb)
}

/// True if a change is too small to apply.
fn is_small(factor: f64) -> bool {
    (factor - 1.0).abs() <= TOLERANCE
}

fn linear(gain_mdb: i32) -> f64 {
    10f64.powf(f64::from(gain_mdb) / 20_000.0)
}

/// Brightness of a pair, both images together.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Brightness {
    mean: f64,
    /// The grey value that only a fraction [`MAX_BRIGHTER`] of the pixels exceeds.
    bright: f64,
}

impl Brightness {
    fn measure(images: [&Gray; 2]) -> Self {
        let mut counts = [0u32; 256];
        let rows = images
            .into_iter()
            .flat_map(|image| image.rows().step_by(STEP));
        rows.for_each(|row| {
            row.iter()
                .step_by(STEP)
                .for_each(|&grey| counts[usize::from(grey)] += 1)
        });
        let total = counts.iter().map(|&n| f64::from(n)).sum::<f64>().max(1.0);
        let mean = counts
            .iter()
            .enumerate()
            .map(|(grey, &n)| grey as f64 * f64::from(n))
            .sum::<f64>()
            / total;
        let mut brighter = 0.0;
        let bright = (0..256).rev().find(|&grey| {
            brighter += f64::from(counts[grey]);
            brighter > MAX_BRIGHTER * total
        });
        Self {
            // At least 1: a black image demands the greatest step, not infinitely more light.
            mean: mean.max(1.0),
            bright: bright.map_or(0.0, |grey| grey as f64).max(1.0),
        }
    }

    /// True if the view and its light are unchanged.
    fn is_like(self, other: Self) -> bool {
        let alike = |a: f64, b: f64| (a - b).abs() <= (TOLERANCE * a.max(b)).max(1.0);
        alike(self.mean, other.mean) && alike(self.bright, other.bright)
    }

    /// Correction factor of the light, 1/4 to 4.
    fn correction(self) -> f64 {
        let mean = TARGET / self.mean;
        let bright = if self.bright < SATURATED {
            BRIGHT / self.bright
        } else {
            STEP_DOWN
        };
        mean.min(bright).clamp(0.25, 4.0)
    }
}
