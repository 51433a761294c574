//! Counter-based random numbers: a pure function of the key, in any order and on any thread.

/// Scrambles 64 bits (the finalizer of splitmix64, Steele et al., OOPSLA 2014).
pub(super) fn mix(key: u64) -> u64 {
    let z = key.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// A standard normal deviate from 64 random bits: the sum of four uniform ones (Irwin-Hall), cut
/// off at 3.46 sigma.
pub(super) fn gaussian(bits: u64) -> f32 {
    let lane = |shift: u32| ((bits >> shift) & 0xFFFF) as i32;
    let sum = lane(0) + lane(16) + lane(32) + lane(48);
    // Four uniforms of 0..=65535 have the mean 2 * 65535 and the standard deviation 65536 /
    // sqrt(3).
    (sum - 131_070) as f32 * (1.732_050_8 / 65_536.0)
}

/// A stream of random numbers for construction in a fixed order.
pub(super) struct Dice(u64);

/// Purpose of a stream of random numbers; each has its own.
#[derive(Clone, Copy)]
pub(super) enum NoiseStream {
    Gait,
    Sensor,
    Floor,
    Room,
    Sheets,
    World,
    /// The layers of a frame of shapes.
    Shapes(u64),
    /// One of the sheets of forest.
    Sheet(usize),
}

impl Dice {
    pub(super) fn new(seed: u64, stream: NoiseStream) -> Self {
        let number = match stream {
            NoiseStream::Gait => 0,
            NoiseStream::Sensor => 1,
            NoiseStream::Floor => 2,
            NoiseStream::Room => 3,
            NoiseStream::Sheets => 4,
            NoiseStream::World => 1 << 32,
            NoiseStream::Shapes(frame) => (2 << 32) + frame,
            NoiseStream::Sheet(i) => 5 + i as u64,
        };
        Self(mix(mix(seed) ^ number))
    }

    pub(super) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        mix(self.0)
    }

    /// Uniform in `from..to`.
    pub(super) fn between(&mut self, from: f32, to: f32) -> f32 {
        // 24 bits, as many as the mantissa of a float holds.
        from + (to - from) * ((self.bits() >> 40) as f32 / (1u64 << 24) as f32)
    }

    /// True with the given probability.
    pub(super) fn chance(&mut self, probability: f32) -> bool {
        self.between(0.0, 1.0) < probability
    }

    /// A unit vector of the plane, every direction equally likely.
    pub(super) fn direction(&mut self) -> (f32, f32) {
        loop {
            let (x, y) = (self.between(-1.0, 1.0), self.between(-1.0, 1.0));
            let square = x * x + y * y;
            // Rejection from the square keeps directions uniform; near 0 the quotient is coarse.
            if (0.01..=1.0).contains(&square) {
                let length = square.sqrt();
                return (x / length, y / length);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaussian_has_zero_mean_and_unit_variance() {
        let n = 100_000;
        let (sum, square) = (0..n)
            .map(|i| gaussian(mix(i)) as f64)
            .fold((0.0, 0.0), |(s, q), g| (s + g, q + g * g));
        let mean = sum / n as f64;
        assert!(mean.abs() < 0.01, "{mean}");
        assert!((square / n as f64 - 1.0).abs() < 0.02, "{square}");
    }
}
