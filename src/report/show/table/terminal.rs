//! A table on the terminal: aligned, within a width, with bars and colours if the terminal has
//! them.

use super::model::{Table, TableCell};
use std::fmt::Write;
use svl_core::{printable, printable_line};

/// Style of text on a terminal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TerminalStyle {
    /// Columns.
    pub width: usize,
    /// Bars and colours; without them text is the same everywhere.
    pub is_rich: bool,
}

impl TerminalStyle {
    /// Text alone, as for a file.
    pub fn plain(width: usize) -> Self {
        Self {
            width,
            is_rich: false,
        }
    }

    /// A text as a terminal may show it: escaped, but for svl's own colours.
    pub fn printable(self, text: &str) -> String {
        let mut parts = text.split(ESCAPE);
        let own = [RIGHT, UNKNOWN, WRONG].map(color);
        let is_own =
            |part: &str| own.iter().any(|own| part.starts_with(own)) || part.starts_with(END);
        let first = printable(parts.next().unwrap_or_default());
        parts.fold(first, |text, part| {
            let escape = ESCAPE.to_string();
            let escape = if self.is_rich && is_own(part) {
                escape
            } else {
                printable(&escape)
            };
            text + &escape + &printable(part)
        })
    }
}

/// Widths of a bar, characters.
const MAX_BAR: usize = 15;
const MIN_BAR: usize = 6;

/// Longest name beside columns that leave too little room; longer ones get a line of their own.
const NAME: usize = 21;

/// Colours of right, unknown and wrong, as codes of the 256.
const RIGHT: u8 = 32;
const UNKNOWN: u8 = 245;
const WRONG: u8 = 208;

impl Table {
    /// The lines of the table without title and notes. Bars shrink first, then disappear; then
    /// optional columns, the last first. Columns that still do not fit follow in further blocks,
    /// groups undivided.
    pub fn terminal(&self, style: TerminalStyle) -> String {
        let mut table = self.clone();
        let texts = table.text_columns();
        let columns = 0..table.columns.len();
        let is_text: Vec<_> = columns.map(|i| texts.contains(&i)).collect();
        let names = table.rows.iter().map(|row| row[0].text());
        let longest = names.map(|name| name.chars().count()).max().unwrap_or(0);
        let name = longest.max(table.columns[0].head.chars().count());
        let mut bar = if style.is_rich { MAX_BAR } else { 0 };
        let excess = |table: &Self, bar: usize| {
            let width = name + table.width(1..table.columns.len(), bar);
            width.saturating_sub(style.width)
        };
        if is_text.contains(&false) {
            bar = bar.saturating_sub(excess(&table, bar));
            if bar < MIN_BAR {
                table.keep(&is_text);
            }
        }
        while excess(&table, bar) > 0
            && let Some(last) = table.columns.iter().rposition(|column| column.is_optional)
        {
            let columns = 0..table.columns.len();
            table.keep(&columns.map(|i| i != last).collect::<Vec<_>>());
        }
        table.blocks(name, bar, style)
    }

    /// The columns in as many blocks as needed.
    fn blocks(&self, name: usize, bar: usize, style: TerminalStyle) -> String {
        let all = self.columns.len();
        let fits =
            |from: usize, to: usize, name: usize| name + self.width(from..to, bar) <= style.width;
        let name = if fits(1, all, name) {
            name
        } else {
            name.min(NAME.max(self.columns[0].head.chars().count()))
        };
        let mut text = String::new();
        let mut from = 1;
        loop {
            let mut to = from;
            while to < all {
                let group = &self.columns[to].group;
                let same = |column: &&super::model::TableColumn| {
                    !group.is_empty() && column.group == *group
                };
                let next = to + self.columns[to..].iter().take_while(same).count().max(1);
                if to > from && !fits(from, next, name) {
                    break;
                }
                to = next;
            }
            if from > 1 {
                text.push('\n');
            }
            self.block(&mut text, name, from..to, bar, style);
            from = to;
            if from >= all {
                return text;
            }
        }
    }

    fn block(
        &self,
        text: &mut String,
        name: usize,
        columns: std::ops::Range<usize>,
        bar: usize,
        style: TerminalStyle,
    ) {
        let mut lines = Vec::new();
        let groups = &self.columns[columns.clone()];
        if groups.iter().any(|column| !column.group.is_empty()) {
            let mut line = " ".repeat(name);
            let mut at = columns.start;
            for group in groups.chunk_by(|a, b| a.group == b.group) {
                let span = self.width(at..at + group.len(), bar) - self.gap(at);
                let words = &group[0].group;
                let blank = span.saturating_sub(words.chars().count());
                // Over numbers, which are at the right of their columns.
                let before = " ".repeat(self.gap(at) + blank.div_ceil(2));
                let _ = write!(line, "{before}{words}{}", " ".repeat(blank / 2));
                at += group.len();
            }
            lines.push(line);
        }
        let first = &self.columns[0].head;
        let mut line = format!("{first:name$}");
        for i in columns.clone() {
            let (gap, width) = (self.gap(i), self.column_width(i, bar));
            let head = &self.columns[i].head;
            line.push_str(&" ".repeat(gap));
            line.push_str(&aligned(head, width, self.columns[i].is_text));
        }
        lines.push(line);
        for row in &self.rows {
            let label = row[0].text();
            let mut line = format!("{label:name$}");
            if label.chars().count() > name {
                lines.push(std::mem::replace(&mut line, " ".repeat(name)));
            }
            for i in columns.clone() {
                line.push_str(&" ".repeat(self.gap(i)));
                let width = self.column_width(i, bar);
                let is_left = self.columns[i].is_text;
                line.push_str(&cell(&row[i], width, is_left, style));
            }
            lines.push(line);
        }
        for line in lines {
            text.push_str(line.trim_end());
            text.push('\n');
        }
    }

    /// Blanks before a column: two between groups, one within.
    fn gap(&self, i: usize) -> usize {
        let [before, own] = [i - 1, i].map(|i| self.columns[i].group.as_str());
        2 - usize::from(!own.is_empty() && before == own)
    }

    fn column_width(&self, i: usize, bar: usize) -> usize {
        let cells = self.rows.iter().map(|row| match &row[i] {
            TableCell::Bar { .. } => bar,
            other => other.text().chars().count(),
        });
        let head = self.columns[i].head.chars().count();
        let own = cells.chain([head]).max().unwrap_or(0);
        // A group's words need room: its last column gives it.
        let group = &self.columns[i].group;
        let is_last = self.columns.get(i + 1);
        let is_last = is_last.is_none_or(|next| next.group != *group);
        if group.is_empty() || !is_last {
            return own;
        }
        let mut before = self.columns[..i].iter();
        let first = before.rposition(|column| column.group != *group);
        let first = first.map_or(0, |before| before + 1);
        let others = (first..i)
            .map(|i| self.column_width(i, bar) + 1)
            .sum::<usize>();
        own.max(group.chars().count().saturating_sub(others))
    }

    /// Characters of columns with the gaps before them.
    fn width(&self, columns: std::ops::Range<usize>, bar: usize) -> usize {
        let columns = columns.map(|i| self.gap(i) + self.column_width(i, bar));
        columns.sum()
    }
}

fn aligned(text: &str, width: usize, is_left: bool) -> String {
    if is_left {
        format!("{text:<width$}")
    } else {
        format!("{text:>width$}")
    }
}

fn cell(cell: &TableCell, width: usize, is_left: bool, style: TerminalStyle) -> String {
    match cell {
        TableCell::Bar { right, wrong } => bar(*right, *wrong, width),
        TableCell::Alert(text) if style.is_rich => {
            let text = aligned(text, width, is_left);
            // Blanks at the end of a line are removed.
            let words = text.trim_end();
            format!("{}{}", colored(words, WRONG), &text[words.len()..])
        }
        other => aligned(&other.text(), width, is_left),
    }
}

fn colored(text: &str, code: u8) -> String {
    format!("{ESCAPE}{}{text}{ESCAPE}{END}", color(code))
}

/// Begin of a terminal's codes.
const ESCAPE: char = '\u{1b}';
/// End of a colour, behind [`ESCAPE`].
const END: &str = "[0m";

/// Begin of a colour, behind [`ESCAPE`].
fn color(code: u8) -> String {
    format!("[38;5;{code}m")
}

/// Right, unknown and wrong, rounded so that their lengths add up.
fn bar(right: f64, wrong: f64, width: usize) -> String {
    let length = width as f64;
    let wrong = (wrong * length).round() as usize;
    let right = ((right * length).round() as usize).min(width - wrong.min(width));
    let unknown = width.saturating_sub(right + wrong);
    let parts = [
        ("█", right, RIGHT),
        ("░", unknown, UNKNOWN),
        ("▒", wrong, WRONG),
    ];
    let parts = parts.into_iter().filter(|(_, length, _)| *length > 0);
    let parts = parts.map(|(block, length, code)| colored(&block.repeat(length), code));
    parts.collect()
}

/// A text, escaped, in lines that fit, all but the first behind blanks.
pub fn wrapped(text: &str, indent: usize, width: usize) -> String {
    let mut lines = vec![String::new()];
    // A number and its unit are one word.
    let joined = printable_line(text)
        .replace(" %", "\u{a0}%")
        .replace(" ms", "\u{a0}ms");
    for word in joined.split(' ') {
        let line = lines.last_mut().expect("one to begin with");
        if line.is_empty() {
            line.push_str(word);
        } else if line.chars().count() + 1 + word.chars().count() > width {
            lines.push(format!("{:indent$}{word}", ""));
        } else {
            line.push(' ');
            line.push_str(word);
        }
    }
    lines.join("\n").replace('\u{a0}', " ") + "\n"
}
