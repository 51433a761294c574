//! How damage is passed over, and noted.

use super::file::FileReader;
use super::layout::{body_size, has_fields, is_record};
use super::loss::Loss;
use super::search::Search;
use std::io;
use std::ops::Range;

/// What is known of a file's damage so far.
pub(super) struct Salvage {
    search: Search,
    losses: Vec<Loss>,
    /// Losses of the files that stand before the current one in the same.
    before: usize,
    /// Up to here nothing is hidden: the last record that vouched for itself ends here, or the last
    /// search did.
    sure: u64,
    /// What vouches for itself if another record follows ends here.
    hoped: u64,
}

impl Salvage {
    pub(super) fn new(file: FileReader, len: u64) -> io::Result<Self> {
        Ok(Self {
            search: Search::new(file, len)?,
            losses: Vec::new(),
            before: 0,
            sure: 0,
            hoped: 0,
        })
    }

    /// Where the records begin in a file of `len` bytes that does not begin as an MCAP file does;
    /// nothing in what is none.
    pub(super) fn begin(&mut self, len: u64) -> io::Result<Option<u64>> {
        // What has no record that vouches for itself is something else.
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

    /// What ends here has vouched for itself.
    pub(super) fn trust(&mut self, end: u64) {
        self.sure = end;
    }

    /// What ends here has vouched for itself if another record follows.
    pub(super) fn trust_if_followed(&mut self, end: u64) {
        self.hoped = end;
    }

    /// A record of this kind begins here, with a length that the file has.
    pub(super) fn follows(&mut self, at: u64, opcode: u8) {
        if self.hoped == at && is_record(opcode) {
            self.trust(at);
        }
    }

    /// Whether anything of the current file is lost.
    pub(super) fn has_losses(&self) -> bool {
        self.losses.len() > self.before
    }

    /// In the order of the file.
    pub(super) fn into_losses(mut self) -> Vec<Loss> {
        self.losses.sort_by_key(|loss| loss.at_byte);
        self.losses
    }

    pub(super) fn note(&mut self, part: Range<u64>, reason: &str) {
        let loss = Loss {
            at_byte: part.start,
            bytes: part.end - part.start,
            reason: reason.to_owned(),
        };
        match self.losses[self.before..].last_mut() {
            Some(last) if *last == loss => {}
            // One goes on where the other ends, or both are of the same chunk.
            Some(last)
                if last.bytes.min(loss.bytes) > 0
                    && (last.at_byte..=last.at_byte + last.bytes).contains(&loss.at_byte) =>
            {
                last.bytes = last.bytes.max(part.end - last.at_byte);
            }
            _ => self.losses.push(loss),
        }
    }

    /// Passes over the record of which `read` was read, and says where records go on: at `end`, or
    /// at what vouches for itself before that.
    pub(super) fn pass_over(
        &mut self,
        read: Range<u64>,
        end: u64,
        reason: &str,
    ) -> io::Result<u64> {
        let from = self.sure + 1;
        let found = self.search.next(from..end)?.unwrap_or(end);
        self.search.spend(read.end.saturating_sub(found));
        self.sure = found;
        // What led here may itself have led too far.
        let start = if found < read.start {
            from - 1
        } else {
            read.start
        };
        self.note(start..found, reason);
        Ok(found)
    }

    /// Trusts the record at `place` if it vouches for itself. Moves in the file.
    pub(super) fn try_trust(&mut self, place: Range<u64>) -> io::Result<()> {
        if self.search.vouches_at(place.start)? {
            self.trust(place.end);
        }
        Ok(())
    }
}

/// Why a record cannot be what was written there.
pub(super) fn examine(opcode: u8, body: &[u8]) -> Result<(), String> {
    // From 0x80 on they are other programs' own.
    if !is_record(opcode) && opcode < 0x80 {
        return Err(format!("a record is of the unknown kind {opcode:#04x}"));
    }
    if has_fields(opcode) && body_size(opcode, body) != Some(body.len() as u64) {
        return Err("the lengths of a record do not agree".to_owned());
    }
    Ok(())
}
