//! Sensor model, from light to grey values: lens blur, motion blur, vignetting, shot and read
//! noise, gain, 8 bits.

use super::config::SensorConfig;
use super::noise::{gaussian, mix};
use super::path::Twist;
use super::render::SharpImage;
use super::view::PinholeView;
use rayon::prelude::*;
use svl_core::stereo::Gray;

/// Exposes one shot of `view`, which moves by `twist`. `key` separates the noise of one image from
/// that of every other.
///
/// Motion blur follows each pixel's own velocity on the sharp image. This is exact within a
/// surface; where a near object passes in front of a far one, the uncovered background is copied
/// from next to it. With the default speeds and shutter that is less than 2 px.
pub(super) fn expose(
    config: &SensorConfig,
    gain_db: f64,
    shot: &SharpImage,
    view: &PinholeView,
    twist: &Twist,
    key: u64,
) -> svl_core::Result<Gray> {
    let (width, height) = (shot.width, shot.radiance.len() / shot.width);
    let soft = soften(&shot.radiance, width, config.lens_blur_px as f32);
    let motion = Motion::new(twist, f64::from(config.shutter_us) * 1.0e-6, view.focal_px);
    let white_e = (config.white_e_per_ms * f64::from(config.shutter_us) * 1.0e-3) as f32;
    let grey_per_e = (255.0 / config.full_scale_e * 10f64.powf(gain_db / 20.0)) as f32;
    let read_variance = (config.read_noise_e * config.read_noise_e) as f32;
    let vignetting = config.vignetting as f32;
    let mut grey = vec![0u8; width * height];
    grey.par_chunks_exact_mut(width)
        .enumerate()
        .for_each(|(y, grey)| {
            for (x, grey) in grey.iter_mut().enumerate() {
                let i = y * width + x;
                let blur = motion.blur_px(view.slope(x as f32, y as f32), shot.hits[i].t);
                let light = smear(&soft, (width, height), (x, y), blur);
                let mean_e = light * white_e * (1.0 - vignetting * view.eccentricity(x, y));
                // Shot noise has the variance of the mean; a Gaussian approximates the Poisson
                // distribution.
                let deviation = if config.noise {
                    (mean_e + read_variance).sqrt() * gaussian(mix(key ^ i as u64))
                } else {
                    0.0
                };
                // The cast saturates at 0 and 255, like a sensor.
                *grey = ((mean_e + deviation) * grey_per_e + 0.5) as u8;
            }
        });
    Gray::from_vec(width, height, grey)
}

/// Blur by (a, 1 - 2a, a) in both directions, with a variance of 2a.
fn soften(sharp: &[f32], width: usize, sigma_px: f32) -> Vec<f32> {
    let side = 0.5 * sigma_px * sigma_px;
    let center = 1.0 - 2.0 * side;
    let height = sharp.len() / width;
    let mut soft = vec![0.0; sharp.len()];
    soft.par_chunks_exact_mut(width).enumerate().for_each_init(
        || vec![0.0; width],
        |column, (y, soft)| {
            let row = |y: usize| &sharp[y * width..][..width];
            let above = row(y.saturating_sub(1));
            let here = row(y);
            let below = row((y + 1).min(height - 1));
            for (x, value) in column.iter_mut().enumerate() {
                *value = center * here[x] + side * (above[x] + below[x]);
            }
            for (x, value) in soft.iter_mut().enumerate() {
                *value = center * column[x]
                    + side * (column[x.saturating_sub(1)] + column[(x + 1).min(width - 1)]);
            }
        },
    );
    soft
}

/// Image motion during the exposure.
struct Motion {
    linear: [f32; 3],
    angular: [f32; 3],
    focal_px: f32,
}

impl Motion {
    fn new(twist: &Twist, shutter_s: f64, focal_px: f32) -> Self {
        let over = |v: &nalgebra::Vector3<f64>| [v.x, v.y, v.z].map(|v| (v * shutter_s) as f32);
        Self {
            linear: over(&twist.linear_m_per_s),
            angular: over(&twist.angular_rad_per_s),
            focal_px,
        }
    }

    /// Displacement of a static point's image (Longuet-Higgins and Prazdny, 1980).
    fn blur_px(&self, (x, y): (f32, f32), depth_m: f32) -> (f32, f32) {
        let ([vx, vy, vz], [wx, wy, wz]) = (self.linear, self.angular);
        // Only the translational part depends on depth.
        let turn = wx * y - wy * x;
        let u = (x * vz - vx) / depth_m - (wy - wz * y - x * turn);
        let v = (y * vz - vy) / depth_m - (wz * x - wx - y * turn);
        (u * self.focal_px, v * self.focal_px)
    }
}

/// Shorter blurs are not visible.
const STILL_PX: f32 = 0.15;
/// Most samples along a blur.
const TAPS: usize = 12;

/// Positions of the samples along a blur of length 1, for each number of them.
const ALONG: [[f32; TAPS]; TAPS + 1] = {
    let mut along = [[0.0; TAPS]; TAPS + 1];
    let mut taps = 1;
    while taps <= TAPS {
        let mut tap = 0;
        while tap < taps {
            along[taps][tap] = (tap as f32 + 0.5) / taps as f32 - 0.5;
            tap += 1;
        }
        taps += 1;
    }
    along
};

/// Mean along a line with the length and direction of `blur_px` through a pixel.
fn smear(
    image: &[f32],
    (width, height): (usize, usize),
    (x, y): (usize, usize),
    blur_px: (f32, f32),
) -> f32 {
    let length = blur_px.0.abs().max(blur_px.1.abs());
    if length < STILL_PX {
        return image[y * width + x];
    }
    let taps = (length as i32 as usize + 2).min(TAPS);
    let (right, bottom) = ((width - 1) as f32, (height - 1) as f32);
    let (x, y) = (x as f32, y as f32);
    let between = |u: f32, v: f32, i: usize, next: usize, down: usize| {
        let (fu, fv) = (u - u as i32 as f32, v - v as i32 as f32);
        let low = image[i] + fu * (image[i + next] - image[i]);
        let high = image[i + down] + fu * (image[i + down + next] - image[i + down]);
        low + fv * (high - low)
    };
    let places = ALONG[taps][..taps].iter();
    let places = places.map(|along| (x + along * blur_px.0, y + along * blur_px.1));
    let reach = 0.5 * length + 1.0;
    let is_inside = x >= reach && y >= reach && x + reach < right && y + reach < bottom;
    let sum: f32 = if is_inside {
        // Casts to 32 bits are faster.
        (places.map(|(u, v)| (u, v, v as i32 as usize * width + u as i32 as usize)))
            .fold(0.0, |sum, (u, v, i)| sum + between(u, v, i, 1, width))
    } else {
        places.fold(0.0, |sum, (u, v)| {
            let (u, v) = (u.clamp(0.0, right), v.clamp(0.0, bottom));
            let (iu, iv) = (u as i32 as usize, v as i32 as usize);
            let next = usize::from(iu + 1 < width);
            let down = if iv + 1 < height { width } else { 0 };
            sum + between(u, v, iv * width + iu, next, down)
        })
    };
    sum / taps as f32
}
