//! Tables beside those of the algorithms' metrics: drives, stress. One form for terminal, Markdown
//! and page.

use serde::Serialize;
use std::fmt::{Display, Formatter, Result};

/// A table of texts.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct SideTable {
    pub(super) title: String,
    /// Head of the first column.
    pub(super) first: &'static str,
    /// Heads of the others.
    pub(super) heads: Vec<String>,
    /// The first column, and the others.
    pub(super) lines: Vec<(String, Vec<String>)>,
    /// Terms and meanings, below it.
    pub(super) notes: Vec<(&'static str, String)>,
}

impl Display for SideTable {
    /// As many columns abreast as fit into the width.
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let total = f.width().unwrap_or(super::text::WIDTH);
        let names = self.lines.iter().map(|(name, _)| name.as_str());
        let name = names.chain([self.first]).map(|n| n.chars().count()).max();
        let name = name.unwrap_or_default().min(24);
        let width = |i: usize| {
            let cells = self.lines.iter().map(|(_, cells)| cells[i].as_str());
            let widths = cells.chain([self.heads[i].as_str()]);
            widths.map(|cell| cell.chars().count()).max().unwrap_or(0)
        };
        let widths: Vec<_> = (0..self.heads.len()).map(width).collect();
        let mut from = 0;
        while from < widths.len() {
            let mut end = name;
            let fits = widths[from..].iter().take_while(|&&width| {
                end += 2 + width;
                end <= total
            });
            let to = from + fits.count().max(1);
            let aligned = |cells: &[String]| {
                let cells = cells[from..to].iter().zip(&widths[from..to]);
                let cells = cells.map(|(cell, width)| format!("  {cell:>width$}"));
                cells.collect::<String>()
            };
            writeln!(f, "{:name$}{}", self.first, aligned(&self.heads))?;
            for (label, cells) in &self.lines {
                super::text::label(f, label, name)?;
                writeln!(f, "{}", aligned(cells))?;
            }
            writeln!(f)?;
            from = to;
        }
        let notes = self.notes.iter();
        let mut notes = notes.map(|(term, meaning)| format!("{term}: {meaning}"));
        notes.try_for_each(|note| super::text::wrapped(f, &note, total))
    }
}

impl SideTable {
    /// As a section of a Markdown page.
    pub(super) fn markdown(&self, page: &mut String) {
        use super::markdown::{escape, table};
        page.push_str(&format!("\n## {}\n", escape(&self.title)));
        let heads = [self.first.to_owned()].into_iter();
        let lines = self.lines.iter().map(|(name, cells)| {
            let cells = cells.iter().map(|cell| escape(cell));
            std::iter::once(escape(name)).chain(cells).collect()
        });
        table(
            page,
            heads.chain(self.heads.iter().cloned()).collect(),
            lines,
        );
        page.push('\n');
        for (term, meaning) in &self.notes {
            page.push_str(&format!("- {}: {}\n", escape(term), escape(meaning)));
        }
    }
}
