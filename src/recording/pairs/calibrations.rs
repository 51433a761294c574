//! The calibrations of a recording's cameras, and what they say of its images.

use super::pair_reader::PairReader;
use crate::cameras::camera::{Calibration, CalibrationChange};
use crate::cameras::topics::Selection;
use crate::cameras::transforms::plain;
use crate::cameras::{camera, topics};
use crate::message::{MessageError, MessageResult};
use crate::stream::channel::{Channel, warn_once};
use std::sync::Arc;
use svl_core::doubt::CalibrationCheck;
use svl_core::listed;
use svl_core::stereo::{Geometry, Rig, Side, StereoCalibration};

/// Time for which calibrations are kept for pairs out of order.
const KEPT_NS: u64 = 10_000_000_000;
/// A first calibration that is less later than the first pair is that of the same moment.
const MIN_LATE_NS: u64 = 100_000_000;

impl PairReader {
    /// True if the images are raw according to the calibration. Distortion is ignored on a
    /// rectified topic: ROS has one CameraInfo for the raw and the rectified image.
    pub(crate) fn are_raw(&self) -> bool {
        let is_raw = |(topic, camera): (&String, &Option<Arc<Calibration>>)| {
            !topics::is_of_rectified(topic)
                && camera.as_deref().is_some_and(Calibration::is_of_raw_camera)
        };
        self.images.iter().zip(&self.cameras).any(is_raw)
    }

    /// Raw, unless topics or calibrations mark the images as rectified.
    pub(crate) fn geometry(&self) -> Geometry {
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

    pub(crate) fn rig(&self) -> MessageResult<Rig> {
        if self.are_raw() {
            return Err(MessageError::Calibration("the images are not rectified"));
        }
        let [left, right] = self.both()?;
        camera::rig(left, right, self.baseline_m).map_err(|error| self.why_no_rig(error))
    }

    /// The reason why there is no rig: that of the baseline if it is missing.
    pub(crate) fn why_no_rig(&self, error: MessageError) -> MessageError {
        match &self.frames {
            [Some(left), Some(right)] if self.lacks_baseline() => {
                let why = self.baseline.metres(left, right).err();
                // P has one, of the wrong sign.
                why.filter(|_| !self.has_reversed_baseline())
                    .unwrap_or(error)
            }
            _ => error,
        }
    }

    /// The calibrations of both cameras, for images of the current size.
    pub(crate) fn both(&self) -> MessageResult<[&Calibration; 2]> {
        match &self.cameras {
            // One topic cannot carry the projections of two cameras.
            [Some(left), Some(right)] if self.calibrations[0] != self.calibrations[1] => {
                [left, right]
                    .into_iter()
                    .try_for_each(|camera| camera.check_size(self.size))?;
                Ok([left, right])
            }
            [Some(_), Some(_)] => {
                let why = "it has no calibration of both cameras but one topic for both";
                Err(MessageError::Calibration(why))
            }
            _ if self.info_topics.len() > 1 => Err(MessageError::Infos(listed(&self.info_topics))),
            _ => Err(MessageError::Calibration(
                "it has no calibration of both cameras",
            )),
        }
    }

    pub(crate) fn lacks_baseline(&self) -> bool {
        self.needs_baseline() && self.baseline_m.is_none()
    }

    /// True if the baseline is that of the static transforms.
    pub(crate) fn needs_baseline(&self) -> bool {
        match &self.cameras {
            [Some(left), Some(right)] => left.needs_baseline(right),
            _ => false,
        }
    }

    fn has_reversed_baseline(&self) -> bool {
        match &self.cameras {
            [Some(left), Some(right)] => left.has_reversed_baseline(right),
            _ => false,
        }
    }

    /// Warns of projections with the sign of another convention.
    pub(crate) fn warn_of_sign(&self) {
        if let Some(metres) = self.baseline_m.filter(|_| self.has_reversed_baseline())
            && self
                .both()
                .is_ok_and(|[left, right]| camera::rig(left, right, Some(metres)).is_ok())
        {
            let [left, right] = &self.images;
            tracing::warn!(
                "{}: {left} and {right}: by P the right camera is to the left, by /tf_static \
                 {metres:.4} m to the right, which is used",
                self.name
            );
        }
    }

    /// True if the messages so far lack the calibration of a camera that has a topic for it.
    pub(crate) fn lacks_calibration(&self) -> bool {
        let mut tracks = self.calibrations.iter().zip(&self.tracks);
        tracks.any(|(topic, track)| topic.is_some() && track.is_empty())
    }

    /// What rectifies raw pairs, by the current calibrations.
    ///
    /// # Errors
    /// The missing part.
    pub(crate) fn stereo_calibration(&self) -> MessageResult<StereoCalibration> {
        let [left, right] = self.both()?;
        camera::calibration(left, right, self.baseline_m).map_err(|why| self.why_no_rig(why))
    }

    /// The checks of the current calibrations, for images of that size; none without both.
    pub(crate) fn checks(
        &self,
        raw: Option<&StereoCalibration>,
        size: (usize, usize),
    ) -> Vec<CalibrationCheck> {
        let rig = match raw {
            Some(calibration) => calibration.rig(),
            None => self.rig().ok(),
        };
        let apart_m = match &self.frames {
            [Some(left), Some(right)] => self.baseline.apart_m(left, right),
            _ => None,
        };
        match (self.both(), rig) {
            (Ok(cameras), Some(rig)) => camera::checks((cameras, size), &rig, raw, apart_m),
            _ => Vec::new(),
        }
    }

    /// Stores a calibration by its stamp.
    pub(crate) fn calibrate(
        &mut self,
        channel: &Channel,
        log_time: u64,
        data: &[u8],
    ) -> MessageResult<()> {
        for side in Side::BOTH {
            let place = side as usize;
            if self.calibrations[place].as_ref() == Some(&channel.topic) {
                let (stamp_ns, calibration) = camera::decode(channel, log_time, data)?;
                self.tracks[place].check_damage(stamp_ns, &calibration)?;
                let fault = self.tracks[place].add((stamp_ns, log_time), calibration);
                if let Some(fault) = fault {
                    let (name, topic) = (&self.name, &channel.topic);
                    warn_once(format!("{name}: {topic}: {}", fault.words()));
                }
                // Before the first pair the first ones decide what kind of images there are.
                if self.sequence == 0 {
                    self.cameras[place] = self.tracks[place].first().cloned();
                }
            }
        }
        Ok(())
    }

    /// Leaves calibrations out that were found by the names of their topics alone, if a frame in
    /// them is not that of its camera's images.
    pub(crate) fn check_info_frames(
        &mut self,
        info_frames: &[Option<String>; 2],
        selection: &Selection,
    ) {
        let [left, right] = &self.images;
        for (side, [image, other]) in [[left, right], [right, left]].into_iter().enumerate() {
            let frames = info_frames[side].as_ref().zip(self.frames[side].as_ref());
            let frames = frames.filter(|_| selection.infos[side].is_none());
            if let Some((info, (info_frame, frame))) = self.calibrations[side].as_ref().zip(frames)
                && (!topics::is_near(info, image) || topics::is_near(info, other))
                && plain(info_frame) != plain(frame)
            {
                if info_frame.is_empty() || frame.is_empty() {
                    tracing::warn!(
                        "{}: {info} is used for {image} by its name alone, as a frame_id is empty; \
                         --calib FILE if it is of another camera",
                        self.name
                    );
                    continue;
                }
                let others = if self.info_topics.len() > 1 {
                    ", or --left-info TOPIC and --right-info TOPIC"
                } else {
                    ""
                };
                tracing::warn!(
                    "{}: {info} is of frame '{info_frame}', {image} of '{frame}': the calibrations \
                     are not used; --calib FILE gives the cameras theirs{others}",
                    self.name
                );
                (self.calibrations, self.cameras, self.tracks) = Default::default();
                return;
            }
        }
    }

    /// Makes the calibrations of a pair with these stamps the current ones. Warns of the first that
    /// differs from that of the pair before it, and of pairs before the first one.
    pub(crate) fn calibrate_pair(&mut self, stamps: [u64; 2]) {
        let mut change = None;
        for (place, stamp_ns) in stamps.into_iter().enumerate() {
            let track = &mut self.tracks[place];
            let Some(next) = track.at(stamp_ns).cloned() else {
                continue;
            };
            let topic = self.calibrations[place].as_deref().unwrap_or_default();
            let late_ns = stamp_ns.saturating_add(MIN_LATE_NS);
            if let Some(first_ns) = track.first_ns().filter(|first_ns| *first_ns > late_ns)
                && self.warned.insert("late calibration")
            {
                tracing::warn!(
                    "{}: {topic}: its first calibration is {:.3} s after the first pair; the pairs \
                     before it use that one",
                    self.name,
                    (first_ns - stamp_ns) as f64 / 1e9
                );
            }
            track.give(stamp_ns);
            track.forget_before(stamp_ns.saturating_sub(KEPT_NS));
            let before = self.cameras[place].replace(Arc::clone(&next));
            // The first pair is pair 1 here: what was before it is no change.
            let before = before.filter(|_| self.sequence > 1);
            let differs = before.and_then(|before| before.change(&next));
            change = change.or(differs.map(|change| (topic.to_owned(), change)));
        }
        self.wait
            .iter_mut()
            .for_each(|wait| wait.count(change.is_some()));
        // Pairs of a data set have a rig each.
        if let Some((topic, change)) = change
            && self.own.is_none()
            && self.warned.insert("change")
        {
            self.warn_of_change(&topic, stamps[0], &change);
        }
    }

    fn warn_of_change(&self, topic: &str, stamp_ns: u64, change: &CalibrationChange) {
        tracing::warn!(
            "{}: {topic}: the calibration changes at {:.3} s ({change}); each pair uses that of \
             its stamp: if it is wrong, --from and --to omit that part, or --calib FILE replaces \
             it",
            self.name,
            stamp_ns as f64 / 1e9
        );
    }
}
