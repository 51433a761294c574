//! The progress bars of long work, and Ctrl-C.

use super::terminal::print_error;
use indicatif::{ProgressBar, ProgressFinish, ProgressState, ProgressStyle};
use std::fmt::Write;
use std::io::IsTerminal;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};
use svl::console::{Bar, Console, Unit};
use svl::printable_line;

static HANDLER: OnceLock<()> = OnceLock::new();

/// Time after the first interrupt within which others are the same one: `timeout` sends it to svl
/// and to its group.
const SAME_INTERRUPT: Duration = Duration::from_millis(200);

/// True once Ctrl-C (or SIGTERM) came. The first asks the work to end orderly; the next one ends
/// the program at once.
pub(crate) fn interrupted() -> bool {
    svl::interrupt::requested()
}

/// Begins to listen for Ctrl-C.
pub(crate) fn listen_for_interrupt() {
    HANDLER.get_or_init(|| {
        let mut first: Option<Instant> = None;
        let handler = move || {
            svl::interrupt::request();
            if first.get_or_insert_with(Instant::now).elapsed() > SAME_INTERRUPT {
                super::log::finish();
                std::process::exit(130);
            }
        };
        // Without a handler Ctrl-C ends the program at once, which is no worse than a power cut:
        // files survive that.
        if let Err(error) = ctrlc::set_handler(handler) {
            tracing::warn!("Ctrl-C will end svl at once: {error}");
        }
    });
}

/// The terminal; without bars and notes if `quiet`.
pub(crate) struct Terminal {
    pub(crate) quiet: bool,
}

impl Console for Terminal {
    fn bar(&self, work: &str, unit: Unit, total: Option<u64>) -> Box<dyn Bar> {
        listen_for_interrupt();
        let bar = if self.quiet {
            ProgressBar::hidden()
        } else {
            total.map_or_else(ProgressBar::no_length, ProgressBar::new)
        };
        let form = match (unit, total) {
            (Unit::Drives, _) => "{bar:16} {pos:>6}/{len} drives {eta:>4} left, {msg} pairs",
            (Unit::Epochs, _) => "{bar:12} {pos:>4}/{len} epochs {eta:>3} left  {msg}",
            (Unit::Rows, _) => "{spinner} {pos:>6} rows {per_sec:>7}{msg}",
            (Unit::Pairs, Some(_)) => {
                "{bar:16} {pos:>6}/{len} pairs {per_sec:>7} {eta:>3} left{msg}"
            }
            (Unit::Pairs, None) => "{spinner} {pos:>6} pairs {per_sec:>7}{msg}",
        };
        let rate = |state: &ProgressState, w: &mut dyn Write| {
            let _ = write!(w, "{:.0}/s", state.per_sec());
        };
        // The templates above are constants, which the tests run.
        let style = ProgressStyle::with_template(&format!("{{prefix:<24!}} {form}"));
        bar.set_style(style.expect("a valid template").with_key("per_sec", rate));
        bar.set_prefix(printable_line(work));
        Box::new(TerminalBar {
            log: (!self.quiet && !std::io::stderr().is_terminal())
                .then(|| ProgressLog::new(work, unit, total)),
            bar: bar.with_finish(ProgressFinish::AndClear),
        })
    }

    fn note(&self, line: &str) {
        if !self.quiet {
            print_error(line);
        }
    }
}

struct TerminalBar {
    bar: ProgressBar,
    /// Progress for a standard error that is no terminal.
    log: Option<ProgressLog>,
}

impl TerminalBar {
    fn report(&self) {
        let line = |log: &ProgressLog| log.line(self.bar.position(), log.began.elapsed());
        if let Some(line) = self.log.as_ref().and_then(line) {
            print_error(line);
        }
    }
}

impl Bar for TerminalBar {
    fn set(&self, done: u64) {
        self.bar.set_position(done);
        self.report();
    }

    fn step(&self) {
        self.bar.inc(1);
        self.report();
    }

    fn show(&self, text: String) {
        if !self.bar.is_hidden() {
            self.bar.set_message(printable_line(&text));
        }
    }

    fn suspend(&self, print: &mut dyn FnMut()) {
        self.bar.suspend(print);
    }
}

/// Time that work takes before its progress is logged: short work is done before anyone asks.
const LOGGED_FROM: Duration = Duration::from_secs(10);
/// Time between the lines of work without a known end.
const LOGGED_EVERY: Duration = Duration::from_secs(60);

/// The progress of long work in a log: a line for every 10 %, or for every minute where the end is
/// unknown.
struct ProgressLog {
    work: String,
    unit: Unit,
    total: Option<u64>,
    began: Instant,
    /// Tenths, or minutes, that were logged.
    logged: AtomicU64,
}

impl ProgressLog {
    fn new(work: &str, unit: Unit, total: Option<u64>) -> Self {
        Self {
            work: work.to_owned(),
            unit,
            total: total.filter(|total| *total > 0),
            began: Instant::now(),
            logged: AtomicU64::new(0),
        }
    }

    /// The line that is due with so many steps done after that time.
    fn line(&self, done: u64, after: Duration) -> Option<String> {
        let reached = match self.total {
            Some(total) => 10 * done / total,
            None => after.as_secs() / LOGGED_EVERY.as_secs(),
        };
        let is_new = || reached > self.logged.fetch_max(reached, Ordering::Relaxed);
        if after < LOGGED_FROM || !is_new() {
            return None;
        }
        let (work, unit) = (&self.work, self.unit.words());
        Some(match self.total {
            Some(total) => format!("{work}: {} %, {done} of {total} {unit}", 10 * reached),
            None => format!("{work}: {done} {unit}"),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_work_logs_each_tenth_once_and_short_work_nothing() {
        let log = ProgressLog::new("match arena", Unit::Pairs, Some(200));
        let lines = |seconds| {
            let line = |done| log.line(done, Duration::from_secs(seconds));
            [0, 19, 20, 39, 61].map(line)
        };
        assert!(lines(9).iter().all(Option::is_none));
        let tenth = Some("match arena: 10 %, 20 of 200 pairs".to_owned());
        let third = Some("match arena: 30 %, 61 of 200 pairs".to_owned());
        assert_eq!(lines(10), [None, None, tenth, None, third]);
        assert!(lines(20).iter().all(Option::is_none));
    }

    #[test]
    fn work_without_an_end_logs_each_minute() {
        let log = ProgressLog::new("record", Unit::Pairs, None);
        let lines = [59, 60, 119, 121].map(|seconds| log.line(7, Duration::from_secs(seconds)));
        let line = Some("record: 7 pairs".to_owned());
        assert_eq!(lines, [None, line.clone(), None, line]);
    }
}
