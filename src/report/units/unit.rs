//! A unit: an algorithm over a block of pairs of a run, or a drive, as one file.
//!
//! The first line is the checksum of all that follows, the second the header, as JSON; then come
//! the tables, as CSV, and the pictures.

use super::facts::PairFacts;
use super::io::{json, open, write_whole};
use super::pictures::BlockPictures;
use crate::rows::csv_rows::{RowReader, csv_error, table_text};
use crate::rows::held::Row;
use crate::rows::records::{CellRow, FailureRow, FrameRow, Record};
use crate::subjects::drives::{CoursePlan, DriveRow, TrackRow};
use crate::subjects::pieces::SightRow;
use crate::subjects::references::TruthRow;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, Cursor, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use svl_core::stereo::TruthOrigin;
use svl_core::{Error, Result};
use svl_files::TableText;
use svl_score::manifest::{hash, hash_bytes, hash_reader};
use svl_score::pixel_errors::PixelErrors;
use svl_score::plausibility::AlgorithmScale;

/// What a unit has besides its tables.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct UnitHeader {
    /// Digest of its run, and its own name.
    pub run: String,
    pub name: String,
    pub label: String,
    /// The session that matched it.
    pub session: String,
    /// The block in its run; 0 for a drive.
    pub block: u64,
    /// True unless its algorithm was not among those with pictures.
    pub has_pictures: bool,
    /// The factor between a truth and the algorithm, if there are enough pixels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale: Option<(TruthOrigin, AlgorithmScale)>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drive: Option<DriveFacts>,
    /// The tables and the pictures that it has, with their lengths in bytes, once it is written.
    pub parts: Vec<(String, usize)>,
}

/// What a drive has besides its rows.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DriveFacts {
    pub course: CoursePlan,
}

/// Parts that are JSON: the pairs of the block, the pictures, the errors of distances of pixels.
const PAIRS: &str = "pairs";
const PICTURES: &str = "pictures";
const PIXEL_ERRORS: &str = "pixel_errors";

/// The form of the files; a change of [`BlockPictures`] or of a header changes it.
const FORM: &str = "units with checksums, pictures with truth, errors of pixels by size, pairs";

/// Most bytes of the checksum and of the header.
const MAX_LINE: u64 = 1 << 24;

/// Adds rows to the text of their table, which begins with the first.
fn push_rows<R: Record>(text: &mut Option<TableText>, rows: &[R]) -> csv::Result<()> {
    for row in rows {
        if text.is_none() {
            *text = Some(table_text::<R>()?);
        }
        text.iter_mut()
            .try_for_each(|text| text.push(&row.values()))?;
    }
    Ok(())
}

/// A row of a unit.
trait UnitRow: Record {
    /// The pair that it is of, unless it is of a drive.
    fn sequence(&self) -> Option<u64>;

    /// Sets what is the report's: the name of the scenario.
    fn set_scenario(&mut self, _: &str) {}
}

macro_rules! unit_row_field {
    (sequence) => {
        fn sequence(&self) -> Option<u64> {
            Some(self.sequence)
        }
    };
    (drive) => {
        fn sequence(&self) -> Option<u64> {
            None
        }
    };
    (scenario) => {
        fn set_scenario(&mut self, scenario: &str) {
            scenario.clone_into(&mut self.scenario);
        }
    };
}

/// Declares the tables of a unit: what each row has, besides its own columns, to be found by.
macro_rules! unit_tables {
    ($($(#[$about:meta])* $table:ident: $row:ident($($field:ident),*),)*) => {
        /// Rows of a unit: those of a pair, or of a drive.
        #[derive(Default)]
        pub struct UnitRows {
            $($(#[$about])* pub $table: Vec<$row>,)*
        }

        impl UnitRows {
            /// Adds the rows of another algorithm.
            pub(super) fn append(&mut self, mut other: Self) {
                $(self.$table.append(&mut other.$table);)*
            }
        }

        $(impl UnitRow for $row {
            $(unit_row_field! { $field })*
        })*

        /// Identifies the columns of all tables of units, and their form: other versions of svl
        /// have others.
        pub fn unit_format() -> String {
            let columns = [$($row::columns()),*];
            let names = columns.iter().flatten().map(|column| column.name);
            hash(&names.chain([FORM]).collect::<Vec<_>>().join("\n"))
        }

        #[derive(Default)]
        struct UnitTexts {
            $($table: Option<TableText>,)*
        }

        impl UnitTexts {
            fn push(&mut self, rows: &UnitRows) -> csv::Result<()> {
                $(push_rows(&mut self.$table, &rows.$table)?;)*
                Ok(())
            }

            fn into_parts(self) -> Vec<(String, Vec<u8>)> {
                let parts = [$((stringify!($table), self.$table)),*];
                let part = |(name, text): (&str, Option<TableText>)| {
                    Some((name.to_owned(), text?.take()))
                };
                parts.into_iter().filter_map(part).collect()
            }
        }

        /// Reads the tables of a unit, pair by pair.
        pub(super) struct UnitReader<'a> {
            scenario: &'a str,
            $($table: TableReader<$row>,)*
        }

        impl<'a> UnitReader<'a> {
            /// The tables of a report of that scenario; `is_read` chooses among them by name.
            ///
            /// # Errors
            /// [`Error::Io`], [`Error::Format`].
            pub(super) fn open(
                unit: &StoredUnit,
                scenario: &'a str,
                is_read: impl Fn(&str) -> bool,
            ) -> Result<Self> {
                let mut parts = unit.parts(is_read)?;
                Ok(Self {
                    scenario,
                    $($table: TableReader::open(unit, parts.remove(stringify!($table)))?,)*
                })
            }

            /// The next rows: those of a pair, or all.
            ///
            /// # Errors
            /// [`Error::Format`] for a line that is no row.
            pub(super) fn take(&mut self, sequence: Option<u64>) -> Result<UnitRows> {
                Ok(UnitRows {
                    $($table: self.$table.take(sequence, self.scenario)?,)*
                })
            }
        }
    };
}

unit_tables! {
    rows: Row(sequence, scenario),
    cells: CellRow(sequence, scenario),
    failures: FailureRow(sequence, scenario),
    /// Results of checkpoints.
    frames: FrameRow(sequence),
    /// The truth of the cells of each pair: the same of all algorithms.
    truths: TruthRow(sequence),
    sights: SightRow(sequence),
    drives: DriveRow(drive, scenario),
    tracks: TrackRow(drive, scenario),
}

/// A table of a unit, whose rows are in the order of the pairs.
struct TableReader<R> {
    reader: Option<RowReader<R>>,
    next: Option<R>,
}

impl<R: UnitRow> TableReader<R> {
    fn open(unit: &StoredUnit, text: Option<Vec<u8>>) -> Result<Self> {
        let reader = text.map(|text| RowReader::new(&unit.path, Box::new(Cursor::new(text))));
        let mut reader = reader.transpose()?;
        let next = reader.as_mut().and_then(Iterator::next).transpose()?;
        Ok(Self { reader, next })
    }

    fn take(&mut self, sequence: Option<u64>, scenario: &str) -> Result<Vec<R>> {
        let is_taken = |row: &mut R| sequence.is_none() || row.sequence() == sequence;
        let mut rows = Vec::new();
        while let Some(mut row) = self.next.take_if(is_taken) {
            row.set_scenario(scenario);
            rows.push(row);
            self.next = self.reader.as_mut().and_then(Iterator::next).transpose()?;
        }
        Ok(rows)
    }
}

/// Collects the rows of a unit, and writes it.
#[derive(Default)]
pub struct UnitWriter {
    pub header: UnitHeader,
    /// The pairs of the block; none of a drive.
    pub pairs: Vec<PairFacts>,
    /// The errors of distances of pixels; none of a perturbed run.
    pub pixel_errors: PixelErrors,
    texts: UnitTexts,
}

impl UnitWriter {
    /// Takes the rows of a pair, or of a drive.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a value that a table cannot have.
    pub fn push(&mut self, rows: &UnitRows) -> Result<()> {
        let pushed = self.texts.push(rows);
        pushed.map_err(|e| csv_error(Path::new("a unit"), e))
    }

    /// Writes the unit, whole, in the place of one of its name. `path`: as
    /// [`super::store::Units::unit_path`] gives it.
    ///
    /// # Errors
    /// [`Error::Io`] with the file.
    pub fn write(mut self, path: &Path, pictures: Option<&BlockPictures>) -> Result<()> {
        let mut parts = self.texts.into_parts();
        if !self.pairs.is_empty() {
            parts.push((PAIRS.to_owned(), json(&self.pairs)?));
        }
        if let Some(pictures) = pictures {
            parts.push((PICTURES.to_owned(), json(pictures)?));
        }
        if !self.pixel_errors.is_empty() {
            parts.push((PIXEL_ERRORS.to_owned(), json(&self.pixel_errors)?));
        }
        let length = |(name, bytes): &(String, Vec<u8>)| (name.clone(), bytes.len());
        self.header.parts = parts.iter().map(length).collect();
        let mut text = json(&self.header)?;
        text.push(b'\n');
        parts
            .iter()
            .for_each(|(_, bytes)| text.extend_from_slice(bytes));
        write_whole(path, &[hash_bytes(&text).as_bytes(), b"\n", &text])
    }
}

/// A unit of a report's folder.
#[derive(Clone, Debug)]
pub struct StoredUnit {
    path: PathBuf,
    pub checksum: String,
    header: UnitHeader,
}

impl std::ops::Deref for StoredUnit {
    type Target = UnitHeader;

    fn deref(&self) -> &UnitHeader {
        &self.header
    }
}

impl StoredUnit {
    /// Reads the header of a unit, and checks all of it; none if it is not there.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] for a file that is not the unit of its run and its name.
    pub fn read(path: &Path, run: &str) -> Result<Option<Self>> {
        if !path.exists() {
            return Ok(None);
        }
        let io = |e| Error::io(path, e);
        let damaged = || Error::format(path, "is damaged");
        let mut file = open(path)?;
        let mut line = || -> Result<Vec<u8>> {
            let mut line = Vec::new();
            let mut bounded = file.by_ref().take(MAX_LINE);
            bounded.read_until(b'\n', &mut line).map_err(io)?;
            Ok(line)
        };
        let (checksum, header) = (line()?, line()?);
        let checksum = String::from_utf8_lossy(checksum.trim_ascii_end()).into_owned();
        let hashed = hash_reader(header.chain(file)).map_err(io)?;
        let header: UnitHeader = serde_json::from_slice(&header).map_err(|_| damaged())?;
        let is_own =
            header.run == run && path.file_stem().is_some_and(|stem| *stem == *header.name);
        if !is_own || hashed != checksum {
            return Err(damaged());
        }
        Ok(Some(Self {
            path: path.to_owned(),
            checksum,
            header,
        }))
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// A row by its place, after the last one again from the first.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Format`].
    pub fn row(&self, place: usize) -> Result<Option<Row>> {
        let mut rows = UnitReader::open(self, "", |table| table == "rows")?
            .take(None)?
            .rows;
        let place = place % rows.len().max(1);
        Ok((place < rows.len()).then(|| rows.swap_remove(place)))
    }

    /// True if its algorithm failed on a pair.
    pub fn has_failures(&self) -> bool {
        self.parts.iter().any(|(name, _)| name == "failures")
    }

    /// The pairs of its block; none of a drive.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Format`].
    pub(super) fn pairs(&self) -> Result<Vec<PairFacts>> {
        Ok(self.parsed(PAIRS)?.unwrap_or_default())
    }

    /// Pictures of the unit, if it has some.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Format`].
    pub fn pictures(&self) -> Result<Option<BlockPictures>> {
        self.parsed(PICTURES)
    }

    /// The errors of distances of its pixels, if it has some.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Format`].
    pub fn pixel_errors(&self) -> Result<Option<PixelErrors>> {
        self.parsed(PIXEL_ERRORS)
    }

    /// A part that is JSON.
    fn parsed<T: DeserializeOwned>(&self, name: &str) -> Result<Option<T>> {
        let text = self.parts(|part| part == name)?.remove(name);
        let parsed = text.map(|text| serde_json::from_slice(&text)).transpose();
        parsed.map_err(|e| Error::format(&self.path, e.to_string()))
    }

    /// The parts of the unit that are chosen by name.
    fn parts(&self, is_read: impl Fn(&str) -> bool) -> Result<BTreeMap<String, Vec<u8>>> {
        let io = |e| Error::io(&self.path, e);
        let mut parts = BTreeMap::new();
        let mut file = None;
        // The parts are the end of the file, which was checked.
        let mut from_end: usize = self.header.parts.iter().map(|(_, length)| length).sum();
        for (name, length) in &self.header.parts {
            if is_read(name) {
                let file = match &mut file {
                    Some(file) => file,
                    None => file.insert(File::open(&self.path).map_err(io)?),
                };
                let mut part = Vec::new();
                file.seek(SeekFrom::End(-(from_end as i64))).map_err(io)?;
                let mut bounded = file.take(*length as u64);
                bounded.read_to_end(&mut part).map_err(io)?;
                parts.insert(name.clone(), part);
            }
            from_end -= length;
        }
        Ok(parts)
    }
}
