//! The messages of an MCAP file with their channels, and its metadata and attachments.

use super::file::McapFile;
use super::records::{ANOTHER, Records};
use super::ros::ROS1;
use super::salvage::DamagedPart;
use mcap::records::{self, ChunkIndex, Header, Metadata, Record, SchemaHeader, op};
use parking_lot::Mutex;
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use svl_core::counted;
use svl_core::{Error, Result};

/// A topic with the encoding of its messages.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Channel {
    pub(super) topic: String,
    pub(super) schema: String,
    pub(super) encoding: String,
}

impl Channel {
    /// Types of ROS 1 are named as those of ROS 2 with the same fields.
    pub(super) fn new(topic: String, schema: String, encoding: String) -> Self {
        let schema = match schema.split_once('/') {
            Some(("tf", "tfMessage")) if encoding == ROS1 => "tf2_msgs/msg/TFMessage".to_owned(),
            Some((package, name)) if encoding == ROS1 => format!("{package}/msg/{name}"),
            _ => schema,
        };
        Self {
            topic,
            schema,
            encoding,
        }
    }
}

/// One message, metadata record or attachment, or the header of a file.
pub(super) enum FileEvent<'a> {
    /// A message with its channel and log time.
    Message(&'a Channel, u64, Cow<'a, [u8]>),
    Metadata(Metadata),
    Attachment {
        /// Start of its record.
        start: u64,
        name: String,
        data: Cow<'a, [u8]>,
    },
    Library(Header),
}

/// Reads the messages of a file, and its other records.
pub(super) trait EventReader: Send {
    /// The next event; `None` at the end of the file and after an error.
    ///
    /// # Errors
    /// [`svl_core::Error::Damaged`] if the file ends early or contradicts its CRCs.
    fn next(&mut self) -> Result<Option<FileEvent<'_>>>;
}

/// The schemas and channels of a file.
#[derive(Clone, Default)]
pub(super) struct Declared {
    schemas: HashMap<u16, Schema>,
    channels: HashMap<u16, (Channel, records::Channel)>,
    /// Record counts from the statistics in the summary.
    promised: Option<RecordCounts>,
}

pub(super) type Schema = (SchemaHeader, Vec<u8>);

#[derive(Clone, Default)]
struct RecordCounts {
    /// By channel.
    messages: BTreeMap<u16, u64>,
    attachments: u64,
    metadata: u64,
}

/// Reads a file from start to end, and any files appended to it.
pub(super) struct Messages {
    records: Records,
    /// Declarations of the current file so far.
    declared: Declared,
    found: RecordCounts,
    /// Declarations of the files before the current one.
    past: Vec<Declared>,
    /// Declarations of each file known before reading it: the summary repeats those of corrupt
    /// chunks.
    beforehand: Vec<Declared>,
    missing: BTreeMap<String, u64>,
    /// True if a summary counts records that were not found.
    lacks: bool,
}

/// The summary section of a file.
pub(super) enum Section {
    Missing,
    Intact(Box<Contents>),
    /// Not at the position in the footer, or corrupt.
    Unknown,
}

/// Contents of a summary section.
pub(super) struct Contents {
    pub(super) declared: Declared,
    /// Names of the attachments and positions of their records, in file order.
    pub(super) attachments: Vec<(String, u64)>,
    /// Positions of the metadata records.
    pub(super) metadata: Vec<u64>,
    /// The chunks in the order of the file.
    pub(super) chunks: Vec<ChunkIndex>,
}

impl Contents {
    /// True if it lists all attachments and metadata records.
    pub(super) fn is_complete(&self) -> bool {
        self.declared.promised.as_ref().is_some_and(|promised| {
            promised.attachments == self.attachments.len() as u64
                && promised.metadata == self.metadata.len() as u64
        })
    }
}

impl Declared {
    /// The channels in the order of their topics.
    pub(super) fn channels(&self) -> Vec<Channel> {
        let mut channels: Vec<_> = self
            .channels
            .values()
            .map(|(known, _)| known.clone())
            .collect();
        channels.sort_unstable_by(|a, b| a.topic.cmp(&b.topic));
        channels
    }

    /// The channels of `topic`.
    pub(super) fn ids(&self, topic: &str) -> Vec<u16> {
        let channels = self.channels.iter();
        let of_topic = channels.filter(|(_, (known, _))| known.topic == topic);
        of_topic.map(|(id, _)| *id).collect()
    }

    /// Message count of `topic` in the summary; `None` without statistics.
    pub(super) fn count(&self, topic: &str) -> Option<u64> {
        let of_topic = |id: &u16| {
            self.channels
                .get(id)
                .is_some_and(|(known, _)| known.topic == topic)
        };
        let counts = self
            .promised
            .as_ref()?
            .messages
            .iter()
            .filter(|(id, _)| of_topic(id));
        Some(counts.fold(0, |sum, (_, n)| sum.saturating_add(*n)))
    }
}

impl Messages {
    /// # Errors
    /// [`svl_core::Error::Io`]; [`svl_core::Error::Format`] for a file that is not MCAP.
    pub(super) fn open(file: &McapFile) -> Result<Self> {
        Ok(Self::new(Records::open(file)?, Vec::new()))
    }

    /// Same as [`Messages::open`], for the intact parts of a corrupt file: see
    /// [`Records::salvage`].
    pub(super) fn salvage(file: &McapFile) -> Result<Self> {
        let beforehand = match Self::summary(file)? {
            Section::Missing => Vec::new(),
            Section::Intact(contents) => vec![contents.declared],
            // Declarations of corrupt chunks may be repeated anywhere in the file: one pass finds
            // them.
            Section::Unknown => {
                let mut messages = Self::new(Records::salvage(file)?, Vec::new());
                while messages.advance()?.is_some() {}
                messages.past
            }
        };
        Ok(Self::new(Records::salvage(file)?, beforehand))
    }

    /// Same as [`Messages::open`], starting at the chunk at `chunk`. The summary's `declared`
    /// replaces the declarations of the chunks before.
    pub(super) fn from(file: &McapFile, chunk: u64, declared: Declared) -> Result<Self> {
        let mut records = Records::open(file)?;
        records.seek_chunk(chunk)?;
        Ok(Self::new(records, vec![declared]))
    }

    /// Same as [`Messages::open`], only for the records outside of chunks.
    pub(super) fn beside(file: &McapFile) -> Result<Self> {
        let mut messages = Self::open(file)?;
        messages.records.skip_chunks();
        Ok(messages)
    }

    fn new(records: Records, beforehand: Vec<Declared>) -> Self {
        Self {
            records,
            declared: Declared::default(),
            found: RecordCounts::default(),
            past: Vec::new(),
            beforehand,
            missing: BTreeMap::new(),
            lacks: false,
        }
    }

    /// Reads the summary section.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(super) fn summary(file: &McapFile) -> Result<Section> {
        // The start is corrupt; salvage looks for the rest.
        let Ok(records) = Records::open(file) else {
            return Ok(Section::Unknown);
        };
        let mut messages = Self::new(records, Vec::new());
        if !messages.records.seek_summary()? {
            return Ok(Section::Missing);
        }
        let (mut attachments, mut metadata) = (Vec::new(), Vec::new());
        let mut chunks = Vec::new();
        loop {
            match messages.advance() {
                Ok(Some(opcode)) => match messages.records.parse(opcode) {
                    Ok(Record::AttachmentIndex(index)) => {
                        attachments.push((index.name, index.offset));
                    }
                    Ok(Record::MetadataIndex(index)) => metadata.push(index.offset),
                    Ok(Record::ChunkIndex(index)) => chunks.push(index),
                    _ => {}
                },
                Ok(None) => break,
                Err(Error::Damaged { .. }) => return Ok(Section::Unknown),
                Err(error) => return Err(error),
            }
        }
        // Writers may list them in any order; the first in the file wins among equal names.
        attachments.sort_by_key(|(_, start)| *start);
        metadata.sort_unstable();
        chunks.sort_by_key(|chunk| chunk.chunk_start_offset);
        Ok(Section::Intact(Box::new(Contents {
            declared: messages.past.swap_remove(0),
            attachments,
            metadata,
            chunks,
        })))
    }

    /// Damaged parts, and by topic the messages counted in the summaries but not found.
    pub(super) fn take_losses(&mut self) -> (Vec<DamagedPart>, BTreeMap<String, u64>) {
        (
            self.records.take_losses(),
            std::mem::take(&mut self.missing),
        )
    }

    /// True if the file has, by its summary or by what was skipped, more than was read.
    pub(super) fn has_more(&self) -> bool {
        self.lacks || self.records.has_skipped()
    }

    /// True if all messages read so far are covered by a CRC.
    pub(super) fn is_checked(&self) -> bool {
        self.records.is_checked()
    }

    /// Channels of the file, or of the first one if others are appended, in the order of their
    /// topics. Before the end of the file, those found so far.
    pub(super) fn channels(&self) -> Vec<Channel> {
        self.past.first().unwrap_or(&self.declared).channels()
    }

    /// Everything declared, as it was written: channels and their schemas, file by file.
    pub(super) fn declarations(
        &self,
    ) -> impl Iterator<Item = (&records::Channel, Option<&Schema>)> {
        self.past
            .iter()
            .chain([&self.declared])
            .flat_map(|declared| {
                let mut channels: Vec<_> = declared
                    .channels
                    .values()
                    .map(|(_, channel)| channel)
                    .collect();
                channels.sort_unstable_by_key(|channel| channel.id);
                channels
                    .into_iter()
                    .map(|channel| (channel, declared.schemas.get(&channel.schema_id)))
            })
    }

    /// A channel of the current file, as it was written, and its schema.
    pub(super) fn declaration(&self, id: u16) -> Option<(&records::Channel, Option<&Schema>)> {
        let (_, channel) = self.channel(id)?;
        let before = || {
            self.beforehand
                .get(self.past.len())?
                .schemas
                .get(&channel.schema_id)
        };
        Some((
            channel,
            self.declared
                .schemas
                .get(&channel.schema_id)
                .or_else(before),
        ))
    }

    fn channel(&self, id: u16) -> Option<&(Channel, records::Channel)> {
        let before = || self.beforehand.get(self.past.len())?.channels.get(&id);
        self.declared.channels.get(&id).or_else(before)
    }

    /// Advances to the next readable record, and returns its opcode; see [`Messages::record`].
    ///
    /// # Errors
    /// The errors of [`Messages::next`].
    pub(super) fn advance(&mut self) -> Result<Option<u8>> {
        loop {
            if self.records.has_ended() {
                return Ok(None);
            }
            let opcode = self.records.advance()?;
            if opcode.is_none_or(|opcode| opcode == ANOTHER) {
                self.close()?;
            }
            let Some(opcode) = opcode else {
                return Ok(None);
            };
            if opcode == ANOTHER {
                self.records.begin_another()?;
                continue;
            }
            match self.check(opcode) {
                Ok(()) => return Ok(Some(opcode)),
                Err(reason) => self.records.lose(&reason)?,
            }
        }
    }

    /// The record that [`Messages::advance`] reached.
    pub(super) fn record(&self, opcode: u8) -> Result<Record<'_>> {
        self.records
            .parse(opcode)
            .map_err(|reason| self.records.damaged(&reason))
    }

    /// Number of files before the current one in the same file.
    pub(super) fn part(&self) -> usize {
        self.past.len()
    }

    /// Stores the declarations of the current record, and checks that it can be read.
    fn check(&mut self, opcode: u8) -> std::result::Result<(), String> {
        match opcode {
            op::MESSAGE
            | op::METADATA
            | op::ATTACHMENT
            | op::HEADER
            | op::STATISTICS
            | op::SCHEMA
            | op::CHANNEL => {}
            _ => return Ok(()),
        }
        let before = self.beforehand.get(self.past.len());
        let Declared {
            schemas,
            channels,
            promised,
        } = &mut self.declared;
        match self.records.parse(opcode)? {
            Record::Schema { header, data } => {
                // MCAP allows repetitions, in every chunk and in the summary, if they are equal.
                let same = |(known, _): &Schema| {
                    (&known.name, &known.encoding) == (&header.name, &header.encoding)
                };
                if !schemas.get(&header.id).is_none_or(same) {
                    return Err(format!(
                        "schema {} is declared twice, differently",
                        header.id
                    ));
                }
                schemas.insert(header.id, (header, data.into_owned()));
            }
            Record::Channel(channel) => {
                let id = channel.schema_id;
                let schema = schemas.get(&id).or_else(|| before?.schemas.get(&id));
                let schema = schema
                    .map(|(schema, _)| schema.name.clone())
                    .unwrap_or_default();
                let (topic, encoding) = (channel.topic.clone(), channel.message_encoding.clone());
                let new = Channel::new(topic, schema, encoding);
                if !channels
                    .get(&channel.id)
                    .is_none_or(|(known, _)| *known == new)
                {
                    return Err(format!(
                        "channel {} is declared twice, differently",
                        channel.id
                    ));
                }
                channels.insert(channel.id, (new, channel));
            }
            Record::Message { header, .. } => {
                let id = &header.channel_id;
                if !channels.contains_key(id)
                    && !before.is_some_and(|before| before.channels.contains_key(id))
                {
                    // The topic was in a corrupt part, so the message is unusable.
                    return Err("a message belongs to an undeclared channel".to_owned());
                }
                *self.found.messages.entry(header.channel_id).or_default() += 1;
            }
            Record::Attachment { .. } => self.found.attachments += 1,
            Record::Metadata(_) => self.found.metadata += 1,
            Record::Statistics(statistics) => {
                *promised = Some(RecordCounts {
                    messages: statistics.channel_message_counts,
                    attachments: statistics.attachment_count.into(),
                    metadata: statistics.metadata_count.into(),
                });
            }
            _ => {}
        }
        Ok(())
    }

    /// The declarations of the current file, with those that were read beforehand.
    fn take_declared(&mut self) -> Declared {
        let mut declared = std::mem::take(&mut self.declared);
        if let Some(before) = self.beforehand.get_mut(self.past.len()).map(std::mem::take) {
            for (id, schema) in before.schemas {
                declared.schemas.entry(id).or_insert(schema);
            }
            for (id, channel) in before.channels {
                declared.channels.entry(id).or_insert(channel);
            }
            declared.promised = declared.promised.or(before.promised);
        }
        declared
    }

    /// Ends the current file: checks that it has everything its summary promises.
    fn close(&mut self) -> Result<()> {
        let found = std::mem::take(&mut self.found);
        let declared = self.take_declared();
        self.past.push(declared);
        let Some(Declared {
            channels,
            promised: Some(promised),
            ..
        }) = self.past.last()
        else {
            return Ok(());
        };
        // Chunks were skipped, so no messages were counted.
        if !self.records.reads_all() {
            return Ok(());
        }
        let mut messages = 0_u64;
        for (id, n) in &promised.messages {
            // More messages than counted are not a loss.
            let missing = n.saturating_sub(found.messages.get(id).copied().unwrap_or(0));
            messages = messages.saturating_add(missing);
            if let Some((channel, _)) = channels.get(id).filter(|_| missing > 0) {
                let sum = self.missing.entry(channel.topic.clone()).or_default();
                *sum = sum.saturating_add(missing);
            }
        }
        let lacking = [
            (messages, "message"),
            (
                promised.attachments.saturating_sub(found.attachments),
                "attachment",
            ),
            (
                promised.metadata.saturating_sub(found.metadata),
                "metadata record",
            ),
        ];
        let lacking: Vec<_> = lacking
            .iter()
            .filter(|(n, _)| *n > 0)
            .map(|(n, noun)| counted(*n, noun))
            .collect();
        self.lacks |= !lacking.is_empty();
        // Damage found before explains missing records.
        if lacking.is_empty() || self.records.has_losses() {
            return Ok(());
        }
        self.records.missing(&format!(
            "its summary counts {} more than it contains",
            lacking.join(" and ")
        ))
    }

    fn event(&self, opcode: u8) -> Result<Option<FileEvent<'_>>> {
        Ok(match self.record(opcode)? {
            Record::Message { header, data } => {
                let channel = self.channel(header.channel_id);
                channel.map(|(channel, _)| FileEvent::Message(channel, header.log_time, data))
            }
            Record::Metadata(metadata) => Some(FileEvent::Metadata(metadata)),
            Record::Attachment { header, data, .. } => Some(FileEvent::Attachment {
                start: self.records.start(),
                name: header.name,
                data,
            }),
            Record::Header(header) => Some(FileEvent::Library(header)),
            _ => None,
        })
    }
}

impl EventReader for Messages {
    fn next(&mut self) -> Result<Option<FileEvent<'_>>> {
        while let Some(opcode) = self.advance()? {
            if matches!(
                opcode,
                op::MESSAGE | op::METADATA | op::ATTACHMENT | op::HEADER
            ) {
                return self.event(opcode);
            }
        }
        Ok(None)
    }
}

/// Limit on different warnings.
const MAX_WARNINGS: usize = 100;

/// Warns once in a process: pairs, truth and places read the poses of a recording each.
pub(super) fn warn_once(warning: String) {
    static WARNED: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());
    let mut warned = WARNED.lock();
    if warned.len() < MAX_WARNINGS && !warned.contains(&warning) {
        tracing::warn!("{warning}");
        warned.insert(warning);
    }
}
