//! What a recording says of itself.

use super::CALIBRATION;
use super::bag::files;
use super::messages::{Event, Messages};
use crate::error::{Error, Result};
use mcap::records::Metadata;
use std::path::Path;

/// Name of the metadata record.
const RECORD: &str = "svl";

/// The metadata record `svl`: who wrote the recording, and of what.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Header {
    /// Version of svl that wrote it.
    pub version: String,
    /// Git revision of that svl, where its build knew it (`SVL_GIT_REVISION`).
    pub git_revision: Option<String>,
    /// Where the frames came from, e.g. `arena` or a folder.
    pub source: String,
    /// Name of the scenario.
    pub scenario: Option<String>,
    pub seed: Option<u64>,
    /// What the pairs were rectified by, where svl did it: the name of a file, which is attached,
    /// or in words.
    pub calibration: Option<String>,
    /// Hash of what determines the frames: recordings of equal hashes are of one run, whole or a
    /// part of it.
    pub hash: Option<String>,
}

impl Header {
    /// A header of this svl for frames from `source`.
    pub fn new(source: impl Into<String>) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            git_revision: option_env!("SVL_GIT_REVISION").map(str::to_owned),
            source: source.into(),
            scenario: None,
            seed: None,
            calibration: None,
            hash: None,
        }
    }

    pub(super) fn to_record(&self) -> Metadata {
        let fields = [
            ("version", Some(self.version.clone())),
            ("git_revision", self.git_revision.clone()),
            ("source", Some(self.source.clone())),
            ("scenario", self.scenario.clone()),
            ("seed", self.seed.map(|seed| seed.to_string())),
            ("calibration", self.calibration.clone()),
            ("hash", self.hash.clone()),
        ];
        let metadata = fields
            .into_iter()
            .filter_map(|(key, value)| Some((key.to_owned(), value?)))
            .collect();
        Metadata {
            name: RECORD.to_owned(),
            metadata,
        }
    }

    /// The header in a metadata record, if it is svl's.
    pub(super) fn from_record(Metadata { name, metadata }: &Metadata) -> Option<Self> {
        let field = |key: &str| metadata.get(key).cloned();
        (name == RECORD).then(|| Self {
            version: field("version").unwrap_or_default(),
            git_revision: field("git_revision"),
            source: field("source").unwrap_or_default(),
            scenario: field("scenario"),
            seed: field("seed").and_then(|seed| seed.parse().ok()),
            calibration: field("calibration"),
            hash: field("hash"),
        })
    }
}

/// The header of the recording at `path`, which stands before its first pair.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] for a file that is not a recording of svl; [`Error::Damaged`].
pub fn header(path: &Path) -> Result<Header> {
    let mut messages = Messages::open(path)?;
    while let Some(event) = messages.next()? {
        if let Event::Metadata(metadata) = event
            && let Some(header) = Header::from_record(&metadata)
        {
            return Ok(header);
        }
    }
    Err(Error::format(
        path,
        format!("is not a recording of svl: it has no metadata record '{RECORD}'"),
    ))
}

/// The files of the calibration by which the pairs of the recording at `path` were rectified, or
/// can be: names and contents.
///
/// # Errors
/// [`Error::Io`], [`Error::Format`], [`Error::Damaged`].
pub fn calibration_files(path: &Path) -> Result<Vec<(String, Vec<u8>)>> {
    let mut found = Vec::new();
    for file in files(path)? {
        let mut messages = Messages::beside(&file)?;
        while let Some(event) = messages.next()? {
            if let Event::Attachment { name, data } = event
                && let Some(name) = name.strip_prefix(CALIBRATION)
            {
                found.push((name.to_owned(), data.to_vec()));
            }
        }
    }
    Ok(found)
}

/// The attachment `name` of the recording at `path`, if there is one.
///
/// # Errors
/// [`Error::Io`], [`Error::Format`], [`Error::Damaged`].
pub fn attachment(path: &Path, name: &str) -> Result<Option<Vec<u8>>> {
    for file in files(path)? {
        let mut messages = Messages::beside(&file)?;
        while let Some(event) = messages.next()? {
            if let Event::Attachment { name: found, data } = event
                && found == name
            {
                return Ok(Some(data.to_vec()));
            }
        }
    }
    Ok(None)
}
