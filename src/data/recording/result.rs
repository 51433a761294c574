//! The result of an algorithm for one pair, as a hash.

use super::Encoded;
use super::Recording;
use super::messages::FileEvent;
use serde::de::DeserializeOwned;
use svl_core::stereo::{Estimate, Frame};
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
    /// image is lower; `None` for algorithms that do not measure it, and in recordings by earlier
    /// versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub row_offset_px: Option<i8>,
}

impl AlgorithmResult {
    pub(super) fn new(frame: &Frame, estimate: &Estimate, [pair, result]: [u128; 2]) -> Self {
        Self {
            sequence: frame.sequence,
            algorithm: estimate.algorithm.clone(),
            hash: format!("{:032x}", result),
            pair_hash: format!("{:032x}", pair),
            coverage: estimate.disparity.coverage(),
            row_offset_px: estimate.disparity.median_row_offset(),
        }
    }

    /// The result in a message; `None` for messages of other kinds.
    pub(super) fn decode(schema: &str, data: &[u8]) -> Option<serde_json::Result<Self>> {
        // By schema, not by topic: names of algorithms are part of the topic.
        (schema == SCHEMA).then(|| serde_json::from_slice(data))
    }

    pub(super) fn encode(&self) -> Encoded {
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

    /// The messages with a JSON schema.
    pub(super) fn json_messages<T: DeserializeOwned>(&self, schema: &str) -> Result<Vec<T>> {
        let file = self.only_file()?;
        let mut messages = file.messages()?;
        let mut found = Vec::new();
        while let Some(event) = messages.next().map_err(|error| self.located(error))? {
            if let FileEvent::Message {
                channel,
                log_time,
                data,
            } = event
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_of_earlier_svl_have_no_row_offset() {
        let old = r#"{"sequence":3,"algorithm":"v4","hash":"1f","pair_hash":"2a","coverage":0.5}"#;
        let result = AlgorithmResult::decode(SCHEMA, old.as_bytes());
        let result = result.unwrap().unwrap();
        assert_eq!(result.row_offset_px, None);
        assert_eq!(
            result.encode().data,
            old.as_bytes(),
            "nor are they written with null"
        );
    }
}
