//! Images that are pictures of a video: each message holds one.

mod bits;
mod decoder;
mod headers;
mod matroska;
mod message;
mod order;

pub(crate) use message::{is_picture, is_video};

use super::pixels::MessageImage;
use crate::Recording;
use crate::messages::Channel;
use decoder::VideoDecoder;
use message::packet;
use order::PictureOrder;

/// A topic whose messages are pictures of a video.
pub(super) struct VideoTopic {
    order: PictureOrder,
    decoder: VideoDecoder,
    /// The number of the last picture that was decoded.
    last: Option<u64>,
}

impl VideoTopic {
    /// # Errors
    /// [`svl_core::Error::Program`] where ffmpeg is missing.
    pub(super) fn open(recording: &Recording, topic: &str) -> svl_core::Result<Self> {
        decoder::check()?;
        Ok(Self {
            order: PictureOrder::default(),
            decoder: VideoDecoder::new(recording, topic),
            last: None,
        })
    }

    /// Adds the next message: its stamp, if it has one. Inner: the reason why its picture cannot be
    /// decoded.
    ///
    /// # Errors
    /// The reason why the message cannot be read.
    pub(super) fn take_in(
        &mut self,
        channel: &Channel,
        data: &[u8],
    ) -> Result<(Option<u64>, Result<(), String>), String> {
        let packet = packet(channel, data);
        let coded = self.order.take_in(&packet);
        Ok((packet?.stamp, coded.map(drop)))
    }

    /// The picture of the message with that number, counted from 0.
    ///
    /// # Errors
    /// The reason why it cannot be decoded.
    pub(super) fn picture(&mut self, number: u64) -> Result<MessageImage, String> {
        if self.last.replace(number) > Some(number) {
            return Err("its stamp is after that of a later message".to_owned());
        }
        Ok(MessageImage {
            image: self.decoder.picture(number)?,
            mosaic: None,
        })
    }
}

/// A topic of videos, as far as it is known without decoding it.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct VideoSummary {
    /// ffmpeg's name of the codec; `None` if svl does not read it.
    pub codec: Option<&'static str>,
    /// Messages, and those whose picture cannot be decoded.
    pub pictures: u64,
    pub undecodable: u64,
    /// Why the first of them cannot.
    pub reason: Option<String>,
}

/// Summarizes the messages of a topic.
#[derive(Default)]
pub(crate) struct VideoScan {
    order: PictureOrder,
    pub(crate) summary: VideoSummary,
}

impl VideoScan {
    /// Adds the next message. True if its picture can be decoded.
    pub(crate) fn take_in(&mut self, channel: &Channel, data: &[u8]) -> bool {
        let packet = packet(channel, data);
        let coded = self.order.take_in(&packet);
        let Self { summary, .. } = self;
        let codec = packet.ok().and_then(|packet| packet.codec.ok());
        summary.codec = summary.codec.or(codec.map(|codec| codec.name()));
        summary.pictures += 1;
        if let Err(reason) = &coded {
            summary.undecodable += 1;
            summary.reason.get_or_insert_with(|| reason.clone());
        }
        coded.is_ok()
    }
}
