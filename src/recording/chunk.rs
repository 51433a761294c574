//! One chunk of an MCAP file, decompressed and checked before it is used.

use super::layout::{MAX_RECORD, known_size, u32_at, u64_at};
use mcap::records::{Record, op};
use std::io::Read as _;
use std::ops::Range;

/// The records of the current chunk.
pub(super) struct Chunk {
    records: Vec<u8>,
    /// Start of the next record.
    next: usize,
    /// The current record without its head.
    body: Range<usize>,
    /// True if the chunk has a CRC, which matches.
    has_crc: bool,
    zstd: zstd::bulk::Decompressor<'static>,
}

/// Decompressed size of a chunk's records, read from the start of its record of `length` bytes;
/// `None` if that cannot be the start of a chunk with records.
pub(super) fn chunk_size(record: &[u8], length: u64) -> Option<u64> {
    let name = u32_at(record, 28)? as usize;
    let compression = record.get(32..)?.get(..name)?;
    let size = u64_at(record, 16)?;
    let fits = match compression {
        b"" => size == u64_at(record, 32)?,
        b"zstd" | b"lz4" => size <= MAX_RECORD,
        _ => false,
    };
    // A cheap test that most byte patterns which merely look like chunks fail.
    let times_are_in_order = u64_at(record, 0)? <= u64_at(record, 8)?;
    let is_used = size > 0 && known_size(op::CHUNK, record, length).is_some();
    (fits && times_are_in_order && is_used).then_some(size)
}

impl Chunk {
    pub(super) fn new() -> std::io::Result<Self> {
        Ok(Self {
            records: Vec::new(),
            next: 0,
            body: 0..0,
            has_crc: false,
            zstd: zstd::bulk::Decompressor::new()?,
        })
    }

    /// Decompresses and checks the chunk in the body of a record.
    ///
    /// # Errors
    /// The reason why it cannot be used; it then has no records.
    pub(super) fn open(&mut self, record: &[u8]) -> Result<(), String> {
        self.clear();
        let opened = self.decompress(record);
        if opened.is_err() {
            self.clear();
        }
        opened
    }

    /// Skips the remaining records.
    pub(super) fn clear(&mut self) {
        self.records.clear();
        (self.next, self.body) = (0, 0..0);
    }

    fn decompress(&mut self, record: &[u8]) -> Result<(), String> {
        let Record::Chunk { header, data } =
            mcap::parse_record(op::CHUNK, record).map_err(|e| e.to_string())?
        else {
            return Err("it is none".to_owned());
        };
        if known_size(op::CHUNK, record, record.len() as u64).is_none() {
            return Err("its lengths do not agree".to_owned());
        }
        let (size, records) = (header.uncompressed_size, &mut self.records);
        if size > MAX_RECORD {
            return Err(format!("it holds {size} bytes, more than {MAX_RECORD}"));
        }
        let read = match header.compression.as_str() {
            "" => (&*data).read_to_end(records),
            "zstd" => {
                records
                    // The size is untrusted until the CRC matches. Pages that are reserved but not
                    // written cost nothing.
                    .try_reserve(size as usize)
                    .map_err(|e| e.to_string())?;
                self.zstd.decompress_to_buffer(&data, records)
            }
            // One byte more than claimed, to detect a chunk that is longer.
            "lz4" => lz4::Decoder::new(&*data).and_then(|d| d.take(size + 1).read_to_end(records)),
            other => return Err(format!("its compression '{other}' is unknown")),
        };
        read.map_err(|e| e.to_string())?;
        if records.len() as u64 != size {
            return Err(format!("it holds {} bytes, {size} expected", records.len()));
        }
        let (saved, calculated) = (header.uncompressed_crc, crc32fast::hash(records));
        // In MCAP, 0 means no CRC.
        if saved != 0 && saved != calculated {
            return Err(format!("its CRC is {calculated:08x}, {saved:08x} expected"));
        }
        self.has_crc = saved != 0 || records.is_empty();
        Ok(())
    }

    /// True if a CRC was checked.
    pub(super) fn has_crc(&self) -> bool {
        self.has_crc
    }

    /// True if the chunk consists of complete records of the kinds allowed in chunks. Rewinds to
    /// the first one.
    pub(super) fn has_only_complete_records(&mut self) -> bool {
        let mut whole = !self.records.is_empty();
        while whole && !self.is_done() {
            whole = self.advance().is_ok();
        }
        (self.next, self.body) = (0, 0..0);
        whole
    }

    /// True if there are no more records.
    pub(super) fn is_done(&self) -> bool {
        self.next >= self.records.len()
    }

    /// Advances to the next record and returns its opcode.
    ///
    /// # Errors
    /// If the chunk ends inside the record, or the record is of a kind not allowed in chunks.
    pub(super) fn advance(&mut self) -> Result<u8, &'static str> {
        let (opcode, body) = self
            .split()
            .ok_or("the rest of a chunk cannot be read: it ends inside one of its records")?;
        // Opcodes from 0x80 on are private to other programs and allowed anywhere.
        if !matches!(opcode, op::SCHEMA | op::CHANNEL | op::MESSAGE | 0x80..) {
            return Err(
                "the rest of a chunk cannot be read: the next record is not one of a chunk's",
            );
        }
        (self.next, self.body) = (body.end, body);
        Ok(opcode)
    }

    /// The body of the current record.
    pub(super) fn body(&self) -> &[u8] {
        &self.records[self.body.clone()]
    }

    fn split(&self) -> Option<(u8, Range<usize>)> {
        let start = self.next.checked_add(9)?;
        let end =
            start.checked_add(usize::try_from(u64_at(&self.records, self.next + 1)?).ok()?)?;
        (end <= self.records.len()).then(|| (self.records[self.next], start..end))
    }
}
