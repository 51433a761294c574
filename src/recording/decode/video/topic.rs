//! Images that are pictures of a video: each message holds one.

use super::decoder::{self, VideoDecoder};
use super::message::{CodedResult, packet};
use super::order::PictureOrder;
use crate::bags::opened::Recording;
use crate::decode::pixels::MessageImage;
use crate::message::{MessageError, MessageResult};
use crate::stream::channel::Channel;

/// A topic whose messages are pictures of a video.
pub(crate) struct VideoTopic {
    order: PictureOrder,
    decoder: VideoDecoder,
    /// The number of the last picture that was decoded.
    last: Option<u64>,
}

impl VideoTopic {
    /// # Errors
    /// [`svl_core::Error::Program`] where ffmpeg is missing.
    pub(crate) fn open(recording: &Recording, topic: &str) -> svl_core::Result<Self> {
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
    pub(crate) fn take_in(
        &mut self,
        channel: &Channel,
        data: &[u8],
    ) -> MessageResult<(Option<u64>, CodedResult<()>)> {
        let packet = packet(channel, data);
        let coded = self.order.take_in(&packet);
        Ok((packet?.stamp, coded.map(drop)))
    }

    /// The picture of the message with that number, counted from 0.
    ///
    /// # Errors
    /// The reason why it cannot be decoded.
    pub(crate) fn picture(&mut self, number: u64) -> MessageResult<MessageImage> {
        if self.last.replace(number) > Some(number) {
            let why = "its stamp is after that of a later message";
            return Err(MessageError::Video(why));
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
            summary.reason.get_or_insert_with(|| reason.to_string());
        }
        coded.is_ok()
    }
}
