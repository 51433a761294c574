//! The result of an algorithm for one pair, as a hash.

use super::Encoded;
use super::Recording;
use super::messages::{FileEvent, Messages};
use crate::error::{Error, Result};
use crate::stereo::{Estimate, Frame};
use std::borrow::Cow;

const SCHEMA: &str = "svl.Result";
const DEFINITION: &str = include_str!("result.schema.json");

/// The message of `/algo/<name>/result`: the hash of a result, by which a replay proves that its
/// own is equal.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct AlgorithmResult {
    /// Number of the pair in its source, from 0.
    pub sequence: u64,
    /// The algorithm as the user wrote it.
    pub algorithm: String,
    /// [`crate::stereo::DisparityMap::hash`], hexadecimal.
    pub hash: String,
    /// [`crate::stereo::StereoPair::hash`] of its pair, hexadecimal.
    pub pair_hash: String,
    /// Share of the pixels with a disparity.
    pub coverage: f64,
}

impl AlgorithmResult {
    pub(super) fn new(frame: &Frame, estimate: &Estimate, [pair, result]: [u128; 2]) -> Self {
        Self {
            sequence: frame.sequence,
            algorithm: estimate.algorithm.clone(),
            hash: format!("{:032x}", result),
            pair_hash: format!("{:032x}", pair),
            coverage: estimate.disparity.coverage(),
        }
    }

    pub(super) fn encode(&self) -> Encoded {
        let definition = Cow::Borrowed(DEFINITION.as_bytes());
        // Finite numbers and strings under fixed keys always serialise.
        let data = serde_json::to_vec(self).expect("plain data");
        Encoded {
            schema: SCHEMA,
            schema_encoding: "jsonschema",
            definition,
            encoding: "json",
            data,
        }
    }
}

impl Recording {
    /// The results in the recording, in its order; none in a recording that no replay wrote.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] for what is no MCAP file, a bag of several files, or a
    /// result that cannot be read; [`Error::Damaged`].
    pub fn results(&self) -> Result<Vec<AlgorithmResult>> {
        let file = self.only_file()?;
        let mut messages = Messages::open(file)?;
        let mut results = Vec::new();
        while let Some(event) = messages.next()? {
            if let FileEvent::Message {
                channel,
                log_time,
                data,
            } = event
                // By schema, not by topic: names of algorithms are part of the topic.
                && channel.schema == SCHEMA
            {
                let topic = &channel.topic;
                let bad = |e| Error::format(file.path(), format!("{topic} at {log_time} ns: {e}"));
                results.push(serde_json::from_slice(&data).map_err(bad)?);
            }
        }
        Ok(results)
    }
}
