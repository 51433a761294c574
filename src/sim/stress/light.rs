//! Light and sensor: gain, exposure, noise, darkness, glare.
//!
//! Electrons are those of the arena's sensor: 9000 give 255, the read noise is 25.

use super::chance::{Chance, grey};
use svl_core::stereo::Gray;

/// Grey levels per electron.
const GREY_PER_E: f32 = 255.0 / 9000.0;
const READ_NOISE_E: f32 = 25.0;

fn each_pixel(image: &mut Gray, mut change: impl FnMut(f32) -> f32) {
    for y in 0..image.height() {
        for pixel in image.row_mut(y) {
            *pixel = grey(change(f32::from(*pixel)));
        }
    }
}

pub(super) fn gain([_, right]: &mut [Gray; 2], decibels: f64, _: &mut Chance) {
    let factor = 10f64.powf(decibels / 20.0) as f32;
    each_pixel(right, |v| v * factor);
}

pub(super) fn exposure([_, right]: &mut [Gray; 2], stops: f64, chance: &mut Chance) {
    darken(right, stops, chance);
}

pub(super) fn dark(images: &mut [Gray; 2], stops: f64, chance: &mut Chance) {
    for image in images {
        darken(image, stops, chance);
    }
}

fn darken(image: &mut Gray, stops: f64, chance: &mut Chance) {
    let share = 2f64.powf(-stops) as f32;
    each_pixel(image, |v| {
        let dark = v * share;
        // The image already contains the noise of its own light, of which that fraction remains.
        dark + ((1.0 - share) * dark * GREY_PER_E).sqrt() * chance.gaussian()
    });
}

pub(super) fn noise(images: &mut [Gray; 2], deviation: f64, chance: &mut Chance) {
    for image in images {
        each_pixel(image, |v| v + deviation as f32 * chance.gaussian());
    }
}

pub(super) fn low_light(images: &mut [Gray; 2], stops: f64, chance: &mut Chance) {
    let share = 2f64.powf(-stops) as f32;
    for image in images {
        each_pixel(image, |v| {
            let electrons = v * share / GREY_PER_E;
            let deviation = (electrons + READ_NOISE_E * READ_NOISE_E).sqrt();
            (electrons + deviation * chance.gaussian()) * GREY_PER_E / share
        });
    }
}

pub(super) fn glare([_, right]: &mut [Gray; 2], brightness: f64, chance: &mut Chance) {
    let (width, height) = right.size();
    let (px, py) = chance.place();
    let (cx, cy) = (px * width as f32, py * height as f32);
    let reach = 0.25 * width as f32;
    for y in 0..height {
        for (x, pixel) in right.row_mut(y).iter_mut().enumerate() {
            let (dx, dy) = ((x as f32 - cx) / reach, (y as f32 - cy) / reach);
            let veil = brightness as f32 * (-0.5 * (dx * dx + dy * dy)).exp();
            *pixel = grey(f32::from(*pixel) + veil);
        }
    }
}
