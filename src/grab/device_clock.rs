//! Converts stamps of a camera's clock to the host's clock.

/// Offset of a camera's clock, estimated from the arrival of its images.
///
/// A camera counts from an epoch of its own, and its crystal is off by some parts per million. On
/// arrival, host time minus camera time is the offset plus the transfer latency, which is never
/// negative: so the smallest difference is the best estimate. It may grow slowly, to follow a
/// camera whose clock is slow. The remaining error is the smallest latency, about 0.1 ms, the same
/// for two cameras of one kind.
#[derive(Clone, Debug, Default)]
pub struct DeviceClock {
    /// Host minus camera time, and the host's time when it was last estimated, nanoseconds.
    offset: Option<(i128, u64)>,
}

/// Fraction of the elapsed time by which the offset may grow: 1/5000 = 200 ppm, twice what two bad
/// crystals drift.
const DRIFT: i128 = 5_000;
/// A larger jump cannot be latency: the camera was reset.
const RESET_NS: i128 = 1_000_000_000;

impl DeviceClock {
    /// The host's time at `device_ns` of the camera's clock. `arrived_ns`: host time when the image
    /// that carries this stamp arrived.
    pub fn host_ns(&mut self, device_ns: u64, arrived_ns: u64) -> u64 {
        let seen = i128::from(arrived_ns) - i128::from(device_ns);
        let offset = match self.offset {
            Some((before, at_ns)) => {
                // A larger difference is latency of this image, not drift: it must not move the
                // offset.
                let most = before + i128::from(arrived_ns.saturating_sub(at_ns)) / DRIFT;
                if seen > most + RESET_NS {
                    seen
                } else {
                    seen.min(most)
                }
            }
            None => seen,
        };
        self.offset = Some((offset, arrived_ns));
        // In 128 bits and clamped: a faulty camera may report any number.
        (i128::from(device_ns) + offset).clamp(0, u64::MAX.into()) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    /// The largest error after a settling time of one second, over a minute of 30 images a second
    /// with a latency of 0.1 ms and up to `late_ms` more.
    fn worst_ns(epoch_ns: u64, drift_ppm: f64, late_ms: f64) -> u64 {
        let (mut clock, mut random) = (DeviceClock::default(), fastrand::Rng::with_seed(5));
        let errors = (0..1800).map(|i| {
            let host_ns = 1_700_000_000_000 * MS + i * 33 * MS;
            let device_ns = epoch_ns + ((i * 33 * MS) as f64 * (1.0 + drift_ppm * 1e-6)) as u64;
            let late_ns = (late_ms * random.f64() * MS as f64) as u64;
            clock
                .host_ns(device_ns, host_ns + MS / 10 + late_ns)
                .abs_diff(host_ns)
        });
        errors.skip(30).max().unwrap()
    }

    #[test]
    fn stamps_of_any_epoch_and_drift_are_taken_to_the_hosts() {
        for epoch_ns in [0, 77 * MS, u64::MAX / 2] {
            for drift_ppm in [-100.0, 0.0, 100.0] {
                assert!(worst_ns(epoch_ns, drift_ppm, 0.0) <= MS / 10 + 1000);
                assert!(
                    worst_ns(epoch_ns, drift_ppm, 2.0) < MS,
                    "{epoch_ns} {drift_ppm}"
                );
            }
        }
    }

    #[test]
    fn one_late_image_moves_no_stamp_and_a_reset_is_noticed() {
        let mut clock = DeviceClock::default();
        assert_eq!(clock.host_ns(0, 1000 * MS), 1000 * MS);
        let late = clock.host_ns(10 * MS, 1050 * MS);
        assert_eq!(late, 1010 * MS + 10_000, "200 ppm of 50 ms");
        assert_eq!(
            clock.host_ns(5, 9000 * MS),
            9000 * MS,
            "it counts from 0 again"
        );
        assert_eq!(
            clock.host_ns(u64::MAX, 9000 * MS),
            9000 * MS,
            "nonsense does no harm"
        );
    }
}
