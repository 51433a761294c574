//! A user's request to the grabber, resolved for the cameras of a driver.

use super::driver::Driver;
use super::pairing::Rule;
use super::queue::WhenFull;
use super::trigger::TriggerSource;
use std::time::Duration;
use svl_core::{Error, Result};
use svl_files::SideBySide;

/// Settings of the grabber. `None` means the default.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GrabRequest {
    /// [`TriggerSource::Software`] if the driver can trigger, else free-running.
    pub trigger: Option<TriggerSource>,
    /// Pairs per second: an upper limit with a trigger, exact without one. 30 unless the trigger
    /// source has its own rate.
    pub rate_hz: Option<f64>,
    /// By pulse if svl triggers and the driver knows the pulses, else by stamp.
    pub pairing: Option<PairBy>,
    /// Largest skew of a pair formed by stamp: a quarter of the period, half of it if cameras are
    /// free-running.
    pub max_skew_ns: Option<u64>,
    /// Limit on pairs that wait for the writer: 64.
    pub queue: Option<usize>,
    /// [`WhenFull::Drop`].
    pub when_full: Option<WhenFull>,
    /// See [`super::Setup::timeout`]: a second.
    pub timeout: Option<Duration>,
    /// The places of both images in those of one device.
    pub side_by_side: Option<SideBySide>,
    /// The driver's own.
    pub seed: Option<u64>,
    /// Pairs and seconds after which no more is taken: a driver prepares no more than that.
    pub pairs: Option<u64>,
    pub duration_s: Option<f64>,
}

/// Rule by which two images are a pair; [`Rule`] adds its numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PairBy {
    Pulse,
    Stamp,
    Order,
}

const RATE_HZ: f64 = 30.0;

impl GrabRequest {
    /// The trigger source for cameras of a driver.
    ///
    /// # Errors
    /// [`Error::Usage`] if the request contradicts itself, or exceeds the driver's abilities.
    pub(super) fn trigger_source(&self, driver: &Driver, source: &str) -> Result<TriggerSource> {
        let trigger = self.trigger.clone().unwrap_or(if driver.can_be_triggered {
            TriggerSource::Software
        } else {
            TriggerSource::FreeRunning
        });
        let by_command = matches!(
            trigger,
            TriggerSource::Software | TriggerSource::FixedRate(_)
        );
        let by_pulse = self.pairing == Some(PairBy::Pulse);
        let name = driver.name;
        let wrong = if by_command && !driver.can_be_triggered {
            format!(
                "svl cannot trigger {name} cameras; omit --trigger, or use serial:DEVICE if a \
                 controller triggers both"
            )
        } else if by_pulse && trigger == TriggerSource::FreeRunning {
            "free-running cameras have no pulse to be paired by; use --pairing stamp".to_owned()
        } else if by_pulse && !driver.can_be_triggered {
            format!("{name} cameras do not report the pulse of an image; use --pairing stamp")
        } else if matches!(trigger, TriggerSource::FixedRate(_)) && self.rate_hz.is_some() {
            "--trigger fixed:HZ has the rate already; omit --rate".to_owned()
        } else if self.max_skew_ns.is_some() && self.pair_by(driver, &trigger) != PairBy::Stamp {
            "--max-skew-ms is for --pairing stamp".to_owned()
        } else if self.seed.is_some() && driver.default_seed.is_none() {
            format!("{source}: its images do not depend on a seed; omit --seed")
        } else {
            return Ok(trigger);
        };
        Err(Error::Usage(wrong))
    }

    pub(super) fn rate_hz(&self, trigger: &TriggerSource) -> f64 {
        match trigger {
            TriggerSource::FixedRate(hz) => *hz,
            _ => self.rate_hz.unwrap_or(RATE_HZ),
        }
    }

    /// Pairs that are taken at most, if that is known.
    pub(super) fn most_pairs(&self, rate_hz: f64) -> Option<u64> {
        // Both ends of the duration have a pair.
        let lasting = self
            .duration_s
            .map(|seconds| (seconds * rate_hz).ceil() as u64 + 1);
        [self.pairs, lasting].into_iter().flatten().min()
    }

    /// The pairing rule for cameras that expose once in `period_ns`.
    pub(super) fn rule(&self, driver: &Driver, trigger: &TriggerSource, period_ns: u64) -> Rule {
        let default_ns = match trigger {
            // The phase of free-running cameras is arbitrary: every phase has to yield pairs.
            TriggerSource::FreeRunning => period_ns / 2,
            _ => period_ns / 4,
        };
        match self.pair_by(driver, trigger) {
            PairBy::Pulse => Rule::Trigger,
            PairBy::Order => Rule::Arrival,
            PairBy::Stamp => Rule::Stamp {
                max_skew_ns: self.max_skew_ns.unwrap_or(default_ns),
                period_ns,
            },
        }
    }

    fn pair_by(&self, driver: &Driver, trigger: &TriggerSource) -> PairBy {
        let when_armed = matches!(trigger, TriggerSource::Software | TriggerSource::Serial(_));
        self.pairing
            .unwrap_or(if when_armed && driver.can_be_triggered {
                PairBy::Pulse
            } else {
                PairBy::Stamp
            })
    }
}
