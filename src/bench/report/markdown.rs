//! A summary as Markdown.

use super::side_table::SideTable;
use super::summary::Summary;
use super::words::{
    CheckpointCell, Checkpoints, Column, VERDICTS, columns, lines, notes, shown, speed_columns,
};

impl Summary {
    /// The summary as a Markdown page under `title`.
    pub fn markdown(&self, title: &str) -> String {
        let mut page = format!("# {}\n", escape(title));
        if let Some(why) = &self.ending.incomplete {
            page.push_str(&format!("\n**Incomplete:** {}\n", escape(why)));
        }
        if let Some(note) = self.ending.note() {
            page.push_str(&format!("\nNot scored: {}\n", escape(&note)));
        }
        let caution = self
            .caution()
            .map(|words| format!("\n**{}**\n", escape(&words)));
        let caution = caution.unwrap_or_default();
        page.push_str(&caution);
        self.algorithms_markdown(&mut page, columns());
        if let Some(checkpoints) = Checkpoints::from_summary(self) {
            page.push_str(&format!("\n## Checkpoints\n{caution}"));
            checkpoints_markdown(&mut page, &checkpoints);
        }
        for table in self.side_tables() {
            table.markdown(&mut page);
        }
        page.push_str("\n## Speed\n");
        self.algorithms_markdown(&mut page, speed_columns());
        if !self.warnings.is_empty() {
            page.push_str("\n## Warnings\n\n");
        }
        for warning in &self.warnings {
            page.push_str(&format!("- {}\n", escape(warning)));
        }
        page
    }

    /// The checkpoints' verdicts alone, under `title`; the whole summary where there are no
    /// checkpoints.
    pub fn verdicts_markdown(&self, title: &str) -> String {
        let Some(checkpoints) = Checkpoints::from_summary(self) else {
            return self.markdown(title);
        };
        let mut page = format!("# {}\n", escape(title));
        checkpoints_markdown(&mut page, &checkpoints);
        page
    }

    fn algorithms_markdown(&self, page: &mut String, columns: Vec<Column>) {
        let columns = shown(columns, self);
        let heads = columns.iter().map(|c| match c.group {
            "" => c.head.to_owned(),
            group => format!("{group}: {}", c.head),
        });
        let lines = lines(&columns, self)
            .map(|(name, cells)| std::iter::once(escape(name)).chain(cells).collect());
        table(
            page,
            std::iter::once("algorithm".to_owned())
                .chain(heads)
                .collect(),
            lines,
        );
        page.push('\n');
        for (term, meaning) in notes(&columns, self) {
            page.push_str(&format!("- {}: {}\n", escape(term), escape(&meaning)));
        }
    }
}

impl SideTable {
    /// As a section of a Markdown page.
    pub(super) fn markdown(&self, page: &mut String) {
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

fn checkpoints_markdown(page: &mut String, checkpoints: &Checkpoints<'_>) {
    let heads = std::iter::once("algorithm".to_owned())
        .chain(checkpoints.heads.iter().map(|head| escape(head)));
    // Blanks align on the terminal alone.
    let plain = |cell: &CheckpointCell| {
        cell.to_string()
            .split_whitespace()
            .collect::<Vec<_>>()
            .join(" ")
    };
    let lines = checkpoints.lines.iter().map(|(algorithm, cells)| {
        std::iter::once(escape(algorithm))
            .chain(cells.iter().map(plain))
            .collect()
    });
    table(page, heads.collect(), lines);
    page.push_str(&format!("\n{VERDICTS}.\n"));
}

/// Appends a table whose first column is text and whose others are numbers.
fn table(page: &mut String, heads: Vec<String>, lines: impl Iterator<Item = Vec<String>>) {
    let rule = format!("|---|{}\n", "---:|".repeat(heads.len() - 1));
    page.push_str(&format!("\n| {} |\n{rule}", heads.join(" | ")));
    lines.for_each(|line| page.push_str(&format!("| {} |\n", line.join(" | "))));
}

/// Keeps text from being read as Markdown or HTML.
fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            // A backslash does not keep < from beginning an HTML tag.
            '<' => escaped.push_str("&lt;"),
            '\\' | '`' | '*' | '_' | '[' | ']' | '|' | '#' | '>' => escaped.extend(['\\', c]),
            '\n' | '\r' => escaped.push(' '),
            c => escaped.push(c),
        }
    }
    escaped
}
