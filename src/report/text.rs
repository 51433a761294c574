//! A summary on the terminal: plain text, aligned, at most 100 columns.

use super::summary::Summary;
use super::words::{COLUMNS, Checkpoints, Column, NOTES, pass, percent, totals};
use std::fmt::{Display, Formatter, Result};

const WIDTH: usize = 100;

/// The columns, each with the gap before it: two blanks between groups, one within.
fn columns() -> impl Iterator<Item = (usize, &'static Column)> {
    COLUMNS.iter().enumerate().map(|(i, column)| {
        let begins = i == 0 || COLUMNS[i - 1].group != column.group;
        (if begins { 2 } else { 1 }, column)
    })
}

impl Display for Summary {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        if let Some(why) = &self.incomplete {
            writeln!(f, "INCOMPLETE: {why}\n")?;
        }
        if self.algorithms.is_empty() {
            return writeln!(f, "No pairs.");
        }
        let numbers: usize = columns().map(|(gap, column)| gap + column.width).sum();
        let room = WIDTH - numbers;
        let longest = self.algorithms.iter().map(|a| a.algorithm.chars().count()).max().unwrap_or_default();
        let name = longest.max("algorithm".len()).min(room);

        writeln!(f, "{}", head_of_groups(name).trim_end())?;
        write!(f, "{:name$}", "algorithm")?;
        for (gap, column) in columns() {
            write!(f, "{:gap$}{:>width$}", "", column.head, width = column.width)?;
        }
        writeln!(f)?;
        for algorithm in &self.algorithms {
            // A name too long for its column stands on a line of its own: cut short it could be mistaken for another.
            match algorithm.algorithm.chars().count() {
                n if n > name => write!(f, "{}\n{:name$}", algorithm.algorithm, "")?,
                _ => write!(f, "{:name$}", algorithm.algorithm)?,
            }
            for (gap, column) in columns() {
                write!(f, "{:gap$}{:>width$}", "", (column.cell)(algorithm), width = column.width)?;
            }
            writeln!(f)?;
        }
        writeln!(f)?;
        NOTES.iter().try_for_each(|(term, meaning)| writeln!(f, "{term}: {meaning}"))?;
        checkpoints(self, f)
    }
}

/// The line above the heads, a group's word centred over its columns.
fn head_of_groups(name: usize) -> String {
    let mut line = " ".repeat(name);
    for group in COLUMNS.chunk_by(|a, b| a.group == b.group) {
        let span = group.iter().map(|column| column.width).sum::<usize>() + group.len() - 1;
        line.push_str(&format!("  {:^span$}", group[0].group));
    }
    line
}

/// The table of checkpoints, as many algorithms abreast as fit.
fn checkpoints(summary: &Summary, f: &mut Formatter<'_>) -> Result {
    const HEADS: &str = "best worst frames, %";
    let table = Checkpoints::of(summary);
    let widest = |texts: &mut dyn Iterator<Item = &str>| texts.map(|t| t.chars().count()).max().unwrap_or_default();
    let name = widest(&mut table.lines.iter().map(|line| line.name.as_str())).max("checkpoint".len());
    let block = widest(&mut table.algorithms.iter().copied()).max(HEADS.len());
    let abreast = (WIDTH.saturating_sub(name) / (block + 2)).max(1);
    let cells =
        |best: &str, worst: &str, share: &str| format!("  {:<block$}", format!("{best:>4} {worst:>5} {share:>9}"));

    for (i, algorithms) in table.algorithms.chunks(abreast).enumerate() {
        let labels: String = algorithms.iter().map(|a| format!("  {a:<block$}")).collect();
        let heads = format!("  {HEADS:<block$}").repeat(algorithms.len());
        writeln!(f, "\n{:name$}{}", "", labels.trim_end())?;
        writeln!(f, "{:name$}{}", "checkpoint", heads.trim_end())?;
        for line in &table.lines {
            let here = &line.cells[i * abreast..][..algorithms.len()];
            let text: String = here
                .iter()
                .map(|cell| {
                    let [best, worst] = [cell.and_then(|c| c.best_passed), cell.and_then(|c| c.worst_passed)].map(pass);
                    cells(best, worst, &percent(cell.and_then(|c| c.share())))
                })
                .collect();
            writeln!(f, "{:name$}{}", line.name, text.trim_end())?;
        }
        let text: String = algorithms
            .iter()
            .map(|algorithm| {
                let [best, worst, share] = totals(summary, algorithm);
                cells(&best, &worst, &share)
            })
            .collect();
        writeln!(f, "{:name$}{}", "all", text.trim_end())?;
    }
    Ok(())
}
