//! Optics and transport: focus, motion, dirt and water on a lens, compression.

use super::chance::{Chance, grey};
use svl_core::stereo::Gray;
use svl_files as files;

pub(super) fn defocus([_, right]: &mut [Gray; 2], deviation: f64, _: &mut Chance) {
    *right = gaussian(right, deviation as f32);
}

pub(super) fn defocus_both(images: &mut [Gray; 2], deviation: f64, _: &mut Chance) {
    for image in images {
        *image = gaussian(image, deviation as f32);
    }
}

pub(super) fn motion_blur(images: &mut [Gray; 2], length: f64, _: &mut Chance) {
    // A box of that length: whole pixels, and a fraction of one at both ends.
    let half = 0.5 * length as f32;
    let reach = (half - 0.5).max(0.0).ceil() as usize;
    let weight = |i: usize| (half + 0.5 - i as f32).clamp(0.0, 1.0);
    let weights: Vec<_> = (0..=reach).map(weight).collect();
    for image in images {
        *image = along_rows(image, &weights);
    }
}

pub(super) fn dirt([_, right]: &mut [Gray; 2], percent: f64, chance: &mut Chance) {
    let covered = spot(right, percent, chance);
    for y in 0..right.height() {
        for (x, pixel) in right.row_mut(y).iter_mut().enumerate() {
            *pixel = grey(f32::from(*pixel) * (1.0 - 0.8 * covered(x, y)));
        }
    }
}

pub(super) fn drop_of_water([_, right]: &mut [Gray; 2], percent: f64, chance: &mut Chance) {
    let deviation = percent as f32 / 100.0 * right.width() as f32 / 40.0;
    let blurred = gaussian(right, deviation);
    let covered = spot(right, percent, chance);
    for y in 0..right.height() {
        for (x, pixel) in right.row_mut(y).iter_mut().enumerate() {
            let (sharp, soft) = (f32::from(*pixel), f32::from(blurred.get(x, y)));
            *pixel = grey(sharp + covered(x, y) * (soft - sharp));
        }
    }
}

pub(super) fn jpeg(images: &mut [Gray; 2], compression: f64, _: &mut Chance) {
    let quality = (100.0 - compression).clamp(1.0, 100.0) as u8;
    for image in images {
        // An image that was just encoded can be decoded.
        if let Ok(decoded) = files::through_jpeg(image, quality) {
            *image = decoded;
        }
    }
}

/// Coverage of a pixel by a round spot whose diameter is a fraction of the width.
fn spot(image: &Gray, percent: f64, chance: &mut Chance) -> impl Fn(usize, usize) -> f32 + use<> {
    let (width, height) = image.size();
    let (px, py) = chance.place();
    let (cx, cy) = (px * width as f32, py * height as f32);
    let radius = 0.5 * percent as f32 / 100.0 * width as f32;
    let soft = 0.4 * radius;
    move |x, y| {
        let distance = ((x as f32 - cx).powi(2) + (y as f32 - cy).powi(2)).sqrt();
        if radius > 0.0 {
            ((radius + 0.5 * soft - distance) / soft).clamp(0.0, 1.0)
        } else {
            0.0
        }
    }
}

fn gaussian(image: &Gray, deviation: f32) -> Gray {
    if deviation <= 0.0 {
        return image.clone();
    }
    let reach = (3.0 * deviation).ceil() as usize;
    let weight = |i: usize| (-0.5 * (i as f32 / deviation).powi(2)).exp();
    let weights: Vec<_> = (0..=reach).map(weight).collect();
    // Columns as rows of the transposed image.
    transposed(&along_rows(
        &transposed(&along_rows(image, &weights)),
        &weights,
    ))
}

fn transposed(image: &Gray) -> Gray {
    let (width, height) = image.size();
    // The number of pixels is unchanged.
    Gray::from_fn(height, width, |x, y| image.get(y, x)).expect("the size of an image")
}

/// Each row convolved with the symmetric weights, `weights[i]` for the pixels `i` away; the border
/// is replicated.
fn along_rows(image: &Gray, weights: &[f32]) -> Gray {
    let sum = weights[0] + 2.0 * weights[1..].iter().sum::<f32>();
    let mut blurred = image.clone();
    let last = image.width() - 1;
    for y in 0..image.height() {
        let row = image.row(y);
        for (x, pixel) in blurred.row_mut(y).iter_mut().enumerate() {
            let mut value = weights[0] * f32::from(row[x]);
            for (i, weight) in weights.iter().enumerate().skip(1) {
                let (left, right) = (row[x.saturating_sub(i)], row[(x + i).min(last)]);
                value += weight * (f32::from(left) + f32::from(right));
            }
            *pixel = grey(value / sum);
        }
    }
    blurred
}
