//! Labels of the windows of frames: a small, human-readable table next to the recording.
//!
//! ```text
//! sequence,window,label,pair_hash
//! 0,0x0,floor,h0d3b6d2f3f9f54c20ab1e6cd50a4bb1e
//! 1,3x2,other,h99aa06d3014798d86001c324468d497f
//! ```
//!
//! The hash is that of the frame's pair, as in the tables of a report: labels belong to these
//! pixels. A window of the floor is named like its cell of the 5 x 3 grid, COLUMNxROW from 0; for
//! *too close* it is 0x0 or 1x0.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use svl_core::filter::FilterKind;
use svl_core::stereo::{GridShape, hash_words, parse_hash};
use svl_core::{Error, Result};

/// A person's labels for the windows of a recording's frames.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameLabels {
    pub kind: FilterKind,
    /// File of the table.
    pub path: PathBuf,
    /// By frame and window.
    labels: BTreeMap<(u64, usize), bool>,
    /// Hashes of the pairs of the frames.
    pairs: BTreeMap<u64, u128>,
}

/// Largest table accepted, bytes.
const MAX_BYTES: u64 = 64 << 20;

/// Columns of the table.
const HEAD: [&str; 4] = ["sequence", "window", "label", "pair_hash"];

/// Fault in a line of the table.
#[derive(Debug, thiserror::Error)]
enum LabelFault {
    #[error("it has {0} of {count} fields", count = HEAD.len())]
    Fields(usize),
    #[error("its sequence is not a frame number")]
    Sequence,
    /// A name, and that of the last window.
    #[error("there is no window '{0}', the last is {1}")]
    Window(String, String),
    /// A word, and those of the categories.
    #[error("'{0}' is neither '{1}' nor '{2}'")]
    Label(String, &'static str, &'static str),
    #[error("'{0}' is not a pair_hash: h and 32 digits")]
    Hash(String),
    #[error("frame {0}, window {1} is '{2}', and not in an earlier line; keep one")]
    Twice(u64, String, String),
    #[error("frame {0} has another pair_hash in an earlier line; keep the labels of one recording")]
    Pairs(u64),
}

impl FrameLabels {
    pub fn new(path: &Path, kind: FilterKind) -> Self {
        Self {
            kind,
            path: path.to_owned(),
            labels: BTreeMap::new(),
            pairs: BTreeMap::new(),
        }
    }

    /// The usual path of a table: next to the recording or the folder, named after it and
    /// the filter.
    pub fn beside(source: &Path, kind: FilterKind) -> PathBuf {
        // A dot in a folder's name does not start a file extension.
        let name = if source.is_dir() {
            source.file_name()
        } else {
            source.file_stem()
        };
        let name = name.unwrap_or_default().to_string_lossy();
        source.with_file_name(format!("{name}.{kind}.csv"))
    }

    /// Number of windows per frame.
    pub fn windows(kind: FilterKind) -> usize {
        shape(kind).cells()
    }

    /// Number of windows side by side.
    pub fn columns(kind: FilterKind) -> usize {
        shape(kind).columns
    }

    /// The window's name in the table.
    pub fn window_name(kind: FilterKind, window: usize) -> String {
        let columns = shape(kind).columns;
        format!("{}x{}", window % columns, window / columns)
    }

    /// Reads a table.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] with the faulty line.
    pub fn read(path: &Path, kind: FilterKind) -> Result<Self> {
        let text = svl_files::read_text(path, MAX_BYTES)?;
        let mut rows = csv::ReaderBuilder::new();
        let rows = rows.trim(csv::Trim::All).flexible(true);
        let mut rows = rows.from_reader(text.as_bytes());
        let head = rows.headers().map_err(|e| Error::format(path, e))?;
        if head.iter().ne(HEAD) {
            let expected = HEAD.join(",");
            let words = format!("its first line is not '{expected}'");
            return Err(Error::format(path, words));
        }
        let (mut labels, lines) = (Self::new(path, kind), text.lines().count() as u64);
        for row in rows.records() {
            let row = row.map_err(|e| Error::format(path, e))?;
            let line = row.position().map_or(0, csv::Position::line);
            let fields: Vec<_> = row.iter().collect();
            let added = match fields[..] {
                [sequence, window, label, hash] => labels.add([sequence, window, label, hash]),
                _ => Err(LabelFault::Fields(fields.len())),
            };
            let is_cut = line == lines && !text.ends_with('\n');
            added.map_err(|fault| {
                let words = if is_cut {
                    format!("line {line}: it is cut off; remove it ({fault})")
                } else {
                    format!("line {line}: {fault}")
                };
                Error::format(path, words)
            })?;
        }
        Ok(labels)
    }

    /// Adds the fields of a line.
    fn add(&mut self, [sequence, window, label, pair_hash]: [&str; 4]) -> Result<(), LabelFault> {
        let (kind, name) = (self.kind, window);
        let sequence = sequence.parse().map_err(|_| LabelFault::Sequence)?;
        let window = parse_window(kind, name)?;
        let is = parse_label(kind, label)?;
        let pair_hash =
            parse_hash(pair_hash).ok_or_else(|| LabelFault::Hash(pair_hash.to_owned()))?;
        if self.set(sequence, window, Some(is)) == Some(!is) {
            return Err(LabelFault::Twice(
                sequence,
                name.to_owned(),
                label.to_owned(),
            ));
        }
        match self.tie(sequence, pair_hash) {
            Some(before) if before != pair_hash => Err(LabelFault::Pairs(sequence)),
            _ => Ok(()),
        }
    }

    /// The table's text.
    pub fn to_text(&self) -> String {
        let mut text = HEAD.join(",") + "\n";
        for ((sequence, window), is) in &self.labels {
            let window = Self::window_name(self.kind, *window);
            let (label, pair) = (self.category(*is), self.pairs[sequence]);
            text += &format!("{sequence},{window},{label},{}\n", hash_words(pair));
        }
        text
    }

    /// The word for a category.
    pub fn category(&self, is: bool) -> &'static str {
        self.kind.spec().categories[usize::from(!is)]
    }

    /// Sets or removes the label of a window, and returns that before.
    pub fn set(&mut self, sequence: u64, window: usize, is: Option<bool>) -> Option<bool> {
        match is {
            Some(is) => self.labels.insert((sequence, window), is),
            None => self.labels.remove(&(sequence, window)),
        }
    }

    /// Records the pair that the labels of a frame belong to, and returns that before.
    pub fn tie(&mut self, sequence: u64, pair_hash: u128) -> Option<u128> {
        self.pairs.insert(sequence, pair_hash)
    }

    /// Rejects a pair of another recording, or of the same one read differently. `source`: the
    /// recording.
    ///
    /// # Errors
    /// [`Error::Format`] with the frame and the remedy.
    pub fn check(
        &self,
        source: &Path,
        sequence: u64,
        pair_hash: impl FnOnce() -> u128,
    ) -> Result<()> {
        let Some(expected) = self.pairs.get(&sequence) else {
            return Ok(());
        };
        let found = pair_hash();
        if found == *expected {
            return Ok(());
        }
        let reason = format!(
            "labels another frame {sequence} than {} has, by their pair_hash {} and {}; name the \
             recording that was labelled, read with the options of then, or move the table away \
             and label again",
            source.display(),
            hash_words(*expected),
            hash_words(found)
        );
        Err(Error::format(&self.path, reason))
    }

    /// The label of a window.
    pub fn get(&self, sequence: u64, window: usize) -> Option<bool> {
        self.labels.get(&(sequence, window)).copied()
    }

    /// The frames that have labels.
    pub fn sequences(&self) -> impl Iterator<Item = u64> + '_ {
        self.labels.keys().map(|(sequence, _)| *sequence)
    }

    /// The last frame that has a label, and its last window that has one.
    pub fn last(&self) -> Option<(u64, usize)> {
        self.labels.keys().next_back().copied()
    }

    /// Number of labels with the filter's object, and without.
    pub fn counts(&self) -> [usize; 2] {
        let count = |is| self.labels.values().filter(|&&label| label == is).count();
        [count(true), count(false)]
    }
}

/// The number of the window with that name.
fn parse_window(kind: FilterKind, name: &str) -> Result<usize, LabelFault> {
    let mut windows = 0..FrameLabels::windows(kind);
    let found = windows.find(|&window| FrameLabels::window_name(kind, window) == name);
    let last = FrameLabels::window_name(kind, FrameLabels::windows(kind) - 1);
    found.ok_or_else(|| LabelFault::Window(name.to_owned(), last))
}

/// True if the word says that the filter's object is there.
fn parse_label(kind: FilterKind, label: &str) -> Result<bool, LabelFault> {
    let [is, is_not] = kind.spec().categories;
    match label {
        label if label == is => Ok(true),
        label if label == is_not => Ok(false),
        _ => Err(LabelFault::Label(label.to_owned(), is, is_not)),
    }
}

fn shape(kind: FilterKind) -> GridShape {
    match kind {
        FilterKind::Floor => GridShape::default(),
        FilterKind::TooClose => GridShape {
            columns: 2,
            rows: 1,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<FrameLabels> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.floor.csv");
        std::fs::write(&path, text).unwrap();
        FrameLabels::read(&path, FilterKind::Floor)
    }

    #[test]
    fn a_table_is_read_as_it_was_written() {
        let mut labels = FrameLabels::new(Path::new("run.floor.csv"), FilterKind::Floor);
        labels.set(7, 13, Some(true));
        labels.set(3, 0, Some(true));
        labels.set(3, 1, Some(true));
        assert_eq!(labels.set(3, 1, None), Some(true));
        labels.tie(7, 0xabc);
        labels.tie(3, 1);
        let text = labels.to_text();
        assert_eq!(
            text,
            format!(
                "sequence,window,label,pair_hash\n3,0x0,floor,{}\n7,3x2,floor,{}\n",
                hash_words(1),
                hash_words(0xabc)
            )
        );
        let again = FrameLabels {
            path: labels.path.clone(),
            ..read(&text).unwrap()
        };
        assert_eq!(again, labels);
        assert_eq!([labels.get(7, 13), labels.get(3, 1)], [Some(true), None]);
        assert_eq!(labels.last(), Some((7, 13)));
        assert_eq!(labels.counts(), [2, 0]);
        let place = FrameLabels::beside(Path::new("a/run.mcap"), FilterKind::TooClose);
        assert_eq!(place, Path::new("a/run.too-close.csv"));
        let folder = tempfile::tempdir().unwrap();
        let days = ["2026.11.20", "2026.11.21"].map(|day| folder.path().join(day));
        days.iter()
            .for_each(|day| std::fs::create_dir(day).unwrap());
        let [one, two] = days.map(|day| FrameLabels::beside(&day, FilterKind::Floor));
        assert_ne!(one, two);
    }

    #[test]
    fn labels_are_of_their_pair() {
        let table = Path::new("b/run.floor.csv");
        let mut labels = FrameLabels::new(table, FilterKind::Floor);
        labels.set(7, 0, Some(true));
        let source = Path::new("a/run.mcap");
        labels.tie(7, 0xabc);
        labels.check(source, 7, || 0xabc).unwrap();
        labels.check(source, 8, || 1).unwrap();
        let error = labels.check(source, 7, || 1).unwrap_err().to_string();
        let words = "b/run.floor.csv: labels another frame 7 than a/run.mcap has";
        assert!(error.starts_with(words) && !error.contains('\n'), "{error}");
    }

    #[test]
    fn wrong_lines_are_named() {
        let [a, b] = [0xa, 0xb].map(hash_words);
        let cut = &a[..5];
        for (lines, reason) in [
            (
                format!("1,3x2,floor,{a}\n0,0x0,floor,{b}\n1,3x2,other,{a}\n"),
                "line 4: frame 1, window 3x2 is 'other', and not in an earlier line",
            ),
            (
                format!("1,1x0,floor,{a}\n1,0x0,floor,{b}\n"),
                "line 3: frame 1 has another pair_hash in an earlier line",
            ),
            ("1,0x0,floor,xy\n".into(), "line 2: 'xy' is not a pair_hash"),
            ("1,0x0,floor,\n".into(), "line 2: '' is not a pair_hash"),
            (
                format!("1,0x0,floor,{a}\nx,0x0,floor,{a}\n"),
                "line 3: its sequence",
            ),
            (
                format!("1,5x0,floor,{a}\n"),
                "line 2: there is no window '5x0', the last is 4x2",
            ),
            (
                format!("0,0x0,floor,{a}\n1,0x0,wall,{a}\n"),
                "line 3: 'wall' is neither 'floor' nor 'other'",
            ),
            ("1,floor\n".into(), "line 2: it has 2 of 4 fields"),
            (
                format!("1,0x0,floor,{a}\n1,1x0,floor,{cut}"),
                "line 3: it is cut off; remove it ('h0000' is not",
            ),
            (
                format!("1,0x0,floor,{a}\n1,1x"),
                "line 3: it is cut off; remove it (it has 2 of 4 fields)",
            ),
        ] {
            let error = read(&format!("{}\n{lines}", HEAD.join(","))).unwrap_err();
            let error = error.to_string();
            assert!(error.contains(reason), "{error}");
        }
        // A last line that lacks only its end is complete.
        read(&format!("{}\n1,0x0,floor,{a}", HEAD.join(","))).unwrap();
        let error = read("sequence,label\n").unwrap_err().to_string();
        assert!(error.contains("first line"), "{error}");
    }
}
