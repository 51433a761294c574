//! The layout of MCAP records, as far as it determines their length (<https://mcap.dev/spec>).

use mcap::records::op;

/// Limit on the length of a record and of a chunk: twice the largest image in 32-bit floats.
pub(crate) const MAX_RECORD: u64 = 2 << 30;
/// Opcode and length of a record.
pub(crate) const HEAD: u64 = 9;

/// A part of a record's body.
enum Field {
    Bytes(u64),
    /// A 4-byte length and that many bytes: a string, an array or a map.
    Sized,
    /// An 8-byte length and that many bytes.
    LongSized,
}

use Field::{Bytes, LongSized, Sized};

/// The fields of a record of this kind; `None` if they do not determine its length: messages extend
/// to the end of their record, and private records are unknown.
fn fields(opcode: u8) -> Option<&'static [Field]> {
    Some(match opcode {
        op::HEADER | op::METADATA => &[Sized, Sized],
        op::FOOTER => &[Bytes(20)],
        op::SCHEMA => &[Bytes(2), Sized, Sized, Sized],
        op::CHANNEL => &[Bytes(4), Sized, Sized, Sized],
        // Two times, size and CRC; compression; records.
        op::CHUNK => &[Bytes(28), Sized, LongSized],
        op::MESSAGE_INDEX => &[Bytes(2), Sized],
        op::CHUNK_INDEX => &[Bytes(32), Sized, Bytes(8), Sized, Bytes(16)],
        // Two times; name; media type; data; CRC.
        op::ATTACHMENT => &[Bytes(16), Sized, Sized, LongSized, Bytes(4)],
        op::ATTACHMENT_INDEX => &[Bytes(40), Sized, Sized],
        op::STATISTICS => &[Bytes(42), Sized],
        op::METADATA_INDEX => &[Bytes(16), Sized],
        op::SUMMARY_OFFSET => &[Bytes(17)],
        op::DATA_END => &[Bytes(4)],
        _ => return None,
    })
}

/// The length of the known fields of a record's body, according to the lengths in it. `body` may be
/// a prefix that ends after the last of them. `None` if the kind of record does not determine it,
/// or `body` is too short.
pub(crate) fn fields_size(opcode: u8, body: &[u8]) -> Option<u64> {
    fields(opcode)?.iter().try_fold(0_u64, |size, field| {
        let at = usize::try_from(size);
        // Checked: damaged lengths may be as large as 2⁶⁴ - 1.
        size.checked_add(match field {
            Bytes(n) => *n,
            Sized => 4 + u64::from(u32_at(body, at.ok()?)?),
            LongSized => u64_at(body, at.ok()?)?.checked_add(8)?,
        })
    })
}

/// The length of the known fields of a record whose body has `length` bytes, see [`fields_size`];
/// `None` if the record cannot have that length. MCAP extends records by fields at their end, which
/// readers ignore, except for footer and end of data.
pub(crate) fn known_size(opcode: u8, body: &[u8], length: u64) -> Option<u64> {
    let may_grow = !matches!(opcode, op::FOOTER | op::DATA_END);
    fields_size(opcode, body).filter(|&size| size == length || may_grow && size < length)
}

/// True if this kind of record consists of known fields, and maybe more behind them.
pub(crate) fn has_fields(opcode: u8) -> bool {
    fields(opcode).is_some()
}

/// True if MCAP defines records of this kind.
pub(crate) fn is_record(opcode: u8) -> bool {
    (op::HEADER..=op::DATA_END).contains(&opcode)
}

pub(crate) fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    bytes
        .get(at..)?
        .first_chunk()
        .map(|b| u32::from_le_bytes(*b))
}

pub(crate) fn u64_at(bytes: &[u8], at: usize) -> Option<u64> {
    bytes
        .get(at..)?
        .first_chunk()
        .map(|b| u64::from_le_bytes(*b))
}
