//! Records of an MCAP file at any position: each is checked as far as it can be on its own, and the
//! next one that is proven is found behind damage, as that may be in the lengths that lead from one
//! record to the next.
//!
//! Every position is examined once, and a budget limits the bytes read for positions that merely
//! look like records. So the time is linear in the length of the file, whatever its content.

use super::chunk;
use super::file::{FileReader, McapFile};
use super::layout::{HEAD, MAX_RECORD, has_fields, is_record, known_size};
use super::layout::{u32_at, u64_at};
use mcap::records::{Record, op};
use std::io::{self, BufReader, Read as _};
use std::ops::Range;

/// Code for the magic of an appended file. No record has this opcode.
pub(super) const ANOTHER: u8 = 0;
/// Opcodes from here on are private to other programs.
pub(super) const PRIVATE: u8 = 0x80;
/// Bytes read at a time.
const WINDOW: u64 = 1 << 18;
/// Bytes of a record that suffice for a first check.
const LOOK: u64 = 64;
/// Limit on the length of an attachment up to its data, and for a proof on that of metadata and of
/// unknown fields.
const MAX_BESIDE: u64 = 1 << 16;

/// One file, and the last record loaded from it.
pub(super) struct RecordSearch {
    file: BufReader<FileReader>,
    at: u64,
    len: u64,
    /// Bytes that may still be read and unpacked in vain, and those read so far.
    budget: u64,
    read: u64,
    /// The body of the record; of an attachment, as if it had no data.
    pub(super) body: Vec<u8>,
    /// The records of a chunk.
    pub(super) unpacked: Vec<u8>,
    zstd: zstd::bulk::Decompressor<'static>,
}

/// A record with a length that fits the file and its own fields.
pub(super) struct Loaded {
    pub(super) opcode: u8,
    pub(super) end: u64,
    /// Start of what is behind the known fields.
    pub(super) unknown: u64,
    /// CRC of all its bytes.
    pub(super) crc: crc32fast::Hasher,
    pub(super) proof: Proof,
    /// True unless a chunk has no CRC.
    pub(super) is_checked: bool,
    /// Size of an attachment's data.
    pub(super) bytes: u64,
}

/// A record counts as proven if it is a chunk or an attachment that matches its CRC; if another
/// record follows, also if it is a chunk without one, metadata, the end of the data section, or has
/// unknown fields behind its own.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Proof {
    No,
    IfFollowed,
    Sure,
}

/// A record that cannot be used.
pub(super) struct Fault {
    /// Where the next record begins; `None` if that is unknown.
    pub(super) end: Option<u64>,
    pub(super) reason: String,
    /// True of a record that is neither a chunk nor a part of one: the messages are still whole.
    pub(super) is_beside: bool,
}

impl Fault {
    pub(super) fn cut(reason: impl Into<String>) -> Self {
        let reason = reason.into();
        Self {
            end: None,
            reason,
            is_beside: false,
        }
    }

    pub(super) fn new(end: u64, reason: impl Into<String>) -> Self {
        Self {
            end: Some(end),
            ..Self::cut(reason)
        }
    }

    pub(super) fn beside(end: u64, reason: impl Into<String>) -> Self {
        Self {
            is_beside: true,
            ..Self::new(end, reason)
        }
    }
}

impl RecordSearch {
    /// # Errors
    /// The errors of opening the file.
    pub(super) fn open(file: &McapFile) -> svl_core::Result<Self> {
        let zstd = zstd::bulk::Decompressor::new();
        Ok(Self {
            file: BufReader::with_capacity(WINDOW as usize, file.reader()?),
            at: 0,
            len: file.len(),
            // 16 times the file size: many fake chunk heads end the search early instead of taking
            // the user's time.
            budget: file.len().saturating_mul(16).saturating_add(16 << 20),
            read: 0,
            body: Vec::new(),
            unpacked: Vec::new(),
            zstd: zstd.map_err(|e| svl_core::Error::io(file.path(), e))?,
        })
    }

    pub(super) fn len(&self) -> u64 {
        self.len
    }

    /// Opcode and length of the record at `at`; `None` if the file has no room for it.
    pub(super) fn head(&mut self, at: u64) -> io::Result<Option<(u8, u64)>> {
        let Some(left) = self.len.checked_sub(at.saturating_add(HEAD)) else {
            return Ok(None);
        };
        let mut head = [0; HEAD as usize];
        self.read_at(at, &mut head)?;
        let length = u64_at(&head, 1).filter(|&length| length <= left.min(MAX_RECORD));
        Ok(length.map(|length| (head[0], length)))
    }

    /// True if the bytes at `at` look like a record.
    fn is_record(&mut self, at: u64) -> io::Result<bool> {
        Ok(self.head(at)?.is_some_and(|(opcode, _)| is_record(opcode)))
    }

    /// True if MCAP's magic is there.
    pub(super) fn is_magic(&mut self, at: u64) -> io::Result<bool> {
        let mut magic = [0; 8];
        Ok(self.len.checked_sub(at).is_some_and(|left| left >= 8)
            && self
                .read_at(at, &mut magic)
                .map(|()| magic == *mcap::MAGIC)?)
    }

    /// True if the header record of a file is there.
    pub(super) fn is_header(&mut self, at: u64) -> io::Result<bool> {
        let is_header = |(opcode, length)| opcode == op::HEADER && length <= MAX_BESIDE;
        Ok(self.head(at)?.is_some_and(is_header) && self.load(at)?.is_ok())
    }

    /// True if the loaded record is proven.
    pub(super) fn is_proven(&mut self, loaded: &Loaded) -> io::Result<bool> {
        Ok(loaded.proof == Proof::Sure
            || loaded.proof == Proof::IfFollowed && self.is_record(loaded.end)?)
    }

    /// Deducts bytes that were read in vain from the budget.
    pub(super) fn spend(&mut self, bytes: u64) {
        self.budget = self.budget.saturating_sub(bytes);
    }

    /// The first position in `places` where a proven record begins.
    pub(super) fn find(&mut self, places: Range<u64>) -> io::Result<Option<u64>> {
        let mut window = Vec::new();
        let mut from = places.start;
        while from < places.end && self.budget > 0 {
            let left = self.len - from;
            window.resize(left.min(WINDOW) as usize, 0);
            self.read_at(from, &mut window)?;
            // Records that begin near the end of the window are examined in the next one.
            let heads = if left > WINDOW { WINDOW - LOOK } else { left };
            let heads = heads.min(places.end - from);
            for i in 0..heads as usize {
                if may_be_proven(&window[i..], left - i as u64) {
                    let read = self.read;
                    if self.proves(from + i as u64)? {
                        return Ok(Some(from + i as u64));
                    }
                    self.spend(self.read - read);
                    if self.budget == 0 {
                        return Ok(None);
                    }
                }
            }
            from += heads;
        }
        Ok(None)
    }

    fn proves(&mut self, at: u64) -> io::Result<bool> {
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
    pub(super) fn load(&mut self, at: u64) -> io::Result<Result<Loaded, Fault>> {
        let left = self.len - at;
        if left < HEAD {
            let reason = ["it was never finished", "it ends inside a record"];
            return Ok(Err(Fault::cut(reason[usize::from(left > 0)])));
        }
        let mut head = [0; HEAD as usize];
        self.read_at(at, &mut head)?;
        let (opcode, length) = (head[0], u64_at(&head, 1).unwrap_or(u64::MAX));
        let mut crc = crc32fast::Hasher::new();
        crc.update(&head);
        let (is_another, left) = (head.starts_with(mcap::MAGIC), left - HEAD);
        if !is_another && let Some(reason) = head_fault(opcode, length, left) {
            return Ok(Err(Fault::cut(reason)));
        }
        let mut loaded = Loaded {
            opcode: if is_another { ANOTHER } else { opcode },
            end: at + HEAD + if is_another { 0 } else { length },
            unknown: 0,
            crc,
            proof: Proof::No,
            is_checked: true,
            bytes: 0,
        };
        if is_another {
            return Ok(Ok(loaded));
        }
        // At most the rest of the file, so a corrupt length cannot allocate more than that.
        let all = opcode != op::ATTACHMENT;
        let bytes = if all { length } else { length.min(MAX_BESIDE) };
        self.read_body(at + HEAD, bytes)?;
        let known = known_size(opcode, &self.body, length);
        loaded.unknown = at + HEAD + known.unwrap_or(length);
        if let Some(reason) = fields_fault(opcode, known) {
            let is_beside = matches!(opcode, op::MESSAGE_INDEX..) && opcode != op::ATTACHMENT;
            return Ok(Err(Fault {
                is_beside,
                ..Fault::new(loaded.end, reason)
            }));
        }
        Ok(match opcode {
            op::ATTACHMENT => self.stream(at + HEAD, loaded)?,
            op::CHUNK => self.unpack(loaded),
            _ => {
                loaded.crc.update(&self.body);
                let is_named = || match mcap::parse_record(opcode, &self.body) {
                    Ok(Record::Metadata(metadata)) => !metadata.name.is_empty(),
                    _ => false,
                };
                let proves = opcode == op::DATA_END
                    || opcode == op::METADATA && length <= MAX_BESIDE && is_named();
                loaded.proof = [Proof::No, Proof::IfFollowed][usize::from(proves)];
                Ok(loaded)
            }
        })
    }

    fn unpack(&mut self, mut loaded: Loaded) -> Result<Loaded, Fault> {
        loaded.crc.update(&self.body);
        let checked = chunk::unpack(&self.body, &mut self.zstd, &mut self.unpacked);
        self.read += self.unpacked.len() as u64;
        loaded.is_checked = checked.map_err(|reason| {
            self.unpacked.clear();
            Fault::new(loaded.end, format!("a chunk is damaged: {reason}"))
        })?;
        let is_sure = loaded.is_checked && !self.unpacked.is_empty();
        loaded.proof = match is_sure {
            true => loaded.sure(),
            // Also a chunk with a corrupt length may unpack into records.
            false if !self.unpacked.is_empty() => Proof::IfFollowed,
            false => Proof::No,
        };
        Ok(loaded)
    }

    /// Checks the CRC of the attachment whose first bytes are loaded, in bounded memory.
    fn stream(&mut self, body: u64, mut loaded: Loaded) -> io::Result<Result<Loaded, Fault>> {
        let fault = |reason: &str| Ok(Err(Fault::new(loaded.end, reason)));
        let name = u32_at(&self.body, 16).map_or(0, u64::from);
        let media = u32_at(&self.body, 20 + name as usize).map_or(0, u64::from);
        // Behind the length of the data.
        let start = (32 + name + media) as usize;
        let Some(head) = self.body.get(..start) else {
            return fault("an attachment is truncated");
        };
        loaded.bytes = u64_at(head, start - 8).unwrap_or(0);
        let mut crc = crc32fast::Hasher::new();
        crc.update(head);
        self.body.truncate(start);
        self.read_pieces(body + start as u64, loaded.bytes, |piece| crc.update(piece))?;
        let mut saved = [0; 4];
        self.read_at(loaded.unknown - 4, &mut saved)?;
        loaded.crc.combine(&crc);
        loaded.crc.update(&saved);
        let unknown = loaded.end - loaded.unknown;
        self.read_pieces(loaded.unknown, unknown, |piece| loaded.crc.update(piece))?;
        let (saved, calculated) = (u32::from_le_bytes(saved), crc.finalize());
        if saved != 0 && saved != calculated {
            let reason = format!("the CRC of an attachment is {calculated:08x}, not {saved:08x}");
            return fault(&reason);
        }
        // Without a CRC any bytes could be an attachment.
        loaded.proof = [Proof::No, loaded.sure()][usize::from(saved != 0)];
        // As if it had no data, and no CRC.
        self.body.truncate(start - 8);
        self.body.extend([0; 12]);
        Ok(Ok(loaded))
    }

    /// Reads `bytes` from `at` on, a piece at a time.
    pub(super) fn read_pieces(
        &mut self,
        at: u64,
        bytes: u64,
        mut take: impl FnMut(&[u8]),
    ) -> io::Result<()> {
        let mut piece = vec![0; bytes.min(WINDOW) as usize];
        for from in (0..bytes).step_by(WINDOW as usize) {
            let piece = &mut piece[..(bytes - from).min(WINDOW) as usize];
            self.read_at(at + from, piece)?;
            take(piece);
        }
        Ok(())
    }

    fn read_body(&mut self, at: u64, bytes: u64) -> io::Result<()> {
        let mut body = std::mem::take(&mut self.body);
        body.resize(bytes as usize, 0);
        let read = self.read_at(at, &mut body);
        self.body = body;
        read
    }

    /// Reads bytes, which must be in the file.
    fn read_at(&mut self, at: u64, bytes: &mut [u8]) -> io::Result<()> {
        self.file
            .seek_relative(at.wrapping_sub(self.at).cast_signed())?;
        self.at = at;
        self.file.read_exact(bytes)?;
        self.at += bytes.len() as u64;
        self.read += bytes.len() as u64;
        Ok(())
    }
}

impl Loaded {
    /// The proof by a CRC.
    fn sure(&self) -> Proof {
        match self.end - self.unknown {
            0 => Proof::Sure,
            1..=MAX_BESIDE => Proof::IfFollowed,
            _ => Proof::No,
        }
    }
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
        op::ATTACHMENT | op::DATA_END => length().is_some(),
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
