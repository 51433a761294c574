//! The index of one MCAP file: its writer, topics, message counts, metadata and attachments.
//!
//! It is read from the summary section. Only if that is missing, corrupt or incomplete, the file is
//! walked from record to record, skipping its chunks.

use super::file::McapFile;
use super::messages::{Contents, Declared, EventReader, FileEvent, Messages, Section};
use super::records::Records;
use mcap::records::{Header, Metadata, Record, op};
use std::path::Path;
use svl_core::{Error, Result};

/// The contents of a file besides its messages.
#[derive(Default)]
pub(super) struct Index {
    /// MCAP's header: profile and library. `None` if it cannot be read.
    pub(super) header: Option<Header>,
    /// Topics and message counts; empty without a summary.
    pub(super) declared: Declared,
    /// Metadata records in the order of the file.
    pub(super) metadata: Vec<Metadata>,
    /// Names of the attachments and positions of their records, in file order.
    pub(super) attachments: Vec<(String, u64)>,
    /// Position and reason of the walk's end, if before the end of the file.
    damage: Option<String>,
}

impl Index {
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] for a file that is not MCAP.
    pub(super) fn read(file: &McapFile) -> Result<Self> {
        let Section::Intact(contents) = Messages::summary(file)? else {
            return Self::walk(file);
        };
        // The counts of an intact summary are valid even if its index entries are not.
        let index = match Self::from_summary(file, &contents)? {
            Some(index) => index,
            None => Self::walk(file)?,
        };
        let declared = contents.declared;
        Ok(Self { declared, ..index })
    }

    /// The index from the summary section; `None` if that does not list everything, or points to a
    /// wrong position.
    fn from_summary(file: &McapFile, contents: &Contents) -> Result<Option<Self>> {
        if !contents.is_complete() {
            return Ok(None);
        }
        let mut records = Records::open(file)?;
        let mut index = Self::default();
        if let Ok(Some(op::HEADER)) = records.advance()
            && let Ok(Record::Header(header)) = records.parse(op::HEADER)
        {
            index.header = Some(header);
        }
        for &start in &contents.metadata {
            match records.record_at(start)? {
                Some(Record::Metadata(metadata)) => index.metadata.push(metadata),
                _ => return Ok(None),
            }
        }
        for (name, start) in &contents.attachments {
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
        let mut messages = Messages::beside(file)?;
        loop {
            match messages.next() {
                Ok(Some(FileEvent::Library(header))) => drop(index.header.get_or_insert(header)),
                Ok(Some(FileEvent::Metadata(metadata))) => index.metadata.push(metadata),
                Ok(Some(FileEvent::Attachment { start, name, .. })) => {
                    index.attachments.push((name, start));
                }
                // Only in files without chunks.
                Ok(Some(FileEvent::Message(..))) => {}
                Ok(None) => return Ok(index),
                Err(Error::Damaged { reason, .. }) => {
                    index.damage = Some(reason);
                    return Ok(index);
                }
                Err(error) => return Err(error),
            }
        }
    }

    /// # Errors
    /// [`Error::Damaged`] if the walk did not reach the end of the file.
    pub(super) fn check_complete(&self, path: &Path) -> Result<()> {
        let damage = self.damage.as_ref();
        damage.map_or(Ok(()), |reason| Err(Error::damaged(path, reason.clone())))
    }
}
