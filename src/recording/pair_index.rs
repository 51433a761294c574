//! Positions of the pairs in a recording by svl, from MCAP's index of chunks and messages.

use super::file::McapFile;
use super::index::Summary;
use super::messages::{Declared, Messages};
use super::records::Records;
use super::topic;
use mcap::records::Record;
use svl_core::Result;

/// The pairs of a file in order.
pub(super) struct PairIndex {
    declared: Declared,
    pairs: Vec<PairPlace>,
}

/// Position of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PairPlace {
    pub(super) stamp_ns: u64,
    /// Start of the first chunk with its messages.
    chunk: u64,
}

impl PairIndex {
    /// `None` if the file has no intact index of all its pairs, or if pairs share a stamp.
    ///
    /// # Errors
    /// [`svl_core::Error::Io`].
    pub(super) fn read(file: &McapFile) -> Result<Option<Self>> {
        let Some(contents) = Summary::read(file)? else {
            return Ok(None);
        };
        let channels = contents.declared.ids(topic::SYNC);
        let mut records = Records::open(file, true)?;
        let mut pairs = Vec::new();
        let mut before = None;
        for chunk in &contents.chunks {
            let start = chunk.chunk_start_offset;
            // The images may be in the chunk before the one that ends the pair.
            let from = before.replace(start).unwrap_or(start);
            for id in &channels {
                let Some(&offset) = chunk.message_index_offsets.get(id) else {
                    continue;
                };
                let Some(Record::MessageIndex(index)) = records.record_at(offset)? else {
                    return Ok(None);
                };
                pairs.extend(index.records.iter().map(|message| PairPlace {
                    stamp_ns: message.log_time,
                    chunk: from,
                }));
            }
        }
        let is_whole = contents.declared.count(topic::SYNC) == Some(pairs.len() as u64)
            // A stamp shared by several pairs does not identify one.
            && pairs.is_sorted_by(|a, b| a.stamp_ns < b.stamp_ns);
        let declared = contents.declared;
        Ok(is_whole.then_some(Self { declared, pairs }))
    }

    pub(super) fn get(&self, index: u64) -> Option<PairPlace> {
        self.pairs.get(usize::try_from(index).ok()?).copied()
    }

    /// The messages of the file, starting before a pair.
    ///
    /// # Errors
    /// The errors of [`Messages::open`].
    pub(super) fn messages(&self, file: &McapFile, place: PairPlace) -> Result<Messages> {
        Messages::from(file, place.chunk, self.declared.clone())
    }
}
