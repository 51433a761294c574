//! The records of an MCAP file, whole, cut or damaged, its own or another program's: read from
//! start to end in bounded memory, going on behind damage.
//!
//! Every length is checked against the file's size, a chunk is used only if it matches its CRC and
//! is whole, and the CRCs of data and summary section are checked on the way. So any changed byte
//! is detected, at the latest at the end, in files with CRCs; files of many ROS 2 recorders have
//! none, see [`Records::is_checked`].
//!
//! mcap's own readers (0.25) are not faster and less safe: `LinearReader` zero-fills the size that
//! a chunk claims, `MessageStream` returns messages before the CRC of their chunk is known, and
//! `IndexedReader` checks none. None tells the position of a record, which resynchronization needs.

use super::chunk::split;
use super::file::{McapFile, not_mcap};
use super::layout::{HEAD, has_fields, known_size, u32_at, u64_at};
use super::search::{LoadedRecord, PRIVATE, RecordFault, RecordSearch};
use crc32fast::Hasher;
use mcap::records::{Record, op};
use std::io::Result as IoResult;
use std::ops::Range;
use std::path::PathBuf;
use svl_core::{Error, Result};

pub(crate) use super::search::ANOTHER;

const MAGIC: u64 = mcap::MAGIC.len() as u64;

/// A part of a file that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct DamagedPart {
    pub at_byte: u64,
    /// Length of the part; 0 if something was never written, or is only detected here.
    pub bytes: u64,
    pub reason: String,
}

impl DamagedPart {
    /// True if records are skipped in a file of `len` bytes, apart from the one in which it ends.
    pub(crate) fn have_records_behind(losses: &[Self], len: u64) -> bool {
        let is_inside = |loss: &Self| loss.bytes > 0 && loss.at_byte + loss.bytes < len;
        losses.iter().any(is_inside)
    }
}

impl std::fmt::Display for DamagedPart {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (at, reason) = (self.at_byte, &self.reason);
        write!(
            f,
            "the recording is incomplete or damaged at byte {at}: {reason}"
        )
    }
}

/// Reads raw records, including those inside chunks. Damaged parts are skipped and noted.
pub(crate) struct Records {
    path: PathBuf,
    /// True if nothing is read behind the first damage that messages may be lost to.
    pub(crate) strict: bool,
    file: RecordSearch,
    /// Start of the next record of the file itself.
    at: u64,
    /// Start of the current record of the file itself; of an attachment, the size of its data.
    pub(crate) start: u64,
    pub(crate) attached: u64,
    /// The current record, if it is in a chunk.
    in_chunk: Option<Range<usize>>,
    part: Part,
    /// True if messages without a CRC were read in the files before the current one.
    unchecked: bool,
    /// The damaged parts that were skipped, in file order.
    pub(crate) losses: Vec<DamagedPart>,
    /// True if messages may be lost.
    pub(crate) is_broken: bool,
}

/// What is known of the current file, of several appended to each other.
struct Part {
    /// CRC of the section being read; `None` if reading began inside the file.
    crc: Option<Hasher>,
    has_header: bool,
    has_chunks: bool,
    /// True if the end magic was read: only an appended file may follow.
    finished: bool,
    /// True if messages without a CRC were read: in this data section, and before.
    unchecked: [bool; 2],
    /// No record is missed before this position: the end of the last proven record, or of the last
    /// search.
    sure: u64,
    /// Number of damaged parts in the files before.
    before: usize,
}

impl Part {
    /// A file whose records begin at `start`.
    fn new(start: u64, before: usize) -> Self {
        let mut crc = Hasher::new();
        crc.update(mcap::MAGIC);
        Self {
            crc: Some(crc),
            has_header: false,
            has_chunks: false,
            finished: false,
            unchecked: [false; 2],
            sure: start,
            before,
        }
    }
}

impl Records {
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] for a file without MCAP's magic, and, unless `strict`,
    /// without any proven record.
    pub(crate) fn open(file: &McapFile, strict: bool) -> Result<Self> {
        let mut records = Self {
            strict,
            ..Self::unread(file)?
        };
        let begins = records.begin().map_err(|e| records.io(e))?;
        if begins {
            return Ok(records);
        }
        Err(Error::format(
            file.path(),
            not_mcap(file.path(), &file.start()?),
        ))
    }

    /// A reader that is still to be moved to a record.
    pub(crate) fn unread(file: &McapFile) -> Result<Self> {
        Ok(Self {
            path: file.path().to_owned(),
            strict: false,
            file: RecordSearch::open(file)?,
            at: MAGIC,
            start: 0,
            attached: 0,
            in_chunk: None,
            part: Part::new(MAGIC, 0),
            unchecked: false,
            losses: Vec::new(),
            is_broken: false,
        })
    }

    /// Finds the first record. False in a file that is not MCAP.
    fn begin(&mut self) -> IoResult<bool> {
        if self.strict || self.file.is_magic(0)? {
            return self.file.is_magic(0);
        }
        // A file without any proven record is not MCAP.
        let Some(found) = self.file.find(0..self.file.len)? else {
            return Ok(false);
        };
        if !self.file.is_header(MAGIC)? {
            self.at = found;
        }
        self.note(0..self.at, "it does not begin as an MCAP file does");
        self.part.sure = self.at;
        Ok(true)
    }

    /// Moves to a record of the file itself.
    pub(crate) fn seek(&mut self, start: u64) {
        (self.at, self.part.sure, self.part.crc) = (start, start, None);
    }

    /// Moves to the summary section; false if the file has no intact one at its end.
    pub(crate) fn seek_summary(&mut self) -> Result<bool> {
        let start = self.summary().map_err(|e| self.io(e))?;
        start.into_iter().for_each(|start| self.seek(start));
        Ok(start.is_some())
    }

    fn summary(&mut self) -> IoResult<Option<u64>> {
        let Some(footer) = self.file.len.checked_sub(HEAD + 20 + MAGIC) else {
            return Ok(None);
        };
        let loaded = self.file.load(footer)?;
        let is_footer = loaded.is_ok_and(|loaded| loaded.opcode == op::FOOTER)
            && self.file.is_magic(footer + HEAD + 20)?;
        let start = u64_at(&self.file.body, 0).unwrap_or(0);
        if !is_footer || !(1..=footer).contains(&start) {
            return Ok(None);
        }
        let saved = u32_at(&self.file.body, 16).unwrap_or(0);
        let mut crc = Hasher::new();
        let covered = footer + HEAD + 16 - start;
        self.file
            .pieces(start, covered, |piece| crc.update(piece))?;
        Ok(Some(start).filter(|_| saved == 0 || saved == crc.finalize()))
    }

    /// True if reading began with the file.
    pub(crate) fn reads_all(&self) -> bool {
        self.part.crc.is_some()
    }

    /// True if all messages read so far are covered by a CRC. Otherwise changed bytes may be
    /// undetected.
    pub(crate) fn is_checked(&self) -> bool {
        !self.unchecked && self.part.unchecked == [false; 2]
    }

    /// True if records were skipped, apart from the one in which the file ends.
    pub(crate) fn has_skipped(&self) -> bool {
        DamagedPart::have_records_behind(&self.losses, self.file.len)
    }

    /// True if any part of the current file was skipped.
    pub(crate) fn has_losses(&self) -> bool {
        self.losses.len() > self.part.before
    }

    /// The error of the first damaged part; `None` without any.
    pub(crate) fn error(&self) -> Option<Error> {
        let first = self.losses.first()?;
        Some(Error::damaged(&self.path, first.to_string()))
    }

    fn io(&self, error: std::io::Error) -> Error {
        Error::io(&self.path, error)
    }

    /// The current record, parsed, or the reason why it cannot be read. An attachment is parsed as
    /// if it had no data.
    pub(crate) fn parse(&self, opcode: u8) -> std::result::Result<Record<'_>, String> {
        let body = match &self.in_chunk {
            Some(body) => {
                let body = &self.file.unpacked[body.clone()];
                // mcap allocates what a length says.
                if has_fields(opcode) && known_size(opcode, body, body.len() as u64).is_none() {
                    return Err("a record cannot be read: a length in it is beyond it".to_owned());
                }
                body
            }
            None => &self.file.body[..],
        };
        mcap::parse_record(opcode, body).map_err(|e| format!("a record cannot be read: {e}"))
    }

    /// Advances to the next record and returns its opcode; `None` at the end of the file.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn advance(&mut self) -> Result<Option<u8>> {
        self.step().map_err(|e| self.io(e))
    }

    fn step(&mut self) -> IoResult<Option<u8>> {
        loop {
            if let Some(opcode) = self.next_in_chunk() {
                return Ok(Some(opcode));
            }
            self.start = self.at;
            if self.part.finished && self.at == self.file.len {
                return Ok(None);
            }
            let loaded = match self.file.load(self.at)? {
                Ok(loaded) if loaded.opcode == ANOTHER => return Ok(Some(ANOTHER)),
                _ if self.part.finished => Err(RecordFault::cut("other data follow after its end")),
                Ok(loaded) => self.accept(loaded)?,
                Err(fault) => Err(fault),
            };
            match loaded {
                // The records of a chunk follow; nothing reads a footer.
                Ok(op::CHUNK | op::FOOTER) => {}
                Ok(opcode) => return Ok(Some(opcode)),
                Err(fault) => self.pass_over(fault)?,
            }
        }
    }

    fn next_in_chunk(&mut self) -> Option<u8> {
        let end = self.in_chunk.take()?.end;
        let (opcode, body, _) = split(&self.file.unpacked[end..])?;
        let start = end + HEAD as usize;
        self.in_chunk = Some(start..start + body.len());
        Some(opcode)
    }

    /// Takes the loaded record in, unless there is a reason not to trust it.
    fn accept(&mut self, loaded: LoadedRecord) -> IoResult<std::result::Result<u8, RecordFault>> {
        let opcode = loaded.opcode;
        // No writer mixes messages inside and outside of chunks, and one flipped bit can turn
        // another record into a message.
        if opcode == op::MESSAGE && self.part.has_chunks {
            let reason = "a message is outside of the chunks";
            return Ok(Err(RecordFault::beside(loaded.end, reason)));
        }
        // After damage any byte from 0x80 on looks like a private record, and the bytes after it
        // like its length.
        let is_doubtful = opcode >= PRIVATE && self.has_losses();
        let unknown = if is_doubtful {
            self.at + 1
        } else {
            loaded.unknown
        };
        if unknown < loaded.end {
            if self.file.find(unknown..loaded.end)?.is_some() {
                let reason = "the unknown part of a record covers others";
                return Ok(Err(RecordFault::beside(loaded.end, reason)));
            }
            // The search has loaded others.
            let _ = self.file.load(self.at)?;
        }
        if self.file.is_proven(&loaded)? {
            self.part.sure = loaded.end;
        }
        (self.at, self.attached) = (loaded.end, loaded.bytes);
        let (before, length) = (self.part.crc.clone(), loaded.end - self.start - HEAD);
        if let Some(crc) = &mut self.part.crc {
            crc.update(&[opcode]);
            crc.update(&length.to_le_bytes());
            match &loaded.streamed {
                Some(body) => crc.combine(body),
                None => crc.update(&self.file.body),
            }
        }
        match opcode {
            op::CHUNK => {
                (self.in_chunk, self.part.has_chunks) = (Some(0..0), true);
                self.part.unchecked[0] |= !loaded.is_checked;
            }
            op::MESSAGE => self.part.unchecked[0] = true,
            // MCAP requires it first; it is accepted anywhere, as its position does not matter.
            op::HEADER => self.part.has_header = true,
            op::DATA_END => {
                let is_checked = self.check_crc("data section", before, 0);
                let [section, earlier] = self.part.unchecked;
                self.part.unchecked = [false, earlier || section && !is_checked];
                self.part.crc = self.part.crc.take().map(|_| Hasher::new());
            }
            op::FOOTER => return self.finish(before),
            _ => {}
        }
        Ok(Ok(opcode))
    }

    /// Ends a file at its footer. `section`: CRC of the summary section before it.
    fn finish(
        &mut self,
        mut section: Option<Hasher>,
    ) -> IoResult<std::result::Result<u8, RecordFault>> {
        // The CRC covers the footer up to the CRC itself.
        let head = [
            &[op::FOOTER][..],
            &20_u64.to_le_bytes(),
            &self.file.body[..16],
        ]
        .concat();
        section.iter_mut().for_each(|section| section.update(&head));
        self.check_crc("summary section", section, 16);
        if !self.part.has_header && self.reads_all() && !self.has_losses() {
            self.missing("it has no header");
        }
        self.start = self.at;
        if !self.file.is_magic(self.at)? {
            return Ok(Err(RecordFault::cut(
                "it does not end as an MCAP file does",
            )));
        }
        self.at += MAGIC;
        (self.part.finished, self.part.sure) = (true, self.at);
        Ok(Ok(op::FOOTER))
    }

    /// Checks the CRC of a section, which is at `place` in the current record; returns true if it
    /// has one, which matches.
    fn check_crc(&mut self, section: &str, crc: Option<Hasher>, place: usize) -> bool {
        let saved = u32_at(&self.file.body, place).unwrap_or(0);
        let Some(calculated) = crc.map(Hasher::finalize).filter(|_| saved != 0) else {
            return false;
        };
        // Damage found before explains a CRC that does not match.
        if saved != calculated && !self.has_losses() {
            self.missing(&format!(
                "the CRC of its {section} is {calculated:08x}, {saved:08x} expected"
            ));
        }
        saved == calculated
    }

    /// Continues in the appended file that begins here, see [`ANOTHER`].
    pub(crate) fn begin_another(&mut self) {
        // Both files are read; the note is that there are two.
        let reason = ["it is truncated, and another", "another"][usize::from(self.part.finished)];
        self.note(
            self.start..self.start,
            &format!("{reason} MCAP file follows"),
        );
        (self.is_broken, self.unchecked) = (true, !self.is_checked());
        self.at = self.start + MAGIC;
        self.part = Part::new(self.at, self.losses.len());
    }

    /// Skips the current record and notes the reason.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn lose(&mut self, reason: &str) -> Result<()> {
        if self.in_chunk.is_some() {
            self.note(self.start..self.at, reason);
            self.is_broken = true;
            return Ok(());
        }
        self.pass_over(RecordFault::new(self.at, reason))
            .map_err(|e| self.io(e))
    }

    /// Notes that something is missing.
    pub(crate) fn missing(&mut self, reason: &str) {
        self.is_broken = true;
        self.note(self.at..self.at, reason);
    }

    /// Skips the record at `start`: up to its end, or to a proven record before that.
    fn pass_over(&mut self, fault: RecordFault) -> IoResult<()> {
        let end = fault.end.unwrap_or(self.file.len);
        // Not at `sure` itself, where the corrupt record begins. Nor at the skipped record, which
        // its known part may prove.
        let (sure, begin) = (self.part.sure, self.start);
        let found = match self.file.find(sure + 1..begin)? {
            Some(found) => found,
            // Nothing behind it is read.
            None if self.strict && !fault.is_beside => end,
            None => self
                .file
                .find((sure + 1).max(begin + 1)..end)?
                .unwrap_or(end),
        };
        // Bytes read before and again after the search count, or two corrupt lengths could loop.
        let read = fault.end.unwrap_or(begin);
        self.file.spend(read.saturating_sub(found));
        // The length that led here may itself be corrupt, and point too far.
        self.note(
            if found < begin { sure } else { begin }..found,
            &fault.reason,
        );
        self.is_broken |= !fault.is_beside;
        (self.at, self.part.sure) = (found, found);
        self.part.finished = found == self.file.len;
        Ok(())
    }

    fn note(&mut self, part: Range<u64>, reason: &str) {
        let loss = DamagedPart {
            at_byte: part.start,
            bytes: part.end - part.start,
            reason: reason.to_owned(),
        };
        match self.losses[self.part.before..].last_mut() {
            Some(last) if *last == loss => {}
            // Adjacent parts, or parts of the same chunk, are one.
            Some(last)
                if last.bytes.min(loss.bytes) > 0
                    && (last.at_byte..=last.at_byte + last.bytes).contains(&loss.at_byte) =>
            {
                last.bytes = last.bytes.max(part.end - last.at_byte);
            }
            _ => self.losses.push(loss),
        }
    }

    /// The record of the file itself at `start`; `None` if none can be read there.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn record_at(&mut self, start: u64) -> Result<Option<Record<'_>>> {
        if self.opcode_at(start)?.is_none() {
            return Ok(None);
        }
        self.in_chunk = None;
        match self.file.load(start).map_err(|e| self.io(e))? {
            Ok(loaded) => Ok(self.parse(loaded.opcode).ok()),
            Err(_) => Ok(None),
        }
    }

    /// Gives the data of the attachment at `start` piece by piece; false if it cannot be read.
    ///
    /// # Errors
    /// [`Error::Io`]; those of `take`.
    pub(crate) fn attachment(
        &mut self,
        start: u64,
        mut take: impl FnMut(&[u8]) -> Result<()>,
    ) -> Result<bool> {
        if self.opcode_at(start)? != Some(op::ATTACHMENT) {
            return Ok(false);
        }
        let Ok(loaded) = self.file.load(start).map_err(|e| self.io(e))? else {
            return Ok(false);
        };
        let (data, mut taken) = (loaded.unknown - 4 - loaded.bytes, Ok(()));
        let read = self.file.pieces(data, loaded.bytes, |piece| {
            if taken.is_ok() {
                taken = take(piece);
            }
        });
        read.map_err(|e| self.io(e))?;
        taken.map(|()| true)
    }

    /// Opcode of the record at `start`; `None` if the file has no room for one.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn opcode_at(&mut self, start: u64) -> Result<Option<u8>> {
        let head = self.file.head(start).map_err(|e| self.io(e))?;
        Ok(head.map(|(opcode, _)| opcode))
    }
}

/// The data of the attachment at `start`; `None` if it cannot be read.
///
/// # Errors
/// [`Error::Io`].
pub(crate) fn attachment(file: &McapFile, start: u64) -> Result<Option<Vec<u8>>> {
    let mut data = Vec::new();
    let is_read = Records::unread(file)?.attachment(start, |piece| {
        data.extend_from_slice(piece);
        Ok(())
    })?;
    Ok(is_read.then_some(data))
}
