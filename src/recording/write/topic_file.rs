//! Messages of live topics into a bag, as they came.

use super::dialect::Dialect;
use crate::mcap::append_file::AppendFile;
use crate::message::wire::LIBRARY;
use crate::read::topic_pairs::LiveTopic;
use mcap::records::MessageHeader;
use std::collections::BTreeMap;
use std::path::Path;
use svl_core::Result;

/// Writes a ROS 2 bag in MCAP of messages in CDR, without the definitions of their types.
pub struct TopicFile {
    file: AppendFile,
    channels: Vec<u16>,
}

impl TopicFile {
    /// # Errors
    /// [`svl_core::Error::Io`] if the file exists already or cannot be created.
    pub fn create(path: &Path, topics: &[LiveTopic]) -> Result<Self> {
        let profile = Dialect::Ros2.profile();
        let mut file = AppendFile::create(path.to_owned(), profile, LIBRARY)?;
        let channel = |topic: &LiveTopic| {
            let schema = (topic.schema.as_str(), "ros2msg", &[][..]);
            file.channel(&topic.name, Some(schema), "cdr", &BTreeMap::new())
        };
        let channels = topics.iter().map(channel).collect::<Result<_>>()?;
        Ok(Self { file, channels })
    }

    /// Writes a message of the topic at that index, received at `received_ns`.
    ///
    /// # Errors
    /// [`svl_core::Error::Io`].
    pub fn write(&mut self, topic: usize, received_ns: u64, data: &[u8]) -> Result<()> {
        let header = MessageHeader {
            channel_id: self.channels[topic],
            sequence: 0,
            log_time: received_ns,
            publish_time: received_ns,
        };
        self.file.message(&header, data)
    }

    /// Completes the file.
    ///
    /// # Errors
    /// [`svl_core::Error::Io`].
    pub fn finish(&mut self) -> Result<()> {
        self.file.finish()
    }
}
