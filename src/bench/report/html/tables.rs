//! The tables of the page: one wide table, and for narrow screens one per group of its columns.

use super::super::summary::Summary;
use super::super::words::{CheckpointCell, Checkpoints, Column, lines, notes, percent, shown};
use serde::Serialize;

#[derive(Serialize)]
pub(super) struct AlgorithmTableView<'a> {
    label: &'static str,
    groups: Vec<GroupView>,
    /// The groups of the narrow tables, which leave no column without a title.
    narrow: Vec<GroupView>,
    /// Name and cells.
    lines: Vec<(&'a str, Vec<CellView>)>,
    notes: Vec<(&'static str, String)>,
}

/// Neighbouring columns.
#[derive(Clone, Serialize)]
struct GroupView {
    title: String,
    /// One per column; empty where the title is head enough.
    heads: Vec<&'static str>,
    /// Its columns of the line, `from..to`.
    from: usize,
    to: usize,
}

#[derive(Serialize)]
struct CellView {
    /// Verdicts, each passed or failed, before the text.
    marks: Vec<bool>,
    text: String,
    /// In words where there are marks.
    words: String,
}

impl<'a> AlgorithmTableView<'a> {
    /// A line per algorithm; nothing without pairs.
    pub(super) fn from_columns(
        label: &'static str,
        columns: Vec<Column>,
        summary: &'a Summary,
    ) -> Option<Self> {
        let columns = shown(columns, summary);
        let plain = |text| CellView {
            marks: Vec::new(),
            text,
            words: String::new(),
        };
        let lines = lines(&columns, summary)
            .map(|(name, cells)| (name, cells.into_iter().map(plain).collect()));
        let lines: Vec<_> = lines.collect();
        (!lines.is_empty()).then(|| Self {
            label,
            groups: groups(&columns, |a, b| a.group == b.group),
            // Columns without a group would be a table without a title: they join the next group.
            narrow: groups(&columns, |a, b| a.group == b.group || a.group.is_empty()),
            lines,
            notes: notes(&columns, summary),
        })
    }

    /// A line per algorithm, a group per checkpoint; nothing without checkpoints.
    pub(super) fn from_checkpoints(summary: &'a Summary) -> Option<Self> {
        let Checkpoints { heads, lines } = Checkpoints::from_summary(summary)?;
        let group = |(i, title)| GroupView {
            title,
            heads: Vec::new(),
            from: i,
            to: i + 1,
        };
        let groups: Vec<_> = heads.into_iter().enumerate().map(group).collect();
        let lines = lines
            .into_iter()
            .map(|(algorithm, cells)| (algorithm, cells.into_iter().map(CellView::new).collect()));
        Some(Self {
            label: "Checkpoints per algorithm",
            narrow: groups.clone(),
            groups,
            lines: lines.collect(),
            notes: Vec::new(),
        })
    }
}

/// Neighbours that belong `together`, under the title of the last.
fn groups(columns: &[Column], together: impl Fn(&Column, &Column) -> bool) -> Vec<GroupView> {
    let mut from = 0;
    let group = |group: &[Column]| {
        let to = from + group.len();
        let title = group.last().map_or("", |column| column.group).to_owned();
        let view = GroupView {
            title,
            heads: group.iter().map(|column| column.head).collect(),
            from,
            to,
        };
        from = to;
        view
    };
    columns.chunk_by(|a, b| together(a, b)).map(group).collect()
}

impl CellView {
    fn new(cell: CheckpointCell) -> Self {
        match cell {
            CheckpointCell::Seen { best, worst, share } => {
                let word = |passed| if passed { "passes" } else { "fails" };
                let share = percent(Some(share));
                let words = format!(
                    "best frame {}, worst frame {}, {share} % pass",
                    word(best),
                    word(worst)
                );
                Self {
                    marks: vec![best, worst],
                    text: share,
                    words,
                }
            }
            CheckpointCell::All {
                seen,
                best,
                worst,
                share,
            } => {
                let share = percent(Some(share));
                let words = format!(
                    "best frames of {best} of {seen} checkpoints pass, worst of {worst}, {share} \
                     % in all"
                );
                Self {
                    marks: Vec::new(),
                    text: share,
                    words,
                }
            }
            CheckpointCell::NeverSeen => Self {
                marks: Vec::new(),
                text: cell.to_string(),
                words: String::new(),
            },
        }
    }
}
