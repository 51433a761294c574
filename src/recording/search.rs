//! Resynchronization: searches a damaged file for the next record, as the damage may be in the
//! lengths that lead from one record to the next.
//!
//! A record counts as proven if it is:
//! - a chunk with consistent lengths that decompresses into complete records, and matches its CRC
//!   or, without a CRC, is followed by another record;
//! - an attachment that matches its CRC;
//! - such a chunk or attachment with unknown fields behind its own, followed by another record;
//! - metadata with consistent lengths, or the end of the data section, followed by another record;
//! - the magic of an appended file.
//!
//! Every position is examined once, and a budget limits the bytes read for positions that merely
//! look like records. So the time is linear in the length of the file, whatever its content.

use super::chunk::{Chunk, chunk_size};
use super::file::FileReader;
use super::layout::{HEAD, MAX_RECORD, is_record, known_size, u64_at};
use mcap::records::{Record, op};
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::ops::Range;

/// Bytes searched at a time.
const WINDOW: usize = 1 << 18;
/// Bytes of a record that suffice for a first check.
const LOOK: usize = 64;
/// Limit on the length of an attachment up to its data, of metadata, and of the unknown fields of
/// any record, for the search.
const MAX_BESIDE: u64 = 1 << 16;

/// Searches one file.
pub(super) struct RecordSearch {
    file: FileReader,
    len: u64,
    /// Bytes that may still be read and decompressed in vain.
    budget: u64,
    body: Vec<u8>,
    chunk: Chunk,
}

impl RecordSearch {
    pub(super) fn new(file: FileReader, len: u64) -> io::Result<Self> {
        // 16 times the file size: many fake chunk heads end the search early instead of taking the
        // user's time.
        let budget = len.saturating_mul(16).saturating_add(16 << 20);
        Ok(Self {
            file,
            len,
            budget,
            body: Vec::new(),
            chunk: Chunk::new()?,
        })
    }

    /// The first position in `range` where a proven record begins.
    ///
    /// # Errors
    /// The errors of reading the file.
    pub(super) fn next(&mut self, range: Range<u64>) -> io::Result<Option<u64>> {
        let mut window = Vec::new();
        let mut at = range.start;
        while at < range.end && self.budget > 0 {
            let left = (range.end - at)
                .saturating_add(LOOK as u64)
                .min(self.len - at);
            let bytes = WINDOW.min(usize::try_from(left).unwrap_or(WINDOW));
            window.resize(bytes, 0);
            self.file.seek(SeekFrom::Start(at))?;
            self.file.read_exact(&mut window)?;
            // Records that begin near the end of the window are examined in the next one.
            let last = at + bytes as u64 == self.len;
            let places = if last { bytes } else { bytes - LOOK };
            let places = places.min(usize::try_from(range.end - at).unwrap_or(places));
            for i in 0..places {
                let place = at + i as u64;
                if self.proves(place, &window[i..bytes.min(i + LOOK)])? {
                    return Ok(Some(place));
                }
            }
            at += places as u64;
        }
        Ok(None)
    }

    /// True if the record at this position is proven.
    pub(super) fn proves_at(&mut self, at: u64) -> io::Result<bool> {
        self.read(at, (self.len - at).min(LOOK as u64))?;
        let head = self.body.clone();
        self.proves(at, &head)
    }

    /// Same as [`RecordSearch::proves_at`], with the first bytes in `head`.
    fn proves(&mut self, at: u64, head: &[u8]) -> io::Result<bool> {
        if head.starts_with(mcap::MAGIC) {
            return self.is_header(at + 8);
        }
        let may_be = matches!(
            head[0],
            op::CHUNK | op::ATTACHMENT | op::METADATA | op::DATA_END
        );
        let Some(length) = u64_at(head, 1).filter(|_| may_be) else {
            return Ok(false);
        };
        let body = at + HEAD;
        // Before any reading: most fakes have absurd lengths.
        if length > MAX_RECORD.min(self.len - body) || self.budget == 0 {
            return Ok(false);
        }
        match head[0] {
            op::CHUNK => self.proves_chunk(body, length, &head[HEAD as usize..]),
            op::ATTACHMENT => self.proves_attachment(body, length),
            op::METADATA if length <= MAX_BESIDE => self.proves_metadata(body, length),
            op::DATA_END => Ok(length == 4 && self.goes_on(body + length)?),
            _ => Ok(false),
        }
    }

    /// Proves a chunk by its records. `record`: the first bytes of its body.
    fn proves_chunk(&mut self, body: u64, length: u64, record: &[u8]) -> io::Result<bool> {
        let (Some(size), Some(known)) = (
            chunk_size(record, length),
            near_size(op::CHUNK, record, length),
        ) else {
            return Ok(false);
        };
        self.read(body, known)?;
        let opened = self.chunk.open(&self.body).is_ok() && self.chunk.has_only_complete_records();
        self.chunk.clear();
        // A chunk with a corrupt length may still decompress into records, across those that
        // follow.
        let is_sure = self.chunk.has_crc() && known == length;
        let fits = opened && (is_sure || self.goes_on(body + length)?);
        Ok(self.paid(fits, known + size))
    }

    fn proves_attachment(&mut self, body: u64, length: u64) -> io::Result<bool> {
        let start = length.min(MAX_BESIDE);
        self.read(body, start)?;
        let Some(known) = near_size(op::ATTACHMENT, &self.body, length) else {
            return Ok(self.paid(false, start));
        };
        self.read(body, known)?;
        // Without a CRC any bytes could be an attachment.
        let has_crc = self.body.last_chunk() != Some(&[0; 4]);
        let opened = has_crc && mcap::parse_record(op::ATTACHMENT, &self.body).is_ok();
        let fits = opened && (known == length || self.goes_on(body + length)?);
        Ok(self.paid(fits, known))
    }

    fn proves_metadata(&mut self, body: u64, length: u64) -> io::Result<bool> {
        self.read(body, length)?;
        let metadata = mcap::parse_record(op::METADATA, &self.body);
        let named = match metadata {
            Ok(Record::Metadata(metadata)) => !metadata.name.is_empty(),
            _ => false,
        };
        let fits = named
            && known_size(op::METADATA, &self.body, length).is_some()
            && self.goes_on(body + length)?;
        Ok(self.paid(fits, length))
    }

    /// True if the header record of a file is there.
    pub(super) fn is_header(&mut self, at: u64) -> io::Result<bool> {
        let Some(left) = self.len.checked_sub(at + HEAD) else {
            return Ok(false);
        };
        self.read(at, HEAD)?;
        let length = u64_at(&self.body, 1)
            .filter(|&length| self.body[0] == op::HEADER && length <= left.min(MAX_BESIDE));
        let Some(length) = length else {
            return Ok(false);
        };
        self.read(at + HEAD, length)?;
        let fits = known_size(op::HEADER, &self.body, length).is_some();
        Ok(self.paid(fits, length))
    }

    /// Deducts bytes from the budget.
    pub(super) fn spend(&mut self, bytes: u64) {
        self.budget = self.budget.saturating_sub(bytes);
    }

    /// Returns `is_right`, and deducts `bytes` from the budget if it is false.
    fn paid(&mut self, is_right: bool, bytes: u64) -> bool {
        if !is_right {
            self.spend(bytes);
        }
        is_right
    }

    /// True if the bytes at `at` look like a record.
    fn goes_on(&mut self, at: u64) -> io::Result<bool> {
        let Some(left) = self.len.checked_sub(at + HEAD) else {
            return Ok(false);
        };
        self.read(at, HEAD)?;
        Ok(is_record(self.body[0])
            && u64_at(&self.body, 1).is_some_and(|length| length <= left.min(MAX_RECORD)))
    }

    /// Reads `length` bytes, which must be in the file.
    fn read(&mut self, at: u64, length: u64) -> io::Result<()> {
        self.body.resize(length as usize, 0);
        self.file.seek(SeekFrom::Start(at))?;
        self.file.read_exact(&mut self.body)
    }
}

/// Length of the known fields of a record, if few unknown ones follow.
fn near_size(opcode: u8, body: &[u8], length: u64) -> Option<u64> {
    known_size(opcode, body, length).filter(|known| length - known <= MAX_BESIDE)
}
