//! The calibrations of a recording's cameras, and what they say of its images.

use super::camera::{self, Calibration, CalibrationChange};
use super::{Foreign, topics};
use crate::recording::messages::Channel;
use svl_core::stereo::{Geometry, Rig};

impl Foreign {
    /// True if the images are raw according to the calibration. Distortion is ignored on a
    /// rectified topic: ROS has one CameraInfo for the raw and the rectified image.
    pub(super) fn are_raw(&self) -> bool {
        let is_raw = |(topic, camera): (&String, &Option<Calibration>)| {
            !topics::is_of_rectified(topic)
                && camera.as_ref().is_some_and(Calibration::is_of_raw_camera)
        };
        self.images.iter().zip(&self.cameras).any(is_raw)
    }

    /// Raw, unless topics or calibrations mark the images as rectified.
    pub(super) fn geometry(&self) -> Geometry {
        // `image_rect` without CameraInfo: rectified, but distances are unknown.
        let named_rectified = self
            .images
            .iter()
            .all(|topic| topics::is_of_rectified(topic));
        match self.rig() {
            Ok(rig) => Geometry::Rectified(Some(rig)),
            Err(_) if named_rectified => Geometry::Rectified(None),
            Err(_) => Geometry::Raw,
        }
    }

    pub(super) fn rig(&self) -> Result<Rig, String> {
        if self.are_raw() {
            return Err("the images are not rectified".to_owned());
        }
        let [left, right] = self.both()?;
        camera::rig(left, right, self.baseline_m).map_err(|error| self.why_no_rig(error))
    }

    /// The reason why there is no rig: that of the baseline if it is missing.
    pub(super) fn why_no_rig(&self, error: String) -> String {
        match &self.frames {
            [Some(left), Some(right)] if self.lacks_baseline() => {
                self.baseline.metres(left, right).err().unwrap_or(error)
            }
            _ => error,
        }
    }

    /// The calibrations of both cameras, for images of the current size.
    pub(super) fn both(&self) -> Result<[&Calibration; 2], String> {
        match &self.cameras {
            // One topic cannot carry the projections of two cameras.
            [Some(left), Some(right)] if self.calibrations[0] != self.calibrations[1] => {
                [left, right]
                    .into_iter()
                    .try_for_each(|camera| camera.check_size(self.size))?;
                Ok([left, right])
            }
            _ => Err("it has no calibration of both cameras".to_owned()),
        }
    }

    pub(super) fn lacks_baseline(&self) -> bool {
        self.needs_baseline() && self.baseline_m.is_none()
    }

    /// True if the baseline is that of the static transforms.
    pub(super) fn needs_baseline(&self) -> bool {
        match &self.cameras {
            [Some(left), Some(right)] => left.lacks_baseline(right),
            _ => false,
        }
    }

    pub(super) fn lacks_calibration(&self) -> bool {
        self.calibrations
            .iter()
            .zip(&self.cameras)
            .any(|(topic, camera)| topic.is_some() && camera.is_none())
    }

    /// Stores the first calibration of a camera.
    pub(super) fn calibrate_first(&mut self, channel: &Channel, data: &[u8]) -> Result<(), String> {
        for (topic, camera) in self.calibrations.iter().zip(&mut self.cameras) {
            if topic.as_ref() == Some(&channel.topic) && camera.is_none() {
                *camera = Some(camera::decode(channel, data)?);
            }
        }
        Ok(())
    }

    /// Stores the next calibration of a camera, and warns of the first that differs from the
    /// previous one.
    pub(super) fn calibrate(
        &mut self,
        channel: &Channel,
        log_time: u64,
        data: &[u8],
    ) -> Result<(), String> {
        let mut change = None;
        for (topic, camera) in self.calibrations.iter().zip(&mut self.cameras) {
            if topic.as_ref() == Some(&channel.topic) {
                let next = camera::decode(channel, data)?;
                let before = camera.as_ref();
                change = change.or_else(|| before.and_then(|before| before.change(&next)));
                *camera = Some(next);
            }
        }
        if let Some(change) = change
            && !std::mem::replace(&mut self.warned_of_change, true)
        {
            self.warn_of_change(&channel.topic, log_time, &change);
        }
        Ok(())
    }

    fn warn_of_change(&self, topic: &str, log_time: u64, change: &CalibrationChange) {
        let used = if self.are_raw() {
            "all pairs are rectified by the first one"
        } else {
            "each pair uses the last one before it"
        };
        tracing::warn!(
            "{}: {topic}: the calibration changes at {:.3} s ({change}); {used}: if it is wrong, \
             --from and --to omit that part, or --calib FILE replaces it",
            self.name,
            log_time as f64 / 1e9
        );
    }
}
