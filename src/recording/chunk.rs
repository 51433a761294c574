//! One chunk of an MCAP file, decompressed and checked before it is used.

use super::records::{MAX_RECORD, u64_at};
use mcap::records::{Record, op};
use std::io::Read as _;
use std::ops::Range;

/// The records of the chunk opened last.
pub(super) struct Chunk {
    records: Vec<u8>,
    /// Where the next record begins.
    next: usize,
    /// The current record without its head.
    body: Range<usize>,
    zstd: zstd::bulk::Decompressor<'static>,
}

impl Chunk {
    pub(super) fn new() -> std::io::Result<Self> {
        Ok(Self { records: Vec::new(), next: 0, body: 0..0, zstd: zstd::bulk::Decompressor::new()? })
    }

    /// Opens the chunk whose record holds `record`.
    ///
    /// # Errors
    /// Why it cannot be used; then it has no records.
    pub(super) fn open(&mut self, record: &[u8]) -> Result<(), String> {
        self.clear();
        let opened = self.decompress(record);
        if opened.is_err() {
            self.clear();
        }
        opened
    }

    /// Leaves out what records there still are.
    pub(super) fn clear(&mut self) {
        self.records.clear();
        (self.next, self.body) = (0, 0..0);
    }

    fn decompress(&mut self, record: &[u8]) -> Result<(), String> {
        let Record::Chunk { header, data } = mcap::parse_record(op::CHUNK, record).map_err(|e| e.to_string())? else {
            return Err("it is none".to_owned());
        };
        let (size, records) = (header.uncompressed_size, &mut self.records);
        if size > MAX_RECORD {
            return Err(format!("it holds {size} bytes, more than {MAX_RECORD}"));
        }
        let read = match header.compression.as_str() {
            "" => (&*data).read_to_end(records),
            "zstd" => {
                records.try_reserve(size as usize).map_err(|e| e.to_string())?;
                self.zstd.decompress_to_buffer(&data, records)
            }
            "lz4" => lz4::Decoder::new(&*data).and_then(|d| d.take(size + 1).read_to_end(records)),
            other => return Err(format!("its compression '{other}' is unknown")),
        };
        read.map_err(|e| e.to_string())?;
        if records.len() as u64 != size {
            return Err(format!("it holds {} bytes, {size} expected", records.len()));
        }
        let (saved, calculated) = (header.uncompressed_crc, crc32fast::hash(records));
        if saved != 0 && saved != calculated {
            return Err(format!("its CRC is {calculated:08x}, {saved:08x} expected"));
        }
        Ok(())
    }

    /// Whether there are no more records.
    pub(super) fn is_done(&self) -> bool {
        self.next >= self.records.len()
    }

    /// Goes to the next record and says what it is.
    ///
    /// # Errors
    /// When the chunk ends inside of it.
    pub(super) fn advance(&mut self) -> Result<u8, &'static str> {
        let (opcode, body) = self.split().ok_or("a chunk ends inside one of its records")?;
        (self.next, self.body) = (body.end, body);
        Ok(opcode)
    }

    /// The body of the current record.
    pub(super) fn body(&self) -> &[u8] {
        &self.records[self.body.clone()]
    }

    fn split(&self) -> Option<(u8, Range<usize>)> {
        let start = self.next.checked_add(9)?;
        let end = start.checked_add(usize::try_from(u64_at(&self.records, self.next + 1)?).ok()?)?;
        (end <= self.records.len()).then(|| (self.records[self.next], start..end))
    }
}
