//! A table as Markdown.

use super::model::Table;
use svl_core::printable;

impl Table {
    /// The table with its notes as a list below; the title is the caller's.
    pub fn markdown(&self) -> String {
        let shown = self.text_columns();
        let head = |i: &usize| {
            let column = &self.columns[*i];
            let both = [column.group.as_str(), column.head.as_str()];
            let words: Vec<_> = both.into_iter().filter(|word| !word.is_empty()).collect();
            escape(&words.join(": "))
        };
        let rule = |i: &usize| {
            if self.columns[*i].is_text {
                "---"
            } else {
                "---:"
            }
        };
        let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
        let mut text = line(shown.iter().map(head).collect());
        let rules: Vec<_> = shown.iter().map(rule).collect();
        text.push_str(&format!("|{}|\n", rules.join("|")));
        for row in &self.rows {
            let cells = shown.iter().map(|i| escape(&row[*i].text()));
            text.push_str(&line(cells.collect()));
        }
        if !self.notes.is_empty() {
            text.push('\n');
        }
        for (term, meaning) in &self.notes {
            text.push_str(&format!("- {}: {}\n", escape(term), escape(meaning)));
        }
        text
    }
}

/// `escape` for a text with code in backticks.
pub fn escape_prose(text: &str) -> String {
    let parts = text.split('`').enumerate().map(|(i, part)| match i % 2 {
        0 => escape(part),
        _ => format!("`{}`", printable(part)),
    });
    parts.collect()
}

/// Keeps text from being read as Markdown or HTML, or as control of a terminal.
pub fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in printable(text).chars() {
        match c {
            // A backslash does not keep < from beginning an HTML tag.
            '<' => escaped.push_str("&lt;"),
            '\\' | '`' | '*' | '_' | '[' | ']' | '|' | '#' | '>' => escaped.extend(['\\', c]),
            '\n' => escaped.push(' '),
            c => escaped.push(c),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_control_neither_markdown_nor_a_terminal() {
        assert_eq!(escape("a_b\n<c>"), "a\\_b &lt;c\\>");
        assert_eq!(escape("a\u{1b}[2J"), "a\\\\u001b\\[2J");
        assert_eq!(escape_prose("*`a_\u{202e}`"), "\\*`a_\\u202e`");
    }
}
