//! A fast sensor model: exposes a noise-free picture with shutter, gain and noise.

use crate::camera::Settings;
use svl_core::Result;
use svl_core::stereo::Gray;

/// Settings of the rendered pictures, before a sensor re-exposes them.
pub(super) const REFERENCE: Settings = Settings::new(8_000, 0);

/// Photoelectrons at grey value 255 and 0 dB, and the standard deviation of the read noise: those
/// of the arena's cameras.
const FULL_SCALE_E: f32 = 9_000.0;
const READ_NOISE_E: f32 = 25.0;

/// Size of the noise table; each image row uses a random section of it.
const NOISE: usize = 1 << 17;

/// The sensor of a camera in a world of a given brightness.
pub(super) struct Sensor {
    light: f64,
    random: fastrand::Rng,
    noise: Vec<f32>,
}

impl Sensor {
    /// `light`: 1 as in the arena.
    pub(super) fn new(light: f64, seed: u64) -> Self {
        let mut random = fastrand::Rng::with_seed(seed);
        // Nearly normal: the sum of four uniform deviates, scaled by √3 to unit variance.
        let noise = (0..NOISE)
            .map(|_| ((0..4).map(|_| random.f32()).sum::<f32>() - 2.0) * 1.732_050_8)
            .collect();
        Self {
            light,
            random,
            noise,
        }
    }

    /// The picture as exposed with `settings`: photons, their noise, the amplifier and its noise, 8
    /// bits.
    pub(super) fn expose(&mut self, picture: &Gray, settings: Settings) -> Result<Gray> {
        let photons = self.light * f64::from(settings.shutter_us) / f64::from(REFERENCE.shutter_us);
        let gain = 10f64.powf(f64::from(settings.gain_mdb - REFERENCE.gain_mdb) / 20_000.0);
        let e_per_grey = FULL_SCALE_E / 255.0;
        // Photons of each grey value, computed once per image: two table look-ups per pixel remain.
        let means: [f32; 256] =
            std::array::from_fn(|grey| grey as f32 * e_per_grey * photons as f32);
        let grey_per_e = gain as f32 / e_per_grey;
        let exposed = means.map(|e| {
            let deviation_e = (e + READ_NOISE_E * READ_NOISE_E).sqrt();
            (e * grey_per_e + 0.5, deviation_e * grey_per_e)
        });
        let (width, height) = picture.size();
        let mut pixels = Vec::with_capacity(width * height);
        for row in picture.rows() {
            // A random section per row: drawing a deviate per pixel would be too slow for real
            // time.
            let noise = &self.noise[self.random.usize(..=NOISE - width)..][..width];
            pixels.extend(row.iter().zip(noise).map(|(&grey, noise)| {
                let (mean, deviation) = exposed[usize::from(grey)];
                // The cast saturates, like the sensor.
                (mean + deviation * noise) as u8
            }));
        }
        Gray::from_vec(width, height, pixels)
    }
}
