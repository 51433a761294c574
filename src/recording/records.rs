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

use super::bag::not_mcap;
use super::chunk::split;
use super::file::McapFile;
use super::layout::{HEAD, u32_at, u64_at};
use super::search::{Fault, Loaded, PRIVATE, RecordSearch};
use crc32fast::Hasher;
use mcap::records::{Record, op};
use std::io::Read as _;
use std::io::Result as IoResult;
use std::ops::Range;
use std::path::PathBuf;
use svl_core::{Error, Result};

pub(super) use super::search::ANOTHER;

/// Length of the footer and the magic behind it.
const FOOTER: u64 = HEAD + 20 + 8;

/// A part of a file that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct DamagedPart {
    pub at_byte: u64,
    /// Length of the part; 0 if something was never written, or is only detected here.
    pub bytes: u64,
    pub reason: String,
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
pub(super) struct Records {
    path: PathBuf,
    file: RecordSearch,
    /// Start of the next record of the file itself, and of the current one.
    at: u64,
    start: u64,
    /// Rest of the chunk, from the end, and the current record in it.
    in_chunk: bool,
    within: Range<usize>,
    /// CRC of the section being read; `None` if reading began inside it.
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
    losses: Vec<DamagedPart>,
    /// Number of damaged parts in the files before the current one, if files are appended.
    before: usize,
    /// True if messages may be lost.
    is_broken: bool,
    /// True if records were skipped, apart from the one in which the file ends.
    skipped: bool,
    /// Size of the data, if the current record is an attachment.
    attached: u64,
    /// False if reading began inside the file: then its sections and counts are unknown.
    reads_all: bool,
}

impl Records {
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] for a file without MCAP's magic, and, unless `strict`,
    /// without any proven record.
    pub(super) fn open(file: &McapFile, strict: bool) -> Result<Self> {
        let mut records = Self::unread(file)?;
        let begins = records.begin(strict).map_err(|e| records.io(e))?;
        begins.then_some(records).ok_or_else(|| no_mcap(file))
    }

    /// A reader that is still to be moved to a record.
    pub(super) fn unread(file: &McapFile) -> Result<Self> {
        Ok(Self {
            path: file.path().to_owned(),
            file: RecordSearch::open(file)?,
            at: mcap::MAGIC.len() as u64,
            start: 0,
            in_chunk: false,
            within: 0..0,
            crc: Some(Hasher::new()),
            has_header: false,
            has_chunks: false,
            finished: false,
            unchecked: [false; 2],
            sure: mcap::MAGIC.len() as u64,
            losses: Vec::new(),
            before: 0,
            is_broken: false,
            skipped: false,
            attached: 0,
            reads_all: true,
        })
    }

    /// Finds the first record. False in a file that is not MCAP.
    fn begin(&mut self, strict: bool) -> IoResult<bool> {
        self.crc.iter_mut().for_each(|crc| crc.update(mcap::MAGIC));
        if self.file.is_magic(0)? {
            return Ok(true);
        }
        if strict {
            return Ok(false);
        }
        // A file without any proven record is not MCAP.
        let Some(found) = self.file.find(0..self.file.len())? else {
            return Ok(false);
        };
        if !self.file.is_header(8)? {
            self.at = found;
        }
        self.skipped = self.at > mcap::MAGIC.len() as u64;
        self.note(0..self.at, "it does not begin as an MCAP file does");
        self.sure = self.at;
        Ok(true)
    }

    /// Moves to a record of the file itself.
    pub(super) fn seek(&mut self, start: u64) {
        (self.at, self.sure, self.reads_all, self.has_header) = (start, start, false, true);
        self.crc = None;
    }

    /// Moves to the summary section; false if the file has none at its end, where that of a file
    /// that was truncated or appended to is not.
    pub(super) fn seek_summary(&mut self) -> Result<bool> {
        let start = self.summary().map_err(|e| self.io(e))?;
        start.into_iter().for_each(|start| self.seek(start));
        self.crc = Some(Hasher::new());
        // No use behind damage.
        self.file.spend(u64::MAX);
        Ok(start.is_some())
    }

    fn summary(&mut self) -> IoResult<Option<u64>> {
        let Some(footer) = self.file.len().checked_sub(FOOTER) else {
            return Ok(None);
        };
        let is_footer = match self.file.load(footer)? {
            Ok(loaded) => loaded.opcode == op::FOOTER,
            Err(_) => false,
        };
        let start = u64_at(&self.file.body, 0).filter(|start| (1..=footer).contains(start));
        let is_footer = is_footer && self.file.is_magic(footer + HEAD + 20)?;
        Ok(start.filter(|_| is_footer))
    }

    /// True if reading began with the file.
    pub(super) fn reads_all(&self) -> bool {
        self.reads_all
    }

    /// True if all messages read so far are covered by a CRC. Otherwise changed bytes may be
    /// undetected.
    pub(super) fn is_checked(&self) -> bool {
        self.unchecked == [false; 2]
    }

    /// The damaged parts that were skipped, in file order.
    pub(super) fn losses(&self) -> &[DamagedPart] {
        &self.losses
    }

    /// True if messages may be lost.
    pub(super) fn is_broken(&self) -> bool {
        self.is_broken
    }

    /// True if records were skipped, apart from the one in which the file ends.
    pub(super) fn has_skipped(&self) -> bool {
        self.skipped
    }

    /// True if any part of the current file was skipped.
    pub(super) fn has_losses(&self) -> bool {
        self.losses.len() > self.before
    }

    /// Start of the current record of the file itself.
    pub(super) fn start(&self) -> u64 {
        self.start
    }

    /// Size of the data of the current record, which is an attachment.
    pub(super) fn attached(&self) -> u64 {
        self.attached
    }

    /// The error of the first damaged part; `None` without any.
    pub(super) fn error(&self) -> Option<Error> {
        let first = self.losses.first()?;
        Some(Error::damaged(&self.path, first.to_string()))
    }

    fn io(&self, error: std::io::Error) -> Error {
        Error::io(&self.path, error)
    }

    /// The body of the current record; of an attachment, as if it had no data.
    pub(super) fn body(&self) -> &[u8] {
        match self.in_chunk {
            true => &self.file.unpacked[self.within.clone()],
            false => &self.file.body,
        }
    }

    /// The current record, parsed, or the reason why it cannot be read.
    pub(super) fn parse(&self, opcode: u8) -> std::result::Result<Record<'_>, String> {
        mcap::parse_record(opcode, self.body()).map_err(|e| format!("a record cannot be read: {e}"))
    }

    /// Advances to the next record and returns its opcode; `None` at the end of the file.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(super) fn advance(&mut self) -> Result<Option<u8>> {
        self.step().map_err(|e| self.io(e))
    }

    fn step(&mut self) -> IoResult<Option<u8>> {
        loop {
            if let Some(opcode) = self.next_in_chunk() {
                return Ok(Some(opcode));
            }
            self.start = self.at;
            if self.finished && self.at == self.file.len() {
                return Ok(None);
            }
            let loaded = match self.file.load(self.at)? {
                Ok(loaded) if loaded.opcode == ANOTHER => return Ok(Some(ANOTHER)),
                _ if self.finished => Err(Fault::cut("other data follow after its end")),
                Ok(loaded) => self.accept(loaded)?,
                Err(fault) => Err(fault),
            };
            match loaded {
                // Its records follow; nothing reads a footer.
                Ok(op::CHUNK | op::FOOTER) => {}
                Ok(opcode) => return Ok(Some(opcode)),
                Err(fault) => self.pass_over(fault)?,
            }
        }
    }

    fn next_in_chunk(&mut self) -> Option<u8> {
        let rest = self.file.unpacked.get(self.within.end..);
        let next = rest.filter(|_| self.in_chunk).and_then(split);
        self.in_chunk = next.is_some();
        let (opcode, body, _) = next?;
        let start = self.within.end + HEAD as usize;
        self.within = start..start + body.len();
        Some(opcode)
    }

    /// Takes the loaded record in, unless there is a reason not to trust it.
    fn accept(&mut self, loaded: Loaded) -> IoResult<std::result::Result<u8, Fault>> {
        let opcode = loaded.opcode;
        // No writer mixes messages inside and outside of chunks, and one flipped bit can turn
        // another record into a message.
        if opcode == op::MESSAGE && self.has_chunks {
            let reason = "a message is outside of the chunks";
            return Ok(Err(Fault::beside(loaded.end, reason)));
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
                return Ok(Err(Fault::beside(loaded.end, reason)));
            }
            // The search has loaded others.
            let _ = self.file.load(self.at)?;
        }
        if self.file.is_proven(&loaded)? {
            self.sure = loaded.end;
        }
        self.at = loaded.end;
        self.attached = loaded.bytes;
        let before = self.crc.clone();
        self.crc.iter_mut().for_each(|crc| crc.combine(&loaded.crc));
        match opcode {
            op::CHUNK => {
                (self.in_chunk, self.within, self.has_chunks) = (true, 0..0, true);
                self.unchecked[0] |= !loaded.is_checked;
            }
            op::MESSAGE => self.unchecked[0] = true,
            // MCAP requires it first; it is accepted anywhere, as its position does not matter.
            op::HEADER => self.has_header = true,
            op::DATA_END => {
                let saved = u32_at(&self.file.body, 0).unwrap_or(0);
                let is_checked = self.check_crc("data section", before, saved);
                let [section, earlier] = self.unchecked;
                self.unchecked = [false, earlier || section && !is_checked];
                self.crc = Some(Hasher::new());
            }
            op::FOOTER => return self.finish(before),
            _ => {}
        }
        Ok(Ok(opcode))
    }

    /// Ends a file at its footer. `section`: CRC of the summary section before it.
    fn finish(&mut self, section: Option<Hasher>) -> IoResult<std::result::Result<u8, Fault>> {
        // The CRC covers the footer up to the CRC itself.
        let (known, saved) = self.file.body.split_at(16);
        let head = [&[op::FOOTER][..], &20_u64.to_le_bytes(), known].concat();
        let saved = u32_at(saved, 0).unwrap_or(0);
        let section = section.map(|mut section| {
            section.update(&head);
            section
        });
        self.check_crc("summary section", section, saved);
        if !self.has_header && !self.has_losses() {
            self.missing("it has no header");
        }
        self.start = self.at;
        if !self.file.is_magic(self.at)? {
            return Ok(Err(Fault::cut("it does not end as an MCAP file does")));
        }
        self.at += mcap::MAGIC.len() as u64;
        (self.finished, self.sure) = (true, self.at);
        Ok(Ok(op::FOOTER))
    }

    /// Checks the CRC of a section; returns true if it has one, which matches.
    fn check_crc(&mut self, section: &str, crc: Option<Hasher>, saved: u32) -> bool {
        let Some(calculated) = crc.map(Hasher::finalize) else {
            return false;
        };
        // Damage found before explains a CRC that does not match.
        if saved != 0 && saved != calculated && !self.has_losses() {
            self.missing(&format!(
                "the CRC of its {section} is {calculated:08x}, {saved:08x} expected"
            ));
        }
        saved == calculated && saved != 0
    }

    /// Continues in the appended file that begins here, see [`ANOTHER`].
    pub(super) fn begin_another(&mut self) {
        // Both files are read; the note is that there are two.
        let reason = ["it is truncated, and another", "another"][usize::from(self.finished)];
        self.note(
            self.start..self.start,
            &format!("{reason} MCAP file follows"),
        );
        self.is_broken = true;
        self.before = self.losses.len();
        self.at = self.start + mcap::MAGIC.len() as u64;
        self.sure = self.at;
        (self.has_header, self.has_chunks, self.finished) = (false, false, false);
        self.unchecked = [false, !self.is_checked()];
        let mut crc = Hasher::new();
        crc.update(mcap::MAGIC);
        self.crc = Some(crc);
    }

    /// Skips the current record and notes the reason.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(super) fn lose(&mut self, reason: &str) -> Result<()> {
        if self.in_chunk {
            self.note(self.start..self.at, reason);
            (self.is_broken, self.skipped) = (true, true);
            return Ok(());
        }
        self.pass_over(Fault::new(self.at, reason))
            .map_err(|e| self.io(e))
    }

    /// Notes that something is missing.
    pub(super) fn missing(&mut self, reason: &str) {
        self.is_broken = true;
        self.note(self.at..self.at, reason);
    }

    /// Skips the record at `start`: up to its end, or to a proven record before that.
    fn pass_over(&mut self, fault: Fault) -> IoResult<()> {
        let end = fault.end.unwrap_or(self.file.len());
        // Not at `sure` itself, where the corrupt record begins. Nor at the skipped record, which
        // its known part may prove.
        let from = self.sure + 1;
        let found = match self.file.find(from..self.start)? {
            Some(found) => found,
            None => {
                let after = from.max(self.start + 1);
                self.file.find(after..end)?.unwrap_or(end)
            }
        };
        // Bytes read before and again after the search count, or two corrupt lengths could loop.
        let read = fault.end.unwrap_or(self.start);
        self.file.spend(read.saturating_sub(found));
        // The length that led here may itself be corrupt, and point too far.
        let start = if found < self.start {
            self.sure
        } else {
            self.start
        };
        self.note(start..found, &fault.reason);
        self.is_broken |= !fault.is_beside;
        self.skipped |= fault.end.is_some() || found < self.file.len();
        self.finished = found == self.file.len();
        (self.at, self.sure) = (found, found);
        Ok(())
    }

    fn note(&mut self, part: Range<u64>, reason: &str) {
        let loss = DamagedPart {
            at_byte: part.start,
            bytes: part.end - part.start,
            reason: reason.to_owned(),
        };
        match self.losses[self.before..].last_mut() {
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
    pub(super) fn record_at(&mut self, start: u64) -> Result<Option<Record<'_>>> {
        if self.opcode_at(start)?.is_none() {
            return Ok(None);
        }
        self.in_chunk = false;
        match self.file.load(start).map_err(|e| self.io(e))? {
            Ok(loaded) => Ok(self.parse(loaded.opcode).ok()),
            Err(_) => Ok(None),
        }
    }

    /// Gives the data of the attachment at `start` piece by piece; false if it cannot be read.
    ///
    /// # Errors
    /// [`Error::Io`]; those of `take`.
    pub(super) fn attachment(
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
        let read = self.file.read_pieces(data, loaded.bytes, |piece| {
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
    pub(super) fn opcode_at(&mut self, start: u64) -> Result<Option<u8>> {
        let head = self.file.head(start).map_err(|e| self.io(e))?;
        Ok(head.map(|(opcode, _)| opcode))
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
