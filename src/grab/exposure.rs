//! Exposure balance: one shutter time and one gain for both cameras, from what both see.
//!
//! Two things are wanted at once: the mean grey value near [`TARGET`], and few pixels cut off at
//! the upper end. Both ask for an amount of light, and the lesser is taken, so that neither undoes
//! what the other did. What a cut-off picture asks for is not known, so the light goes down step by
//! step until it shows. Where a sensor answers in coarse steps, or not in proportion, the light
//! that was too much is remembered and stayed below while the view stays.

use super::camera::{Limits, Settings};
use crate::stereo::Gray;

/// Mean grey value that is aimed at: below the middle, since what is too bright is lost and what is
/// dark is not.
const TARGET: f64 = 100.0;
/// Share of pixels that may be brighter than [`BRIGHT`], and be cut off.
const MAX_BRIGHTER: f64 = 0.02;
/// The grey value that all others are to be below, at most: with [`TOLERANCE`] it reaches to
/// [`SATURATED`].
const BRIGHT: f64 = 225.0;
/// From here on a pixel may be cut off.
const SATURATED: f64 = 250.0;
/// Step by which a picture that is cut off is made darker. From just cut off it leads to within the
/// tolerance.
const STEP_DOWN: f64 = 0.8;
/// Deviations that are let be, so that noise does not keep it busy, and how far a view may change
/// and be the same.
const TOLERANCE: f64 = 0.1;
/// How near it comes to light that was too much; and what asks for more than this many times that
/// light is another view.
const BELOW: f64 = 0.9;
const ANOTHER: f64 = 2.0;
/// Only every so many-th pixel of a row, and row, is looked at.
const STEP: usize = 4;

/// Watches pairs and says what the next ones are to be exposed with.
pub struct Balance {
    limits: Limits,
    settings: Settings,
    every: u32,
    since: u32,
    /// What was seen first with these settings.
    first: Option<View>,
    /// The least light that was too much for this view.
    too_bright: Option<f64>,
}

impl Balance {
    /// Begins with `settings`; looks at every `every`-th of the pairs that were taken with what it
    /// last said.
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

    /// What both cameras are to be set to.
    pub fn settings(&self) -> Settings {
        self.settings
    }

    /// Looks at a pair, for which `settings` were asked.
    pub fn observe(&mut self, left: &Gray, right: &Gray, settings: Settings) {
        // What was exposed before the last change says nothing about it.
        if settings != self.settings {
            return;
        }
        self.since += 1;
        if self.since >= self.every {
            self.since = 0;
            self.look(View::of([left, right]));
        }
    }

    fn look(&mut self, view: View) {
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
            .filter(|too_bright| wanted <= ANOTHER * too_bright);
        if let Some(too_bright) = self.too_bright.filter(|_| factor > 1.0) {
            wanted = wanted.min(BELOW * too_bright).max(light);
        }
        let settings = self.apply(wanted);
        if !is_small(wanted / light) && settings != self.settings {
            (self.settings, self.first) = (settings, None);
        }
    }

    /// The shutter does it, and the gain only what the shutter cannot: gain amplifies noise too.
    fn apply(&self, light: f64) -> Settings {
        let Limits {
            shutter_us,
            gain_mdb,
        } = &self.limits;
        let plain = light / linear(*gain_mdb.start());
        let shutter = (plain.round().min(f64::from(u32::MAX)) as u32)
            .clamp(*shutter_us.start(), *shutter_us.end());
        let gain = match shutter < *shutter_us.end() {
            true => *gain_mdb.start(),
            false => (20_000.0 * (light / f64::from(shutter)).log10()).round() as i32,
        };
        Settings {
            shutter_us: shutter,
            gain_mdb: gain.clamp(*gain_mdb.start(), *gain_mdb.end()),
        }
    }
}

/// How much light settings make of: microseconds at 0 dB.
fn light(settings: Settings) -> f64 {
    f64::from(settings.shutter_us) * linear(settings.gain_mdb)
}

/// Whether a change is let be.
fn is_small(factor: f64) -> bool {
    (factor - 1.0).abs() <= TOLERANCE
}

fn linear(gain_mdb: i32) -> f64 {
    10f64.powf(f64::from(gain_mdb) / 20_000.0)
}

/// What matters of both images.
#[derive(Clone, Copy, Debug, PartialEq)]
struct View {
    mean: f64,
    /// Only [`MAX_BRIGHTER`] are brighter.
    bright: f64,
}

impl View {
    fn of(images: [&Gray; 2]) -> Self {
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
            mean: mean.max(1.0),
            bright: bright.map_or(0.0, |grey| grey as f64).max(1.0),
        }
    }

    /// Whether the light stayed the same.
    fn is_like(self, other: Self) -> bool {
        let alike = |a: f64, b: f64| (a - b).abs() <= (TOLERANCE * a.max(b)).max(1.0);
        alike(self.mean, other.mean) && alike(self.bright, other.bright)
    }

    /// By what to multiply the light: 1 when all is well, from a quarter to four at once.
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
