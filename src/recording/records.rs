//! The records of an MCAP file, read from start to end in bounded memory.
//!
//! mcap's own readers take lengths out of a chunk before its CRC is known to be good, and reserve memory for them; here
//! every length is checked against what the file can hold, a chunk is used only when its CRC fits, and the CRCs of data
//! and summary section are checked on the way. So any changed byte is noticed, at the latest at the end.

use super::bag::not_mcap;
use super::chunk::Chunk;
use crate::error::{Error, Result};
use mcap::records::{Record, op};
use std::cell::Cell;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Longest record and chunk: an image of the largest size in 32-bit floats, and as much again.
pub(super) const MAX_RECORD: u64 = 2 << 30;
/// Footer record and end magic.
const TAIL: u64 = 9 + 20 + 8;

/// A part of a file that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Loss {
    pub at_byte: u64,
    /// How long the part is; 0 where something was never written.
    pub bytes: u64,
    pub reason: String,
}

impl std::fmt::Display for Loss {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "the recording is incomplete or damaged at byte {}: {}", self.at_byte, self.reason)
    }
}

/// Raw records, those inside chunks included.
///
/// Reading ends at the first damage, unless they are salvaged: then what is damaged is passed over, and noted.
pub(super) struct Records {
    path: PathBuf,
    file: BufReader<File>,
    len: u64,
    /// Bytes read so far.
    at: u64,
    /// Where the current record of the file itself begins.
    start: u64,
    /// Of the section being read.
    crc: crc32fast::Hasher,
    body: Vec<u8>,
    chunk: Chunk,
    /// Whether the current record stands in `chunk`.
    in_chunk: bool,
    /// In a cell, because whoever finds damage ends the reading.
    ended: Cell<bool>,
    /// What was passed over, where they are salvaged.
    losses: Option<Vec<Loss>>,
    /// Whether chunks are left unread, and the section that has them unchecked.
    skips_chunks: bool,
}

impl Records {
    pub(super) fn open(path: &Path) -> Result<Self> {
        let io = |e| Error::io(path, e);
        let file = File::open(path).map_err(io)?;
        let metadata = file.metadata().map_err(io)?;
        if metadata.is_dir() {
            return Err(Error::format(path, "is a folder, not a recording"));
        }
        let mut records = Self {
            path: path.to_owned(),
            file: BufReader::with_capacity(1 << 18, file),
            len: metadata.len(),
            at: 0,
            start: 0,
            crc: crc32fast::Hasher::new(),
            body: Vec::new(),
            chunk: Chunk::new().map_err(io)?,
            in_chunk: false,
            ended: Cell::new(false),
            losses: None,
            skips_chunks: false,
        };
        if records.len == 0 {
            return Err(Error::format(path, "is empty: nothing was recorded, or not yet"));
        }
        let mut magic = [0; 8];
        if records.len < 8 || records.read(&mut magic).is_err() || magic != mcap::MAGIC {
            return Err(Error::format(path, not_mcap(&magic)));
        }
        Ok(records)
    }

    /// From here on passes over what is damaged.
    pub(super) fn salvage(&mut self) {
        self.losses = Some(Vec::new());
    }

    /// From here on reads only what stands outside of chunks: neither messages nor the damage among them.
    pub(super) fn skip_chunks(&mut self) {
        self.skips_chunks = true;
    }

    /// What was passed over.
    pub(super) fn take_losses(&mut self) -> Vec<Loss> {
        self.losses.take().unwrap_or_default()
    }

    /// Goes to the summary section; false where the file has none.
    pub(super) fn seek_summary(&mut self) -> Result<bool> {
        let mut tail = [0; TAIL as usize];
        let Some(footer) = self.len.checked_sub(TAIL) else { return Ok(false) };
        self.seek(footer)?;
        self.read(&mut tail)?;
        let start = u64_at(&tail, 9).unwrap_or(0);
        if tail[0] != op::FOOTER || tail[29..] != *mcap::MAGIC || start == 0 || start > footer {
            return Ok(false);
        }
        self.seek(start)?;
        self.crc = crc32fast::Hasher::new();
        Ok(true)
    }

    fn seek(&mut self, to: u64) -> Result<()> {
        self.at = self.file.seek(SeekFrom::Start(to)).map_err(|e| Error::io(&self.path, e))?;
        Ok(())
    }

    fn read(&mut self, bytes: &mut [u8]) -> Result<()> {
        self.file.read_exact(bytes).map_err(|e| Error::io(&self.path, e))?;
        self.at += bytes.len() as u64;
        self.crc.update(bytes);
        Ok(())
    }

    /// Goes to the next record and says what it is; nothing at the end of the file, and after an error.
    pub(super) fn advance(&mut self) -> Result<Option<u8>> {
        let opcode = if self.ended.get() { Ok(None) } else { self.step() };
        if !matches!(opcode, Ok(Some(_))) {
            self.ended.set(true);
        }
        opcode
    }

    /// The record that [`Records::advance`] went to.
    pub(super) fn body(&self) -> &[u8] {
        if self.in_chunk { self.chunk.body() } else { &self.body }
    }

    /// The current record, taken apart, or why it cannot be read.
    pub(super) fn parse(&self, opcode: u8) -> std::result::Result<Record<'_>, String> {
        let body = self.body();
        // mcap 0.25 panics on an attachment that ends before its CRC.
        if opcode == op::ATTACHMENT && !attachment_fits(body) {
            return Err("an attachment is cut short".to_owned());
        }
        mcap::parse_record(opcode, body).map_err(|e| format!("a record cannot be read: {e}"))
    }

    fn step(&mut self) -> Result<Option<u8>> {
        loop {
            self.in_chunk = !self.chunk.is_done();
            if self.in_chunk {
                match self.chunk.advance() {
                    Ok(opcode) => return Ok(Some(opcode)),
                    Err(reason) => {
                        self.chunk.clear();
                        self.lose(reason)?;
                        continue;
                    }
                }
            }
            self.start = self.at;
            match self.top()? {
                Some(op::CHUNK) if self.skips_chunks => {}
                Some(op::CHUNK) => {
                    if let Err(reason) = self.chunk.open(&self.body) {
                        self.lose(&format!("a chunk is damaged: {reason}"))?;
                    }
                }
                opcode => return Ok(opcode),
            }
        }
    }

    /// Reads the next record of the file itself into `body`.
    fn top(&mut self) -> Result<Option<u8>> {
        let left = self.len - self.at;
        if left == 0 {
            return self.lose_the_rest("it was never finished");
        }
        if left < 9 {
            return self.lose_the_rest("it ends inside a record");
        }
        let section = self.crc.clone();
        let mut head = [0; 9];
        self.read(&mut head)?;
        let (opcode, length) = (head[0], u64_at(&head, 1).unwrap_or(u64::MAX));
        let left = self.len - self.at;
        if length > left {
            let reason = format!("it ends inside a record of {length} bytes, of which it has {left}");
            return self.lose_the_rest(&reason);
        }
        if length > MAX_RECORD {
            return self.lose_the_rest(&format!("a record of {length} bytes is longer than {MAX_RECORD}"));
        }
        if opcode == op::CHUNK && self.skips_chunks {
            // No more than the file has.
            self.file.seek_relative(length as i64).map_err(|e| Error::io(&self.path, e))?;
            self.at += length;
            return Ok(Some(opcode));
        }
        self.body.resize(length as usize, 0);
        self.file.read_exact(&mut self.body).map_err(|e| Error::io(&self.path, e))?;
        self.at += length;
        self.crc.update(&self.body);
        match opcode {
            op::DATA_END => {
                self.check_crc("data section", section, u32_at(&self.body, 0))?;
                self.crc = crc32fast::Hasher::new();
            }
            op::FOOTER => {
                let mut summary = section;
                summary.update(&head);
                summary.update(self.body.get(..16).unwrap_or_default());
                self.check_crc("summary section", summary, u32_at(&self.body, 16))?;
                return self.finish();
            }
            _ => {}
        }
        Ok(Some(opcode))
    }

    fn finish(&mut self) -> Result<Option<u8>> {
        let mut magic = [0; 8];
        if self.len - self.at != 8 || self.read(&mut magic).is_err() || magic != mcap::MAGIC {
            return self.lose_the_rest("it does not end as an MCAP file does");
        }
        Ok(None)
    }

    /// Passes over the current record of the file and notes why; an error unless records are salvaged.
    pub(super) fn lose(&mut self, reason: &str) -> Result<()> {
        let loss = Loss { at_byte: self.start, bytes: self.at - self.start, reason: reason.to_owned() };
        match &mut self.losses {
            Some(losses) => losses.push(loss),
            None => return Err(self.damaged(reason)),
        }
        Ok(())
    }

    /// As [`Records::lose`], of all that follows.
    fn lose_the_rest(&mut self, reason: &str) -> Result<Option<u8>> {
        if self.losses.is_some() {
            self.at = self.len;
        }
        self.lose(reason).map(|()| None)
    }

    fn check_crc(&mut self, section: &str, crc: crc32fast::Hasher, saved: Option<u32>) -> Result<()> {
        let calculated = crc.finalize();
        match saved {
            Some(_) if self.skips_chunks => Ok(()),
            Some(saved) if saved == 0 || saved == calculated => Ok(()),
            // Explained by what was found damaged already.
            Some(_) if self.losses.as_ref().is_some_and(|losses| !losses.is_empty()) => Ok(()),
            Some(saved) => {
                self.start = self.at;
                self.lose(&format!("the CRC of its {section} is {calculated:08x}, {saved:08x} expected"))
            }
            None => self.lose(&format!("the end of its {section} is cut short")),
        }
    }

    /// The error for damage met at this place, after which there are no more records.
    pub(super) fn damaged(&self, reason: &str) -> Error {
        self.ended.set(true);
        let loss = Loss { at_byte: self.at, bytes: 0, reason: reason.to_owned() };
        Error::damaged(&self.path, loss.to_string())
    }
}

/// Whether an attachment's body has room for two times, name, media type, length and CRC.
fn attachment_fits(body: &[u8]) -> bool {
    let after_string = |at: usize| at.checked_add(4)?.checked_add(u32_at(body, at)? as usize);
    after_string(16).and_then(after_string).is_some_and(|end| body.len() >= end.saturating_add(8 + 4))
}

pub(super) fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..)?.first_chunk().map(|b| u32::from_le_bytes(*b))
}

pub(super) fn u64_at(bytes: &[u8], at: usize) -> Option<u64> {
    bytes.get(at..)?.first_chunk().map(|b| u64::from_le_bytes(*b))
}
