//! One chunk of an MCAP file, unpacked in bounded memory and checked before it is used.

use super::layout::{MAX_RECORD, known_size, u32_at, u64_at};
use mcap::records::{Record, op};
use std::io::Read as _;

/// False for most bytes that merely look like the start of a chunk with records, whose record has
/// `length` bytes.
pub(crate) fn may_be_chunk(start: &[u8], length: u64) -> bool {
    let number = |at| u64_at(start, at).unwrap_or(0);
    let name = u32_at(start, 28).and_then(|name| start.get(32..)?.get(..name as usize));
    let fits = match name {
        // The empty name is MCAP's, `none` that of some writers.
        Some(b"") => number(16) == number(32),
        Some(b"none") => number(16) == number(36),
        Some(b"zstd" | b"lz4") => number(16) <= MAX_RECORD,
        _ => false,
    };
    let times_are_in_order = number(0) <= number(8);
    fits && times_are_in_order && number(16) > 0 && known_size(op::CHUNK, start, length).is_some()
}

/// Unpacks the chunk in the body of a record into `records`. Returns true if it has a CRC.
///
/// # Errors
/// The reason why it cannot be used: also if it matches no CRC, or ends inside a record.
pub(crate) fn unpack(
    body: &[u8],
    zstd: &mut zstd::bulk::Decompressor<'static>,
    records: &mut Vec<u8>,
) -> Result<bool, String> {
    records.clear();
    let record = mcap::parse_record(op::CHUNK, body).map_err(|e| e.to_string())?;
    let Record::Chunk { header, data } = record else {
        return Err("its record is of another kind".to_owned());
    };
    let size = header.uncompressed_size;
    if size > MAX_RECORD {
        return Err(format!("it holds {size} bytes, more than {MAX_RECORD}"));
    }
    let read = match header.compression.as_str() {
        "" | "none" => (&*data).read_to_end(records),
        // The size is untrusted until the CRC matches. Pages that are reserved but not written cost
        // nothing.
        "zstd" => match records.try_reserve(size as usize) {
            Ok(()) => zstd.decompress_to_buffer(&data, records),
            Err(e) => return Err(e.to_string()),
        },
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
    let mut rest = &records[..];
    while !rest.is_empty() {
        let (opcode, _, after) = split(rest).ok_or("it ends inside one of its records")?;
        // Opcodes from 0x80 on are private to other programs and allowed anywhere.
        if !matches!(opcode, op::SCHEMA | op::CHANNEL | op::MESSAGE | 0x80..) {
            return Err("one of its records is not one of a chunk's".to_owned());
        }
        rest = after;
    }
    Ok(saved != 0 || records.is_empty())
}

/// The first record: its opcode, its body, and what follows.
pub(crate) fn split(records: &[u8]) -> Option<(u8, &[u8], &[u8])> {
    let (head, rest) = records.split_first_chunk::<9>()?;
    let length = u64_at(head, 1)?;
    let (body, after) = rest.split_at_checked(usize::try_from(length).ok()?)?;
    Some((head[0], body, after))
}
