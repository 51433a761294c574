//! The first messages of a source: calibrations, the cameras' frames and baseline, and the number
//! of bits that 16-bit images use.

use super::pair_reader::PairReader;
use super::stamp_order::HOLD_NS;
use crate::bags::opened::Recording;
use crate::cameras::camera_track::CameraTrack;
use crate::cameras::topics::Selection;
use crate::decode::head::head;
use crate::decode::image;
use crate::decode::video::message;
use crate::decode::video::topic::VideoTopic;
use crate::poses::reader::PoseReader;
use crate::stream::channel::{Channel, FileEvent};
use svl_core::{Error, Result};
use svl_files::{BitDepth, GreyLevels};

/// The first messages, from which a [`PairReader`] is prepared before its first pair.
#[derive(Default)]
pub(crate) struct FirstMessages {
    images: FirstImages,
    /// The earliest stamp of each camera's images.
    first_ns: [Option<u64>; 2],
    /// The frame of each camera's first calibration.
    info_frames: [Option<String>; 2],
    /// The first log time, the latest, and that at which the calibrations were there.
    begin_ns: Option<u64>,
    log_ns: u64,
    calibrated_ns: Option<u64>,
}

impl FirstMessages {
    /// True if all is known that these messages may contain.
    pub(crate) fn are_enough(&self, pairs: &PairReader) -> bool {
        let [left, right] = &pairs.frames;
        let (Some(left), Some(right)) = (left, right) else {
            return false;
        };
        // The baseline of the calibrations is compared with the transforms of the first second.
        let is_early = self
            .begin_ns
            .is_some_and(|begin_ns| self.log_ns < begin_ns.saturating_add(HOLD_NS));
        let wants_baseline = (pairs.lacks_baseline() || is_early && pairs.wait.is_none())
            && pairs.baseline.may_be_found(left, right);
        self.have_first_calibrations(pairs) && self.images.are_enough() && !wants_baseline
    }

    /// True if the first calibrations are known. In a file, one that is after its images may not be
    /// the earliest: those of the next second decide.
    fn have_first_calibrations(&self, pairs: &PairReader) -> bool {
        let is_before = |(track, first_ns): (&CameraTrack, Option<u64>)| {
            let stamps = track.first_ns().zip(first_ns);
            stamps.is_none_or(|(calibration_ns, image_ns)| calibration_ns <= image_ns)
        };
        let are_before = pairs.tracks.iter().zip(self.first_ns).all(is_before);
        let is_past = |found_ns: u64| self.log_ns >= found_ns.saturating_add(HOLD_NS);
        let are_settled = pairs.wait.is_some() || self.calibrated_ns.is_some_and(is_past);
        !pairs.lacks_calibration() && (are_before || are_settled)
    }

    /// Takes a message in. An unreadable one is reported when its turn comes.
    pub(crate) fn take_in(
        &mut self,
        pairs: &mut PairReader,
        channel: &Channel,
        log_ns: u64,
        data: &[u8],
    ) {
        self.begin_ns.get_or_insert(log_ns);
        self.log_ns = self.log_ns.max(log_ns);
        drop(pairs.calibrate(channel, log_ns, data));
        if !pairs.lacks_calibration() {
            self.calibrated_ns.get_or_insert(log_ns);
        }
        self.images.take_in(&pairs.images, channel, data);
        let cameras = pairs.images.iter().zip(&mut pairs.frames);
        for (info, frame) in pairs.calibrations.iter().zip(&mut self.info_frames) {
            if info.as_ref() == Some(&channel.topic)
                && let Ok((_, name)) = head(channel, data)
            {
                frame.get_or_insert(name);
            }
        }
        for ((topic, frame), first_ns) in cameras.zip(&mut self.first_ns) {
            if *topic == channel.topic
                && let Ok((stamp, name)) = head(channel, data)
            {
                frame.get_or_insert(name);
                let stamp_ns = stamp.unwrap_or(log_ns);
                *first_ns = Some(first_ns.map_or(stamp_ns, |first_ns| first_ns.min(stamp_ns)));
            }
        }
        pairs.baseline.take_in(channel, data);
        if let [Some(left), Some(right)] = &pairs.frames {
            pairs.baseline_m = pairs.baseline.metres(left, right).ok();
        }
    }

    /// True of each camera whose images are pictures of a video.
    pub(crate) fn are_videos(&self) -> [bool; 2] {
        self.images.are_videos
    }

    /// Decides the bit depth.
    ///
    /// # Errors
    /// The errors of [`BitDepth::decide`].
    pub(crate) fn end(self, pairs: &mut PairReader, selection: &Selection) -> Result<()> {
        pairs.check_info_frames(&self.info_frames, selection);
        pairs.depth = BitDepth::decide(selection.bits, &self.images.levels)?;
        Ok(())
    }
}

impl PairReader {
    /// Chooses the topics of a recording, those of svl if `is_own`, and looks for the first
    /// calibration of each camera.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] if no two topics can be the cameras, or more than two can.
    pub(crate) fn open(recording: &Recording, selection: &Selection, is_own: bool) -> Result<Self> {
        let name = recording.path().display().to_string();
        let channels = recording.channels()?;
        let mut pairs = Self::new(name, &channels, selection, is_own)
            .map_err(|reason| Error::format(recording.path(), reason))?;
        let mut first = FirstMessages::default();
        for file in recording.files() {
            let mut messages = file.messages()?;
            // Pairs may come before the first CameraInfo; with it from the start, all of them get a
            // rig. The bit depth is also decided before the first pair.
            while !first.are_enough(&pairs) {
                match messages.next() {
                    Ok(Some(FileEvent::Message(channel, log_time, data))) => {
                        first.take_in(&mut pairs, channel, log_time, &data)
                    }
                    Ok(Some(_)) => {}
                    Ok(None) | Err(_) => break,
                }
            }
        }
        let are_videos = first.are_videos();
        first.end(&mut pairs, selection)?;
        pairs.warn_of_sign();
        pairs.poses = PoseReader::open(recording, &channels)?;
        let topics = pairs.images.iter().zip(are_videos);
        for ((topic, is_video), video) in topics.zip(&mut pairs.videos) {
            if is_video {
                *video = Some(VideoTopic::open(recording, topic)?);
            }
        }
        Ok(pairs)
    }
}

/// The values of the first images of both cameras.
#[derive(Default)]
struct FirstImages {
    levels: GreyLevels,
    are_videos: [bool; 2],
}

impl FirstImages {
    fn are_enough(&self) -> bool {
        // Videos are decoded to 8 bits.
        self.are_videos.contains(&true) || self.levels.are_enough()
    }

    fn take_in(&mut self, topics: &[String; 2], channel: &Channel, data: &[u8]) {
        for side in (0..2).filter(|side| topics[*side] == channel.topic) {
            if message::is_picture(channel, data) {
                self.are_videos[side] = true;
            }
            if self.are_enough() {
                continue;
            }
            // An unreadable one is reported when its turn comes.
            if let Ok((_, Ok(image))) = image::decode(channel, data) {
                self.levels.add(side, &image.image);
            }
        }
    }
}
