//! The messages of an MCAP file with their channels, and its metadata and attachments.

use super::file::McapFile;
use super::records::Records;
use super::search::ANOTHER;
use crate::stream::channel::{Channel, EventReader, FileEvent, Schema};
use mcap::records::{self, Record, op};
use std::collections::{BTreeMap, HashMap};
use svl_core::{Result, counted};

/// The schemas and channels of a file.
#[derive(Clone, Default)]
pub(crate) struct Declared {
    schemas: HashMap<u16, Schema>,
    channels: HashMap<u16, (Channel, records::Channel)>,
    /// Record counts from the statistics in the summary.
    promised: Option<RecordCounts>,
}

#[derive(Clone, Default)]
struct RecordCounts {
    /// By channel.
    messages: BTreeMap<u16, u64>,
    attachments: u64,
    metadata: u64,
}

/// Reads a file from start to end, and any files appended to it.
pub(crate) struct Messages {
    pub(crate) records: Records,
    has_ended: bool,
    /// Declarations of the current file so far.
    declared: Declared,
    /// The file in a salvage, and true once declarations were looked for behind damage.
    file: Option<McapFile>,
    has_looked_ahead: bool,
    found: RecordCounts,
    /// Declarations of the files before the current one.
    past: Vec<Declared>,
    missing: BTreeMap<String, u64>,
    /// True if a summary counts records that were not found.
    pub(crate) lacks: bool,
}

impl Declared {
    /// The channels in the order of their topics.
    pub(crate) fn channels(&self) -> Vec<Channel> {
        let mut channels: Vec<_> = self
            .channels
            .values()
            .map(|(known, _)| known.clone())
            .collect();
        channels.sort_unstable_by(|a, b| a.topic.cmp(&b.topic));
        channels
    }

    /// The channels of `topic`.
    pub(crate) fn ids(&self, topic: &str) -> Vec<u16> {
        let channels = self.channels.iter();
        let of_topic = channels.filter(|(_, (known, _))| known.topic == topic);
        of_topic.map(|(id, _)| *id).collect()
    }

    /// True if statistics count as many attachments and metadata records.
    pub(crate) fn counts(&self, attachments: usize, metadata: usize) -> bool {
        let counts = (attachments as u64, metadata as u64);
        let promised = self.promised.as_ref();
        promised.is_some_and(|promised| (promised.attachments, promised.metadata) == counts)
    }

    /// Forgets the counts of statistics, which may be damaged.
    pub(crate) fn without_counts(mut self) -> Self {
        self.promised = None;
        self
    }

    /// True if statistics count the messages of no channel but those, and all schemas are there:
    /// summaries need not repeat what the chunks declare.
    pub(crate) fn is_whole(&self) -> bool {
        let has_schema = |id: u16| id == 0 || self.schemas.contains_key(&id);
        let mut channels = self.channels.values();
        let counted = |own: &RecordCounts| {
            let mut ids = own.messages.keys();
            ids.all(|id| self.channels.contains_key(id))
        };
        self.promised.as_ref().is_none_or(counted)
            && channels.all(|(_, channel)| has_schema(channel.schema_id))
    }

    /// The same with the counts of other statistics.
    pub(crate) fn with_counts(self, other: Self) -> Self {
        Self {
            promised: other.promised,
            ..self
        }
    }

    /// Message count of `topic` in the summary; `None` without statistics.
    pub(crate) fn count(&self, topic: &str) -> Option<u64> {
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
    pub(crate) fn open(file: &McapFile) -> Result<Self> {
        Ok(Self::new(Records::open(file, true)?, Declared::default()))
    }

    /// Same as [`Messages::open`], but damaged parts are skipped and noted.
    pub(crate) fn salvage(file: &McapFile) -> Result<Self> {
        let records = Records::open(file, false)?;
        Ok(Self {
            file: Some(file.clone()),
            ..Self::new(records, Declared::default())
        })
    }

    /// Same as [`Messages::open`], starting at the chunk at `chunk`. The summary's `declared`
    /// replaces the declarations of the chunks before.
    pub(crate) fn from(file: &McapFile, chunk: u64, declared: Declared) -> Result<Self> {
        let mut records = Records::open(file, true)?;
        records.seek(chunk);
        Ok(Self::new(records, declared))
    }

    pub(crate) fn new(records: Records, declared: Declared) -> Self {
        Self {
            records,
            has_ended: false,
            declared,
            file: None,
            has_looked_ahead: false,
            found: RecordCounts::default(),
            past: Vec::new(),
            missing: BTreeMap::new(),
            lacks: false,
        }
    }

    /// By topic the messages counted in the summaries but not found.
    pub(crate) fn take_missing(&mut self) -> BTreeMap<String, u64> {
        std::mem::take(&mut self.missing)
    }

    /// Declarations of the file, or of the first one if others are appended. Before the end of the
    /// file, those found so far.
    pub(crate) fn declared(&self) -> &Declared {
        self.past.first().unwrap_or(&self.declared)
    }

    /// Everything declared, as it was written: channels and their schemas, file by file.
    pub(crate) fn declarations(
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
    pub(crate) fn declaration(&self, id: u16) -> Option<(&records::Channel, Option<&Schema>)> {
        let (_, channel) = self.declared.channels.get(&id)?;
        Some((channel, self.declared.schemas.get(&channel.schema_id)))
    }

    /// Advances to the next readable record, and returns its opcode; see [`Records::parse`].
    ///
    /// # Errors
    /// The errors of [`Messages::next`].
    pub(crate) fn advance(&mut self) -> Result<Option<u8>> {
        while !self.has_ended {
            let opcode = self.records.advance()?;
            if opcode.is_none_or(|opcode| opcode == ANOTHER) {
                self.close();
            }
            match opcode {
                None => self.has_ended = true,
                Some(ANOTHER) => self.records.begin_another(),
                // Reading ends before what follows the damage.
                Some(_) if self.records.is_broken && self.records.strict => {}
                Some(opcode) => match self.look_ahead(opcode)?.check(opcode) {
                    Ok(()) => return Ok(Some(opcode)),
                    Err(reason) => self.records.lose(&reason)?,
                },
            }
            if self.records.strict
                && (self.has_ended || self.records.is_broken)
                && let Some(error) = self.records.error()
            {
                self.has_ended = true;
                return Err(error);
            }
        }
        Ok(None)
    }

    /// Number of files before the current one in the same file.
    pub(crate) fn part(&self) -> usize {
        self.past.len()
    }

    /// Takes the declarations that follow in the file, once, if the current record lacks its own:
    /// the summary repeats those of corrupt chunks.
    fn look_ahead(&mut self, opcode: u8) -> Result<&mut Self> {
        let Declared {
            schemas, channels, ..
        } = &mut self.declared;
        let lacks = self.records.has_losses()
            && match self.records.parse(opcode) {
                Ok(Record::Message { header, .. }) => !channels.contains_key(&header.channel_id),
                Ok(Record::Channel(channel)) => {
                    channel.schema_id > 0 && !schemas.contains_key(&channel.schema_id)
                }
                _ => false,
            };
        let Some(file) = self
            .file
            .as_ref()
            .filter(|_| lacks && !self.has_looked_ahead)
        else {
            return Ok(self);
        };
        self.has_looked_ahead = true;
        let mut records = Records::unread(file)?;
        records.seek(self.records.start);
        let mut ahead = Self::new(records, Declared::default());
        while ahead.past.is_empty() && ahead.advance()?.is_some() {}
        let found = ahead.declared().clone();
        for (id, schema) in found.schemas {
            schemas.entry(id).or_insert(schema);
        }
        for (id, (_, raw)) in found.channels {
            let channel = Channel::declared(&raw, schemas);
            channels.entry(id).or_insert((channel, raw));
        }
        Ok(self)
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
                let new = Channel::declared(&channel, schemas);
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
                if !channels.contains_key(&header.channel_id) {
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

    /// Ends the current file: notes what it lacks of all that its summary promises.
    fn close(&mut self) {
        let found = std::mem::take(&mut self.found);
        self.has_looked_ahead = false;
        self.past.push(std::mem::take(&mut self.declared));
        let Some(Declared {
            channels,
            promised: Some(promised),
            ..
        }) = self.past.last()
        else {
            return;
        };
        // Chunks were skipped, so no messages were counted.
        if !self.records.reads_all() {
            return;
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
        if !lacking.is_empty() && !self.records.has_losses() {
            let lacking = lacking.join(" and ");
            self.records.missing(&format!(
                "its summary counts {lacking} more than it contains"
            ));
        }
    }

    fn event(&self, opcode: u8) -> Option<FileEvent<'_>> {
        // Checked already.
        Some(match self.records.parse(opcode).ok()? {
            Record::Message { header, data } => {
                let (channel, _) = self.declared.channels.get(&header.channel_id)?;
                FileEvent::Message(channel, header.log_time, data)
            }
            Record::Metadata(metadata) => FileEvent::Metadata(metadata),
            Record::Attachment { header, .. } => FileEvent::Attachment {
                start: self.records.start,
                name: header.name,
                bytes: self.records.attached,
            },
            Record::Header(header) => FileEvent::Library(header),
            _ => return None,
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
                return Ok(self.event(opcode));
            }
        }
        Ok(None)
    }
}
