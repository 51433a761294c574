//! The calibrations of one camera by their stamps, and the one of each image.

use super::camera::{self, Calibration};
use crate::message::MessageResult;
use crate::stream::channel::Channel;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Limit on calibrations that are kept: an hour at 250 a second, 40 bytes each.
const MAX_KEPT: usize = 1_000_000;

/// Stamps that differ by no more are equal: one of the two went through a floating-point number.
const MAX_ROUNDING_NS: u64 = 1_000;

/// The calibrations of a camera. ROS publishes an image before its `camera_info`, and bags are out
/// of order, so that only the stamps say which belong together.
#[derive(Default)]
pub(crate) struct CameraTrack {
    calibrations: BTreeMap<u64, Arc<Calibration>>,
    /// Greatest stamp of an image that was given its calibration.
    given_ns: Option<u64>,
}

/// A calibration that could not be used as its stamp says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StampFault {
    /// Another calibration has the same stamp; its log time is used.
    Repeated,
    /// It came after images of its stamp had been given another one.
    Late,
}

impl StampFault {
    pub(crate) fn words(self) -> &'static str {
        match self {
            Self::Repeated => {
                "different calibrations have one stamp: the later ones are used by their log times"
            }
            Self::Late => {
                "a calibration is more than a second behind the images of its stamp, which have \
                 the one before it; `mcap sort FILE -o SORTED.mcap` helps if log times are right"
            }
        }
    }
}

impl CameraTrack {
    /// Adds a calibration by its stamp, or by its log time if another one has that stamp.
    pub(crate) fn add(
        &mut self,
        (stamp_ns, log_ns): (u64, u64),
        calibration: Calibration,
    ) -> Option<StampFault> {
        let known = self.calibrations.get(&stamp_ns);
        if known.is_some_and(|known| known.change(&calibration).is_some()) {
            self.insert(log_ns.max(stamp_ns + 1), calibration);
            return Some(StampFault::Repeated);
        }
        let is_given = self.given_ns.is_some_and(|given_ns| stamp_ns <= given_ns);
        let differs = |used: &Arc<Calibration>| used.change(&calibration).is_some();
        let is_late = is_given && self.at(stamp_ns).is_some_and(differs);
        self.insert(stamp_ns, calibration);
        is_late.then_some(StampFault::Late)
    }

    /// Checks a calibration with that stamp.
    ///
    /// # Errors
    /// The errors of [`Calibration::check_damage`] against the one before it.
    pub(crate) fn check_damage(&self, stamp_ns: u64, next: &Calibration) -> MessageResult<()> {
        self.at(stamp_ns)
            .map_or(Ok(()), |known| next.check_damage(known))
    }

    /// Notes that an image of that stamp has its calibration.
    pub(crate) fn give(&mut self, stamp_ns: u64) {
        self.given_ns = self.given_ns.max(Some(stamp_ns));
    }

    /// Adds a calibration. Equal ones share their memory, so that a change is a change of address.
    fn insert(&mut self, stamp_ns: u64, calibration: Calibration) {
        let before = self.calibrations.range(..=stamp_ns).next_back();
        let after = self.calibrations.range(stamp_ns..).next();
        let mut neighbours = before.into_iter().chain(after).map(|(_, known)| known);
        let known = neighbours.find(|known| known.change(&calibration).is_none());
        let calibration = known.cloned().unwrap_or_else(|| Arc::new(calibration));
        self.calibrations.insert(stamp_ns, calibration);
        if self.calibrations.len() > MAX_KEPT {
            self.calibrations.pop_first();
        }
    }

    /// Adds the calibration in a message, if it can be read and is not damaged.
    pub(crate) fn read(&mut self, channel: &Channel, log_time: u64, data: &[u8]) {
        if let Ok((stamp_ns, calibration)) = camera::decode(channel, log_time, data)
            && self.check_damage(stamp_ns, &calibration).is_ok()
        {
            self.add((stamp_ns, log_time), calibration);
        }
    }

    /// The calibration of an image: that of its own stamp; else the last one before it; else the
    /// first after it.
    pub(crate) fn at(&self, stamp_ns: u64) -> Option<&Arc<Calibration>> {
        let last_ns = stamp_ns.saturating_add(MAX_ROUNDING_NS);
        let before = self.calibrations.range(..=last_ns).next_back();
        let found = before.or_else(|| self.calibrations.first_key_value());
        found.map(|(_, calibration)| calibration)
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.calibrations.is_empty()
    }

    /// True if there is one of that very stamp.
    pub(crate) fn has(&self, stamp_ns: u64) -> bool {
        let first_ns = stamp_ns.saturating_sub(MAX_ROUNDING_NS);
        let last_ns = stamp_ns.saturating_add(MAX_ROUNDING_NS);
        self.calibrations.range(first_ns..=last_ns).next().is_some()
    }

    /// The first calibration.
    pub(crate) fn first(&self) -> Option<&Arc<Calibration>> {
        self.calibrations
            .first_key_value()
            .map(|(_, calibration)| calibration)
    }

    /// Stamp of the first calibration.
    pub(crate) fn first_ns(&self) -> Option<u64> {
        self.calibrations
            .first_key_value()
            .map(|(&stamp_ns, _)| stamp_ns)
    }

    /// Drops those that no image from that stamp on can have.
    pub(crate) fn forget_before(&mut self, stamp_ns: u64) {
        if let Some((&last, _)) = self.calibrations.range(..=stamp_ns).next_back()
            && self.first_ns() < Some(last)
        {
            self.calibrations = self.calibrations.split_off(&last);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::camera::calibration_of_size;
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn an_image_has_the_calibration_of_its_stamp() {
        let mut track = CameraTrack::default();
        assert!(track.at(5).is_none() && track.is_empty());
        for (stamp, width) in [(30, 3), (10, 1), (20, 2)] {
            track.insert(stamp * MS, calibration_of_size((width, 1)));
        }
        let width = |track: &CameraTrack, stamp| track.at(stamp).unwrap().size().0;
        // An image has the calibration of its stamp, the last one before it, or the first after it.
        let found = [20, 29, 30, 99, 5].map(|stamp| width(&track, stamp * MS));
        assert_eq!(found, [2, 2, 3, 3, 1]);
        assert!(track.has(20 * MS) && !track.has(21 * MS));
        // The calibration of its stamp, rounded.
        assert!(track.has(20 * MS - 300) && width(&track, 20 * MS - 300) == 2);
        assert!(!track.has(20 * MS - 2_000) && width(&track, 20 * MS - 2_000) == 1);
        assert_eq!(track.first_ns(), Some(10 * MS));
        track.forget_before(25 * MS);
        let widths = [25, 30, 5].map(|stamp| width(&track, stamp * MS));
        assert_eq!(widths, [2, 3, 2]);
        track.forget_before(1);
        assert_eq!(track.first_ns(), Some(20 * MS));
    }

    #[test]
    fn calibrations_of_one_stamp_and_late_ones_are_faults() {
        let of_width = |width| calibration_of_size((width, 1));
        let mut track = CameraTrack::default();
        let add = |track: &mut CameraTrack, stamp, log, width| {
            track.add((stamp * MS, log * MS), of_width(width))
        };
        assert_eq!(add(&mut track, 10, 10, 1), None);
        assert_eq!(add(&mut track, 10, 20, 1), None);
        assert_eq!(add(&mut track, 10, 30, 2), Some(StampFault::Repeated));
        let widths = [10, 29, 30].map(|stamp| track.at(stamp * MS).unwrap().size().0);
        assert_eq!(widths, [1, 1, 2]);
        track.give(50 * MS);
        assert_eq!(add(&mut track, 40, 90, 2), None);
        assert_eq!(add(&mut track, 45, 95, 3), Some(StampFault::Late));
    }

    #[test]
    fn equal_calibrations_are_one() {
        let mut track = CameraTrack::default();
        for (stamp, width) in [(1, 7), (2, 7), (3, 8), (0, 7)] {
            track.insert(stamp * MS, calibration_of_size((width, 1)));
        }
        let at = |stamp| track.at(stamp * MS).unwrap();
        let is_same = |a, b| Arc::ptr_eq(at(a), at(b));
        assert!(is_same(1, 2) && is_same(0, 2) && !is_same(2, 3));
    }
}
