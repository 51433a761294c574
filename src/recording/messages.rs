//! The messages of an MCAP file with their channels, and what stands between them.

use super::records::Records;
use crate::error::Result;
use mcap::records::{Header, Metadata, Record, op};
use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::path::Path;

/// Where messages of one topic come from, and how to read them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Channel {
    pub(super) topic: String,
    pub(super) schema: String,
    pub(super) encoding: String,
}

/// What a file holds, piece by piece.
pub(super) enum Event<'a> {
    Message {
        channel: &'a Channel,
        log_time: u64,
        data: Cow<'a, [u8]>,
    },
    Metadata(Metadata),
    Attachment {
        name: String,
        data: Cow<'a, [u8]>,
    },
    Library(Header),
    /// Messages per channel, from the summary section.
    Counts(BTreeMap<u16, u64>),
}

/// Reads a file from start to end.
pub(super) struct Messages {
    records: Records,
    schemas: HashMap<u16, String>,
    channels: HashMap<u16, Channel>,
}

impl Messages {
    /// # Errors
    /// [`crate::Error::Io`]; [`crate::Error::Format`] for what is not an MCAP file.
    pub(super) fn open(path: &Path) -> Result<Self> {
        Ok(Self { records: Records::open(path)?, schemas: HashMap::new(), channels: HashMap::new() })
    }

    /// How many messages `topic` has by the file's summary, where it has one.
    pub(super) fn count(path: &Path, topic: &str) -> Result<Option<u64>> {
        let mut summary = Self::open(path)?;
        if !summary.records.seek_summary()? {
            return Ok(None);
        }
        let mut counts = None;
        while let Some(event) = summary.next()? {
            if let Event::Counts(found) = event {
                counts = Some(found);
            }
        }
        let of_topic = |id: &u16| summary.channels.get(id).is_some_and(|channel| channel.topic == topic);
        Ok(counts.map(|c| c.iter().filter(|(id, _)| of_topic(id)).fold(0, |sum: u64, (_, &n)| sum.saturating_add(n))))
    }

    /// Channels met so far, in the order of their topics.
    pub(super) fn channels(&self) -> Vec<&Channel> {
        let mut channels: Vec<_> = self.channels.values().collect();
        channels.sort_unstable_by(|a, b| a.topic.cmp(&b.topic));
        channels
    }

    /// All channels of the file at `path`: those its summary names, or else those met on reading it, as far as it goes.
    pub(super) fn all_channels(path: &Path) -> Result<Vec<Channel>> {
        let mut messages = Self::open(path)?;
        if messages.records.seek_summary()? {
            while let Ok(Some(_)) = messages.next() {}
        }
        if messages.channels.is_empty() {
            messages = Self::open(path)?;
            while let Ok(Some(_)) = messages.next() {}
        }
        Ok(messages.channels().into_iter().cloned().collect())
    }

    /// The next piece; nothing at the end of the file, and after an error.
    ///
    /// # Errors
    /// [`crate::Error::Damaged`] where the file ends early or is not what its CRCs say.
    pub(super) fn next(&mut self) -> Result<Option<Event<'_>>> {
        while let Some(opcode) = self.records.advance()? {
            match opcode {
                op::SCHEMA | op::CHANNEL => self.declare(opcode)?,
                op::MESSAGE | op::METADATA | op::ATTACHMENT | op::HEADER | op::STATISTICS => {
                    return self.event(opcode);
                }
                _ => {}
            }
        }
        Ok(None)
    }

    fn declare(&mut self, opcode: u8) -> Result<()> {
        match self.records.parse(opcode)? {
            Record::Schema { header, .. } => {
                self.schemas.insert(header.id, header.name);
            }
            Record::Channel(channel) => {
                let schema = self.schemas.get(&channel.schema_id).cloned().unwrap_or_default();
                let (topic, encoding) = (channel.topic, channel.message_encoding);
                self.channels.insert(channel.id, Channel { topic, schema, encoding });
            }
            _ => {}
        }
        Ok(())
    }

    fn event(&self, opcode: u8) -> Result<Option<Event<'_>>> {
        Ok(match self.records.parse(opcode)? {
            Record::Message { header, data } => {
                let unknown = || self.records.damaged(&format!("a message of unknown channel {}", header.channel_id));
                let channel = self.channels.get(&header.channel_id).ok_or_else(unknown)?;
                Some(Event::Message { channel, log_time: header.log_time, data })
            }
            Record::Metadata(metadata) => Some(Event::Metadata(metadata)),
            Record::Attachment { header, data, .. } => Some(Event::Attachment { name: header.name, data }),
            Record::Header(header) => Some(Event::Library(header)),
            Record::Statistics(statistics) => Some(Event::Counts(statistics.channel_message_counts)),
            _ => None,
        })
    }
}
