//! The result of an algorithm for one pair: as a hash, and as all that a recording has of it.

use super::cells::{self, AlgorithmCells};
use crate::bags::opened::Recording;
use crate::decode::encoding::floats;
use crate::message::MessageError;
use crate::message::wire::Encoded;
use crate::pairs::truth;
use crate::stream::channel::{EventReader, FileEvent};
use serde::de::DeserializeOwned;
use svl_core::stereo::{Estimate, Frame, Plane, hash_words};
use svl_core::{Error, Result};

const SCHEMA: &str = "svl.Result";
const DEFINITION: &str = include_str!("result.schema.json");

/// The message of `/algo/<name>/result`: the hash of a result, with which a replay verifies its
/// own.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct AlgorithmResult {
    /// Number of the pair in its source, from 0.
    pub sequence: u64,
    /// The algorithm as the user wrote it.
    pub algorithm: String,
    /// [`svl_core::stereo::DisparityMap::hash`], hexadecimal.
    pub hash: String,
    /// [`svl_core::stereo::StereoPair::hash`] of its pair, hexadecimal.
    pub pair_hash: String,
    /// Fraction of the pixels with a disparity.
    pub coverage: f64,
    /// [`svl_core::stereo::DisparityMap::median_row_offset`]: number of rows by which the right
    /// image is lower; `None` for algorithms that do not measure it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub row_offset_px: Option<i8>,
    /// The greatest disparity searched, pixels, if the algorithm says so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub range_px: Option<f64>,
}

impl AlgorithmResult {
    pub(crate) fn new(frame: &Frame, estimate: &Estimate, [pair, result]: [u128; 2]) -> Self {
        Self {
            sequence: frame.sequence,
            algorithm: estimate.algorithm.clone(),
            hash: hash_words(result),
            pair_hash: hash_words(pair),
            coverage: estimate.disparity.coverage(),
            row_offset_px: estimate.disparity.median_row_offset(),
            range_px: estimate.range_px,
        }
    }

    /// The result in a message; `None` for messages of other kinds.
    pub(crate) fn decode(schema: &str, data: &[u8]) -> Option<serde_json::Result<Self>> {
        // By schema, not by topic: names of algorithms are part of the topic.
        (schema == SCHEMA).then(|| serde_json::from_slice(data))
    }

    pub(crate) fn encode(&self) -> Encoded {
        Encoded::json(SCHEMA, DEFINITION, self)
    }
}

impl Recording {
    /// The results in the recording, in order; empty if no replay wrote it.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] for a file that is not MCAP, a bag of several files, or an
    /// unreadable result; [`Error::Damaged`].
    pub fn results(&self) -> Result<Vec<AlgorithmResult>> {
        self.json_messages(SCHEMA)
    }

    /// Reads the results in the order of the recording, pair by pair.
    ///
    /// # Errors
    /// The errors of [`Recording::results`].
    pub fn stored_results(&self) -> Result<StoredResults> {
        Ok(StoredResults {
            events: self.only_file()?.messages()?,
            next: None,
            disparity: None,
            cells: None,
        })
    }

    /// The messages with a JSON schema.
    pub(crate) fn json_messages<T: DeserializeOwned>(&self, schema: &str) -> Result<Vec<T>> {
        let file = self.only_file()?;
        let mut messages = file.messages()?;
        let mut found = Vec::new();
        while let Some(event) = messages.next()? {
            if let FileEvent::Message(channel, log_time, data) = event
                // By schema, not by topic: names of algorithms are part of the topic.
                && channel.schema == schema
            {
                let topic = &channel.topic;
                let bad = |e| Error::format(file.path(), format!("{topic} at {log_time} ns: {e}"));
                found.push(serde_json::from_slice(&data).map_err(bad)?);
            }
        }
        Ok(found)
    }
}

/// The result of an algorithm for one pair, as a recording has it.
#[derive(Clone, Debug)]
pub struct PairResult {
    /// `+∞` in invalid pixels.
    pub disparity: Plane<f32>,
    pub cells: AlgorithmCells,
    pub result: AlgorithmResult,
}

impl PairResult {
    /// `hashes`: those of the pair and of the estimate.
    pub fn new(frame: &Frame, estimate: &Estimate, hashes: [u128; 2]) -> Self {
        Self {
            disparity: estimate.disparity.disparity().clone(),
            cells: AlgorithmCells::new(frame.sequence, estimate),
            result: AlgorithmResult::new(frame, estimate, hashes),
        }
    }
}

/// Reads the results of a recording, pair by pair.
pub struct StoredResults {
    events: Box<dyn EventReader>,
    /// The first result of a later pair.
    next: Option<PairResult>,
    /// The first messages of a result, which ends with its hash.
    disparity: Option<Plane<f32>>,
    cells: Option<AlgorithmCells>,
}

impl StoredResults {
    /// The results of pair `sequence`, which is after the pair of the last call.
    ///
    /// # Errors
    /// The reason why a result cannot be read; those of the file.
    pub fn pair_results(&mut self, sequence: u64) -> Result<Vec<PairResult>> {
        let mut found = Vec::new();
        loop {
            let next = match self.next.take() {
                Some(next) => Some(next),
                None => self.read()?,
            };
            match next {
                None => return Ok(found),
                Some(next) if next.result.sequence > sequence => {
                    self.next = Some(next);
                    return Ok(found);
                }
                Some(next) if next.result.sequence == sequence => found.push(next),
                Some(_) => {}
            }
        }
    }

    /// The next result; one of several without its disparities or cells is passed over.
    fn read(&mut self) -> Result<Option<PairResult>> {
        loop {
            let (channel, log_time, data) = match self.events.next() {
                Ok(Some(FileEvent::Message(channel, log_time, data))) => (channel, log_time, data),
                Ok(Some(_)) => continue,
                // Damage is reported with the pairs.
                Ok(None) | Err(Error::Damaged { .. }) => return Ok(None),
                Err(error) => return Err(error),
            };
            let topic = &channel.topic;
            let bad = |e: MessageError| Error::Invalid(format!("{topic} at {log_time} ns: {e}"));
            if let Some(result) = AlgorithmResult::decode(&channel.schema, &data) {
                let result = result.map_err(|e| bad(e.into()))?;
                if let (Some(disparity), Some(cells)) = (self.disparity.take(), self.cells.take()) {
                    return Ok(Some(PairResult {
                        disparity,
                        cells,
                        result,
                    }));
                }
            } else if channel.schema == cells::SCHEMA {
                self.cells = Some(AlgorithmCells::decode(&data).map_err(bad)?);
            } else if channel.schema == "sensor_msgs/msg/Image" && topic.starts_with("/algo/") {
                let floats = floats(channel, &data).map_err(bad)?;
                self.disparity = Some(truth::from_file(&floats));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn absent_numbers_are_not_written() {
        let written =
            r#"{"sequence":3,"algorithm":"v4","hash":"1f","pair_hash":"2a","coverage":0.5}"#;
        let result = AlgorithmResult::decode(SCHEMA, written.as_bytes());
        let result = result.unwrap().unwrap();
        assert_eq!((result.row_offset_px, result.range_px), (None, None));
        assert_eq!(result.encode().data, written.as_bytes());
    }
}
