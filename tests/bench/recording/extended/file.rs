//! MCAP files with unknown fields behind those of their records, as MCAP allows for all kinds but
//! messages, the end of the data and the footer.

use mcap::records::{Record, op};
use std::collections::BTreeMap;

/// The kinds of records that may be extended.
pub(super) const EXTENSIBLE: [u8; 12] = [
    op::HEADER,
    op::SCHEMA,
    op::CHANNEL,
    op::CHUNK,
    op::MESSAGE_INDEX,
    op::CHUNK_INDEX,
    op::ATTACHMENT,
    op::ATTACHMENT_INDEX,
    op::STATISTICS,
    op::METADATA,
    op::METADATA_INDEX,
    op::SUMMARY_OFFSET,
];

/// A file to which records are appended.
pub(super) struct ExtendedFile<'a> {
    pub(super) bytes: Vec<u8>,
    /// The kinds of records that get unknown fields.
    pub(super) kinds: &'a [u8],
    pub(super) fields: &'a [u8],
}

impl<'a> ExtendedFile<'a> {
    pub(super) fn new(kinds: &'a [u8], fields: &'a [u8]) -> Self {
        let bytes = mcap::MAGIC.to_vec();
        Self {
            bytes,
            kinds,
            fields,
        }
    }

    pub(super) fn record(&mut self, opcode: u8, body: &[u8]) {
        let fields = if self.kinds.contains(&opcode) {
            self.fields
        } else {
            &[]
        };
        self.bytes.push(opcode);
        let length = (body.len() + fields.len()) as u64;
        self.bytes.extend(length.to_le_bytes());
        self.bytes.extend(body);
        self.bytes.extend(fields);
    }

    /// Adds end of data, with its CRC.
    pub(super) fn end_data(&mut self) {
        let crc = crc32fast::hash(&self.bytes);
        self.record(op::DATA_END, &crc.to_le_bytes());
    }

    /// Adds the footer, whose CRC covers the bytes from `summary` on, and the end magic.
    pub(super) fn finish(mut self, summary: usize, starts: [u64; 2]) -> Vec<u8> {
        let mut body = starts.map(u64::to_le_bytes).concat();
        body.extend([0; 4]);
        self.record(op::FOOTER, &body);
        let end = self.bytes.len();
        let crc = crc32fast::hash(&self.bytes[summary..end - 4]);
        self.bytes[end - 4..].copy_from_slice(&crc.to_le_bytes());
        self.bytes.extend(mcap::MAGIC);
        self.bytes
    }
}

fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap())
}

fn put(bytes: &mut [u8], at: usize, value: u64) {
    bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
}

/// The records in `bytes` from `at` on: start, opcode, body.
fn records(bytes: &[u8], mut at: usize) -> Vec<(usize, u8, &[u8])> {
    let mut records = Vec::new();
    while at + 9 < bytes.len() {
        let end = at + 9 + u64_at(bytes, at + 1) as usize;
        records.push((at, bytes[at], &bytes[at + 9..end]));
        at = end;
    }
    records
}

/// Rewrites a recording with `fields` behind those of the records of these kinds, with all its
/// positions and CRCs right. Without `index` it has no summary.
pub(super) fn extended(bytes: &[u8], kinds: &[u8], fields: &[u8], index: bool) -> Vec<u8> {
    let mut file = ExtendedFile::new(kinds, fields);
    // Positions of the records, by those in `bytes`; and of messages in the current chunk.
    let (mut moved, mut within) = (BTreeMap::new(), BTreeMap::new());
    let mut summary = 0;
    for (start, opcode, body) in records(bytes, mcap::MAGIC.len()) {
        moved.insert(start as u64, file.bytes.len() as u64);
        let length = |from: u64, length: u64| moved[&(from + length)] - moved[&from];
        let mut body = body.to_vec();
        match opcode {
            op::CHUNK => (body, within) = extended_chunk(&body, kinds, fields),
            op::MESSAGE_INDEX => {
                for at in (6..body.len()).step_by(16) {
                    let place = within[&u64_at(&body, at + 8)];
                    put(&mut body, at + 8, place);
                }
            }
            op::DATA_END => {
                file.end_data();
                summary = file.bytes.len();
                continue;
            }
            op::FOOTER if index => {
                let start = |at| moved.get(&u64_at(&body, at)).copied().unwrap_or(0);
                return file.finish(summary, [start(0), start(8)]);
            }
            op::FOOTER => return file.finish(summary, [0, 0]),
            _ if summary > 0 && !index => continue,
            op::CHUNK_INDEX => {
                let (chunk, bytes) = (u64_at(&body, 16), u64_at(&body, 24));
                put(&mut body, 16, moved[&chunk]);
                put(&mut body, 24, length(chunk, bytes));
                let end = 36 + u32::from_le_bytes(body[32..36].try_into().unwrap()) as usize;
                for at in (36..end).step_by(10) {
                    let place = moved[&u64_at(&body, at + 2)];
                    put(&mut body, at + 2, place);
                }
                let indexes = u64_at(&body, end);
                put(&mut body, end, length(chunk + bytes, indexes));
            }
            op::ATTACHMENT_INDEX | op::METADATA_INDEX => {
                let (start, bytes) = (u64_at(&body, 0), u64_at(&body, 8));
                put(&mut body, 0, moved[&start]);
                put(&mut body, 8, length(start, bytes));
            }
            op::SUMMARY_OFFSET => {
                let (start, bytes) = (u64_at(&body, 1), u64_at(&body, 9));
                put(&mut body, 1, moved[&start]);
                put(&mut body, 9, length(start, bytes));
            }
            _ => {}
        }
        file.record(opcode, &body);
    }
    unreachable!("a recording ends with a footer")
}

/// The body of a chunk with extended records, and the positions of its records by those before.
fn extended_chunk(body: &[u8], kinds: &[u8], fields: &[u8]) -> (Vec<u8>, BTreeMap<u64, u64>) {
    let Record::Chunk { header, data } = mcap::parse_record(op::CHUNK, body).unwrap() else {
        unreachable!("it is a chunk")
    };
    let size = header.uncompressed_size as usize;
    let before = zstd::bulk::decompress(&data, size).unwrap();
    let mut inside = ExtendedFile {
        bytes: Vec::new(),
        kinds,
        fields,
    };
    let mut moved = BTreeMap::new();
    for (start, opcode, body) in records(&before, 0) {
        moved.insert(start as u64, inside.bytes.len() as u64);
        inside.record(opcode, body);
    }
    let packed = zstd::bulk::compress(&inside.bytes, 1).unwrap();
    let mut body = body[..16].to_vec();
    body.extend((inside.bytes.len() as u64).to_le_bytes());
    body.extend(crc32fast::hash(&inside.bytes).to_le_bytes());
    body.extend([4, 0, 0, 0]);
    body.extend(b"zstd");
    body.extend((packed.len() as u64).to_le_bytes());
    body.extend(packed);
    (body, moved)
}
