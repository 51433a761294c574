//! ROS 1 bags, format 2.0 (wiki.ros.org/Bags/Format/2.0): chunks of connections and messages.
//!
//! The chunks are read one after the other, so that a bag without its index, which a killed
//! recorder leaves, needs no reindexing. The index only repeats the connections, which are used if
//! the chunk that declares them is damaged. Behind damage, reading continues at the next bytes that
//! are the header of a chunk. The format has no checksums but those inside bz2 and LZ4.

use crate::mcap::file::{FileReader, McapFile};
use crate::mcap::records::DamagedPart;
use crate::stream::channel::{Channel, EventReader, FileEvent, ROS1};
use bzip2::read::BzDecoder;
use parking_lot::Mutex;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::PathBuf;
use std::sync::LazyLock;
use svl_core::{Error, Result};
use xxhash_rust::xxh3::xxh3_128;

/// First bytes of such a file, without the line break.
pub(crate) const MAGIC: &[u8] = b"#ROSBAG V2.0";
/// Limits on the header of a record and on a chunk, packed and unpacked, bytes: headers have a
/// hundred, chunks 768 KiB by default and at least one message.
const MAX_HEADER: u32 = 1 << 16;
const MAX_CHUNK: u32 = 1 << 30;
/// Limit on connections, and on the bytes of one: it has the definition of its messages.
const MAX_CONNECTIONS: usize = 10_000;
const MAX_CONNECTION: u32 = 1 << 22;
/// Bytes searched at a time behind damage, first and at most, and those that a chunk's header needs
/// at most.
const FIRST_WINDOW: usize = 1 << 12;
const WINDOW: usize = 1 << 18;
const CHUNK_HEADER: usize = 128;
/// The field of a header that marks a chunk: length, name, value.
const CHUNK_FIELD: &[u8] = &[4, 0, 0, 0, b'o', b'p', b'=', CHUNK];

/// Kinds of records.
const MESSAGE: u8 = 2;
const BAG: u8 = 3;
const CHUNK: u8 = 5;
const CONNECTION: u8 = 7;

/// Chunks that were unpacked from bz2, which takes far longer than to read them: a command reads a
/// bag several times, and unpacks it once.
static UNPACKED: LazyLock<Mutex<UnpackedChunks>> = LazyLock::new(Mutex::default);

#[derive(Default)]
struct UnpackedChunks {
    /// A temporary file without a name.
    file: Option<File>,
    /// Start and length of each chunk, by the hash of its packed bytes.
    places: BTreeMap<u128, (u64, usize)>,
}

impl UnpackedChunks {
    /// Reads a chunk that was unpacked before. False if there is none.
    fn read(&mut self, key: u128, chunk: &mut Vec<u8>) -> io::Result<bool> {
        let (Some(file), Some((at, length))) = (&mut self.file, self.places.get(&key)) else {
            return Ok(false);
        };
        chunk.resize(*length, 0);
        file.seek(SeekFrom::Start(*at))?;
        file.read_exact(chunk).map(|()| true)
    }

    fn keep(&mut self, key: u128, chunk: &[u8]) -> io::Result<()> {
        let file = match &mut self.file {
            Some(file) => file,
            none => none.insert(tempfile::tempfile()?),
        };
        let at = file.seek(SeekFrom::End(0))?;
        file.write_all(chunk)?;
        self.places.insert(key, (at, chunk.len()));
        Ok(())
    }
}

/// Unpacks a chunk, at most `limit` bytes of it. Returns their number.
fn unpack_bz2(mut file: impl Read, limit: u64, chunk: &mut Vec<u8>) -> io::Result<usize> {
    let mut packed = Vec::new();
    file.read_to_end(&mut packed)?;
    let key = xxh3_128(&packed);
    if UNPACKED.lock().read(key, chunk)? {
        return Ok(chunk.len());
    }
    let length = BzDecoder::new(&packed[..]).take(limit).read_to_end(chunk)?;
    if (length as u64) < limit {
        // A full disk costs time, but no message.
        drop(UNPACKED.lock().keep(key, chunk));
    }
    Ok(length)
}

/// The messages of a bag in recorded order.
pub(crate) struct Ros1Messages {
    path: PathBuf,
    file: FileReader,
    len: u64,
    /// Start of the next record.
    at: u64,
    /// Start of the index; 0 in a bag that was not closed.
    index: u64,
    channels: BTreeMap<u32, Channel>,
    /// Definitions of their messages, by topic.
    definitions: BTreeMap<String, String>,
    /// The unpacked chunk, and the start of its next record.
    chunk: Vec<u8>,
    within: usize,
    /// Start of that chunk in the file.
    chunk_at: u64,
    /// Bytes that may still be read and unpacked in vain: many false chunks then end the search
    /// instead of taking the user's time.
    budget: u64,
    losses: Vec<DamagedPart>,
    /// True once its losses were reported.
    has_ended: bool,
}

/// The fields of a record's header.
struct HeaderFields<'a>(&'a [u8]);

impl<'a> HeaderFields<'a> {
    fn get(&self, name: &str) -> Option<&'a [u8]> {
        let mut rest = self.0;
        while let Some((length, bytes)) = rest.split_first_chunk::<4>() {
            let (field, after) = bytes.split_at_checked(u32::from_le_bytes(*length) as usize)?;
            let equals = field.iter().position(|byte| *byte == b'=')?;
            if field[..equals] == *name.as_bytes() {
                return Some(&field[equals + 1..]);
            }
            rest = after;
        }
        None
    }

    fn u32(&self, name: &str) -> Option<u32> {
        Some(u32::from_le_bytes(self.get(name)?.try_into().ok()?))
    }

    fn u64(&self, name: &str) -> Option<u64> {
        Some(u64::from_le_bytes(self.get(name)?.try_into().ok()?))
    }

    fn kind(&self) -> Option<u8> {
        self.get("op")?.first().copied()
    }

    fn text(&self, name: &str) -> Option<String> {
        Some(String::from_utf8_lossy(self.get(name)?).into_owned())
    }

    /// The id and the channel of a connection record with this data, and the definition of its
    /// messages.
    fn connection(&self, data: &[u8]) -> Option<(u32, Channel, String)> {
        let inner = HeaderFields(data);
        let topic = self.text("topic").or_else(|| inner.text("topic"))?;
        let channel = Channel::new(topic, inner.text("type")?, ROS1.to_owned());
        let definition = inner.text("message_definition").unwrap_or_default();
        Some((self.u32("conn")?, channel, definition))
    }
}

impl Ros1Messages {
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] for an encrypted bag.
    pub(crate) fn open(file: &McapFile) -> Result<Self> {
        let mut messages = Self {
            path: file.path().to_owned(),
            file: file.reader()?,
            len: file.len(),
            at: MAGIC.len() as u64 + 1,
            index: 0,
            channels: BTreeMap::new(),
            definitions: BTreeMap::new(),
            chunk: Vec::new(),
            within: 0,
            chunk_at: 0,
            budget: file.len().saturating_mul(16).saturating_add(16 << 20),
            losses: Vec::new(),
            has_ended: false,
        };
        let read = messages.read_head();
        if read.map_err(|e| Error::io(file.path(), e))? {
            return Ok(messages);
        }
        let cure = "decrypt it first, with ROS 1's `rosbag decrypt`";
        Err(Error::format(
            file.path(),
            format!("is an encrypted bag; {cure}"),
        ))
    }

    /// The messages from `places` places on, all over the bag; none without an index.
    ///
    /// # Errors
    /// The errors of [`Ros1Messages::open`].
    pub(crate) fn places(file: &McapFile, places: usize) -> Result<Vec<Self>> {
        let mut found = Vec::new();
        for place in 1..=places as u64 {
            let mut messages = Self::open(file)?;
            let at = file.len() / (places as u64 + 1) * place;
            if let Ok(Some(at)) = messages.search(at)
                && !messages.channels.is_empty()
            {
                messages.at = at;
                found.push(messages);
            }
        }
        Ok(found)
    }

    /// The channels: those of the index, or else those found in reading the bag to its end.
    pub(crate) fn channels(mut self) -> Vec<Channel> {
        if self.channels.is_empty() {
            while let Ok(Some(_)) = self.next() {}
        }
        let mut channels: Vec<_> = self.channels.into_values().collect();
        channels.sort_unstable_by(|a, b| a.topic.cmp(&b.topic));
        channels.dedup();
        channels
    }

    /// The definitions of the messages by topic, found as [`Ros1Messages::channels`].
    pub(crate) fn definitions(mut self) -> BTreeMap<String, String> {
        if self.channels.is_empty() {
            while let Ok(Some(_)) = self.next() {}
        }
        self.definitions
    }

    /// The damaged parts so far.
    pub(crate) fn take_losses(&mut self) -> Vec<DamagedPart> {
        std::mem::take(&mut self.losses)
    }

    /// Reads the bag's header and the connections of the index. False if it is encrypted.
    fn read_head(&mut self) -> io::Result<bool> {
        let Some((header, data)) = self.head(self.at)? else {
            self.lose(self.at, 0, "its header is damaged");
            return Ok(true);
        };
        let fields = HeaderFields(&header);
        if fields.kind() != Some(BAG) {
            self.lose(self.at, 0, "its header is damaged");
            return Ok(true);
        }
        if fields.get("encryptor").is_some_and(|name| !name.is_empty()) {
            return Ok(false);
        }
        self.index = fields.u64("index_pos").unwrap_or(0);
        self.at = data.end;
        // Past the end, the bag was cut; the walk over its chunks reports it.
        let mut at = self.index.max(data.end);
        while self.index > 0 && self.channels.len() < MAX_CONNECTIONS {
            let Some((header, data)) = self.head(at)? else {
                break;
            };
            if HeaderFields(&header).kind() != Some(CONNECTION) {
                break;
            }
            at = data.end;
            self.declare(&header, data)?;
        }
        Ok(true)
    }

    fn declare(&mut self, header: &[u8], data: std::ops::Range<u64>) -> io::Result<()> {
        if data.end - data.start <= MAX_CONNECTION.into() {
            let bytes = self.read(data.start, data.end - data.start)?;
            self.connect(HeaderFields(header).connection(&bytes));
        }
        Ok(())
    }

    fn connect(&mut self, connection: Option<(u32, Channel, String)>) {
        if let Some((id, channel, definition)) = connection
            && self.channels.len() < MAX_CONNECTIONS
        {
            self.definitions.insert(channel.topic.clone(), definition);
            self.channels.insert(id, channel);
        }
    }

    /// The header of the record at `at`, and the position of its data; `None` if it is damaged or
    /// does not fit the file.
    fn head(&mut self, at: u64) -> io::Result<Option<(Vec<u8>, std::ops::Range<u64>)>> {
        let Some(length) = self.read_u32(at)?.filter(|length| *length <= MAX_HEADER) else {
            return Ok(None);
        };
        let start = at + 4 + u64::from(length);
        let Some(data) = self.read_u32(start)? else {
            return Ok(None);
        };
        let (start, end) = (start + 4, start + 4 + u64::from(data));
        if end > self.len {
            return Ok(None);
        }
        Ok(Some((self.read(at + 4, length.into())?, start..end)))
    }

    fn read_u32(&mut self, at: u64) -> io::Result<Option<u32>> {
        if at.saturating_add(4) > self.len {
            return Ok(None);
        }
        let bytes = self.read(at, 4)?;
        Ok(bytes.first_chunk().map(|bytes| u32::from_le_bytes(*bytes)))
    }

    /// Reads bytes that are within the file and limited.
    fn read(&mut self, at: u64, bytes: u64) -> io::Result<Vec<u8>> {
        let mut read = Vec::new();
        self.file.read_at(at, bytes, &mut read)?;
        Ok(read)
    }

    fn lose(&mut self, at_byte: u64, bytes: u64, reason: &str) {
        let reason = reason.to_owned();
        self.losses.push(DamagedPart {
            at_byte,
            bytes,
            reason,
        });
    }

    /// Unpacks the next chunk. False at the end of the file.
    fn next_chunk(&mut self) -> io::Result<bool> {
        self.chunk.clear();
        self.within = 0;
        while self.at < self.len {
            let at = self.at;
            let Some((header, data)) = self.head(at)? else {
                self.resynchronize(at, "a record is damaged or cut off")?;
                continue;
            };
            let fields = HeaderFields(&header);
            match fields.kind() {
                Some(CHUNK) => {
                    self.at = data.end;
                    let packed = data.end - data.start;
                    if let Err(reason) = self.unpack(&fields, data)? {
                        let in_vain = packed + self.chunk.len() as u64;
                        self.budget = self.budget.saturating_sub(in_vain);
                        // A wrong length would lead into the middle of another chunk.
                        self.resynchronize(at, &reason)?;
                        continue;
                    }
                    self.chunk_at = at;
                    return Ok(true);
                }
                Some(CONNECTION) => {
                    self.at = data.end;
                    self.declare(&header, data)?;
                }
                Some(_) => self.at = data.end,
                None => self.resynchronize(at, "a record is damaged")?,
            }
        }
        // Records of the index follow the last chunk.
        if self.index == 0 {
            self.lose(
                self.len,
                0,
                "its recorder was stopped before it wrote the index",
            );
        } else if self.index >= self.len {
            self.lose(self.len, 0, "it is cut off before its index");
        }
        Ok(false)
    }

    /// Unpacks the chunk with this data. Inner: the reason why it cannot be unpacked.
    fn unpack(
        &mut self,
        fields: &HeaderFields<'_>,
        data: std::ops::Range<u64>,
    ) -> io::Result<std::result::Result<(), String>> {
        let (Some(compression), Some(size)) = (fields.text("compression"), fields.u32("size"))
        else {
            return Ok(Err("a chunk has no compression or size".to_owned()));
        };
        let packed = data.end - data.start;
        if size > MAX_CHUNK || packed > MAX_CHUNK.into() {
            return Ok(Err(format!(
                "a chunk of {packed} bytes, {size} unpacked, is too large"
            )));
        }
        self.file.seek(data.start);
        let file = (&mut self.file).take(packed);
        // One byte more than promised shows that the size is wrong.
        let limit = u64::from(size) + 1;
        let read = match compression.as_str() {
            "none" => file.take(limit).read_to_end(&mut self.chunk),
            "lz4" => lz4::Decoder::new(file)
                .and_then(|decoder| decoder.take(limit).read_to_end(&mut self.chunk)),
            "bz2" => unpack_bz2(file, limit, &mut self.chunk),
            other => return Ok(Err(format!("a chunk is compressed in '{other}'"))),
        };
        Ok(match read {
            Ok(length) if length as u64 == u64::from(size) => Ok(()),
            Ok(length) => Err(format!("a chunk has {length} bytes instead of {size}")),
            Err(e) => Err(format!("a chunk in {compression} cannot be unpacked: {e}")),
        })
    }

    /// Continues at the next chunk behind the damage at `at`, or ends.
    fn resynchronize(&mut self, at: u64, reason: &str) -> io::Result<()> {
        self.chunk.clear();
        self.at = self.search(at + 1)?.unwrap_or(self.len);
        self.lose(at, self.at - at, reason);
        if self.budget == 0 {
            let reason = "it has too many damaged parts to look for more";
            self.lose(self.len, 0, reason);
        }
        Ok(())
    }

    /// Start of the first record from `at` on that is a chunk by its header.
    fn search(&mut self, mut at: u64) -> io::Result<Option<u64>> {
        let mut window = FIRST_WINDOW;
        while at < self.len && self.budget > 0 {
            let bytes = self.read(at, (self.len - at).min(window as u64))?;
            self.budget = self.budget.saturating_sub(bytes.len() as u64);
            window = WINDOW.min(2 * window);
            let is_last = at + bytes.len() as u64 == self.len;
            let marks = bytes.windows(CHUNK_FIELD.len()).enumerate();
            for (mark, _) in marks.filter(|(_, field)| *field == CHUNK_FIELD) {
                // The order of a header's fields is free.
                for start in mark.saturating_sub(CHUNK_HEADER)..mark {
                    let Some(length) = bytes[start..].first_chunk() else {
                        continue;
                    };
                    let end = start + 4 + u32::from_le_bytes(*length) as usize;
                    if end < mark + CHUNK_FIELD.len() || end > mark + CHUNK_HEADER {
                        continue;
                    }
                    let header = bytes.get(start + 4..end).map(HeaderFields);
                    let is_chunk = header.is_some_and(|header| {
                        let has_all =
                            header.u32("size").is_some() && header.get("compression").is_some();
                        has_all && header.kind() == Some(CHUNK)
                    });
                    let place = at + start as u64;
                    if is_chunk && self.head(place)?.is_some() {
                        return Ok(Some(place));
                    }
                }
            }
            if is_last {
                break;
            }
            // A header on the border is in the next window.
            at += (bytes.len() - 2 * CHUNK_HEADER) as u64;
        }
        Ok(None)
    }

    /// The next message of the chunk: id, stamp, position of its data in the chunk.
    fn next_in_chunk(&mut self) -> Option<(u32, u64, std::ops::Range<usize>)> {
        while self.within < self.chunk.len() {
            let part = |at: usize| {
                let bytes = self.chunk.get(at..)?;
                let (length, bytes) = bytes.split_first_chunk::<4>()?;
                let length = u32::from_le_bytes(*length) as usize;
                (length <= bytes.len()).then_some(at + 4..at + 4 + length)
            };
            let header = part(self.within);
            let data = header.clone().and_then(|header| part(header.end));
            let (Some(header), Some(data)) = (header, data) else {
                self.lose(self.chunk_at, 0, "a record of a chunk is damaged");
                self.chunk.clear();
                return None;
            };
            self.within = data.end;
            let fields = HeaderFields(&self.chunk[header]);
            match fields.kind() {
                Some(CONNECTION) => {
                    let connection = fields.connection(&self.chunk[data]);
                    self.connect(connection);
                }
                Some(MESSAGE) => {
                    let id = fields.u32("conn");
                    if let (Some(id), Some(time)) = (id, fields.u64("time"))
                        && self.channels.contains_key(&id)
                    {
                        // Seconds in the lower half, nanoseconds in the upper one.
                        let stamp = (time & 0xFFFF_FFFF) * 1_000_000_000 + (time >> 32);
                        return Some((id, stamp, data));
                    }
                    self.lose(
                        self.chunk_at,
                        0,
                        "a message belongs to an undeclared connection",
                    );
                }
                _ => {}
            }
        }
        None
    }
}

impl EventReader for Ros1Messages {
    fn next(&mut self) -> Result<Option<FileEvent<'_>>> {
        while !self.has_ended {
            if let Some((id, log_time, data)) = self.next_in_chunk() {
                let data = Cow::Borrowed(&self.chunk[data]);
                let channel = &self.channels[&id];
                return Ok(Some(FileEvent::Message(channel, log_time, data)));
            }
            match self.next_chunk() {
                Ok(true) => {}
                Ok(false) => {
                    self.has_ended = true;
                    if let Some(first) = self.losses.first() {
                        return Err(Error::damaged(&self.path, first.to_string()));
                    }
                }
                Err(e) => {
                    self.has_ended = true;
                    return Err(Error::io(&self.path, e));
                }
            }
        }
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bzip2::Compression;
    use bzip2::write::BzEncoder;

    #[test]
    fn a_chunk_is_unpacked_once() {
        let packed = |text: &[u8]| {
            let mut encoder = BzEncoder::new(Vec::new(), Compression::fast());
            encoder.write_all(text).unwrap();
            encoder.finish().unwrap()
        };
        let is_kept = |packed: &[u8]| UNPACKED.lock().places.contains_key(&xxh3_128(packed));
        let chunks = [packed(&[1; 1000]), packed(&[2; 2000])];
        for round in 0..3 {
            for (chunk, (byte, length)) in chunks.iter().zip([(1, 1000), (2, 2000)]) {
                assert_eq!(is_kept(chunk), round > 0);
                let mut read = Vec::new();
                assert_eq!(unpack_bz2(&chunk[..], 5000, &mut read).unwrap(), length);
                assert_eq!(read, vec![byte; length]);
            }
        }
        // Neither one that is too long for its header, nor a damaged one.
        let long = packed(&[3; 3000]);
        assert_eq!(unpack_bz2(&long[..], 9, &mut Vec::new()).unwrap(), 9);
        let mut damaged = packed(&[4; 1000]);
        damaged[20] ^= 1;
        unpack_bz2(&damaged[..], 5000, &mut Vec::new()).unwrap_err();
        assert!(!is_kept(&long) && !is_kept(&damaged));
    }
}
