//! Random numbers, and rounding to grey values.

/// Random numbers of a pair, and of its run for anything that is constant in it.
pub(super) struct Chance {
    pair: fastrand::Rng,
    run: fastrand::Rng,
}

/// A grey value from a real number: rounded, and clipped like in a sensor.
pub(super) fn grey(value: f32) -> u8 {
    // The cast saturates.
    (value + 0.5) as u8
}

impl Chance {
    pub(super) fn new(run: u64, sequence: u64) -> Self {
        Self {
            pair: fastrand::Rng::with_seed(run ^ sequence),
            run: fastrand::Rng::with_seed(run ^ u64::MAX),
        }
    }

    /// A normal deviate: the sum of four uniform ones (Irwin-Hall), the same on every machine.
    pub(super) fn gaussian(&mut self) -> f32 {
        let bits = self.pair.u64(..);
        let lane = |shift: u32| ((bits >> shift) & 0xFFFF) as i32;
        let sum = lane(0) + lane(16) + lane(32) + lane(48);
        (sum - 131_070) as f32 * (1.732_050_8 / 65_536.0)
    }

    /// A position in an image, fixed for the run, in fractions of its width and height, away from
    /// the border.
    pub(super) fn place(&mut self) -> (f32, f32) {
        (0.25 + 0.5 * self.run.f32(), 0.25 + 0.5 * self.run.f32())
    }
}
