//! The checkpoint under work, kept in a file beside the scenario after every key, so that nothing
//! typed is lost.

use super::label::CellLabel;
use crate::cli::commands::label::input::replace;
use crate::cli::shared::stepper::Stepper;
use anyhow::{Context, bail};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use svl::counted;
use svl::outputs::remove_file;
use svl::score::LabelledPair;
use svl::stereo::Frame;

/// A checkpoint as far as it is labelled.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Draft {
    pub(super) name: String,
    /// The first and the last of its frames, where they were set.
    pub(super) first: Option<u64>,
    pub(super) last: Option<u64>,
    /// In raster order.
    pub(super) cells: Vec<LabelledCell>,
}

/// A label, and the pair at which it was given.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LabelledCell {
    /// `[column, row]`.
    pub(super) at: [usize; 2],
    pub(super) label: CellLabel,
    pair: LabelledPair,
}

impl Draft {
    pub(super) fn label(&self, at: [usize; 2]) -> Option<CellLabel> {
        let cell = self.cells.iter().find(|cell| cell.at == at);
        cell.map(|cell| cell.label)
    }

    /// Labels a cell at a pair, or clears it.
    pub(super) fn set(&mut self, at: [usize; 2], label: Option<CellLabel>, pair: LabelledPair) {
        self.cells.retain(|cell| cell.at != at);
        let cell = label.map(|label| LabelledCell { at, label, pair });
        self.cells.extend(cell);
        self.cells.sort_by_key(|cell| [cell.at[1], cell.at[0]]);
    }

    /// True if nothing would be lost.
    pub(super) fn is_empty(&self) -> bool {
        self.cells.is_empty() && self.name.is_empty() && self.first.or(self.last).is_none()
    }

    /// Frames of the checkpoint, both ends among them; ends that were not set are those that were
    /// labelled.
    pub(super) fn frames(&self, shown: u64) -> [u64; 2] {
        let pairs = self.labelled();
        let [from, to] = [pairs.first(), pairs.last()].map(|p| p.map_or(shown, |p| p.frame));
        let last = self.last.unwrap_or(u64::MAX);
        let first = self.first.unwrap_or(from.min(last));
        [first, self.last.unwrap_or(to.max(first))]
    }

    /// The pairs at which its cells were labelled, each once, by frame.
    pub(super) fn labelled(&self) -> Vec<&LabelledPair> {
        let mut pairs: Vec<_> = self.cells.iter().map(|cell| &cell.pair).collect();
        pairs.sort_by_key(|pair| pair.frame);
        pairs.dedup();
        pairs
    }

    /// Sets the first frame.
    ///
    /// # Errors
    /// It would be behind the last one.
    pub(super) fn begin(&mut self, frame: u64) -> Result<(), String> {
        if let Some(last) = self.last.filter(|last| *last < frame) {
            return Err(format!(
                "frame {frame} is behind the last one, {last}; move that with ] first"
            ));
        }
        self.first = Some(frame);
        Ok(())
    }

    /// Sets the last frame.
    ///
    /// # Errors
    /// It would be before the first one.
    pub(super) fn end(&mut self, frame: u64) -> Result<(), String> {
        if let Some(first) = self.first.filter(|first| frame < *first) {
            return Err(format!(
                "frame {frame} is before the first one, {first}; move that with [ first"
            ));
        }
        self.last = Some(frame);
        Ok(())
    }
}

/// The file of a draft.
pub(super) struct DraftFile {
    pub(super) path: PathBuf,
    /// The source that is labelled.
    source: String,
    /// The draft that the file has.
    pub(super) written: Option<DraftTable>,
}

/// The text of a draft.
#[derive(Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct DraftTable {
    /// For a person; its pairs identify it.
    source: String,
    pub(super) draft: Draft,
    /// The pair that was shown last.
    pub(super) shown: LabelledPair,
}

/// Largest draft that is read, bytes.
const MAX_BYTES: u64 = 1 << 20;

impl DraftFile {
    /// The draft beside a scenario.
    ///
    /// # Errors
    /// It cannot be read.
    pub(super) fn open(scenario: &Path, source: &str) -> anyhow::Result<Self> {
        let path = scenario.with_added_extension("draft");
        Ok(Self {
            written: path.exists().then(|| DraftTable::read(&path)).transpose()?,
            path,
            source: source.to_owned(),
        })
    }

    /// Goes to the pair that was shown last. Refuses a draft of another recording, by its pairs:
    /// the same one may have another path.
    pub(super) fn resume<T>(&self, stepper: &mut Stepper<'_, T>) -> anyhow::Result<()> {
        let Some(DraftTable {
            source,
            draft,
            shown,
        }) = &self.written
        else {
            return Ok(());
        };
        let pairs = draft.labelled().into_iter().chain([shown]);
        if let Some(LabelledPair { frame, .. }) = first_other(pairs, stepper) {
            bail!(
                "{}: is of {source}, and frame {frame} of {} is another pair; finish it with the \
                 recording of then, or remove the file",
                self.path.display(),
                self.source
            );
        }
        stepper.go_to(shown.frame);
        let cells = counted(draft.cells.len(), "labelled cell");
        stepper.say(format!("resumed at frame {} with {cells}", shown.frame));
        Ok(())
    }

    /// Keeps the draft and the pair that is shown.
    pub(super) fn keep(&mut self, frame: &Frame, draft: &Draft) -> anyhow::Result<()> {
        let table = DraftTable {
            source: self.source.clone(),
            draft: draft.clone(),
            shown: LabelledPair::new(frame),
        };
        if self.written.as_ref() != Some(&table) {
            replace(&self.path, &toml::to_string(&table)?, false)?;
            self.written = Some(table);
        }
        Ok(())
    }

    /// Removes the file: nothing is left to resume.
    pub(super) fn remove(&mut self) -> anyhow::Result<()> {
        self.written = None;
        Ok(remove_file(&self.path)?)
    }
}

impl DraftTable {
    fn read(path: &Path) -> anyhow::Result<Self> {
        let text = svl::files::read_text(path, MAX_BYTES)?;
        let shown = path.display();
        let wrong = || format!("{shown}: is not a draft of svl's; remove the file");
        toml::from_str(&text).ok().with_context(wrong)
    }
}

/// The first of the pairs that the source has not at its frame.
pub(super) fn first_other<'p, T>(
    pairs: impl IntoIterator<Item = &'p LabelledPair>,
    stepper: &mut Stepper<'_, T>,
) -> Option<&'p LabelledPair> {
    pairs.into_iter().find(|pair| {
        stepper.go_to(pair.frame);
        LabelledPair::new(&stepper.frame) != **pair
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair(frame: u64) -> LabelledPair {
        LabelledPair {
            frame,
            hash: "1f".into(),
        }
    }

    fn draft() -> Draft {
        let mut draft = Draft {
            name: "the \"shelf\"".into(),
            first: Some(3),
            ..Draft::default()
        };
        draft.set([4, 0], "0.43".parse().ok(), pair(5));
        draft.set([0, 1], "must".parse().ok(), pair(6));
        draft.set([0, 1], "free".parse().ok(), pair(7));
        draft
    }

    #[test]
    fn a_draft_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        let scenario = folder.path().join("own.toml");
        let mut file = DraftFile::open(&scenario, "a.mcap").unwrap();
        assert!(file.written.is_none());
        let gray = || svl::stereo::Gray::filled(4, 2, 9).unwrap();
        let frame = svl::stereo::StereoPair::new(gray(), gray()).unwrap();
        let frame = Frame::new(frame, svl::stereo::Geometry::Raw);
        file.keep(&frame, &draft()).unwrap();
        let mut file = DraftFile::open(&scenario, "b.mcap").unwrap();
        let found = file.written.as_ref().unwrap();
        assert_eq!(found.draft, draft());
        assert_eq!(found.shown, LabelledPair::new(&frame));
        assert_eq!(draft().label([0, 1]), Some(CellLabel::FREE));
        assert_eq!(draft().cells.len(), 2);
        file.remove().unwrap();
        file.remove().unwrap();
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        std::fs::write(&file.path, "source = 3").unwrap();
        let error = DraftFile::open(&scenario, "a.mcap").err().unwrap();
        assert!(
            error.to_string().contains("is not a draft of svl's"),
            "{error}"
        );
    }

    #[test]
    fn ends_that_were_not_set_follow_the_labels() {
        let frames = |first, last, labelled_at: Option<u64>| {
            let mut draft = Draft {
                first,
                last,
                ..Draft::default()
            };
            if let Some(at) = labelled_at {
                draft.set([0, 0], Some(CellLabel::Must), pair(at));
            }
            draft.frames(50)
        };
        assert_eq!(frames(None, None, None), [50, 50]);
        assert_eq!(frames(None, None, Some(9)), [9, 9]);
        assert_eq!(frames(Some(5), None, Some(9)), [5, 9]);
        assert_eq!(frames(Some(12), None, Some(9)), [12, 12]);
        assert_eq!(frames(None, Some(12), Some(9)), [9, 12]);
        assert_eq!(frames(None, Some(3), Some(9)), [3, 3]);
        assert_eq!(frames(Some(5), Some(12), Some(90)), [5, 12]);
    }

    #[test]
    fn the_ends_cannot_be_reversed() {
        let mut draft = Draft::default();
        draft.begin(10).unwrap();
        let error = draft.end(9).unwrap_err().to_string();
        assert!(error.contains("before the first one, 10"), "{error}");
        draft.end(10).unwrap();
        let error = draft.begin(11).unwrap_err().to_string();
        assert!(error.contains("behind the last one, 10"), "{error}");
        assert_eq!(draft.frames(0), [10, 10]);
    }
}
