//! Recovers the intact records of a truncated or corrupt file.

use crate::bags::container::Container;
use crate::bags::opened::Recording;
use crate::bags::ros1_bag::Ros1Messages;
use crate::mcap::append_file::AppendFile;
use crate::mcap::file::McapFile;
use crate::mcap::messages::Messages;
use crate::mcap::records::{DamagedPart, Records};
use crate::message::sync;
use crate::message::wire::{LIBRARY, topic};
use crate::stream::channel::{EventReader, FileEvent, ROS1, Schema};
use mcap::records::{Channel, MessageHeader, Record};
use std::collections::hash_map::Entry;
use std::collections::{BTreeMap, HashMap};
use std::path::Path;
use svl_core::{Error, Result};

/// Figures of a recovery: recovered and lost parts.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Recovery {
    /// Messages recovered, by topic.
    pub messages: BTreeMap<String, u64>,
    /// Complete pairs in svl's own recordings; 0 in bags.
    pub pairs: u64,
    pub attachments: u64,
    pub metadata: u64,
    /// The damaged parts, in file order.
    pub losses: Vec<DamagedPart>,
    /// Messages counted in the file's own summary but not found, by topic. Empty if it has no
    /// summary.
    pub missing: BTreeMap<String, u64>,
    /// True if the file has more than was recovered: corrupt records, or some that its summary
    /// counts. The record in which a truncated file ends is no such record.
    pub partial: bool,
    /// True if CRCs cover all recovered messages. Otherwise they may contain changed bytes.
    pub checksums: bool,
}

impl Recording {
    /// Copies everything intact, from any writer, into the new file `to`: chunk by chunk, schemas,
    /// topics, messages, attachments and metadata. Anything that does not match its CRC is skipped
    /// and recorded. If the length of a record is corrupt, the copy resynchronizes at the next
    /// proven record; MCAP files appended to the file are copied too.
    ///
    /// # Errors
    /// [`Error::Io`], also if `to` exists; [`Error::Format`] for a file in SQLite or one that has
    /// nothing to recover, in which case `to` is removed, and for a bag of several files.
    pub fn recover(&self, to: &Path) -> Result<Recovery> {
        let from = match self.only_file()? {
            Container::Mcap(file) => file,
            Container::Ros1(file) => return recover_ros1(file, to),
            Container::Sqlite(file) => {
                let cure = "`sqlite3 FILE .recover` does it for SQLite";
                return Err(Error::format(
                    file.path(),
                    format!("is not an MCAP file; {cure}"),
                ));
            }
        };
        let mut messages = Messages::salvage(from)?;
        let first = messages.advance()?;
        let (profile, library) = match first.map(|opcode| messages.records.parse(opcode)) {
            Some(Ok(Record::Header(header))) => (header.profile, header.library),
            _ => Default::default(),
        };
        // Distinguishes a recovered file from an original, also for other programs.
        let library = format!("{LIBRARY}, recovered from {library}");
        let file = AppendFile::create(to.to_owned(), &profile, &library)?;
        let mut copy = Copier {
            file,
            attachments: Records::unread(from)?,
            channels: HashMap::new(),
            recovery: Recovery::default(),
        };
        let saved = copy.all(&mut messages, first);
        let Copier { file, recovery, .. } = copy;
        completed(saved, (file, recovery), (from.path(), to))
    }
}

/// The figures of a recovery whose file is complete.
///
/// # Errors
/// That of `saved`; [`Error::Format`] if nothing was saved. The file is then removed.
fn completed(
    saved: Result<()>,
    (mut file, recovery): (AppendFile, Recovery),
    (from, to): (&Path, &Path),
) -> Result<Recovery> {
    let is_empty = recovery.messages.is_empty() && recovery.attachments + recovery.metadata == 0;
    if saved.is_ok() && !is_empty {
        file.finish()?;
        return Ok(recovery);
    }
    drop(file);
    // An empty file is useless, and would block the next attempt.
    let _ = std::fs::remove_file(to);
    saved?;
    let reason = "contains nothing that can be recovered";
    Err(Error::format(from, reason))
}

/// Copies the messages of a ROS 1 bag that can be read into an MCAP file.
fn recover_ros1(from: &McapFile, to: &Path) -> Result<Recovery> {
    let definitions = Ros1Messages::open(from)?.definitions();
    let mut messages = Ros1Messages::open(from)?;
    let library = format!("{LIBRARY}, recovered from rosbag");
    let mut copy = AppendFile::create(to.to_owned(), ROS1, &library)?;
    let (mut recovery, mut ids) = (Recovery::default(), HashMap::new());
    // The error at the end is the first of the losses.
    while let Ok(Some(FileEvent::Message(channel, log_time, data))) = messages.next() {
        let topic = &channel.topic;
        let channel_id = match ids.get(topic) {
            Some(id) => *id,
            None => {
                let schema = channel.schema.replace("/msg/", "/");
                let definition = definitions.get(topic).map_or("", String::as_str);
                let schema = (schema.as_str(), "ros1msg", definition.as_bytes());
                let id = copy.channel(topic, Some(schema), ROS1, &Default::default())?;
                ids.insert(topic.clone(), id);
                id
            }
        };
        let header = MessageHeader {
            channel_id,
            sequence: 0,
            log_time,
            publish_time: log_time,
        };
        copy.message(&header, &data)?;
        *recovery.messages.entry(topic.clone()).or_default() += 1;
    }
    recovery.losses = messages.take_losses();
    recovery.partial = DamagedPart::have_records_behind(&recovery.losses, from.len());
    completed(Ok(()), (copy, recovery), (from.path(), to))
}

struct Copier {
    file: AppendFile,
    /// Reads the data of the attachments.
    attachments: Records,
    /// Channel ids in the new file, by file and channel id in the old one.
    channels: HashMap<(usize, u16), u16>,
    recovery: Recovery,
}

impl Copier {
    /// Copies everything from the first record on.
    fn all(&mut self, messages: &mut Messages, first: Option<u8>) -> Result<()> {
        let mut next = first;
        while let Some(opcode) = next {
            self.take_in(messages, opcode)?;
            next = messages.advance()?;
        }
        // Topics without messages too.
        for (channel, schema) in messages.declarations() {
            declare(&mut self.file, channel, schema)?;
        }
        let recovery = &mut self.recovery;
        recovery.losses = messages.records.losses.clone();
        recovery.missing = messages.take_missing();
        recovery.partial = messages.lacks || messages.records.has_skipped();
        recovery.checksums = messages.records.is_checked();
        Ok(())
    }

    /// Copies the current record.
    fn take_in(&mut self, messages: &Messages, opcode: u8) -> Result<()> {
        // Checked already.
        let Ok(record) = messages.records.parse(opcode) else {
            return Ok(());
        };
        match record {
            Record::Message { header, data } => {
                let Some((channel, schema)) = messages.declaration(header.channel_id) else {
                    return Ok(());
                };
                // A ROS 2 bag has another schema: its pairs are found by stamps.
                let is_pair = channel.topic == topic::SYNC
                    && schema.is_some_and(|(header, _)| header.name == sync::SCHEMA);
                self.recovery.pairs += u64::from(is_pair);
                // Appended files renumber their channels; equal topics become one channel.
                let channel_id = match self.channels.entry((messages.part(), header.channel_id)) {
                    Entry::Occupied(number) => *number.get(),
                    Entry::Vacant(number) => {
                        *number.insert(declare(&mut self.file, channel, schema)?)
                    }
                };
                self.file.message(
                    &MessageHeader {
                        channel_id,
                        ..header
                    },
                    &data,
                )?;
                *self
                    .recovery
                    .messages
                    .entry(channel.topic.clone())
                    .or_default() += 1;
            }
            Record::Attachment { header, .. } => {
                let (start, bytes) = (messages.records.start, messages.records.attached);
                let file = &mut self.file;
                file.begin_attachment(bytes, header)?;
                let copy = |piece: &[u8]| file.attachment_piece(piece);
                self.attachments.attachment(start, copy)?;
                self.file.finish_attachment()?;
                self.recovery.attachments += 1;
            }
            Record::Metadata(metadata) => {
                self.file.metadata(&metadata)?;
                self.recovery.metadata += 1;
            }
            _ => {}
        }
        Ok(())
    }
}

/// Declares a channel of the old file in the new one.
fn declare(file: &mut AppendFile, channel: &Channel, schema: Option<&Schema>) -> Result<u16> {
    let schema = schema.map(|(header, data)| {
        (
            header.name.as_str(),
            header.encoding.as_str(),
            data.as_slice(),
        )
    });
    file.channel(
        &channel.topic,
        schema,
        &channel.message_encoding,
        &channel.metadata,
    )
}
