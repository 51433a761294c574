//! Foxglove messages in JSON: the fields of the protobuf messages, with bytes in base64.

use crate::message::{MessageError, MessageResult};
use base64::Engine as _;
use serde::{Deserialize, Deserializer, de};

#[derive(Clone, Copy, Default, Deserialize)]
pub(crate) struct JsonTime {
    pub(crate) sec: u32,
    pub(crate) nsec: u32,
}

/// Leading fields of all messages with a frame.
#[derive(Deserialize)]
pub(crate) struct JsonHead {
    #[serde(default)]
    pub(crate) timestamp: JsonTime,
    #[serde(default)]
    pub(crate) frame_id: String,
}

#[derive(Deserialize)]
pub(crate) struct JsonRawImage {
    #[serde(default)]
    pub(crate) timestamp: JsonTime,
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) encoding: String,
    pub(crate) step: u32,
    #[serde(deserialize_with = "bytes")]
    pub(crate) data: Vec<u8>,
}

#[derive(Deserialize)]
pub(crate) struct JsonCompressedImage {
    #[serde(default)]
    pub(crate) timestamp: JsonTime,
    #[serde(deserialize_with = "bytes")]
    pub(crate) data: Vec<u8>,
    #[serde(default)]
    pub(crate) format: String,
}

#[derive(Deserialize)]
pub(crate) struct JsonCalibration {
    #[serde(default)]
    pub(crate) width: u32,
    #[serde(default)]
    pub(crate) height: u32,
    #[serde(default)]
    pub(crate) distortion_model: String,
    #[serde(default, rename = "K")]
    pub(crate) k: Vec<f64>,
    #[serde(default, rename = "D")]
    pub(crate) d: Vec<f64>,
    #[serde(default, rename = "R")]
    pub(crate) r: Vec<f64>,
    #[serde(default, rename = "P")]
    pub(crate) p: Vec<f64>,
}

pub(crate) fn read<'a, T: Deserialize<'a>>(data: &'a [u8]) -> MessageResult<T> {
    serde_json::from_slice(data).map_err(MessageError::Json)
}

fn bytes<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<u8>, D::Error> {
    let text = String::deserialize(deserializer)?;
    base64::engine::general_purpose::STANDARD
        .decode(text)
        .map_err(de::Error::custom)
}
