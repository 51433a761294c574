//! Writes the results of a session in a block, table by table, and seals them.

use super::{BlockPictures, DriveFacts};
use crate::csv_rows::csv_error;
use crate::drives::{DriveRow, TrackRow};
use crate::prior::TruthRow;
use crate::rows::{CellRow, FailureRow, FrameRow, Record, Row};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use svl_core::{Error, Result};
use svl_score::manifest::hash_bytes;
use xxhash_rust::xxh3::Xxh3Default;

/// The results that the tables of a block hold: written last, and renamed into place.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Seal {
    pub session: String,
    /// The block in its run; 0 for a drive.
    pub block: u64,
    /// The pairs that were matched, in their order; none of a drive.
    pub pairs: Vec<SealedPair>,
    pub algorithms: Vec<SealedAlgorithm>,
    /// The files of the tables and of the pictures.
    pub files: BTreeMap<String, SealedFile>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drive: Option<DriveFacts>,
}

/// A pair of a block.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SealedPair {
    /// Place in the run, from 0.
    pub place: u64,
    pub sequence: u64,
    pub input_hash: String,
    /// True if it has a calibration.
    pub has_rig: bool,
}

/// An algorithm of a block.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SealedAlgorithm {
    pub label: String,
    pub identity: String,
    /// True if the pictures are also of its results.
    pub has_pictures: bool,
    /// Places of pairs without a result of it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub without: Vec<u64>,
}

/// The beginning of a file that is sealed.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SealedFile {
    pub bytes: u64,
    pub hash: String,
}

/// The tables of a block, by their names.
pub(super) const ROWS: &str = "rows";
pub(super) const CELLS: &str = "cells";
pub(super) const FAILURES: &str = "failures";
pub(super) const FRAMES: &str = "frames";
pub(super) const DRIVES: &str = "drives";
pub(super) const TRACKS: &str = "tracks";
pub(super) const TRUTHS: &str = "truths";
pub(super) const PICTURES: &str = "pictures";

/// Writes the tables of a block.
pub struct BlockWriter {
    folder: PathBuf,
    name: String,
    seal: Seal,
    pub rows: UnitTable<Row>,
    pub cells: UnitTable<CellRow>,
    pub failures: UnitTable<FailureRow>,
    pub frames: UnitTable<FrameRow>,
    pub drives: UnitTable<DriveRow>,
    pub tracks: UnitTable<TrackRow>,
    /// The truth of each pair's cells, once for all algorithms.
    pub truths: UnitTable<TruthRow>,
}

impl BlockWriter {
    /// Files `folder/NAME.*`, of these algorithms with their identities.
    pub fn new(folder: &Path, name: String, session: &str, block: u64) -> Self {
        Self {
            rows: UnitTable::new(folder, &name, ROWS),
            cells: UnitTable::new(folder, &name, CELLS),
            failures: UnitTable::new(folder, &name, FAILURES),
            frames: UnitTable::new(folder, &name, FRAMES),
            drives: UnitTable::new(folder, &name, DRIVES),
            tracks: UnitTable::new(folder, &name, TRACKS),
            truths: UnitTable::new(folder, &name, TRUTHS),
            folder: folder.to_owned(),
            name,
            seal: Seal {
                session: session.to_owned(),
                block,
                ..Seal::default()
            },
        }
    }

    /// The block in its run.
    pub fn block(&self) -> u64 {
        self.seal.block
    }

    /// Adds a pair, which these algorithms have a result of; each of them is one of the block's
    /// from then on, with its identity.
    pub fn add_pair<'a>(
        &mut self,
        pair: SealedPair,
        algorithms: impl Iterator<Item = (&'a str, &'a str, bool)>,
    ) {
        let (place, before) = (pair.place, self.seal.pairs.iter().map(|pair| pair.place));
        let before: Vec<_> = before.collect();
        let mut here = Vec::new();
        for (label, identity, has_pictures) in algorithms {
            here.push(label);
            if self.seal.algorithms.iter().all(|own| own.label != label) {
                self.seal.algorithms.push(SealedAlgorithm {
                    label: label.to_owned(),
                    identity: identity.to_owned(),
                    has_pictures,
                    without: before.clone(),
                });
            }
        }
        for own in &mut self.seal.algorithms {
            if !here.contains(&own.label.as_str()) {
                own.without.push(place);
            }
        }
        self.seal.pairs.push(pair);
    }

    /// The drive of an algorithm, whole.
    pub fn set_drive(&mut self, label: &str, identity: &str, facts: DriveFacts) {
        self.seal.algorithms.push(SealedAlgorithm {
            label: label.to_owned(),
            identity: identity.to_owned(),
            has_pictures: true,
            without: Vec::new(),
        });
        self.seal.drive = Some(facts);
    }

    /// Seals all that was written so far, with new pictures in place of those of the last seal, if
    /// there are some. `are_all`: false if they are not of all pairs.
    ///
    /// # Errors
    /// [`Error::Io`] with the file.
    pub fn seal(&mut self, pictures: Option<&BlockPictures>, are_all: bool) -> Result<()> {
        let mut files = BTreeMap::new();
        self.rows.seal(&mut files)?;
        self.cells.seal(&mut files)?;
        self.failures.seal(&mut files)?;
        self.frames.seal(&mut files)?;
        self.drives.seal(&mut files)?;
        self.tracks.seal(&mut files)?;
        self.truths.seal(&mut files)?;
        let before = std::mem::take(&mut self.seal.files);
        if let Some(pictures) = pictures {
            let text = json(pictures)?;
            let hash = hash_bytes(&text);
            // Of another name than that of the last seal, which stays readable.
            let name = format!("{}.{PICTURES}-{}.json", self.name, &hash[..8]);
            if !before.contains_key(&name) {
                write_whole(&self.folder.join(&name), &text)?;
            }
            let bytes = text.len() as u64;
            files.insert(name, SealedFile { bytes, hash });
        } else {
            let is_picture = |name: &str| name.ends_with(".json");
            let own = before.iter().filter(|(name, _)| is_picture(name));
            files.extend(own.map(|(name, file)| (name.clone(), file.clone())));
        }
        self.seal.files = files;
        let mut seal = self.seal.clone();
        for own in &mut seal.algorithms {
            own.has_pictures &= are_all;
        }
        let path = self.folder.join(format!("{}.json", self.name));
        write_whole(&path, &json(&seal)?)?;
        for name in before.keys() {
            if !self.seal.files.contains_key(name) {
                // It is not read any more.
                let _ = std::fs::remove_file(self.folder.join(name));
            }
        }
        Ok(())
    }
}

/// Writes a file under another name, and renames it.
///
/// # Errors
/// [`Error::Io`] with the file.
pub(super) fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    // Another process may write the same file.
    let begun = path.with_extension(format!("{}.part", std::process::id()));
    let written = std::fs::write(&begun, bytes).and_then(|()| std::fs::rename(&begun, path));
    written.map_err(|e| Error::io(path, e))
}

/// The JSON of a value.
pub(super) fn json(value: &impl Serialize) -> Result<Vec<u8>> {
    serde_json::to_vec(value).map_err(|e| Error::Invalid(format!("units: {e}")))
}

/// A table of a block, which is made with its first row.
pub struct UnitTable<R> {
    path: PathBuf,
    file: String,
    writer: Option<csv::Writer<HashedFile>>,
    row: std::marker::PhantomData<R>,
}

impl<R: Record> UnitTable<R> {
    fn new(folder: &Path, name: &str, table: &str) -> Self {
        let file = format!("{name}.{table}.csv");
        Self {
            path: folder.join(&file),
            file,
            writer: None,
            row: std::marker::PhantomData,
        }
    }

    /// Takes rows.
    ///
    /// # Errors
    /// [`Error::Io`] with the file.
    pub fn push(&mut self, rows: impl IntoIterator<Item = R>) -> Result<()> {
        for row in rows {
            let writer = match &mut self.writer {
                Some(writer) => writer,
                None => self.writer.insert(begin::<R>(&self.path)?),
            };
            let written = writer.serialize(row.values());
            written.map_err(|e| csv_error(&self.path, e))?;
        }
        Ok(())
    }

    fn seal(&mut self, files: &mut BTreeMap<String, SealedFile>) -> Result<()> {
        if let Some(writer) = &mut self.writer {
            writer.flush().map_err(|e| Error::io(&self.path, e))?;
            files.insert(self.file.clone(), writer.get_ref().sealed());
        }
        Ok(())
    }
}

fn begin<R: Record>(path: &Path) -> Result<csv::Writer<HashedFile>> {
    let file = File::create(path).map_err(|e| Error::io(path, e))?;
    let mut writer = csv::WriterBuilder::new()
        .has_headers(false)
        .from_writer(HashedFile {
            file: BufWriter::new(file),
            hasher: Xxh3Default::new(),
            bytes: 0,
        });
    let head = R::columns();
    let written = writer.write_record(head.iter().map(|column| column.name));
    written.map_err(|e| csv_error(path, e))?;
    Ok(writer)
}

/// A file with the hash of what was written into it.
struct HashedFile {
    file: BufWriter<File>,
    hasher: Xxh3Default,
    bytes: u64,
}

impl HashedFile {
    fn sealed(&self) -> SealedFile {
        SealedFile {
            bytes: self.bytes,
            hash: format!("{:032x}", self.hasher.digest128()),
        }
    }
}

impl Write for HashedFile {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let written = self.file.write(bytes)?;
        self.hasher.update(&bytes[..written]);
        self.bytes += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.file.flush()
    }
}
