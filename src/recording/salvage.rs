//! Salvage: skips and records the damaged parts of a file.

use super::file::FileReader;
use super::layout::{HEAD, fields_size, has_fields, is_record, known_size};
use super::search::RecordSearch;
use std::io;
use std::ops::Range;

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

/// The damage of a file found so far.
pub(super) struct Salvage {
    search: RecordSearch,
    losses: Vec<DamagedPart>,
    /// Number of damaged parts in the files before the current one, if files are appended.
    before: usize,
    /// No record is missed before this position: the end of the last proven record, or of the last
    /// search.
    sure: u64,
    /// End of a record that is proven if another record follows.
    hoped: u64,
}

impl Salvage {
    pub(super) fn new(file: FileReader, len: u64) -> io::Result<Self> {
        Ok(Self {
            search: RecordSearch::new(file, len)?,
            losses: Vec::new(),
            before: 0,
            sure: 0,
            hoped: 0,
        })
    }

    /// Start of the records in a file of `len` bytes whose beginning is corrupt; `None` in a file
    /// that is not MCAP.
    pub(super) fn begin(&mut self, len: u64) -> io::Result<Option<u64>> {
        // A file without any proven record is not MCAP.
        let Some(found) = self.search.next(0..len)? else {
            return Ok(None);
        };
        let at = if self.search.is_header(8)? { 8 } else { found };
        self.note(0..at, "it does not begin as an MCAP file does");
        self.sure = at;
        Ok(Some(at))
    }

    /// Another file begins here.
    pub(super) fn begin_another(&mut self, at: u64) {
        (self.before, self.sure) = (self.losses.len(), at);
    }

    /// The record that ends here is proven.
    pub(super) fn trust(&mut self, end: u64) {
        self.sure = end;
    }

    /// The record that ends here is proven if another record follows.
    pub(super) fn trust_if_followed(&mut self, end: u64) {
        self.hoped = end;
    }

    /// A record of this kind begins here, with a length that fits the file.
    pub(super) fn follows(&mut self, at: u64, opcode: u8) {
        if self.hoped == at && is_record(opcode) {
            self.trust(at);
        }
    }

    /// True if anything of the current file is lost.
    pub(super) fn has_losses(&self) -> bool {
        self.losses.len() > self.before
    }

    /// The damaged parts, in file order.
    pub(super) fn into_losses(mut self) -> Vec<DamagedPart> {
        self.losses.sort_by_key(|loss| loss.at_byte);
        self.losses
    }

    pub(super) fn note(&mut self, part: Range<u64>, reason: &str) {
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

    /// Skips the record of which `read` was read, and returns where records resume: at `end`, or
    /// before it at a proven record.
    pub(super) fn pass_over(
        &mut self,
        read: Range<u64>,
        end: u64,
        reason: &str,
    ) -> io::Result<u64> {
        // Not at `sure` itself, where the corrupt record begins.
        let from = self.sure + 1;
        // Nor at the skipped record, which its known part may prove.
        let before = self.search.next(from..read.start)?;
        let found = match before {
            Some(found) => found,
            None => {
                let after = from.max(read.start + 1);
                self.search.next(after..end)?.unwrap_or(end)
            }
        };
        // Bytes read before and again after the search count, or two corrupt lengths could loop.
        self.search.spend(read.end.saturating_sub(found));
        self.sure = found;
        // The length that led here may itself be corrupt, and point too far.
        let start = if found < read.start {
            from - 1
        } else {
            read.start
        };
        self.note(start..found, reason);
        Ok(found)
    }

    /// True if the unknown part of the record at `place` contains other proven records: its length
    /// is corrupt. After damage any byte from 0x80 on looks like a private record, and the bytes
    /// after it like its length.
    pub(super) fn covers_others(
        &mut self,
        opcode: u8,
        body: &[u8],
        place: Range<u64>,
    ) -> io::Result<bool> {
        let unknown = match fields_size(opcode, body) {
            Some(size) => place.start + HEAD + size,
            None if opcode >= PRIVATE && self.has_losses() => place.start + 1,
            None => place.end,
        };
        Ok(unknown < place.end && self.search.next(unknown..place.end)?.is_some())
    }

    /// Trusts the record at `place` if it can be proven.
    pub(super) fn try_trust(&mut self, place: Range<u64>) -> io::Result<()> {
        if self.search.proves_at(place.start)? {
            self.trust(place.end);
        }
        Ok(())
    }
}

/// Opcodes from here on are private to other programs.
const PRIVATE: u8 = 0x80;

/// Reason why a record cannot be intact.
pub(super) fn examine(opcode: u8, body: &[u8]) -> Result<(), String> {
    if !is_record(opcode) && opcode < PRIVATE {
        return Err(format!("a record is of the unknown kind {opcode:#04x}"));
    }
    if has_fields(opcode) && known_size(opcode, body, body.len() as u64).is_none() {
        return Err("the lengths of a record do not agree".to_owned());
    }
    Ok(())
}
