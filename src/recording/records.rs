//! The records of an MCAP file, read from start to end in bounded memory.
//!
//! mcap's own readers take lengths out of a chunk before its CRC is known to be good, and reserve memory for them; here
//! every length is checked against what the file can hold, a chunk is used only when its CRC fits, and the CRCs of data
//! and summary section are checked on the way. So any changed byte is noticed, at the latest at the end.

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

/// Raw records, those inside chunks included.
pub(super) struct Records {
    path: PathBuf,
    file: BufReader<File>,
    len: u64,
    /// Bytes read so far.
    at: u64,
    /// Of the section being read.
    crc: crc32fast::Hasher,
    body: Vec<u8>,
    chunk: Chunk,
    /// Whether the current record stands in `chunk`.
    in_chunk: bool,
    /// In a cell, because whoever finds damage ends the reading.
    ended: Cell<bool>,
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
            crc: crc32fast::Hasher::new(),
            body: Vec::new(),
            chunk: Chunk::new().map_err(io)?,
            in_chunk: false,
            ended: Cell::new(false),
        };
        if records.len == 0 {
            return Err(Error::format(path, "is empty: nothing was recorded, or not yet"));
        }
        let mut magic = [0; 8];
        if records.len < 8 || records.read(&mut magic).is_err() || magic != mcap::MAGIC {
            return Err(Error::format(path, "is not an MCAP file; svl reads recordings in MCAP (.mcap)"));
        }
        Ok(records)
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

    /// The current record, taken apart.
    pub(super) fn parse(&self, opcode: u8) -> Result<Record<'_>> {
        let body = self.body();
        // mcap 0.25 panics on an attachment that ends before its CRC.
        if opcode == op::ATTACHMENT && !attachment_fits(body) {
            return Err(self.damaged("an attachment is cut short"));
        }
        mcap::parse_record(opcode, body).map_err(|e| self.damaged(&format!("a record cannot be read: {e}")))
    }

    fn step(&mut self) -> Result<Option<u8>> {
        loop {
            self.in_chunk = !self.chunk.is_done();
            if self.in_chunk {
                let opcode = self.chunk.advance();
                return opcode.map(Some).map_err(|reason| self.damaged(reason));
            }
            match self.top()? {
                Some(op::CHUNK) => self.open_chunk()?,
                opcode => return Ok(opcode),
            }
        }
    }

    /// Reads the next record of the file itself into `body`.
    fn top(&mut self) -> Result<Option<u8>> {
        let left = self.len - self.at;
        if left == 0 {
            return Err(self.damaged("it was never finished"));
        }
        if left < 9 {
            return Err(self.damaged("it ends inside a record"));
        }
        let section = self.crc.clone();
        let mut head = [0; 9];
        self.read(&mut head)?;
        let (opcode, length) = (head[0], u64_at(&head, 1).unwrap_or(u64::MAX));
        let left = self.len - self.at;
        if length > left {
            return Err(self.damaged(&format!("it ends inside a record of {length} bytes, of which it has {left}")));
        }
        if length > MAX_RECORD {
            return Err(self.damaged(&format!("a record of {length} bytes is longer than {MAX_RECORD}")));
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
            return Err(self.damaged("it does not end as an MCAP file does"));
        }
        Ok(None)
    }

    fn open_chunk(&mut self) -> Result<()> {
        let opened = self.chunk.open(&self.body);
        opened.map_err(|reason| self.damaged(&format!("a chunk is damaged: {reason}")))
    }

    fn check_crc(&self, section: &str, crc: crc32fast::Hasher, saved: Option<u32>) -> Result<()> {
        let calculated = crc.finalize();
        match saved {
            Some(saved) if saved == 0 || saved == calculated => Ok(()),
            Some(saved) => {
                Err(self.damaged(&format!("the CRC of its {section} is {calculated:08x}, {saved:08x} expected")))
            }
            None => Err(self.damaged(&format!("the end of its {section} is cut short"))),
        }
    }

    /// The error for damage met at this place, after which there are no more records.
    pub(super) fn damaged(&self, reason: &str) -> Error {
        self.ended.set(true);
        Error::damaged(&self.path, format!("the recording is incomplete or damaged at byte {}: {reason}", self.at))
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
