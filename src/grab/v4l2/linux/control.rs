//! Exposure and gain controls of a driver, and their units.

use super::abi::{
    ANALOGUE_GAIN, AUTOGAIN, EXPOSURE_ABSOLUTE, EXPOSURE_AUTO, EXPOSURE_AUTO_PRIORITY,
    EXPOSURE_MANUAL, GAIN,
};
use super::stream::{ControlRange, VideoStream};
use crate::camera::{Limits, Settings};
use rustix::io::Errno;

/// The controls that svl sets; `None` if the exposure cannot be set: such a camera keeps its
/// automatic exposure.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Controls {
    exposure: Option<ControlRange>,
    gain: Option<(u32, ControlRange)>,
}

/// Unit of V4L2_CID_EXPOSURE_ABSOLUTE.
const US_PER_UNIT: f64 = 100.0;
/// Assumed span of a gain control whose unit is unknown.
const NOMINAL_MDB: f64 = 24_000.0;

impl Controls {
    /// Turns automatic controls off.
    ///
    /// # Errors
    /// The driver's.
    pub(super) fn take(driver: &mut impl VideoStream) -> Result<Self, Errno> {
        if driver.range(EXPOSURE_ABSOLUTE).is_none() {
            return Ok(Self {
                exposure: None,
                gain: None,
            });
        }
        // Left on, they change the exposure between the two images of a pair; with auto priority
        // webcams lengthen it beyond the period and the rate falls.
        for (automatic, off) in [
            (EXPOSURE_AUTO, EXPOSURE_MANUAL),
            (EXPOSURE_AUTO_PRIORITY, 0),
            (AUTOGAIN, 0),
        ] {
            if driver.range(automatic).is_some() {
                driver.set(automatic, off)?;
            }
        }
        let gain = [GAIN, ANALOGUE_GAIN]
            .into_iter()
            .find_map(|id| Some((id, driver.range(id)?)));
        Ok(Self {
            exposure: driver.range(EXPOSURE_ABSOLUTE),
            gain,
        })
    }

    /// The limits; a shutter of 0 µs if the exposure cannot be set and is unknown.
    pub(super) fn limits(&self) -> Limits {
        let Some(exposure) = self.exposure else {
            return Limits::new(0..=0, 0..=0);
        };
        let us = |units: i32| (f64::from(units.max(1)) * US_PER_UNIT) as u32;
        let greatest_mdb = self
            .gain
            .map_or(0, |(_, range)| range.mdb(range.max).round() as i32);
        Limits {
            // A minimum of 0 units is replaced: the balance divides by the shutter time.
            shutter_us: us(exposure.min)..=us(exposure.max),
            gain_mdb: 0..=greatest_mdb,
        }
    }

    /// Sets shutter and gain to the nearest values and returns those.
    ///
    /// # Errors
    /// The driver's.
    pub(super) fn apply(
        &self,
        settings: Settings,
        driver: &mut impl VideoStream,
    ) -> Result<Settings, Errno> {
        let Some(exposure) = self.exposure else {
            return Ok(Settings::new(0, 0));
        };
        let units = exposure.nearest(f64::from(settings.shutter_us) / US_PER_UNIT);
        let units = driver.set(EXPOSURE_ABSOLUTE, units)?;
        let gain_mdb = match self.gain {
            Some((id, range)) => range
                .mdb(driver.set(id, range.value_at(f64::from(settings.gain_mdb)))?)
                .round() as i32,
            None => 0,
        };
        Ok(Settings {
            shutter_us: (f64::from(units.max(0)) * US_PER_UNIT) as u32,
            gain_mdb,
        })
    }
}

impl ControlRange {
    fn nearest(&self, value: f64) -> i32 {
        let (min, max) = (f64::from(self.min), f64::from(self.max));
        let step = f64::from(self.step.max(1));
        (min + ((value.clamp(min, max) - min) / step).round() * step).min(max) as i32
    }

    /// True if the values are multiples of the least gain, as in sensor registers (16 is 1×, 64 is
    /// 4×).
    fn is_linear(&self) -> bool {
        self.min > 0
    }

    /// Thousandths of a decibel above the least gain. V4L2 gives gain no unit: values that are not
    /// multiples are spread evenly over [`NOMINAL_MDB`].
    fn mdb(&self, value: i32) -> f64 {
        let (value, min, max) = (f64::from(value), f64::from(self.min), f64::from(self.max));
        if self.is_linear() {
            20_000.0 * (value / min).log10()
        } else {
            NOMINAL_MDB * (value - min) / (max - min)
        }
    }

    fn value_at(&self, mdb: f64) -> i32 {
        let (min, max) = (f64::from(self.min), f64::from(self.max));
        self.nearest(if self.is_linear() {
            min * 10f64.powf(mdb / 20_000.0)
        } else {
            min + (max - min) * mdb / NOMINAL_MDB
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shutters_are_in_steps_of_the_control() {
        let range = ControlRange::new(3, 2047, 4);
        assert_eq!(
            [0.0, 3.0, 4.9, 5.1, 1e9].map(|units| range.nearest(units)),
            [3, 3, 3, 7, 2047]
        );
        let controls = Controls {
            exposure: Some(range),
            gain: None,
        };
        assert_eq!(controls.limits(), Limits::new(300..=204_700, 0..=0));
        let unknown = Controls {
            exposure: None,
            gain: None,
        };
        assert_eq!(unknown.limits(), Limits::new(0..=0, 0..=0));
    }

    #[test]
    fn gain_is_in_decibels_where_the_values_say_so_and_nominal_else() {
        let linear = ControlRange::new(16, 64, 1);
        assert_eq!(linear.mdb(64).round(), 12_041.0);
        let nominal = ControlRange::new(0, 255, 1);
        assert_eq!((nominal.mdb(0), nominal.mdb(255)), (0.0, NOMINAL_MDB));
        for range in [linear, nominal] {
            for value in range.min..=range.max {
                assert_eq!(range.value_at(range.mdb(value)), value);
            }
            assert_eq!(
                (range.value_at(-9e9), range.value_at(9e9)),
                (range.min, range.max)
            );
        }
        // A control with a single value.
        let still = ControlRange::new(0, 0, 0);
        assert_eq!(still.value_at(3_000.0), 0);
    }
}
