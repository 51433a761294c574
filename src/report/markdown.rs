//! A summary as Markdown.

use super::summary::Summary;
use super::words::{COLUMNS, Checkpoints, NOTES, pass, percent, totals};

impl Summary {
    /// The summary as a Markdown page under `title`.
    pub fn markdown(&self, title: &str) -> String {
        let mut page = format!("# {}\n", escape(title));
        if let Some(why) = &self.incomplete {
            page.push_str(&format!("\n**Incomplete:** {}\n", escape(why)));
        }
        let heads = COLUMNS.iter().map(|c| match c.group {
            "" => c.head.to_owned(),
            group => format!("{group}: {}", c.head),
        });
        let lines = self.algorithms.iter().map(|a| {
            let cells = COLUMNS.iter().map(|column| (column.cell)(a));
            std::iter::once(escape(&a.algorithm)).chain(cells).collect()
        });
        table(&mut page, std::iter::once("algorithm".to_owned()).chain(heads).collect(), lines);
        page.push('\n');
        for (term, meaning) in NOTES {
            page.push_str(&format!("- {}: {}\n", escape(term), escape(meaning)));
        }
        if !self.checkpoints.is_empty() {
            page.push_str("\n## Checkpoints\n");
            self.checkpoints_markdown(&mut page);
        }
        page
    }

    /// The checkpoints' verdicts alone, under `title`; the whole summary where there are no checkpoints.
    pub fn verdicts_markdown(&self, title: &str) -> String {
        if self.checkpoints.is_empty() {
            return self.markdown(title);
        }
        let mut page = format!("# {}\n", escape(title));
        self.checkpoints_markdown(&mut page);
        page
    }

    fn checkpoints_markdown(&self, page: &mut String) {
        let checkpoints = Checkpoints::of(self);
        let heads = checkpoints.algorithms.iter().flat_map(|a| ["best", "worst", "frames, %"].map(|h| (a, h)));
        let heads = heads.map(|(algorithm, head)| format!("{} {head}", escape(algorithm)));
        let lines = checkpoints.lines.iter().map(|line| {
            let cells = line.cells.iter().flat_map(|cell| {
                let best = pass(cell.and_then(|c| c.best_passed));
                let worst = pass(cell.and_then(|c| c.worst_passed));
                [best.to_owned(), worst.to_owned(), percent(cell.and_then(|c| c.share()))]
            });
            std::iter::once(escape(&line.name)).chain(cells).collect()
        });
        let sums = checkpoints.algorithms.iter().flat_map(|a| totals(self, a));
        let sums = std::iter::once("all".to_owned()).chain(sums).collect();
        table(page, std::iter::once("checkpoint".to_owned()).chain(heads).collect(), lines.chain([sums]));
        page.push_str("\nBest and worst frame of all runs, and the share of frames in which the checkpoint passes.\n");
    }
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
            '<' => escaped.push_str("&lt;"),
            '\\' | '`' | '*' | '_' | '[' | ']' | '|' | '#' | '>' => escaped.extend(['\\', c]),
            '\n' | '\r' => escaped.push(' '),
            c => escaped.push(c),
        }
    }
    escaped
}
