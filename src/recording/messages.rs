//! The messages of an MCAP file with their channels, and what stands between them.

use super::records::{Loss, Records};
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
    /// Messages per topic, from the summary section.
    Counts(BTreeMap<String, u64>),
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

    /// As [`Messages::open`], for what is still good in a damaged file: see [`Records`].
    pub(super) fn salvage(path: &Path) -> Result<Self> {
        let mut messages = Self::open(path)?;
        // What a damaged chunk declared, the summary declares again; a damaged one is of no use.
        if messages.records.seek_summary()? {
            let whole = loop {
                match messages.next() {
                    Ok(Some(_)) => {}
                    end => break end.is_ok(),
                }
            };
            if !whole {
                messages = Self::open(path)?;
            }
        }
        messages.records = Records::open(path)?;
        messages.records.salvage();
        Ok(messages)
    }

    /// As [`Messages::open`], for what stands beside the messages alone.
    pub(super) fn beside(path: &Path) -> Result<Self> {
        let mut messages = Self::open(path)?;
        messages.records.skip_chunks();
        Ok(messages)
    }

    /// What was passed over.
    pub(super) fn take_losses(&mut self) -> Vec<Loss> {
        self.records.take_losses()
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
        Ok(counts.map(|counts| counts.get(topic).copied().unwrap_or(0)))
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
            if let Err(reason) = self.check(opcode) {
                self.records.lose(&reason)?;
                continue;
            }
            match opcode {
                op::MESSAGE | op::METADATA | op::ATTACHMENT | op::HEADER | op::STATISTICS => {
                    return self.event(opcode);
                }
                _ => {}
            }
        }
        Ok(None)
    }

    /// Takes in what the current record declares, and makes sure that it can be read.
    fn check(&mut self, opcode: u8) -> std::result::Result<(), String> {
        match opcode {
            op::MESSAGE | op::METADATA | op::ATTACHMENT | op::HEADER | op::STATISTICS | op::SCHEMA | op::CHANNEL => {}
            _ => return Ok(()),
        }
        match self.records.parse(opcode)? {
            Record::Schema { header, .. } => {
                self.schemas.insert(header.id, header.name);
            }
            Record::Channel(channel) => {
                let schema = self.schemas.get(&channel.schema_id).cloned().unwrap_or_default();
                let (topic, encoding) = (channel.topic, channel.message_encoding);
                self.channels.insert(channel.id, Channel { topic, schema, encoding });
            }
            Record::Message { header, .. } if !self.channels.contains_key(&header.channel_id) => {
                return Err(format!("a message of unknown channel {}", header.channel_id));
            }
            _ => {}
        }
        Ok(())
    }

    fn event(&self, opcode: u8) -> Result<Option<Event<'_>>> {
        let record = self.records.parse(opcode).map_err(|reason| self.records.damaged(&reason))?;
        Ok(match record {
            Record::Message { header, data } => {
                let channel = self.channels.get(&header.channel_id);
                channel.map(|channel| Event::Message { channel, log_time: header.log_time, data })
            }
            Record::Metadata(metadata) => Some(Event::Metadata(metadata)),
            Record::Attachment { header, data, .. } => Some(Event::Attachment { name: header.name, data }),
            Record::Header(header) => Some(Event::Library(header)),
            Record::Statistics(statistics) => {
                let mut counts = BTreeMap::<String, u64>::new();
                for (id, n) in &statistics.channel_message_counts {
                    if let Some(channel) = self.channels.get(id) {
                        let count = counts.entry(channel.topic.clone()).or_default();
                        *count = count.saturating_add(*n);
                    }
                }
                Some(Event::Counts(counts))
            }
            _ => None,
        })
    }
}
