//! The first 16-bit images of both cameras, which decide how many bits are used.

use super::{image, video};
use crate::files::DECIDING_PAIRS;
use crate::recording::messages::Channel;

/// The largest values of the first 16-bit images of both cameras.
#[derive(Default)]
pub(super) struct FirstImages {
    largest: [Vec<u16>; 2],
    /// True if they have 8 bits: then there is nothing to decide.
    are_of_8_bits: bool,
}

impl FirstImages {
    pub(super) fn are_enough(&self) -> bool {
        let enough = |largest: &Vec<u16>| largest.len() >= DECIDING_PAIRS;
        self.are_of_8_bits || self.largest.iter().all(enough)
    }

    pub(super) fn take_in(&mut self, topics: &[String; 2], channel: &Channel, data: &[u8]) {
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
    pub(super) fn largest(self) -> Option<Option<u16>> {
        if self.are_of_8_bits {
            Some(None)
        } else {
            self.largest.into_iter().flatten().max().map(Some)
        }
    }
}
