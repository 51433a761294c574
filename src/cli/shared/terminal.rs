//! Standard output: text, JSON, and the lines that several commands print of a recording. Warnings
//! on standard error.

use anyhow::Context;
use parking_lot::Mutex;
use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, IsTerminal, Write};
use std::path::Path;
use svl::counted;
use svl::recording::DamagedPart;
use svl::report::table::TerminalStyle;
use svl::sink::report_runs;

/// Prints to standard output. A reader that went away (`| head`) has read enough: no error.
pub(crate) fn print(text: &str) -> anyhow::Result<()> {
    match io::stdout().lock().write_all(text.as_bytes()) {
        Err(e) if e.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        result => result.context("standard output"),
    }
}

/// Prints a line to standard error. Does nothing if that is closed.
pub(crate) fn print_error(line: impl std::fmt::Display) {
    let _ = writeln!(io::stderr(), "{line}");
}

/// Prints a value as JSON.
pub(crate) fn print_json(value: &impl serde::Serialize) -> anyhow::Result<()> {
    print(&(serde_json::to_string_pretty(value)? + "\n"))
}

/// Target of warnings: standard error, later where a tool has the screen.
pub(crate) struct Warnings;

/// The warnings so far, a line each, also those that `--quiet` does not print.
pub(crate) struct WarningLog;

static WARNED: Mutex<Warned> = Mutex::new(Warned {
    text: String::new(),
    part: 0,
});

/// The lines of warnings: each once in a part.
struct Warned {
    text: String,
    /// Beginning of the last part.
    part: usize,
}

/// Warnings on standard error.
static WRITTEN: Mutex<WrittenOnce> = Mutex::new(WrittenOnce(BTreeSet::new()));

/// Texts that were written, each of which is written once.
struct WrittenOnce(BTreeSet<Vec<u8>>);

/// Warnings that are remembered; later ones may be written twice.
const MAX_REMEMBERED: usize = 1000;

impl WrittenOnce {
    /// True at the first call with this text.
    fn is_new(&mut self, text: &[u8]) -> bool {
        self.0.len() >= MAX_REMEMBERED || self.0.insert(text.to_owned())
    }
}

impl WarningLog {
    /// All warnings so far; one that was given in several parts is there several times.
    pub(crate) fn lines() -> Vec<String> {
        let lines = |warned: &Warned| {
            warned
                .text
                .lines()
                .map(|line| line.trim().to_owned())
                .collect()
        };
        lines(&WARNED.lock())
    }

    /// Begins another part, and returns the number of warnings before it.
    pub(crate) fn begin_part() -> usize {
        let mut warned = WARNED.lock();
        warned.part = warned.text.len();
        warned.text.lines().count()
    }
}

impl Write for WarningLog {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut warned = WARNED.lock();
        let line = String::from_utf8_lossy(bytes);
        let mut lines = warned.text[warned.part..].lines();
        let is_known = lines.any(|known| known == line.trim_end());
        if warned.text.len() < MAX_HELD_BYTES && !is_known {
            warned.text.push_str(&line);
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Warnings that are held back, and the place in them of the first that was not yet taken.
static HELD: Mutex<Option<(Vec<u8>, usize)>> = Mutex::new(None);

/// Largest size of warnings that are held back, bytes.
const MAX_HELD_BYTES: usize = 1 << 16;

impl Warnings {
    /// From now on warnings are held back.
    pub(crate) fn hold() {
        HELD.lock().get_or_insert_default();
    }

    /// Writes what was held back, and from now on everything at once.
    pub(crate) fn release() {
        if let Some((held, _)) = HELD.lock().take() {
            // A closed standard error is ignored.
            let _ = io::stderr().write_all(&held);
        }
    }

    /// The last line that was held back since this was asked last.
    pub(crate) fn take_last() -> Option<String> {
        let mut held = HELD.lock();
        let (held, taken) = held.as_mut()?;
        let new = String::from_utf8_lossy(&held[std::mem::replace(taken, held.len())..]);
        new.lines().last().map(plain)
    }
}

/// The line without the escape sequences of its colours.
fn plain(line: &str) -> String {
    let mut characters = line.chars();
    let mut plain = String::new();
    while let Some(c) = characters.next() {
        if c == '\u{1b}' {
            // Up to the letter that ends the sequence.
            let _ = characters.find(char::is_ascii_alphabetic);
        } else {
            plain.push(c);
        }
    }
    plain
}

impl Write for Warnings {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match &mut *HELD.lock() {
            Some((held, _)) => {
                let room = MAX_HELD_BYTES.saturating_sub(held.len());
                held.extend_from_slice(&bytes[..bytes.len().min(room)]);
                Ok(bytes.len())
            }
            None => {
                let mut written = WRITTEN.lock();
                if written.is_new(bytes) {
                    io::stderr().write_all(bytes)?;
                }
                Ok(bytes.len())
            }
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        io::stderr().flush()
    }
}

/// Largest number of gaps and of losses that are listed one by one.
pub(crate) const MAX_LISTED: usize = 5;

/// Parts of a file that cannot be read, a line each.
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
    listed(losses.iter(), part)
}

/// The first [`MAX_LISTED`] as lines, and how many more there are.
pub(crate) fn listed<T>(
    all: impl ExactSizeIterator<Item = T>,
    line: impl Fn(T) -> String,
) -> Vec<String> {
    let more = all.len().saturating_sub(MAX_LISTED);
    let mut lines: Vec<_> = all.take(MAX_LISTED).map(line).collect();
    if more > 0 {
        lines.push(format!("           and {more} more; --json lists them"));
    }
    lines
}

/// Messages that the file's own summary promises and it does not hold.
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
const MIN_WIDTH: usize = 40;

/// Columns of standard output: the terminal's, else those of the variable `COLUMNS`, or 100.
pub(crate) fn width() -> usize {
    let size = terminal_size::terminal_size_of(io::stdout());
    let own = size.map(|(columns, _)| usize::from(columns.0));
    let named = || std::env::var("COLUMNS").ok()?.parse().ok();
    own.or_else(named)
        .map_or(PIPED, |columns| columns.max(MIN_WIDTH))
}

/// Form of tables on standard output: with bars and colours on a terminal, unless `NO_COLOR` is
/// set.
pub(crate) fn style() -> TerminalStyle {
    let is_set = |name| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    let is_dumb = std::env::var_os("TERM").is_some_and(|term| term == "dumb");
    TerminalStyle {
        width: width(),
        is_rich: io::stdout().is_terminal() && !is_set("NO_COLOR") && !is_dumb,
    }
}

/// The place of a report, and the commands that show more of it.
pub(crate) fn report_lines(named: &Path) -> String {
    let (page, folder) = (named.join("index.html"), named.display());
    let viewer = format!("viewer   svl view {folder}\n");
    let viewer = match report_runs(named).is_empty() {
        false => viewer,
        true => String::new(),
    };
    format!(
        "report   {}\n{viewer}more     --columns all, --explain, --json\n",
        page.display()
    )
}

/// Last column of the help below the options, which clap does not break again.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_warning_is_written_once() {
        let mut written = WrittenOnce(BTreeSet::new());
        let news = ["first", "second", "first"].map(|text| written.is_new(text.as_bytes()));
        assert_eq!(news, [true, true, false]);
        WarningLog.write_all(b" a warning\n").unwrap();
        WarningLog.write_all(b" a warning\n").unwrap();
        let lines = WarningLog::lines();
        assert_eq!(lines.iter().filter(|line| *line == "a warning").count(), 1);
    }

    #[test]
    fn a_warning_that_is_held_back_is_shown_without_its_colours() {
        assert_eq!(Warnings::take_last(), None);
        Warnings::hold();
        write!(Warnings, "first\n\u{1b}[33m WARN\u{1b}[0m second\n").unwrap();
        assert_eq!(Warnings::take_last().unwrap(), " WARN second");
        assert_eq!(Warnings::take_last(), None);
        Warnings::release();
    }
}
