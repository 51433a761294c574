//! Labels of frames and windows: a small table beside the recording that a person can read.
//!
//! ```text
//! sequence,window,label
//! 0,,floor
//! 1,3x2,other
//! ```
//!
//! A window of the floor is named as its cell of the 5 x 3 grid, COLUMNxROW from 0; of *too close*
//! it is 0x0 or 1x0. Without a window the label is of all windows of the frame.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use svl_core::filter::FilterKind;
use svl_core::stereo::GridShape;
use svl_core::{Error, Result};

/// What a person said of the windows of a recording's frames.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameLabels {
    pub kind: FilterKind,
    /// By frame and window; that of no window is of all.
    labels: BTreeMap<(u64, Option<usize>), bool>,
}

/// Largest table that is read, bytes.
const MAX_BYTES: u64 = 64 << 20;

/// Columns of the table.
const HEAD: [&str; 3] = ["sequence", "window", "label"];

impl FrameLabels {
    pub fn new(kind: FilterKind) -> Self {
        Self {
            kind,
            labels: BTreeMap::new(),
        }
    }

    /// The table's place: beside the recording or the folder, named after it and the filter.
    pub fn path(source: &Path, kind: FilterKind) -> PathBuf {
        // A dot in a folder's name begins no ending.
        let name = match source.is_dir() {
            true => source.file_name(),
            false => source.file_stem(),
        };
        let name = name.unwrap_or_default().to_string_lossy();
        source.with_file_name(format!("{name}.{kind}.csv"))
    }

    /// How many windows a frame has.
    pub fn windows(kind: FilterKind) -> usize {
        shape(kind).cells()
    }

    /// How many of them stand side by side.
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
    /// [`Error::Io`]; [`Error::Format`] with the line that is wrong.
    pub fn read(path: &Path, kind: FilterKind) -> Result<Self> {
        let text = crate::files::read_text(path, MAX_BYTES)?;
        let mut labels = Self::new(kind);
        let mut rows = csv::ReaderBuilder::new();
        let mut rows = rows.trim(csv::Trim::All).from_reader(text.as_bytes());
        let wrong = |line: u64, what: String| Error::format(path, format!("line {line}: {what}"));
        let head = rows
            .headers()
            .map_err(|e| Error::format(path, e.to_string()))?;
        if head.iter().ne(HEAD) {
            let expected = HEAD.join(",");
            return Err(Error::format(
                path,
                format!("its first line is not '{expected}'"),
            ));
        }
        for row in rows.records() {
            let row = row.map_err(|e| Error::format(path, e.to_string()))?;
            let line = row.position().map_or(0, csv::Position::line);
            let [sequence, window, label] = [0, 1, 2].map(|i| row.get(i).unwrap_or_default());
            let sequence = sequence.parse();
            let sequence =
                sequence.map_err(|_| wrong(line, "its sequence is no number of a frame".into()))?;
            let window = match window {
                "" => None,
                name => {
                    let mut all = 0..Self::windows(kind);
                    let found = all.find(|&w| Self::window_name(kind, w) == name);
                    let last = Self::window_name(kind, Self::windows(kind) - 1);
                    let unknown = || {
                        wrong(
                            line,
                            format!("there is no window '{name}', the last is {last}"),
                        )
                    };
                    Some(found.ok_or_else(unknown)?)
                }
            };
            let [is, is_not] = kind.spec().categories;
            let is = match label {
                label if label == is => true,
                label if label == is_not => false,
                _ => {
                    return Err(wrong(
                        line,
                        format!("'{label}' is neither '{is}' nor '{is_not}'"),
                    ));
                }
            };
            labels.set(sequence, window, Some(is));
        }
        Ok(labels)
    }

    /// The table's text.
    pub fn to_text(&self) -> String {
        let mut text = HEAD.join(",") + "\n";
        for ((sequence, window), is) in &self.labels {
            let window = window.map(|window| Self::window_name(self.kind, window));
            let label = self.category(*is);
            text += &format!("{sequence},{},{label}\n", window.unwrap_or_default());
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

    /// The label that was given to a window, or to a frame.
    pub fn get(&self, sequence: u64, window: Option<usize>) -> Option<bool> {
        self.labels.get(&(sequence, window)).copied()
    }

    /// What a window is: its own label, else its frame's.
    pub fn of(&self, sequence: u64, window: usize) -> Option<bool> {
        self.get(sequence, Some(window))
            .or_else(|| self.get(sequence, None))
    }

    /// The frames that have labels.
    pub fn sequences(&self) -> impl Iterator<Item = u64> + '_ {
        self.labels.keys().map(|(sequence, _)| *sequence)
    }

    /// How many are of what the filter detects, and how many are not.
    pub fn counts(&self) -> [usize; 2] {
        let of = |is| self.labels.values().filter(|&&label| label == is).count();
        [of(true), of(false)]
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
        labels.set(7, Some(13), Some(false));
        labels.set(3, Some(0), Some(true));
        labels.set(3, Some(1), Some(true));
        labels.set(3, Some(1), None);
        let text = labels.to_text();
        assert_eq!(
            text,
            "sequence,window,label\n3,0x0,floor\n7,,floor\n7,3x2,other\n"
        );
        assert_eq!(read(&text).unwrap(), labels);
        assert_eq!(
            [labels.of(7, 13), labels.of(7, 2), labels.of(3, 1)],
            [Some(false), Some(true), None]
        );
        assert_eq!(labels.counts(), [2, 1]);
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
    fn wrong_lines_are_named() {
        for (text, reason) in [
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
