//! Standard output: text and JSON.

use anyhow::Context;
use std::io::{self, IsTerminal, Write};
use std::path::Path;
use svl::report::table::TerminalStyle;
use svl::sink::report_runs;
use svl::{printable, printable_line};

/// Prints to standard output, with text from outside escaped. A reader that went away (`| head`)
/// has read enough: no error.
pub(crate) fn print(text: &str) -> anyhow::Result<()> {
    let text = style().printable(text);
    match io::stdout().lock().write_all(text.as_bytes()) {
        Err(e) if e.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        result => result.context("standard output"),
    }
}

/// Prints a line to standard error.
pub(crate) fn print_error(line: impl std::fmt::Display) {
    write_error("", &format!("{line}\n"));
}

/// Writes svl's own `mark`, then a text, in which text from outside is escaped, to standard error.
/// Does nothing if that is closed.
pub(crate) fn write_error(mark: &str, text: &str) {
    let _ = write!(io::stderr(), "{mark}{}", printable(text));
}

/// Prints a value as JSON.
pub(crate) fn print_json(value: &impl serde::Serialize) -> anyhow::Result<()> {
    print(&(serde_json::to_string_pretty(value)? + "\n"))
}

/// Prints a value as JSON, or else as that text.
pub(crate) fn print_value<E>(
    is_json: bool,
    value: &impl serde::Serialize,
    text: impl FnOnce() -> Result<String, E>,
) -> anyhow::Result<()>
where
    anyhow::Error: From<E>,
{
    if is_json {
        print_json(value)
    } else {
        print(&text()?)
    }
}

/// A number of bytes in words.
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

/// True if a terminal may show colours: it can, and `NO_COLOR` is not set.
pub(crate) fn allows_color() -> bool {
    let is_unwanted = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
    let is_dumb = std::env::var_os("TERM").is_some_and(|term| term == "dumb");
    !is_unwanted && !is_dumb
}

/// Form of tables on standard output: with bars and colours on a terminal that may show them.
pub(crate) fn style() -> TerminalStyle {
    TerminalStyle {
        width: width(),
        is_rich: io::stdout().is_terminal() && allows_color(),
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
    let page = page.display();
    format!("report   {page}\n{viewer}more     --columns all, --explain, --json\n")
}

/// Last column of the help below the options, which clap does not break again.
pub(crate) const LAST_COLUMN: usize = 78;

/// `head`, and from a column on the words of `text`, escaped and broken at the last column.
pub(crate) fn wrapped(head: &str, column: usize, text: &str, last: usize) -> String {
    let mut lines = vec![format!("{head:<column$}")];
    for word in printable_line(text).split(' ') {
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
