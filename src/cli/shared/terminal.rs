//! Standard output: text, JSON, and the lines that several commands print of a recording.

use anyhow::Context;
use std::collections::BTreeMap;
use svl::counted;
use svl::recording::DamagedPart;

/// Prints to standard output. A reader that went away (`| head`) has read enough: no error.
pub(crate) fn print(text: &str) -> anyhow::Result<()> {
    use std::io::Write;
    match std::io::stdout().lock().write_all(text.as_bytes()) {
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        result => result.context("standard output"),
    }
}

/// Prints a value as JSON.
pub(crate) fn print_json(value: &impl serde::Serialize) -> anyhow::Result<()> {
    print(&(serde_json::to_string_pretty(value)? + "\n"))
}

/// Gaps and losses that are listed one by one.
pub(crate) const LISTED: usize = 5;

/// What cannot be read of a file, a line each.
pub(crate) fn losses(losses: &[DamagedPart]) -> Vec<String> {
    let part = |DamagedPart {
                    at_byte,
                    bytes,
                    reason,
                }: &DamagedPart| match bytes {
        0 => format!("lost       at byte {at_byte}: {reason}"),
        1..1000 => format!(
            "lost       {} at byte {at_byte}: {reason}",
            counted(*bytes, "byte")
        ),
        _ => format!("lost       {} at byte {at_byte}: {reason}", size(*bytes)),
    };
    let mut lines: Vec<_> = losses.iter().take(LISTED).map(part).collect();
    if losses.len() > LISTED {
        lines.push(format!(
            "           and {} more; --json lists them",
            losses.len() - LISTED
        ));
    }
    lines
}

/// What the file's own summary promises and it does not hold.
pub(crate) fn missing(missing: &BTreeMap<String, u64>) -> Vec<String> {
    missing
        .iter()
        .map(|(topic, n)| format!("missing    {} of {topic}", counted(*n, "message")))
        .collect()
}

pub(crate) fn size(bytes: u64) -> String {
    match bytes {
        ..1_000_000 => format!("{:.1} kB", bytes as f64 / 1e3),
        1_000_000.. => format!("{:.1} MB", bytes as f64 / 1e6),
    }
}

/// Width of tables that go to a pipe or a file, columns.
const PIPED: usize = 100;
/// Narrower terminals get lines that the terminal itself breaks.
const NARROWEST: usize = 60;

/// Columns of standard output: the terminal's, or 100.
pub(crate) fn width() -> usize {
    let size = terminal_size::terminal_size_of(std::io::stdout());
    size.map_or(PIPED, |(columns, _)| usize::from(columns.0).max(NARROWEST))
}

/// Last column of the help that stands below the options, which clap does not break again.
pub(crate) const LAST_COLUMN: usize = 78;

/// `head`, and from a column on the words of `text`, broken at the last column.
pub(crate) fn wrapped(head: &str, column: usize, text: &str, last: usize) -> String {
    let mut lines = vec![format!("{head:<column$}")];
    for word in text.split(' ') {
        let line = lines.last_mut().expect("one to begin with");
        let used = line.chars().count();
        if used > column && used + 1 + word.chars().count() > last {
            lines.push(format!("{:column$}{word}", ""));
        } else {
            line.push_str(if used > column { " " } else { "" });
            line.push_str(word);
        }
    }
    lines.join("\n") + "\n"
}
