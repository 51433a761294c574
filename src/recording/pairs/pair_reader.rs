//! The pairs of a recording: of svl's own, bags of ROS 1 and 2, of the RealSense SDK, and Foxglove
//! recordings.

use super::pair_stamps::PairStamps;
use super::stamp_order::{ImagePairing, PairImage, PairImages, ReadImage};
use super::stamp_pairing::UnpairedImages;
use crate::cameras::topics::{self, Selection, choose};
use crate::decode::image;
use crate::decode::video::message::is_picture;
use crate::message::MessageError::Video;
use crate::message::{MessageError, MessageResult, geometry};

use super::calibration_wait::CalibrationWait;
use super::own_topics::OwnTopics;
use super::steps::StepWatch;
use super::stream_facts::{CameraFacts, StreamFacts};
use crate::cameras::baseline::BaselineSearch;
use crate::cameras::camera::Calibration;
use crate::cameras::camera_track::CameraTrack;
use crate::cameras::transforms::Transforms;
use crate::decode::pixels::MessageImage;
use crate::decode::video::topic::VideoTopic;
use crate::message::wire::topic;
use crate::poses::reader::PoseReader;
use crate::stream::channel::{Channel, warn_of, warn_once};
use nalgebra::UnitQuaternion;
use std::collections::BTreeSet;
use std::sync::Arc;
use svl_core::stereo::{Exposure, Frame, Geometry, Pose, Side};
use svl_core::{counted, listed};
use svl_files::{BitDepth, SideBySide};

/// Live images are never that much out of order: their clock jumped.
const JUMP_NS: u64 = 500_000_000;
/// A longer jump is from the time since 1970 to that of a simulation or a device.
const MIN_EPOCH_NS: u64 = 100_000_000_000_000_000;

/// Pairs the images of two topics: by svl's records where it wrote them, else by stamp.
pub(crate) struct PairReader {
    pub(crate) images: [String; 2],
    /// What svl's own recordings have of the pairs besides; `None` in others.
    pub(crate) own: Option<OwnTopics>,
    pub(crate) calibrations: [Option<String>; 2],
    /// All topics of calibrations.
    pub(crate) info_topics: BTreeSet<String>,
    /// The calibrations of each camera so far, and those before the first pair.
    pub(crate) tracks: [CameraTrack; 2],
    /// The calibrations of the last pair; before any, the first ones.
    pub(crate) cameras: [Option<Arc<Calibration>>; 2],
    /// The baseline in the static transforms, if the calibrations have none.
    pub(crate) baseline_m: Option<f64>,
    pub(crate) baseline: BaselineSearch,
    /// The poses of the recording, if it has any.
    pub(crate) poses: Option<PoseReader>,
    /// The frame of each camera's first image; empty if it names none.
    pub(crate) frames: [Option<String>; 2],
    pub(crate) partners: ImagePairing<ReadImage>,
    /// Waits for the calibrations of live pairs; those of a file are there.
    pub(crate) wait: Option<CalibrationWait>,
    /// The videos of topics that hold such.
    pub(crate) videos: [Option<VideoTopic>; 2],
    pub(crate) depth: BitDepth,
    /// The places of both images in those of one topic.
    pub(crate) side_by_side: Option<SideBySide>,
    pub(crate) max_skew_ns: u64,
    /// Images of each camera, and those among them of which not even the stamp can be read.
    pub(crate) counts: [u64; 2],
    pub(crate) without_stamp: [u64; 2],
    /// Pairs so far, and the readable ones among them.
    pub(crate) sequence: u64,
    pub(crate) pairs: u64,
    /// Width and height of the last pair's images.
    pub(crate) size: (usize, usize),
    /// The recording's name in warnings.
    pub(crate) name: String,
    /// What the user was warned of: a change of the calibration, a late first one, images without a
    /// stamp, equal stamps.
    pub(crate) warned: BTreeSet<&'static str>,
    /// The last stamp of each camera.
    pub(crate) last_ns: [Option<u64>; 2],
    /// Jumps of a live clock; `None` for files, which may have any order.
    pub(crate) jumps: Option<u64>,
    /// Watches for steps of the cameras' clocks, until one.
    pub(crate) watch: Option<StepWatch>,
}

impl PairReader {
    /// The pose of the left camera at that time: of images that were rectified before they were
    /// recorded, with the rotation of their rectification; and that of the base, if it is known.
    fn pose(&mut self, stamp_ns: u64) -> Option<(Pose, Option<Pose>)> {
        let poses = self.poses.as_mut()?;
        let (pose, base) = poses.at(self.frames[0].as_ref()?, stamp_ns)?;
        let rotation = self.cameras[0].as_ref().filter(|_| !self.are_raw());
        let rotation = rotation.and_then(|camera| camera.rotation().ok());
        let rotation = rotation.map(|rotation| UnitQuaternion::from_rotation_matrix(&rotation));
        Some((pose * rotation.unwrap_or_default().inverse(), base))
    }

    /// Chooses the topics of a source called `name`, those of svl if `is_own`. Calibrations and bit
    /// depth are still unknown.
    ///
    /// # Errors
    /// The reason why no two topics can be the cameras, or why more than two can.
    pub(crate) fn new(
        name: String,
        channels: &[&Channel],
        selection: &Selection,
        is_own: bool,
    ) -> Result<Self, String> {
        let images = if is_own {
            Side::BOTH.map(|side| topic::camera(side, "image"))
        } else {
            choose(channels, selection)?
        };
        let names = images.each_ref().map(String::as_str);
        let calibrations = topics::calibrations(channels, names, selection)?;
        let others = Transforms::other_robots(channels, names);
        if !others.is_empty() {
            warn_once(format!(
                "{name}: {}: not used, as {} is in another namespace: its robot is another",
                listed(others),
                images[0]
            ));
        }
        Ok(Self {
            images,
            own: is_own.then(OwnTopics::default),
            calibrations,
            info_topics: topics::calibration_topics(channels),
            tracks: Default::default(),
            cameras: [None, None],
            baseline_m: None,
            baseline: BaselineSearch::new(channels),
            poses: None,
            frames: [None, None],
            partners: if is_own {
                ImagePairing::by_records()
            } else {
                ImagePairing::for_file(selection.max_skew_ns)
            },
            wait: None,
            videos: [None, None],
            depth: BitDepth::FULL,
            side_by_side: selection.side_by_side,
            max_skew_ns: selection.max_skew_ns,
            counts: [0, 0],
            without_stamp: [0, 0],
            sequence: 0,
            pairs: 0,
            size: (0, 0),
            name,
            warned: BTreeSet::new(),
            last_ns: [None; 2],
            jumps: None,
            watch: None,
        })
    }

    /// Forgets all messages, as reading goes on elsewhere in svl's own recording.
    pub(crate) fn restart(&mut self) {
        self.own = Some(OwnTopics::default());
        self.partners = ImagePairing::by_records();
        self.tracks = Default::default();
        (self.counts, self.without_stamp, self.pairs) = ([0; 2], [0; 2], 0);
    }

    /// The next two images that are a pair, once their calibrations are there or are not waited for
    /// any more.
    fn next_images(&mut self) -> Option<PairImages> {
        let Some(wait) = &mut self.wait else {
            return self.partners.pop();
        };
        let pair = wait.next(|| self.partners.pop())?;
        let stamps = pair.images.each_ref().map(|(stamp_ns, _)| *stamp_ns);
        let mut tracks = self.calibrations.iter().zip(&self.tracks).zip(stamps);
        let are_there = tracks.all(|((topic, track), stamp)| topic.is_none() || track.has(stamp));
        wait.release(pair, are_there)
    }

    /// The stamp of an image message, if it has one, and the image.
    ///
    /// # Errors
    /// The reason why the message cannot be read.
    fn image(
        &mut self,
        side: Side,
        channel: &Channel,
        data: &[u8],
    ) -> MessageResult<(Option<u64>, ReadImage)> {
        let Some(video) = &mut self.videos[side as usize] else {
            let (stamp, image) = image::decode(channel, data)?;
            // The pictures of a live topic.
            if image.is_err() && is_picture(channel, data) {
                let why = "a video, which svl reads from a bag: record it first";
                return Err(Video(why));
            }
            return Ok((stamp, image.map(PairImage::Image)));
        };
        let number = self.counts[side as usize] - 1;
        let (stamp, coded) = video.take_in(channel, data)?;
        let picture = coded.map(|()| PairImage::Picture(number));
        Ok((stamp, picture.map_err(MessageError::Picture)))
    }

    /// The pixels of an image that found its partner.
    ///
    /// # Errors
    /// The reason why a picture of a video cannot be decoded.
    fn pixels(&mut self, side: Side, image: PairImage) -> MessageResult<MessageImage> {
        let number = match image {
            PairImage::Image(image) => return Ok(image),
            PairImage::Picture(number) => number,
        };
        let video = self.videos[side as usize].as_mut();
        let picture = video.map_or_else(|| Err(Video("no video")), |v| v.picture(number));
        picture.map_err(|e| e.on(&self.images[side as usize]))
    }

    /// Warns once of images that have no stamp, of images that share one, and of a live clock that
    /// jumps back.
    fn check_stamp(&mut self, side: Side, stamp: Option<u64>, log_time: u64) {
        let topic = &self.images[side as usize];
        // A stamp of 0 counts as missing; if the log time is 0 too, it is a stamp.
        if stamp.is_none() && log_time > 0 && self.warned.insert("stamps") {
            tracing::warn!(
                "{}: {topic}: images without a stamp; the log time, which is later, is used \
                 instead: pairs and their truth may be from different moments",
                self.name
            );
        }
        let stamp = stamp.unwrap_or(log_time);
        let last = self.last_ns[side as usize].replace(stamp);
        let back = last.map_or(0, |last| last.saturating_sub(stamp));
        if let Some(jumps) = self.jumps.as_mut().filter(|_| back > JUMP_NS) {
            *jumps += 1;
            if *jumps == 1 {
                let by = if back > MIN_EPOCH_NS {
                    "from the time since 1970 to that since a start".to_owned()
                } else {
                    format!("by {:.3} s", back as f64 / 1e9)
                };
                let name = &self.name;
                tracing::warn!("{name}: {topic}: the clock of its stamps jumped back {by}");
            }
            self.partners.pairing_mut().forget_later(side, stamp);
        }
        let is_repeated = last == Some(stamp);
        if is_repeated && self.warned.insert("equal stamps") {
            tracing::warn!(
                "{}: {topic}: images share a stamp, {:.3} s; they are paired in the order of the \
                 file: if one is missing, the pairs after it are from different moments",
                self.name,
                stamp as f64 / 1e9
            );
        }
    }

    /// Warns once of a step of a camera's clock.
    fn watch_step(&mut self, side: Side, log_time: u64, stamp_ns: u64) {
        let watch = self.watch.as_mut();
        let step = watch.and_then(|own| own.take_in(&self.images, side, log_time, stamp_ns));
        if let Some(step) = step {
            warn_of(&self.name, &step);
            self.watch = None;
        }
    }

    /// The reason why there was no pair.
    fn why_none(&self) -> String {
        let [left, right] = &self.images;
        let [lefts, rights] = self.counts;
        if self.own.is_some() {
            return match self.counts {
                [0, 0] => "has no pairs: its recording ended before the first".to_owned(),
                _ => format!(
                    "has no stereo pairs: no {} says which of {} of {left} and {rights} of \
                     {right} belong together",
                    topic::SYNC,
                    counted(lefts, "image")
                ),
            };
        }
        let milliseconds = |ns: u64| ns as f64 / 1e6;
        let skew = milliseconds(self.max_skew_ns);
        let watch = self.watch.as_ref();
        let shift_ns = watch.and_then(|watch| watch.shift_ns(self.max_skew_ns));
        let miss = match (self.partners.pairing.nearest_miss_ns, shift_ns) {
            (None, _) => String::new(),
            (_, Some(ns)) => format!(
                "; by the log times the clock of {right} is off: `--right-offset-ms {:.1}` \
                 corrects its stamps",
                ns as f64 / 1e6
            ),
            (Some(ns), _) => format!(": at best {} ms, see --max-skew-ms", milliseconds(ns)),
        };
        format!(
            "has no stereo pairs: of {} of {left} and {rights} of {right} none are within {skew} \
             ms of each other{miss}",
            counted(lefts, "image")
        )
    }

    /// Warning about the pairs. `fault`: the reason why their calibrations give no distances.
    fn remark(&self, are_raw: bool, fault: Option<&str>) -> Option<String> {
        if !are_raw {
            return fault.map(|reason| format!("disparities but no distances: {reason}"));
        }
        let [left, right] = &self.images;
        let cure = match fault {
            Some(reason) => {
                format!("it does not say how to rectify them ({reason}): --calib FILE does")
            }
            None => "it says how to rectify them".to_owned(),
        };
        Some(format!(
            "{left} and {right}: by their calibration they are not rectified, so rows of left and \
             right do not correspond, and there are no distances; {cure}"
        ))
    }

    /// The coordinate frame of the left images, if they name one.
    pub(crate) fn frame_id(&self) -> Option<&str> {
        let left = self.frames[0].as_deref();
        left.filter(|frame| !frame.is_empty())
    }

    /// Adds one message.
    ///
    /// # Errors
    /// The reason why the message cannot be read.
    pub(crate) fn take_in(
        &mut self,
        channel: &Channel,
        log_time: u64,
        data: &[u8],
    ) -> MessageResult<()> {
        if let Some(own) = &mut self.own
            && let Some(joined) = own.take_in(channel, log_time, data)?
        {
            let pairing = self.partners.pairing_mut();
            joined.into_iter().for_each(|stamps| pairing.join(stamps));
            return Ok(());
        }
        self.partners.advance(log_time);
        let is_of_use = self.images.contains(&channel.topic)
            || self
                .calibrations
                .iter()
                .flatten()
                .any(|topic| *topic == channel.topic);
        if Transforms::reads(channel)
            && let [Some(left), Some(right)] = &self.frames
            && let Some(warning) =
                self.baseline
                    .take_in_later(channel, data, (left, right), self.baseline_m)
            && self.needs_baseline()
        {
            tracing::warn!("{}: {warning}", self.name);
        }
        if !is_of_use {
            return Ok(());
        }
        for side in Side::BOTH {
            if channel.topic == self.images[side as usize] {
                self.counts[side as usize] += 1;
                let read = self.image(side, channel, data);
                self.without_stamp[side as usize] += u64::from(read.is_err());
                let (stamp, image) = read?;
                let image = image.map_err(|e| e.on(&channel.topic));
                let bytes = match &image {
                    Ok(PairImage::Image(image)) => image.image.bytes(),
                    _ => 0,
                };
                if !channel.stamps.is_log() {
                    self.check_stamp(side, stamp, log_time);
                }
                let stamp_ns = stamp.unwrap_or(log_time);
                self.watch_step(side, log_time, stamp_ns);
                self.partners.push(side, stamp_ns, log_time, image, bytes);
            }
        }
        self.calibrate(channel, log_time, data)
    }

    /// The next pair that is ready without another message.
    ///
    /// # Errors
    /// The reason why two images that belong together cannot be a pair.
    pub(crate) fn pop(&mut self) -> Option<MessageResult<Frame>> {
        let [(left_ns, left), (right_ns, right)] = self.next_images()?;
        let sequence = self.sequence;
        self.sequence += 1;
        let exposure = Exposure {
            trigger_id: sequence,
            // Stamps above 2⁶³ ns are damage; wrapping still keeps their difference right.
            skew_ns: Some(right_ns.wrapping_sub(left_ns).cast_signed()),
            drops: self.partners.pairing.unpaired_ns.len() as u64,
            ..Exposure::default()
        };
        let left = left.and_then(|image| self.pixels(Side::Left, image));
        let right = right.and_then(|image| self.pixels(Side::Right, image));
        let pair = match (left, right) {
            (Ok(left), Ok(right)) => {
                let images = [left, right].map(|image| image.demosaiced(&mut self.depth));
                let images = match self.side_by_side {
                    Some(places) => images[0].halves(places),
                    None => Ok(images),
                };
                let pair = images.and_then(|images| self.depth.pair(images));
                pair.map_err(MessageError::Refused)
            }
            (Err(reason), _) | (_, Err(reason)) => Err(reason),
        };
        // The size is known from the first pair on; calibrations are checked against it.
        if let Ok((pair, _)) = &pair {
            self.size = pair.size();
        }
        self.calibrate_pair([left_ns, right_ns]);
        let (geometry, poses) = (self.geometry(), self.pose(left_ns));
        let is_raw = geometry == Geometry::Raw;
        let calibration = is_raw.then(|| self.stereo_calibration().ok()).flatten();
        let frame = pair.map(|(pair, color)| Frame {
            sequence,
            stamp_ns: left_ns,
            calibration: calibration.map(Arc::new),
            pose: poses.map(|(pose, _)| pose),
            base: poses.and_then(|(_, base)| base),
            color,
            exposure,
            ..Frame::new(pair, geometry)
        });
        let frame = frame.and_then(|frame| self.completed(frame, [left_ns, right_ns]));
        self.pairs += u64::from(frame.is_ok());
        Some(frame.map_err(|e| MessageError::Pair(left_ns, Box::new(e))))
    }

    /// The frame with what svl's own recording has of it besides its images.
    fn completed(&mut self, frame: Frame, stamps: [u64; 2]) -> MessageResult<Frame> {
        let Some(own) = &mut self.own else {
            return Ok(frame);
        };
        let mut tracks = self.tracks.iter().zip(stamps);
        let have_own = tracks.all(|(track, stamp)| track.has(stamp));
        let rig = match &self.cameras {
            // The exact rig: that of another pair may differ.
            [Some(left), Some(right)] if have_own => {
                Some(geometry::rig(&left.projection()?, &right.projection()?)?)
            }
            _ => None,
        };
        own.complete(frame, stamps, rig)
    }

    /// Ends the recording: there are no more messages.
    pub(crate) fn end(&mut self) {
        self.partners.end();
        self.wait.iter_mut().for_each(CalibrationWait::end);
    }

    /// True if svl wrote the recording.
    pub(crate) fn is_own(&self) -> bool {
        self.own.is_some()
    }

    /// The topic of the left camera's calibrations.
    pub(crate) fn left_calibration(&self) -> Option<String> {
        self.calibrations[0].clone()
    }

    /// The rule by which the stamps of the messages form pairs.
    pub(crate) fn stamps(&self) -> PairStamps {
        if self.is_own() {
            return PairStamps::Synced;
        }
        PairStamps::Nearest {
            topics: self.images.clone(),
            pairing: Box::new(ImagePairing::for_file(self.max_skew_ns)),
            next: 0,
        }
    }

    /// The facts so far.
    pub(crate) fn facts(&self) -> StreamFacts {
        let pairing = &self.partners.pairing;
        let facts = StreamFacts {
            topics: self.images.clone(),
            pairs: self.pairs,
            unpaired_ns: pairing.unpaired_ns.to_vec(),
            // An image with a stamp has its partner, even if its pixels cannot be read. If images
            // of both cameras are without, they may be partners of each other.
            partners_of_unreadable: self.without_stamp[0].max(self.without_stamp[1]),
            outside: pairing.outside(),
            late: pairing.late,
            why_none: self.why_none(),
            ..StreamFacts::from_images(&self.depth, self.side_by_side, self.size)
        };
        // The rest is in svl's header.
        if self.is_own() {
            return facts;
        }
        let are_raw = self.are_raw();
        let raw = are_raw.then(|| self.stereo_calibration());
        let fault = match &raw {
            Some(calibration) => calibration.as_ref().err().map(ToString::to_string),
            None => self.rig().err().map(|e| e.to_string()),
        };
        let left = self.cameras[0].as_ref();
        let raw_left = left.filter(|_| are_raw);
        let frame_id = self.frame_id().map(str::to_owned);
        let has_calibration = self.cameras.iter().any(Option::is_some);
        StreamFacts {
            remarks: self.remark(are_raw, fault.as_deref()).into_iter().collect(),
            camera: CameraFacts {
                checks: self.checks(raw.as_ref().and_then(|raw| raw.as_ref().ok()), self.size),
                focal_px: left.and_then(|left| left.focal_px(are_raw)),
                distortion_model: raw_left
                    .and_then(|left| left.distortion_model())
                    .map(str::to_owned),
                calibration_fault: fault.filter(|_| has_calibration),
            },
            calibration: raw.and_then(Result::ok),
            frame_id,
            ..facts
        }
    }
}

/// An image of a recording, without its pixels.
#[derive(Clone, Copy)]
pub(crate) struct StampedImage {
    /// Index of the image among all images of the recording.
    pub place: u64,
    pub stamp_ns: u64,
    pub log_ns: u64,
    pub bytes: usize,
}

/// Pairs images in file order by stamp alone, like [`PairReader`]: the stamps of each pair, and the
/// images without a partner.
pub(crate) fn pair_stamps(
    images: &[(Side, &StampedImage)],
    max_skew_ns: u64,
) -> (Vec<[u64; 2]>, UnpairedImages) {
    let mut partners = ImagePairing::for_file(max_skew_ns);
    let mut stamps = Vec::new();
    let mut pop = |partners: &mut ImagePairing<()>| {
        while let Some([(left, ()), (right, ())]) = partners.pop() {
            stamps.push([left, right]);
        }
    };
    for &(side, image) in images {
        partners.push(side, image.stamp_ns, image.log_ns, (), image.bytes);
        pop(&mut partners);
    }
    partners.end();
    pop(&mut partners);
    (stamps, partners.pairing.unpaired_images())
}
