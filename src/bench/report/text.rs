//! A summary on the terminal: plain text, aligned, broken at the width that the caller formats it
//! with (`{summary:80}`), or at 100 columns.

use super::side_table::SideTable;
use super::summary::Summary;
use super::words::{Checkpoints, Column, VERDICTS, columns, failed, lines, notes, shown};
use std::fmt::{Display, Formatter, Result};

/// Width where none is given, as in a pipe.
const WIDTH: usize = 100;

/// Longest name that stands beside its checkpoints.
const NAME: usize = 24;

impl Display for Summary {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        if let Some(why) = &self.ending.incomplete {
            writeln!(f, "INCOMPLETE: {why}\n")?;
        }
        if let Some(note) = self.ending.note() {
            writeln!(f, "Not scored: {note}\n")?;
        }
        if self.algorithms.is_empty() {
            return match failed(self) {
                Some(failed) => writeln!(f, "No pairs. Failed: {failed}"),
                None => writeln!(f, "No pairs."),
            };
        }
        let columns = shown(columns(), self);
        let total = f.width().unwrap_or(WIDTH);
        let blocks = blocks(&columns, total);
        // One width of names for all blocks, so that they line up.
        let widest = blocks
            .iter()
            .map(|block| width(block))
            .max()
            .unwrap_or_default();
        let failed = self.failed.iter().map(|failed| failed.algorithm.as_str());
        let names = self.algorithms.iter().map(|a| a.algorithm.as_str());
        let names = names.chain(failed);
        let name = name_width(names, total.saturating_sub(widest));
        let caution = self.caution();
        for block in blocks {
            if let Some(caution) = &caution {
                wrapped(f, caution, total)?;
            }
            self.block(f, name, block)?;
        }
        notes(&columns, self)
            .iter()
            .try_for_each(|(term, meaning)| wrapped(f, &format!("{term}: {meaning}"), total))?;
        if let Some(table) = Checkpoints::from_summary(self) {
            if let Some(caution) = &caution {
                writeln!(f)?;
                wrapped(f, caution, total)?;
            }
            checkpoints(&table, f, total)?;
        }
        let tables = self.side_tables();
        let mut tables = tables.iter();
        tables.try_for_each(|table| write!(f, "\n{}\n{table:total$}", table.title))
    }
}

impl Summary {
    /// A line per algorithm with these columns.
    fn block(&self, f: &mut Formatter<'_>, name: usize, columns: &[Column]) -> Result {
        writeln!(f, "{}", head_of_groups(name, columns).trim_end())?;
        write!(f, "{:name$}", "algorithm")?;
        for (i, column) in columns.iter().enumerate() {
            let width = gap(columns, i) + column.width;
            write!(f, "{:>width$}", column.head)?;
        }
        writeln!(f)?;
        for (algorithm, cells) in lines(columns, self) {
            label(f, algorithm, name)?;
            for (i, (column, cell)) in columns.iter().zip(cells).enumerate() {
                let width = gap(columns, i) + column.width;
                write!(f, "{cell:>width$}")?;
            }
            writeln!(f)?;
        }
        writeln!(f)
    }
}

impl Display for SideTable {
    /// As many columns abreast as fit into the width.
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let total = f.width().unwrap_or(WIDTH);
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
            for (title, cells) in &self.lines {
                label(f, title, name)?;
                writeln!(f, "{}", aligned(cells))?;
            }
            writeln!(f)?;
            from = to;
        }
        let notes = self.notes.iter();
        let mut notes = notes.map(|(term, meaning)| format!("{term}: {meaning}"));
        notes.try_for_each(|note| wrapped(f, &note, total))
    }
}

/// Blanks before a column: two between groups, one within.
fn gap(columns: &[Column], i: usize) -> usize {
    let begins_group = i == 0 || columns[i - 1].group != columns[i].group;
    1 + usize::from(begins_group)
}

fn width(columns: &[Column]) -> usize {
    let columns = columns
        .iter()
        .enumerate()
        .map(|(i, column)| gap(columns, i) + column.width);
    columns.sum()
}

/// The columns in blocks that fit beside the shortest names, groups undivided.
fn blocks(columns: &[Column], total: usize) -> Vec<&[Column]> {
    let (mut blocks, mut begin, mut end) = (Vec::new(), 0, 0);
    for group in columns.chunk_by(|a, b| a.group == b.group) {
        let next = end + group.len();
        if end > begin && width(&columns[begin..next]) + "algorithm".len() > total {
            blocks.push(&columns[begin..end]);
            begin = end;
        }
        end = next;
    }
    blocks.push(&columns[begin..end]);
    blocks
}

/// Writes a text in lines that fit, all but the first indented.
fn wrapped(f: &mut Formatter<'_>, text: &str, total: usize) -> Result {
    let mut line = String::new();
    for word in text.split(' ') {
        if line.chars().count() + 1 + word.chars().count() > total {
            writeln!(f, "{line}")?;
            line = " ".to_owned();
        }
        if !line.is_empty() {
            line.push(' ');
        }
        line.push_str(word);
    }
    writeln!(f, "{line}")
}

/// Width of the column of names: the longest, where there is room.
fn name_width<'a>(names: impl Iterator<Item = &'a str>, room: usize) -> usize {
    let longest = names
        .map(|name| name.chars().count())
        .max()
        .unwrap_or_default();
    longest.min(room).max("algorithm".len())
}

/// A name too long for its column gets a line of its own: shortened it could be ambiguous.
fn label(f: &mut Formatter<'_>, name: &str, width: usize) -> Result {
    if name.chars().count() > width {
        write!(f, "{name}\n{:width$}", "")
    } else {
        write!(f, "{name:width$}")
    }
}

/// The line above the heads, a group's word centred over its columns.
fn head_of_groups(name: usize, columns: &[Column]) -> String {
    let mut line = " ".repeat(name);
    for group in columns.chunk_by(|a, b| a.group == b.group) {
        let span = group.iter().map(|column| column.width).sum::<usize>() + group.len() - 1;
        line.push_str(&format!("  {:^span$}", group[0].group));
    }
    line
}

/// The table of checkpoints, as many abreast as fit.
fn checkpoints(table: &Checkpoints<'_>, f: &mut Formatter<'_>, total: usize) -> Result {
    let name = name_width(table.lines.iter().map(|(algorithm, _)| *algorithm), NAME);
    let lines: Vec<Vec<String>> = table
        .lines
        .iter()
        .map(|(_, cells)| cells.iter().map(ToString::to_string).collect())
        .collect();
    let longest = |i: usize| {
        lines
            .iter()
            .map(|line| &line[i])
            .chain([&table.heads[i]])
            .map(|t| t.chars().count())
            .max()
    };
    let widths: Vec<_> = (0..table.heads.len())
        .map(|i| longest(i).unwrap_or_default())
        .collect();
    let aligned = |texts: &[String], from: usize| {
        let texts = texts
            .iter()
            .zip(&widths[from..])
            .map(|(text, width)| format!("  {text:<width$}"));
        texts.collect::<String>().trim_end().to_owned()
    };
    let mut from = 0;
    while from < widths.len() {
        let mut end = name;
        let fits = widths[from..].iter().take_while(|&&width| {
            end += 2 + width;
            end <= total
        });
        let to = from + fits.count().max(1);
        writeln!(
            f,
            "\n{:name$}{}",
            "algorithm",
            aligned(&table.heads[from..to], from)
        )?;
        for ((algorithm, _), cells) in table.lines.iter().zip(&lines) {
            label(f, algorithm, name)?;
            writeln!(f, "{}", aligned(&cells[from..to], from))?;
        }
        from = to;
    }
    writeln!(f)?;
    wrapped(f, VERDICTS, total)
}
