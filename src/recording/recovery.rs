//! Saves what an unfinished or damaged file still holds.

use super::append::Append;
use super::messages::{Event, Messages};
use super::records::{Loss, Records};
use super::{Kind, LIBRARY};
use crate::error::{Error, Result};
use mcap::records::{self, Record, SchemaHeader, op};
use mcap::{Attachment, records::Channel};
use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::path::Path;

/// What was saved, and what was not.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Recovery {
    /// Messages saved, by topic.
    pub messages: BTreeMap<String, u64>,
    /// Pairs that svl wrote whole.
    pub pairs: u64,
    pub attachments: u64,
    pub metadata: u64,
    /// What is damaged, in the order of the file.
    pub losses: Vec<Loss>,
    /// Messages that the file's own summary counts and that were not found, by topic. Empty where it has no summary.
    pub missing: BTreeMap<String, u64>,
}

/// Copies everything whole in the MCAP file `from`, whoever wrote it, into the new file `to`: chunk by chunk, schemas,
/// topics, messages, attachments and metadata. What does not fit its CRC is passed over and noted.
///
/// # Errors
/// [`Error::Io`], also when `to` exists; [`Error::Format`] for what is not an MCAP file or holds nothing to save, of which
/// no file is left.
pub fn recover(from: &Path, to: &Path) -> Result<Recovery> {
    let (profile, library) = match Messages::open(from)?.next() {
        Ok(Some(Event::Library(header))) => (header.profile, header.library),
        _ => Default::default(),
    };
    let mut salvage = Salvage {
        records: Records::open(from)?,
        file: Append::create(to.to_owned(), &profile, &format!("{LIBRARY}, recovered from {library}"))?,
        schemas: HashMap::new(),
        channels: HashMap::new(),
        promised: BTreeMap::new(),
        recovery: Recovery::default(),
    };
    let saved = salvage.run(from);
    if matches!(saved, Ok(true)) {
        salvage.file.finish()?;
    } else {
        drop(salvage.file);
        // A file of nothing is of no use, and would stand in the way of the next attempt.
        let _ = std::fs::remove_file(to);
    }
    match saved? {
        true => Ok(salvage.recovery),
        false => Err(Error::format(from, "holds nothing that could be saved")),
    }
}

struct Salvage {
    records: Records,
    file: Append,
    schemas: HashMap<u16, (SchemaHeader, Vec<u8>)>,
    /// As they were declared, with their numbers in the new file.
    channels: HashMap<u16, (Channel, Option<u16>)>,
    /// Messages that the file should have, by topic.
    promised: BTreeMap<String, u64>,
    recovery: Recovery,
}

impl Salvage {
    /// Copies all there is; whether there was anything.
    fn run(&mut self, from: &Path) -> Result<bool> {
        // What a damaged chunk declared, the summary declares again; a damaged one is of no use.
        if self.records.seek_summary()? && !self.read_summary()? {
            (self.schemas, self.channels, self.promised) = Default::default();
        }
        self.records = Records::open(from)?;
        self.records.salvage();
        while let Some(opcode) = self.records.advance()? {
            if let Err(reason) = self.take_in(opcode)? {
                self.records.lose(&reason)?;
            }
        }
        let mut silent: Vec<_> = self.channels.values().filter(|(_, number)| number.is_none()).collect();
        silent.sort_unstable_by_key(|(channel, _)| channel.id);
        for (channel, _) in silent {
            declare(&mut self.file, channel, &self.schemas)?;
        }
        let recovery = &mut self.recovery;
        recovery.losses = self.records.take_losses();
        recovery.pairs = recovery.messages.get(Kind::Sync.topic()).copied().unwrap_or(0);
        for (topic, promised) in std::mem::take(&mut self.promised) {
            let missing = promised.saturating_sub(recovery.messages.get(&topic).copied().unwrap_or(0));
            if missing > 0 {
                recovery.missing.insert(topic, missing);
            }
        }
        Ok(!recovery.messages.is_empty() || recovery.attachments + recovery.metadata > 0)
    }

    /// Takes in what the summary declares; whether it is whole.
    fn read_summary(&mut self) -> Result<bool> {
        loop {
            match self.records.advance() {
                Ok(None) => return Ok(true),
                Ok(Some(opcode @ (op::SCHEMA | op::CHANNEL | op::STATISTICS))) => {
                    if self.take_in(opcode)?.is_err() {
                        return Ok(false);
                    }
                }
                Ok(Some(_)) => {}
                Err(Error::Damaged { .. }) => return Ok(false),
                Err(error) => return Err(error),
            }
        }
    }

    /// Copies the current record, or says why it cannot be read.
    fn take_in(&mut self, opcode: u8) -> Result<std::result::Result<(), String>> {
        match opcode {
            op::SCHEMA | op::CHANNEL | op::MESSAGE | op::ATTACHMENT | op::METADATA | op::STATISTICS => {}
            _ => return Ok(Ok(())),
        }
        let record = match self.records.parse(opcode) {
            Ok(record) => record,
            Err(reason) => return Ok(Err(reason)),
        };
        match record {
            Record::Schema { header, data } => {
                self.schemas.insert(header.id, (header, data.into_owned()));
            }
            Record::Channel(channel) if self.channels.get(&channel.id).is_none_or(|(known, _)| *known != channel) => {
                self.channels.insert(channel.id, (channel, None));
            }
            Record::Message { header, data } => {
                let Some((channel, number)) = self.channels.get_mut(&header.channel_id) else {
                    return Ok(Err(format!("a message of unknown channel {}", header.channel_id)));
                };
                let channel_id = match number {
                    Some(number) => *number,
                    None => *number.insert(declare(&mut self.file, channel, &self.schemas)?),
                };
                self.file.message(&records::MessageHeader { channel_id, ..header }, &data)?;
                *self.recovery.messages.entry(channel.topic.clone()).or_default() += 1;
            }
            Record::Attachment { header, data, crc } => {
                let body = self.records.body();
                let calculated = crc32fast::hash(&body[..body.len() - 4]);
                if crc != 0 && crc != calculated {
                    let name = header.name;
                    return Ok(Err(format!(
                        "the CRC of the attachment '{name}' is {calculated:08x}, {crc:08x} expected"
                    )));
                }
                let records::AttachmentHeader { log_time, create_time, name, media_type } = header;
                let data = Cow::Borrowed(&*data);
                self.file.attach(&Attachment { log_time, create_time, name, media_type, data })?;
                self.recovery.attachments += 1;
            }
            Record::Metadata(metadata) => {
                self.file.metadata(&metadata)?;
                self.recovery.metadata += 1;
            }
            Record::Statistics(statistics) => {
                self.promised.clear();
                for (id, n) in &statistics.channel_message_counts {
                    if let Some((channel, _)) = self.channels.get(id) {
                        let promised = self.promised.entry(channel.topic.clone()).or_default();
                        *promised = promised.saturating_add(*n);
                    }
                }
            }
            _ => {}
        }
        Ok(Ok(()))
    }
}

/// Declares a channel in the new file, as it was in the old one.
fn declare(file: &mut Append, channel: &Channel, schemas: &HashMap<u16, (SchemaHeader, Vec<u8>)>) -> Result<u16> {
    let schema = schemas.get(&channel.schema_id);
    let schema = schema.map(|(header, data)| (header.name.as_str(), header.encoding.as_str(), data.as_slice()));
    file.channel(&channel.topic, schema, &channel.message_encoding, &channel.metadata)
}
