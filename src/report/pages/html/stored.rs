//! Figures in JSON: images in base64, rows as lines of CSV.

use crate::rows::csv_rows::{rows_from_text, rows_to_text};
use crate::rows::records::Record;
use base64::{Engine as _, engine::general_purpose::STANDARD};
use serde::de::Error as _;
use serde::ser::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::value::RawValue;

/// JSON's text of an image, which is not searched for characters to escape again.
fn quoted(image: &[u8]) -> serde_json::Result<Box<RawValue>> {
    RawValue::from_string(format!("\"{}\"", STANDARD.encode(image)))
}

/// An image file.
pub(crate) mod image {
    use super::*;

    pub fn serialize<S: Serializer>(image: &[u8], serializer: S) -> Result<S::Ok, S::Error> {
        quoted(image)
            .map_err(S::Error::custom)?
            .serialize(serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<u8>, D::Error> {
        let text = String::deserialize(deserializer)?;
        STANDARD.decode(text).map_err(D::Error::custom)
    }
}

/// An image file, or none.
pub(crate) mod optional_image {
    use super::*;

    pub fn serialize<S: Serializer>(
        image: &Option<Vec<u8>>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        let text = image.as_deref().map(quoted).transpose();
        text.map_err(S::Error::custom)?.serialize(serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Option<Vec<u8>>, D::Error> {
        let text = Option::<String>::deserialize(deserializer)?;
        let image = text.map(|text| STANDARD.decode(text).map_err(D::Error::custom));
        image.transpose()
    }
}

/// Rows.
pub(crate) mod rows {
    use super::*;

    pub fn serialize<R: Record, S: Serializer>(
        rows: &[R],
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        let text = rows_to_text(rows).map_err(S::Error::custom)?;
        text.serialize(serializer)
    }

    pub fn deserialize<'de, R: Record, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Vec<R>, D::Error> {
        let text = String::deserialize(deserializer)?;
        rows_from_text(&text).map_err(D::Error::custom)
    }
}

/// One row.
pub(crate) mod row {
    use super::*;

    pub fn serialize<R: Record, S: Serializer>(row: &R, serializer: S) -> Result<S::Ok, S::Error> {
        rows::serialize(std::slice::from_ref(row), serializer)
    }

    pub fn deserialize<'de, R: Record, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<R, D::Error> {
        let row = rows::deserialize(deserializer)?.pop();
        row.ok_or_else(|| D::Error::custom("a figure without its row"))
    }
}
