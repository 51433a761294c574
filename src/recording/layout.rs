//! The fields of MCAP's records, as far as they say how long a record is.

use mcap::records::op;

/// Longest record and chunk: an image of the largest size in 32-bit floats, and as much again.
pub(super) const MAX_RECORD: u64 = 2 << 30;
/// Opcode and length of a record.
pub(super) const HEAD: u64 = 9;

/// A part of a record's body.
enum Field {
    Bytes(u64),
    /// A length in 4 bytes, and so many bytes: a string, an array or a map.
    Sized,
    /// A length in 8 bytes, and so many bytes.
    LongSized,
}

use Field::{Bytes, LongSized, Sized};

/// The fields of a record of this kind, by <https://mcap.dev/spec>; nothing where they do not say
/// how long it is: messages go on to the end of their record, and what others added is unknown.
fn fields(opcode: u8) -> Option<&'static [Field]> {
    Some(match opcode {
        op::HEADER | op::METADATA => &[Sized, Sized],
        op::FOOTER => &[Bytes(20)],
        op::SCHEMA => &[Bytes(2), Sized, Sized, Sized],
        op::CHANNEL => &[Bytes(4), Sized, Sized, Sized],
        op::CHUNK => &[Bytes(28), Sized, LongSized],
        op::MESSAGE_INDEX => &[Bytes(2), Sized],
        op::CHUNK_INDEX => &[Bytes(32), Sized, Bytes(8), Sized, Bytes(16)],
        op::ATTACHMENT => &[Bytes(16), Sized, Sized, LongSized, Bytes(4)],
        op::ATTACHMENT_INDEX => &[Bytes(40), Sized, Sized],
        op::STATISTICS => &[Bytes(42), Sized],
        op::METADATA_INDEX => &[Bytes(16), Sized],
        op::SUMMARY_OFFSET => &[Bytes(17)],
        op::DATA_END => &[Bytes(4)],
        _ => return None,
    })
}

/// How long the body of a record should be by the lengths in it; `body` may be its beginning alone,
/// up to the last of them. Nothing where the kind of record does not say, or `body` is too short
/// to.
pub(super) fn body_size(opcode: u8, body: &[u8]) -> Option<u64> {
    fields(opcode)?.iter().try_fold(0_u64, |size, field| {
        let at = usize::try_from(size);
        size.checked_add(match field {
            Bytes(n) => *n,
            Sized => 4 + u64::from(u32_at(body, at.ok()?)?),
            LongSized => u64_at(body, at.ok()?)?.checked_add(8)?,
        })
    })
}

/// Whether records of this kind say how long they are.
pub(super) fn has_fields(opcode: u8) -> bool {
    fields(opcode).is_some()
}

/// Whether MCAP has records of this kind.
pub(super) fn is_record(opcode: u8) -> bool {
    (op::HEADER..=op::DATA_END).contains(&opcode)
}

pub(super) fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    bytes
        .get(at..)?
        .first_chunk()
        .map(|b| u32::from_le_bytes(*b))
}

pub(super) fn u64_at(bytes: &[u8], at: usize) -> Option<u64> {
    bytes
        .get(at..)?
        .first_chunk()
        .map(|b| u64::from_le_bytes(*b))
}
