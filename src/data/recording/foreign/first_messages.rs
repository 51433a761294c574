//! The first messages of a source: calibrations, the cameras' frames and baseline, and the number
//! of bits that 16-bit images use.

use super::{Foreign, Selection, head, image, video};
use crate::files::{BitDepth, DECIDING_PAIRS};
use crate::recording::messages::Channel;
use svl_core::Result;

/// The first messages, from which a [`Foreign`] is prepared before its first pair.
#[derive(Default)]
pub(super) struct FirstMessages {
    images: FirstImages,
}

impl FirstMessages {
    /// True if all is known that these messages may contain.
    pub(super) fn are_enough(&self, foreign: &Foreign) -> bool {
        let [left, right] = &foreign.frames;
        let (Some(left), Some(right)) = (left, right) else {
            return false;
        };
        let wants_baseline = foreign.lacks_baseline() && foreign.baseline.may_be_found(left, right);
        !foreign.lacks_calibration() && self.images.are_enough() && !wants_baseline
    }

    /// Takes a message in. An unreadable one is reported when its turn comes.
    pub(super) fn take_in(&mut self, foreign: &mut Foreign, channel: &Channel, data: &[u8]) {
        drop(foreign.calibrate_first(channel, data));
        self.images.take_in(&foreign.images, channel, data);
        for (topic, frame) in foreign.images.iter().zip(&mut foreign.frames) {
            if *topic == channel.topic && frame.is_none() {
                *frame = head(channel, data).ok().map(|(_, frame)| frame);
            }
        }
        foreign.baseline.take_in(channel, data);
        if let [Some(left), Some(right)] = &foreign.frames {
            foreign.baseline_m = foreign.baseline.metres(left, right).ok();
        }
    }

    /// Decides the bit depth.
    ///
    /// # Errors
    /// Those of [`BitDepth::decide`].
    pub(super) fn end(self, foreign: &mut Foreign, selection: &Selection) -> Result<()> {
        foreign.depth = BitDepth::decide(selection.bits, self.images.largest())?;
        Ok(())
    }
}

/// The largest values of the first 16-bit images of both cameras.
#[derive(Default)]
struct FirstImages {
    largest: [Vec<u16>; 2],
    /// True if they have 8 bits: then there is nothing to decide.
    are_of_8_bits: bool,
}

impl FirstImages {
    fn are_enough(&self) -> bool {
        let enough = |largest: &Vec<u16>| largest.len() >= DECIDING_PAIRS;
        self.are_of_8_bits || self.largest.iter().all(enough)
    }

    fn take_in(&mut self, topics: &[String; 2], channel: &Channel, data: &[u8]) {
        let Some(side) = topics.iter().position(|topic| *topic == channel.topic) else {
            return;
        };
        if self.are_enough() || self.largest[side].len() >= DECIDING_PAIRS {
            return;
        }
        // Videos are decoded to 8 bits.
        if video::is_video(channel) {
            self.are_of_8_bits = true;
            return;
        }
        // An unreadable one is reported when its turn comes.
        if let Ok((_, Ok(image))) = image::decode(channel, data) {
            match image.image.largest() {
                Some(largest) => self.largest[side].push(largest),
                None => self.are_of_8_bits = true,
            }
        }
    }

    /// The largest of all; the inner value is `None` for 8 bits.
    fn largest(self) -> Option<Option<u16>> {
        if self.are_of_8_bits {
            Some(None)
        } else {
            self.largest.into_iter().flatten().max().map(Some)
        }
    }
}
