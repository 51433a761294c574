//! Pairs of live ROS 2 topics, formed as those of a bag: the same topics, readers and pairing.

use crate::cameras::camera;
use crate::cameras::topics::Selection;
use crate::cameras::transforms::Transforms;
use crate::clocks::scan::ClockScan;
use crate::clocks::table::ClockTable;
use crate::decode::head::head;
use crate::decode::image;
use crate::decode::video::message;
use crate::message::MessageError;
use crate::message::wire::LEFT_FRAME;
use crate::pairs::calibration_wait::CalibrationWait;
use crate::pairs::first_messages::FirstMessages;
use crate::pairs::pair_reader::PairReader;
use crate::pairs::stamp_order::ImagePairing;
use crate::pairs::stream_facts::StreamFacts;
use crate::stream::channel::Channel;
use svl_core::stereo::Frame;
use svl_core::{Error, Result};

/// Limit on the bytes of images that wait for their partners: while one camera is silent, those of
/// the other wait.
const WAITING_BYTES: usize = 128 << 20;

/// A topic and the type of its messages.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LiveTopic {
    pub name: String,
    /// Type of the messages, as in a bag: `sensor_msgs/msg/Image`.
    pub schema: String,
}

impl LiveTopic {
    /// True if its messages are images that svl reads.
    pub fn is_image(&self) -> bool {
        image::SCHEMAS.contains(&self.schema.as_str())
    }

    /// True if its messages are calibrations that svl reads.
    pub fn is_calibration(&self) -> bool {
        camera::SCHEMAS.contains(&self.schema.as_str())
    }

    /// True if its messages are static transforms.
    pub fn is_static_transform(&self) -> bool {
        Transforms::reads(&self.channel())
    }

    fn channel(&self) -> Channel {
        Channel::cdr(&self.name, &self.schema)
    }
}

/// Forms pairs of the messages of live topics, in CDR as a bag stores them.
pub struct TopicPairs {
    pairs: PairReader,
    /// The topics that it needs: images left and right, their calibrations, static transforms.
    channels: Vec<Channel>,
    selection: Selection,
    /// Until the first pair.
    first: Option<(FirstMessages, ClockScan)>,
    /// True once the user was warned of another frame of the left images.
    warned_of_frame: bool,
}

impl TopicPairs {
    /// Chooses among `topics`. `source`: its name in warnings.
    ///
    /// # Errors
    /// The reason why no two topics can be the cameras, or why more than two can.
    pub fn new(
        source: &str,
        topics: &[LiveTopic],
        selection: &Selection,
    ) -> std::result::Result<Self, String> {
        let channels: Vec<_> = topics.iter().map(LiveTopic::channel).collect();
        let all: Vec<_> = channels.iter().collect();
        let mut pairs = PairReader::new(source.to_owned(), &all, selection, false)?;
        let is_video = |channel: &&Channel| {
            pairs.images.contains(&channel.topic) && message::is_video(channel)
        };
        if let Some(Channel { topic, schema, .. }) = channels.iter().find(is_video) {
            return Err(format!(
                "{topic}: {schema}, a video, which svl reads from a bag: record it first"
            ));
        }
        pairs.partners = ImagePairing::live(selection.max_skew_ns, WAITING_BYTES);
        pairs.wait = Some(CalibrationWait::default());
        pairs.jumps = Some(0);
        let mut needed: Vec<Channel> = Vec::new();
        let names = pairs.images.iter();
        for name in names.chain(pairs.calibrations.iter().flatten()) {
            let found = channels.iter().find(|channel| channel.topic == *name);
            // One calibration may be that of both.
            needed.extend(found.filter(|found| !needed.contains(found)).cloned());
        }
        let others = Transforms::other_robots(&all, pairs.images.each_ref().map(String::as_str));
        let fixed = channels.iter().filter(|channel| Transforms::reads(channel));
        needed.extend(fixed.filter(|c| !others.contains(&c.topic)).cloned());
        let clocks = ClockScan::new(&pairs.images);
        Ok(Self {
            pairs,
            channels: needed,
            selection: selection.clone(),
            first: Some((FirstMessages::default(), clocks)),
            warned_of_frame: false,
        })
    }

    /// Names of the topics that it needs: images left and right, their calibrations, static
    /// transforms.
    pub fn topics(&self) -> impl Iterator<Item = &str> {
        self.channels.iter().map(|channel| channel.topic.as_str())
    }

    /// Looks at a message of the topic at that index, received at `received_ns`, before the first
    /// pair. True once calibrations, baseline and bit depth can be decided.
    pub fn look_at(&mut self, topic: usize, received_ns: u64, data: &[u8]) -> bool {
        let channel = &self.channels[topic];
        let Some((first, clocks)) = &mut self.first else {
            return true;
        };
        first.take_in(&mut self.pairs, channel, received_ns, data);
        clocks.take_in(channel, received_ns, data);
        first.are_enough(&self.pairs)
    }

    /// True once the clocks of both cameras can be measured by the messages that it looked at.
    pub fn knows_clocks(&self) -> bool {
        let first = self.first.as_ref();
        first.is_none_or(|(_, clocks)| clocks.has_enough())
    }

    /// Decides the bit depth and the clocks by the messages that it looked at.
    ///
    /// # Errors
    /// The errors of the bit depth: 16-bit images that use no bits, or more than the selected ones;
    /// clocks that permit no pair.
    pub fn begin(&mut self) -> Result<()> {
        let Some((first, clocks)) = self.first.take() else {
            return Ok(());
        };
        let channels: Vec<_> = self.channels.iter().collect();
        let clocks = ClockTable::new(&clocks, &channels, &self.selection);
        let name = &self.pairs.name;
        let checked = clocks.check(name);
        checked.map_err(|doubt| Error::other(format!("{name}: {doubt}")))?;
        self.pairs.watch = clocks.watch();
        for channel in &mut self.channels {
            if let Some(rule) = clocks.rules().get(&channel.topic) {
                channel.stamps = *rule;
            }
        }
        first.end(&mut self.pairs, &self.selection)
    }

    /// Adds a message of the topic at that index, received at `received_ns`.
    ///
    /// # Errors
    /// The reason why it cannot be read.
    pub fn take_in(
        &mut self,
        topic: usize,
        received_ns: u64,
        data: &[u8],
    ) -> std::result::Result<(), MessageError> {
        let channel = &self.channels[topic];
        if let Some(first) = self.pairs.frames[0].as_deref().filter(|_| topic == 0)
            && !self.warned_of_frame
            && let Ok((_, frame)) = head(channel, data)
            && frame != first
        {
            self.warned_of_frame = true;
            let used = self.pairs.frame_id().unwrap_or(LEFT_FRAME);
            tracing::warn!(
                "{}: {}: the frame of its images changes from '{first}' to '{frame}'; results \
                 stay in '{used}'",
                self.pairs.name,
                channel.topic
            );
        }
        let taken = self.pairs.take_in(channel, received_ns, data);
        taken.map_err(|e| e.on(&channel.topic))
    }

    /// The next pair that is ready. `now_ns`: the time of a clock that never jumps. A pair waits
    /// for the calibrations of its stamp, at most 0.2 s and one period, then has the last ones
    /// before; after ten pairs with unchanged calibrations none waits.
    ///
    /// # Errors
    /// The reason why two images that belong together cannot be a pair.
    pub fn pop(&mut self, now_ns: u64) -> Option<std::result::Result<Frame, MessageError>> {
        self.pairs
            .wait
            .iter_mut()
            .for_each(|wait| wait.set_now(now_ns));
        self.pairs.pop()
    }

    /// Ends the source: there are no more messages.
    pub fn end(&mut self) {
        self.pairs.end();
    }

    /// The facts of the pairs so far.
    pub fn facts(&self) -> StreamFacts {
        self.pairs.facts()
    }

    /// Images left and right.
    pub fn counts(&self) -> [u64; 2] {
        self.pairs.counts
    }

    /// Images without a partner so far.
    pub fn unpaired(&self) -> u64 {
        self.pairs.partners.pairing.unpaired_ns.len() as u64
    }

    /// Jumps of the cameras' clocks back in time.
    pub fn jumps(&self) -> u64 {
        self.pairs.jumps.unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::ros;
    use crate::message::wire::RosStamp;
    use svl_core::stereo::Gray;

    #[test]
    fn a_name_that_is_no_text_is_an_unreadable_message() {
        let topics = ["/left/image_rect", "/right/image_rect"].map(|name| LiveTopic {
            name: name.to_owned(),
            schema: "sensor_msgs/msg/Image".to_owned(),
        });
        let mut pairs = TopicPairs::new("ros2:", &topics, &Selection::default()).unwrap();
        let stamp = RosStamp::new(1_000_000_000).unwrap();
        let image = Gray::filled(4, 2, 7).unwrap();
        let mut data = ros::encode_8bit(&image, stamp, "left").data;
        let name = data.windows(4).position(|bytes| bytes == b"left").unwrap();
        data[name] = 0xff;
        assert!(!pairs.look_at(0, 0, &data) && pairs.facts().frame_id.is_none());
        let reason = pairs.take_in(0, 0, &data).unwrap_err();
        assert!(
            reason.to_string().starts_with("/left/image_rect: "),
            "{reason}"
        );
        // Cut anywhere, it is unreadable too.
        data[name] = b'l';
        for end in 0..data.len() {
            let taken = pairs.take_in(0, 0, &data[..end]);
            assert!(taken.is_err() || pairs.pop(0).is_none(), "{end} bytes");
        }
        assert_eq!(pairs.take_in(0, 0, &data), Ok(()));
        assert_eq!(pairs.take_in(1, 0, &data), Ok(()));
        assert_eq!(pairs.pop(0).unwrap().unwrap().pair.left(), &image);
    }
}
