//! A camera's own clock on the host's.

/// Takes stamps of a camera's clock to the host's clock.
///
/// A camera counts from an epoch of its own, and its crystal is some parts per million off. When an
/// image arrives, the difference of the two clocks is seen, and the time on the way besides, which
/// is never less than nothing: so the least difference is the truest. It may grow again, slowly, so
/// that a camera whose clock is slow is followed. What is left is the time of the quickest way,
/// some 0.1 ms, the same for two cameras that are alike.
#[derive(Clone, Debug, Default)]
pub struct DeviceClock {
    /// Host minus camera, and when it was last seen, nanoseconds.
    seen: Option<(i128, u64)>,
}

/// By how much of the elapsed time the difference may grow: 200 ppm, twice what two bad crystals
/// do.
const DRIFT: i128 = 5_000;
/// More than any image is late: the camera was reset.
const RESET_NS: i128 = 1_000_000_000;

impl DeviceClock {
    /// The host's time of a moment that was `device_ns` on the camera, and that the host heard of
    /// at `heard_ns`.
    pub fn host_ns(&mut self, device_ns: u64, heard_ns: u64) -> u64 {
        let now = i128::from(heard_ns) - i128::from(device_ns);
        let difference = match self.seen {
            Some((before, at_ns)) => {
                let most = before + i128::from(heard_ns.saturating_sub(at_ns)) / DRIFT;
                if now > most + RESET_NS {
                    now
                } else {
                    now.min(most)
                }
            }
            None => now,
        };
        self.seen = Some((difference, heard_ns));
        (i128::from(device_ns) + difference).clamp(0, u64::MAX.into()) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    /// The largest error after a settling time of one second, over a minute of 30 images a second
    /// whose way takes 0.1 ms and up to `late_ms` more.
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
