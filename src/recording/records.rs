//! The records of an MCAP file, read from start to end in bounded memory.
//!
//! Every length is checked against the file's size, a chunk is used only if it matches its CRC, and
//! the CRCs of data and summary section are checked on the way. So any changed byte is detected, at
//! the latest at the end, in files with CRCs; files of many ROS 2 recorders have none, see
//! [`Records::is_checked`].
//!
//! This walker also reads intact files, instead of mcap's own readers (0.25), which are not faster
//! and less safe. The messages of the arena's recording (109 MB) take 0.17 s of CPU time here, 0.19
//! s with `LinearReader` and all its CRCs, 0.19 s with `MessageStream`, 0.17 s with `IndexedReader`
//! (Intel Xeon model 207, one thread of two cores). Of these, `IndexedReader` checks no CRC;
//! `MessageStream` returns messages before the CRC of their chunk is known, and ends before the
//! CRCs of data and summary section; `LinearReader` zero-fills the size that a chunk claims, 2.1 GB
//! and 5 s for a file of 278 bytes. None reports the position of a record in the file, which
//! salvage needs: this walker would be needed in addition to any of them.

use super::bag::not_mcap;
use super::chunk::Chunk;
use super::file::{FileReader, McapFile};
use super::layout::{HEAD, MAX_RECORD, known_size, u32_at, u64_at};
use super::salvage::{self, DamagedPart, Salvage};
use mcap::records::{Record, op};
use std::cell::Cell;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::PathBuf;
use svl_core::{Error, Result};

/// Code for the magic of an appended file. No record has this opcode.
pub(super) const ANOTHER: u8 = 0;
/// Footer record and end magic.
const TAIL: u64 = HEAD + 20 + 8;

/// Reads raw records, including those inside chunks.
///
/// Reading ends at the first damage. With salvage, damaged parts are skipped and noted.
pub(super) struct Records {
    path: PathBuf,
    file: BufReader<FileReader>,
    len: u64,
    /// Number of bytes read so far.
    at: u64,
    /// Start of the current record of the file itself.
    start: u64,
    /// CRC of the section being read.
    crc: crc32fast::Hasher,
    body: Vec<u8>,
    chunk: Chunk,
    /// True if the current record is in `chunk`.
    in_chunk: bool,
    /// In a cell, because a shared reference may find damage, which ends the reading.
    ended: Cell<bool>,
    extent: Extent,
    has_header: bool,
    has_chunks: bool,
    /// True if the end magic was read: only an appended file may follow.
    finished: bool,
    /// True if messages without a CRC were read: in this data section, and before.
    unchecked: [bool; 2],
    /// True if records were skipped, apart from the one in which the file ends.
    skipped: bool,
    salvage: Option<Salvage>,
}

/// Part of a file's records to read.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Extent {
    All,
    /// Records outside of chunks: neither messages nor the damage among them.
    Beside,
    /// The summary section.
    Summary,
    /// From a chunk to the end.
    Rest,
}

/// Result of reading at a position of the file.
enum Top {
    Record(u8),
    /// Handled already; the next one follows.
    Passed,
    End,
}

impl Records {
    pub(super) fn open(file: &McapFile) -> Result<Self> {
        let mut records = Self::unread(file)?;
        if records.begin()? {
            Ok(records)
        } else {
            Err(no_mcap(file))
        }
    }

    /// Same as [`Records::open`], but corrupt parts are skipped and recorded.
    pub(super) fn salvage(file: &McapFile) -> Result<Self> {
        let io = |e| Error::io(file.path(), e);
        let mut records = Self::unread(file)?;
        let mut salvage = Salvage::new(file.reader()?, records.len).map_err(io)?;
        if records.begin()? {
            salvage.trust(records.at);
        } else {
            let at = salvage
                .begin(records.len)
                .map_err(io)?
                .ok_or_else(|| no_mcap(file))?;
            records.skipped = at > mcap::MAGIC.len() as u64;
            records.seek(at)?;
        }
        records.salvage = Some(salvage);
        Ok(records)
    }

    fn unread(file: &McapFile) -> Result<Self> {
        Ok(Self {
            path: file.path().to_owned(),
            file: BufReader::with_capacity(1 << 18, file.reader()?),
            len: file.len(),
            at: 0,
            start: 0,
            crc: crc32fast::Hasher::new(),
            body: Vec::new(),
            chunk: Chunk::new().map_err(|e| Error::io(file.path(), e))?,
            in_chunk: false,
            ended: Cell::new(false),
            extent: Extent::All,
            has_header: false,
            has_chunks: false,
            finished: false,
            unchecked: [false; 2],
            skipped: false,
            salvage: None,
        })
    }

    /// Reads the magic; returns true if it is there.
    fn begin(&mut self) -> Result<bool> {
        let mut magic = [0; 8];
        Ok(self.len - self.at >= 8 && self.read(&mut magic).map(|()| magic == *mcap::MAGIC)?)
    }

    /// Restricts reading to the records outside of chunks from here on.
    pub(super) fn skip_chunks(&mut self) {
        self.extent = Extent::Beside;
    }

    /// True if the records in chunks are read too.
    pub(super) fn reads_all(&self) -> bool {
        self.extent == Extent::All
    }

    /// True if there are no more records.
    pub(super) fn has_ended(&self) -> bool {
        self.ended.get()
    }

    /// True if all messages read so far are covered by a CRC. Otherwise changed bytes may be
    /// undetected.
    pub(super) fn is_checked(&self) -> bool {
        self.unchecked == [false; 2]
    }

    /// The damaged parts that were skipped, in file order.
    pub(super) fn take_losses(&mut self) -> Vec<DamagedPart> {
        self.salvage
            .take()
            .map(Salvage::into_losses)
            .unwrap_or_default()
    }

    /// True if records were skipped, apart from the one in which the file ends.
    pub(super) fn has_skipped(&self) -> bool {
        self.skipped
    }

    /// True if any part of the current file was skipped.
    pub(super) fn has_losses(&self) -> bool {
        self.salvage.as_ref().is_some_and(Salvage::has_losses)
    }

    /// Moves to the summary section; returns false if the file has none.
    pub(super) fn seek_summary(&mut self) -> Result<bool> {
        let mut tail = [0; TAIL as usize];
        let Some(footer) = self.len.checked_sub(TAIL) else {
            return Ok(false);
        };
        self.seek(footer)?;
        self.read(&mut tail)?;
        let start = u64_at(&tail, 9).unwrap_or(0);
        // Read from the end; a file that was truncated or appended to has no footer there.
        if tail[0] != op::FOOTER || tail[29..] != *mcap::MAGIC || start == 0 || start > footer {
            return Ok(false);
        }
        self.seek(start)?;
        self.crc = crc32fast::Hasher::new();
        (self.extent, self.has_header) = (Extent::Summary, true);
        Ok(true)
    }

    /// Moves to the chunk that begins at `start`.
    pub(super) fn seek_chunk(&mut self, start: u64) -> Result<()> {
        (self.extent, self.has_header) = (Extent::Rest, true);
        self.seek(start)
    }

    /// The record of the file itself that begins at `start`; `None` if none can be read.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(super) fn record_at(&mut self, start: u64) -> Result<Option<Record<'_>>> {
        if self.opcode_at(start)?.is_none() {
            return Ok(None);
        }
        self.seek(start)?;
        self.extent = Extent::Beside;
        match self.advance() {
            // Chunks are skipped, so this may be a later record.
            Ok(Some(opcode)) if self.start == start => Ok(self.parse(opcode).ok()),
            Ok(_) | Err(Error::Damaged { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Opcode of the record at `start`; `None` if the file has no room for one.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(super) fn opcode_at(&mut self, start: u64) -> Result<Option<u8>> {
        let Some(left) = self
            .len
            .checked_sub(HEAD)
            .and_then(|last| last.checked_sub(start))
        else {
            return Ok(None);
        };
        let mut head = [0; HEAD as usize];
        self.seek(start)?;
        self.read(&mut head)?;
        Ok(u64_at(&head, 1)
            .filter(|&length| length <= left)
            .map(|_| head[0]))
    }

    /// Start of the current record of the file itself.
    pub(super) fn start(&self) -> u64 {
        self.start
    }

    fn seek(&mut self, to: u64) -> Result<()> {
        self.at = self
            .file
            .seek(SeekFrom::Start(to))
            .map_err(|e| Error::io(&self.path, e))?;
        Ok(())
    }

    fn read(&mut self, bytes: &mut [u8]) -> Result<()> {
        self.file
            .read_exact(bytes)
            .map_err(|e| Error::io(&self.path, e))?;
        self.at += bytes.len() as u64;
        self.crc.update(bytes);
        Ok(())
    }

    /// Advances to the next record and returns its opcode; `None` at the end of the file, and after
    /// an error.
    pub(super) fn advance(&mut self) -> Result<Option<u8>> {
        let opcode = if self.ended.get() {
            Ok(None)
        } else {
            self.step()
        };
        if !matches!(opcode, Ok(Some(_))) {
            self.ended.set(true);
        }
        opcode
    }

    /// The body of the current record.
    pub(super) fn body(&self) -> &[u8] {
        if self.in_chunk {
            self.chunk.body()
        } else {
            &self.body
        }
    }

    /// The current record, parsed, or the reason why it cannot be read.
    pub(super) fn parse(&self, opcode: u8) -> std::result::Result<Record<'_>, String> {
        let body = self.body();
        // mcap 0.25 panics on an attachment that ends before its CRC.
        if opcode == op::ATTACHMENT && known_size(opcode, body, body.len() as u64).is_none() {
            return Err("an attachment is truncated".to_owned());
        }
        mcap::parse_record(opcode, body).map_err(|e| format!("a record cannot be read: {e}"))
    }

    fn step(&mut self) -> Result<Option<u8>> {
        loop {
            self.in_chunk = !self.chunk.is_done();
            if self.in_chunk {
                match self.chunk.advance() {
                    Ok(opcode) => return Ok(Some(opcode)),
                    Err(reason) => {
                        self.chunk.clear();
                        self.pass_over(self.at, reason)?;
                        continue;
                    }
                }
            }
            self.start = self.at;
            match self.top()? {
                Top::Record(op::CHUNK) if self.extent == Extent::Beside => {}
                Top::Record(op::CHUNK) => match self.chunk.open(&self.body) {
                    Ok(()) => {
                        self.has_chunks = true;
                        self.unchecked[0] |= !self.chunk.has_crc();
                        match &mut self.salvage {
                            Some(salvage) if self.chunk.has_crc() => salvage.trust(self.at),
                            Some(salvage) if self.chunk.has_only_complete_records() => {
                                salvage.trust_if_followed(self.at)
                            }
                            _ => {}
                        }
                    }
                    Err(reason) => {
                        self.pass_over(self.at, &format!("a chunk is damaged: {reason}"))?
                    }
                },
                Top::Record(opcode) => {
                    self.unchecked[0] |= opcode == op::MESSAGE;
                    return Ok(Some(opcode));
                }
                Top::Passed => {}
                Top::End => return Ok(None),
            }
        }
    }

    /// Reads the next record outside of chunks into `body`.
    fn top(&mut self) -> Result<Top> {
        let left = self.len - self.at;
        if left < HEAD {
            return match (left, self.finished) {
                // Exactly the end magic was last.
                (0, true) => Ok(Top::End),
                (0, false) => self.cut("it was never finished"),
                _ => self.cut("it ends inside a record"),
            };
        }
        // The CRC of a section ends before the record that contains it.
        let section = self.crc.clone();
        let mut head = [0; HEAD as usize];
        self.read(&mut head)?;
        if head.starts_with(mcap::MAGIC) {
            return Ok(Top::Record(ANOTHER));
        }
        let (opcode, length) = (head[0], u64_at(&head, 1).unwrap_or(u64::MAX));
        if let Some(reason) = self.head_fault(opcode, length) {
            return self.cut(&reason);
        }
        if let Some(salvage) = &mut self.salvage {
            salvage.follows(self.start, opcode);
        }
        // Seeking makes the walk cheap: only heads are read.
        if opcode == op::CHUNK && self.extent == Extent::Beside {
            // Checked above: not beyond the end of the file.
            self.file
                .seek_relative(length as i64)
                .map_err(|e| Error::io(&self.path, e))?;
            self.at += length;
            return Ok(Top::Record(opcode));
        }
        // At most the rest of the file, so a corrupt length cannot allocate more than that.
        self.body.resize(length as usize, 0);
        self.file
            .read_exact(&mut self.body)
            .map_err(|e| Error::io(&self.path, e))?;
        self.at += length;
        self.crc.update(&self.body);
        if let Some(reason) = self.untrusted(opcode)? {
            self.pass_over(self.at, &reason)?;
            return Ok(Top::Passed);
        }
        if self.extent == Extent::Summary && is_data(opcode) {
            return Err(self.damaged("its summary is not where its footer says"));
        }
        self.check_section(opcode, section, &head)
    }

    /// The reason why no record can have this head, which was just read.
    fn head_fault(&self, opcode: u8, length: u64) -> Option<String> {
        if self.finished {
            return Some("other data follow after its end".to_owned());
        }
        if opcode == 0 {
            return Some("there is no record here".to_owned());
        }
        let left = self.len - self.at;
        if length > left {
            let reason =
                format!("it ends inside a record of {length} bytes, of which it has {left}");
            return Some(reason);
        }
        (length > MAX_RECORD)
            .then(|| format!("a record of {length} bytes is longer than {MAX_RECORD}"))
    }

    /// The reason why salvage does not trust the record just read.
    fn untrusted(&mut self, opcode: u8) -> Result<Option<String>> {
        if self.salvage.is_some()
            && let Err(reason) = self.examine(opcode)
        {
            return Ok(Some(reason));
        }
        let Some(salvage) = &mut self.salvage else {
            return Ok(None);
        };
        if salvage
            .covers_others(opcode, &self.body, self.start..self.at)
            .map_err(|e| Error::io(&self.path, e))?
        {
            let reason = "the unknown part of a record covers others";
            return Ok(Some(reason.to_owned()));
        }
        if matches!(opcode, op::ATTACHMENT | op::METADATA | op::DATA_END) {
            salvage
                .try_trust(self.start..self.at)
                .map_err(|e| Error::io(&self.path, e))?;
        }
        Ok(None)
    }

    /// Checks the CRC of the section that ends with the record just read, if one does. `section`:
    /// that up to the record.
    fn check_section(
        &mut self,
        opcode: u8,
        section: crc32fast::Hasher,
        head: &[u8],
    ) -> Result<Top> {
        match opcode {
            // MCAP requires it first; it is accepted anywhere, as its position does not matter
            // here.
            op::HEADER => self.has_header = true,
            op::DATA_END => {
                let checked = self.check_crc("data section", section, u32_at(&self.body, 0))?;
                let [section, before] = self.unchecked;
                self.unchecked = [false, before || section && !checked];
                self.crc = crc32fast::Hasher::new();
            }
            op::FOOTER => {
                let mut summary = section;
                summary.update(head);
                // The CRC covers the footer up to the CRC itself.
                summary.update(self.body.get(..16).unwrap_or_default());
                self.check_crc("summary section", summary, u32_at(&self.body, 16))?;
                return self.finish();
            }
            _ => {}
        }
        Ok(Top::Record(opcode))
    }

    /// Reason why the record just read cannot be intact. Only salvage has to know before the CRC of
    /// the section is checked.
    fn examine(&self, opcode: u8) -> std::result::Result<(), String> {
        // No writer mixes messages inside and outside of chunks, and one flipped bit can turn
        // another record into a message.
        if opcode == op::MESSAGE && self.has_chunks {
            return Err("a message is outside of the chunks".to_owned());
        }
        salvage::examine(opcode, &self.body)
    }

    fn finish(&mut self) -> Result<Top> {
        if !self.has_header && !self.has_losses() {
            self.missing("it has no header")?;
        }
        self.start = self.at;
        if !self.begin()? {
            return self.cut("it does not end as an MCAP file does");
        }
        self.finished = true;
        if let Some(salvage) = &mut self.salvage {
            salvage.trust(self.at);
        }
        Ok(if self.at == self.len {
            Top::End
        } else {
            Top::Passed
        })
    }

    /// Continues in the appended file that begins here, see [`ANOTHER`].
    pub(super) fn begin_another(&mut self) -> Result<()> {
        let what = if self.finished {
            "another MCAP file follows"
        } else {
            "it is truncated, and another MCAP file follows"
        };
        let Some(salvage) = &mut self.salvage else {
            return Err(self.damaged(what));
        };
        // Both files are read; the note is that there are two.
        salvage.note(self.start..self.start, what);
        salvage.begin_another(self.start + 8);
        self.seek(self.start + 8)?;
        (self.has_header, self.has_chunks, self.finished) = (false, false, false);
        self.unchecked = [false, self.unchecked.contains(&true)];
        self.crc = crc32fast::Hasher::new();
        self.crc.update(mcap::MAGIC);
        Ok(())
    }

    /// Skips the current record and records the reason; an error without salvage.
    pub(super) fn lose(&mut self, reason: &str) -> Result<()> {
        match &mut self.salvage {
            Some(salvage) if self.in_chunk => {
                self.skipped = true;
                salvage.note(self.start..self.at, reason);
                Ok(())
            }
            _ => self.pass_over(self.at, reason),
        }
    }

    /// Records that something is missing; an error without salvage.
    pub(super) fn missing(&mut self, reason: &str) -> Result<()> {
        let Some(salvage) = &mut self.salvage else {
            return Err(self.damaged_at(self.at, reason));
        };
        salvage.note(self.at..self.at, reason);
        Ok(())
    }

    /// Skips a part whose end is unknown.
    fn cut(&mut self, reason: &str) -> Result<Top> {
        let skipped = self.skipped;
        self.pass_over(self.len, reason)?;
        self.skipped = skipped || self.at < self.len;
        Ok(Top::Passed)
    }

    /// Skips the current record up to `end`, or resynchronizes before it at a proven record; an
    /// error without salvage.
    fn pass_over(&mut self, end: u64, reason: &str) -> Result<()> {
        let Some(salvage) = &mut self.salvage else {
            return Err(self.damaged(reason));
        };
        let found = salvage
            .pass_over(self.start..self.at, end, reason)
            .map_err(|e| Error::io(&self.path, e))?;
        self.finished = found == self.len;
        self.skipped = true;
        self.seek(found)
    }

    /// Checks the CRC of a section; returns true if it has one, which matches.
    fn check_crc(
        &mut self,
        section: &str,
        crc: crc32fast::Hasher,
        saved: Option<u32>,
    ) -> Result<bool> {
        let calculated = crc.finalize();
        let Some(saved) = saved else {
            return self
                .missing(&format!("the end of its {section} is truncated"))
                .map(|()| false);
        };
        // A part was skipped, so the CRC was not computed over the section.
        let unread = matches!(self.extent, Extent::Beside | Extent::Rest);
        // Damage found before explains a CRC that does not match.
        if saved != 0 && saved != calculated && !unread && !self.has_losses() {
            self.missing(&format!(
                "the CRC of its {section} is {calculated:08x}, {saved:08x} expected"
            ))?;
        }
        Ok(saved == calculated && saved != 0)
    }

    /// The error for damage in the current record, which ends the reading.
    pub(super) fn damaged(&self, reason: &str) -> Error {
        // The start of the record: the position that salvage records for the same damage.
        self.damaged_at(self.start, reason)
    }

    fn damaged_at(&self, at_byte: u64, reason: &str) -> Error {
        self.ended.set(true);
        let loss = DamagedPart {
            at_byte,
            bytes: 0,
            reason: reason.to_owned(),
        };
        Error::damaged(&self.path, loss.to_string())
    }
}

fn no_mcap(file: &McapFile) -> Error {
    let mut start = Vec::new();
    let io = |e| Error::io(file.path(), e);
    let read = file
        .reader()
        .and_then(|reader| reader.take(8).read_to_end(&mut start).map_err(io));
    match read {
        Ok(_) => Error::format(file.path(), not_mcap(file.path(), &start)),
        Err(error) => error,
    }
}

/// True if records of this kind belong to the data section, including its end.
fn is_data(opcode: u8) -> bool {
    matches!(
        opcode,
        op::HEADER
            | op::MESSAGE
            | op::CHUNK
            | op::MESSAGE_INDEX
            | op::ATTACHMENT
            | op::METADATA
            | op::DATA_END
    )
}
