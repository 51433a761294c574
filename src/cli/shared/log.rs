//! The log of a command: its notices, and lines on standard error, which are held back while a tool
//! has the screen.

use super::terminal::write_error;
use parking_lot::Mutex;
use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, IsTerminal};
use std::sync::LazyLock;
use svl::notice::{Notice, NoticeLog, grouped, name_and_kind};
use svl::printable_line;
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::Layer;
use tracing_subscriber::layer::Context;

/// Takes the events of svl: warnings as notices, also those that `--quiet` does not print, and as
/// lines those up to a level.
pub(crate) struct NoticeLayer(pub(crate) Level);

impl<S: Subscriber> Layer<S> for NoticeLayer {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let level = *event.metadata().level();
        let notice = Notice::from_event(event);
        if level <= self.0 {
            LINES.lock().add((level, notice.to_string()));
        }
        if level <= Level::WARN {
            NoticeLog::current().add(notice);
        }
    }
}

/// The lines of this process.
static LINES: LazyLock<Mutex<Lines>> = LazyLock::new(Mutex::default);

/// Lines that are held back or remembered; later ones are lost, or may be written twice.
const MAX_REMEMBERED: usize = 1000;

type LogLine = (Level, String);

/// Lines, each of which is written once.
#[derive(Default)]
struct Lines {
    /// Lines that are held back, and the number of them that were taken.
    held: Option<(Vec<LogLine>, usize)>,
    written: BTreeSet<LogLine>,
    /// The first name of each kind of warnings.
    kinds: BTreeMap<String, String>,
    /// Warnings of other names, which the end of the command groups.
    later: Vec<String>,
}

impl Lines {
    fn add(&mut self, line: LogLine) {
        if let Some((held, _)) = &mut self.held {
            if held.len() < MAX_REMEMBERED {
                held.push(line);
            }
        } else if self.is_new(&line) {
            if self.is_later(&line) {
                self.later.push(line.1);
            } else {
                write(&line);
            }
        }
    }

    /// True for a warning of a known kind with another name than the first.
    fn is_later(&mut self, (level, text): &LogLine) -> bool {
        let Some((name, kind)) = name_and_kind(text).filter(|_| *level == Level::WARN) else {
            return false;
        };
        let has_room = self.kinds.len().max(self.later.len()) < MAX_REMEMBERED;
        has_room && self.kinds.entry(kind).or_insert_with(|| name.to_owned()) != name
    }

    /// True at the first call with this line.
    fn is_new(&mut self, line: &LogLine) -> bool {
        self.written.len() >= MAX_REMEMBERED || self.written.insert(line.clone())
    }

    fn take_last(&mut self) -> Option<String> {
        let (held, taken) = self.held.as_mut()?;
        let new = &held[std::mem::replace(taken, held.len())..];
        new.last()
            .map(|line| mark(line.0, false) + &printable_line(&line.1))
    }
}

/// From now on lines are held back.
pub(crate) fn hold() {
    LINES.lock().held.get_or_insert_default();
}

/// Writes what was held back, and from now on everything at once.
pub(crate) fn release() {
    let mut lines = LINES.lock();
    let (held, _) = lines.held.take().unwrap_or_default();
    held.into_iter().for_each(|line| lines.add(line));
}

/// Writes the warnings that are grouped.
pub(crate) fn finish() {
    let later = std::mem::take(&mut LINES.lock().later);
    let lines = grouped(later).into_iter();
    lines.for_each(|line| write(&(Level::WARN, line)));
}

fn write((level, text): &LogLine) {
    let mark = mark(*level, io::stderr().is_terminal());
    write_error(&mark, &(printable_line(text) + "\n"));
}

/// The last line that was held back since this was asked last.
pub(crate) fn take_last() -> Option<String> {
    LINES.lock().take_last()
}

/// The level before a line.
fn mark(level: Level, is_rich: bool) -> String {
    let color = match level {
        Level::ERROR => 31,
        Level::WARN => 33,
        Level::INFO => 32,
        _ => 34,
    };
    match is_rich {
        true => format!("\u{1b}[{color}m{level:>5}\u{1b}[0m "),
        false => format!("{level:>5} "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn warning(words: &str) -> LogLine {
        (Level::WARN, words.to_owned())
    }

    #[test]
    fn a_line_is_written_once() {
        let mut lines = Lines::default();
        let news = ["first", "second", "first"].map(|words| lines.is_new(&warning(words)));
        assert_eq!(news, [true, true, false]);
    }

    #[test]
    fn warnings_of_other_names_are_grouped_at_the_end() {
        let mut lines = Lines::default();
        let texts = ["a: 1 lost", "a: 2 lost", "b: 3 lost", "b: none", "lost"];
        let later = texts.map(|text| lines.is_later(&warning(text)));
        assert_eq!(later, [false, false, true, false, false]);
        assert!(!lines.is_later(&(Level::INFO, "b: 4 lost".to_owned())));
    }

    #[test]
    fn the_last_line_that_is_held_back_is_taken_once() {
        let mut lines = Lines {
            held: Some(Default::default()),
            ..Lines::default()
        };
        assert_eq!(lines.take_last(), None);
        lines.add(warning("first"));
        lines.add(warning("second"));
        assert_eq!(lines.take_last().unwrap(), " WARN second");
        assert_eq!(lines.take_last(), None);
    }
}
