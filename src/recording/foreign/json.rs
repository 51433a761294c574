//! Foxglove messages in JSON: the fields of the protobuf messages, with bytes in base64.

use base64::Engine as _;
use serde::{Deserialize, Deserializer, de};

#[derive(Clone, Copy, Default, Deserialize)]
pub(super) struct JsonTime {
    pub(super) sec: u32,
    pub(super) nsec: u32,
}

/// Leading fields of all messages with a frame.
#[derive(Deserialize)]
pub(super) struct JsonHead {
    #[serde(default)]
    pub(super) timestamp: JsonTime,
    #[serde(default)]
    pub(super) frame_id: String,
}

#[derive(Deserialize)]
pub(super) struct JsonRawImage {
    #[serde(default)]
    pub(super) timestamp: JsonTime,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) encoding: String,
    pub(super) step: u32,
    #[serde(deserialize_with = "bytes")]
    pub(super) data: Vec<u8>,
}

#[derive(Deserialize)]
pub(super) struct JsonCompressedImage {
    #[serde(default)]
    pub(super) timestamp: JsonTime,
    #[serde(deserialize_with = "bytes")]
    pub(super) data: Vec<u8>,
    #[serde(default)]
    pub(super) format: String,
}

#[derive(Deserialize)]
pub(super) struct JsonCalibration {
    #[serde(default)]
    pub(super) width: u32,
    #[serde(default)]
    pub(super) height: u32,
    #[serde(default)]
    pub(super) distortion_model: String,
    #[serde(default, rename = "K")]
    pub(super) k: Vec<f64>,
    #[serde(default, rename = "D")]
    pub(super) d: Vec<f64>,
    #[serde(default, rename = "R")]
    pub(super) r: Vec<f64>,
    #[serde(default, rename = "P")]
    pub(super) p: Vec<f64>,
}

pub(super) fn read<'a, T: Deserialize<'a>>(data: &'a [u8]) -> Result<T, String> {
    serde_json::from_slice(data).map_err(|e| format!("its JSON cannot be read: {e}"))
}

fn bytes<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<u8>, D::Error> {
    let text = String::deserialize(deserializer)?;
    base64::engine::general_purpose::STANDARD
        .decode(text)
        .map_err(de::Error::custom)
}
