//! A table in LaTeX, for the package booktabs.

use super::model::{Table, TableCell};

impl Table {
    /// The table as a `tabular` of booktabs, without a float around it. Bars are left out; marks of
    /// checkpoints are the per cent that pass.
    pub fn latex(&self) -> String {
        let shown = self.text_columns();
        let columns = || shown.iter().map(|&i| &self.columns[i]);
        let forms = columns().map(|column| if column.is_text { 'l' } else { 'r' });
        let mut text = format!(
            "\\begin{{tabular}}{{{}}}\n\\toprule\n",
            forms.collect::<String>()
        );
        let all: Vec<_> = columns().collect();
        if all.iter().any(|column| !column.group.is_empty()) {
            let (mut heads, mut rules, mut at) = (Vec::new(), String::new(), 1);
            for group in all.chunk_by(|a, b| !a.group.is_empty() && a.group == b.group) {
                let (span, words) = (group.len(), escape(&group[0].group));
                heads.push(format!("\\multicolumn{{{span}}}{{c}}{{{words}}}"));
                if !words.is_empty() {
                    rules.push_str(&format!("\\cmidrule(lr){{{at}-{}}}", at + span - 1));
                }
                at += span;
            }
            text.push_str(&format!("{} \\\\\n{rules}\n", heads.join(" & ")));
        }
        let heads: Vec<_> = columns().map(|column| escape(&column.head)).collect();
        text.push_str(&format!("{} \\\\\n\\midrule\n", heads.join(" & ")));
        for row in &self.rows {
            let cells: Vec<_> = shown.iter().map(|&i| cell(&row[i])).collect();
            text.push_str(&format!("{} \\\\\n", cells.join(" & ")));
        }
        text + "\\bottomrule\n\\end{tabular}\n"
    }
}

fn cell(cell: &TableCell) -> String {
    match cell {
        TableCell::Marks(shares) => {
            let percent = |share: &Option<f64>| {
                share.map_or("--".to_owned(), |s| format!("{:.0}", 100.0 * s))
            };
            shares.iter().map(percent).collect::<Vec<_>>().join(" ")
        }
        other => escape(&other.text()),
    }
}

/// Keeps text from being read as commands.
fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => escaped.extend(['\\', c]),
            '\\' => escaped.push_str("\\textbackslash{}"),
            '~' => escaped.push_str("\\textasciitilde{}"),
            '^' => escaped.push_str("\\textasciicircum{}"),
            '<' => escaped.push_str("\\textless{}"),
            '>' => escaped.push_str("\\textgreater{}"),
            '–' => escaped.push_str("--"),
            c => escaped.push(c),
        }
    }
    escaped
}
