//! Records of an MCAP file at any position: each is checked as far as it can be on its own, and the
//! next one that is proven is found behind damage, as that may be in the lengths that lead from one
//! record to the next.
//!
//! Every position is examined once, and a budget limits the bytes read for positions that merely
//! look like records. So the time is linear in the length of the file, whatever its content.

use super::chunk;
use super::file::{FileReader, McapFile};
use super::layout::{HEAD, MAX_RECORD, has_fields, is_record, known_size, u32_at, u64_at};
use crc32fast::Hasher;
use mcap::records::{Record, op};
use std::io::Result as IoResult;
use std::ops::Range;

/// Code for the magic of an appended file. No record has this opcode.
pub(crate) const ANOTHER: u8 = 0;
/// Opcodes from here on are private to other programs.
pub(crate) const PRIVATE: u8 = 0x80;
/// Bytes read at a time.
const WINDOW: u64 = 1 << 18;
/// Bytes read ahead of records that are smaller.
const AHEAD: u64 = 1 << 16;
/// Bytes of a record that suffice for a first check.
const LOOK: u64 = 64;
/// Limit on the length of an attachment up to its data, and for a proof on that of metadata and of
/// unknown fields.
const MAX_BESIDE: u64 = 1 << 16;

/// One file, and the last record loaded from it.
pub(crate) struct RecordSearch {
    file: FileReader,
    pub(crate) len: u64,
    /// A piece of the file, and its position.
    ahead: Vec<u8>,
    ahead_at: u64,
    /// Bytes that may still be read and unpacked in vain, and those read so far.
    budget: u64,
    read: u64,
    /// The body of the record; of an attachment, as if it had no data.
    pub(crate) body: Vec<u8>,
    /// The records of a chunk.
    pub(crate) unpacked: Vec<u8>,
    zstd: zstd::bulk::Decompressor<'static>,
}

/// A record with a length that fits the file and its own fields.
pub(crate) struct LoadedRecord {
    pub(crate) opcode: u8,
    pub(crate) end: u64,
    /// Start of what is behind the known fields.
    pub(crate) unknown: u64,
    /// CRC of its body, of an attachment: that is not in memory.
    pub(crate) streamed: Option<Hasher>,
    pub(crate) proof: Proof,
    /// True unless a chunk has no CRC.
    pub(crate) is_checked: bool,
    /// Size of an attachment's data.
    pub(crate) bytes: u64,
}

/// A record counts as proven if it is a chunk or an attachment that matches its CRC; if another
/// record follows, also if it is a chunk without one, metadata, the end of the data section, or has
/// unknown fields behind its own.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Proof {
    No,
    IfFollowed,
    Sure,
}

/// A record that cannot be used.
pub(crate) struct RecordFault {
    /// Where the next record begins; `None` if that is unknown.
    pub(crate) end: Option<u64>,
    pub(crate) reason: String,
    /// True of a record that is neither a chunk nor a part of one: the messages are still whole.
    pub(crate) is_beside: bool,
}

impl RecordFault {
    pub(crate) fn cut(reason: impl Into<String>) -> Self {
        let reason = reason.into();
        Self {
            end: None,
            reason,
            is_beside: false,
        }
    }

    pub(crate) fn new(end: u64, reason: impl Into<String>) -> Self {
        Self {
            end: Some(end),
            ..Self::cut(reason)
        }
    }

    pub(crate) fn beside(end: u64, reason: impl Into<String>) -> Self {
        Self {
            is_beside: true,
            ..Self::new(end, reason)
        }
    }
}

impl RecordSearch {
    /// # Errors
    /// The errors of opening the file.
    pub(crate) fn open(file: &McapFile) -> svl_core::Result<Self> {
        let zstd = zstd::bulk::Decompressor::new();
        Ok(Self {
            file: file.reader()?,
            len: file.len(),
            ahead: Vec::new(),
            ahead_at: 0,
            // 16 times the file size: many fake chunk heads end the search early instead of taking
            // the user's time.
            budget: file.len().saturating_mul(16).saturating_add(16 << 20),
            read: 0,
            body: Vec::new(),
            unpacked: Vec::new(),
            zstd: zstd.map_err(|e| svl_core::Error::io(file.path(), e))?,
        })
    }

    /// Opcode and length of the record at `at`; `None` if the file has no room for it.
    pub(crate) fn head(&mut self, at: u64) -> IoResult<Option<(u8, u64)>> {
        let Some(left) = self.len.checked_sub(at.saturating_add(HEAD)) else {
            return Ok(None);
        };
        let head = self.peek(at, HEAD)?;
        let (opcode, length) = (head[0], u64_at(head, 1));
        let length = length.filter(|&length| length <= left.min(MAX_RECORD));
        Ok(length.map(|length| (opcode, length)))
    }

    /// True if the bytes at `at` look like a record.
    fn is_record(&mut self, at: u64) -> IoResult<bool> {
        Ok(self.head(at)?.is_some_and(|(opcode, _)| is_record(opcode)))
    }

    /// True if MCAP's magic is there.
    pub(crate) fn is_magic(&mut self, at: u64) -> IoResult<bool> {
        let left = self.len.saturating_sub(at);
        Ok(self.peek(at, left.min(8))? == mcap::MAGIC)
    }

    /// True if the header record of a file is there.
    pub(crate) fn is_header(&mut self, at: u64) -> IoResult<bool> {
        let is_header = |(opcode, length)| opcode == op::HEADER && length <= MAX_BESIDE;
        Ok(self.head(at)?.is_some_and(is_header) && self.load(at)?.is_ok())
    }

    /// True if the loaded record is proven.
    pub(crate) fn is_proven(&mut self, loaded: &LoadedRecord) -> IoResult<bool> {
        Ok(loaded.proof == Proof::Sure
            || loaded.proof == Proof::IfFollowed && self.is_record(loaded.end)?)
    }

    /// Deducts bytes that were read in vain from the budget.
    pub(crate) fn spend(&mut self, bytes: u64) {
        self.budget = self.budget.saturating_sub(bytes);
    }

    /// The first position in `places` where a proven record begins.
    pub(crate) fn find(&mut self, places: Range<u64>) -> IoResult<Option<u64>> {
        let (mut from, mut window) = (places.start, Vec::new());
        while from < places.end && self.budget > 0 {
            let left = self.len - from;
            self.read += left.min(WINDOW);
            self.file.read_at(from, left.min(WINDOW), &mut window)?;
            // Records that begin near the end of the window are examined in the next one.
            let heads = if left > WINDOW { WINDOW - LOOK } else { left };
            let heads = heads.min(places.end - from) as usize;
            let mut i = 0;
            while let Some(found) = candidate(&window, i..heads) {
                i = found + 1;
                if !may_be_proven(&window[found..], left - found as u64) {
                    continue;
                }
                let read = self.read;
                if self.proves(from + found as u64)? {
                    return Ok(Some(from + found as u64));
                }
                self.spend(self.read - read);
                if self.budget == 0 {
                    return Ok(None);
                }
            }
            from += heads as u64;
        }
        Ok(None)
    }

    fn proves(&mut self, at: u64) -> IoResult<bool> {
        match self.load(at)? {
            Ok(loaded) if loaded.opcode == ANOTHER => self.is_header(at + 8),
            Ok(loaded) => self.is_proven(&loaded),
            Err(_) => Ok(false),
        }
    }

    /// Loads the record at `at`, or the magic of an appended file.
    ///
    /// # Errors
    /// The errors of reading the file; inside, the reason why there is no such record.
    pub(crate) fn load(&mut self, at: u64) -> IoResult<Result<LoadedRecord, RecordFault>> {
        let left = self.len - at;
        if left < HEAD {
            let reason = ["it was never finished", "it ends inside a record"];
            return Ok(Err(RecordFault::cut(reason[usize::from(left > 0)])));
        }
        let head = self.peek(at, HEAD)?;
        let (opcode, length) = (head[0], u64_at(head, 1).unwrap_or(u64::MAX));
        let is_magic = head.starts_with(mcap::MAGIC);
        let mut loaded = LoadedRecord {
            opcode: ANOTHER,
            end: at + HEAD,
            unknown: at + HEAD,
            streamed: None,
            proof: Proof::No,
            is_checked: true,
            bytes: 0,
        };
        if is_magic {
            return Ok(Ok(loaded));
        }
        if let Some(reason) = head_fault(opcode, length, left - HEAD) {
            return Ok(Err(RecordFault::cut(reason)));
        }
        // At most the rest of the file, so a corrupt length cannot allocate more than that.
        let all = opcode != op::ATTACHMENT;
        let bytes = if all { length } else { length.min(MAX_BESIDE) };
        self.read_body(at + HEAD, bytes)?;
        let known = known_size(opcode, &self.body, length);
        (loaded.opcode, loaded.end) = (opcode, at + HEAD + length);
        if let Some(reason) = fields_fault(opcode, known) {
            let is_beside = !matches!(opcode, op::HEADER..=op::CHUNK | op::DATA_END)
                && !matches!(opcode, op::ATTACHMENT | op::METADATA | op::STATISTICS);
            let fault = RecordFault::new(loaded.end, reason);
            return Ok(Err(RecordFault { is_beside, ..fault }));
        }
        loaded.unknown = at + HEAD + known.unwrap_or(length);
        Ok(match opcode {
            op::ATTACHMENT => self.stream(at + HEAD, loaded)?,
            op::CHUNK => self.unpack(loaded),
            op::METADATA if length <= MAX_BESIDE => {
                let record = mcap::parse_record(opcode, &self.body);
                if matches!(record, Ok(Record::Metadata(data)) if !data.name.is_empty()) {
                    loaded.proof = Proof::IfFollowed;
                }
                Ok(loaded)
            }
            op::DATA_END => {
                loaded.proof = Proof::IfFollowed;
                Ok(loaded)
            }
            _ => Ok(loaded),
        })
    }

    fn unpack(&mut self, mut loaded: LoadedRecord) -> Result<LoadedRecord, RecordFault> {
        let checked = chunk::unpack(&self.body, &mut self.zstd, &mut self.unpacked);
        self.read += self.unpacked.len() as u64;
        loaded.is_checked = checked.map_err(|reason| {
            self.unpacked.clear();
            RecordFault::new(loaded.end, format!("a chunk is damaged: {reason}"))
        })?;
        loaded.proof = match loaded.is_checked {
            _ if self.unpacked.is_empty() => Proof::No,
            true => loaded.sure(),
            // Also a chunk with a corrupt length may unpack into records.
            false => Proof::IfFollowed,
        };
        Ok(loaded)
    }

    /// Checks the CRC of the attachment whose first bytes are loaded, in bounded memory.
    fn stream(
        &mut self,
        body: u64,
        mut loaded: LoadedRecord,
    ) -> IoResult<Result<LoadedRecord, RecordFault>> {
        let fault = |reason: &str| Ok(Err(RecordFault::new(loaded.end, reason)));
        let name = u32_at(&self.body, 16).map_or(0, u64::from);
        let media = u32_at(&self.body, 20 + name as usize).map_or(0, u64::from);
        // Behind the length of the data.
        let start = (32 + name + media) as usize;
        let Some(head) = self.body.get(..start) else {
            return fault("an attachment is truncated");
        };
        loaded.bytes = u64_at(head, start - 8).unwrap_or(0);
        let mut crc = Hasher::new();
        crc.update(head);
        self.body.truncate(start);
        self.pieces(body + start as u64, loaded.bytes, |piece| crc.update(piece))?;
        let calculated = crc.clone().finalize();
        let saved = self.peek(loaded.unknown - 4, 4)?;
        crc.update(saved);
        let saved = u32_at(saved, 0).unwrap_or(0);
        let unknown = loaded.end - loaded.unknown;
        self.pieces(loaded.unknown, unknown, |piece| crc.update(piece))?;
        loaded.streamed = Some(crc);
        if saved != 0 && saved != calculated {
            let reason = format!("the CRC of an attachment is {calculated:08x}, not {saved:08x}");
            return fault(&reason);
        }
        // Without a CRC any bytes could be an attachment.
        loaded.proof = [Proof::No, loaded.sure()][usize::from(saved != 0)];
        // The body is that of an attachment without data and CRC.
        self.body.truncate(start - 8);
        self.body.extend([0; 12]);
        Ok(Ok(loaded))
    }

    /// Reads `bytes` from `at` on, a piece at a time.
    pub(crate) fn pieces(
        &mut self,
        at: u64,
        bytes: u64,
        mut take: impl FnMut(&[u8]),
    ) -> IoResult<()> {
        let mut piece = Vec::new();
        for from in (0..bytes).step_by(WINDOW as usize) {
            let length = (bytes - from).min(WINDOW);
            self.read += length;
            self.file.read_at(at + from, length, &mut piece)?;
            take(&piece);
        }
        Ok(())
    }

    /// Reads the body of a record, which must be in the file.
    fn read_body(&mut self, at: u64, bytes: u64) -> IoResult<()> {
        let mut body = std::mem::take(&mut self.body);
        if bytes < AHEAD {
            body.clear();
            body.extend_from_slice(self.peek(at, bytes)?);
        } else {
            self.read += bytes;
            self.file.read_at(at, bytes, &mut body)?;
        }
        self.body = body;
        Ok(())
    }

    /// A few bytes, which must be in the file. Those behind are read with them, for the records
    /// that follow.
    fn peek(&mut self, at: u64, bytes: u64) -> IoResult<&[u8]> {
        self.read += bytes;
        let end = self.ahead_at + self.ahead.len() as u64;
        if !(self.ahead_at..=end).contains(&at) || at + bytes > end {
            let ahead = self.len.saturating_sub(at).min(AHEAD);
            self.file.read_at(at, ahead, &mut self.ahead)?;
            self.ahead_at = at;
        }
        let start = (at - self.ahead_at) as usize;
        Ok(&self.ahead[start..start + bytes as usize])
    }
}

impl LoadedRecord {
    /// The proof by a CRC.
    fn sure(&self) -> Proof {
        match self.end - self.unknown {
            0 => Proof::Sure,
            1..=MAX_BESIDE => Proof::IfFollowed,
            _ => Proof::No,
        }
    }
}

/// The first of the places where a record that can be proven, or a file, may begin by its first
/// byte.
fn candidate(bytes: &[u8], places: Range<usize>) -> Option<usize> {
    let mut i = places.start;
    while i < places.end {
        // The upper half of a length is 0: of one from here on to 3 places further, also the byte
        // that all four share. Those of a file share one of the last of the magic.
        if i + 8 < bytes.len()
            && bytes[i + 8] != 0
            && !matches!(bytes[i + 7], b'P' | b'0' | b'\r' | b'\n')
        {
            i += 4;
            continue;
        }
        // The magic's first byte is no opcode.
        if matches!(
            bytes[i],
            op::CHUNK | op::ATTACHMENT | op::METADATA | op::DATA_END | 0x89
        ) {
            return Some(i);
        }
        i += 1;
    }
    None
}

/// False for most bytes that merely look like a record which can be proven; `left`: those up to the
/// end of the file.
fn may_be_proven(bytes: &[u8], left: u64) -> bool {
    let Some(room) = left.checked_sub(HEAD) else {
        return false;
    };
    let length = || u64_at(bytes, 1).filter(|&length| length <= room.min(MAX_RECORD));
    match bytes[0] {
        op::CHUNK => length()
            .is_some_and(|length| chunk::may_be_chunk(&bytes[9..bytes.len().min(73)], length)),
        op::ATTACHMENT => length().is_some(),
        op::DATA_END => length() == Some(4),
        op::METADATA => length().is_some_and(|length| length <= MAX_BESIDE),
        _ => bytes.starts_with(mcap::MAGIC),
    }
}

/// The reason why no record can have this head; `left`: bytes behind it.
fn head_fault(opcode: u8, length: u64, left: u64) -> Option<String> {
    if opcode == 0 {
        return Some("there is no record here".to_owned());
    }
    if length > left {
        let reason = format!("it ends inside a record of {length} bytes, of which it has {left}");
        return Some(reason);
    }
    (length > MAX_RECORD).then(|| format!("a record of {length} bytes is longer than {MAX_RECORD}"))
}

/// The reason why a record of this kind, with known fields of that length, cannot be intact.
fn fields_fault(opcode: u8, known: Option<u64>) -> Option<String> {
    if !is_record(opcode) && opcode < PRIVATE {
        return Some(format!("a record is of the unknown kind {opcode:#04x}"));
    }
    let is_wrong = has_fields(opcode) && known.is_none();
    is_wrong.then(|| "the lengths of a record do not agree".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn no_record_and_no_file_is_passed_over(
            mut bytes in prop::collection::vec(
                prop::sample::select(&[0, 0, 4, op::CHUNK, op::METADATA, op::DATA_END, b'P'][..]),
                0..200,
            ),
            places in prop::collection::vec(0_usize..200, 0..4),
        ) {
            for place in places {
                let place = place.min(bytes.len());
                bytes.splice(place..place, mcap::MAGIC.iter().copied());
            }
            let all = 0..bytes.len();
            let mut found = Vec::new();
            let mut from = 0;
            while let Some(place) = candidate(&bytes, from..all.end) {
                found.push(place);
                from = place + 1;
            }
            let left = |place| (bytes.len() - place) as u64;
            let missed = all.clone().find(|place| {
                may_be_proven(&bytes[*place..], left(*place)) && !found.contains(place)
            });
            prop_assert_eq!(missed, None);
        }
    }
}
