//! The index of one MCAP file: its writer, topics, message counts, metadata and attachments.
//!
//! It is read from the summary section. Only if that is missing, corrupt or incomplete, all of the
//! file is read.

use crate::mcap::file::McapFile;
use crate::mcap::messages::{Declared, Messages};
use crate::mcap::records::Records;
use crate::message::wire::topic;
use crate::stream::channel::{EventReader, FileEvent};
use mcap::records::{ChunkIndex, Header, Metadata, Record, op};
use std::path::Path;
use svl_core::{Error, Result};

/// The contents of a file besides its messages.
#[derive(Default)]
pub(crate) struct Index {
    /// MCAP's header: profile and library. `None` if it cannot be read.
    pub(crate) header: Option<Header>,
    /// Topics, and message counts if there is an intact summary.
    pub(crate) declared: Declared,
    /// Metadata records in the order of the file.
    pub(crate) metadata: Vec<Metadata>,
    /// Names of the attachments and positions of their records, in file order.
    pub(crate) attachments: Vec<(String, u64)>,
    /// Starts of the chunks in file order, if there is an intact summary.
    pub(crate) chunks: Vec<u64>,
    /// The first damage, if the file was read for want of a summary.
    damage: Option<String>,
}

/// Contents of an intact summary section.
#[derive(Default)]
struct Summary {
    declared: Declared,
    attachments: Vec<(String, u64)>,
    /// Positions of the metadata records.
    metadata: Vec<u64>,
    /// The chunks in the order of the file.
    chunks: Vec<ChunkIndex>,
}

/// The pairs of svl's own recording, to go on from any of them.
pub(crate) struct PairIndex {
    pub(crate) declared: Declared,
    /// Stamps in order, each with the start of the first chunk that has messages of its pair.
    pub(crate) pairs: Vec<(u64, u64)>,
}

impl PairIndex {
    /// `None` if the file has no intact index of all its pairs, or if pairs share a stamp.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn read(file: &McapFile) -> Result<Option<Self>> {
        let Some(Summary {
            declared, chunks, ..
        }) = Summary::read(file)?
        else {
            return Ok(None);
        };
        if !declared.is_whole() {
            return Ok(None);
        }
        let channels = declared.ids(topic::SYNC);
        let mut records = Records::open(file, true)?;
        let mut pairs = Vec::new();
        let mut before = None;
        for chunk in &chunks {
            let start = chunk.chunk_start_offset;
            // The images may be in the chunk before the one that ends the pair.
            let from = before.replace(start).unwrap_or(start);
            for offset in channels
                .iter()
                .filter_map(|id| chunk.message_index_offsets.get(id))
            {
                let Some(Record::MessageIndex(index)) = records.record_at(*offset)? else {
                    return Ok(None);
                };
                pairs.extend(index.records.iter().map(|message| (message.log_time, from)));
            }
        }
        let is_whole = declared.count(topic::SYNC) == Some(pairs.len() as u64)
            // A stamp shared by several pairs does not identify one.
            && pairs.is_sorted_by(|a, b| a.0 < b.0);
        Ok(is_whole.then_some(Self { declared, pairs }))
    }
}

impl Summary {
    /// `None` if the file has none, or it is corrupt or not where the footer says.
    ///
    /// # Errors
    /// [`Error::Io`].
    fn read(file: &McapFile) -> Result<Option<Self>> {
        let mut records = Records::unread(file)?;
        if !records.seek_summary()? {
            return Ok(None);
        }
        let mut messages = Messages::new(records, Declared::default());
        let mut found = Self::default();
        while let Some(opcode) = messages.advance()? {
            match messages.records.parse(opcode) {
                Ok(Record::AttachmentIndex(index)) => {
                    found.attachments.push((index.name, index.offset));
                }
                Ok(Record::MetadataIndex(index)) => found.metadata.push(index.offset),
                Ok(Record::ChunkIndex(index)) => found.chunks.push(index),
                _ if is_data(opcode) => return Ok(None),
                _ => {}
            }
        }
        if !messages.records.losses.is_empty() {
            return Ok(None);
        }
        // Writers may list them in any order; the first in the file wins among equal names.
        found.attachments.sort_by_key(|(_, start)| *start);
        found.metadata.sort_unstable();
        found.chunks.sort_by_key(|chunk| chunk.chunk_start_offset);
        found.declared = messages.declared().clone();
        Ok(Some(found))
    }
}

/// True if records of this kind belong to the data section, including its end.
fn is_data(opcode: u8) -> bool {
    matches!(
        opcode,
        op::HEADER | op::MESSAGE | op::MESSAGE_INDEX | op::ATTACHMENT | op::METADATA | op::DATA_END
    )
}

impl Index {
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] for a file that is not MCAP.
    pub(crate) fn read(file: &McapFile) -> Result<Self> {
        let Some(summary) = Summary::read(file)? else {
            let index = Self::walk(file)?;
            let declared = index.declared.without_counts();
            return Ok(Self { declared, ..index });
        };
        // The counts of an intact summary are valid even if its index entries are not.
        let is_whole = summary.declared.is_whole();
        let chunks = summary.chunks.iter();
        let chunks = chunks.map(|chunk| chunk.chunk_start_offset).collect();
        let index = match Self::from_summary(file, &summary)? {
            Some(index) if is_whole => index,
            _ => Self::walk(file)?,
        };
        let declared = if is_whole {
            summary.declared
        } else {
            index.declared.with_counts(summary.declared)
        };
        Ok(Self {
            declared,
            chunks,
            ..index
        })
    }

    /// The index from the summary section; `None` if that does not list everything, or points to a
    /// wrong position.
    fn from_summary(file: &McapFile, summary: &Summary) -> Result<Option<Self>> {
        let (attachments, metadata) = (&summary.attachments, &summary.metadata);
        if !summary.declared.counts(attachments.len(), metadata.len()) {
            return Ok(None);
        }
        let mut records = Records::open(file, true)?;
        let mut index = Self::default();
        if let Ok(Some(op::HEADER)) = records.advance()
            && let Ok(Record::Header(header)) = records.parse(op::HEADER)
        {
            index.header = Some(header);
        }
        for &start in metadata {
            match records.record_at(start)? {
                Some(Record::Metadata(metadata)) => index.metadata.push(metadata),
                _ => return Ok(None),
            }
        }
        for (name, start) in attachments {
            // Only the head: an attachment may be of any size, and few are requested.
            if records.opcode_at(*start)? != Some(op::ATTACHMENT) {
                return Ok(None);
            }
            index.attachments.push((name.clone(), *start));
        }
        Ok(Some(index))
    }

    fn walk(file: &McapFile) -> Result<Self> {
        let mut index = Self::default();
        let mut messages = Messages::salvage(file)?;
        while let Some(event) = messages.next()? {
            match event {
                FileEvent::Library(header) => drop(index.header.get_or_insert(header)),
                FileEvent::Metadata(metadata) => index.metadata.push(metadata),
                FileEvent::Attachment { start, name, .. } => index.attachments.push((name, start)),
                FileEvent::Message(..) => {}
            }
        }
        index.damage = messages.records.losses.first().map(ToString::to_string);
        index.declared = messages.declared().clone();
        Ok(index)
    }

    /// # Errors
    /// [`Error::Damaged`] if the file was read and is damaged: more may be there.
    pub(crate) fn check_complete(&self, path: &Path) -> Result<()> {
        let damage = self.damage.as_ref();
        damage.map_or(Ok(()), |reason| Err(Error::damaged(path, reason.clone())))
    }
}
