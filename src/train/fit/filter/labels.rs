//! Labels of frames and windows: a small, human-readable table next to the recording.
//!
//! ```text
//! sequence,window,label,pair_hash
//! 0,,floor,0d3b6d2f3f9f54c20ab1e6cd50a4bb1e
//! 1,3x2,other,99aa06d3014798d86001c324468d497f
//! ```
//!
//! The hash is that of the frame's pair, as in the tables of a report: labels belong to these
//! pixels. A window of the floor is named like its cell of the 5 x 3 grid, COLUMNxROW from 0; for
//! *too close* it is 0x0 or 1x0. Without a window the label applies to all windows of the frame.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use svl_core::filter::FilterKind;
use svl_core::stereo::GridShape;
use svl_core::{Error, Result};

/// A person's labels for the windows of a recording's frames.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameLabels {
    pub kind: FilterKind,
    /// By frame and window; without a window, for all of them.
    labels: BTreeMap<(u64, Option<usize>), bool>,
    /// Hashes of the pairs of the frames, if known.
    pairs: BTreeMap<u64, u128>,
}

/// Largest table accepted, bytes.
const MAX_BYTES: u64 = 64 << 20;

/// Columns of the table.
const HEAD: [&str; 4] = ["sequence", "window", "label", "pair_hash"];

impl FrameLabels {
    pub fn new(kind: FilterKind) -> Self {
        Self {
            kind,
            labels: BTreeMap::new(),
            pairs: BTreeMap::new(),
        }
    }

    /// The table's path: next to the recording or the folder, named after it and the filter.
    pub fn path(source: &Path, kind: FilterKind) -> PathBuf {
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
        let mut rows = rows.trim(csv::Trim::All).from_reader(text.as_bytes());
        let head = rows
            .headers()
            .map_err(|e| Error::format(path, e.to_string()))?;
        // Tables of earlier versions have no hashes.
        if head.iter().ne(HEAD) && head.iter().ne(HEAD[..3].iter().copied()) {
            let expected = HEAD.join(",");
            return Err(Error::format(
                path,
                format!("its first line is not '{expected}'"),
            ));
        }
        let mut table = LabelTable::new(kind);
        for row in rows.records() {
            let row = row.map_err(|e| Error::format(path, e.to_string()))?;
            let line = row.position().map_or(0, csv::Position::line);
            let fields = [0, 1, 2, 3].map(|i| row.get(i).unwrap_or_default());
            table
                .add(line, fields)
                .map_err(|reason| Error::format(path, format!("line {line}: {reason}")))?;
        }
        Ok(table.labels)
    }

    /// The table's text.
    pub fn to_text(&self) -> String {
        let mut text = HEAD.join(",") + "\n";
        for ((sequence, window), is) in &self.labels {
            let window = window.map(|window| Self::window_name(self.kind, window));
            let label = self.category(*is);
            let pair = self.pairs.get(sequence).map(|hash| format!("{hash:032x}"));
            let [window, pair] = [window, pair].map(Option::unwrap_or_default);
            text += &format!("{sequence},{window},{label},{pair}\n");
        }
        text
    }

    /// The word for a category.
    pub fn category(&self, is: bool) -> &'static str {
        self.kind.spec().categories[usize::from(!is)]
    }

    /// Sets or removes the label of a window, or of a frame.
    pub fn set(&mut self, sequence: u64, window: Option<usize>, is: Option<bool>) {
        match is {
            Some(is) => self.labels.insert((sequence, window), is),
            None => self.labels.remove(&(sequence, window)),
        };
    }

    /// The label of the whole frame, or of one of its windows, that would contradict a label.
    pub fn contrary(
        &self,
        sequence: u64,
        window: Option<usize>,
        is: bool,
    ) -> Option<Option<usize>> {
        let windows = (sequence, Some(0))..=(sequence, Some(usize::MAX));
        match window {
            Some(_) => (self.get(sequence, None) == Some(!is)).then_some(None),
            None => {
                let mut contrary = self
                    .labels
                    .range(windows)
                    .filter(|(_, label)| **label != is);
                contrary.next().map(|((_, window), _)| *window)
            }
        }
    }

    /// Records the pair that the labels of a frame belong to.
    pub fn tie(&mut self, sequence: u64, pair_hash: u128) {
        self.pairs.insert(sequence, pair_hash);
    }

    /// A labelled frame whose pair the table does not identify.
    pub fn untied(&self) -> Option<u64> {
        self.sequences()
            .find(|sequence| !self.pairs.contains_key(sequence))
    }

    /// Rejects a pair of another recording, or of the same one read differently. `source`: the
    /// recording next to the table.
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
            "labels another frame {sequence} than {} has, by their pair_hash {expected:032x} and \
             {found:032x}; name the recording that was labelled, read with the options of then, \
             or move the table away and label again",
            source.display()
        );
        Err(Error::format(Self::path(source, self.kind), reason))
    }

    /// The label assigned to a window, or to a frame.
    pub fn get(&self, sequence: u64, window: Option<usize>) -> Option<bool> {
        self.labels.get(&(sequence, window)).copied()
    }

    /// Category of a window: its own label, else its frame's.
    pub fn window_category(&self, sequence: u64, window: usize) -> Option<bool> {
        self.get(sequence, Some(window))
            .or_else(|| self.get(sequence, None))
    }

    /// The frames that have labels.
    pub fn sequences(&self) -> impl Iterator<Item = u64> + '_ {
        self.labels.keys().map(|(sequence, _)| *sequence)
    }

    /// Number of labels with the filter's object, and without.
    pub fn counts(&self) -> [usize; 2] {
        let count = |is| self.labels.values().filter(|&&label| label == is).count();
        [count(true), count(false)]
    }
}

/// A table while it is read.
struct LabelTable {
    labels: FrameLabels,
    /// Line numbers of the labels, and of the hashes.
    lines: BTreeMap<(u64, Option<usize>), u64>,
    pair_lines: BTreeMap<u64, u64>,
}

impl LabelTable {
    fn new(kind: FilterKind) -> Self {
        Self {
            labels: FrameLabels::new(kind),
            lines: BTreeMap::new(),
            pair_lines: BTreeMap::new(),
        }
    }

    /// Adds a line. The error is the reason why it is faulty.
    fn add(
        &mut self,
        line: u64,
        [sequence, window, label, pair_hash]: [&str; 4],
    ) -> std::result::Result<(), String> {
        let kind = self.labels.kind;
        let sequence = sequence
            .parse()
            .map_err(|_| "its sequence is not a frame number")?;
        let window = parse_window(kind, window)?;
        let is = parse_label(kind, label)?;
        let before = self.lines.insert((sequence, window), line);
        if let Some(before) = before.filter(|_| self.labels.get(sequence, window) != Some(is)) {
            let window = window.map(|window| FrameLabels::window_name(kind, window));
            let place = window.map_or(String::new(), |window| format!(", window {window}"));
            return Err(format!(
                "frame {sequence}{place} is '{label}', and not in line {before}; keep one"
            ));
        }
        self.check_contrary(sequence, window, is)?;
        self.labels.set(sequence, window, Some(is));
        if pair_hash.is_empty() {
            return Ok(());
        }
        let pair_hash = u128::from_str_radix(pair_hash, 16)
            .map_err(|_| format!("'{pair_hash}' is not a pair_hash"))?;
        let before = self.pair_lines.insert(sequence, line);
        if let Some(before) = before.filter(|_| self.labels.pairs[&sequence] != pair_hash) {
            return Err(format!(
                "frame {sequence} has another pair_hash in line {before}; keep the labels of one \
                 recording"
            ));
        }
        self.labels.tie(sequence, pair_hash);
        Ok(())
    }

    /// Rejects a label that contradicts that of the whole frame, or of one of its windows.
    fn check_contrary(
        &self,
        sequence: u64,
        window: Option<usize>,
        is: bool,
    ) -> std::result::Result<(), String> {
        let Some(contrary) = self.labels.contrary(sequence, window, is) else {
            return Ok(());
        };
        let before = self.lines[&(sequence, contrary)];
        let [other, own] = [!is, is].map(|is| self.labels.category(is));
        let (whole, part) = match window {
            Some(_) => (other, own),
            None => (own, other),
        };
        Err(format!(
            "with line {before} it says of frame {sequence} '{whole}' as a whole, and '{part}' of \
             a window; keep one, or label the windows alone"
        ))
    }
}

/// The number of the window with that name; `None` for no name, which is the whole frame.
fn parse_window(kind: FilterKind, name: &str) -> std::result::Result<Option<usize>, String> {
    if name.is_empty() {
        return Ok(None);
    }
    let mut windows = 0..FrameLabels::windows(kind);
    let found = windows.find(|&window| FrameLabels::window_name(kind, window) == name);
    if found.is_none() {
        let last = FrameLabels::window_name(kind, FrameLabels::windows(kind) - 1);
        return Err(format!("there is no window '{name}', the last is {last}"));
    }
    Ok(found)
}

/// True if the word says that the filter's object is there.
fn parse_label(kind: FilterKind, label: &str) -> std::result::Result<bool, String> {
    let [is, is_not] = kind.spec().categories;
    match label {
        label if label == is => Ok(true),
        label if label == is_not => Ok(false),
        _ => Err(format!("'{label}' is neither '{is}' nor '{is_not}'")),
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

    fn read(text: &str) -> std::result::Result<FrameLabels, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.floor.csv");
        std::fs::write(&path, text).unwrap();
        FrameLabels::read(&path, FilterKind::Floor).map_err(|e| e.to_string())
    }

    #[test]
    fn a_table_is_read_as_it_was_written() {
        let mut labels = FrameLabels::new(FilterKind::Floor);
        labels.set(7, None, Some(true));
        labels.set(7, Some(13), Some(true));
        labels.set(3, Some(0), Some(true));
        labels.set(3, Some(1), Some(true));
        labels.set(3, Some(1), None);
        labels.tie(7, 0xabc);
        assert_eq!(labels.untied(), Some(3));
        let text = labels.to_text();
        assert_eq!(
            text,
            format!(
                "sequence,window,label,pair_hash\n3,0x0,floor,\n7,,floor,{0:032x}\n7,3x2,floor,\
                 {0:032x}\n",
                0xabc
            )
        );
        // A table of an earlier version.
        let old = read("sequence,window,label\n3,0x0,floor\n").unwrap();
        assert_eq!((old.untied(), old.counts()), (Some(3), [1, 0]));
        assert_eq!(read(&text).unwrap(), labels);
        assert_eq!(
            [
                labels.window_category(7, 13),
                labels.window_category(7, 2),
                labels.window_category(3, 1)
            ],
            [Some(true), Some(true), None]
        );
        assert_eq!(labels.counts(), [3, 0]);
        let place = FrameLabels::path(Path::new("a/run.mcap"), FilterKind::TooClose);
        assert_eq!(place, Path::new("a/run.too-close.csv"));
        let folder = tempfile::tempdir().unwrap();
        let days = ["2026.11.20", "2026.11.21"].map(|day| folder.path().join(day));
        days.iter()
            .for_each(|day| std::fs::create_dir(day).unwrap());
        let [one, two] = days.map(|day| FrameLabels::path(&day, FilterKind::Floor));
        assert_ne!(one, two);
    }

    #[test]
    fn labels_are_of_their_pair() {
        let mut labels = FrameLabels::new(FilterKind::Floor);
        labels.set(7, None, Some(true));
        let source = Path::new("a/run.mcap");
        labels.check(source, 7, || 1).unwrap();
        labels.tie(7, 0xabc);
        labels.check(source, 7, || 0xabc).unwrap();
        labels.check(source, 8, || 1).unwrap();
        let error = labels.check(source, 7, || 1).unwrap_err().to_string();
        let words = "a/run.floor.csv: labels another frame 7 than a/run.mcap has";
        assert!(error.starts_with(words) && !error.contains('\n'), "{error}");
    }

    #[test]
    fn wrong_lines_are_named() {
        for (text, reason) in [
            (
                "sequence,window,label,pair_hash\n1,3x2,floor,\n0,,floor,\n1,3x2,other,\n",
                "line 4: frame 1, window 3x2 is 'other', and not in line 2",
            ),
            (
                "sequence,window,label\n1,,floor\n1,,floor\n1,,other\n",
                "line 4: frame 1 is 'other', and not in line 3",
            ),
            (
                "sequence,window,label\n0,,other\n1,,floor\n1,0x0,floor\n1,3x2,other\n",
                "line 5: with line 3 it says of frame 1 'floor' as a whole",
            ),
            (
                "sequence,window,label\n1,0x0,floor\n1,3x2,other\n1,,other\n",
                "line 4: with line 2 it says of frame 1 'other' as a whole",
            ),
            (
                "sequence,window,label,pair_hash\n1,,floor,ab\n1,0x0,floor,ac\n",
                "line 3: frame 1 has another pair_hash in line 2",
            ),
            (
                "sequence,window,label,pair_hash\n1,,floor,xy\n",
                "line 2: 'xy' is not a pair_hash",
            ),
            ("sequence,label\n", "first line"),
            (
                "sequence,window,label\n1,,floor\nx,,floor\n",
                "line 3: its sequence",
            ),
            (
                "sequence,window,label\n1,5x0,floor\n",
                "line 2: there is no window '5x0', the last is 4x2",
            ),
            (
                "sequence,window,label\n0,,floor\n1,,wall\n",
                "line 3: 'wall' is neither 'floor' nor 'other'",
            ),
            ("sequence,window,label\n1,floor\n", "2 fields"),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.contains(reason), "{error}");
        }
    }
}
